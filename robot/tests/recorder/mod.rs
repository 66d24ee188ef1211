//! Writes down every command that leaves the envelope, whether or not it arrives.

#![allow(dead_code, reason = "each program that includes this module uses a part of it")]

use dsm::time::Stamp;
use dsm_robot::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, Twist,
};
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::{Group, RobotModel};
use dsm_robot::safety::{LONGEST_STEP, PERIOD};

/// The commands of one part, with the true time of each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tape {
    pub(crate) base: Vec<(Stamp, Twist)>,
    pub(crate) arm: Vec<(Stamp, Vec<f64>)>,
    pub(crate) head: Vec<(Stamp, Vec<f64>)>,
    pub(crate) gripper: Vec<(f64, f64)>,
}

/// A robot whose commands are written down.
pub(crate) struct Recorder<R: Robot> {
    parts: Arm<R>,
}

struct Arm<R: Robot>(Head<R>);
struct Head<R: Robot>(Core<R>);

struct Core<R: Robot> {
    robot: R,
    true_now: fn(&R) -> Stamp,
    tape: Tape,
}

impl<R: Robot> Recorder<R> {
    /// `true_now` tells the time of the world, whatever the robot's clock says.
    pub(crate) fn new(robot: R, true_now: fn(&R) -> Stamp) -> Self {
        Self { parts: Arm(Head(Core { robot, true_now, tape: Tape::default() })) }
    }
    pub(crate) fn inner(&self) -> &R {
        &self.parts.0.0.robot
    }
    pub(crate) fn inner_mut(&mut self) -> &mut R {
        &mut self.parts.0.0.robot
    }
    pub(crate) fn tape(&self) -> &Tape {
        &self.parts.0.0.tape
    }
    pub(crate) fn true_now(&self) -> Stamp {
        (self.parts.0.0.true_now)(self.inner())
    }
    pub(crate) fn rewind(&mut self) {
        self.parts.0.0.tape = Tape::default();
    }
}

impl<R: Robot> Core<R> {
    fn now(&self) -> Stamp {
        (self.true_now)(&self.robot)
    }
}

impl<R: Robot> Base for Core<R> {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.tape.base.push((self.now(), twist));
        self.robot.base().command(twist)
    }
    fn velocity(&mut self) -> Result<Twist, DriverError> {
        self.robot.base().velocity()
    }
}

impl<R: Robot> JointGroup for Arm<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        let core = &mut self.0.0;
        core.tape.arm.push((core.now(), velocities.values().to_vec()));
        core.robot.arm().command(velocities)
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.0.robot.arm().state()
    }
}

impl<R: Robot> JointGroup for Head<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.tape.head.push((self.0.now(), velocities.values().to_vec()));
        self.0.robot.head().command(velocities)
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.robot.head().state()
    }
}

impl<R: Robot> Gripper for Core<R> {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.tape.gripper.push((width_m, max_force_n));
        self.robot.gripper().command(width_m, max_force_n)
    }
    fn state(&mut self) -> Result<GripperState, DriverError> {
        self.robot.gripper().state()
    }
}

impl<R: Robot> Robot for Recorder<R> {
    fn base(&mut self) -> &mut dyn Base {
        &mut self.parts.0.0
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        &mut self.parts
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        &mut self.parts.0.0
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        &mut self.parts.0
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        self.parts.0.0.robot.cameras()
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        self.parts.0.0.robot.localisation()
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self.parts.0.0.robot.clock()
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        self.parts.0.0.robot.emergency_stop()
    }
}

/// What of a tape is beyond velocity, acceleration, width or force limits, in words; `None` when nothing is.
pub(crate) fn find_violation(tape: &Tape, model: &RobotModel) -> Option<String> {
    let base = &model.settings.base;
    let limits = [
        (base.max_speed_m_per_s, base.max_acceleration_m_per_s2),
        (base.max_turn_rate_rad_per_s, base.max_turn_acceleration_rad_per_s2),
    ];
    let twists = tape.base.iter().map(|(at, twist)| (*at, vec![twist.forward_m_per_s, twist.turn_rad_per_s])).collect();
    let of_group = |group: &Group| -> Vec<(f64, f64)> {
        group.limits.iter().map(|limit| limit.velocity).zip(group.max_accelerations.iter().copied()).collect()
    };
    let gripper = &model.settings.gripper;
    let beyond = |&(width_m, force_n): &(f64, f64)| {
        !(0.0..=gripper.max_aperture_m).contains(&width_m) || !(0.0..=gripper.max_force_n).contains(&force_n)
    };
    find_jump("base", &twists, &limits)
        .or_else(|| find_jump("arm", &tape.arm, &of_group(&model.arm)))
        .or_else(|| find_jump("head", &tape.head, &of_group(&model.head)))
        .or_else(|| tape.gripper.iter().find(|command| beyond(command)).map(|command| format!("gripper {command:?}")))
}

/// Commands at one moment all start from what was sent before that moment.
fn find_jump(part: &str, commands: &Vec<(Stamp, Vec<f64>)>, limits: &[(f64, f64)]) -> Option<String> {
    const EPSILON: f64 = 1e-9;
    let mut before: (Stamp, Vec<f64>) = (Stamp(i64::MIN / 2), vec![0.0; limits.len()]);
    let mut last = before.clone();
    for (at, values) in commands {
        if *at > last.0 {
            before = last.clone();
        }
        let step_s = (*at - before.0).as_s().clamp(PERIOD.as_s(), LONGEST_STEP.as_s());
        for (k, (value, (speed, acceleration))) in values.iter().zip(limits).enumerate() {
            let change = (value - before.1[k]).abs();
            if !(value.abs() <= speed + EPSILON && change <= acceleration * step_s + EPSILON) {
                return Some(format!("{part} {k} at {:.3} s: {} -> {value}", at.as_s(), before.1[k]));
            }
        }
        last = (*at, values.clone());
    }
    None
}
