//! Pushing a door open with the closed hand, away from the robot: the hand follows an arc about the hinges, the base drives
//! on behind it.
//!
//! ```text
//! lag = r (told - gone);     usual += (lag - usual) dt / T;     held up: lag - usual > bound
//! ```

use super::pull::seen_from_base;
use crate::agent::{Agent, Halt};
use dsm::Pose;
use dsm::time::Span;
use dsm_robot::control::{Controller, ControllerConfig};
use dsm_robot::drivers::Twist;
use dsm_robot::model::LinkId;
use nalgebra::{Point2, Point3, UnitQuaternion, Vector2, Vector3};

/// Speed of the hand until the door has given way, and after that, metres per second.
const FIRST_M_PER_S: f64 = 0.02;
const SHOVE_M_PER_S: f64 = 0.05;
/// How fast it gains and loses speed, metres per second squared.
const GAIN_M_PER_S2: f64 = 0.1;
/// The hand lags behind its way by no more than this above what is usual, metres: where it meets the door and that breaks
/// loose, which takes so much way, and after that.
const MEETS_LAG_M: f64 = 0.0013;
const MEETS_M: f64 = 0.05;
const LAG_M: f64 = 0.0013;
/// What is usual is learned within so long, seconds.
const USUAL_S: f64 = 0.4;
/// Back from what holds it up, and how fast, metres and metres per second.
const LET_DOWN_M: f64 = 0.015;
const BACK_M_PER_S: f64 = 0.05;
/// Share of the door's turning by which the hand turns with it.
const TURN_SHARE: f64 = 0.5;
/// Gains of the base towards its place and its heading, 1/s, and its greatest speed beyond that of the hand.
const BASE_GAIN_PER_S: f64 = 2.0;

/// A way of the closed hand about the hinges of a door, in the frame of the base where it begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arc {
    /// The hinges.
    pub hinge: Point2<f64>,
    /// 1 when the door turns to the left, seen from above, else -1.
    pub sense: f64,
    /// The tip of the fingers at the beginning.
    pub tip: Point3<f64>,
    /// How the hand is turned there.
    pub rotation: UnitQuaternion<f64>,
    /// From the tool to the tip of the fingers, metres.
    pub tip_m: f64,
}

impl Arc {
    /// The arc that a hand goes on from where it is.
    pub(super) fn from_tool(hinge: Point2<f64>, sense: f64, base_from_tool: &Pose, tip_m: f64) -> Self {
        let tip = base_from_tool * Point3::new(0.0, 0.0, tip_m);
        Self { hinge, sense, tip, rotation: base_from_tool.rotation, tip_m }
    }

    fn arm(&self) -> Vector2<f64> {
        self.tip.xy() - self.hinge
    }

    /// From the hinges to the tip, metres.
    pub(super) fn radius_m(&self) -> f64 {
        self.arm().norm()
    }

    /// The tool on the arc, in the frame of the base at the beginning.
    pub(super) fn tool_at(&self, angle_rad: f64) -> Pose {
        let turned = |share: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), share * self.sense * angle_rad);
        let arm = turned(1.0) * Vector3::new(self.arm().x, self.arm().y, 0.0);
        let rotation = turned(TURN_SHARE) * self.rotation;
        let tip = Vector3::new(self.hinge.x + arm.x, self.hinge.y + arm.y, self.tip.z);
        Pose::from_parts((tip - rotation * Vector3::z() * self.tip_m).into(), rotation)
    }

    /// How far the base has driven on when the tip is there, metres: the hand keeps its distance before it.
    pub(super) fn base_at_m(&self, angle_rad: f64) -> f64 {
        (self.tool_at(angle_rad).translation.x - self.tool_at(0.0).translation.x).max(0.0)
    }

    /// How far a tip has come about the hinges, radians.
    fn angle_of(&self, tip: &Point3<f64>) -> f64 {
        let (from, to) = (self.arm(), tip.xy() - self.hinge);
        self.sense * (from.x * to.y - from.y * to.x).atan2(from.dot(&to))
    }
}

/// How a push ended, and how far the hand came about the hinges, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shoved {
    /// As far as it was to go.
    AllTheWay(f64),
    /// Something holds it up.
    HeldUp(f64),
}

impl Shoved {
    /// How far the hand came, radians.
    pub(super) fn angle_rad(self) -> f64 {
        match self {
            Self::AllTheWay(angle_rad) | Self::HeldUp(angle_rad) => angle_rad,
        }
    }
}

