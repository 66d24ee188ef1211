//! Third stage: colour, depth and label of what is seen, in short pieces of rows that the compiler can vectorise.

use super::image::{SrgbTable, linear_from_srgb};
use super::scene::{Light, Material, Scene};
use super::setup::{Prepared, Triangle};
use super::texture::Texture;
use super::visibility::{Band, NOTHING};
use crate::Pose;
use crate::camera::CameraModel;
use nalgebra::{Point3, Vector3};

/// Pixels shaded together.
const PIECE: usize = 64;
type Lane = [f32; PIECE];
/// 0, 1, 2, ... as numbers: a count kept as a float would tie each pixel to the one before.
const STEPS: Lane = {
    let mut steps = [0.0; PIECE];
    let mut i = 0;
    while i < PIECE {
        steps[i] = i as f32;
        i += 1;
    }
    steps
};

/// A light in the camera frame.
struct CameraLight {
    /// Towards the light (directional) or its place (point).
    vector: [f32; 3],
    /// 0 for directional light: its vector is the direction everywhere.
    from_surface: f32,
    /// 1/m², so that the strength is 1 / (1 + d² / range²).
    falloff: f32,
    color: [f32; 3],
}

impl CameraLight {
    /// Share of the light that each pixel scatters (Lambert) and mirrors (Schlick's rational form of Blinn's power).
    #[inline(always)]
    fn fall_on(
        &self,
        piece: &Piece,
        view: &[Lane; 3],
        columns: &Lane,
        row: f32,
        diffuse: &mut Lane,
        highlight: &mut Lane,
    ) {
        let [nx, ny, nz] = &piece.normal;
        let [vx, vy, vz] = view;
        for i in 0..PIECE {
            let depth = piece.z[i] * self.from_surface;
            let (x, y, z) = (self.vector[0] - columns[i] * depth, self.vector[1] - row * depth, self.vector[2] - depth);
            let squared = x * x + y * y + z * z + 1e-12;
            let inverse = 1.0 / squared.sqrt();
            let fading = 1.0 / (1.0 + squared * self.falloff);
            let (x, y, z) = (x * inverse, y * inverse, z * inverse);
            let cos = nx[i] * x + ny[i] * y + nz[i] * z;
            let cos = if cos > 0.0 { cos } else { 0.0 };
            // A surface that turns away from the light has no highlight.
            let lit = if cos > 0.0 { fading } else { 0.0 };
            let (hx, hy, hz) = (x + vx[i], y + vy[i], z + vz[i]);
            let half = nx[i] * hx + ny[i] * hy + nz[i] * hz;
            let half = if half > 0.0 { half } else { 0.0 };
            let half = half / (hx * hx + hy * hy + hz * hz + 1e-12).sqrt();
            diffuse[i] = cos * fading;
            highlight[i] = lit * piece.specular[i] * half / (piece.shininess[i] * (1.0 - half) + half + 1e-12);
        }
    }
}

#[inline(always)]
fn normalize(normal: &mut [Lane; 3]) {
    let [x, y, z] = normal;
    for i in 0..PIECE {
        let inverse = 1.0 / (x[i] * x[i] + y[i] * y[i] + z[i] * z[i] + 1e-20).sqrt();
        x[i] *= inverse;
        y[i] *= inverse;
        z[i] *= inverse;
    }
}

/// Unit vectors from the surfaces towards the camera.
#[inline(always)]
fn look_back(columns: &Lane, row: f32, view: &mut [Lane; 3]) {
    let [x, y, z] = view;
    for i in 0..PIECE {
        let inverse = -1.0 / (columns[i] * columns[i] + row * row + 1.0).sqrt();
        x[i] = columns[i] * inverse;
        y[i] = row * inverse;
        z[i] = inverse;
    }
}

#[inline(always)]
fn dot(vectors: &[Lane; 3], other: &[f32; 3], product: &mut Lane) {
    let [x, y, z] = vectors;
    for i in 0..PIECE {
        product[i] = x[i] * other[0] + y[i] * other[1] + z[i] * other[2];
    }
}

