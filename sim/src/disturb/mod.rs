//! Disturbances: what happens to a world while a robot works in it.
//!
//! ```text
//! [[disturb]] of an episode ──check──▶ Disturber ◀──words of the event log
//!                                        │ hands: bodies put elsewhere, taken away, made slippery; a person that walks
//!                                        └ conditions: light, frames, wheels, localisation
//! ```
//!
//! A disturbance is done to the world or to the robot's senses. Nothing tells the robot: it learns of it by what it
//! measures. The words of the event log go one way, from the run to the world, so that a disturbance can wait for a stage
//! of the task.

mod actors;
mod places;
mod stage;
mod walker;

pub(crate) use stage::{Conditions, Disturber, Happening, Wires, add_actors};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DisturbanceKind {
    /// `object` stands elsewhere on what carries it, `by_m` away or less where there is no room.
    ObjectMoved,
    /// `object` is taken away for good.
    ObjectRemoved,
    /// `object` becomes slippery: what holds it loses it.
    Slip,
    /// A box stands in the way of the base as soon as it drives.
    PathBlocked,
    /// Somebody walks to and fro through the way of the base, and stops short of the robot.
    Person,
    /// A `share` of all frames is lost, and the others arrive `late_s` late.
    Frames,
    /// The wheels slip: the base moves by a `share` less than they turn.
    WheelSlip,
    /// The believed pose jumps by `by_m`, turned a little, and jumps back at the end.
    LocalisationJump,
    /// The lights are off.
    LightOff,
    /// `object` and `with` change places.
    Swapped,
}

impl DisturbanceKind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::ObjectMoved,
        Self::ObjectRemoved,
        Self::Slip,
        Self::PathBlocked,
        Self::Person,
        Self::Frames,
        Self::WheelSlip,
        Self::LocalisationJump,
        Self::LightOff,
        Self::Swapped,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::ObjectMoved => "object_moved",
            Self::ObjectRemoved => "object_removed",
            Self::Slip => "slip",
            Self::PathBlocked => "path_blocked",
            Self::Person => "person",
            Self::Frames => "frames",
            Self::WheelSlip => "wheel_slip",
            Self::LocalisationJump => "localisation_jump",
            Self::LightOff => "light_off",
            Self::Swapped => "swapped",
        }
    }

    /// Whether it is about a body of the scene.
    pub fn needs_object(self) -> bool {
        matches!(self, Self::ObjectMoved | Self::ObjectRemoved | Self::Slip | Self::Swapped)
    }

    /// Whether bodies are put elsewhere or changed while the world runs.
    fn needs_hands(self) -> bool {
        self.needs_object() || matches!(self, Self::PathBlocked | Self::Person)
    }

    /// How long it lasts when the file does not say, seconds; `None` when it does not end.
    fn lasts_s(self) -> Option<f64> {
        match self {
            Self::ObjectMoved | Self::ObjectRemoved | Self::Swapped => None,
            // Long enough to fall out of a hand 10 cm above its support.
            Self::Slip => Some(0.4),
            Self::PathBlocked => Some(60.0),
            Self::Person | Self::Frames => Some(40.0),
            Self::WheelSlip => Some(15.0),
            Self::LocalisationJump => Some(6.0),
            Self::LightOff => Some(20.0),
        }
    }
}

/// One disturbance of an episode. It begins `after_s` after one of `at_s`, `on` and `within_m`, once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Disturbance {
    /// What happens.
    pub kind: DisturbanceKind,
    /// Begins at this simulated time, seconds. Range 0 to 36000.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 36000.0))]
    pub at_s: Option<f64>,
    /// Begins with the first event of the event log that holds these words.
    #[serde(default)]
    pub on: Option<String>,
    /// Begins when the base is this near to `object`, metres. Range 0.3 to 20.
    #[serde(default)]
    #[schemars(range(min = 0.3, max = 20.0))]
    pub within_m: Option<f64>,
    /// Waits so long after that, seconds. Default 0, range 0 to 600.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub after_s: f64,
    /// How long it lasts, seconds; by kind when left out. Range 0.05 to 36000.
    #[serde(default)]
    #[schemars(range(min = 0.05, max = 36000.0))]
    pub for_s: Option<f64>,
    /// MJCF body.
    #[serde(default)]
    pub object: Option<String>,
    /// The other MJCF body (`swapped` only).
    #[serde(default)]
    pub with: Option<String>,
    /// Distance for `object_moved` and `localisation_jump`, metres. Default 0.25, range 0.02 to 2.
    #[serde(default = "default_by_m")]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub by_m: f64,
    /// Share of frames lost (`frames`), or of the wheels' motion (`wheel_slip`). Default 0.4, range 0 to 0.95.
    #[serde(default = "default_share")]
    #[schemars(range(min = 0.0, max = 0.95))]
    pub share: f64,
    /// How late frames arrive (`frames`), seconds. Default 0.3, range 0 to 5.
    #[serde(default = "default_late_s")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub late_s: f64,
}

