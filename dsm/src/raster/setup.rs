//! First stage: triangles and points in pixel coordinates, culled, clipped and sorted into bands of rows.

use super::mesh::Mesh;
use super::renderer::RenderOptions;
use super::scene::{Scene, Splats};
use crate::Pose;
use crate::camera::CameraModel;
use nalgebra::{Matrix3, Vector3};

/// Rows of a band: its share of the visibility buffer fits the second-level cache.
pub(super) const BAND_ROWS: usize = 16;

/// A vertex in the camera frame and in the image.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vertex {
    /// Camera frame, metres.
    pub position: Vector3<f32>,
    /// Camera frame.
    pub normal: Vector3<f32>,
    pub uv: [f32; 2],
    /// Pixels; meaningful only in front of the near plane.
    pub x: f32,
    pub y: f32,
    /// 1/m.
    pub inverse_z: f32,
}

/// A function that is linear over the image: value at the triangle's origin pixel and slopes per pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Plane {
    pub at_origin: f32,
    pub per_column: f32,
    pub per_row: f32,
}

impl Plane {
    #[inline(always)]
    pub(super) fn at(&self, column: f32, row: f32) -> f32 {
        self.at_origin + column * self.per_column + row * self.per_row
    }
}

/// A triangle ready to be filled. The planes count columns and rows from the origin pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Corners in pixels from the topmost to the lowest.
    pub corners: [[f32; 2]; 3],
    /// Whether the middle corner lies left of the edge from the topmost to the lowest.
    pub middle_is_left: bool,
    /// Whether the camera sees the side that faces inward (only kept for open meshes).
    pub back: bool,
    pub origin: [i32; 2],
    pub first_row: u32,
    pub end_row: u32,
    pub inverse_z: Plane,
    pub inverse_z_min: f32,
    pub inverse_z_max: f32,
    /// Barycentric coordinates of the second and third vertex, divided by z.
    pub second: Plane,
    pub third: Plane,
    /// Texture area per pixel area, times the cube of the inverse depth (uv squared per pixel squared per cubic metre).
    pub uv_density: f32,
    pub vertices: [u32; 3],
    pub instance: u32,
}

/// A point ready to be filled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub x: f32,
    pub y: f32,
    pub radius: f32,
    pub inverse_z: f32,
    pub color: [u8; 3],
    pub label: u32,
}

/// The output of the stage; its buffers are used again.
#[derive(Debug, Default)]
pub(super) struct Prepared {
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<Triangle>,
    pub discs: Vec<Disc>,
    /// Triangles, then discs (numbered on from the triangles), that touch each band, in rising order.
    pub bands: Vec<Vec<u32>>,
}

/// The image bounds and planes of one view.
struct View<'a> {
    model: &'a CameraModel,
    focal: [f32; 2],
    center: [f32; 2],
    near_m: f32,
    far_m: f32,
    /// Inward normals of the four side planes of the frustum, camera frame.
    sides: [Vector3<f32>; 4],
}

impl Prepared {
    /// Fills the buffers for one view of the scene.
    pub(super) fn prepare(
        &mut self,
        scene: &Scene,
        model: &CameraModel,
        camera_from_world: &Pose,
        options: &RenderOptions,
    ) {
        self.vertices.clear();
        self.triangles.clear();
        self.discs.clear();
        self.bands.resize_with((model.height as usize).div_ceil(BAND_ROWS), Vec::new);
        self.bands.iter_mut().for_each(Vec::clear);
        let view = View::new(model, options);
        for (number, instance) in scene.instances.iter().enumerate() {
            let mesh = scene.mesh(instance.mesh);
            let camera_from_mesh = camera_from_world * instance.world_from_mesh;
            let rotation = camera_from_mesh.rotation.to_rotation_matrix().into_inner().cast::<f32>();
            let translation = camera_from_mesh.translation.vector.cast::<f32>();
            let (center, radius) = mesh.bounding_sphere();
            if let Some(place) = view.place_sphere(&(rotation * center.coords + translation), radius) {
                self.add_mesh(&view, mesh, number as u32, &rotation, &translation, place);
            }
        }
        for splats in &scene.splats {
            self.add_splats(&view, splats, camera_from_world);
        }
    }

    fn add_mesh(
        &mut self,
        view: &View,
        mesh: &Mesh,
        instance: u32,
        rotation: &Matrix3<f32>,
        translation: &Vector3<f32>,
        place: SpherePlace,
    ) {
        let first = self.vertices.len() as u32;
        let corners = mesh.positions().iter().zip(mesh.normals()).zip(mesh.uvs());
        self.vertices.extend(corners.map(|((position, normal), &uv)| {
            view.vertex(rotation * position.coords + translation, rotation * normal, uv)
        }));
        for triangle in mesh.indices() {
            let corners = triangle.map(|i| first + i);
            if place == SpherePlace::BeyondNear {
                self.add_triangle(view, corners, instance, mesh.is_closed());
            } else {
                self.add_clipped(view, corners, instance, mesh.is_closed());
            }
        }
    }

