//! Whether localisation and odometry can be true, and where the base was a moment ago.

use super::joint_watch::Moment;
use super::settings::SafetySettings;
use super::state::{Cause, Part};
use crate::drivers::{StampedPose, Twist};
use dsm::Pose;
use dsm::time::{Span, Stamp};
use std::collections::VecDeque;

/// Poses are remembered so long: frames come late.
const MEMORY: Span = Span(1_500_000_000);
/// A base that was told to move by so much without one bit of its pose changing is not measured: metres, and radians.
const STUCK: f64 = 0.1;
const PART: Part = Part::Localisation;

/// Where the base was.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) stamp: Stamp,
    pub(super) world_from_base: Pose,
    pub(super) odom_from_base: Pose,
}

/// Watches localisation.
pub(super) struct PlaceWatch {
    places: VecDeque<Place>,
    /// When the newest pose came.
    news_at: Stamp,
    /// When poses of localisation and of odometry changed last, and by how much the base was told to move since.
    changed_at: [Stamp; 2],
    told: [f64; 2],
    jumped: Option<(Stamp, f64)>,
}

impl PlaceWatch {
    pub(super) fn new(now: Stamp) -> Self {
        Self { places: VecDeque::new(), news_at: now, changed_at: [now; 2], told: [0.0; 2], jumped: None }
    }

    /// The newest place.
    pub(super) fn find_newest(&self) -> Option<&Place> {
        self.places.back()
    }

    /// Where the base was at a stamp of the robot's clock.
    pub(super) fn find_at(&self, stamp: Stamp) -> Option<&Place> {
        self.places.iter().rev().find(|place| place.stamp <= stamp).or_else(|| self.places.front())
    }

    /// What is wrong with a pose by itself.
    pub(super) fn find_flaw(pose: &Pose) -> Option<Cause> {
        let finite = pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|value| value.is_finite());
        (!finite).then_some(Cause::NotFinite { part: PART })
    }

    /// Takes in the poses of this moment; `told` is what the base follows. Returns what is wrong for good.
    pub(super) fn note(
        &mut self,
        at: Moment,
        world: &StampedPose,
        odom: &StampedPose,
        told: Twist,
        settings: &SafetySettings,
    ) -> Option<Cause> {
        if let Some(flaw) = Self::find_flaw(&world.pose).or_else(|| Self::find_flaw(&odom.pose)) {
            return Some(flaw);
        }
        let stamp = world.stamp.min(odom.stamp);
        let ahead_s = (world.stamp.max(odom.stamp) - at.clock).as_s();
        if ahead_s > settings.time_jump_s {
            return Some(Cause::TimeJump { part: PART, by_s: ahead_s });
        }
        let place = Place { stamp, world_from_base: world.pose, odom_from_base: odom.pose };
        let Some(last) = self.places.back().copied() else {
            self.places.push_back(place);
            (self.news_at, self.changed_at) = (at.now, [at.now; 2]);
            return None;
        };
        let step_s = (stamp - last.stamp).as_s();
        if step_s < 0.0 {
            return Some(Cause::TimeJump { part: PART, by_s: step_s });
        }
        if step_s == 0.0 {
            return None;
        }
        let expected = last.world_from_base * last.odom_from_base.inv_mul(&odom.pose);
        let off = expected.inv_mul(&world.pose);
        let by_m = off.translation.vector.norm();
        if by_m > settings.jump_m || off.rotation.angle() > settings.jump_rad {
            self.jumped = Some((at.now, by_m));
        }
        let unchanged = [world.pose == last.world_from_base, odom.pose == last.odom_from_base];
        let way = (told.forward_m_per_s.abs() + told.turn_rad_per_s.abs()) * step_s;
        for (k, unchanged) in unchanged.into_iter().enumerate() {
            (self.changed_at[k], self.told[k]) =
                if unchanged { (self.changed_at[k], self.told[k] + way) } else { (at.now, 0.0) };
        }
        self.news_at = at.now;
        self.places.push_back(place);
        while self.places.front().is_some_and(|oldest| stamp - oldest.stamp > MEMORY) {
            self.places.pop_front();
        }
        let timeout = Span::from_s(settings.sensor_timeout_s);
        let stuck = (0..2).any(|k| at.now - self.changed_at[k] > timeout && self.told[k] > STUCK);
        stuck.then_some(Cause::Stuck { part: PART })
    }

    /// What is wrong at present and may become right again.
    pub(super) fn find_trouble(&self, now: Stamp, settings: &SafetySettings) -> Option<Cause> {
        if now - self.news_at > Span::from_s(settings.sensor_timeout_s) {
            return Some(Cause::Silent { part: PART });
        }
        let (at, by_m) = self.jumped?;
        (now - at < Span::from_s(settings.settled_after_s)).then_some(Cause::LocalisationJump { by_m })
    }
}
