//! What the cameras measured around the base a moment ago, and how far the base can drive before it meets it.
//!
//! Points are kept in odometry's frame: a jump of localisation moves none of them. Where the base drives along an arc
//! about the point c with the radius r, it meets a point p with its footprint R after the way
//!
//! ```text
//! |r| (phi - acos((r^2 + d^2 - R^2) / (2 |r| d))),   d = |p - c|,   phi = angle of p about c from where the base is
//! ```

use super::settings::DepthSettings;
use crate::drivers::Twist;
use crate::nav::{LiveConfig, LiveObstacles};
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::geometry::OrientedBox;
use nalgebra::{Point2, Point3};

/// Beyond this radius an arc counts as straight, metres.
const STRAIGHT_M: f64 = 50.0;
/// A footprint that turns about a point so near to its middle goes nowhere, metres.
const SPIN_M: f64 = 0.02;
/// What lies so far inside the footprint cannot be there, metres.
const IMPOSSIBLE_M: f64 = 0.04;

/// Obstacles of the last moments.
pub(super) struct DepthGuard {
    live: LiveObstacles,
    config: LiveConfig,
    /// Odometry's frame.
    points: Vec<Point2<f64>>,
}

impl DepthGuard {
    /// For a robot of this height.
    pub(super) fn new(settings: &DepthSettings, height_m: f64) -> Self {
        let config = LiveConfig {
            lowest_m: settings.lowest_m,
            highest_m: height_m,
            memory_s: settings.memory_s,
            ..LiveConfig::default()
        };
        Self { live: LiveObstacles::default(), config, points: Vec::new() }
    }

    /// Takes in a frame by the true place of its camera; `bodies` are the robot's own and what it holds, odometry's frame.
    pub(super) fn note(&mut self, frame: &mut RgbdFrame, odom_from_camera: Pose, bodies: &[OrientedBox]) {
        let believed = std::mem::replace(&mut frame.world_from_camera, odom_from_camera);
        self.live.observe(frame, bodies, &self.config);
        frame.world_from_camera = believed;
        self.points.clear();
        self.points.extend(self.live.points());
    }

    /// The way that a base with the footprint `radius_m` drives with `twist` before it comes as near as `margin_m` to
    /// something, metres; `None` when there is nothing within `reach_m`.
    pub(super) fn find_way_m(
        &self,
        odom_from_base: &Pose,
        twist: Twist,
        (radius_m, margin_m): (f64, f64),
        reach_m: f64,
    ) -> Option<f64> {
        let base_from_odom = odom_from_base.inverse();
        let here = odom_from_base.translation.vector.xy();
        let kept_m = radius_m + margin_m;
        let far = (reach_m + kept_m) * (reach_m + kept_m);
        let near = (radius_m - IMPOSSIBLE_M) * (radius_m - IMPOSSIBLE_M);
        let around = self.points.iter().filter(|point| (near..far).contains(&(point.coords - here).norm_squared()));
        let ways = around.filter_map(|point| {
            let point = (base_from_odom * Point3::new(point.x, point.y, 0.0)).xy();
            find_way_to_m(&point, twist, kept_m)
        });
        ways.min_by(f64::total_cmp).filter(|way_m| *way_m < reach_m)
    }
}

/// The way to a point, base frame.
fn find_way_to_m(point: &Point2<f64>, twist: Twist, kept_m: f64) -> Option<f64> {
    // Driving backwards is driving forwards with the world mirrored.
    let forward = if twist.forward_m_per_s < 0.0 { -1.0 } else { 1.0 };
    let ahead_m = forward * point.x;
    let radius_m = twist.forward_m_per_s.abs() / twist.turn_rad_per_s.abs().max(1e-9);
    if radius_m < SPIN_M {
        return None;
    }
    if radius_m > STRAIGHT_M {
        let chord = kept_m * kept_m - point.y * point.y;
        // What is touched already is met at once by driving towards it, and left by driving away.
        return (chord > 0.0 && ahead_m > 0.0).then(|| (ahead_m - chord.sqrt()).max(0.0));
    }
    // The base turns about (0, r); mirrored so that it does to its left.
    let left = if twist.turn_rad_per_s * forward < 0.0 { -1.0 } else { 1.0 };
    let (x, y) = (ahead_m, left * point.y - radius_m);
    let distance_m = x.hypot(y);
    if (distance_m - radius_m).abs() >= kept_m || (ahead_m <= 0.0 && x.hypot(y + radius_m) < kept_m) {
        return None;
    }
    let half = (radius_m * radius_m + distance_m * distance_m - kept_m * kept_m) / (2.0 * radius_m * distance_m);
    let angle = x.atan2(-y).rem_euclid(std::f64::consts::TAU);
    Some((radius_m * (angle - half.clamp(-1.0, 1.0).acos())).max(0.0))
}

