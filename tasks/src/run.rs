//! One episode from its file to its summary.

use crate::episode::Episode;
use crate::error::TaskError;
use crate::journal::{Journal, Moment};
use crate::language::{Language, embedded};
use crate::perception::Tape;
use crate::replay::RecordingEnd;
use crate::session::{Keep, Session};
use crate::summary::Summary;
use dsm::map::Map;
use dsm_robot::model::ros2::Ros2Settings;
use dsm_robot::safety::StopSwitch;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Side of a free-space cell, metres.
pub(crate) const CELL_M: f64 = 0.05;

/// Behind which drivers the robot stands.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Drivers {
    /// The simulator's, in this process.
    #[default]
    Simulated,
    /// A robot that speaks ROS 2.
    Ros2(Box<Ros2Settings>),
}

impl Drivers {
    /// In one word.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Simulated => "simulated",
            Self::Ros2(_) => "ros2",
        }
    }
}

/// All that decides a run.
#[derive(Clone, Debug)]
pub struct RunSpec {
    /// Name of the episode.
    pub name: String,
    /// The episode file.
    pub file: PathBuf,
    /// The episode.
    pub episode: Episode,
    /// The scene's MJCF file or folder.
    pub scene: PathBuf,
    /// Robot by name or path.
    pub robot: String,
    /// Physics engine.
    pub physics: String,
    /// Perception preset.
    pub perception: String,
    /// Backend of language.
    pub language: Arc<dyn Language>,
    /// Where the robot stands.
    pub drivers: Drivers,
    /// Seed.
    pub seed: u64,
    /// Simulated time limit, seconds.
    pub time_limit_s: f64,
    /// Gives the simulator's label ids another meaning in every frame: nothing may change. Default false.
    pub permute_labels: bool,
    /// Stops the robot when it is pressed, by a key or whatever holds a copy of it.
    pub stop: StopSwitch,
}

impl RunSpec {
    /// A run of an episode that a program made: robot, seed and time limit as the episode says, the paths of its scene as
    /// seen from the working directory, physics, perception and language as by default.
    pub fn new(name: impl Into<String>, episode: Episode) -> Self {
        Self {
            name: name.into(),
            file: episode.scene.clone(),
            scene: episode.scene.clone(),
            robot: episode.robot.clone(),
            physics: "rapier".into(),
            perception: "noisy".into(),
            language: embedded(),
            drivers: Drivers::Simulated,
            seed: episode.seed,
            time_limit_s: episode.time_limit_s,
            permute_labels: false,
            stop: StopSwitch::default(),
            episode,
        }
    }
}

/// A finished run.
pub struct Finished {
    /// The account.
    pub summary: Summary,
    /// The map at the end.
    pub map: Arc<Map>,
    /// What happened along the way.
    pub journal: Journal,
    /// How its recording ended, when there is one.
    pub recorded: Option<RecordingEnd>,
}

/// Hears about a run while it goes on. Nothing that it does changes the run.
pub trait Progress {
    /// The simulated time, seconds.
    fn at(&mut self, sim_time_s: f64);

    /// A frame that was taken, and what is known so far. By default nobody looks.
    fn sees(&mut self, _: &Moment<'_>) {}
}

/// Nobody listens.
pub struct Silent;

impl Progress for Silent {
    fn at(&mut self, _: f64) {}
}

/// Runs an episode. The map is logged to `map_file` while it grows, and replaced by its compact form at the end.
pub fn run_episode(
    spec: &RunSpec,
    map_file: Option<&Path>,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Finished, TaskError> {
    run_taped(spec, map_file, Vec::new(), interrupted, progress)
}

/// As [`run_episode`]; `tapes` keep what the map is made of.
pub fn run_taped(
    spec: &RunSpec,
    map_file: Option<&Path>,
    tapes: Vec<Box<dyn Tape>>,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Finished, TaskError> {
    run_kept(spec, map_file, Keep { tapes, recorder: None }, interrupted, progress)
}

/// As [`run_episode`]; what `keep` says is kept of the run.
pub fn run_kept(
    spec: &RunSpec,
    map_file: Option<&Path>,
    keep: Keep,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Finished, TaskError> {
    let mut session = Session::begin_kept(spec, map_file, keep, interrupted, progress)?;
    session.run(&spec.episode.steps);
    session.finish()
}
