//! The stages in order, and the buffers they share.

use super::image::{Image, SrgbTable};
use super::scene::Scene;
use super::setup::{BAND_ROWS, Prepared, Seen};
use super::shade::Shader;
use super::visibility::Band;
use crate::Pose;
use crate::camera::CameraModel;
use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};
use pulp::{Arch, NullaryFnOnce};
use rayon::prelude::*;

/// How an image is rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Colour where nothing is seen, sRGB. Default: a light grey.
    pub background: [u8; 3],
    /// Nothing nearer than this is drawn, metres along the camera's z; above 0. Default 0.02.
    pub near_m: f32,
    /// Nothing farther than this is drawn, metres along the camera's z; above `near_m`. Default 100.
    pub far_m: f32,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { background: [200, 205, 210], near_m: 0.02, far_m: 100.0 }
    }
}

/// Renders images and keeps its working memory between them.
#[derive(Debug)]
pub struct Renderer {
    prepared: Prepared,
    inverse_z: Vec<f32>,
    seen: Vec<Seen>,
    srgb: SrgbTable,
    /// The instructions of this machine.
    arch: Arch,
}

/// One band: its nearest surfaces, and their shading.
struct BandWork<'a> {
    prepared: &'a Prepared,
    shader: &'a Shader<'a>,
    far_m: f32,
    band: Band<'a>,
    color: &'a mut [[u8; 3]],
    depth_m: &'a mut [f32],
    labels: &'a mut [u32],
}

impl NullaryFnOnce for BandWork<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        self.band.fill(self.prepared, self.far_m);
        self.shader.shade(&self.band, self.color, self.depth_m, self.labels);
    }
}

impl Default for Renderer {
    fn default() -> Self {
        Self {
            prepared: Prepared::default(),
            inverse_z: Vec::new(),
            seen: Vec::new(),
            srgb: SrgbTable::new(),
            arch: Arch::new(),
        }
    }
}

impl Renderer {
    /// Renders colour, depth and labels into `image`, whose buffers are used again.
    ///
    /// Works on the threads of the current rayon pool; the image does not depend on their number.
    pub fn render_into(
        &mut self,
        scene: &Scene,
        model: &CameraModel,
        world_from_camera: &Pose,
        options: &RenderOptions,
        image: &mut Image,
    ) {
        let camera_from_world = world_from_camera.inverse();
        image.resize(model.width, model.height);
        self.inverse_z.resize(model.pixel_count(), 0.0);
        self.seen.resize(model.pixel_count(), Seen::NOTHING);
        // 1. Triangles in pixels, culled and clipped.
        self.prepared.prepare(scene, model, &camera_from_world, options);
        // 2. and 3. Each band of rows finds its nearest surfaces and shades them.
        let prepared = &self.prepared;
        let shader = Shader::new(scene, model, world_from_camera, prepared, options.background, &self.srgb);
        let arch = self.arch;
        let pixels = BAND_ROWS * model.width as usize;
        if pixels == 0 {
            return;
        }
        (self.inverse_z.par_chunks_mut(pixels))
            .zip(self.seen.par_chunks_mut(pixels))
            .zip(image.color.par_chunks_mut(pixels))
            .zip(image.depth_m.par_chunks_mut(pixels))
            .zip(image.labels.par_chunks_mut(pixels))
            .enumerate()
            .for_each(|(number, ((((inverse_z, seen), color), depth_m), labels))| {
                let first_row = (number * BAND_ROWS) as u32;
                let end_row = (first_row + BAND_ROWS as u32).min(model.height);
                let band = Band { number, width: model.width, first_row, end_row, inverse_z, seen };
                let (shader, far_m) = (&shader, options.far_m);
                arch.dispatch(BandWork { prepared, shader, far_m, band, color, depth_m, labels });
            });
    }

    /// Renders a new image.
    pub fn render(
        &mut self,
        scene: &Scene,
        model: &CameraModel,
        world_from_camera: &Pose,
        options: &RenderOptions,
    ) -> Image {
        let mut image = Image::default();
        self.render_into(scene, model, world_from_camera, options, &mut image);
        image
    }
}

/// Renders one image; see [`Renderer`] for many.
pub fn render(scene: &Scene, model: &CameraModel, world_from_camera: &Pose, options: &RenderOptions) -> Image {
    Renderer::default().render(scene, model, world_from_camera, options)
}

/// `world_from_camera` of a camera at `eye` that looks at `target` (world frame, metres) with the horizon level.
/// Looking straight up or down, the top of the image is world x; with both points alike it looks along world x.
pub fn look_at(eye: &Point3<f64>, target: &Point3<f64>) -> Pose {
    let forward = (target - eye).try_normalize(1e-12).unwrap_or_else(Vector3::x);
    let level = forward.cross(&Vector3::z()).try_normalize(1e-9);
    let right = level.unwrap_or_else(|| forward.cross(&Vector3::x()).normalize());
    let rotation = Rotation3::from_basis_unchecked(&[right, forward.cross(&right), forward]);
    Pose::from_parts((*eye).into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

#[cfg(test)]
mod tests {
    //! Contract: the target lies in the middle of the image, and up is up.
    use super::*;

    #[test]
    fn the_target_is_straight_ahead_and_the_horizon_level() {
        let eye = Point3::new(1.0, 2.0, 3.0);
        for target in [Point3::new(4.0, -1.0, 0.5), Point3::new(1.0, 2.0, 0.0), eye] {
            let camera_from_world = look_at(&eye, &target).inverse();
            let seen = camera_from_world * target;
            assert!(seen.x.abs() < 1e-12 && seen.y.abs() < 1e-12 && seen.z >= 0.0);
            let up = camera_from_world * Vector3::z();
            assert!(up.x.abs() < 1e-12 && up.y < 1e-12, "{up}");
        }
        let up = look_at(&eye, &Point3::new(1.0, 2.0, 0.0)).inverse_transform_vector(&Vector3::x());
        assert!((up + Vector3::y()).norm() < 1e-12, "{up}");
    }
}
