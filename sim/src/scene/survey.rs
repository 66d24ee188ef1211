//! One MJCF file tried: does it load, does it come to rest on an engine, is there something to see.

use super::model::{BodyMotion, SceneBody, SceneGeom, SceneModel, SceneShape};
use super::notes::SceneNote;
use super::scene_file;
use super::semantics::Semantics;
use super::source::is_part;
use crate::camera::{CameraRig, LightDraw};
use crate::physics::Engine;
use crate::world::WorldError;
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::geometry::Aabb;
use dsm::time::Span;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Time that a scene is left to itself.
const REST: Span = Span(1_000_000_000);
/// Size of the frame in pixels, and its vertical field of view.
const FRAME: (u32, u32, f64) = (640, 480, 0.8);
/// Wider scenes are rooms: their walls hide what is in them, so they are seen from farther above. Metres.
const ROOM_M: f64 = 3.0;

/// Nothing is looked at from farther away than the renderer draws, metres.
const FARTHEST_M: f64 = 80.0;

/// How far a file came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Loaded, simulated and drawn.
    Works,
    /// It is no model but a piece for others to include.
    Part,
    /// It failed.
    Fails(Stage),
}

/// Where a file failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Reading it.
    Load,
    /// Simulating it.
    Simulate,
    /// Drawing it.
    Draw,
}

/// What was found out about one file.
#[derive(Clone, Debug, Serialize)]
pub struct SurveyedScene {
    /// The file.
    pub file: PathBuf,
    /// How far it came.
    pub outcome: Outcome,
    /// Why it failed.
    pub reason: Option<String>,
    /// Bodies besides the world.
    pub bodies: usize,
    /// How many of them are free.
    pub free_bodies: usize,
    /// Geoms.
    pub geoms: usize,
    /// Meshes.
    pub meshes: usize,
    /// Textures.
    pub textures: usize,
    /// Lights.
    pub lights: usize,
    /// Categories of the objects, without doubles.
    pub categories: BTreeSet<String>,
    /// What is not done as the file says.
    pub notes: Vec<SceneNote>,
    /// Free bodies that moved by more than a centimetre while the scene was left to itself.
    pub moved: usize,
    /// Share of the frame's pixels that show something of the scene.
    pub seen: f64,
}

/// A picture of a scene, sRGB, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Colours.
    pub rgb: Vec<[u8; 3]>,
}

/// Loads a file, leaves it to itself for a second on the engine and draws one frame of what then is there.
pub fn survey_scene(path: &Path, engine: &dyn Engine) -> (SurveyedScene, Option<Frame>) {
    let file = scene_file(path);
    let mut survey = SurveyedScene {
        outcome: Outcome::Works,
        reason: None,
        bodies: 0,
        free_bodies: 0,
        geoms: 0,
        meshes: 0,
        textures: 0,
        lights: 0,
        categories: BTreeSet::new(),
        notes: Vec::new(),
        moved: 0,
        seen: 0.0,
        file,
    };
    if is_part(&survey.file) {
        survey.outcome = Outcome::Part;
        return (survey, None);
    }
    match try_scene(&mut survey, engine) {
        Ok(frame) => (survey, Some(frame)),
        Err((stage, error)) => {
            (survey.outcome, survey.reason) = (Outcome::Fails(stage), Some(error.to_string()));
            (survey, None)
        }
    }
}