    /// Cuts off what is nearer than the near plane: nothing, one or two triangles remain.
    fn add_clipped(&mut self, view: &View, corners: [u32; 3], instance: u32, closed: bool) {
        let inside = corners.map(|i| self.vertices[i as usize].position.z >= view.near_m);
        let mut polygon = [0_u32; 4];
        let mut count = 0;
        for i in 0..3 {
            let j = (i + 1) % 3;
            if inside[i] {
                polygon[count] = corners[i];
                count += 1;
            }
            if inside[i] != inside[j] {
                // From the visible end, so that the neighbour across the edge gets the same point.
                let (from, to) = if inside[i] { (corners[i], corners[j]) } else { (corners[j], corners[i]) };
                polygon[count] = self.vertices.len() as u32;
                count += 1;
                let cut = view.cut(&self.vertices[from as usize], &self.vertices[to as usize]);
                self.vertices.push(cut);
            }
        }
        for i in 2..count {
            self.add_triangle(view, [polygon[0], polygon[i - 1], polygon[i]], instance, closed);
        }
    }

    fn add_triangle(&mut self, view: &View, vertices: [u32; 3], instance: u32, closed: bool) {
        let corners = vertices.map(|i| self.vertices[i as usize]);
        if let Some(triangle) = find_triangle(view, &corners, vertices, instance, closed) {
            let number = self.triangles.len() as u32;
            self.add_to_bands(number, triangle.first_row, triangle.end_row);
            self.triangles.push(triangle);
        }
    }

    fn add_splats(&mut self, view: &View, splats: &Splats, camera_from_world: &Pose) {
        let rotation = camera_from_world.rotation.to_rotation_matrix().into_inner().cast::<f32>();
        let translation = camera_from_world.translation.vector.cast::<f32>();
        for (point, &color) in splats.points_in_world.iter().zip(&splats.colors) {
            let p = rotation * point.coords + translation;
            if !(p.z >= view.near_m && p.z <= view.far_m) {
                continue;
            }
            let inverse_z = 1.0 / p.z;
            let (x, y) =
                (view.focal[0] * p.x * inverse_z + view.center[0], view.focal[1] * p.y * inverse_z + view.center[1]);
            // With 0.71 pixels a disc holds at least one pixel centre.
            let radius = (splats.radius_m * view.focal[0] * inverse_z).max(0.71);
            let (width, height) = (view.model.width as f32, view.model.height as f32);
            if x + radius < 0.0 || x - radius > width || y + radius < 0.0 || y - radius > height {
                continue;
            }
            let number = (self.triangles.len() + self.discs.len()) as u32;
            let (first_row, end_row) =
                (pixel_from(y - radius, view.model.height), pixel_from(y + radius, view.model.height));
            self.add_to_bands(number, first_row, end_row);
            self.discs.push(Disc { x, y, radius, inverse_z, color, label: splats.label });
        }
    }

    fn add_to_bands(&mut self, number: u32, first_row: u32, end_row: u32) {
        if first_row < end_row {
            for band in first_row as usize / BAND_ROWS..=(end_row as usize - 1) / BAND_ROWS {
                self.bands[band].push(number);
            }
        }
    }
}

/// Where a visible bounding sphere lies.
#[derive(Clone, Copy, PartialEq)]
enum SpherePlace {
    BeyondNear,
    CrossesNear,
}

impl<'a> View<'a> {
    fn new(model: &'a CameraModel, options: &RenderOptions) -> Self {
        let (left, right) = (-model.cx / model.fx, (f64::from(model.width) - model.cx) / model.fx);
        let (top, bottom) = (-model.cy / model.fy, (f64::from(model.height) - model.cy) / model.fy);
        let side = |x: f64, y: f64, z: f64| Vector3::new(x, y, z).normalize().cast::<f32>();
        Self {
            model,
            focal: [model.fx as f32, model.fy as f32],
            center: [model.cx as f32, model.cy as f32],
            near_m: options.near_m,
            far_m: options.far_m,
            sides: [side(1.0, 0.0, -left), side(-1.0, 0.0, right), side(0.0, 1.0, -top), side(0.0, -1.0, bottom)],
        }
    }

    /// `None` when no part of the sphere can be seen.
    fn place_sphere(&self, center: &Vector3<f32>, radius: f32) -> Option<SpherePlace> {
        let outside = center.z + radius < self.near_m
            || center.z - radius > self.far_m
            || self.sides.iter().any(|side| side.dot(center) < -radius);
        let nearest_m = center.z - radius;
        (!outside).then_some(if nearest_m > self.near_m { SpherePlace::BeyondNear } else { SpherePlace::CrossesNear })
    }

    #[inline]
    fn vertex(&self, position: Vector3<f32>, normal: Vector3<f32>, uv: [f32; 2]) -> Vertex {
        let inverse_z = 1.0 / position.z;
        Vertex {
            position,
            normal,
            uv,
            x: self.focal[0] * position.x * inverse_z + self.center[0],
            y: self.focal[1] * position.y * inverse_z + self.center[1],
            inverse_z,
        }
    }

