//! Puts a run together: scene, robot, world, detector, judge. The only place that knows all of them.

use crate::deferred::Waiting;
use crate::engine::find_engine;
use crate::error::TaskError;
use crate::joint_bounds::JointBounds;
use crate::judge::Judge;
use crate::run::{Drivers, RunSpec};
use crate::summary::Summary;
use dsm::build::BuildConfig;
use dsm::eval::Truth;
use dsm::ground::{GroundConfig, Grounder};
use dsm::knowledge::Knowledge;
use dsm::map::Map;
use dsm::perceive::{Detector, PixelSegmenter};
use dsm_robot::drivers::Robot;
use dsm_robot::faults::Faulty;
use dsm_robot::model::RobotModel;
use dsm_robot::recorded::{RecordSink, Recording};
use dsm_robot::safety::{Envelope, StopSwitch};
use dsm_robot::timing::Synchronised;
use dsm_sim::disturb::DisturbanceError;
use dsm_sim::replay::{Moment, Replay};
use dsm_sim::scene::summarise_notes;
use dsm_sim::world::{LabelIds, Perception, StartPose, World, WorldConfig, WorldError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};

/// Folder of the robots that ship with the program, below the repository's root.
const ROBOTS: &str = "robot/models";

/// A run, ready to begin.
pub struct Assembled {
    /// The robot with its limits.
    pub robot: Box<dyn Robot>,
    /// Its model.
    pub model: Arc<RobotModel>,
    /// The detector.
    pub detector: Box<dyn Detector>,
    /// Samples of the truth, for the judge alone.
    pub truth: Receiver<Truth>,
    /// The judge.
    pub judge: Judge,
    /// Takes the words of the event log, for disturbances that wait for a stage of the task.
    pub words: Sender<String>,
}

/// Builds everything that a run needs.
pub fn assemble(spec: &RunSpec) -> Result<Assembled, TaskError> {
    assemble_recording(spec, None)
}

/// As [`assemble`]; `recorder` gets what is needed to see each image again.
pub fn assemble_recording(spec: &RunSpec, recorder: Option<Sender<Moment>>) -> Result<Assembled, TaskError> {
    let Bare { robot, model, detector, judged: Judged { truth, judge }, words } = assemble_bare(spec, recorder)?;
    let robot = enveloped(robot, &model, spec.stop.clone());
    Ok(Assembled { robot, model, detector, truth, judge, words })
}

/// A robot of the simulator without its envelope, and what belongs to it.
pub struct Bare {
    /// The robot as it breaks in this episode.
    pub robot: Box<dyn Robot>,
    /// Its model.
    pub model: Arc<RobotModel>,
    /// The detector.
    pub detector: Box<dyn Detector>,
    /// Who judges.
    pub judged: Judged,
    /// Takes the words of the event log, for disturbances that wait for a stage of the task.
    pub words: Sender<String>,
}

/// The judge and what it is to see.
pub struct Judged {
    /// Samples of the truth, for the judge alone.
    pub truth: Receiver<Truth>,
    /// The judge.
    pub judge: Judge,
}

impl Judged {
    /// Lets the judge see all samples that have come.
    pub fn observe(&mut self) {
        self.truth.try_iter().for_each(|sample| self.judge.observe(sample));
    }
}

/// Hands the summary and the map at the end of a run to whoever judges elsewhere.
pub type Tell = Box<dyn FnOnce(&Summary, &Map)>;

/// What a run is made of, wherever the robot stands.
pub struct Present {
    /// The robot with its limits.
    pub robot: Box<dyn Robot>,
    /// Its model.
    pub model: Arc<RobotModel>,
    /// The detector.
    pub detector: Box<dyn Detector>,
    /// Takes the words of the event log.
    pub words: Sender<String>,
    /// Who judges, where the world is ours.
    pub judged: Option<Judged>,
    /// Whether time waits for slow work.
    pub waiting: Waiting,
    /// Where the world is not ours: hands the account to whoever judges.
    pub tell: Option<Tell>,
}

/// What a run needs, behind the drivers that it asks for; `sink` gets all that the drivers below the limits are asked and
/// answer.
pub fn find_present(spec: &RunSpec, sink: Option<Box<dyn RecordSink>>) -> Result<Present, TaskError> {
    match &spec.drivers {
        Drivers::Simulated => {
            let Bare { robot, model, detector, judged, words } = assemble_bare(spec, None)?;
            let robot = limited(robot, &model, sink, spec.stop.clone());
            let (judged, waiting, tell) = (Some(judged), Waiting::ForResults, None);
            Ok(Present { robot, model, detector, words, judged, waiting, tell })
        }
        #[cfg(feature = "ros2")]
        Drivers::Ros2(settings) => crate::deploy::reach(spec, settings, sink),
        #[cfg(not(feature = "ros2"))]
        Drivers::Ros2(_) => Err(TaskError::no_ros2("--drivers ros2")),
    }
}

