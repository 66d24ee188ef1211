//! Pushing with a closed hand while the base follows it: straight along a way that stands on the floor, until something holds
//! it up.
//!
//! ```text
//! lag = told - gone;     usual += (lag - usual) dt / T;     the end: lag - usual > bound
//! ```
//!
//! Base and arm that are held up press by 50 to 120 N for each millimetre that they lag behind (a door at its end: 87 to 253 N
//! in 0.25 s at 25 mm/s; a drawer: 115 N at 1.4 mm), so the bound is a quarter of a millimetre above what friction costs, and
//! all of the way is gone slowly.

use super::pull::seen_from_base;
use crate::agent::{Agent, Halt};
use dsm::Pose;
use dsm::map::ObjectId;
use dsm::time::Span;
use dsm_robot::control::{Controller, ControllerConfig};
use dsm_robot::drivers::Twist;
use dsm_robot::model::LinkId;
use nalgebra::Vector3;

/// Speed of a push, metres per second.
const PUSH_M_PER_S: f64 = 0.02;
/// Speed where the end is near, and how near that is, metres: what is pushed stops there at once.
const LAST_M_PER_S: f64 = 0.006;
const NEAR_END_M: f64 = 0.1;
/// The hand lags behind its way by no more than this above what is usual, metres: where it meets what it pushes and that
/// breaks loose, which takes so much way, and after that.
const MEETS_LAG_M: f64 = 0.0013;
const MEETS_M: f64 = 0.04;
const LAG_M: f64 = 0.00025;
/// What is usual is learned within so long, seconds.
const USUAL_S: f64 = 0.4;
/// Speed at which it is let down again, metres per second.
const BACK_M_PER_S: f64 = 0.05;
/// How fast it gains and loses speed, metres per second squared.
const GAIN_M_PER_S2: f64 = 0.1;
/// The map follows what goes along in steps of this, metres.
const CARRY_M: f64 = 0.02;
/// Back from what holds it up, metres: what the motors wound up is let down.
const LET_DOWN_M: f64 = 0.012;

/// How a push ended, and how far the hand came, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pushed {
    /// As far as it was to go at most: nothing held it up.
    AllTheWay(f64),
    /// Something holds it up.
    HeldUp(f64),
}

impl Pushed {
    /// How far the hand came, metres.
    pub(super) fn way_m(self) -> f64 {
        match self {
            Self::AllTheWay(way_m) | Self::HeldUp(way_m) => way_m,
        }
    }
}

/// What is pushed, and how far.
pub(super) struct Push<'a> {
    /// The hand meets it after so much, metres.
    pub before_m: f64,
    /// It is expected to end so far from where the hand begins, metres ...
    pub expected_m: f64,
    /// ... and the hand goes no farther than this, metres.
    pub most_m: f64,
    /// Things of the map that go with it.
    pub load: &'a [ObjectId],
}

