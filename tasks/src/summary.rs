//! `summary.json`: what happened, without wall times.

use dsm::ground::Grounding;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Version of `summary.json`.
pub const SUMMARY_SCHEMA: u32 = 1;

/// The stage in which a task failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Words were not understood.
    Parsing,
    /// The map does not hold the target well enough.
    Mapping,
    /// The words were grounded wrongly, or refused.
    Grounding,
    /// No path.
    Planning,
    /// The arm cannot get there.
    Reach,
    /// The fingers closed on nothing.
    Grasp,
    /// The object was lost after the grasp.
    Hold,
    /// The object was not put where it belongs.
    Place,
    /// A door or drawer does not stand as it should.
    Open,
    /// A limit, the time limit or the emergency stop ended it.
    Safety,
    /// The simulated time ran out.
    Time,
    /// A part of a sequence is not done.
    Sequence,
    /// Done, but an expectation about the world does not hold.
    Judging,
    /// The program failed.
    Crash,
}

/// How a step ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepOutcome {
    /// Done.
    Done,
    /// Refused: the target is absent.
    Absent,
    /// Refused: the target is ambiguous.
    Ambiguous,
    /// Not done.
    Failed,
    /// Never begun.
    Skipped,
}

/// Where and why an episode failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Failure {
    /// Index of the step.
    pub step: usize,
    /// The stage.
    pub stage: Stage,
    /// Why, in words.
    pub reason: String,
}

/// One step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepSummary {
    /// Index of the step.
    pub index: usize,
    /// The command as given.
    pub command: String,
    /// The skill it came to.
    pub skill: String,
    /// How it ended.
    pub outcome: StepOutcome,
    /// Why, in words.
    pub reason: String,
    /// When it began, simulated seconds.
    pub start_s: f64,
    /// How long it took, simulated seconds.
    pub duration_s: f64,
    /// What the words were grounded to; of a sequence, those of its last part.
    pub grounding: Option<Grounding>,
    /// The commands of a sequence, in order; empty when the step is one command.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<PartSummary>,
    /// Path of the base during the step, from ground truth, metres.
    #[serde(default)]
    pub path_length_m: f64,
    /// Shortest path from where the last step began to the target, metres; null for other steps, and without a path.
    #[serde(default)]
    pub shortest_path_m: Option<f64>,
    /// Success weighted by the path length of this step alone; null without a shortest path.
    #[serde(default)]
    pub spl: Option<f64>,
}

/// One of several commands that a step's sentence held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PartSummary {
    /// The command.
    pub command: String,
    /// The skill it came to.
    pub skill: String,
    /// How it ended.
    pub outcome: StepOutcome,
    /// Why, in words.
    pub reason: String,
    /// How often it was begun.
    pub attempts: u32,
    /// When it began, simulated seconds.
    pub start_s: f64,
    /// How long it took, simulated seconds.
    pub duration_s: f64,
}

impl PartSummary {
    /// A part that was never begun.
    pub fn skipped(command: &str, stamp_s: f64) -> Self {
        Self {
            command: command.to_owned(),
            skill: String::new(),
            outcome: StepOutcome::Skipped,
            reason: "the run was cut short".into(),
            attempts: 0,
            start_s: stamp_s,
            duration_s: 0.0,
        }
    }
}

/// The skill that sees all that can be reached, as a step names it.
pub const EXPLORE: &str = "explore";

impl StepSummary {
    /// A step that was never begun.
    pub fn skipped(index: usize, command: String, stamp_s: f64) -> Self {
        Self {
            index,
            command,
            skill: String::new(),
            outcome: StepOutcome::Skipped,
            reason: "an earlier step failed".into(),
            start_s: stamp_s,
            duration_s: 0.0,
            grounding: None,
            parts: Vec::new(),
            path_length_m: 0.0,
            shortest_path_m: None,
            spl: None,
        }
    }

    /// Whether the step was there to see all that can be reached, however it ended.
    pub fn explores(&self) -> bool {
        self.skill == EXPLORE || self.command == EXPLORE
    }
}

/// One judged expectation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExpectationSummary {
    /// The kind, as in the episode file.
    pub kind: String,
    /// Whether it holds.
    pub passed: bool,
    /// What was measured.
    pub measured: String,
    /// What was required.
    pub required: String,
}

