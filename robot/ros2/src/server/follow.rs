//! Trajectories as joints follow them.

use crate::messages::{Duration, JointTrajectory, JointTrajectoryPoint};
use dsm::time::{Span, Stamp};
use dsm_robot::joints::JointNames;

/// How fast an error of position is taken out, 1/s.
const GAIN_PER_S: f64 = 8.0;
/// How far a joint may be off at the end where the goal does not say, radians or metres.
const REACHED: f64 = 0.01;
/// How late it may be there where the goal does not say.
const GRACE: Span = Span(2_000_000_000);

/// A way of joints, and when it began.
pub(super) struct Way {
    begun: Stamp,
    /// Moments after the beginning, and positions in the group's order.
    points: Vec<(Span, Vec<f64>)>,
    tolerance: f64,
    grace: Span,
}

/// What joints that follow a way do next.
#[derive(Debug, PartialEq)]
pub(super) enum Next {
    /// These velocities.
    Move(Vec<f64>),
    /// They are there.
    Reached,
    /// They are not there in time; the joint that is farthest off, and by how much.
    Missed(usize, f64),
}

fn span(duration: Duration) -> Span {
    Span(i64::from(duration.sec) * 1_000_000_000 + i64::from(duration.nanosec))
}

impl Way {
    /// A way from where the joints are; `Err` with why it is none.
    pub(super) fn new(
        names: &JointNames,
        said: &JointTrajectory,
        now: Stamp,
        positions: &[f64],
        tolerance: Option<f64>,
        grace: Duration,
    ) -> Result<Self, String> {
        let place = |name: &str| said.joint_names.iter().position(|known| known == name);
        let places: Option<Vec<usize>> = names.iter().map(|name| place(name)).collect();
        let places = places.ok_or_else(|| format!("expected the joints {names:?}, got {:?}", said.joint_names))?;
        let mut points = vec![(Span(0), positions.to_vec())];
        for JointTrajectoryPoint { positions, time_from_start, .. } in &said.points {
            let at: Option<Vec<f64>> = places.iter().map(|place| positions.get(*place).copied()).collect();
            let at = at.filter(|at| at.iter().all(|value| value.is_finite()));
            let at = at.ok_or("a point without a finite position for each joint")?;
            let (last, time) = (points.last().map_or(Span(0), |(time, _)| *time), span(*time_from_start));
            if time < last {
                return Err(format!("a point at {} s after one at {} s", time.as_s(), last.as_s()));
            }
            points.push((time, at));
        }
        if points.len() == 1 {
            return Err("no points".into());
        }
        let grace = if span(grace).0 > 0 { span(grace) } else { GRACE };
        Ok(Self { begun: now, points, tolerance: tolerance.unwrap_or(REACHED), grace })
    }

    /// Where the joints are to be at a moment, and how fast.
    fn desired(&self, now: Stamp) -> (Vec<f64>, Vec<f64>) {
        let time = now - self.begun;
        let still = |at: &[f64]| (at.to_vec(), vec![0.0; at.len()]);
        let Some(next) = self.points.iter().position(|(moment, _)| *moment > time) else {
            return still(&self.points[self.points.len() - 1].1);
        };
        if next == 0 {
            return still(&self.points[0].1);
        }
        let ((from_time, from), (to_time, to)) = (&self.points[next - 1], &self.points[next]);
        let length_s = to_time.as_s() - from_time.as_s();
        let share = (time.as_s() - from_time.as_s()) / length_s;
        let at = from.iter().zip(to).map(|(from, to)| from + share * (to - from)).collect();
        let speed = from.iter().zip(to).map(|(from, to)| (to - from) / length_s).collect();
        (at, speed)
    }

    /// What to do at a moment, from where the joints are.
    pub(super) fn next(&self, now: Stamp, positions: &[f64]) -> Next {
        let (at, speed) = self.desired(now);
        let errors: Vec<f64> = at.iter().zip(positions).map(|(at, is)| at - is).collect();
        let end = self.points[self.points.len() - 1].0;
        let time = now - self.begun;
        if time >= end {
            let worst = (0..errors.len()).max_by(|a, b| errors[*a].abs().total_cmp(&errors[*b].abs()));
            match worst.map(|joint| (joint, errors[joint].abs())) {
                Some((_, error)) if error <= self.tolerance => return Next::Reached,
                Some((joint, error)) if time.0 > end.0 + self.grace.0 => return Next::Missed(joint, error),
                _ => {}
            }
        }
        Next::Move(speed.iter().zip(&errors).map(|(speed, error)| speed + GAIN_PER_S * error).collect())
    }
}

#[cfg(test)]
mod tests {
    //! Contract: joints that do what they are told follow a way and arrive; joints that do not are said to have missed it;
    //! a way that is none says why.
    use super::*;

    fn names() -> JointNames {
        vec!["a".into(), "b".into()].into()
    }

    fn trajectory(joints: &[&str], points: &[(i32, [f64; 2])]) -> JointTrajectory {
        let point = |(sec, positions): &(i32, [f64; 2])| JointTrajectoryPoint {
            positions: positions.to_vec(),
            time_from_start: Duration { sec: *sec, nanosec: 0 },
            ..JointTrajectoryPoint::default()
        };
        JointTrajectory {
            joint_names: joints.iter().map(|name| (*name).to_owned()).collect(),
            points: points.iter().map(point).collect(),
            ..JointTrajectory::default()
        }
    }

    fn way(said: &JointTrajectory) -> Result<Way, String> {
        Way::new(&names(), said, Stamp(0), &[0.0, 0.0], None, Duration::default())
    }

    #[test]
    fn joints_follow_and_arrive() {
        let way = way(&trajectory(&["b", "a"], &[(1, [1.0, 0.5]), (2, [1.0, 1.0])])).unwrap();
        let (mut positions, mut worst, mut now) = ([0.0, 0.0], 0.0_f64, Stamp(0));
        while let Next::Move(velocities) = way.next(now, &positions) {
            let (at, _) = way.desired(now);
            worst = positions.iter().zip(&at).fold(worst, |worst, (is, at)| worst.max((is - at).abs()));
            positions.iter_mut().zip(velocities).for_each(|(position, velocity)| *position += 0.01 * velocity);
            now = now + Span(10_000_000);
        }
        assert!(worst < 0.02 && now.as_s() < 2.1, "{worst} {}", now.as_s());
        assert!((positions[0] - 1.0).abs() < REACHED && (positions[1] - 1.0).abs() < REACHED, "{positions:?}");
        assert_eq!(way.next(Stamp::from_s(1.5), &[0.0, 1.0]), Next::Move(vec![0.5 + GAIN_PER_S * 0.75, 0.0]));
        assert_eq!(way.next(Stamp::from_s(4.5), &[0.0, 1.0]), Next::Missed(0, 1.0));
    }

    #[test]
    fn what_is_no_way_says_why() {
        assert!(way(&trajectory(&["a"], &[(1, [1.0, 0.5])])).is_err_and(|why| why.contains("expected the joints")));
        assert!(way(&trajectory(&["a", "b"], &[])).is_err_and(|why| why == "no points"));
        assert!(way(&trajectory(&["a", "b"], &[(2, [0.0; 2]), (1, [0.0; 2])])).is_err_and(|why| why.contains("after")));
        assert!(way(&trajectory(&["a", "b"], &[(1, [f64::NAN; 2])])).is_err_and(|why| why.contains("finite")));
    }
}
