//! Looks of the head: around, towards a place, through a passage.

use crate::agent::{Agent, Gaze, Halt};
use dsm::time::Span;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::RobotModel;
use dsm_robot::nav::Pose2;
use nalgebra::{Point2, Point3};
use std::f64::consts::PI;

/// Tilt of the head for looking into a room, radians.
const ROOM_TILT_RAD: f64 = 0.42;
/// Tilt of the head for looking at the floor around the base, radians.
const FLOOR_TILT_RAD: f64 = 0.95;

/// Turns the head towards a place and a little to both sides of it; the base turns only as far as the head cannot.
pub(super) fn look_towards(agent: &mut Agent, place: &Point2<f64>) -> Result<(), Halt> {
    const SIDE_RAD: f64 = 0.5;
    let base = Pose2::from_pose(&agent.world_from_base()?);
    let bearing = (place - base.position).y.atan2((place - base.position).x);
    let mut pan_rad = (bearing - base.yaw_rad).sin().atan2((bearing - base.yaw_rad).cos());
    if pan_rad.abs() > sight_rad(agent.model()) {
        turn_base(agent, pan_rad)?;
        pan_rad = 0.0;
    }
    pan_to(agent, pan_rad - SIDE_RAD, ROOM_TILT_RAD)?;
    pan_to(agent, pan_rad + SIDE_RAD, ROOM_TILT_RAD)
}

/// Looks through a passage to both sides, then level: what stood in it up to its full height is gone only once every height
/// was looked through, and a view into the room passes below the upper half.
pub(super) fn look_through(agent: &mut Agent, place: &Point2<f64>) -> Result<(), Halt> {
    const HEIGHTS_M: [f64; 3] = [1.35, 0.9, 0.3];
    const LOOK_S: f64 = 1.5;
    look_towards(agent, place)?;
    for height_m in HEIGHTS_M {
        agent.gaze = Gaze::Point(Point3::new(place.x, place.y, height_m));
        agent.rest(Span::from_s(LOOK_S))?;
    }
    Ok(())
}

/// Pans the head to one side into the room, and back over the other side looking at the floor around the base. What lies
/// behind a head that cannot pan so far is looked at from the other side of the base.
pub fn look_around(agent: &mut Agent, half_rad: f64) -> Result<(), Halt> {
    agent.await_light()?;
    let turns = half_rad > sight_rad(agent.model());
    for half_turn in 0..=u32::from(turns) {
        if half_turn > 0 {
            turn_base(agent, PI)?;
        }
        pan_to(agent, half_rad, ROOM_TILT_RAD)?;
        pan_to(agent, -half_rad, ROOM_TILT_RAD)?;
        pan_to(agent, half_rad, FLOOR_TILT_RAD)?;
    }
    Ok(())
}

/// How far from ahead the camera of the head sees to both sides, radians.
fn sight_rad(model: &RobotModel) -> f64 {
    let pan_rad = model.head.limits.first().map_or(PI, |limits| limits.upper.min(-limits.lower));
    let half_view = model.find_camera("head").map_or(0.0, |(camera, _)| {
        let wide = f64::from(camera.width) / f64::from(camera.height);
        ((0.5 * camera.vertical_fov_rad).tan() * wide).atan()
    });
    pan_rad + half_view
}

/// Turns the base where it stands; with the arm folded its footprint is round.
fn turn_base(agent: &mut Agent, angle_rad: f64) -> Result<(), Halt> {
    const RATE_RAD_PER_S: f64 = 0.8;
    const GAIN_PER_S: f64 = 2.0;
    const REACHED_RAD: f64 = 0.05;
    let still = JointVelocities::zeros(&agent.model().arm.joints);
    let end = agent.now() + Span::from_s(2.0 * angle_rad.abs() / RATE_RAD_PER_S + 1.0);
    let mut yaw_rad = Pose2::from_pose(&agent.world_from_base()?).yaw_rad;
    let mut left_rad = angle_rad;
    while left_rad.abs() > REACHED_RAD && agent.now() < end {
        let turn_rad_per_s = (GAIN_PER_S * left_rad).clamp(-RATE_RAD_PER_S, RATE_RAD_PER_S);
        agent.tick(Twist { forward_m_per_s: 0.0, turn_rad_per_s }, &still)?;
        let now_rad = Pose2::from_pose(&agent.world_from_base()?).yaw_rad;
        left_rad -= (now_rad - yaw_rad).sin().atan2((now_rad - yaw_rad).cos());
        yaw_rad = now_rad;
    }
    Ok(())
}

/// Pans the head at a rate that leaves no gaps between frames.
fn pan_to(agent: &mut Agent, goal_rad: f64, tilt_rad: f64) -> Result<(), Halt> {
    const RATE_RAD_PER_S: f64 = 1.8;
    let limits = agent.model().head.limits.first().map_or((-3.0, 3.0), |l| (l.lower, l.upper));
    let from = agent.pan_rad()?;
    let to = goal_rad.clamp(limits.0, limits.1);
    let period_s = agent.period().as_s();
    let ticks = ((to - from).abs() / RATE_RAD_PER_S / period_s).ceil().max(1.0) as usize;
    for i in 1..=ticks {
        agent.gaze = Gaze::Angles { pan_rad: from + (to - from) * i as f64 / ticks as f64, tilt_rad };
        agent.rest(Span::from_s(period_s))?;
    }
    Ok(())
}
