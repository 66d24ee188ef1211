//! Light on the surfaces of a piece of a row. Loops over lanes, without branches, that the compiler vectorises.

use super::scene::Light;
use super::shadow::ShadowView;
use crate::Pose;
use nalgebra::Point3;

/// Pixels shaded together.
pub(super) const PIECE: usize = 64;
/// One value of each pixel of a piece.
pub(super) type Lane = [f32; PIECE];

/// The surfaces of one piece of a row.
pub(super) struct Surfaces {
    pub z: Lane,
    /// Camera frame; any length but zero.
    pub normal: [Lane; 3],
    pub albedo: [Lane; 3],
    pub specular: Lane,
    pub shininess: Lane,
    pub metallic: Lane,
    pub emission: Lane,
    /// Whether any of them is a metal.
    pub metals: bool,
    /// Whether any of them has highlights.
    pub glossy: bool,
}

impl Surfaces {
    pub(super) fn new() -> Self {
        Self {
            z: [1.0; PIECE],
            normal: [[0.0; PIECE]; 3],
            albedo: [[0.0; PIECE]; 3],
            specular: [0.0; PIECE],
            shininess: [1.0; PIECE],
            metallic: [0.0; PIECE],
            emission: [0.0; PIECE],
            metals: false,
            glossy: false,
        }
    }
}

/// All light of a scene, in the camera frame.
pub(super) struct Lighting<'a> {
    pub lights: Vec<CameraLight>,
    pub ambient: [f32; 3],
    /// World z.
    pub up: [f32; 3],
    /// World x.
    pub east: [f32; 3],
    /// Shadows, and the light that throws them.
    pub shadow: Option<(usize, ShadowView<'a>)>,
}

/// A light in the camera frame.
pub(super) struct CameraLight {
    kind: Kind,
    color: [f32; 3],
}

enum Kind {
    /// Unit vector towards the light.
    Directional { to_light: [f32; 3] },
    /// Its place, and 1/m² so that the strength is 1 / (1 + d² / range²).
    Point { position: [f32; 3], falloff: f32 },
}

impl CameraLight {
    pub(super) fn new(light: &Light, camera_from_world: &Pose) -> Self {
        match *light {
            Light::Directional { direction_in_world, color } => {
                let direction = (camera_from_world.rotation * direction_in_world.cast::<f64>()).normalize();
                Self { kind: Kind::Directional { to_light: (-direction.cast::<f32>()).into() }, color }
            }
            Light::Point { position_in_world, color, range_m } => {
                let place: Point3<f32> = (camera_from_world * position_in_world.cast::<f64>()).cast();
                let kind = Kind::Point { position: place.coords.into(), falloff: 1.0 / (range_m * range_m) };
                Self { kind, color }
            }
        }
    }
}

/// Values that the steps of lighting share.
struct Work<'a> {
    surfaces: &'a Surfaces,
    /// Unit vectors towards the camera.
    view: [Lane; 3],
    /// Share of a light that is scattered.
    diffuse: Lane,
    /// Share of a light that is mirrored.
    highlight: Lane,
    /// 1 where a light arrives, 0 in shadow.
    lit: Lane,
}

impl Lighting<'_> {
    /// Linear light of each pixel; `columns` and `row` are the rays at z = 1.
    #[inline(always)]
    pub(super) fn shine(&self, surfaces: &mut Surfaces, columns: &Lane, row: f32) -> [Lane; 3] {
        normalize(&mut surfaces.normal);
        let mut facing_up = [0.0; PIECE];
        dot(&surfaces.normal, &self.up, &mut facing_up);
        let mut sum = [[0.0; PIECE]; 3];
        let mut shine = [[0.0; PIECE]; 3];
        for (sum, ambient) in sum.iter_mut().zip(self.ambient) {
            for i in 0..PIECE {
                sum[i] = ambient * (0.75 + 0.25 * facing_up[i]) + surfaces.emission[i];
            }
        }
        let zero = [0.0; PIECE];
        let mut work = Work { surfaces, view: [zero; 3], diffuse: zero, highlight: zero, lit: zero };
        if surfaces.glossy {
            look_back(columns, row, &mut work.view);
        }
        for (number, light) in self.lights.iter().enumerate() {
            match &light.kind {
                Kind::Directional { to_light } => work.add_directional(to_light),
                Kind::Point { position, falloff } => work.add_point(position, *falloff, columns, row),
            }
            if let Some((_, shadow)) = self.shadow.as_ref().filter(|(thrower, _)| *thrower == number) {
                shadow.find_lit(&surfaces.z, &work.diffuse, columns, row, &mut work.lit);
                for i in 0..PIECE {
                    work.diffuse[i] *= work.lit[i];
                    work.highlight[i] *= work.lit[i];
                }
            }
            for (sum, color) in sum.iter_mut().zip(light.color) {
                add_scaled(sum, &work.diffuse, color);
            }
            if surfaces.glossy {
                for (shine, color) in shine.iter_mut().zip(light.color) {
                    add_scaled(shine, &work.highlight, color);
                }
            }
        }
        let mut around = [0.0; PIECE];
        if surfaces.metals {
            self.mirror_room(work.surfaces, &work.view, &mut around);
        }
        for ((sum, shine), albedo) in sum.iter_mut().zip(&shine).zip(&surfaces.albedo) {
            for i in 0..PIECE {
                // A metal scatters a fifth, and tints what it mirrors.
                let metallic = surfaces.metallic[i];
                let scattered = sum[i] * (1.0 - 0.8 * metallic) + around[i];
                let tint = 1.0 + metallic * (2.0 * albedo[i] - 1.0);
                sum[i] = scattered * albedo[i] + shine[i] * tint;
            }
        }
        sum
    }
}