/// A robot within its limits, recorded below them if somebody records.
pub(crate) fn limited(
    robot: Box<dyn Robot>,
    model: &Arc<RobotModel>,
    sink: Option<Box<dyn RecordSink>>,
    stop: StopSwitch,
) -> Box<dyn Robot> {
    match sink {
        Some(sink) => enveloped(Recording::new(robot, model, sink), model, stop),
        None => enveloped(robot, model, stop),
    }
}

/// Loads the world of a run.
pub fn assemble_bare(spec: &RunSpec, recorder: Option<Sender<Moment>>) -> Result<Bare, TaskError> {
    let (model, world) = load(spec, recorder)?;
    for note in summarise_notes(world.notes()) {
        tracing::warn!("{note}");
    }
    let truth = world.truth_at_start();
    check_names(spec, &world)?;
    let bounds = model
        .groups
        .iter()
        .flat_map(|group| group.joints.iter().zip(&group.limits))
        .map(|(name, limit)| JointBounds {
            name: name.to_string(),
            position: (limit.lower, limit.upper),
            speed: limit.velocity,
        })
        .collect();
    let radius_m = model.settings.base.footprint_radius_m;
    let judge = Judge::new(truth, spec.episode.expectations.clone(), bounds, radius_m, hand_of(&model));
    let parts = world.into_parts();
    let detector: Box<dyn Detector> =
        if sees_pixels_alone(spec) { Box::new(PixelSegmenter) } else { Box::new(parts.detector) };
    let (robot, judged) = (with_faults(parts.robot, spec), Judged { truth: parts.truth, judge });
    Ok(Bare { robot, model, detector, judged, words: parts.words })
}

/// The robot as it breaks in this episode; it breaks within its envelope.
fn with_faults(robot: impl Robot + 'static, spec: &RunSpec) -> Box<dyn Robot> {
    let faults = &spec.episode.faults;
    if faults.is_empty() { Box::new(robot) } else { Box::new(Faulty::new(robot, faults.clone(), spec.seed)) }
}

/// The robot of a run without its envelope, to check its drivers.
pub fn bare_robot(spec: &RunSpec) -> Result<(Box<dyn Robot>, Arc<RobotModel>), TaskError> {
    match &spec.drivers {
        Drivers::Simulated => {
            let (model, world) = load(spec, None)?;
            Ok((with_faults(world.into_parts().robot, spec), model))
        }
        #[cfg(feature = "ros2")]
        Drivers::Ros2(settings) => crate::deploy::reach_bare(spec, settings),
        #[cfg(not(feature = "ros2"))]
        Drivers::Ros2(_) => Err(TaskError::no_ros2("--drivers ros2")),
    }
}

/// A driver within its safety envelope. Where `robot.toml` declares latencies its frames get the pose of their own moment.
pub(crate) fn enveloped<R: Robot + 'static>(driver: R, model: &Arc<RobotModel>, stop: StopSwitch) -> Box<dyn Robot> {
    if model.settings.has_latency() {
        let driver = Synchronised::new(driver, model.clone());
        Box::new(Envelope::new(driver, model).with_stop_switch(stop))
    } else {
        Box::new(Envelope::new(driver, model).with_stop_switch(stop))
    }
}

/// Loads and checks all inputs of a run without beginning it. Where the world is not ours that is the robot's model.
pub fn check(spec: &RunSpec) -> Result<(), TaskError> {
    // Networks that are missing or of another shape show here.
    spec.language.looks()?;
    spec.language.builder(BuildConfig::default())?;
    if spec.drivers != Drivers::Simulated {
        return Ok(RobotModel::load(&find_robot(&spec.robot)?).map(drop)?);
    }
    let (_, world) = load(spec, None)?;
    check_names(spec, &world)
}

fn load(spec: &RunSpec, recorder: Option<Sender<Moment>>) -> Result<(Arc<RobotModel>, World), TaskError> {
    let model = Arc::new(RobotModel::load(&find_robot(&spec.robot)?)?);
    let perception = preset(spec);
    let label_ids = if spec.permute_labels { LabelIds::PermutedPerFrame } else { LabelIds::default() };
    let start = spec.episode.start.map(|s| StartPose { x_m: s.x_m, y_m: s.y_m, yaw_rad: s.yaw_rad });
    let engine = find_engine(&spec.physics)?;
    let disturbances = spec.episode.disturbances.clone();
    let open = spec.episode.open.clone();
    let config = WorldConfig { seed: spec.seed, perception, start, engine, label_ids, recorder, disturbances, open };
    let world = World::load(&spec.scene, model.clone(), config).map_err(|error| match error {
        WorldError::Disturbance(DisturbanceError::NoFreeBody { body: name, known, .. }) => {
            let nearest = dsm::config::find_nearest(&name, known.iter().map(String::as_str)).map(str::to_owned);
            let (path, line) = (spec.file.clone(), line_of_name(&spec.file, &name));
            TaskError::UnknownName { path, line, what: "free body", name, nearest, known }
        }
        WorldError::NoPart { part: name, known } => {
            let nearest = dsm::config::find_nearest(&name, known.iter().map(String::as_str)).map(str::to_owned);
            let (path, line) = (spec.file.clone(), line_of_name(&spec.file, &name));
            TaskError::UnknownName { path, line, what: "door or drawer", name, nearest, known }
        }
        other => other.into(),
    })?;
    Ok((model, world))
}