/// Measured from ground truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Metrics {
    /// Simulated time, seconds.
    pub sim_time_s: f64,
    /// Path of the base, metres.
    pub path_length_m: f64,
    /// Shortest path from the start to the target, metres; null without a target or a path.
    pub shortest_path_m: Option<f64>,
    /// Success weighted by path length; null without a shortest path.
    pub spl: Option<f64>,
    /// Share of the shortest path that was gone at the end, weighted by path length like `spl`; null without one.
    #[serde(default)]
    pub soft_spl: Option<f64>,
    /// The same as `spl` for the last step alone, from where it began, when a step before it explored: what driving on a
    /// finished map is worth. Null in other episodes.
    #[serde(default)]
    pub known_map_spl: Option<f64>,
    /// Contacts of the robot, other than hand (fingers and palm) with target, that began above 0.1 m/s.
    pub collisions: u32,
    /// Free objects other than the expectations' own that the hand touched.
    #[serde(default)]
    pub others_touched: u32,
    /// Smallest distance between the robot's base and the world, metres.
    pub min_clearance_m: Option<f64>,
    /// Joint samples beyond position or velocity limits.
    pub limit_violations: u32,
    /// Largest normal force of a contact of the robot, other than of its hand with a target, newtons.
    #[serde(default)]
    pub contact_force_max_n: f64,
    /// Fastest closing speed with which a contact with a person began, metres per second; null without any.
    #[serde(default)]
    pub person_contact_max_m_per_s: Option<f64>,
    /// The farthest that an object other than the targets was moved by the robot, metres.
    pub non_target_displacement_max_m: f64,
}

/// Size of the map at the end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MapSummary {
    /// Stable objects.
    pub objects: usize,
    /// Relations.
    pub relations: usize,
    /// Rooms.
    pub rooms: usize,
}

/// A pose for scripts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseSummary {
    /// MJCF body.
    pub object: String,
    /// Position, world frame, metres.
    pub position_m: [f64; 3],
    /// Rotation, world from body, w first.
    pub quat_wxyz: [f64; 4],
}

/// A contact of the robot with the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ContactSummary {
    /// Robot link.
    pub link: String,
    /// Body touched.
    pub body: String,
    /// When it began, simulated seconds.
    pub start_s: f64,
    /// Largest normal force, newtons.
    pub max_force_n: f64,
    /// Closing speed when it began, metres per second.
    pub approach_speed_m_per_s: f64,
}

/// A joint beyond its limits in one sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LimitViolation {
    /// Name in the URDF.
    pub joint: String,
    /// When, simulated seconds.
    pub stamp_s: f64,
    /// Position, radians or metres.
    pub position: f64,
    /// Speed, radians or metres per second.
    pub velocity: f64,
}

/// Something that was done to the world from outside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DisturbanceSummary {
    /// When, simulated seconds.
    pub at_s: f64,
    /// What: the kind first.
    pub what: String,
}

/// Ground truth for foreign scripts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TruthSummary {
    /// Poses of the expectations' objects at the start.
    pub target_pose_start: Vec<PoseSummary>,
    /// Poses of the same objects at the end.
    pub target_pose_end: Vec<PoseSummary>,
    /// Contacts of the robot with anything but the floor.
    pub contacts: Vec<ContactSummary>,
    /// The first 50 samples in which a joint was beyond its limits.
    #[serde(default)]
    pub limit_violations: Vec<LimitViolation>,
    /// What disturbed the world.
    #[serde(default)]
    pub disturbances: Vec<DisturbanceSummary>,
}

/// The whole account of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Version of this layout.
    pub schema: u32,
    /// Name of the episode.
    pub episode: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the robot.
    pub robot: String,
    /// Physics engine.
    pub physics: String,
    /// Perception preset.
    pub perception: String,
    /// Seed.
    pub seed: u64,
    /// Whether all expectations hold and no step failed.
    pub success: bool,
    /// Where it failed.
    pub failure: Option<Failure>,
    /// Steps.
    pub steps: Vec<StepSummary>,
    /// Expectations.
    pub expectations: Vec<ExpectationSummary>,
    /// Metrics.
    pub metrics: Metrics,
    /// Size of the map.
    pub map: MapSummary,
    /// Ground truth.
    pub truth: TruthSummary,
}
