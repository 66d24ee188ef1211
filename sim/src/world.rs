//! A scene, a robot and a seed put together, and the truth about it.
//!
//! ```text
//! scene + semantics ──seed: placement, light, start──▶ settled scene ──▶ physics ──▶ SimRobot
//!                                                                         │  └─images, labels─▶ SimDetector
//!                                                                         └─truth (for the judge alone)
//! ```

mod ajar;
pub(crate) mod imager;
mod placement;
mod solids;
mod truth;

pub use ajar::OpenPart;
pub use placement::StartPose;
pub(crate) use placement::{Mover, scene_bounds, stream};
pub(crate) use solids::{Column, Solids};
pub(crate) use truth::FLOOR_TOP_M;

use crate::camera::{CameraError, CameraRig, LightDraw, NoiseError, NoiseParameters, SensorModel, robot_visuals};
pub use crate::detect::{DetectorPreset as Perception, LabelIds};
use crate::detect::{SimDetector, label_channel};
use crate::disturb::{Disturbance, DisturbanceError, Disturber, Wires, add_actors};
use crate::physics::{Engine, Physics, PhysicsConfig, PhysicsError, Rapier, RobotBody, RobotStart, settle_scene};
use crate::replay::Moment;
use crate::robot::{LocalisationConfig, LocalisationNoise, SimRobot, SimRobotError};
use crate::scene::{BodyMotion, SceneError, SceneModel, SceneNote, Semantics, SemanticsError, scene_file};
use dsm::Pose;
use dsm::eval::{TrueRoom, TrueWorld, Truth};
use dsm::map::{CellState, FreeSpace};
use dsm::time::Span;
use dsm_robot::model::RobotModel;
use imager::WorldImager;
use nalgebra::Point2;
use placement::{draw_placements, find_obstruction, find_start};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use thiserror::Error;
use truth::TruthSampler;

/// Time in which the world comes to rest before the run begins.
const REST: Span = Span(1_000_000_000);
/// A thing that moves farther while coming to rest did not find a good place and goes back to its own, metres.
const FALLEN_M: f64 = 0.03;
/// A joint that moves less than this while the world comes to rest did not move, radians or metres.
const STOOD: f64 = 1e-5;
/// Resolution of the true free space, metres.
const CELL_M: f64 = 0.05;
/// Posture that a robot starts in, when it has it: folded for driving.
const START_POSTURE: &str = "carry";