#[inline(always)]
fn add_scaled(sum: &mut Lane, values: &Lane, factor: f32) {
    for i in 0..PIECE {
        sum[i] += values[i] * factor;
    }
}

/// A material ready for shading.
struct Look<'a> {
    color: [f32; 3],
    texture: Option<&'a Texture>,
    repeat: [f32; 2],
    /// Texels squared per unit of texture coordinates squared.
    texels: f32,
    specular: f32,
    shininess: f32,
    emission: f32,
}

/// The surfaces of one piece of a row.
struct Piece {
    z: Lane,
    /// Barycentric coordinates of the second and third vertex.
    second: Lane,
    third: Lane,
    normal: [Lane; 3],
    albedo: [Lane; 3],
    specular: Lane,
    shininess: Lane,
    emission: Lane,
}

/// All that shading needs to know about one view.
pub(super) struct Shader<'a> {
    prepared: &'a Prepared,
    srgb: &'a SrgbTable,
    background: [u8; 3],
    labels: Vec<u32>,
    /// Look of each instance.
    looks: Vec<Look<'a>>,
    look_of_instance: Vec<u32>,
    lights: Vec<CameraLight>,
    ambient: [f32; 3],
    up: [f32; 3],
    /// Direction of each column and row of pixels at z = 1.
    columns: Vec<f32>,
    rows: Vec<f32>,
}

