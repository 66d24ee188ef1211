//! Contract: our renderer sees what MuJoCo sees: off the edges, the label agrees at 99 % of the pixels and, where it does,
//! the depth up to 5 m within 1 mm at 99 %. MuJoCo sees in two ways: drawn by its own OpenGL renderer, and along its rays.

#![allow(clippy::print_stdout, reason = "figures of the agreement are wanted")]

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm_sim::camera::{CameraRig, LightDraw, TrueImage};
use dsm_sim::scene::{SceneModel, scene_file};
use dsm_sim_mujoco::{Eye, Picture, PictureError, cast_rays, draw};
use nalgebra::{Rotation3, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// The depths of three neighbours bend by more at an edge, metres.
const BEND_M: f32 = 0.02;
const FARTHEST_M: f32 = 5.0;
const AGREE_M: f32 = 0.001;
const SHARE: f64 = 0.99;

fn apartment() -> SceneModel {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/apartment");
    SceneModel::load(&scene_file(&folder)).expect("the apartment loads")
}

/// A head camera above (x, y) that looks along `yaw` and down by `tilt`.
fn eye(x: f64, y: f64, yaw: f64, tilt: f64) -> Eye {
    let forward = Vector3::new(yaw.cos() * tilt.cos(), yaw.sin() * tilt.cos(), -tilt.sin());
    let right = Vector3::new(yaw.sin(), -yaw.cos(), 0.0);
    let rotation = Rotation3::from_basis_unchecked(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    let world_from_camera = Pose::from_parts(Translation3::new(x, y, 1.25), rotation);
    Eye { model: CameraModel::from_vertical_fov(640, 480, 1.0), world_from_camera }
}

/// Eyes in all rooms, in several directions.
fn eyes(scene: &SceneModel) -> Vec<Eye> {
    let centers = scene.bodies.iter().map(|body| body.world_from_body.translation.vector);
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for center in centers {
        (low, high) = (low.inf(&center), high.sup(&center));
    }
    let place = |i: u32, axis: usize, share: f64| low[axis] + (high[axis] - low[axis]) * (share * f64::from(i)).fract();
    (1..=8)
        .map(|i| eye(place(i, 0, 0.618), place(i, 1, 0.382), 0.8 * f64::from(i), 0.2 + 0.05 * f64::from(i)))
        .collect()
}

#[derive(Default)]
struct Agreement {
    pixels: usize,
    labels: usize,
    near: usize,
    depths: usize,
}

impl Agreement {
    fn count(&mut self, ours: &TrueImage, theirs: &Picture, width: usize) {
        let height = theirs.labels.len() / width;
        for row in 1..height - 1 {
            for pixel in row * width + 1..(row + 1) * width - 1 {
                if is_edge(&ours.labels, &ours.depth_m, width, pixel)
                    || is_edge(&theirs.labels, &theirs.depth_m, width, pixel)
                {
                    continue;
                }
                self.pixels += 1;
                if ours.labels[pixel] != theirs.labels[pixel] {
                    continue;
                }
                self.labels += 1;
                let (a, b) = (ours.depth_m[pixel], theirs.depth_m[pixel]);
                if ours.labels[pixel] != 0 && a < FARTHEST_M {
                    self.near += 1;
                    self.depths += usize::from((a - b).abs() <= AGREE_M);
                }
            }
        }
    }

    fn check(&self, whose: &str) {
        let share = |part: usize, whole: usize| part as f64 / whole as f64;
        let (labels, depths) = (share(self.labels, self.pixels), share(self.depths, self.near));
        let said = format!(
            "{whose}: labels agree at {:.3} % of {} pixels, depth at {:.3} % of {}",
            100.0 * labels,
            self.pixels,
            100.0 * depths,
            self.near
        );
        println!("{said}");
        assert!(self.near > 500_000, "too little is seen: {said}");
        assert!(labels >= SHARE && depths >= SHARE, "{said}");
    }
}

/// Whether a neighbour has another label or the depth bends.
fn is_edge(labels: &[u32], depths: &[f32], width: usize, pixel: usize) -> bool {
    [1, width, width - 1, width + 1].iter().any(|&step| {
        let (before, after) = (pixel - step, pixel + step);
        labels[before] != labels[pixel]
            || labels[after] != labels[pixel]
            || (depths[before] + depths[after] - 2.0 * depths[pixel]).abs() > BEND_M
    })
}

fn ours(scene: &SceneModel, eyes: &[Eye]) -> Vec<TrueImage> {
    let mut rig = CameraRig::new(scene, &[], &LightDraw::unchanged()).expect("the scene can be drawn");
    let bodies: Vec<Pose> = scene.bodies.iter().map(|body| body.world_from_body).collect();
    eyes.iter().map(|eye| rig.render(&bodies, &[], &eye.model, &eye.world_from_camera)).collect()
}

#[test]
fn our_pictures_agree_with_mujocos_rays() {
    let scene = apartment();
    let eyes = eyes(&scene);
    let mut agreement = Agreement::default();
    for (eye, image) in eyes.iter().zip(ours(&scene, &eyes)) {
        let theirs = cast_rays(&scene, eye).expect("rays need no display");
        agreement.count(&image, &theirs, eye.model.width as usize);
    }
    agreement.check("rays");
}

#[test]
// The message is how a reader of the test's output learns that nothing was checked.
#[allow(clippy::print_stderr)]
fn our_pictures_agree_with_mujocos_renderer() {
    let scene = apartment();
    let eyes = eyes(&scene);
    let pictures = match draw(&scene, &eyes) {
        Err(PictureError::NoGl(reason)) => {
            eprintln!("skipped: {reason}");
            return;
        }
        drawn => drawn.expect("the scene is sound"),
    };
    let mut agreement = Agreement::default();
    for ((eye, image), theirs) in eyes.iter().zip(ours(&scene, &eyes)).zip(&pictures) {
        agreement.count(&image, theirs, eye.model.width as usize);
    }
    agreement.check("renderer");
}