/// Pushes ahead of the base, straight on. `touching` may touch things.
pub(super) fn push(agent: &mut Agent, task: &Push<'_>, touching: &[LinkId]) -> Result<Pushed, Halt> {
    let &Push { expected_m, most_m, .. } = task;
    let model = agent.model().clone();
    let config = ControllerConfig { max_tool_speed_m_per_s: 2.0 * BACK_M_PER_S, ..model.settings.control.clone() };
    let mut controller = Controller::new(&model, config);
    controller.set_touching(touching);
    controller.set_posture(&agent.arm_state()?.positions);
    let odom_from_start = agent.odom_from_base()?;
    let odom_from_tool = odom_from_start * model.kinematics.root_from_link(&agent.configuration()?, model.tool);
    let ahead = odom_from_start.rotation * Vector3::x();
    let dt_s = agent.period().as_s();
    let begin = agent.now();
    let longest_s = 1.5 * most_m / LAST_M_PER_S + 3.0;
    let (mut told_m, mut speed, mut usual_m, mut most_lag_m) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let (mut pushed, mut carried_m) = (None, task.before_m);
    let way_in_world = agent.world_from_base()?.rotation * Vector3::x();
    let gone_of = |agent: &mut Agent| -> Result<f64, Halt> {
        let tool = agent.odom_from_base()? * model.kinematics.root_from_link(&agent.configuration()?, model.tool);
        Ok((tool.translation.vector - odom_from_tool.translation.vector).dot(&ahead))
    };
    agent.take_touch();
    while (agent.now() - begin).as_s() < longest_s {
        let gone_m = gone_of(agent)?;
        if gone_m >= most_m {
            pushed = Some(Pushed::AllTheWay(gone_m));
            break;
        }
        if gone_m - carried_m > CARRY_M {
            let by = way_in_world * (gone_m - carried_m);
            agent.moved.extend(task.load.iter().map(|id| (*id, by)));
            carried_m = gone_m;
        }
        let lag_m = told_m - gone_m;
        most_lag_m = most_lag_m.max(lag_m);
        let is_near_end = gone_m > expected_m - NEAR_END_M;
        let wanted = if is_near_end { LAST_M_PER_S } else { PUSH_M_PER_S };
        let bound_m = if gone_m < task.before_m + MEETS_M { MEETS_LAG_M } else { LAG_M };
        // Speeding up and slowing down lag by themselves.
        let is_steady = (speed - wanted).abs() < 0.2 * wanted;
        if is_steady && lag_m - usual_m > bound_m {
            pushed = Some(Pushed::HeldUp(gone_m));
            break;
        }
        usual_m += (lag_m - usual_m) * dt_s / USUAL_S;
        speed += (wanted - speed).clamp(-3.0 * GAIN_M_PER_S2 * dt_s, GAIN_M_PER_S2 * dt_s);
        told_m += speed * dt_s;
        step(agent, &mut controller, (&odom_from_start, &odom_from_tool), (told_m, speed))?;
    }
    // What the motors wound up is let down at once.
    let end_m = gone_of(agent)?;
    let mut back_m = told_m;
    while back_m > end_m - LET_DOWN_M {
        back_m -= BACK_M_PER_S * dt_s;
        step(agent, &mut controller, (&odom_from_start, &odom_from_tool), (back_m, -BACK_M_PER_S))?;
    }
    agent.log(format!("pushed by {end_m:.3} m of {expected_m:.3}, at most {:.1} mm behind", 1e3 * most_lag_m));
    agent.rest(Span::from_s(0.2))?;
    agent.take_touch();
    Ok(pushed.unwrap_or(Pushed::HeldUp(end_m)))
}

/// One tick with the hand and the base so far on their way, at a speed.
fn step(
    agent: &mut Agent,
    controller: &mut Controller,
    (odom_from_start, odom_from_tool): (&Pose, &Pose),
    (told_m, speed): (f64, f64),
) -> Result<(), Halt> {
    let ahead = odom_from_start.rotation * Vector3::x();
    let odom_from_base = agent.odom_from_base()?;
    let base_m = (odom_from_base.translation.vector - odom_from_start.translation.vector).dot(&ahead);
    let at = odom_from_tool.translation.vector + ahead * told_m;
    let goal = odom_from_base.inverse() * Pose::from_parts(at.into(), odom_from_tool.rotation);
    let along = odom_from_base.rotation.inverse() * ahead * speed;
    let goal = seen_from_base(&goal, (along, 0.0), agent.base_velocity()?);
    let forward_m_per_s = (speed + 2.0 * (told_m - base_m)).clamp(-2.0 * BACK_M_PER_S, 2.0 * BACK_M_PER_S);
    controller.set_other_joints(agent.configuration()?.positions());
    let output = controller.tick(&agent.arm_state()?, &goal, &[], agent.period().as_s());
    agent.tick(Twist { forward_m_per_s, turn_rad_per_s: 0.0 }, &output.velocities)
}
