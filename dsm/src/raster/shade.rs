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

    /// Shades a band; the slices hold its pixels.
    pub(super) fn shade(&self, band: &Band, color: &mut [[u8; 3]], depth_m: &mut [f32], labels: &mut [u32]) {
        let width = band.width as usize;
        let mut piece = Piece {
            z: [1.0; PIECE],
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
                let columns: &[f32; PIECE] = match self.columns[first..].first_chunk() {
                    Some(columns) => columns,
                    None => continue,
                };
                let lit = self.gather(&mut piece, numbers, inverse_z, first, row, &mut labels[pixels.clone()]);
                for ((depth, z), number) in depth_m[pixels.clone()].iter_mut().zip(&piece.z).zip(numbers) {
                    *depth = if *number == NOTHING { 0.0 } else { *z };
                }
                let color = &mut color[pixels];
                if lit {
                    let light = self.light(&piece, columns, self.rows[row as usize]);
                    for (i, pixel) in color.iter_mut().enumerate() {
                        *pixel = [
                            self.srgb.encode(light[0][i]),
                            self.srgb.encode(light[1][i]),
                            self.srgb.encode(light[2][i]),
                        ];
                    }
                }
                self.color_unlit(numbers, color);
            }
        }
    }

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
        for (step, i) in run.clone().enumerate() {
            let (step, z) = (step as f32, piece.z[i]);
            let s = ((second + step * triangle.second.per_column) * z).clamp(0.0, 1.0);
            let t = ((third + step * triangle.third.per_column) * z).clamp(0.0, 1.0);
            for axis in 0..3 {
                piece.normal[axis][i] = normal_a[axis] + s * edge_b[axis] + t * edge_c[axis];
            }
            let mut albedo = look.color;
            if let Some((texture, level)) = texture {
                let u = (a.uv[0] + s * uv_b[0] + t * uv_c[0]) * look.repeat[0];
                let v = (a.uv[1] + s * uv_b[1] + t * uv_c[1]) * look.repeat[1];
                let texel = texture.sample(level, u, v);
                albedo = std::array::from_fn(|channel| albedo[channel] * texel[channel]);
            }
            for channel in 0..3 {
                piece.albedo[channel][i] = albedo[channel];
            }
        }
        piece.specular[run.clone()].fill(look.specular);
        piece.shininess[run.clone()].fill(look.shininess);
        piece.emission[run].fill(look.emission);
    }

    /// Linear light of each pixel: ambient, Lambert, and highlights by Schlick's rational form of Blinn's power.
    fn light(&self, piece: &Piece, columns: &[f32; PIECE], row: f32) -> [Lane; 3] {
        let mut n = piece.normal;
        // Towards the camera, unit length.
        let mut view = [[0.0; PIECE]; 3];
        let mut diffuse = [[0.0; PIECE]; 3];
        let mut shine = [[0.0; PIECE]; 3];
        for i in 0..PIECE {
            let length = (n[0][i] * n[0][i] + n[1][i] * n[1][i] + n[2][i] * n[2][i] + 1e-20).sqrt();
            let inverse = 1.0 / length;
            (n[0][i], n[1][i], n[2][i]) = (n[0][i] * inverse, n[1][i] * inverse, n[2][i] * inverse);
            let inverse = -1.0 / (columns[i] * columns[i] + row * row + 1.0).sqrt();
            (view[0][i], view[1][i], view[2][i]) = (columns[i] * inverse, row * inverse, inverse);
            let facing_up = n[0][i] * self.up[0] + n[1][i] * self.up[1] + n[2][i] * self.up[2];
            let ambient = 0.75 + 0.25 * facing_up;
            for channel in 0..3 {
                diffuse[channel][i] = self.ambient[channel] * ambient + piece.emission[i];
            }
        }
        for light in &self.lights {
            for i in 0..PIECE {
                let z = piece.z[i] * light.from_surface;
                let (x, y, z) = (light.vector[0] - columns[i] * z, light.vector[1] - row * z, light.vector[2] - z);
                let squared = x * x + y * y + z * z + 1e-12;
                let inverse = 1.0 / squared.sqrt();
                let (x, y, z) = (x * inverse, y * inverse, z * inverse);
                let cos = n[0][i] * x + n[1][i] * y + n[2][i] * z;
                let cos = if cos > 0.0 { cos } else { 0.0 };
                let strength = cos / (1.0 + squared * light.falloff);
                let (hx, hy, hz) = (x + view[0][i], y + view[1][i], z + view[2][i]);
                let half = n[0][i] * hx + n[1][i] * hy + n[2][i] * hz;
                let half = half / (hx * hx + hy * hy + hz * hz + 1e-12).sqrt();
                let half = if half > 0.0 { half } else { 0.0 };
                let power = half / (piece.shininess[i] * (1.0 - half) + half + 1e-12);
                // A surface that turns away from the light has no highlight.
                let power = if cos > 0.0 { power * piece.specular[i] / (1.0 + squared * light.falloff) } else { 0.0 };
                for channel in 0..3 {
                    diffuse[channel][i] += strength * light.color[channel];
                    shine[channel][i] += power * light.color[channel];
                }
            }
        }
        for channel in 0..3 {
            for i in 0..PIECE {
                diffuse[channel][i] = diffuse[channel][i] * piece.albedo[channel][i] + shine[channel][i];
            }
        }
        diffuse
    }

    /// Points keep the colour they were measured with; where nothing is seen there is the background.
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
