//! Time as whole nanoseconds from the start of the run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::{Add, Sub};

/// A moment: nanoseconds from the run's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
pub struct Stamp(pub i64);

/// A span of time in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
pub struct Span(pub i64);

impl Stamp {
    /// The moment `seconds` after the run's start, rounded to a nanosecond.
    pub fn from_s(seconds: f64) -> Self {
        Self((seconds * 1e9).round() as i64)
    }

    /// Seconds since the run's start.
    pub fn as_s(self) -> f64 {
        self.0 as f64 * 1e-9
    }
}

impl Span {
    /// A span of `seconds`, rounded to a nanosecond.
    pub fn from_s(seconds: f64) -> Self {
        Self((seconds * 1e9).round() as i64)
    }

    /// The span in seconds.
    pub fn as_s(self) -> f64 {
        self.0 as f64 * 1e-9
    }
}

impl Add<Span> for Stamp {
    type Output = Stamp;
    fn add(self, span: Span) -> Stamp {
        Stamp(self.0 + span.0)
    }
}

impl Sub for Stamp {
    type Output = Span;
    fn sub(self, earlier: Stamp) -> Span {
        Span(self.0 - earlier.0)
    }
}