fn preset(spec: &RunSpec) -> Perception {
    if spec.perception == "oracle" { Perception::Oracle } else { Perception::Noisy }
}

/// Whether things are found in pixels alone instead of by the simulated detector.
pub fn sees_pixels_alone(spec: &RunSpec) -> bool {
    spec.perception == "pixels"
}

/// The recorded drive of a run, ready to be seen again.
pub fn replay(spec: &RunSpec) -> Result<Replay, TaskError> {
    let model = Arc::new(RobotModel::load(&find_robot(&spec.robot)?)?);
    Ok(Replay::load(&spec.scene, model, preset(spec), spec.seed)?)
}

/// The folder of a robot: a path as given, or the name of a robot that ships with the program.
pub fn find_robot(robot: &str) -> Result<PathBuf, TaskError> {
    let given = Path::new(robot);
    if given.exists() {
        return Ok(given.to_owned());
    }
    let roots = [Path::new(ROBOTS).to_owned(), Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(ROBOTS)];
    if let Some(found) = roots.iter().map(|root| root.join(robot)).find(|folder| folder.join("robot.toml").is_file()) {
        return Ok(found);
    }
    let mut known: Vec<String> = roots
        .iter()
        .filter_map(|root| std::fs::read_dir(root).ok())
        .flat_map(|entries| entries.flatten())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    known.sort();
    known.dedup();
    Err(TaskError::Usage(format!(
        "robot `{robot}`: expected the path of a robot.toml, or one of: {}",
        known.join(", ")
    )))
}

/// Names in expectations must exist: a misspelt body would fail an episode for no reason that anyone sees.
fn check_names(spec: &RunSpec, world: &World) -> Result<(), TaskError> {
    let bodies = world.object_names();
    let rooms = world.room_names();
    let fail = |what: &'static str, name: &str, known: &[String]| {
        let nearest = dsm::config::find_nearest(name, known.iter().map(String::as_str)).map(str::to_owned);
        let (path, name, line) = (spec.file.clone(), name.to_owned(), line_of_name(&spec.file, name));
        Err(TaskError::UnknownName { path, line, what, name, nearest, known: known.to_vec() })
    };
    for e in &spec.episode.expectations {
        for body in [&e.object, &e.surface].into_iter().flatten() {
            if !bodies.contains(body) {
                return fail("body", body, &bodies);
            }
        }
        if let Some(room) = &e.room
            && !rooms.contains(room)
        {
            return fail("room", room, &rooms);
        }
    }
    Ok(())
}

/// The first line that gives the name as a value; 1 when there is none.
fn line_of_name(file: &Path, name: &str) -> usize {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let value = format!("\"{name}\"");
    let gives = |line: &str| line.split_once('=').is_some_and(|(_, rest)| rest.trim_start().starts_with(&value));
    text.lines().position(gives).map_or(1, |index| index + 1)
}

/// The embedded knowledge.
pub fn knowledge() -> Result<Arc<Knowledge>, TaskError> {
    Knowledge::embedded().map(Arc::new).map_err(|e| TaskError::Internal(e.to_string()))
}

/// The embedded grounder.
pub fn grounder() -> Result<Arc<Grounder>, TaskError> {
    let grounder = Grounder::new(GroundConfig::default(), knowledge()?);
    grounder.map(Arc::new).map_err(|e| TaskError::Internal(e.to_string()))
}

/// Names of the links of the hand: the fingers, and the palm that carries them.
fn hand_of(model: &RobotModel) -> Vec<String> {
    let fingers = &model.settings.gripper.finger_links;
    let joints = &model.kinematics.joints;
    let of_finger = |finger: &String| joints.iter().find(|joint| model.kinematics.links[joint.child.0].name == *finger);
    let palms = fingers.iter().filter_map(of_finger).map(|joint| model.kinematics.links[joint.parent.0].name.clone());
    let mut hand: Vec<String> = fingers.iter().cloned().chain(palms).collect();
    hand.dedup();
    hand
}
