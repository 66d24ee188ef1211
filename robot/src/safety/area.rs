//! The area that the base stays in.

use crate::drivers::Twist;
use crate::nav::Pose2;
use nalgebra::{Point2, Vector2};

/// Speed at which a base that stands outside may move, metres per second: it has to come back somehow.
const OUTSIDE_M_PER_S: f64 = 0.1;

/// The way from `from` along `ahead` to the border of the area, metres; `None` outside.
fn find_way_m(corners: &[[f64; 2]], from: &Point2<f64>, ahead: &Vector2<f64>) -> Option<f64> {
    let (mut crossings, mut way_m) = (0, f64::INFINITY);
    for (k, corner) in corners.iter().enumerate() {
        let begin = Vector2::from(*corner) - from.coords;
        let along = Vector2::from(corners[(k + 1) % corners.len()]) - from.coords - begin;
        let across = ahead.perp(&along);
        if across == 0.0 {
            continue;
        }
        let (way, share) = (begin.perp(&along) / across, begin.perp(ahead) / across);
        if way >= 0.0 && (0.0..1.0).contains(&share) {
            crossings += 1;
            way_m = way_m.min(way);
        }
    }
    (crossings % 2 == 1).then_some(way_m)
}

/// Speed from which a base stops before it leaves the area on a straight way.
pub(super) fn allowed_m_per_s(corners: &[[f64; 2]], base: &Pose2, wanted: Twist, stops: impl Fn(f64) -> f64) -> f64 {
    if corners.len() < 3 {
        return f64::INFINITY;
    }
    let way = if wanted.forward_m_per_s < 0.0 { -1.0 } else { 1.0 };
    let ahead = way * Vector2::new(base.yaw_rad.cos(), base.yaw_rad.sin());
    find_way_m(corners, &base.position, &ahead).map_or(OUTSIDE_M_PER_S, stops)
}

#[cfg(test)]
mod tests {
    //! Contract: the way to the border ahead decides the speed, whichever way the base drives; outside it creeps.
    use super::*;

    #[test]
    fn the_border_ahead_counts() {
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]];
        let speed = |x: f64, y: f64, yaw_rad: f64, forward_m_per_s: f64| {
            let base = Pose2 { position: Point2::new(x, y), yaw_rad };
            allowed_m_per_s(&corners, &base, Twist { forward_m_per_s, turn_rad_per_s: 0.0 }, |way_m| way_m)
        };
        assert!((speed(1.0, 1.0, 0.0, 1.0) - 3.0).abs() < 1e-9);
        assert!((speed(1.0, 1.0, 0.0, -1.0) - 1.0).abs() < 1e-9);
        assert!((speed(1.0, 3.0, 0.0, 1.0) - 1.0).abs() < 1e-9, "the corner is cut out");
        assert_eq!(speed(3.0, 3.0, 0.0, 1.0), OUTSIDE_M_PER_S);
        let nowhere = Pose2 { position: Point2::origin(), yaw_rad: 0.0 };
        assert_eq!(allowed_m_per_s(&[], &nowhere, Twist::default(), |way_m| way_m), f64::INFINITY);
    }
}
