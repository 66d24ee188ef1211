//! Contract: with a base that lags, the follower arrives from random starts within its tolerances, keeps its limits,
//! never enters cells that the plan avoids, does not swing at the goal, and says when it is blocked or lost.
use super::*;
use crate::nav::sight::tests::room_grid;
use crate::nav::{CostmapConfig, SpeedLimits, find_path};
use rand::{RngExt, SeedableRng};

const DT_S: f64 = 0.01;

/// A base whose velocity follows the command with a lag of 80 ms.
struct LaggingBase {
    pose: Pose2,
    twist: Twist,
}

impl LaggingBase {
    fn step(&mut self, command: Twist) {
        const LAG_S: f64 = 0.08;
        self.twist.forward_m_per_s += (command.forward_m_per_s - self.twist.forward_m_per_s) * DT_S / LAG_S;
        self.twist.turn_rad_per_s += (command.turn_rad_per_s - self.twist.turn_rad_per_s) * DT_S / LAG_S;
        self.pose.yaw_rad = wrap_angle(self.pose.yaw_rad + self.twist.turn_rad_per_s * DT_S);
        let (sin, cos) = self.pose.yaw_rad.sin_cos();
        self.pose.position.x += cos * self.twist.forward_m_per_s * DT_S;
        self.pose.position.y += sin * self.twist.forward_m_per_s * DT_S;
    }
}

fn furnished() -> Costmap {
    let mut grid = room_grid();
    for column in 20..44 {
        for row in 44..56 {
            grid.set([column, row], CellState::Occupied);
            grid.set([column + 80, row - 30], CellState::Occupied);
        }
    }
    Costmap::from_free_space(&grid, &CostmapConfig::default())
}

#[test]
fn arrives_from_random_starts() {
    let costmap = furnished();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let place = |rng: &mut rand_chacha::ChaCha8Rng| {
        loop {
            let point = Point2::new(rng.random_range(0.3..7.7), rng.random_range(0.3..3.7));
            if costmap.is_traversable_at(&point) {
                return point;
            }
        }
    };
    for run in 0..40 {
        let (start, goal) = (place(&mut rng), place(&mut rng));
        let yaw = rng.random_range(-3.1..3.1);
        let mut base = LaggingBase {
            pose: Pose2 { position: start, yaw_rad: rng.random_range(-3.1..3.1) },
            twist: Twist::default(),
        };
        let path = find_path(&costmap, &start, &goal).unwrap().with_goal_yaw(yaw);
        let length = path.length_m;
        let config = FollowerConfig::default();
        let mut follower = Follower::new(config.clone(), path);
        let (mut ticks, mut driven, mut last) = (0, 0.0, Twist::default());
        let mut turns_changed = 0;
        loop {
            let out = follower.tick(&base.pose.to_pose(), base.twist, &costmap, &SpeedLimits::NONE, DT_S);
            let slack = 1.0 + 1e-9;
            assert!(out.twist.forward_m_per_s.abs() <= config.max_speed_m_per_s * slack);
            assert!(out.twist.turn_rad_per_s.abs() <= config.max_turn_rad_per_s * slack);
            let (dv, dw) =
                (out.twist.forward_m_per_s - last.forward_m_per_s, out.twist.turn_rad_per_s - last.turn_rad_per_s);
            assert!(dv.abs() <= config.max_acceleration_m_per_s2 * DT_S * slack);
            assert!(dw.abs() <= config.max_turn_acceleration_rad_per_s2 * DT_S * slack);
            let near = (base.pose.position - goal).norm() < 0.3;
            turns_changed += i32::from(near && out.twist.turn_rad_per_s * last.turn_rad_per_s < 0.0);
            last = out.twist;
            match out.status {
                FollowStatus::Arrived => break,
                FollowStatus::Following { .. } => {}
                other => panic!("run {run}: {other:?} at {:?}", base.pose),
            }
            let before = base.pose.position;
            base.step(out.twist);
            driven += (base.pose.position - before).norm();
            let clearance = costmap.clearance_at_m(&base.pose.position);
            assert!(clearance > 0.25, "run {run}: {clearance} m of clearance at {:?}", base.pose);
            ticks += 1;
            let bound_s = 10.0 + 3.5 * length / 0.6;
            assert!(f64::from(ticks) * DT_S < bound_s, "run {run} takes longer than {bound_s} s for {length} m");
        }
        assert!((base.pose.position - goal).norm() <= config.position_tolerance_m, "run {run}");
        assert!(wrap_angle(base.pose.yaw_rad - yaw).abs() <= config.yaw_tolerance_rad, "run {run}");
        assert!(driven < length + 0.3, "run {run}: drove {driven} of {length}");
        assert!(turns_changed <= 8, "run {run}: swings {turns_changed} times at the goal");
    }
}

