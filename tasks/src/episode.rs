//! Episode files: a scene, a robot, commands, and what must be true afterwards.

use crate::error::TaskError;
use dsm::config::{ConfigError, line_of, parse_toml};
use dsm_robot::faults::Fault;
use dsm_sim::disturb::Disturbance;
use dsm_sim::world::OpenPart;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The version of episode files that this program reads.
pub const EPISODE_VERSION: u32 = 1;

/// An episode, as written in `episodes/*.toml`. Paths are relative to the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Episode {
    /// Format version; 1.
    pub version: u32,
    /// The scene's MJCF file or its folder.
    pub scene: PathBuf,
    /// Name of a robot that ships with the program, or a path to its `robot.toml`.
    #[serde(default = "default_robot")]
    pub robot: String,
    /// Seed of every draw: start pose, placements, light, noise. Default 0.
    #[serde(default)]
    pub seed: u64,
    /// Simulated time after which the episode ends, seconds. Default 240, range 1 to 36000.
    #[serde(default = "default_time_limit_s")]
    #[schemars(range(min = 1.0, max = 36000.0))]
    pub time_limit_s: f64,
    /// Start pose of the base; drawn from the seed when left out.
    #[serde(default)]
    pub start: Option<Start>,
    /// What is to be done, in order.
    #[serde(default, rename = "step")]
    pub steps: Vec<Step>,
    /// What must be true afterwards, by ground truth.
    #[serde(default, rename = "expect")]
    pub expectations: Vec<Expectation>,
    /// What happens to the world meanwhile. The robot learns of it by its senses alone.
    #[serde(default, rename = "disturb")]
    pub disturbances: Vec<Disturbance>,
    /// Doors and drawers that stand open at the start.
    #[serde(default)]
    pub open: Vec<OpenPart>,
    /// What breaks in the robot meanwhile: drivers, sensors, clock, connection. Its safety envelope has to find out.
    #[serde(default, rename = "fault")]
    pub faults: Vec<Fault>,
}

/// Start pose of the base in the world frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// x in metres.
    pub x_m: f64,
    /// y in metres.
    pub y_m: f64,
    /// Heading in radians, 0 along x.
    #[serde(default)]
    pub yaw_rad: f64,
}

/// One step: an English `command`, or a `skill` with a `target` in words.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// A command in English, for example `Grasp the red apple on the table`.
    #[serde(default)]
    pub command: Option<String>,
    /// A skill by name.
    #[serde(default)]
    pub skill: Option<SkillName>,
    /// What the skill acts on, in words.
    #[serde(default)]
    pub target: Option<String>,
}

/// The skills.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SkillName {
    /// Sees all that can be reached.
    Explore,
    /// Drives to an object or a room.
    Navigate,
    /// Drives to an object and lifts it.
    Grasp,
    /// Turns the head from gaze to gaze and rests at each while all else stands still: `dsm calibrate` needs such a recording.
    Wiggle,
}

/// What an expectation is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExpectationKind {
    /// The robot ends within `within_m` of the object with the object in view, or inside `room`.
    RobotNear,
    /// The object is lifted by `height_m` and held for `hold_s`.
    ObjectLifted,
    /// The object rests on `surface` for `hold_s`.
    ObjectOn,
    /// The last grounding points at the object.
    Grounding,
    /// A part of the object (`part`, or any) is open by `at_least` of its way for `hold_s`, and nothing else was moved or pressed.
    JointOpen,
    /// The part of the object (`part`, or all) is closed for `hold_s`, and nothing else was moved or pressed.
    JointClosed,
    /// The robot refused: it said that the target is absent or ambiguous, and touched nothing.
    Refused,
}

/// Something that must be true, judged from ground truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expectation {
    /// The kind.
    pub kind: ExpectationKind,
    /// MJCF body.
    #[serde(default)]
    pub object: Option<String>,
    /// Name of a room in the scene's semantics (`robot_near` only).
    #[serde(default)]
    pub room: Option<String>,
    /// MJCF body of the support (`object_on` only).
    #[serde(default)]
    pub surface: Option<String>,
    /// MJCF body of a door or drawer of the object (`joint_open`, `joint_closed` only); any of them, or all, when left out.
    #[serde(default)]
    pub part: Option<String>,
    /// Share of its way for `joint_open`. Default 0.6, range 0.05 to 1.
    #[serde(default = "default_at_least")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub at_least: f64,
    /// Distance for `robot_near`, metres. Default 1, range 0.1 to 10.
    #[serde(default = "default_within_m")]
    #[schemars(range(min = 0.1, max = 10.0))]
    pub within_m: f64,
    /// Height for `object_lifted`, metres. Default 0.10, range 0.01 to 2.
    #[serde(default = "default_height_m")]
    #[schemars(range(min = 0.01, max = 2.0))]
    pub height_m: f64,
    /// Time for `object_lifted`, `object_on`, `joint_open` and `joint_closed`, seconds. Default 2, range 0 to 60.
    #[serde(default = "default_hold_s")]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub hold_s: f64,
}

fn default_robot() -> String {
    "porter".into()
}

fn default_time_limit_s() -> f64 {
    240.0
}

fn default_within_m() -> f64 {
    1.0
}

fn default_height_m() -> f64 {
    0.10
}

fn default_hold_s() -> f64 {
    2.0
}

fn default_at_least() -> f64 {
    0.6
}

