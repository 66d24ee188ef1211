//! Pulling on what the hand holds while the base backs off: the hand follows a way that stands on the floor, and gives way
//! across it.

use crate::agent::{Agent, Halt};
use dsm::Pose;
use dsm::map::CellState;
use dsm::time::Span;
use dsm_robot::control::{Controller, ControllerConfig, ToolGoal};
use dsm_robot::drivers::Twist;
use dsm_robot::model::LinkId;
use nalgebra::{Point3, Vector3};

/// Speed of a pull, metres per second: slow enough that the weight of a full drawer is nothing to speed up.
pub(super) const PULL_M_PER_S: f64 = 0.06;
/// The hand lags behind its way by less while something gives way, metres.
const LAG_M: f64 = 0.015;
/// How fast a hand gives way to what leads it aside, 1/s: a hand that slips aside does not hold along its way either.
const LEAK_PER_S: f64 = 6.0;
/// Narrower than this the fingers hold nothing, metres.
pub(super) const NOTHING_M: f64 = 0.006;
/// Floor that must be left behind the base, metres: half of a cell, and braking from a creep.
const GAP_M: f64 = 0.03;

/// How a pull ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pulled {
    /// As far as it was to go, metres.
    AllTheWay(f64),
    /// Something holds it after so many metres.
    Held(f64),
    /// The hand slipped off after so many metres.
    Slipped(f64),
    /// The base has no more floor behind it after so many metres.
    NoFloor(f64),
}

impl Pulled {
    /// How far the hand came while it held, metres.
    pub(super) fn way_m(self) -> f64 {
        match self {
            Self::AllTheWay(way_m) | Self::Held(way_m) | Self::Slipped(way_m) | Self::NoFloor(way_m) => way_m,
        }
    }
}

/// Pulls straight along `axis` (base frame of this moment, level), with the base behind it: the base faces against the axis
/// more or less. `touching` may touch things.
pub(super) fn pull(agent: &mut Agent, axis: &Vector3<f64>, way_m: f64, touching: &[LinkId]) -> Result<Pulled, Halt> {
    let model = agent.model().clone();
    let config = ControllerConfig { max_tool_speed_m_per_s: 2.0 * PULL_M_PER_S, ..model.settings.control.clone() };
    let mut controller = Controller::new(&model, config);
    controller.set_touching(touching);
    let configuration = agent.configuration()?;
    controller.set_posture(&agent.arm_state()?.positions);
    let odom_from_start = agent.odom_from_base()?;
    let odom_from_tool = odom_from_start * model.kinematics.root_from_link(&configuration, model.tool);
    let axis_in_odom = odom_from_start.rotation * axis;
    let dt_s = agent.period().as_s();
    let begin = agent.now();
    let longest_s = 3.0 * way_m / PULL_M_PER_S + 3.0;
    let (mut reference_m, mut speed, mut lagging_s) = (0.0_f64, 0.0_f64, 0.0_f64);
    let across = Vector3::z().cross(&axis_in_odom);
    let (mut aside_lag_m, mut last_aside_m) = (0.0, None::<f64>);
    let mut done = None;
    agent.take_touch();
    while (agent.now() - begin).as_s() < longest_s {
        let odom_from_base = agent.odom_from_base()?;
        let configuration = agent.configuration()?;
        let tool = odom_from_base * model.kinematics.root_from_link(&configuration, model.tool);
        let gone_m = (tool.translation.vector - odom_from_tool.translation.vector).dot(&axis_in_odom);
        let base_m = (odom_from_base.translation.vector - odom_from_start.translation.vector).dot(&axis_in_odom);
        if agent.grip_state()?.width_m < NOTHING_M {
            done = Some(Pulled::Slipped(gone_m));
            break;
        }
        if gone_m >= way_m {
            done = Some(Pulled::AllTheWay(gone_m));
            break;
        }
        lagging_s = if reference_m - gone_m > LAG_M { lagging_s + dt_s } else { 0.0 };
        if lagging_s > 0.4 {
            done = Some(Pulled::Held(gone_m));
            break;
        }
        if !is_floor_behind(agent)? {
            done = Some(Pulled::NoFloor(gone_m));
            break;
        }
        // A way that waits for the hand, begins and ends gently.
        let braking = (2.0 * 0.1 * (way_m + 0.01 - reference_m).max(0.0)).sqrt();
        let wanted = if reference_m - gone_m > LAG_M { 0.0 } else { PULL_M_PER_S.min(braking) };
        speed += (wanted - speed).clamp(-0.3 * dt_s, 0.1 * dt_s);
        reference_m += speed * dt_s;
        // The base keeps its distance from the hand.
        let back = (speed + 2.0 * (reference_m - base_m)).clamp(0.0, 2.0 * PULL_M_PER_S);
        // Along the way as told; across it the drawer leads, and what the motors wound up against it is let down.
        let aside_m = (tool.translation.vector - odom_from_tool.translation.vector).dot(&across);
        let wanted_aside = -LEAK_PER_S * aside_lag_m;
        if let Some(before_m) = last_aside_m.replace(aside_m) {
            aside_lag_m += wanted_aside * dt_s - (aside_m - before_m);
        }
        let at = odom_from_tool.translation.vector + axis_in_odom * reference_m + across * aside_m;
        let goal = odom_from_base.inverse() * Pose::from_parts(at.into(), odom_from_tool.rotation);
        let now = agent.base_velocity()?;
        let velocity = axis_in_odom * speed + across * wanted_aside;
        let along = odom_from_base.rotation.inverse() * velocity;
        let goal = seen_from_base(&goal, (along, 0.0), now);
        let state = agent.arm_state()?;
        controller.set_other_joints(configuration.positions());
        let base = Twist { forward_m_per_s: -back, turn_rad_per_s: 0.0 };
        let output = controller.tick(&state, &goal, &[], dt_s);
        agent.tick(base, &output.velocities)?;
    }
    agent.rest(Span::from_s(0.3))?;
    agent.take_touch();
    let way = |agent: &mut Agent| -> Result<f64, Halt> {
        let tool = agent.odom_from_base()? * model.kinematics.root_from_link(&agent.configuration()?, model.tool);
        Ok((tool.translation.vector - odom_from_tool.translation.vector).dot(&axis_in_odom))
    };
    Ok(match done {
        Some(done) => done,
        None => Pulled::Held(way(agent)?),
    })
}

