//! First stage: triangles and points in pixel coordinates, culled, clipped and sorted into bands of rows.

use super::mesh::Mesh;
use super::renderer::RenderOptions;
use super::scene::{Scene, Splats};
use super::triangle::{Corner, Culling, Outline, Shares, Triangle, pixel_from};
use crate::Pose;
use crate::camera::CameraModel;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a band: its share of the visibility buffer fits the second-level cache.
pub(super) const BAND_ROWS: usize = 16;
/// The instances are prepared in so many parts, side by side. A fixed number: the order of triangles is that of the scene
/// for any number of threads.
const PARTS: usize = 8;
/// A [`Seen`] triangle keeps its index in the bits below, the number of its part above.
const PART_SHIFT: u32 = 28;
const DISC: u32 = 1 << 31;

/// What a pixel of the visibility buffer shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen(u32);

/// The thing that is seen.
pub(super) enum Thing {
    Nothing,
    Triangle { part: usize, index: usize },
    Disc { index: usize },
}

impl Seen {
    /// Nothing covers the pixel.
    pub(super) const NOTHING: Self = Self(u32::MAX);

    #[inline(always)]
    pub(super) fn triangle(part: usize, index: usize) -> Self {
        Self((part as u32) << PART_SHIFT | index as u32)
    }

    #[inline(always)]
    pub(super) fn disc(index: usize) -> Self {
        Self(DISC | index as u32)
    }

    /// The other one where the condition holds. In bits, because the compiler makes a choice between places in memory of
    /// a choice between values, which is much slower.
    #[inline(always)]
    pub(super) fn replaced_if(self, condition: bool, other: Self) -> Self {
        let mask = u32::from(condition).wrapping_neg();
        Self(other.0 & mask | self.0 & !mask)
    }

    /// Whether it is something that light falls on.
    #[inline(always)]
    pub(super) fn is_triangle(self) -> bool {
        self.0 < DISC
    }

    #[inline(always)]
    pub(super) fn thing(self) -> Thing {
        match self.0 {
            u32::MAX => Thing::Nothing,
            disc if disc >= DISC => Thing::Disc { index: (disc & !DISC) as usize },
            triangle => Thing::Triangle {
                part: (triangle >> PART_SHIFT) as usize,
                index: (triangle & ((1 << PART_SHIFT) - 1)) as usize,
            },
        }
    }
}

/// A vertex in the camera frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vertex {
    /// Camera frame, metres.
    pub position: Vector3<f32>,
    /// Camera frame.
    pub normal: Vector3<f32>,
    pub uv: [f32; 2],
}

/// What shading needs to know of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    pub shares: Shares,
    /// Texture area per pixel area, times the cube of the inverse depth (uv squared per pixel squared per cubic metre).
    pub uv_density: f32,
    /// Whether all corners have the same normal.
    pub flat: bool,
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

/// Some of the instances.
#[derive(Debug, Default)]
pub(super) struct Part {
    corners: Vec<Corner>,
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<Triangle>,
    /// As many as triangles.
    pub surfaces: Vec<Surface>,
    /// Triangles that touch each band, in rising order.
    pub bands: Vec<Vec<u32>>,
}

/// The output of the stage; its buffers are used again.
#[derive(Debug, Default)]
pub(super) struct Prepared {
    visible: Vec<Visible>,
    pub parts: [Part; PARTS],
    pub discs: Vec<Disc>,
    /// Discs that touch each band, in rising order.
    pub disc_bands: Vec<Vec<u32>>,
}

/// An instance of which something may be seen.
#[derive(Clone, Copy, Debug)]
struct Visible {
    instance: u32,
    /// Mesh to camera frame.
    rotation: Matrix3<f32>,
    translation: Vector3<f32>,
    place: SpherePlace,
    /// Triangles of all instances before this one.
    triangles_before: usize,
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
        let view = View::new(model, options);
        let bands = (model.height as usize).div_ceil(BAND_ROWS);
        self.visible.clear();
        let mut triangles = 0;
        for (number, instance) in scene.instances.iter().enumerate() {
            let mesh = scene.mesh(instance.mesh);
            let camera_from_mesh = camera_from_world * instance.world_from_mesh;
            let rotation = camera_from_mesh.rotation.to_rotation_matrix().into_inner().cast::<f32>();
            let translation = camera_from_mesh.translation.vector.cast::<f32>();
            let (center, radius) = mesh.bounding_sphere();
            if let Some(place) = view.place_sphere(&(rotation * center.coords + translation), radius) {
                let instance = number as u32;
                self.visible.push(Visible { instance, rotation, translation, place, triangles_before: triangles });
                triangles += mesh.indices().len();
            }
        }
        // Each part takes about as many triangles.
        let visible = &self.visible;
        let first_of = |part: usize| visible.partition_point(|v| v.triangles_before * PARTS < part * triangles);
        let shares: [Range<usize>; PARTS] = std::array::from_fn(|part| {
            if part + 1 < PARTS { first_of(part)..first_of(part + 1) } else { first_of(part)..visible.len() }
        });
        self.parts.par_iter_mut().zip(shares).for_each(|(part, share)| {
            part.clear(bands);
            for visible in &visible[share] {
                let mesh = scene.mesh(scene.instances[visible.instance as usize].mesh);
                part.add_mesh(&view, mesh, visible);
            }
        });
        self.discs.clear();
        self.disc_bands.resize_with(bands, Vec::new);
        self.disc_bands.iter_mut().for_each(Vec::clear);
        for splats in &scene.splats {
            self.add_splats(&view, splats, camera_from_world);
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
            let Corner { x, y, nearness } = view.corner(&p);
            // With 0.71 pixels a disc holds at least one pixel centre.
            let radius = (splats.radius_m * view.focal[0] * nearness).max(0.71);
            let (width, height) = (view.model.width as f32, view.model.height as f32);
            if x + radius < 0.0 || x - radius > width || y + radius < 0.0 || y - radius > height {
                continue;
            }
            let rows = pixel_from(y - radius, view.model.height)..pixel_from(y + radius, view.model.height);
            add_to_bands(&mut self.disc_bands, self.discs.len() as u32, rows);
            self.discs.push(Disc { x, y, radius, inverse_z: nearness, color, label: splats.label });
        }
    }
}

