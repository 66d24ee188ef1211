//! Swinging a door by its handle: the hand follows an arc about the hinge and gives way across it, the base keeps its place
//! behind the hand.
//!
//! ```text
//! v = v_t t + (k e - l lag) n,   lag += (v - v_measured) . n dt
//! ```
//!
//! Motors that follow velocities hold a hand to its way with all they have, and a door leaves no choice of the way. What the
//! hand lags behind what it was told across the arc (n) is the spring that the motors wound up; letting it down by l keeps
//! the force at a few newtons though the hinge is only known to a centimetre or two.

use super::pull::{NOTHING_M, Pulled, is_floor_behind, seen_from_base};
use crate::agent::{Agent, Halt};
use dsm::Pose;
use dsm::time::{Span, Stamp};
use dsm_robot::control::{Controller, ControllerConfig};
use dsm_robot::drivers::{JointState, Twist};
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::{Configuration, LinkId, RobotModel};
use nalgebra::{Point2, UnitQuaternion, Vector2, Vector3};

/// Speed of the hand on the arc, metres per second: no faster than it may move next to things.
const SWING_M_PER_S: f64 = 0.06;
/// The hand lags behind its way by less while the door gives way, metres: motors wind up by about 10 N for a millimetre.
const SWING_LAG_M: f64 = 0.005;
/// How fast it gains that speed, metres per second squared.
const GAIN_M_PER_S2: f64 = 0.1;
/// Share of the door's turning by which the base turns with it: the arm turns the rest.
const TURN_SHARE: f64 = 0.3;
/// How fast the hand comes back to the arc, and how fast it lets go of what holds it off, 1/s.
const TO_ARC_PER_S: f64 = 1.0;
const LEAK_PER_S: f64 = 6.0;
/// How fast the base comes to its place behind the hand, 1/s.
const BASE_GAIN_PER_S: f64 = 2.0;
/// Bounds of the base's speed while it follows a hand.
const BASE_M_PER_S: f64 = 0.2;
const BASE_RAD_PER_S: f64 = 0.5;

/// The vertical hinge of a door that the hand holds: positive turns are to the left, seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hinge {
    /// Where it stands, in the frame of the base at the beginning.
    pub at: Point2<f64>,
    /// Along the closed door, from its handle to the hinge.
    pub along: Vector2<f64>,
    /// 1 when the door opens to the left, else -1.
    pub sense: f64,
}

impl Hinge {
    /// Moves the hinge along the closed door to where it must be for the hand to have come from `from` to `at`: the way of the
    /// hand shows it better than what the door looks like.
    fn learn(&mut self, from: &Vector2<f64>, at: &Vector2<f64>) {
        /// The hand must have come so far towards the hinge that a millimetre does not matter, metres.
        const SEEN_M: f64 = 0.012;
        /// Share that is believed at once, and the farthest that looks may deceive, metres.
        const SHARE: f64 = 0.05;
        const FARTHEST_M: f64 = 0.25;
        let way = at - from;
        let towards = way.dot(&self.along);
        if towards > SEEN_M {
            // As far from both: (at - from) . ((at + from) / 2 - hinge) = 0.
            let off_m = way.dot(&((at + from) * 0.5 - self.at.coords)) / towards;
            self.at += self.along * (SHARE * off_m.clamp(-FARTHEST_M, FARTHEST_M));
        }
    }
}

/// The hand on an arc that has turned by `angle_rad` (positive opens), from where it was at the beginning.
fn on_arc(start: &Pose, hinge: &Hinge, angle_rad: f64) -> Pose {
    let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), hinge.sense * angle_rad);
    let center = Vector3::new(hinge.at.x, hinge.at.y, 0.0);
    let arm = start.translation.vector - center;
    Pose::from_parts((center + turned * arm).into(), turned * start.rotation)
}