impl Lighting<'_> {
    /// What metals mirror: a room with a dark floor, a bright ceiling and three bright stripes on its walls, far away.
    #[inline(always)]
    fn mirror_room(&self, surfaces: &Surfaces, view: &[Lane; 3], around: &mut Lane) {
        let [nx, ny, nz] = &surfaces.normal;
        let [vx, vy, vz] = view;
        let (up, east) = (&self.up, &self.east);
        for i in 0..PIECE {
            let twice = 2.0 * (nx[i] * vx[i] + ny[i] * vy[i] + nz[i] * vz[i]);
            let (x, y, z) = (twice * nx[i] - vx[i], twice * ny[i] - vy[i], twice * nz[i] - vz[i]);
            let rise = x * up[0] + y * up[1] + z * up[2];
            let along = x * east[0] + y * east[1] + z * east[2];
            let ceiling = (1.6 * rise + 0.3).clamp(0.0, 1.0);
            // cos(3a) of the bearing a, to the fourth power where it is positive.
            let level = (1.0 - rise * rise + 1e-6).sqrt();
            let cos = along / level;
            let stripe = (4.0 * cos * cos * cos - 3.0 * cos).max(0.0);
            let stripe = stripe * stripe * stripe * stripe;
            around[i] = surfaces.metallic[i] * (0.06 + 0.55 * ceiling + 1.1 * stripe * (1.0 - ceiling));
        }
    }
}

impl Work<'_> {
    #[inline(always)]
    fn add_directional(&mut self, &[x, y, z]: &[f32; 3]) {
        let [nx, ny, nz] = &self.surfaces.normal;
        for i in 0..PIECE {
            let cos = nx[i] * x + ny[i] * y + nz[i] * z;
            self.diffuse[i] = if cos > 0.0 { cos } else { 0.0 };
        }
        if self.surfaces.glossy {
            for i in 0..PIECE {
                self.highlight[i] = self.mirror(i, [x, y, z]);
            }
        }
    }

    #[inline(always)]
    fn add_point(&mut self, position: &[f32; 3], falloff: f32, columns: &Lane, row: f32) {
        let [nx, ny, nz] = &self.surfaces.normal;
        for i in 0..PIECE {
            let depth = self.surfaces.z[i];
            let (x, y, z) = (position[0] - columns[i] * depth, position[1] - row * depth, position[2] - depth);
            let squared = x * x + y * y + z * z + 1e-12;
            let inverse = 1.0 / squared.sqrt();
            let fading = 1.0 / (1.0 + squared * falloff);
            let (x, y, z) = (x * inverse, y * inverse, z * inverse);
            let cos = nx[i] * x + ny[i] * y + nz[i] * z;
            self.diffuse[i] = if cos > 0.0 { cos } else { 0.0 };
            self.highlight[i] = fading * self.mirror(i, [x, y, z]);
            self.diffuse[i] *= fading;
        }
    }

    /// Share of light from the direction that is mirrored to the camera: Schlick's rational form of Blinn's power,
    /// h / (s (1 - h) + h) with h the cosine between the normal and the middle of both directions. A surface that turns
    /// away from the light has no highlight; `diffuse` must be known.
    #[inline(always)]
    fn mirror(&self, i: usize, [x, y, z]: [f32; 3]) -> f32 {
        let [nx, ny, nz] = &self.surfaces.normal;
        let [vx, vy, vz] = &self.view;
        let (hx, hy, hz) = (x + vx[i], y + vy[i], z + vz[i]);
        let half = nx[i] * hx + ny[i] * hy + nz[i] * hz;
        let half = if half > 0.0 { half } else { 0.0 };
        // The middle is not of unit length: both sides of the fraction are scaled by its length instead.
        let length = (hx * hx + hy * hy + hz * hz + 1e-12).sqrt();
        let strength = if self.diffuse[i] > 0.0 { self.surfaces.specular[i] } else { 0.0 };
        strength * half / (self.surfaces.shininess[i] * (length - half) + half + 1e-12)
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