/// A goal (frame of the base) that moves against the floor with a linear velocity and turns at a rate about the vertical, for
/// an arm whose base moves beneath it: the arm does what the base does not.
pub(super) fn seen_from_base(goal: &Pose, (linear, turn): (Vector3<f64>, f64), base: Twist) -> ToolGoal {
    let at = goal.translation.vector;
    let carried = Vector3::new(base.forward_m_per_s - base.turn_rad_per_s * at.y, base.turn_rad_per_s * at.x, 0.0);
    ToolGoal {
        base_from_tool: *goal,
        linear_m_per_s: linear - carried,
        angular_rad_per_s: Vector3::z() * (turn - base.turn_rad_per_s),
    }
}

/// Whether nothing that the map shows stands behind the base; it came that way, so that what is unknown there is floor.
pub(super) fn is_floor_behind(agent: &mut Agent) -> Result<bool, Halt> {
    let world_from_base = agent.world_from_base()?;
    let reach_m = agent.model().settings.base.footprint_radius_m + GAP_M;
    let map = agent.map();
    Ok((-5..=5).all(|i| {
        let angle_rad = f64::from(i) * 0.18;
        let behind = world_from_base * Point3::new(-reach_m * angle_rad.cos(), reach_m * angle_rad.sin(), 0.0);
        map.free_space.state_at(&behind.xy()) != CellState::Occupied
    }))
}

/// Turns on the spot by an angle, radians, positive to the left.
pub(super) fn turn(agent: &mut Agent, angle_rad: f64) -> Result<(), Halt> {
    const SPEED: f64 = 0.3;
    let still = dsm_robot::joints::JointVelocities::zeros(&agent.model().arm.joints);
    let start = agent.odom_from_base()?;
    let begin = agent.now();
    agent.take_touch();
    while (agent.now() - begin).as_s() < 4.0 * angle_rad.abs() / SPEED + 3.0 {
        let turned = start.rotation.inverse() * agent.odom_from_base()?.rotation;
        let left = angle_rad - turned.euler_angles().2;
        if left.abs() < 0.004 || agent.take_touch() {
            break;
        }
        let rate = (2.0 * left).clamp(-SPEED, SPEED);
        agent.tick(Twist { forward_m_per_s: 0.0, turn_rad_per_s: rate }, &still)?;
    }
    agent.rest(Span::from_s(0.3))
}

/// Drives straight: forwards a short way that the caller has seen to be free, or (with a negative way) backwards, where it looks
/// at nothing, as far as the map shows nothing. Ends early when something is touched; how far it went, metres.
pub(super) fn creep(agent: &mut Agent, way_m: f64, speed_m_per_s: f64) -> Result<f64, Halt> {
    let still = dsm_robot::joints::JointVelocities::zeros(&agent.model().arm.joints);
    let start = agent.odom_from_base()?;
    let begin = agent.now();
    agent.take_touch();
    let gone =
        |agent: &mut Agent| -> Result<f64, Halt> { Ok((start.inverse() * agent.odom_from_base()?).translation.x) };
    // Beside things the arm slows the base.
    while (agent.now() - begin).as_s() < 4.0 * way_m.abs() / speed_m_per_s + 3.0 {
        let left_m = way_m - gone(agent)?;
        let free = way_m > 0.0 || is_floor_behind(agent)?;
        if left_m * way_m.signum() < 0.003 || !free || agent.take_touch() {
            break;
        }
        let speed = speed_m_per_s.min((2.0 * 0.2 * left_m.abs()).sqrt()).max(0.015);
        agent.tick(Twist { forward_m_per_s: speed * left_m.signum(), turn_rad_per_s: 0.0 }, &still)?;
    }
    agent.rest(Span::from_s(0.3))?;
    gone(agent)
}