impl Part {
    fn clear(&mut self, bands: usize) {
        self.corners.clear();
        self.vertices.clear();
        self.triangles.clear();
        self.surfaces.clear();
        self.bands.resize_with(bands, Vec::new);
        self.bands.iter_mut().for_each(Vec::clear);
    }

    fn add_mesh(&mut self, view: &View, mesh: &Mesh, visible: &Visible) {
        let first = self.vertices.len() as u32;
        let (rotation, translation) = (visible.rotation, visible.translation);
        for ((position, normal), &uv) in mesh.positions().iter().zip(mesh.normals()).zip(mesh.uvs()) {
            let position = rotation * position.coords + translation;
            self.corners.push(view.corner(&position));
            self.vertices.push(Vertex { position, normal: rotation * normal, uv });
        }
        let culling = if mesh.is_closed() { Culling::Back } else { Culling::Nothing };
        for triangle in mesh.indices() {
            let vertices = triangle.map(|i| first + i);
            if visible.place == SpherePlace::BeyondNear {
                self.add_triangle(view, vertices, visible.instance, culling);
            } else {
                self.add_clipped(view, vertices, visible.instance, culling);
            }
        }
    }

    /// Cuts off what is nearer than the near plane: nothing, one or two triangles remain.
    fn add_clipped(&mut self, view: &View, corners: [u32; 3], instance: u32, culling: Culling) {
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
                self.corners.push(view.corner(&cut.position));
                self.vertices.push(cut);
            }
        }
        for i in 2..count {
            self.add_triangle(view, [polygon[0], polygon[i - 1], polygon[i]], instance, culling);
        }
    }

    #[inline]
    fn add_triangle(&mut self, view: &View, vertices: [u32; 3], instance: u32, culling: Culling) {
        let [i, j, k] = vertices.map(|vertex| vertex as usize);
        let (a, b, c) = (&self.corners[i], &self.corners[j], &self.corners[k]);
        let Some(outline) = Outline::find([a, b, c], [view.model.width, view.model.height], culling) else { return };
        let (triangle, shares) = (outline.triangle(), outline.shares());
        let nearness = a.nearness * b.nearness * c.nearness;
        let (a, b, c) = (&self.vertices[i], &self.vertices[j], &self.vertices[k]);
        let uv_area = (b.uv[0] - a.uv[0]) * (c.uv[1] - a.uv[1]) - (c.uv[0] - a.uv[0]) * (b.uv[1] - a.uv[1]);
        let uv_density = (uv_area * nearness * shares.inverse_area).abs();
        let flat = a.normal == b.normal && a.normal == c.normal;
        add_to_bands(&mut self.bands, self.triangles.len() as u32, triangle.first_row..triangle.end_row);
        self.triangles.push(triangle);
        self.surfaces.push(Surface { shares, uv_density, flat, vertices, instance });
    }
}

fn add_to_bands(bands: &mut [Vec<u32>], number: u32, rows: Range<u32>) {
    if !rows.is_empty() {
        for band in &mut bands[rows.start as usize / BAND_ROWS..=(rows.end as usize - 1) / BAND_ROWS] {
            band.push(number);
        }
    }
}

/// Where a visible bounding sphere lies.
#[derive(Clone, Copy, Debug, PartialEq)]
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

    /// Where a point of the camera frame lies in the image.
    #[inline(always)]
    fn corner(&self, position: &Vector3<f32>) -> Corner {
        let nearness = 1.0 / position.z;
        Corner {
            x: self.focal[0] * position.x * nearness + self.center[0],
            y: self.focal[1] * position.y * nearness + self.center[1],
            nearness,
        }
    }

    /// The point where the edge from a visible to a hidden vertex meets the near plane.
    fn cut(&self, visible: &Vertex, hidden: &Vertex) -> Vertex {
        let share = (visible.position.z - self.near_m) / (visible.position.z - hidden.position.z);
        let mut position = visible.position + (hidden.position - visible.position) * share;
        position.z = self.near_m;
        let normal = visible.normal + (hidden.normal - visible.normal) * share;
        let uv = std::array::from_fn(|i| visible.uv[i] + (hidden.uv[i] - visible.uv[i]) * share);
        Vertex { position, normal, uv }
    }
}
