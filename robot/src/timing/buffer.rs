//! Stamped values, and what lies between them.

use crate::joints::JointPositions;
use dsm::Pose;
use dsm::time::{Span, Stamp};
use nalgebra::UnitQuaternion;
use std::collections::BTreeMap;

/// A value that can be interpolated.
pub trait Between: Clone {
    /// The value a `share` of the way from `self` to `other`: 0 is `self`, 1 is `other`, more goes on beyond. `None` when
    /// the two are of different things.
    fn find_between(&self, other: &Self, share: f64) -> Option<Self>;
}

impl Between for Pose {
    /// The position along the line, the rotation about one axis at constant speed the short way round (slerp).
    fn find_between(&self, other: &Self, share: f64) -> Option<Self> {
        let translation = self.translation.vector.lerp(&other.translation.vector, share);
        let turn = self.rotation.rotation_to(&other.rotation).scaled_axis();
        let rotation = UnitQuaternion::from_scaled_axis(turn * share) * self.rotation;
        Some(Self::from_parts(translation.into(), rotation))
    }
}

impl Between for JointPositions {
    fn find_between(&self, other: &Self, share: f64) -> Option<Self> {
        let values = self.values().iter().zip(other.values()).map(|(a, b)| a + share * (b - a)).collect();
        if self.names() == other.names() { Self::from_values(self.names(), values) } else { None }
    }
}

/// How far a buffer's answers may reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferLimits {
    /// Values older than the newest by more are forgotten; default 5 s, range above `longest_gap`.
    pub keep: Span,
    /// Nothing is interpolated over a longer gap; default 0.2 s, range above 0.
    pub longest_gap: Span,
    /// Nothing is extrapolated farther beyond the newest value; default 0.05 s, range 0 to `longest_gap`.
    pub farthest_beyond: Span,
}

impl Default for BufferLimits {
    fn default() -> Self {
        Self { keep: Span(5_000_000_000), longest_gap: Span(200_000_000), farthest_beyond: Span(50_000_000) }
    }
}

/// What became of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inserted {
    /// It is the newest.
    Newest,
    /// It came late and fills its place among others.
    Filled,
    /// There was one with this stamp, which stays.
    Repeated,
    /// It is too old to be kept.
    TooOld,
}

/// The value at a moment, or why there is none.
#[derive(Clone, Debug, PartialEq)]
pub enum At<T> {
    /// It was measured then.
    Measured(T),
    /// It lies between two values that are `gap` apart.
    Interpolated {
        /// The value.
        value: T,
        /// Time between the two.
        gap: Span,
    },
    /// It lies a little beyond the newest value.
    Extrapolated {
        /// The value.
        value: T,
        /// How far.
        beyond: Span,
    },
    /// Nothing so new is known yet.
    NotYet {
        /// Stamp of the newest value.
        newest: Stamp,
    },
    /// Nothing so old is known any more.
    Forgotten {
        /// Stamp of the oldest value.
        oldest: Stamp,
    },
    /// The values around it are too far apart, or of different things.
    InGap {
        /// Stamp of the one before.
        before: Stamp,
        /// Stamp of the one after.
        after: Stamp,
    },
    /// Nothing is known at all.
    Empty,
}

impl<T> At<T> {
    /// The same outcome of another value.
    pub fn map<U>(self, change: impl FnOnce(T) -> U) -> At<U> {
        match self {
            Self::Measured(value) => At::Measured(change(value)),
            Self::Interpolated { value, gap } => At::Interpolated { value: change(value), gap },
            Self::Extrapolated { value, beyond } => At::Extrapolated { value: change(value), beyond },
            Self::NotYet { newest } => At::NotYet { newest },
            Self::Forgotten { oldest } => At::Forgotten { oldest },
            Self::InGap { before, after } => At::InGap { before, after },
            Self::Empty => At::Empty,
        }
    }

    /// The value, if there is one.
    pub fn find(self) -> Option<T> {
        match self {
            Self::Measured(value) | Self::Interpolated { value, .. } | Self::Extrapolated { value, .. } => Some(value),
            Self::NotYet { .. } | Self::Forgotten { .. } | Self::InGap { .. } | Self::Empty => None,
        }
    }
}

/// Values of the last seconds by their stamps; they may come in any order.
#[derive(Clone, Debug)]
pub struct TimedBuffer<T> {
    limits: BufferLimits,
    values: BTreeMap<Stamp, T>,
}

impl<T: Between> TimedBuffer<T> {
    /// An empty buffer.
    pub fn new(limits: BufferLimits) -> Self {
        Self { limits, values: BTreeMap::new() }
    }

    /// Number of values that are kept.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Takes in a value.
    pub fn insert(&mut self, stamp: Stamp, value: T) -> Inserted {
        let newest = self.values.keys().next_back().copied();
        if newest.is_some_and(|newest| newest - stamp > self.limits.keep) {
            return Inserted::TooOld;
        }
        if self.values.contains_key(&stamp) {
            return Inserted::Repeated;
        }
        self.values.insert(stamp, value);
        if newest.is_some_and(|newest| stamp < newest) {
            return Inserted::Filled;
        }
        let oldest = Stamp(stamp.0.saturating_sub(self.limits.keep.0));
        self.values = self.values.split_off(&oldest);
        Inserted::Newest
    }

    /// The value at a moment.
    pub fn at(&self, stamp: Stamp) -> At<T> {
        if let Some(value) = self.values.get(&stamp) {
            return At::Measured(value.clone());
        }
        let before = self.values.range(..stamp).next_back();
        let after = self.values.range(stamp..).next();
        match (before, after) {
            (Some(before), Some(after)) => self.interpolate(before, after, stamp),
            (Some((newest, _)), None) => self.extrapolate(*newest, stamp),
            (None, Some((oldest, _))) => At::Forgotten { oldest: *oldest },
            (None, None) => At::Empty,
        }
    }

    fn interpolate(&self, (before, a): (&Stamp, &T), (after, b): (&Stamp, &T), stamp: Stamp) -> At<T> {
        let gap = *after - *before;
        let share = (stamp - *before).0 as f64 / gap.0 as f64;
        match a.find_between(b, share) {
            Some(value) if gap <= self.limits.longest_gap => At::Interpolated { value, gap },
            _ => At::InGap { before: *before, after: *after },
        }
    }

    /// Goes on as between the last two values.
    fn extrapolate(&self, newest: Stamp, stamp: Stamp) -> At<T> {
        let beyond = stamp - newest;
        let mut last = self.values.iter().rev().take(2);
        let (Some((_, b)), Some((before, a))) = (last.next(), last.next()) else { return At::NotYet { newest } };
        let gap = newest - *before;
        if beyond > self.limits.farthest_beyond || gap > self.limits.longest_gap {
            return At::NotYet { newest };
        }
        match a.find_between(b, 1.0 + beyond.0 as f64 / gap.0 as f64) {
            Some(value) => At::Extrapolated { value, beyond },
            None => At::NotYet { newest },
        }
    }
}