/// Why a world cannot be built.
#[derive(Debug, Error, PartialEq)]
pub enum WorldError {
    /// The scene.
    #[error(transparent)]
    Scene(Box<SceneError>),
    /// Its semantics.
    #[error(transparent)]
    Semantics(#[from] SemanticsError),
    /// Scene and robot cannot be simulated.
    #[error(transparent)]
    Physics(#[from] PhysicsError),
    /// The scene cannot be drawn.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The sensor model's parameters.
    #[error(transparent)]
    Noise(#[from] NoiseError),
    /// The robot's drivers cannot be simulated.
    #[error(transparent)]
    Robot(#[from] SimRobotError),
    /// What is to disturb it cannot.
    #[error(transparent)]
    Disturbance(#[from] DisturbanceError),
    /// A part that is to stand open is none.
    #[error("`{part}` is no door or drawer with an end to its way; those of the scene: {}", known.join(", "))]
    NoPart {
        /// The body.
        part: String,
        /// Doors and drawers of the scene.
        known: Vec<String>,
    },
    /// No free place for the robot.
    #[error("scene `{scene}`: no free place for a robot of radius {radius_m} m in the start areas of semantics.toml")]
    NoStart {
        /// The scene.
        scene: String,
        /// Radius of the footprint.
        radius_m: f64,
    },
    /// Something stands where the robot is to start.
    #[error("scene `{scene}`: the robot cannot start at ({x_m}, {y_m}): `{body}` is in the way")]
    StartBlocked {
        /// The scene.
        scene: String,
        /// Along x, metres.
        x_m: f64,
        /// Along y, metres.
        y_m: f64,
        /// The body in the way.
        body: String,
    },
}

impl From<SceneError> for WorldError {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}

/// What a world is built with besides scene and robot.
#[derive(Clone, Debug)]
pub struct WorldConfig {
    /// Seed of everything that is drawn: start pose, placement, light, noise. Default 0.
    pub seed: u64,
    /// How good detector, cameras and localisation are; default noisy.
    pub perception: Perception,
    /// Where the robot starts; drawn from the seed when absent (the default).
    pub start: Option<StartPose>,
    /// The engine that runs the world; default rapier. What the seed draws comes to rest in rapier whatever runs, so
    /// that a seed places things alike on all.
    pub engine: Arc<dyn Engine>,
    /// Which label ids the cameras hand to the detector; they make no difference.
    pub label_ids: LabelIds,
    /// Gets what is needed to see each image again; `None` by default.
    pub recorder: Option<Sender<Moment>>,
    /// What happens to the world while it runs; nothing by default.
    pub disturbances: Vec<Disturbance>,
    /// Doors and drawers that stand open when it begins; none by default.
    pub open: Vec<OpenPart>,
}

impl Default for WorldConfig {
    fn default() -> Self {
        Self {
            seed: 0,
            perception: Perception::default(),
            start: None,
            engine: Arc::new(Rapier::default()),
            label_ids: LabelIds::default(),
            recorder: None,
            disturbances: Vec::new(),
            open: Vec::new(),
        }
    }
}

/// A world at rest, ready to run.
pub struct World {
    scene: SceneModel,
    notes: Vec<SceneNote>,
    semantics: Semantics,
    floor: FreeSpace,
    parts: WorldParts,
}

/// What a run needs of a world.
pub struct WorldParts {
    /// The robot behind its drivers; its clock moves the world.
    pub robot: SimRobot,
    /// The detector for the frames of its cameras.
    pub detector: SimDetector,
    /// Samples of the truth, 20 a second; for the judge alone.
    pub truth: Receiver<Truth>,
    /// Takes the words of the event log, on which disturbances may wait; nothing comes back.
    pub words: Sender<String>,
}

impl World {
    /// Loads a scene (its file or folder), applies the draws of the seed, lets it come to rest and puts the robot in.
    ///
    /// # Errors
    /// [`WorldError`]: whatever is wrong with the scene, its semantics or the robot's body, and a start without room.
    pub fn load(scene: &Path, robot: Arc<RobotModel>, config: WorldConfig) -> Result<Self, WorldError> {
        let (mut model, notes) = SceneModel::load_with_notes(scene)?;
        let semantics = Semantics::load(&scene_file(scene), &model)?;
        let solids = Solids::new(&model)?;
        settle(&mut model, &semantics, &solids, &config)?;
        ajar::stand_open(&mut model, &config.open)?;
        let base = &robot.settings.base;
        let size_m = (base.footprint_radius_m, base.height_m);
        let start = choose_start(&model, &semantics, &solids, size_m, &config)?;
        let body = RobotBody::of(&robot)?;
        let joints = robot
            .find_posture(START_POSTURE)
            .map_or_else(Vec::new, |posture| posture.iter().map(|(name, value)| (name.to_owned(), value)).collect());
        let start = RobotStart { x_m: start.x_m, y_m: start.y_m, yaw_rad: start.yaw_rad, joints };
        // What disturbs is no part of the scene that anybody is asked about.
        let mut staged = (!config.disturbances.is_empty()).then(|| model.clone());
        let actors = staged.as_mut().map_or_else(Vec::new, |staged| add_actors(staged, &config.disturbances));
        let shown = staged.as_ref().unwrap_or(&model);
        let physics = config.engine.build(shown, &body, &start)?;
        // Who can open doors is not kept in by them.
        let open = semantics.with_doorways_open(&model);
        let floor = free_space(&open, &Solids::new(&open)?, base.height_m);
        let parts = connect(shown, &semantics, &robot, physics, &config, (&actors, &floor))?;
        Ok(Self { scene: model, notes, semantics, floor, parts })
    }

    /// What of the scene is not done as its file says.
    pub fn notes(&self) -> &[SceneNote] {
        &self.notes
    }

    /// Bodies that count as objects, in the order of semantics.toml.
    pub fn object_names(&self) -> Vec<String> {
        self.semantics.objects.iter().map(|object| object.body.clone()).collect()
    }

    /// Names of the rooms.
    pub fn room_names(&self) -> Vec<String> {
        self.semantics.rooms.iter().map(|room| room.name.clone()).collect()
    }

    /// What does not change during the run: rooms and free floor. For the judge alone.
    pub fn truth_at_start(&self) -> TrueWorld {
        let room = |room: &crate::scene::RoomSemantics| TrueRoom {
            name: room.name.clone(),
            polygon: room.polygon.iter().map(|[x, y]| Point2::new(*x, *y)).collect(),
        };
        TrueWorld {
            scene: self.scene.name.clone(),
            rooms: self.semantics.rooms.iter().map(room).collect(),
            free_space: self.floor.clone(),
        }
    }

    /// Hands out the parts of a run.
    pub fn into_parts(self) -> WorldParts {
        self.parts
    }
}

/// Draws placements and lets the scene come to rest; things that fall from their drawn place go back to their own.
pub(crate) fn settle(
    model: &mut SceneModel,
    semantics: &Semantics,
    solids: &Solids,
    config: &WorldConfig,
) -> Result<(), WorldError> {
    let authored: Vec<Pose> = model.bodies.iter().map(|body| body.world_from_body).collect();
    draw_placements(model, semantics, solids, config.seed);
    let mut rested = settle_scene(model, REST, PhysicsConfig::default())?;
    let fallen = |model: &SceneModel, rested: &[Pose]| {
        let moved = |(body, pose): (&crate::scene::SceneBody, &Pose)| {
            let shift = body.world_from_body.translation.vector - pose.translation.vector;
            body.motion == BodyMotion::Free && shift.norm() > FALLEN_M
        };
        model.bodies.iter().zip(rested).any(moved)
    };
    if fallen(model, &rested) {
        // A thing that falls may have pushed others: the whole draw goes back to where the author put things.
        for (body, pose) in model.bodies.iter_mut().zip(&authored) {
            body.world_from_body = *pose;
        }
        rested = settle_scene(model, REST, PhysicsConfig::default())?;
    }
    let standing: Vec<Pose> = model.joints.iter().map(|joint| model.standing_part(joint)).collect();
    let before: Vec<f64> = model.joints.iter().map(|joint| model.joint_position(joint)).collect();
    for (body, pose) in model.bodies.iter_mut().zip(&rested) {
        if body.motion == BodyMotion::Free {
            body.world_from_body = *pose;
        }
    }
    // Carriers come first: what they carry stands on the joint where it came to rest, or as it stood.
    for (joint, (standing, before)) in model.joints.iter().zip(standing.iter().zip(before)) {
        let position = joint.find_position(&rested[joint.carrier], &rested[joint.part]);
        let moved = (position - before).abs() > STOOD;
        let carrier_from_part = if moved { joint.carrier_from_part(position) } else { *standing };
        model.bodies[joint.part].world_from_body = model.bodies[joint.carrier].world_from_body * carrier_from_part;
    }
    Ok(())
}

fn choose_start(
    model: &SceneModel,
    semantics: &Semantics,
    solids: &Solids,
    size_m: (f64, f64),
    config: &WorldConfig,
) -> Result<StartPose, WorldError> {
    let Some(start) = config.start else {
        let drawn = find_start(model, semantics, solids, size_m, config.seed);
        return drawn.ok_or_else(|| WorldError::NoStart { scene: model.name.clone(), radius_m: size_m.0 });
    };
    match find_obstruction(model, solids, &start, size_m) {
        None => Ok(start),
        Some(body) => Err(WorldError::StartBlocked {
            scene: model.name.clone(),
            x_m: start.x_m,
            y_m: start.y_m,
            body: model.bodies[body].name.clone(),
        }),
    }
}

/// Wires cameras, detector and truth to the physics.
fn connect(
    model: &SceneModel,
    semantics: &Semantics,
    robot: &RobotModel,
    mut physics: Box<dyn Physics>,
    config: &WorldConfig,
    (actors, floor): (&[Option<usize>], &FreeSpace),
) -> Result<WorldParts, WorldError> {
    let seed = config.seed;
    let (labels, label_receiver) = label_channel(config.label_ids);
    let (view_sender, views) = channel();
    let (truth_sender, truth) = channel();
    let (words, heard) = channel();
    let (told, happenings) = channel();
    let need = Disturber::find_need_of_hands(&config.disturbances);
    if let (Some(kind), None) = (need, physics.hands()) {
        return Err(DisturbanceError::NoHands { kind: kind.name() }.into());
    }
    let wires = Wires { heard, told };
    let disturber =
        Disturber::new(&config.disturbances, actors, model, Solids::new(model)?, floor, config.seed, wires)?;
    let visuals = robot_visuals(&robot.kinematics);
    let rig = CameraRig::new(model, &visuals, &LightDraw::new(seed))?.showing(model, &semantics.find_wholes(model));
    let (sensor, localisation) = match config.perception {
        Perception::Noisy => (SensorModel::noisy(NoiseParameters::default())?, LocalisationNoise::Noisy),
        Perception::Oracle => (SensorModel::oracle(), LocalisationNoise::None),
    };
    let imager = WorldImager::new(rig, sensor, labels, view_sender, config.recorder.clone(), seed);
    let base = &robot.settings.base;
    let size_m = (base.footprint_radius_m, base.height_m);
    let mut sampler =
        TruthSampler::new(truth_sender, (views, happenings), model, semantics, Solids::new(model)?, size_m);
    sampler.observe(physics.as_ref());
    let localisation = LocalisationConfig { seed, noise: localisation };
    let robot = SimRobot::new(physics, robot, Box::new(imager), localisation)?
        .with_disturber(disturber)
        .with_observer(Box::new(move |physics| sampler.observe(physics)));
    let detector = SimDetector::new(label_receiver, model, semantics, config.perception, seed);
    Ok(WorldParts { robot, detector, truth, words })
}

/// Where nothing of a scene, as its file has it, stands between floor and a robot's height.
///
/// # Errors
/// A solid that the scene does not describe well.
pub fn floor_of(scene: &SceneModel, height_m: f64) -> Result<FreeSpace, WorldError> {
    Ok(free_space(scene, &Solids::new(scene)?, height_m))
}

/// Where nothing stands between floor and the robot's height.
pub(crate) fn free_space(scene: &SceneModel, solids: &Solids, height_m: f64) -> FreeSpace {
    let mut grid = FreeSpace::new(CELL_M);
    let bounds = scene_bounds(scene, solids);
    let cells = |low: f64, high: f64| (low / CELL_M).floor() as i32..=(high / CELL_M).floor() as i32;
    for row in cells(bounds.min.y, bounds.max.y) {
        for column in cells(bounds.min.x, bounds.max.x) {
            grid.set([column, row], CellState::Free);
        }
    }
    for solid in solids.iter().filter(|solid| !solid.is_plane) {
        let pose = &scene.bodies[solid.body].world_from_body;
        let around = solid.bounds(pose);
        if around.max.z <= FLOOR_TOP_M || around.min.z >= height_m {
            continue;
        }
        for row in cells(around.min.y, around.max.y) {
            for column in cells(around.min.x, around.max.x) {
                let center = grid.center_of([column, row]);
                let post = Column {
                    x_m: center.x,
                    y_m: center.y,
                    radius_m: 0.5 * CELL_M,
                    bottom_m: FLOOR_TOP_M,
                    top_m: height_m,
                };
                if solid.find_distance_to_column_m(pose, &post, 0.0).is_some() {
                    grid.set([column, row], CellState::Occupied);
                }
            }
        }
    }
    grid
}