impl Episode {
    /// Reads and checks an episode file.
    pub fn load(path: &Path) -> Result<Self, TaskError> {
        let text = std::fs::read_to_string(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
        let episode: Self = parse_toml(&text, path)?;
        episode.check(&text, path)?;
        Ok(episode)
    }

    /// The scene's path as seen from the working directory.
    pub fn scene_path(&self, file: &Path) -> PathBuf {
        file.parent().unwrap_or(Path::new(".")).join(&self.scene)
    }

    fn check(&self, text: &str, path: &Path) -> Result<(), TaskError> {
        let fail = |key: &str, nth: usize, expected: String| -> Result<(), TaskError> {
            let offset = text.match_indices(key).nth(nth).map_or(0, |(offset, _)| offset);
            let message = format!("{key}: expected {expected}");
            Err(ConfigError::Invalid { file: path.to_owned(), line: line_of(text, offset), message }.into())
        };
        if self.version != EPISODE_VERSION {
            return fail("version", 0, format!("version {EPISODE_VERSION}, got {}", self.version));
        }
        if let Some(start) = self.start
            && ![start.x_m, start.y_m, start.yaw_rad].iter().all(|v| v.is_finite())
        {
            return fail("start", 0, "finite x_m, y_m and yaw_rad".into());
        }
        if self.steps.is_empty() {
            return fail("step", 0, "at least one [[step]]".into());
        }
        for (i, step) in self.steps.iter().enumerate() {
            let complete = match (&step.command, step.skill, &step.target) {
                (Some(command), None, None) => !command.trim().is_empty(),
                (None, Some(SkillName::Explore | SkillName::Wiggle), None) => true,
                (None, Some(SkillName::Navigate | SkillName::Grasp), Some(target)) => !target.trim().is_empty(),
                _ => false,
            };
            if !complete {
                return fail(
                    "[[step]]",
                    i,
                    "either command = \"text\", or skill = explore | wiggle, or skill = navigate | grasp with its target = \"text\""
                        .into(),
                );
            }
        }
        for (i, e) in self.expectations.iter().enumerate() {
            if let Some(needs) = e.find_flaw() {
                return fail("[[expect]]", i, format!("{needs} for this kind"));
            }
        }
        for (i, disturbance) in self.disturbances.iter().enumerate() {
            if let Some(expected) = disturbance.find_flaw() {
                return fail("[[disturb]]", i, expected.into());
            }
        }
        for (i, open) in self.open.iter().enumerate() {
            if let Some(expected) = open.find_flaw() {
                return fail("[[open]]", i, expected.into());
            }
        }
        for (i, fault) in self.faults.iter().enumerate() {
            if let Some(expected) = fault.find_flaw() {
                return fail("[[fault]]", i, expected.into());
            }
        }
        Ok(())
    }
}

impl Step {
    /// A command in English.
    pub fn command(text: impl Into<String>) -> Self {
        Self { command: Some(text.into()), ..Self::default() }
    }
}

impl Expectation {
    /// What has to be named for this kind and is not.
    pub fn find_flaw(&self) -> Option<&'static str> {
        let (object, room, surface) = (self.object.is_some(), self.room.is_some(), self.surface.is_some());
        let (complete, needs) = match self.kind {
            ExpectationKind::RobotNear => (object != room, "object or room (one of them)"),
            ExpectationKind::ObjectOn => (object && surface, "object and surface"),
            ExpectationKind::Refused => (true, ""),
            ExpectationKind::ObjectLifted
            | ExpectationKind::Grounding
            | ExpectationKind::JointOpen
            | ExpectationKind::JointClosed => (object, "object"),
        };
        (!complete).then_some(needs)
    }

    /// Something of a kind with the usual distances and times, about nothing yet.
    fn of(kind: ExpectationKind) -> Self {
        Self {
            kind,
            object: None,
            room: None,
            surface: None,
            part: None,
            at_least: default_at_least(),
            within_m: default_within_m(),
            height_m: default_height_m(),
            hold_s: default_hold_s(),
        }
    }

    /// The robot ends near an object (MJCF body) with the object in view.
    pub fn robot_near_object(object: impl Into<String>) -> Self {
        Self { object: Some(object.into()), ..Self::of(ExpectationKind::RobotNear) }
    }

    /// The robot ends in a room of the scene's semantics.
    pub fn robot_in_room(room: impl Into<String>) -> Self {
        Self { room: Some(room.into()), ..Self::of(ExpectationKind::RobotNear) }
    }

    /// An object is lifted and held.
    pub fn object_lifted(object: impl Into<String>) -> Self {
        Self { object: Some(object.into()), ..Self::of(ExpectationKind::ObjectLifted) }
    }

    /// An object rests on another body.
    pub fn object_on(object: impl Into<String>, surface: impl Into<String>) -> Self {
        Self { surface: Some(surface.into()), object: Some(object.into()), ..Self::of(ExpectationKind::ObjectOn) }
    }
}

impl Episode {
    /// An episode without steps and expectations, in a scene (its MJCF file or folder), with the defaults of a file.
    pub fn new(scene: impl Into<PathBuf>) -> Self {
        Self {
            version: EPISODE_VERSION,
            scene: scene.into(),
            robot: default_robot(),
            seed: 0,
            time_limit_s: default_time_limit_s(),
            start: None,
            steps: Vec::new(),
            expectations: Vec::new(),
            disturbances: Vec::new(),
            open: Vec::new(),
            faults: Vec::new(),
        }
    }

    /// An episode that only explores.
    pub fn exploration(scene: PathBuf, time_limit_s: f64) -> Self {
        let step = Step { skill: Some(SkillName::Explore), ..Step::default() };
        Self { time_limit_s, steps: vec![step], ..Self::new(scene) }
    }
}
