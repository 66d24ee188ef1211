//! Jumps of the believed pose, told by odometry, and what is believed meanwhile.
//!
//! ```text
//! expected = B_0 O_0^-1 O_1;     jump: |expected^-1 C L_1| > bound;     then C = expected L_1^-1,  B_1 = C L_1
//! ```
//!
//! Localisation L is right in the long run and may jump; odometry O drifts and never does. A jump is taken out (C) until
//! localisation jumps back, or has stood by it for so long that it is believed.
//!
//! The safety envelope sees the same jump by the same bounds and decides how the base moves: it brakes until localisation
//! moves with odometry again. What is decided here is which pose is believed meanwhile and after.

use dsm::Pose;
use dsm::time::{Span, Stamp};

/// In one control period no base moves so far against its odometry: at 0.8 m/s it moves 8 mm, however its wheels slip.
const JUMP_M: f64 = 0.05;
/// ... nor turns so far: at 2 rad/s it turns 0.02 rad.
const JUMP_RAD: f64 = 0.035;
/// Nearer than this to where it ought to be, localisation is back; what odometry drifts meanwhile is less, metres.
const BACK_M: f64 = 0.1;
const BACK_RAD: f64 = 0.06;
/// A localisation that stands by its jump for so long is right: by then odometry has drifted by as much.
const BELIEVED_AFTER: Span = Span(10_000_000_000);

/// What became of the believed pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PoseEvent {
    /// It jumped by so much; what is believed does not.
    Jumped {
        /// Metres.
        by_m: f64,
    },
    /// It is where it ought to be again.
    Back,
    /// It stood by its jump; what is believed follows.
    Believed,
}

/// Watches localisation.
#[derive(Clone, Debug, Default)]
pub(crate) struct PoseWatch {
    /// Believed and odometric pose of the last look.
    last: Option<(Pose, Pose)>,
    /// World as it ought to be from the world of localisation, since when; `None` while they are the same.
    correction: Option<(Pose, Stamp)>,
}

impl PoseWatch {
    /// Looks at localisation and odometry of this control period.
    pub(crate) fn note(&mut self, now: Stamp, located: &Pose, odom: &Pose) -> Option<PoseEvent> {
        let event = self.last.and_then(|(believed, odom_before)| {
            let expected = believed * odom_before.inv_mul(odom);
            self.judge(now, located, &expected)
        });
        self.last = Some((self.believed(now, located), *odom));
        event
    }

    fn judge(&mut self, now: Stamp, located: &Pose, expected: &Pose) -> Option<PoseEvent> {
        let is_off = |pose: &Pose, by_m: f64, by_rad: f64| {
            let off = expected.inv_mul(pose);
            off.translation.vector.norm() > by_m || off.rotation.angle() > by_rad
        };
        if let Some((_, since)) = self.correction {
            if !is_off(located, BACK_M, BACK_RAD) {
                self.correction = None;
                return Some(PoseEvent::Back);
            }
            if now - since >= BELIEVED_AFTER {
                self.correction = None;
                return Some(PoseEvent::Believed);
            }
        }
        if !is_off(&self.believed(now, located), JUMP_M, JUMP_RAD) {
            return None;
        }
        let by_m = expected.inv_mul(&self.believed(now, located)).translation.vector.norm();
        let since = self.correction.map_or(now, |(_, since)| since);
        self.correction = Some((expected * located.inverse(), since));
        Some(PoseEvent::Jumped { by_m })
    }

    /// What is believed of a pose in the world of localisation that was measured at `stamp`.
    pub(crate) fn believed(&self, stamp: Stamp, located: &Pose) -> Pose {
        match &self.correction {
            Some((correction, since)) if stamp >= *since => correction * located,
            _ => *located,
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a jump that comes back is never believed, one that stays is believed in the end, and what a localiser
    //! wanders or wheels slip is no jump.
    use super::*;
    use nalgebra::Vector3;

    fn at(x: f64, yaw_rad: f64) -> Pose {
        Pose::new(Vector3::new(x, 0.0, 0.0), Vector3::z() * yaw_rad)
    }

    /// Drives at 0.6 m/s; `error` says by what localisation is off at a time, odometry counts `turns` of what is driven.
    fn drive(seconds: f64, turns: f64, error: impl Fn(f64) -> Pose) -> (f64, Vec<(i64, PoseEvent)>) {
        let mut watch = PoseWatch::default();
        let (mut worst_m, mut events) = (0.0_f64, Vec::new());
        for tick in 0..(seconds * 100.0) as i64 {
            let (now, driven_m) = (Stamp(tick * 10_000_000), 0.006 * tick as f64);
            let located = error(now.as_s()) * at(driven_m, 0.0);
            events.extend(watch.note(now, &located, &at(turns * driven_m, 0.0)).map(|event| (tick, event)));
            let off = watch.believed(now, &located).translation.vector - at(driven_m, 0.0).translation.vector;
            worst_m = worst_m.max(off.norm());
        }
        (worst_m, events)
    }

    #[test]
    fn a_jump_that_comes_back_is_never_believed() {
        let error = |now_s: f64| if (2.0..7.0).contains(&now_s) { at(0.3, 0.1) } else { Pose::identity() };
        let (worst_m, events) = drive(12.0, 1.02, error);
        assert!(worst_m < 0.08, "{worst_m}");
        assert!(matches!(events[..], [(200, PoseEvent::Jumped { .. }), (700, PoseEvent::Back)]), "{events:?}");
    }

    #[test]
    fn a_jump_that_stays_is_believed_in_the_end() {
        let error = |now_s: f64| if now_s >= 2.0 { at(0.3, 0.0) } else { Pose::identity() };
        let (worst_m, events) = drive(20.0, 1.0, error);
        assert!(matches!(events[..], [(200, PoseEvent::Jumped { .. }), (1200, PoseEvent::Believed)]), "{events:?}");
        assert!((worst_m - 0.3).abs() < 1e-9, "what is believed is the localiser's in the end");
    }

    #[test]
    fn wandering_and_slipping_are_no_jumps() {
        assert_eq!(drive(20.0, 1.9, |now_s| at(0.03 * now_s.sin(), 0.008 * now_s.cos())).1, []);
    }
}