#[cfg(test)]
mod tests {
    //! Contract: the way to a point is what a base that drives its arc step by step finds, forwards and backwards, to the
    //! left and to the right.
    use super::*;

    /// Drives 1.2 m in small steps.
    fn driven_m(point: &Point2<f64>, twist: Twist, kept_m: f64) -> Option<f64> {
        let (mut x, mut y, mut yaw) = (0.0_f64, 0.0_f64, 0.0_f64);
        let step_s = 1e-4 / twist.forward_m_per_s.abs();
        let first = point.x.hypot(point.y);
        (0..12_000).find_map(|step| {
            let distance = (point.x - x).hypot(point.y - y);
            yaw += 0.5 * twist.turn_rad_per_s * step_s;
            x += twist.forward_m_per_s * step_s * yaw.cos();
            y += twist.forward_m_per_s * step_s * yaw.sin();
            yaw += 0.5 * twist.turn_rad_per_s * step_s;
            (distance < kept_m && (first >= kept_m || point.x * twist.forward_m_per_s > 0.0))
                .then_some(1e-4 * f64::from(step))
        })
    }

    #[test]
    fn the_way_is_what_driving_finds() {
        let mut met = 0;
        for (i, j) in (-12..=12).flat_map(|i| (-12..=12).map(move |j| (i, j))) {
            let point = Point2::new(0.1 * f64::from(i) + 0.003, 0.1 * f64::from(j) + 0.007);
            if point.x.hypot(point.y) < 0.3 {
                continue;
            }
            for (forward_m_per_s, turn_rad_per_s) in [(0.5, 0.0), (-0.5, 0.0), (0.5, 0.8), (0.4, -0.5), (-0.3, 0.6)] {
                let twist = Twist { forward_m_per_s, turn_rad_per_s };
                let found = find_way_to_m(&point, twist, 0.3).filter(|way_m| *way_m < 1.19);
                match (found, driven_m(&point, twist, 0.3)) {
                    (Some(found), Some(driven)) => {
                        assert!((found - driven).abs() < 2e-3, "{point} {twist:?}: {found}, {driven}");
                        met += 1;
                    }
                    (None, None) => {}
                    // A base that grazes a point may miss it by a step.
                    (found, driven) => {
                        let grazed = find_way_to_m(&point, twist, 0.299).is_none();
                        assert!(grazed || driven.is_some_and(|m| m > 1.18), "{point} {twist:?}: {found:?}, {driven:?}");
                    }
                }
            }
        }
        assert!(met > 250, "{met}");
    }

    #[test]
    fn turning_on_the_spot_meets_nothing_and_what_is_touched_can_be_left() {
        let spin = Twist { forward_m_per_s: 0.0, turn_rad_per_s: 1.0 };
        assert_eq!(find_way_to_m(&Point2::new(0.32, 0.0), spin, 0.3), None);
        let back = Twist { forward_m_per_s: -0.2, turn_rad_per_s: 0.0 };
        assert_eq!(find_way_to_m(&Point2::new(0.28, 0.0), back, 0.3), None);
        let on = Twist { forward_m_per_s: 0.2, turn_rad_per_s: 0.0 };
        assert_eq!(find_way_to_m(&Point2::new(0.28, 0.0), on, 0.3), Some(0.0));
    }
}