fn try_scene(survey: &mut SurveyedScene, engine: &dyn Engine) -> Result<Frame, (Stage, WorldError)> {
    let at = |stage: Stage| move |error: WorldError| (stage, error);
    let (scene, notes) =
        SceneModel::load_with_notes(&survey.file).map_err(WorldError::from).map_err(at(Stage::Load))?;
    let semantics = Semantics::load(&survey.file, &scene).map_err(WorldError::from).map_err(at(Stage::Load))?;
    survey.bodies = scene.bodies.len() - 1;
    survey.free_bodies = scene.bodies.iter().filter(|body| body.motion == BodyMotion::Free).count();
    survey.geoms = scene.bodies.iter().map(|body| body.geoms.len()).sum();
    (survey.meshes, survey.textures, survey.lights) = (scene.meshes.len(), scene.textures.len(), scene.lights.len());
    survey.categories = semantics.objects.into_iter().map(|object| object.category).collect();
    survey.notes = notes;
    let poses = engine.settle(&scene, REST).map_err(WorldError::from).map_err(at(Stage::Simulate))?;
    // What is not a number is not near.
    let stays = |(body, pose): (&SceneBody, &Pose)| {
        (body.world_from_body.translation.vector - pose.translation.vector).norm() <= 0.01
    };
    survey.moved = scene.bodies.iter().zip(&poses).filter(|pair| !stays(*pair)).count();
    let mut rig =
        CameraRig::new(&scene, &[], &LightDraw::unchanged()).map_err(WorldError::from).map_err(at(Stage::Draw))?;
    let (width, height, fov_rad) = FRAME;
    let camera = CameraModel::from_vertical_fov(width, height, fov_rad);
    let world_from_camera = choose_view(&scene, &poses);
    let image = rig.render(&poses, &[], &camera, &world_from_camera);
    let shown = image.labels.iter().filter(|label| **label != 0).count();
    survey.seen = shown as f64 / image.labels.len().max(1) as f64;
    Ok(Frame { width, height, rgb: image.color })
}

/// A camera that has all of the scene in view, from the front and aslant from above. Planes count only where there is
/// nothing else: many reach farther than what stands on them.
fn choose_view(scene: &SceneModel, poses: &[Pose]) -> Pose {
    let is_plane = |geom: &SceneGeom| matches!(geom.shape, SceneShape::Plane { .. });
    let seen = || scene.bodies.iter().flat_map(|body| &body.geoms).filter(|geom| geom.visible);
    let has_solids = seen().any(|geom| !is_plane(geom));
    let mut points = Vec::new();
    for (body, pose) in scene.bodies.iter().zip(poses) {
        for geom in body.geoms.iter().filter(|geom| geom.visible && !(has_solids && is_plane(geom))) {
            let world_from_geom = pose * geom.body_from_geom;
            points.extend(outline(scene, &geom.shape).into_iter().map(|point| world_from_geom * point));
        }
    }
    points.retain(|point| point.coords.iter().all(|c| c.is_finite() && c.abs() < 1e3));
    let bounds = Aabb::from_points(&points).unwrap_or(Aabb { min: Point3::origin(), max: Point3::new(1.0, 1.0, 1.0) });
    let middle = nalgebra::center(&bounds.min, &bounds.max);
    let radius_m = (0.5 * (bounds.max - bounds.min).norm()).max(0.02);
    let down_rad: f64 = if 2.0 * radius_m > ROOM_M { 1.0 } else { 0.5 };
    let heading_rad: f64 = 2.4;
    let forward = Vector3::new(heading_rad.cos() * down_rad.cos(), heading_rad.sin() * down_rad.cos(), -down_rad.sin());
    let right = forward.cross(&Vector3::z()).normalize();
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let away_m = (radius_m / (0.5 * FRAME.2).sin()).min(FARTHEST_M);
    Pose::from_parts(Translation3::from(middle.coords - forward * away_m), rotation)
}

/// Points of a shape in its own frame that no other point of it reaches beyond; none of an unbounded plane.
fn outline(scene: &SceneModel, shape: &SceneShape) -> Vec<Point3<f64>> {
    let half = match *shape {
        SceneShape::Plane { half_m: [x, y] } if x <= 0.0 || y <= 0.0 => return Vec::new(),
        SceneShape::Plane { half_m: [x, y] } => Vector3::new(x, y, 0.0),
        SceneShape::Box { half_m } => half_m,
        SceneShape::Sphere { radius_m } => Vector3::repeat(radius_m),
        SceneShape::Cylinder { radius_m, half_length_m } => Vector3::new(radius_m, radius_m, half_length_m),
        SceneShape::Capsule { radius_m, half_length_m } => Vector3::new(radius_m, radius_m, radius_m + half_length_m),
        SceneShape::Ellipsoid { radii_m } => radii_m,
        SceneShape::Mesh { mesh } => {
            return scene.meshes[mesh].positions.iter().map(|point| point.cast::<f64>()).collect();
        }
    };
    let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    (0..8).map(|corner| Point3::from(Vector3::from_fn(|axis, _| sign(corner, axis) * half[axis]))).collect()
}