/// The base's velocity that keeps it behind a hand which is now at `base_from_tool`: `ahead_m` before it, and turned with the
/// door by its share. `turned_rad` is how far the base has turned in the door's sense, at the door's `angle_rad`.
fn follow(base_from_tool: &Pose, ahead_m: f64, (angle_rad, turned_rad): (f64, f64), sense: f64) -> Twist {
    let forward = BASE_GAIN_PER_S * (base_from_tool.translation.x - ahead_m);
    let turn = sense * BASE_GAIN_PER_S * (TURN_SHARE * angle_rad - turned_rad);
    Twist {
        forward_m_per_s: forward.clamp(-BASE_M_PER_S, BASE_M_PER_S),
        turn_rad_per_s: turn.clamp(-BASE_RAD_PER_S, BASE_RAD_PER_S),
    }
}

/// The controller of a swing that begins with these joints.
fn controller_of(model: &RobotModel, joints: &JointPositions, touching: &[LinkId]) -> Controller {
    let config = ControllerConfig { max_tool_speed_m_per_s: 2.0 * SWING_M_PER_S, ..model.settings.control.clone() };
    let mut controller = Controller::new(model, config);
    controller.set_posture(joints);
    controller.set_touching(touching);
    controller
}

/// How far a door can be swung by this hand from this stand before the arm ends, radians: the motion as it will be, by a robot
/// that does exactly what it is told.
pub(super) fn rehearse(
    model: &RobotModel,
    folded: &Configuration,
    base_from_grip: &Pose,
    joints: &JointPositions,
    hinge: &Hinge,
    wanted_rad: f64,
) -> f64 {
    const DT_S: f64 = 0.02;
    /// An arm that falls behind by more has come to its end.
    const BEHIND: (f64, f64) = (0.015, 0.2);
    let radius_m = (base_from_grip.translation.vector.xy() - hinge.at.coords).norm().max(0.05);
    let mut controller = controller_of(model, joints, &[]);
    let mut configuration = folded.clone();
    configuration.apply(joints);
    let names = &model.arm.joints;
    let mut velocities = JointVelocities::zeros(names);
    let (mut base, mut twist, mut turned_rad, mut angle_rad) = (Pose::identity(), Twist::default(), 0.0, 0.0);
    let mut speed = 0.0_f64;
    while angle_rad < wanted_rad {
        let goal = base.inverse() * on_arc(base_from_grip, hinge, angle_rad);
        let tool = model.kinematics.root_from_link(&configuration, model.tool);
        let behind_m = (goal.translation.vector - tool.translation.vector).norm();
        if behind_m > BEHIND.0 || goal.rotation.angle_to(&tool.rotation) > BEHIND.1 {
            return angle_rad;
        }
        let arm = model.arm.values_of(&configuration);
        let Some(positions) = JointPositions::from_values(names, arm.clone()) else { return angle_rad };
        let state = JointState { stamp: Stamp::default(), positions, velocities: velocities.clone() };
        let out = (on_arc(base_from_grip, hinge, angle_rad).translation.vector.xy() - hinge.at.coords).normalize();
        let tangent = Vector3::new(-out.y, out.x, 0.0) * hinge.sense;
        speed = (speed + GAIN_M_PER_S2 * DT_S).min(SWING_M_PER_S);
        let rate = speed / radius_m;
        let along = base.rotation.inverse() * tangent * speed;
        let goal = seen_from_base(&goal, (along, hinge.sense * rate), twist);
        let output = controller.tick(&state, &goal, &[], DT_S);
        twist = follow(&tool, base_from_grip.translation.x, (angle_rad, turned_rad), hinge.sense);
        turned_rad += hinge.sense * twist.turn_rad_per_s * DT_S;
        base *= Pose::new(Vector3::x() * (twist.forward_m_per_s * DT_S), Vector3::z() * (twist.turn_rad_per_s * DT_S));
        let moved: Vec<f64> = arm.iter().zip(output.velocities.values()).map(|(at, v)| at + v * DT_S).collect();
        configuration.apply_group(&model.arm, &moved);
        velocities = output.velocities;
        angle_rad += rate * DT_S;
    }
    angle_rad
}

