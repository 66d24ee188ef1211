//! Looks through a camera of the porter into a scene and writes what it sees: `<prefix>_true.png`, `<prefix>_sensed.png`,
//! `<prefix>_depth.png` (near is bright, black is no return) and `<prefix>_labels.png`.
//!
//! The camera `above` looks straight down from a height of YAW_RAD metres instead, north up.
//!
//! `cargo run --release -p dsm-sim --example look -- scenes/apartment /tmp/look head X_M Y_M YAW_RAD [SEED]`

use anyhow::{Context, Result};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm_robot::model::RobotModel;
use dsm_sim::camera::{CameraRig, LightDraw, NoiseKey, NoiseParameters, SensorModel, TrueImage, robot_visuals};
use dsm_sim::scene::SceneModel;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

fn write(path: &str, image: &TrueImage, rgb: impl Iterator<Item = [u8; 3]>) -> Result<()> {
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), image.width, image.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&rgb.flatten().collect::<Vec<u8>>())?;
    Ok(())
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |i: usize, name: &str| arguments.get(i).cloned().with_context(|| format!("argument {name} is missing"));
    let number = |i: usize, name: &str| Ok::<f64, anyhow::Error>(text(i, name)?.parse()?);
    let (scene, prefix, camera) = (text(0, "SCENE")?, text(1, "PREFIX")?, text(2, "CAMERA")?);
    let (x_m, y_m, yaw_rad) = (number(3, "X_M")?, number(4, "Y_M")?, number(5, "YAW_RAD")?);
    let seed = arguments.get(6).map_or(Ok(0), |seed| seed.parse())?;

    let model = SceneModel::load(Path::new(&scene))?;
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../robot/models/porter"));
    let robot = RobotModel::load(&folder)?;
    let visuals = robot_visuals(&robot.kinematics);

    let mut configuration = robot.kinematics.zero();
    configuration.apply(&robot.find_posture("carry").context("no posture `carry`")?);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let world_from_base = Pose::from_parts(Translation3::new(x_m, y_m, 0.0), rotation);
    let base_from_links = robot.kinematics.root_from_links(&configuration);
    let links: Vec<Pose> = base_from_links.as_slice().iter().map(|link| world_from_base * link).collect();
    let bodies: Vec<Pose> = model.bodies.iter().map(|body| body.world_from_body).collect();
    let (camera, world_from_camera) = if camera == "above" {
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let world_from_camera = Pose::from_parts(Translation3::new(x_m, y_m, yaw_rad), down);
        (CameraModel::from_vertical_fov(1200, 1000, 0.9), world_from_camera)
    } else {
        let (settings, frame) = robot.find_camera(&camera).with_context(|| format!("no camera `{camera}`"))?;
        let model = CameraModel::from_vertical_fov(settings.width, settings.height, settings.vertical_fov_rad);
        (model, links[frame.0])
    };

    let mut rig = CameraRig::new(&model, &visuals, &LightDraw::new(seed))?;
    let image = rig.render(&bodies, &links, &camera, &world_from_camera);
    let sensor = SensorModel::noisy(NoiseParameters::default())?;
    let sensed = sensor.sense(&image, &camera, NoiseKey { seed, stream: 0, frame: 0 });
    write(&format!("{prefix}_true.png"), &image, image.color.iter().copied())?;
    write(&format!("{prefix}_sensed.png"), &image, sensed.color.into_iter())?;
    let grey = |depth: f32| if depth > 0.0 { [(255.0 * (1.0 - depth / 8.0).clamp(0.1, 1.0)) as u8; 3] } else { [0; 3] };
    write(&format!("{prefix}_depth.png"), &image, sensed.depth_m.into_iter().map(grey))?;
    let tint = |label: &u32| [97_u32, 151, 211].map(|factor| (label.wrapping_mul(factor) % 256) as u8);
    write(&format!("{prefix}_labels.png"), &image, image.labels.iter().map(tint))
}