/// Moves the hand along an arc by an angle; it meets the door after `before_m`. `touching` may touch things.
pub(super) fn shove(
    agent: &mut Agent,
    arc: &Arc,
    (before_m, wanted_rad): (f64, f64),
    touching: &[LinkId],
) -> Result<Shoved, Halt> {
    let model = agent.model().clone();
    let config = ControllerConfig { max_tool_speed_m_per_s: 3.0 * SHOVE_M_PER_S, ..model.settings.control.clone() };
    let mut controller = Controller::new(&model, config);
    controller.set_touching(touching);
    controller.set_posture(&agent.arm_state()?.positions);
    let odom_from_start = agent.odom_from_base()?;
    let radius_m = arc.radius_m();
    let dt_s = agent.period().as_s();
    let begin = agent.now();
    let longest_s = 3.0 * wanted_rad * radius_m / FIRST_M_PER_S + 3.0;
    let gone_of = |agent: &mut Agent| -> Result<f64, Halt> {
        let start_from_base = odom_from_start.inverse() * agent.odom_from_base()?;
        let tool = start_from_base * model.kinematics.root_from_link(&agent.configuration()?, model.tool);
        Ok(arc.angle_of(&(tool * Point3::new(0.0, 0.0, arc.tip_m))))
    };
    let (mut told_rad, mut speed, mut usual_m, mut most_lag_m) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut ended = None;
    agent.take_touch();
    while (agent.now() - begin).as_s() < longest_s {
        let gone_rad = gone_of(agent)?;
        if gone_rad >= wanted_rad {
            ended = Some(Shoved::AllTheWay(gone_rad));
            break;
        }
        let (lag_m, gone_m) = (radius_m * (told_rad - gone_rad), radius_m * gone_rad);
        most_lag_m = most_lag_m.max(lag_m);
        let is_first = gone_m < before_m + MEETS_M;
        let (wanted, bound_m) = if is_first { (FIRST_M_PER_S, MEETS_LAG_M) } else { (SHOVE_M_PER_S, LAG_M) };
        // Speeding up and slowing down lag by themselves.
        let is_steady = (speed - wanted).abs() < 0.2 * wanted;
        if is_steady && lag_m - usual_m > bound_m {
            ended = Some(Shoved::HeldUp(gone_rad));
            break;
        }
        usual_m += (lag_m - usual_m) * dt_s / USUAL_S;
        speed += (wanted - speed).clamp(-3.0 * GAIN_M_PER_S2 * dt_s, GAIN_M_PER_S2 * dt_s);
        told_rad += speed * dt_s / radius_m;
        step(agent, &mut controller, &odom_from_start, arc, (told_rad, speed / radius_m))?;
    }
    // What the motors wound up is let down at once.
    let end_rad = gone_of(agent)?;
    while told_rad > end_rad - LET_DOWN_M / radius_m {
        told_rad -= BACK_M_PER_S * dt_s / radius_m;
        step(agent, &mut controller, &odom_from_start, arc, (told_rad, -BACK_M_PER_S / radius_m))?;
    }
    agent.log(format!(
        "pushed by {end_rad:.2} rad of {wanted_rad:.2}, radius {radius_m:.2} m, at most {:.1} mm behind",
        1e3 * most_lag_m
    ));
    agent.rest(Span::from_s(0.2))?;
    agent.take_touch();
    Ok(ended.unwrap_or(Shoved::HeldUp(end_rad)))
}

/// One tick with the hand so far on its arc, at a rate, and the base behind it.
fn step(
    agent: &mut Agent,
    controller: &mut Controller,
    odom_from_start: &Pose,
    arc: &Arc,
    (told_rad, rate_rad_per_s): (f64, f64),
) -> Result<(), Halt> {
    const AHEAD_RAD: f64 = 0.01;
    let start_from_base = odom_from_start.inverse() * agent.odom_from_base()?;
    let [at, on] = [told_rad, told_rad + AHEAD_RAD].map(|angle_rad| arc.tool_at(angle_rad));
    let along = (on.translation.vector - at.translation.vector) * (rate_rad_per_s / AHEAD_RAD);
    let into_base = start_from_base.inverse();
    let turn = arc.sense * TURN_SHARE * rate_rad_per_s;
    let goal = seen_from_base(&(into_base * at), (into_base.rotation * along, turn), agent.base_velocity()?);
    let [base_m, base_on_m] = [told_rad, told_rad + AHEAD_RAD].map(|angle_rad| arc.base_at_m(angle_rad));
    let forward = (base_on_m - base_m) / AHEAD_RAD * rate_rad_per_s;
    let forward = forward + BASE_GAIN_PER_S * (base_m - start_from_base.translation.x);
    let bound = 2.0 * SHOVE_M_PER_S;
    let heading_rad = start_from_base.rotation.euler_angles().2;
    let base = Twist { forward_m_per_s: forward.clamp(-bound, bound), turn_rad_per_s: (-heading_rad).clamp(-0.1, 0.1) };
    controller.set_other_joints(agent.configuration()?.positions());
    let output = controller.tick(&agent.arm_state()?, &goal, &[], agent.period().as_s());
    agent.tick(base, &output.velocities)
}

#[cfg(test)]
mod tests {
    //! Contract: the tip of the fingers keeps its distance from the hinges and goes away from the robot; the base drives on.
    use super::*;

    #[test]
    fn the_tip_stays_on_its_arc() {
        let ahead = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        for sense in [1.0, -1.0] {
            // Hinges to the left of a door that turns to the left.
            let hinge = Point2::new(0.7, 0.4 * sense);
            let tool = Pose::from_parts(Vector3::new(0.62, -0.2 * sense, 0.95).into(), ahead);
            let arc = Arc::from_tool(hinge, sense, &tool, 0.015);
            assert!((arc.tool_at(0.0).translation.vector - tool.translation.vector).norm() < 1e-9);
            for angle_rad in [0.3, 0.8, 1.2] {
                let tip = arc.tool_at(angle_rad) * Point3::new(0.0, 0.0, 0.015);
                assert!(((tip.xy() - hinge).norm() - arc.radius_m()).abs() < 1e-9);
                assert!((arc.angle_of(&tip) - angle_rad).abs() < 1e-9, "{sense}");
                assert!(tip.x > arc.tip.x + 0.1 && arc.base_at_m(angle_rad) > 0.1, "{tip}");
            }
        }
    }
}