/// Swings the door that the hand holds by an angle; the way in the answer is that of the hand, metres. The door's angle comes
/// with it, radians.
pub(super) fn swing(
    agent: &mut Agent,
    hinge: &Hinge,
    wanted_rad: f64,
    touching: &[LinkId],
) -> Result<(Pulled, f64), Halt> {
    let model = agent.model().clone();
    let mut controller = controller_of(&model, &agent.arm_state()?.positions, touching);
    let odom_from_start = agent.odom_from_base()?;
    // All in the frame of the base at the beginning.
    let pose_of = |agent: &mut Agent| -> Result<(Pose, Pose), Halt> {
        let start_from_base = odom_from_start.inverse() * agent.odom_from_base()?;
        let base_from_tool = model.kinematics.root_from_link(&agent.configuration()?, model.tool);
        Ok((start_from_base, base_from_tool))
    };
    let start_from_grip = pose_of(agent)?.1;
    let mut hinge = *hinge;
    let from = start_from_grip.translation.vector.xy();
    let mut radius_m = (from - hinge.at.coords).norm();
    let dt_s = agent.period().as_s();
    let begin = agent.now();
    let longest_s = 3.0 * wanted_rad * radius_m / SWING_M_PER_S + 4.0;
    let (mut speed, mut told_m, mut across_lag_m, mut lagging_s) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut last: Option<Vector2<f64>> = None;
    let mut angle_rad = 0.0;
    let mut done = None;
    let mut ended = String::new();
    agent.take_touch();
    while (agent.now() - begin).as_s() < longest_s {
        let (start_from_base, base_from_tool) = pose_of(agent)?;
        let tool = start_from_base * base_from_tool;
        let ahead_m = told_m - angle_rad * radius_m;
        hinge.learn(&from, &tool.translation.vector.xy());
        let (arm0, arm) = (from - hinge.at.coords, tool.translation.vector.xy() - hinge.at.coords);
        radius_m = arm0.norm();
        told_m = ahead_m + angle_rad * radius_m;
        angle_rad = hinge.sense * (arm0.x * arm.y - arm0.y * arm.x).atan2(arm0.dot(&arm));
        let gone_m = angle_rad * radius_m;
        let out = arm.normalize();
        let tangent = Vector2::new(-out.y, out.x) * hinge.sense;
        if agent.grip_state()?.width_m < NOTHING_M {
            done = Some(Pulled::Slipped(gone_m));
            break;
        }
        if angle_rad >= wanted_rad {
            done = Some(Pulled::AllTheWay(gone_m));
            break;
        }
        lagging_s = if told_m - gone_m > SWING_LAG_M { lagging_s + dt_s } else { 0.0 };
        if lagging_s > 0.5 {
            done = Some(Pulled::Held(gone_m));
            break;
        }
        if !is_floor_behind(agent)? {
            done = Some(Pulled::NoFloor(gone_m));
            break;
        }
        let wanted = if told_m - gone_m > SWING_LAG_M { 0.0 } else { SWING_M_PER_S };
        speed += (wanted - speed).clamp(-3.0 * GAIN_M_PER_S2 * dt_s, GAIN_M_PER_S2 * dt_s);
        told_m = (told_m + speed * dt_s).max(gone_m - SWING_LAG_M);
        // Along the arc as told, across it as the door wants.
        let along = speed + TO_ARC_PER_S * (told_m - gone_m).clamp(-SWING_LAG_M, SWING_LAG_M);
        let across = TO_ARC_PER_S * (radius_m - arm.norm()) - LEAK_PER_S * across_lag_m;
        let velocity = tangent * along + out * across;
        let at = tool.translation.vector.xy();
        if let Some(last) = last {
            let measured = (at - last) / dt_s;
            across_lag_m += (velocity - measured).dot(&out) * dt_s;
        }
        last = Some(at);
        let arc = on_arc(&start_from_grip, &hinge, angle_rad);
        // The height and the turning are as on the arc; the place is where the hand is.
        let place = Vector3::new(at.x, at.y, start_from_grip.translation.z);
        let into_base = start_from_base.inverse();
        let goal = into_base * Pose::from_parts(place.into(), arc.rotation);
        let linear = into_base.rotation * Vector3::new(velocity.x, velocity.y, 0.0);
        let now = agent.base_velocity()?;
        let goal = seen_from_base(&goal, (linear, hinge.sense * along / radius_m), now);
        let turned_rad = hinge.sense * start_from_base.rotation.euler_angles().2;
        let base = follow(&base_from_tool, start_from_grip.translation.x, (angle_rad, turned_rad), hinge.sense);
        let state = agent.arm_state()?;
        controller.set_other_joints(agent.configuration()?.positions());
        let output = controller.tick(&state, &goal, &[], dt_s);
        ended =
            format!("{:?}, {} active, turned off by {:.2} rad", output.status, output.active_rows, output.error_rad);
        agent.tick(base, &output.velocities)?;
    }
    agent.log(format!(
        "swung by {angle_rad:.2} rad of {wanted_rad:.2}, radius {radius_m:.2} m, told {:.0} mm ahead, across lag {:.1} mm, {ended}",
        1e3 * (told_m - angle_rad * radius_m),
        1e3 * across_lag_m
    ));
    agent.rest(Span::from_s(0.3))?;
    agent.take_touch();
    Ok((done.unwrap_or(Pulled::Held(angle_rad * radius_m)), angle_rad))
}

