//! Contract: between two measurements a pose lies between them, however they came in; nothing is guessed far beyond or over a
//! gap; messages come out once, in order, whatever order, loss and repetition they came in with; frames get the pose of their
//! own moment.

use super::*;
use crate::joints::{JointNames, JointPositions};
use dsm::Pose;
use dsm::time::{Span, Stamp};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use std::sync::Arc;

const MS: i64 = 1_000_000;

fn at_ms(ms: i64) -> Stamp {
    Stamp(ms * MS)
}

/// A screw motion: what interpolates well is exact on it.
fn pose_at(s: f64) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.9) * s);
    Pose::from_parts(Translation3::new(0.5 * s, -0.1 * s, 0.02 * s), turn)
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    (a.translation.vector - b.translation.vector).norm() + a.rotation.angle_to(&b.rotation)
}

proptest! {
    #[test]
    fn poses_lie_between_their_neighbours_in_any_order_of_arrival(
        mut stamps in prop::collection::btree_set(0_i64..400, 2..60).prop_map(|set| set.into_iter().collect::<Vec<_>>()),
        asked in -50_i64..450,
        seed in 0_usize..1000,
    ) {
        let sorted = stamps.clone();
        let count = stamps.len();
        for i in 0..count {
            stamps.swap(i, (i * 7919 + seed) % count);
        }
        let limits = BufferLimits { keep: Span(1000 * MS), longest_gap: Span(60 * MS), farthest_beyond: Span(30 * MS) };
        let mut buffer = TimedBuffer::new(limits);
        for stamp in &stamps {
            buffer.insert(at_ms(*stamp), pose_at(*stamp as f64 * 1e-3));
        }
        prop_assert_eq!(buffer.insert(at_ms(stamps[0]), Pose::identity()), Inserted::Repeated);
        let before = sorted.iter().rev().find(|stamp| **stamp <= asked).copied();
        let after = sorted.iter().find(|stamp| **stamp >= asked).copied();
        let outcome = buffer.at(at_ms(asked));
        match (before, after) {
            (Some(before), Some(after)) if before == after => prop_assert_eq!(outcome, At::Measured(pose_at(asked as f64 * 1e-3))),
            (Some(before), Some(after)) if after - before <= 60 => {
                let value = outcome.find().unwrap();
                prop_assert!(apart(&value, &pose_at(asked as f64 * 1e-3)) < 1e-9);
            }
            (Some(before), Some(after)) => prop_assert_eq!(outcome, At::InGap { before: at_ms(before), after: at_ms(after) }),
            (None, Some(_)) => prop_assert_eq!(outcome, At::Forgotten { oldest: at_ms(sorted[0]) }),
            (Some(newest), None) => {
                let gap = newest - sorted[count - 2];
                if asked - newest <= 30 && gap <= 60 {
                    let expected = pose_at(asked as f64 * 1e-3);
                    let At::Extrapolated { value, beyond } = outcome else { panic!("{outcome:?}") };
                    prop_assert_eq!(beyond, Span((asked - newest) * MS));
                    prop_assert!(apart(&value, &expected) < 1e-9);
                } else {
                    prop_assert_eq!(outcome, At::NotYet { newest: at_ms(newest) });
                }
            }
            (None, None) => unreachable!("there are two at least"),
        }
    }

    #[test]
    fn messages_come_out_once_and_in_order(
        // Of each message: how late it comes, whether it is lost, whether it comes twice.
        fates in prop::collection::vec((0_i64..80, prop::bool::weighted(0.1), prop::bool::weighted(0.1)), 1..80),
        patience_ms in 0_i64..60,
    ) {
        let mut arrivals: Vec<(i64, i64)> = Vec::new();
        for (number, (late, lost, twice)) in fates.iter().enumerate() {
            let stamp = 20 * number as i64;
            if !lost {
                arrivals.push((stamp + late, stamp));
            }
            if *twice {
                arrivals.push((stamp + late + 30, stamp));
            }
        }
        arrivals.sort();
        let mut reorder = Reorder::new(Span(patience_ms * MS), 16);
        let mut given = Vec::new();
        let end = arrivals.last().map_or(0, |(at, _)| at + 200);
        let mut arrivals_left = arrivals.iter().peekable();
        for now in 0..=end {
            while let Some((_, stamp)) = arrivals_left.next_if(|(at, _)| *at == now) {
                reorder.put(at_ms(*stamp), *stamp);
            }
            while let Some((stamp, message)) = reorder.take_ready(at_ms(now)) {
                prop_assert_eq!(stamp, at_ms(message));
                prop_assert!(now - message >= patience_ms);
                given.push(message);
            }
        }
        prop_assert!(given.windows(2).all(|pair| pair[0] < pair[1]), "{:?}", given);
        let flow = reorder.flow();
        prop_assert_eq!(flow.given as usize, given.len());
        prop_assert_eq!((flow.given + flow.late + flow.repeated + flow.crowded_out) as usize, arrivals.len());
        // Who comes within patience is never dropped.
        for (arrival, stamp) in arrivals.iter().filter(|(arrival, stamp)| arrival - stamp <= patience_ms) {
            prop_assert!(given.contains(stamp) || flow.crowded_out > 0, "{stamp} came at {arrival}");
        }
    }
}

#[test]
fn old_values_are_forgotten_and_other_joints_are_not_mixed() {
    let limits = BufferLimits { keep: Span(100 * MS), longest_gap: Span(50 * MS), farthest_beyond: Span(0) };
    let mut buffer = TimedBuffer::new(limits);
    assert_eq!(buffer.at(at_ms(0)), At::<Pose>::Empty);
    assert_eq!(buffer.insert(at_ms(0), pose_at(0.0)), Inserted::Newest);
    assert_eq!(buffer.insert(at_ms(200), pose_at(0.2)), Inserted::Newest);
    assert_eq!((buffer.len(), buffer.insert(at_ms(50), pose_at(0.05))), (1, Inserted::TooOld));
    assert_eq!(buffer.insert(at_ms(160), pose_at(0.16)), Inserted::Filled);
    assert_eq!(buffer.at(at_ms(201)), At::NotYet { newest: at_ms(200) });
    let names = |name: &str| -> JointNames { Arc::from([Arc::from(name)]) };
    let mut joints = TimedBuffer::new(limits);
    joints.insert(at_ms(0), JointPositions::zeros(&names("pan")));
    joints.insert(at_ms(10), JointPositions::zeros(&names("tilt")));
    assert_eq!(joints.at(at_ms(5)), At::InGap { before: at_ms(0), after: at_ms(10) });
}

#[test]
fn a_full_buffer_drops_the_oldest() {
    let mut reorder = Reorder::new(Span(1000 * MS), 2);
    for stamp in [10, 30, 20] {
        assert_eq!(reorder.put(at_ms(stamp), stamp), Taken::Waits);
    }
    assert_eq!(reorder.put(at_ms(20), 20), Taken::Repeated);
    assert_eq!((reorder.len(), reorder.flow().crowded_out, reorder.find_ready(at_ms(500))), (2, 1, None));
    assert_eq!(reorder.take_ready(at_ms(2000)), Some((at_ms(20), 20)));
    assert_eq!(reorder.put(at_ms(5), 5), Taken::Late { by: Span(15 * MS) });
}
