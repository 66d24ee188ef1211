//! The states of the envelope: a pure machine that knows neither robot nor time.
//!
//! ```text
//!             fault                standstill
//! Running ───────────▶ Braking ───────────────▶ Held       (released when its cause is gone)
//!    ▲                  │   │                    │ overdue, latching fault
//!    │     cleared      │   │ latching fault,    ▼
//!    ├──────────────────┘   │ overdue     ┌▶ Braking by reset ─ standstill ─▶ Stopped
//!    │                      └─────────────┘                                      │
//!    └──────────────────────────────── reset ────────────────────────────────────┘
//! ```
//!
//! | state | fault that clears | fault that latches | cleared | overdue | standstill | reset |
//! |---|---|---|---|---|---|---|
//! | Running | Braking | Braking by reset | - | - | - | - |
//! | Braking | - | Braking by reset | Running | Braking by reset | Held | - |
//! | Held | - | Braking by reset | Running | Braking by reset | - | - |
//! | Braking by reset | - | - | - | - | Stopped | - |
//! | Stopped | - | - | - | - | - | Running |
//!
//! The first cause that latches stays: it is what went wrong. A reset counts at standstill alone.

use std::fmt;

/// A part of the robot that a cause is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The base.
    Base,
    /// The arm with its lift.
    Arm,
    /// The head.
    Head,
    /// The gripper.
    Gripper,
    /// The head camera.
    Camera,
    /// Localisation and odometry.
    Localisation,
    /// The clock.
    Clock,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Base => "base",
            Self::Arm => "arm",
            Self::Head => "head",
            Self::Gripper => "gripper",
            Self::Camera => "head camera",
            Self::Localisation => "localisation",
            Self::Clock => "clock",
        })
    }
}

/// Why the envelope brakes.
#[derive(Clone, Debug, PartialEq)]
pub enum Cause {
    /// The emergency stop, in the words of who pressed it.
    EmergencyStop {
        /// The words.
        reason: String,
    },
    /// A part answers with an error.
    PartFailed {
        /// The part.
        part: Part,
        /// Its words.
        reason: String,
    },
    /// A measured value is not finite.
    NotFinite {
        /// Of which part.
        part: Part,
    },
    /// A measured state names other joints, or in another order.
    WrongJoints {
        /// Of which part.
        part: Part,
    },
    /// Joints are measured to have moved farther than they can.
    MeasurementJump {
        /// Of which part.
        part: Part,
    },
    /// Stamps of a part, or the clock itself, go back or jump ahead.
    TimeJump {
        /// Of which part.
        part: Part,
        /// By how much, seconds.
        by_s: f64,
    },
    /// Measured values stay exactly the same although the part is driven.
    Stuck {
        /// Of which part.
        part: Part,
    },
    /// No newer measurement for too long.
    Silent {
        /// Of which part.
        part: Part,
    },
    /// Localisation jumped against odometry.
    LocalisationJump {
        /// By how much, metres.
        by_m: f64,
    },
}

/// What ends a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Release {
    /// The cause is gone.
    Cleared,
    /// Somebody resets the emergency stop.
    Reset,
}

impl Cause {
    /// What ends a stop for this cause: a sense that comes back is enough where a sense was lost; whatever may be
    /// measured or done wrongly is looked at by somebody first.
    pub fn release(&self) -> Release {
        match self {
            Self::Silent { .. } | Self::LocalisationJump { .. } => Release::Cleared,
            _ => Release::Reset,
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EmergencyStop { reason } => f.write_str(reason),
            Self::PartFailed { part, reason } => write!(f, "the {part} failed: {reason}"),
            Self::NotFinite { part } => write!(f, "a measured value of the {part} is not finite"),
            Self::WrongJoints { part } => write!(f, "the state of the {part} names other joints or in another order"),
            Self::MeasurementJump { part } => write!(f, "the {part} is measured to move faster than it can"),
            Self::TimeJump { part, by_s } => write!(f, "time of the {part} jumps by {by_s:.3} s"),
            Self::Stuck { part } => write!(f, "what is measured of the {part} does not change although it is driven"),
            Self::Silent { part } => write!(f, "the {part} is silent"),
            Self::LocalisationJump { by_m } => write!(f, "localisation jumps by {by_m:.2} m against odometry"),
        }
    }
}

/// What happens to the envelope.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A cause to brake.
    Fault(Cause),
    /// No cause that clears is left.
    Cleared,
    /// A hold lasts for too long.
    Overdue,
    /// Nothing moves any more.
    Standstill,
    /// Somebody releases the latch.
    Reset,
}

/// The state of the envelope.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum SafetyState {
    /// Commands within the limits pass.
    #[default]
    Running,
    /// All parts brake at their acceleration limits, whatever is commanded.
    Braking {
        /// Why.
        cause: Cause,
        /// What ends it.
        release: Release,
    },
    /// All stands until the cause is gone; commands are answered with the zero that is sent.
    Held {
        /// Why.
        cause: Cause,
    },
    /// All stands and commands are refused until the reset.
    Stopped {
        /// Why.
        cause: Cause,
    },
}

