//! What every driver of a robot has to do, as a list of behaviours that are measured one by one.
//!
//! ```text
//! any &mut dyn Robot + its model ──senses, motion, stops──▶ Report
//! ```
//!
//! The list holds a driver to the contract of [`crate::drivers`]: units, frames and signs, rates and stamps, what was sent
//! is what is done, limits, refusals, and standing when nobody commands or somebody presses the stop. It is meant for the
//! bare driver, without the [`crate::safety::Envelope`], since the envelope hides what a driver forgets; it passes with
//! the envelope too.
//!
//! [`Scope::Moving`] moves the robot: it needs [`SPACE_M`] of free floor all around, the arm folded for driving, an empty
//! hand, and somebody at the stop.

mod bench;
mod motion;
mod senses;
mod stops;

use crate::drivers::{DriverError, Robot};
use crate::model::RobotModel;
use bench::Bench;
use serde::Serialize;

/// Free floor around the base that the motions need, metres.
pub const SPACE_M: f64 = 1.0;

/// How far the check goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Only what can be measured while the robot stands, without a command: for recordings and first trials.
    ReadingOnly,
    /// Everything.
    Moving,
}

/// One behaviour and what was measured of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The behaviour.
    pub behaviour: &'static str,
    /// Whether the driver behaves so.
    pub passed: bool,
    /// What was measured, in words with units.
    pub measured: String,
    /// What is required.
    pub required: String,
}

/// All behaviours in the order in which they were tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Version of this layout; 1.
    pub schema: u32,
    /// Name of the robot.
    pub robot: String,
    /// Whether all passed.
    pub passed: bool,
    /// What was found.
    pub findings: Vec<Finding>,
}

/// What one trial comes to: whether it passed, what was measured, what is required.
struct Verdict {
    passed: bool,
    measured: String,
    required: String,
}

impl Verdict {
    fn new(passed: bool, measured: impl Into<String>, required: impl Into<String>) -> Self {
        Self { passed, measured: measured.into(), required: required.into() }
    }
}

type Trial = fn(&mut Bench<'_>) -> Result<Verdict, DriverError>;

/// What can be measured while the robot stands.
const STANDING: [(&str, Trial); 6] = [
    ("reading lets no time pass", senses::reading_lets_no_time_pass),
    ("waiting lets the time pass that was asked for", senses::waiting_passes_time),
    ("states name the model's joints, finite and within their limits", senses::joints_are_the_models),
    ("states are stamped by the robot's clock and renewed", senses::states_are_fresh),
    ("cameras give each image once, at their rate and size", senses::cameras_keep_their_rate),
    ("cameras are where the kinematics says, +z forward, y down", senses::cameras_are_where_they_are),
];

/// What needs motion.
const MOVING: [(&str, Trial); 12] = [
    ("a positive speed drives forwards, in metres per second as sent", motion::base_drives_forwards),
    ("a negative speed drives backwards", motion::base_drives_backwards),
    ("a positive turning rate turns left, in radians per second as sent", motion::base_turns_left),
    ("localisation follows the base as odometry does", motion::localisation_follows),
    ("each joint of the arm follows its own command, in its unit and sign", motion::arm_follows),
    ("each joint of the head follows its own command, in its unit and sign", motion::head_follows),
    ("the gripper goes to the width asked for, in metres", motion::gripper_opens),
    ("commands beyond the limits are clamped, and the answer says so", motion::limits_are_told),
    ("what is not finite or for other joints is refused, and nothing moves", motion::nonsense_is_refused),
    ("a base that hears nothing stands after half a second", stops::silent_base_stands),
    ("joints that hear nothing stand after half a second", stops::silent_joints_stand),
    ("the emergency stop stops, refuses, keeps its first reason, and is released", stops::stop_is_latched),
];

/// Checks a robot.
pub fn check(robot: &mut dyn Robot, model: &RobotModel, scope: Scope) -> Report {
    let mut bench = Bench::new(robot, model);
    let mut findings = Vec::new();
    let moving: &[(&'static str, Trial)] = if scope == Scope::Moving { &MOVING } else { &[] };
    for (behaviour, trial) in STANDING.iter().chain(moving) {
        let verdict = trial(&mut bench).unwrap_or_else(|error| Verdict::new(false, error.to_string(), "an answer"));
        let Verdict { passed, measured, required } = verdict;
        findings.push(Finding { behaviour, passed, measured, required });
        if scope == Scope::Moving {
            // Each trial begins at rest, whatever the one before has left.
            bench.rest();
        }
    }
    let passed = findings.iter().all(|finding| finding.passed);
    Report { schema: 1, robot: model.settings.name.clone(), passed, findings }
}
