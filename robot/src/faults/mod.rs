//! Faults of a robot by schedule: what drivers, sensors, the clock and the connection do when they break.
//!
//! ```text
//! task ──▶ Envelope ──▶ Faulty ──▶ any robot
//!                         ▲ [[fault]] of an episode
//! ```
//!
//! [`Faulty`] implements the same traits and lies, stays silent or fails while a fault lasts. What it does is a function of
//! the schedule, the seed and the robot's own clock.

mod faulty;
mod senses;

pub use faulty::Faulty;

use crate::safety::Part;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// One position of `part` (arm, head) is not a number.
    JointsNan,
    /// Two joints of `part` (arm, head) change places in the measured state, names and values.
    JointsSwapped,
    /// Measured positions of `part` (arm, head) are off by 1 rad or 1 m.
    JointsJump,
    /// `part` (arm, head, camera, localisation) repeats what it measured last, with its old stamp.
    SensorFrozen,
    /// `part` (arm, head, localisation) repeats what it measured last, with new stamps.
    SensorStuck,
    /// `part` (any but the clock) does not answer.
    PartLost,
    /// Nothing answers and no time passes: the process of the world is dead.
    WorldKilled,
    /// The clock and all stamps are off by `by_s`.
    ClockJump,
    /// Frames arrive `by_s` late.
    FramesLate,
    /// A `share` of the frames is lost.
    FramesLost,
    /// Every frame arrives twice.
    FramesDuplicated,
    /// The believed pose is off by `by_m`.
    LocalisationJump,
    /// Somebody presses the robot's own stop.
    Estop,
}

/// A part in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultPart {
    /// The base.
    Base,
    /// The arm with its lift.
    Arm,
    /// The head.
    Head,
    /// The gripper.
    Gripper,
    /// The cameras.
    Camera,
    /// Localisation and odometry.
    Localisation,
}

impl From<FaultPart> for Part {
    fn from(part: FaultPart) -> Self {
        match part {
            FaultPart::Base => Self::Base,
            FaultPart::Arm => Self::Arm,
            FaultPart::Head => Self::Head,
            FaultPart::Gripper => Self::Gripper,
            FaultPart::Camera => Self::Camera,
            FaultPart::Localisation => Self::Localisation,
        }
    }
}

impl FaultKind {
    /// All kinds.
    pub const ALL: [Self; 13] = [
        Self::JointsNan,
        Self::JointsSwapped,
        Self::JointsJump,
        Self::SensorFrozen,
        Self::SensorStuck,
        Self::PartLost,
        Self::WorldKilled,
        Self::ClockJump,
        Self::FramesLate,
        Self::FramesLost,
        Self::FramesDuplicated,
        Self::LocalisationJump,
        Self::Estop,
    ];

    /// The parts that it can be about; none when it is about no part.
    pub fn parts(self) -> &'static [FaultPart] {
        use FaultPart::{Arm, Base, Camera, Gripper, Head, Localisation};
        match self {
            Self::JointsNan | Self::JointsSwapped | Self::JointsJump => &[Arm, Head],
            Self::SensorFrozen => &[Arm, Head, Camera, Localisation],
            Self::SensorStuck => &[Arm, Head, Localisation],
            Self::PartLost => &[Base, Arm, Head, Gripper, Camera, Localisation],
            _ => &[],
        }
    }
}

/// `[[fault]]`: one fault of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// What breaks.
    pub kind: FaultKind,
    /// Begins at this time of the robot's own clock, seconds. Range 0 to 36000.
    #[schemars(range(min = 0.0, max = 36000.0))]
    pub at_s: f64,
    /// How long it lasts, seconds. Default: until the end. Range 0.01 to 36000.
    #[serde(default)]
    #[schemars(range(min = 0.01, max = 36000.0))]
    pub for_s: Option<f64>,
    /// The part, for kinds that are about one.
    #[serde(default)]
    pub part: Option<FaultPart>,
    /// Time of `clock_jump` (less than 0: back) and `frames_late`, seconds. Default 1, range -3600 to 3600.
    #[serde(default = "default_by_s")]
    #[schemars(range(min = -3600.0, max = 3600.0))]
    pub by_s: f64,
    /// Distance of `localisation_jump`, metres. Default 0.3, range 0.01 to 10.
    #[serde(default = "default_by_m")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub by_m: f64,
    /// Share of `frames_lost`. Default 1, range 0.05 to 1.
    #[serde(default = "default_share")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub share: f64,
}

fn default_by_s() -> f64 {
    1.0
}

fn default_by_m() -> f64 {
    0.3
}

fn default_share() -> f64 {
    1.0
}

impl Fault {
    /// One with the usual figures that begins at a time and stays.
    pub fn at(kind: FaultKind, at_s: f64) -> Self {
        let part = kind.parts().first().copied();
        Self { kind, at_s, for_s: None, part, by_s: default_by_s(), by_m: default_by_m(), share: default_share() }
    }

    /// What is missing or too much; `None` when it is whole.
    pub fn find_flaw(&self) -> Option<&'static str> {
        match (self.part, self.kind.parts()) {
            (None, []) => {}
            (Some(_), []) => return Some("no `part` for this kind"),
            (None, _) => return Some("`part` for this kind"),
            (Some(part), parts) if parts.contains(&part) => {}
            (Some(_), [FaultPart::Arm, FaultPart::Head]) => return Some("part = arm or head for this kind"),
            (Some(_), _) => return Some("another `part`: this one cannot have this fault"),
        }
        (self.kind == FaultKind::FramesLate && self.by_s < 0.0).then_some("by_s of 0 or more: no frame comes early")
    }

    /// Whether it lasts at a time of the robot's clock.
    fn is_active(&self, now_s: f64) -> bool {
        now_s >= self.at_s && self.for_s.is_none_or(|for_s| now_s < self.at_s + for_s)
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a fault names the part that it is about, and no other.
    use super::*;

    #[test]
    fn a_fault_names_its_part_and_no_other() {
        for kind in FaultKind::ALL {
            let fault = Fault::at(kind, 1.0);
            assert_eq!(fault.find_flaw(), None, "{kind:?}");
            let other = if fault.part.is_some() { None } else { Some(FaultPart::Arm) };
            assert!(Fault { part: other, ..fault }.find_flaw().is_some(), "{kind:?}");
        }
        let nan = Fault { part: Some(FaultPart::Base), ..Fault::at(FaultKind::JointsNan, 0.0) };
        assert!(nan.find_flaw().expect("a base has no joints").contains("arm or head"));
        assert!(Fault { by_s: -1.0, ..Fault::at(FaultKind::FramesLate, 0.0) }.find_flaw().is_some());
    }

    #[test]
    fn a_fault_lasts_its_time() {
        let fault = Fault { for_s: Some(0.5), ..Fault::at(FaultKind::Estop, 1.0) };
        assert_eq!([0.99, 1.0, 1.49, 1.5].map(|at_s| fault.is_active(at_s)), [false, true, true, false]);
    }
}