impl SafetyState {
    /// The state after an event.
    pub fn next(self, event: Event) -> Self {
        match (self, event) {
            (Self::Running, Event::Fault(cause)) => {
                let release = cause.release();
                Self::Braking { cause, release }
            }
            (Self::Braking { release: Release::Cleared, .. } | Self::Held { .. }, Event::Fault(cause))
                if cause.release() == Release::Reset =>
            {
                Self::Braking { cause, release: Release::Reset }
            }
            (Self::Braking { release: Release::Cleared, .. } | Self::Held { .. }, Event::Cleared) => Self::Running,
            (Self::Braking { cause, release: Release::Cleared } | Self::Held { cause }, Event::Overdue) => {
                Self::Braking { cause, release: Release::Reset }
            }
            (Self::Braking { cause, release: Release::Cleared }, Event::Standstill) => Self::Held { cause },
            (Self::Braking { cause, release: Release::Reset }, Event::Standstill) => Self::Stopped { cause },
            (Self::Stopped { .. }, Event::Reset) => Self::Running,
            (state, _) => state,
        }
    }

    /// Why it does not run.
    pub fn find_cause(&self) -> Option<&Cause> {
        match self {
            Self::Running => None,
            Self::Braking { cause, .. } | Self::Held { cause } | Self::Stopped { cause } => Some(cause),
        }
    }

    /// Why commands are refused until a reset.
    pub fn find_latched(&self) -> Option<&Cause> {
        match self {
            Self::Braking { cause, release: Release::Reset } | Self::Stopped { cause } => Some(cause),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: from every state every event leads where the table of this module says, and nowhere else; whatever
    //! happens in whatever order, a latch is left by a reset at standstill alone and its first cause stays.
    use super::*;
    use proptest::prelude::*;

    fn clears() -> Cause {
        Cause::Silent { part: Part::Camera }
    }

    fn latches() -> Cause {
        Cause::NotFinite { part: Part::Arm }
    }

    fn states() -> [SafetyState; 5] {
        [
            SafetyState::Running,
            SafetyState::Braking { cause: clears(), release: Release::Cleared },
            SafetyState::Held { cause: clears() },
            SafetyState::Braking { cause: latches(), release: Release::Reset },
            SafetyState::Stopped { cause: latches() },
        ]
    }

    fn events() -> [Event; 6] {
        [
            Event::Fault(clears()),
            Event::Fault(latches()),
            Event::Cleared,
            Event::Overdue,
            Event::Standstill,
            Event::Reset,
        ]
    }

    /// The row and column of the table, as the place of the next state in [`states`].
    const TABLE: [[usize; 6]; 5] =
        [[1, 3, 0, 0, 0, 0], [1, 3, 0, 3, 2, 1], [2, 3, 0, 3, 2, 2], [3, 3, 3, 3, 4, 3], [4, 4, 4, 4, 4, 0]];

    #[test]
    fn every_event_in_every_state_leads_where_the_table_says() {
        let place = |state: &SafetyState| match state {
            SafetyState::Running => 0,
            SafetyState::Braking { release: Release::Cleared, .. } => 1,
            SafetyState::Held { .. } => 2,
            SafetyState::Braking { release: Release::Reset, .. } => 3,
            SafetyState::Stopped { .. } => 4,
        };
        let mut walked = 0;
        for (row, state) in states().into_iter().enumerate() {
            for (column, event) in events().into_iter().enumerate() {
                let next = state.clone().next(event.clone());
                assert_eq!(place(&next), TABLE[row][column], "{state:?} + {event:?} = {next:?}");
                walked += 1;
            }
        }
        assert_eq!(walked, 30);
    }

    #[test]
    fn every_cause_says_what_ends_it_and_why() {
        let part = Part::Arm;
        let reset = [
            Cause::EmergencyStop { reason: "a person".into() },
            Cause::PartFailed { part, reason: "gone".into() },
            Cause::NotFinite { part },
            Cause::WrongJoints { part },
            Cause::MeasurementJump { part },
            Cause::TimeJump { part: Part::Clock, by_s: -1.0 },
            Cause::Stuck { part },
        ];
        assert!(reset.iter().all(|cause| cause.release() == Release::Reset && !cause.to_string().is_empty()));
        for cause in [Cause::Silent { part: Part::Camera }, Cause::LocalisationJump { by_m: 0.3 }] {
            assert_eq!(cause.release(), Release::Cleared);
        }
        assert_eq!(Cause::Silent { part: Part::Camera }.to_string(), "the head camera is silent");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn a_latch_is_left_by_a_reset_at_standstill_alone(picks in prop::collection::vec((0usize..6, 0u32..1000), 1..60)) {
            let mut state = SafetyState::Running;
            for (pick, number) in picks {
                // Each latching fault has words of its own, so that a later one would show.
                let event = match pick {
                    1 => Event::Fault(Cause::EmergencyStop { reason: number.to_string() }),
                    other => events()[other].clone(),
                };
                let before = state.clone();
                state = state.next(event.clone());
                if let Some(cause) = before.find_latched() {
                    let left = matches!(before, SafetyState::Stopped { .. }) && event == Event::Reset;
                    prop_assert_eq!(left, state.find_latched().is_none());
                    if !left {
                        prop_assert_eq!(state.find_latched(), Some(cause));
                    }
                }
                // Motion begins again only from what stood, or from what brakes for a cause that is gone.
                if state == SafetyState::Running && before != SafetyState::Running {
                    prop_assert!(matches!(event, Event::Cleared | Event::Reset));
                }
                // A fault is never without effect on what runs.
                if matches!(event, Event::Fault(_)) {
                    prop_assert!(state.find_cause().is_some());
                }
            }
        }
    }
}
