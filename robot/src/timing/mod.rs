//! When things were measured, as against when they are heard of.
//!
//! ```text
//! states, in any order ──▶ TimedBuffer ──▶ the state at an image's stamp
//! frames, in any order ──▶ Reorder ──────▶ frames in order, each once
//!                 Synchronised<R>: any robot whose frames get the pose of their own moment
//! ```
//!
//! A stamp is the moment at which something was true; a latency is how much later it is heard of. Poses between two
//! measurements are interpolated, a little beyond the last one extrapolated; what lies farther out is said, never guessed.

mod buffer;
mod reorder;
mod synchronised;

pub use buffer::{At, Between, BufferLimits, Inserted, TimedBuffer};
pub use reorder::{Flow, Reorder, Taken};
pub use synchronised::{Synchronised, SynchronisedReport};

#[cfg(test)]
mod tests;