impl<'a> Shader<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        model: &CameraModel,
        camera_from_world: &Pose,
        prepared: &'a Prepared,
        background: [u8; 3],
        srgb: &'a SrgbTable,
    ) -> Self {
        let up: Vector3<f32> = (camera_from_world.rotation * Vector3::z()).cast();
        let ray = |i: u32, center: f64, focal: f64| ((f64::from(i) + 0.5 - center) / focal) as f32;
        // A whole number of pieces, so that the last one needs no care.
        let padded = model.width.next_multiple_of(PIECE as u32);
        Self {
            prepared,
            srgb,
            background,
            labels: scene.instances.iter().map(|instance| instance.label).collect(),
            looks: scene.materials().iter().map(|material| look(scene, material)).collect(),
            look_of_instance: scene.instances.iter().map(|instance| instance.material.0).collect(),
            lights: scene.lights.iter().map(|light| light_in_camera(light, camera_from_world)).collect(),
            ambient: scene.ambient,
            up: up.into(),
            columns: (0..padded).map(|column| ray(column, model.cx, model.fx)).collect(),
            rows: (0..model.height).map(|row| ray(row, model.cy, model.fy)).collect(),
        }
    }

    /// Shades a band; the slices hold its pixels. Everything below is compiled into each set of instructions that
    /// the caller picks from, which is why it is always inlined; the arithmetic is the same in all of them.
    #[inline(always)]
    pub(super) fn shade(&self, band: &Band, color: &mut [[u8; 3]], depth_m: &mut [f32], labels: &mut [u32]) {
        let width = band.width as usize;
        let mut piece = Piece {
            z: [1.0; PIECE],
            second: [0.0; PIECE],
            third: [0.0; PIECE],
            normal: [[0.0; PIECE]; 3],
            albedo: [[0.0; PIECE]; 3],
            specular: [0.0; PIECE],
            shininess: [1.0; PIECE],
            emission: [0.0; PIECE],
        };
        for row in band.first_row..band.end_row {
            let line = (row - band.first_row) as usize * width;
            for first in (0..width).step_by(PIECE) {
                let pixels = line + first..line + (first + PIECE).min(width);
                let numbers = &band.numbers[pixels.clone()];
                let inverse_z = &band.inverse_z[pixels.clone()];
                let columns: &Lane = match self.columns[first..].first_chunk() {
                    Some(columns) => columns,
                    None => continue,
                };
                let lit = self.gather(&mut piece, numbers, inverse_z, first, row, &mut labels[pixels.clone()]);
                for ((depth, z), number) in depth_m[pixels.clone()].iter_mut().zip(&piece.z).zip(numbers) {
                    *depth = if *number == NOTHING { 0.0 } else { *z };
                }
                let color = &mut color[pixels];
                if lit {
                    let light = self.light(&mut piece, columns, self.rows[row as usize]);
                    let steps = light.map(|channel| channel.map(SrgbTable::step));
                    for (i, pixel) in color.iter_mut().enumerate() {
                        *pixel = [0, 1, 2].map(|channel| self.srgb.encode(steps[channel][i]));
                    }
                }
                self.color_unlit(numbers, color);
            }
        }
    }

    #[inline(always)]
    /// Fetches the surfaces of a piece and writes its labels; returns whether any of them needs light.
    fn gather(
        &self,
        piece: &mut Piece,
        numbers: &[u32],
        inverse_z: &[f32],
        first_column: usize,
        row: u32,
        labels: &mut [u32],
    ) -> bool {
        for (z, inverse) in piece.z.iter_mut().zip(inverse_z) {
            *z = 1.0 / inverse;
        }
        let mut lit = false;
        let mut start = 0;
        while start < numbers.len() {
            let number = numbers[start];
            let length = numbers[start..].iter().take_while(|&&other| other == number).count();
            let run = start..start + length;
            start += length;
            labels[run.clone()].fill(match self.prepared.triangles.get(number as usize) {
                Some(triangle) => {
                    lit = true;
                    self.gather_run(piece, triangle, run, first_column, row);
                    self.labels[triangle.instance as usize]
                }
                None if number == NOTHING => 0,
                None => self.prepared.discs[number as usize - self.prepared.triangles.len()].label,
            });
        }
        lit
    }

    /// The surfaces of neighbouring pixels of one triangle.
    #[inline(always)]
    fn gather_run(
        &self,
        piece: &mut Piece,
        triangle: &Triangle,
        run: std::ops::Range<usize>,
        first_column: usize,
        row: u32,
    ) {
        let [a, b, c] = triangle.vertices.map(|i| &self.prepared.vertices[i as usize]);
        let look = &self.looks[self.look_of_instance[triangle.instance as usize] as usize];
        let (column, row) =
            (((first_column + run.start) as i32 - triangle.origin[0]) as f32, (row as i32 - triangle.origin[1]) as f32);
        let (second, third) = (triangle.second.at(column, row), triangle.third.at(column, row));
        let side = if triangle.back { -1.0 } else { 1.0 };
        let (normal_a, edge_b, edge_c) = (a.normal * side, (b.normal - a.normal) * side, (c.normal - a.normal) * side);
        let (uv_b, uv_c) = ([b.uv[0] - a.uv[0], b.uv[1] - a.uv[1]], [c.uv[0] - a.uv[0], c.uv[1] - a.uv[1]]);
        let texture = look.texture.map(|texture| {
            let z = piece.z[run.start + run.len() / 2];
            (texture, texture.level_for(triangle.uv_density * z * z * z * look.texels))
        });
        let (s, t) = (&mut piece.second[run.clone()], &mut piece.third[run.clone()]);
        for (((s, t), z), step) in s.iter_mut().zip(t.iter_mut()).zip(&piece.z[run.clone()]).zip(&STEPS) {
            *s = ((second + step * triangle.second.per_column) * z).clamp(0.0, 1.0);
            *t = ((third + step * triangle.third.per_column) * z).clamp(0.0, 1.0);
        }
        let (s, t) = (&*s, &*t);
        for (axis, lane) in piece.normal.iter_mut().enumerate() {
            for ((value, s), t) in lane[run.clone()].iter_mut().zip(s).zip(t) {
                *value = normal_a[axis] + s * edge_b[axis] + t * edge_c[axis];
            }
        }
        match texture {
            None => {
                for (lane, value) in piece.albedo.iter_mut().zip(look.color) {
                    lane[run.clone()].fill(value);
                }
            }
            Some((texture, level)) => {
                for ((i, s), t) in run.clone().zip(s).zip(t) {
                    let u = (a.uv[0] + s * uv_b[0] + t * uv_c[0]) * look.repeat[0];
                    let v = (a.uv[1] + s * uv_b[1] + t * uv_c[1]) * look.repeat[1];
                    let texel = texture.sample(level, u, v);
                    for ((lane, color), texel) in piece.albedo.iter_mut().zip(look.color).zip(texel) {
                        lane[i] = color * texel;
                    }
                }
            }
        }
        piece.specular[run.clone()].fill(look.specular);
        piece.shininess[run.clone()].fill(look.shininess);
        piece.emission[run].fill(look.emission);
    }

    #[inline(always)]
    /// Linear light of each pixel. The loops hold no branches and only lanes, so that the compiler vectorises them.
    fn light(&self, piece: &mut Piece, columns: &Lane, row: f32) -> [Lane; 3] {
        let mut view = [[0.0; PIECE]; 3];
        let mut facing_up = [0.0; PIECE];
        normalize(&mut piece.normal);
        look_back(columns, row, &mut view);
        dot(&piece.normal, &self.up, &mut facing_up);
        let mut sum = [[0.0; PIECE]; 3];
        let mut shine = [[0.0; PIECE]; 3];
        for (sum, ambient) in sum.iter_mut().zip(self.ambient) {
            for i in 0..PIECE {
                sum[i] = ambient * (0.75 + 0.25 * facing_up[i]) + piece.emission[i];
            }
        }
        let (mut diffuse, mut highlight) = ([0.0; PIECE], [0.0; PIECE]);
        for light in &self.lights {
            light.fall_on(piece, &view, columns, row, &mut diffuse, &mut highlight);
            for ((sum, shine), color) in sum.iter_mut().zip(&mut shine).zip(light.color) {
                add_scaled(sum, &diffuse, color);
                add_scaled(shine, &highlight, color);
            }
        }
        for ((sum, shine), albedo) in sum.iter_mut().zip(&shine).zip(&piece.albedo) {
            for i in 0..PIECE {
                sum[i] = sum[i] * albedo[i] + shine[i];
            }
        }
        sum
    }

    /// Points keep the colour they were measured with; where nothing is seen there is the background.
    #[inline(always)]
    fn color_unlit(&self, numbers: &[u32], color: &mut [[u8; 3]]) {
        let triangles = self.prepared.triangles.len();
        for (pixel, &number) in color.iter_mut().zip(numbers) {
            if number as usize >= triangles {
                *pixel = match number {
                    NOTHING => self.background,
                    _ => self.prepared.discs[number as usize - triangles].color,
                };
            }
        }
    }
}

fn look<'a>(scene: &'a Scene, material: &Material) -> Look<'a> {
    let texture = material.texture.map(|index| scene.texture(index));
    let [u, v] = material.texture_repeat;
    Look {
        color: material.color.map(linear_from_srgb),
        texture,
        repeat: material.texture_repeat,
        texels: texture.map_or(0.0, |texture| (u * v).abs() * (texture.width() * texture.height()) as f32),
        specular: material.specular,
        shininess: material.shininess,
        emission: material.emission,
    }
}

fn light_in_camera(light: &Light, camera_from_world: &Pose) -> CameraLight {
    match *light {
        Light::Directional { direction_in_world, color } => CameraLight {
            vector: (-(camera_from_world.rotation * direction_in_world.cast::<f64>()).cast::<f32>()).into(),
            from_surface: 0.0,
            falloff: 0.0,
            color,
        },
        Light::Point { position_in_world, color, range_m } => {
            let place: Point3<f32> = (camera_from_world * position_in_world.cast::<f64>()).cast();
            CameraLight { vector: place.coords.into(), from_surface: 1.0, falloff: 1.0 / (range_m * range_m), color }
        }
    }
}