#[cfg(test)]
mod tests {
    //! Contract: the hand stays on its arc and opens towards the robot; from a stand well towards the hinge a cupboard's door
    //! can be swung by more than 60 degrees, from one on the far side it cannot.
    use super::*;
    use dsm_robot::control::{IkRequest, find_ik};
    use std::path::Path;

    #[test]
    fn a_door_can_be_swung_from_a_stand_towards_its_hinge() {
        let model = RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter")).unwrap();
        let mut folded = model.kinematics.zero();
        folded.apply(&model.find_posture("carry").unwrap());
        let down = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let seeds = [model.find_posture("ready_front").unwrap()];
        let swung_rad = |sense: f64, z: f64, towards_m: f64| {
            // The hinge of a door that opens to the left is to the right of its handle.
            let y = towards_m * sense;
            let hinge = Hinge { at: Point2::new(0.66, y - 0.4 * sense), along: Vector2::new(0.0, -sense), sense };
            let grip = Pose::from_parts(Vector3::new(0.62, y, z).into(), down);
            let arc = on_arc(&grip, &hinge, 0.5);
            let radius = |pose: &Pose| (pose.translation.vector.xy() - hinge.at.coords).norm();
            assert!((radius(&arc) - radius(&grip)).abs() < 1e-9);
            assert!(arc.translation.x < grip.translation.x, "it opens towards the robot");
            let request = IkRequest { seeds: &seeds, restarts: 6, ..IkRequest::new(&folded) };
            let joints = find_ik(&model, &grip, &request).expect("in reach");
            rehearse(&model, &folded, &grip, &joints, &hinge, 1.15)
        };
        for (sense, z) in [(1.0, 0.4), (-1.0, 0.4), (1.0, 0.9), (-1.0, 0.9)] {
            assert!(swung_rad(sense, z, 0.3) > 1.1, "{sense} {z}: {}", swung_rad(sense, z, 0.3));
            assert!(swung_rad(sense, z, -0.3) < 1.0);
        }
    }

    #[test]
    fn the_way_of_the_hand_shows_the_hinge() {
        // A handle 0.42 m from its hinge, which is taken to be 0.1 m farther.
        let (from, real) = (Vector2::new(0.62, 0.0), Point2::new(0.66, 0.42));
        let mut hinge = Hinge { at: Point2::new(0.66, 0.52), along: Vector2::y(), sense: -1.0 };
        let real_from = Pose::translation(from.x, from.y, 0.0);
        for step in 0..100 {
            let at = on_arc(&real_from, &Hinge { at: real, ..hinge }, 0.008 * f64::from(step));
            hinge.learn(&from, &at.translation.vector.xy());
        }
        assert!((hinge.at - real).norm() < 0.01, "{}", hinge.at);
    }
}