fn default_by_m() -> f64 {
    0.25
}

fn default_share() -> f64 {
    0.4
}

fn default_late_s() -> f64 {
    0.3
}

impl Disturbance {
    /// One with the usual figures that begins at a time.
    pub fn at(kind: DisturbanceKind, at_s: f64) -> Self {
        Self {
            kind,
            at_s: Some(at_s),
            on: None,
            within_m: None,
            after_s: 0.0,
            for_s: None,
            object: None,
            with: None,
            by_m: default_by_m(),
            share: default_share(),
            late_s: default_late_s(),
        }
    }

    /// What is missing or too much; `None` when it is whole.
    pub fn find_flaw(&self) -> Option<&'static str> {
        let starts = [self.at_s.is_some(), self.on.is_some(), self.within_m.is_some()];
        if starts.into_iter().filter(|given| *given).count() != 1 {
            return Some("one of at_s, on and within_m says when it begins");
        }
        if self.on.as_ref().is_some_and(|words| words.trim().is_empty()) {
            return Some("`on` holds words of the event log");
        }
        if (self.kind.needs_object() || self.within_m.is_some()) && self.object.is_none() {
            return Some("object = \"body\" for this kind or start");
        }
        if (self.kind == DisturbanceKind::Swapped) != self.with.is_some() {
            return Some("with = \"body\" for `swapped`, and for nothing else");
        }
        if self.with.is_some() && self.with == self.object {
            return Some("two different bodies to swap");
        }
        None
    }

    fn lasts_s(&self) -> Option<f64> {
        self.for_s.or(self.kind.lasts_s())
    }
}

/// Why a world cannot be disturbed.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum DisturbanceError {
    /// A body that the scene does not have, or that does not move freely.
    #[error("disturbance `{kind}`: `{body}` is no free body of the scene")]
    NoFreeBody {
        /// The kind.
        kind: &'static str,
        /// The body.
        body: String,
        /// Bodies that could be meant.
        known: Vec<String>,
    },
    /// It is not whole.
    #[error("disturbance `{kind}`: expected {expected}")]
    Flawed {
        /// The kind.
        kind: &'static str,
        /// What is expected.
        expected: &'static str,
    },
    /// The engine cannot put bodies elsewhere.
    #[error("disturbance `{kind}`: this physics engine cannot change bodies while it runs; use rapier")]
    NoHands {
        /// The kind.
        kind: &'static str,
    },
}

#[cfg(test)]
mod tests {
    //! Contract: a disturbance says once when it begins and names what it is about.
    use super::*;

    #[test]
    fn names_in_files_are_the_names_of_the_kinds() {
        for kind in DisturbanceKind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
        }
    }

    #[test]
    fn what_is_missing_is_said() {
        let light = Disturbance::at(DisturbanceKind::LightOff, 3.0);
        assert_eq!(light.find_flaw(), None);
        assert!(Disturbance { on: Some("lifts".into()), ..light.clone() }.find_flaw().unwrap().contains("one of"));
        assert!(Disturbance { at_s: None, ..light.clone() }.find_flaw().unwrap().contains("one of"));
        let moved = Disturbance { kind: DisturbanceKind::ObjectMoved, ..light.clone() };
        assert!(moved.find_flaw().unwrap().contains("object"));
        assert_eq!(Disturbance { object: Some("mug".into()), ..moved.clone() }.find_flaw(), None);
        let swapped = Disturbance { kind: DisturbanceKind::Swapped, object: Some("mug".into()), ..light.clone() };
        assert!(swapped.find_flaw().unwrap().contains("with"));
        assert!(Disturbance { with: Some("mug".into()), ..swapped.clone() }.find_flaw().unwrap().contains("different"));
        assert!(Disturbance { with: Some("mug".into()), ..light }.find_flaw().is_some());
    }
}