    /// The point where the edge from a visible to a hidden vertex meets the near plane.
    fn cut(&self, visible: &Vertex, hidden: &Vertex) -> Vertex {
        let share = (visible.position.z - self.near_m) / (visible.position.z - hidden.position.z);
        let mut position = visible.position + (hidden.position - visible.position) * share;
        position.z = self.near_m;
        let normal = visible.normal + (hidden.normal - visible.normal) * share;
        let uv = std::array::from_fn(|i| visible.uv[i] + (hidden.uv[i] - visible.uv[i]) * share);
        self.vertex(position, normal, uv)
    }
}

/// The first pixel whose centre lies at or after the coordinate, within 0 to `limit`.
#[inline(always)]
pub(super) fn pixel_from(coordinate: f32, limit: u32) -> u32 {
    let start = (coordinate - 0.5).max(0.0).min(limit as f32);
    let whole = start as u32;
    whole + u32::from(start > whole as f32)
}

/// The triangle in the image; `None` when it covers no pixel or faces away.
fn find_triangle(
    view: &View,
    corners: &[Vertex; 3],
    vertices: [u32; 3],
    instance: u32,
    closed: bool,
) -> Option<Triangle> {
    let [a, b, c] = corners;
    let (width, height) = (view.model.width, view.model.height);
    let first_row = pixel_from(min3(a.y, b.y, c.y), height);
    let end_row = pixel_from(max3(a.y, b.y, c.y), height);
    let first_column = pixel_from(min3(a.x, b.x, c.x), width);
    let end_column = pixel_from(max3(a.x, b.x, c.x), width);
    if first_row >= end_row || first_column >= end_column {
        return None;
    }
    // In f64: a triangle cut at the near plane may reach far outside the image.
    let (ax, ay) = (f64::from(a.x), f64::from(a.y));
    let (bx, by) = (f64::from(b.x) - ax, f64::from(b.y) - ay);
    let (cx, cy) = (f64::from(c.x) - ax, f64::from(c.y) - ay);
    let area = bx * cy - cx * by;
    // Rows run down, so a counter-clockwise triangle has a negative area.
    let back = area > 0.0;
    if area == 0.0 || (back && closed) {
        return None;
    }
    let (dx, dy) = (f64::from(first_column) + 0.5 - ax, f64::from(first_row) + 0.5 - ay);
    let inverse_area = 1.0 / area;
    let plane = |at_a: f32, at_b: f32, at_c: f32| {
        let (rise_b, rise_c) = (f64::from(at_b) - f64::from(at_a), f64::from(at_c) - f64::from(at_a));
        let per_column = (rise_b * cy - rise_c * by) * inverse_area;
        let per_row = (rise_c * bx - rise_b * cx) * inverse_area;
        let at_origin = f64::from(at_a) + per_column * dx + per_row * dy;
        Plane { at_origin: at_origin as f32, per_column: per_column as f32, per_row: per_row as f32 }
    };
    let uv_area = (b.uv[0] - a.uv[0]) * (c.uv[1] - a.uv[1]) - (c.uv[0] - a.uv[0]) * (b.uv[1] - a.uv[1]);
    let [top, middle, bottom] = sorted_by_row([[a.x, a.y], [b.x, b.y], [c.x, c.y]]);
    let along = f64::from(middle[1] - top[1]) * f64::from(bottom[0] - top[0]);
    let across = f64::from(middle[0] - top[0]) * f64::from(bottom[1] - top[1]);
    Some(Triangle {
        corners: [top, middle, bottom],
        middle_is_left: across < along,
        back,
        origin: [first_column as i32, first_row as i32],
        first_row,
        end_row,
        inverse_z: plane(a.inverse_z, b.inverse_z, c.inverse_z),
        inverse_z_min: min3(a.inverse_z, b.inverse_z, c.inverse_z),
        inverse_z_max: max3(a.inverse_z, b.inverse_z, c.inverse_z),
        second: plane(0.0, b.inverse_z, 0.0),
        third: plane(0.0, 0.0, c.inverse_z),
        uv_density: (uv_area * a.inverse_z * b.inverse_z * c.inverse_z * inverse_area as f32).abs(),
        vertices,
        instance,
    })
}

fn sorted_by_row([mut a, mut b, mut c]: [[f32; 2]; 3]) -> [[f32; 2]; 3] {
    if b[1] < a[1] {
        (a, b) = (b, a);
    }
    if c[1] < b[1] {
        (b, c) = (c, b);
        if b[1] < a[1] {
            (a, b) = (b, a);
        }
    }
    [a, b, c]
}

fn min3(a: f32, b: f32, c: f32) -> f32 {
    let least = if b < a { b } else { a };
    if c < least { c } else { least }
}

fn max3(a: f32, b: f32, c: f32) -> f32 {
    let most = if b > a { b } else { a };
    if c > most { c } else { most }
}
