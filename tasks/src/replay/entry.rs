//! What a recording consists of.

use crate::assemble::find_robot;
use crate::episode::Episode;
use crate::error::TaskError;
use crate::executor::Account;
use crate::run::RunSpec;
use crate::summary::{Failure, StepSummary};
use dsm::frame::{FrameId, RgbdFrame};
use dsm::map::{Map, ObjectId};
use dsm::perceive::Detections;
use dsm::store::{StoreError, digest_bytes, encode_map};
use dsm::time::Stamp;
use dsm_robot::joints::JointNames;
use dsm_robot::model::RobotModel;
use dsm_robot::recorded::Period;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Version of the recordings that this program writes and reads.
pub const FORMAT: u32 = 1;

/// What is needed to run again. The first entry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// Version of the layout: [`FORMAT`].
    pub format: u32,
    /// Version of the program that recorded.
    pub program: String,
    /// Name of the episode.
    pub name: String,
    /// The episode.
    pub episode: Episode,
    /// The text of its file; empty when a program made it.
    pub episode_text: String,
    /// Robot by name or path.
    pub robot: String,
    /// Digest of `robot.toml` and the URDFs.
    pub robot_digest: String,
    /// Physics engine.
    pub physics: String,
    /// Perception preset.
    pub perception: String,
    /// Seed.
    pub seed: u64,
    /// Simulated time limit, seconds.
    pub time_limit_s: f64,
    /// Who detected.
    pub detector: String,
    /// Joints of the arm, in the order of their values.
    pub arm_joints: Vec<String>,
    /// Joints of the head, in the order of their values.
    pub head_joints: Vec<String>,
}

impl Head {
    /// Of a run that begins.
    pub(super) fn new(spec: &RunSpec, model: &RobotModel, detector: &str) -> Result<Self, TaskError> {
        let names = |joints: &JointNames| joints.iter().map(|name| name.to_string()).collect();
        Ok(Self {
            format: FORMAT,
            program: env!("CARGO_PKG_VERSION").into(),
            name: spec.name.clone(),
            episode: spec.episode.clone(),
            episode_text: std::fs::read_to_string(&spec.file).unwrap_or_default(),
            robot: spec.robot.clone(),
            robot_digest: robot_digest(&spec.robot, model)?,
            physics: spec.physics.clone(),
            perception: spec.perception.clone(),
            seed: spec.seed,
            time_limit_s: spec.time_limit_s,
            detector: detector.into(),
            arm_joints: names(&model.arm.joints),
            head_joints: names(&model.head.joints),
        })
    }
}

/// Tells descriptions of a robot apart, by the bytes of their files.
pub(super) fn robot_digest(robot: &str, model: &RobotModel) -> Result<String, TaskError> {
    let found = find_robot(robot)?;
    let folder = if found.is_dir() { found.clone() } else { found.parent().unwrap_or(&found).to_owned() };
    let file = if found.is_dir() { found.join("robot.toml") } else { found };
    let others = std::iter::once(&model.settings.urdf).chain(&model.settings.attachments).map(|name| folder.join(name));
    let mut bytes = Vec::new();
    for path in std::iter::once(file).chain(others) {
        bytes.extend(std::fs::read(&path).map_err(|source| TaskError::Read { path, source })?);
    }
    Ok(format!("{:016x}", digest_bytes(&bytes)))
}

/// What a frame taught.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Learnt {
    /// The frame.
    pub frame: FrameId,
    /// When it was taken.
    pub stamp: Stamp,
    /// What was detected in it.
    pub detections: Detections,
    /// Which detections (by place) were taken for which objects.
    pub associations: Vec<(u32, ObjectId)>,
    /// Tells what of the map changed apart from anything else.
    pub digest: u64,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Noted {
    /// When.
    pub stamp: Stamp,
    /// What, in words.
    pub what: String,
}

/// How a run ended, as the robot itself knows it. The last entry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct End {
    /// Whether Ctrl-C ended it.
    pub interrupted: bool,
    /// Accounts of its steps, without what the judge measured.
    pub steps: Vec<StepSummary>,
    /// The first failure that the robot knows of.
    pub failure: Option<Failure>,
    /// The map, as in a finished `map.dsm`.
    #[serde(skip)]
    pub map: Vec<u8>,
}

impl End {
    /// Of a run that is over.
    pub(super) fn new(account: &Account, map: &Map) -> Self {
        Self {
            interrupted: matches!(account.halt, Some(crate::agent::Halt::Interrupted)),
            steps: account.steps.clone(),
            failure: account.failure.clone(),
            map: encode_map(map),
        }
    }
}

/// One entry of a recording, in the order of the control loop.
#[derive(Clone, Debug)]
pub enum Entry {
    /// What is needed to run again.
    Head(Box<Head>),
    /// A frame that was read in the period that comes next.
    Frame(Box<RgbdFrame>),
    /// A control period.
    Period(Box<Period>),
    /// What a frame taught.
    Learnt(Box<Learnt>),
    /// The map after it: for viewers, and not read back.
    Map(Arc<Map>),
    /// An event.
    Noted(Noted),
    /// Nothing follows, for the file has become as large as it may.
    Full(Stamp),
    /// How the run ended.
    End(Box<End>),
}

/// A recording that is being written.
pub trait EntryFile: Send {
    /// Writes an entry.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    fn put(&mut self, entry: &Entry) -> Result<(), StoreError>;

    /// Bytes so far, about.
    fn len_bytes(&self) -> u64;

    /// Hands all that was written to the operating system, so that the process can be killed.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    fn flush(&mut self) -> Result<(), StoreError>;

    /// Closes the file.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    fn finish(self: Box<Self>) -> Result<(), StoreError>;
}

/// Which entries are wanted: images take long to unpack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// All of them.
    All,
    /// All but frames.
    AllButFrames,
}

/// A recording that is being read.
pub trait EntrySource: Send {
    /// The next entry; `None` at the end, and where the file breaks off.
    ///
    /// # Errors
    /// [`TaskError`]: it is damaged.
    fn next_entry(&mut self) -> Result<Option<Entry>, TaskError>;

    /// Why it breaks off, when it has.
    fn find_break(&self) -> Option<String>;
}
