//! Skills: what the robot can do. Each is a function that ticks the agent until it is done and answers with a typed
//! outcome; each is bounded in simulated time.

mod ajar;
pub mod approach;
pub mod arm;
mod carcass;
mod carry;
pub mod close;
mod doors;
pub mod drive;
pub mod explore;
pub mod fallen;
pub(crate) mod front_places;
mod fronts;
pub mod grasp;
pub mod held;
mod hold;
pub mod inside;
mod lift;
pub mod looks;
pub mod meaning;
pub mod navigate;
pub mod obstacles;
pub mod open;
mod pass;
pub mod place;
mod pull;
mod push;
pub mod regrip;
pub mod retreat;
pub mod search;
mod seen;
mod shove;
pub mod spots;
mod swing;
mod target;
pub mod wiggle;
mod wrist;

use crate::summary::Stage;

/// How a skill ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Done; what was reached, in words.
    Done(String),
    /// Not done: in which stage, and why.
    Failed(Stage, String),
}