#[test]
fn says_when_blocked_or_lost() {
    let start = Point2::new(1.0, 1.0);
    let goal = Point2::new(3.0, 1.0);
    let free = Costmap::from_free_space(&room_grid(), &CostmapConfig::default());
    let mut grid = room_grid();
    for row in 14..28 {
        grid.set([36, row], CellState::Occupied);
    }
    let closed = Costmap::from_free_space(&grid, &CostmapConfig::default());
    let config = FollowerConfig::default();
    let mut base = LaggingBase { pose: Pose2 { position: start, yaw_rad: 0.0 }, twist: Twist::default() };
    let mut follower = Follower::new(config.clone(), Path::from_points(vec![start, goal]));
    let mut blocked_at = None;
    for tick in 0..600 {
        let costmap = if tick < 40 { &free } else { &closed };
        let out = follower.tick(&base.pose.to_pose(), base.twist, costmap, &SpeedLimits::NONE, DT_S);
        if let FollowStatus::Blocked { reason: BlockReason::Obstacle { at } } = out.status {
            blocked_at = Some(at);
        }
        base.step(out.twist);
    }
    assert!((blocked_at.unwrap().x - 1.6).abs() < 0.1);
    assert!(base.pose.position.x < 1.8 - 0.27, "stops before the obstacle, at {:?}", base.pose);
    assert!(base.twist.forward_m_per_s.abs() < 1e-3);
    // Held in place: commanded, but not moving.
    let mut held = Follower::new(config.clone(), Path::from_points(vec![start, goal]));
    let pose = Pose2 { position: start, yaw_rad: 0.0 }.to_pose();
    let stalled = (0..300).any(|_| {
        let out = held.tick(&pose, Twist::default(), &free, &SpeedLimits::NONE, DT_S);
        out.status == FollowStatus::Blocked { reason: BlockReason::Stalled }
    });
    assert!(stalled);
    // Pushed aside.
    let mut lost = Follower::new(config, Path::from_points(vec![start, goal]));
    let aside = Pose2 { position: Point2::new(1.5, 2.0), yaw_rad: 0.0 }.to_pose();
    let out = lost.tick(&aside, Twist::default(), &free, &SpeedLimits::NONE, DT_S);
    assert_eq!(out.status, FollowStatus::OffPath { distance_m: 1.0 });
}

/// A hand beside a wall let the base turn at 0.12 rad/s at most, which was too slow to count as held up: the base pushed
/// until the time was over.
#[test]
fn a_base_that_may_only_move_slowly_is_held_up_too() {
    let (start, goal) = (Point2::new(1.0, 1.0), Point2::new(1.0, 3.0));
    let free = Costmap::from_free_space(&room_grid(), &CostmapConfig::default());
    let pose = Pose2 { position: start, yaw_rad: 0.0 }.to_pose();
    let mut held = Follower::new(FollowerConfig::default(), Path::from_points(vec![start, goal]));
    let stalled = (0..300).any(|_| {
        let out = held.tick(&pose, Twist::default(), &free, &SpeedLimits::NONE, DT_S);
        let share = (0.12 / out.twist.turn_rad_per_s.abs().max(1e-9)).min(1.0);
        held.note_sent(Twist {
            forward_m_per_s: share * out.twist.forward_m_per_s,
            turn_rad_per_s: share * out.twist.turn_rad_per_s,
        });
        out.status == FollowStatus::Blocked { reason: BlockReason::Stalled }
    });
    assert!(stalled);
}
