//! What lies between two waits, as plain values.

use crate::drivers::{DriverError, GripperState, JointState, StampedPose, Twist};
use crate::joints::{JointNames, JointPositions, JointVelocities};
use dsm::frame::FrameId;
use dsm::time::Stamp;
use serde::{Deserialize, Serialize};

/// A command and what was answered: what was sent, or why not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exchange<T> {
    /// The command.
    pub asked: T,
    /// The answer.
    pub answer: Result<T, DriverError>,
}

/// Answers of one part to the same question, in the order in which it was asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answers<T> {
    /// How often it was asked.
    asked: u32,
    /// The number of each question, from 0, whose answer differs from the one before.
    changes: Vec<(u32, Result<T, DriverError>)>,
}

impl<T> Default for Answers<T> {
    fn default() -> Self {
        Self { asked: 0, changes: Vec::new() }
    }
}

impl<T: PartialEq> Answers<T> {
    /// Notes the answer to the next question.
    pub fn note(&mut self, answer: Result<T, DriverError>) {
        if self.changes.last().is_none_or(|(_, last)| *last != answer) {
            self.changes.push((self.asked, answer));
        }
        self.asked += 1;
    }

    /// The answer to question `number`, from 0; the last one when there were fewer, `None` when there was none.
    pub fn find(&self, number: u32) -> Option<&Result<T, DriverError>> {
        self.changes.iter().rev().find(|(from, _)| *from <= number).map(|(_, answer)| answer)
    }
}

/// Values of joints; their names only where they are not the part's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointValues {
    names: Option<JointNames>,
    values: Vec<f64>,
}

impl JointValues {
    /// Values of a part whose joints are `own`.
    fn new(own: &JointNames, names: &JointNames, values: &[f64]) -> Self {
        Self { names: (names != own).then(|| names.clone()), values: values.to_vec() }
    }

    /// Velocities for a part whose joints are `own`.
    pub fn of_velocities(own: &JointNames, velocities: &JointVelocities) -> Self {
        Self::new(own, velocities.names(), velocities.values())
    }

    /// The velocities; `None` when there are not as many values as names.
    pub fn find_velocities(&self, own: &JointNames) -> Option<JointVelocities> {
        JointVelocities::from_values(self.names.as_ref().unwrap_or(own), self.values.clone())
    }

    fn find_positions(&self, own: &JointNames) -> Option<JointPositions> {
        JointPositions::from_values(self.names.as_ref().unwrap_or(own), self.values.clone())
    }
}

/// A measured state of joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointReading {
    /// When it was measured.
    pub stamp: Stamp,
    /// Positions, radians or metres.
    pub positions: JointValues,
    /// Velocities, radians or metres per second.
    pub velocities: JointValues,
}

impl JointReading {
    /// The state of a part whose joints are `own`.
    pub fn new(own: &JointNames, state: &JointState) -> Self {
        Self {
            stamp: state.stamp,
            positions: JointValues::new(own, state.positions.names(), state.positions.values()),
            velocities: JointValues::of_velocities(own, &state.velocities),
        }
    }

    /// The state; `None` when there are not as many values as names.
    pub fn find_state(&self, own: &JointNames) -> Option<JointState> {
        Some(JointState {
            stamp: self.stamp,
            positions: self.positions.find_positions(own)?,
            velocities: self.velocities.find_velocities(own)?,
        })
    }
}

/// Commands to a group of joints, and its states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTalk {
    /// Commands in order.
    pub commands: Vec<Exchange<JointValues>>,
    /// States.
    pub state: Answers<JointReading>,
}

/// Commands to the gripper as (width in metres, greatest force in newtons), and its states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GripperTalk {
    /// Commands in order.
    pub commands: Vec<Exchange<(f64, f64)>>,
    /// States.
    pub state: Answers<GripperState>,
}

/// A camera that was asked for its newest frame. The frame itself is kept beside the period.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRead {
    /// The camera as it was named.
    pub camera: String,
    /// Number of the frame, if there was a new one.
    pub answer: Result<Option<FrameId>, DriverError>,
}

/// What was asked of the emergency stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum StopCommand {
    /// To stop, and why.
    Trigger(String),
    /// To release its latch.
    Reset,
}

/// How a period ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Waited {
    /// Until when was to be waited.
    pub until: Stamp,
    /// The clock's answer.
    pub answer: Result<(), DriverError>,
}

/// All that was asked between two waits, and answered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Period {
    /// The moment it holds for.
    pub now: Stamp,
    /// Commands to the base.
    pub base: Vec<Exchange<Twist>>,
    /// The base's measured velocity.
    pub base_velocity: Answers<Twist>,
    /// The arm.
    pub arm: JointTalk,
    /// The head.
    pub head: JointTalk,
    /// The gripper.
    pub gripper: GripperTalk,
    /// Localisation.
    pub world_from_base: Answers<StampedPose>,
    /// Odometry.
    pub odom_from_base: Answers<StampedPose>,
    /// Cameras that were read, in order.
    pub frames: Vec<FrameRead>,
    /// Why the emergency stop is latched, whenever it was turned to.
    pub stop_reason: Answers<Option<String>>,
    /// What was asked of the emergency stop.
    pub stop: Vec<(StopCommand, Result<(), DriverError>)>,
    /// How it ended; `None` when nobody waited any more.
    pub waited: Option<Waited>,
}

/// Equality of commands to the bit, so that one that is no number is the same as then.
pub(super) trait SameBits {
    fn is_same(&self, other: &Self) -> bool;
}

impl SameBits for f64 {
    fn is_same(&self, other: &Self) -> bool {
        self.to_bits() == other.to_bits()
    }
}

impl SameBits for (f64, f64) {
    fn is_same(&self, other: &Self) -> bool {
        self.0.is_same(&other.0) && self.1.is_same(&other.1)
    }
}

impl SameBits for Twist {
    fn is_same(&self, other: &Self) -> bool {
        let values = |twist: &Self| (twist.forward_m_per_s, twist.turn_rad_per_s);
        values(self).is_same(&values(other))
    }
}

impl SameBits for JointValues {
    fn is_same(&self, other: &Self) -> bool {
        self.names == other.names
            && self.values.len() == other.values.len()
            && self.values.iter().zip(&other.values).all(|(own, other)| own.is_same(other))
    }
}
