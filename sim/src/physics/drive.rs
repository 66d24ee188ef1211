//! The motors: joint targets, gravity feed-forward, base velocity.

use super::JointTarget;
use super::convert::{from_pose, from_vector};
use super::robot_body::{BuiltRobot, JointPlace};
use super::robot_spec::BaseDrive;
use dsm_robot::drivers::Twist;
use nalgebra::Vector3;
use rapier3d::prelude::*;

/// Stiffness and damping of a joint's motor.
#[derive(Clone, Copy, Debug)]
struct Gains {
    stiffness: f64,
    damping: f64,
    /// How far the moving position target may run ahead of the joint, radians or metres: it bounds the effort that a
    /// blocked joint builds up.
    lead: f64,
}

/// Gains by the effort the motor can give: full effort at a position error of `full_effort_at`.
///
/// Measured in `examples/spike.rs`: 0.02 rad keeps the tool within 2 mm, and the damping (0.07 s times the stiffness)
/// leaves no oscillation with a load of 1 kg.
fn gains(joint: &JointPlace, finger: bool) -> Gains {
    let full_effort_at = match (joint.prismatic, finger) {
        (_, true) => 0.005,
        (true, false) => 0.005,
        (false, false) => 0.02,
    };
    let stiffness = joint.max_effort / full_effort_at;
    Gains { stiffness, damping: 0.07 * stiffness, lead: 2.0 * full_effort_at }
}

/// The wheels' velocity control integrates, so that a standing base does not creep under a steady push: full force at
/// this error along each axis, and the moving reference runs no further ahead.
const BASE_HOLD_M: f64 = 0.005;
const BASE_HOLD_RAD: f64 = 0.005;

struct Motor {
    gains: Gains,
    target: JointTarget,
    /// The moving position target.
    reference: f64,
    /// Measured position and its change per second.
    position: f64,
    velocity: f64,
    effort: f64,
    is_finger: bool,
}

/// All motors of the robot.
pub(super) struct Drive {
    motors: Vec<Motor>,
    twist: Twist,
    /// Moving references of x, y and yaw.
    base_reference: [f64; 3],
    limits: BaseDrive,
    finger_max_force_n: f64,
}

impl Drive {
    /// Motors that hold the given positions, base at rest.
    pub(super) fn new(
        robot: &BuiltRobot,
        limits: BaseDrive,
        finger_max_force_n: f64,
        base: [f64; 3],
        positions: &[f64],
    ) -> Self {
        let motors = robot.joints.iter().zip(positions).enumerate().map(|(index, (joint, position))| {
            let is_finger = robot.finger_joints.contains(&index);
            Motor {
                gains: gains(joint, is_finger),
                target: JointTarget::Velocity(0.0),
                reference: *position,
                position: *position,
                velocity: 0.0,
                effort: 0.0,
                is_finger,
            }
        });
        Self { motors: motors.collect(), twist: Twist::default(), base_reference: base, limits, finger_max_force_n }
    }

    pub(super) fn command_base(&mut self, twist: Twist) {
        let clamp = |value: f64, limit: f64| if value.is_finite() { value.clamp(-limit, limit) } else { 0.0 };
        self.twist = Twist {
            forward_m_per_s: clamp(twist.forward_m_per_s, self.limits.max_speed_m_per_s),
            turn_rad_per_s: clamp(twist.turn_rad_per_s, self.limits.max_turn_rad_per_s),
        };
    }

    pub(super) fn command_joint(&mut self, joint: usize, target: JointTarget) {
        self.motors[joint].target = target;
    }

    pub(super) fn effort(&self, joint: usize) -> f64 {
        self.motors[joint].effort
    }

    /// Sets the engine's motors for the next step of `dt_s`.
    pub(super) fn before_step(&mut self, robot: &BuiltRobot, world: &mut PhysicsWorld, dt_s: f64) {
        self.drive_base(robot, world, dt_s);
        for (index, place) in robot.joints.iter().enumerate() {
            let holding = holding_effort(robot, place, world);
            self.drive_joint(index, place, world, holding, dt_s);
        }
    }

    fn drive_base(&mut self, robot: &BuiltRobot, world: &mut PhysicsWorld, dt_s: f64) {
        let Some((multibody, link)) = world.multibody_joints.get_mut(robot.base_joint) else { return };
        let Some(link) = multibody.link_mut(link) else { return };
        let coords = link.joint.coords();
        let (sin, cos) = f64::from(coords[5]).sin_cos();
        let forward = self.twist.forward_m_per_s;
        let limits = &self.limits;
        let axes = [
            (JointAxis::LinX, forward * cos, BASE_HOLD_M, limits.max_force_n),
            (JointAxis::LinY, forward * sin, BASE_HOLD_M, limits.max_force_n),
            (JointAxis::AngZ, self.twist.turn_rad_per_s, BASE_HOLD_RAD, limits.max_torque_nm),
        ];
        for ((axis, velocity, hold, max), reference) in axes.into_iter().zip(&mut self.base_reference) {
            let position = f64::from(coords[axis as usize]);
            *reference = (*reference + velocity * dt_s).clamp(position - hold, position + hold);
            let stiffness = max / hold;
            let joint = &mut link.joint.data;
            joint.set_motor_model(axis, MotorModel::ForceBased);
            joint.set_motor(axis, *reference as f32, velocity as f32, stiffness as f32, (0.15 * stiffness) as f32);
            joint.set_motor_max_force(axis, max as f32);
        }
    }

    fn drive_joint(&mut self, index: usize, place: &JointPlace, world: &mut PhysicsWorld, holding: f64, dt_s: f64) {
        let motor = &mut self.motors[index];
        let (velocity, max_effort) = match motor.target {
            JointTarget::Velocity(velocity) => {
                let velocity = if velocity.is_finite() { velocity } else { 0.0 };
                let velocity = velocity.clamp(-place.max_speed, place.max_speed);
                let wanted = (motor.reference + velocity * dt_s).clamp(place.lower, place.upper);
                motor.reference = wanted.clamp(motor.position - motor.gains.lead, motor.position + motor.gains.lead);
                // No feed-forward into a limit.
                let blocked = wanted <= place.lower && velocity < 0.0 || wanted >= place.upper && velocity > 0.0;
                (if blocked { 0.0 } else { velocity }, place.max_effort)
            }
            JointTarget::Position { position: goal, speed, max_effort } => {
                let goal = goal.clamp(place.lower, place.upper);
                let stride = speed.abs().min(place.max_speed) * dt_s;
                let max_effort = max_effort.min(place.max_effort);
                // Not much further ahead than the effort needs, or a joint that comes free shoots after its target.
                let lead = 1.25 * max_effort.max(0.0) / motor.gains.stiffness;
                let before = motor.reference;
                motor.reference = (before + (goal - before).clamp(-stride, stride))
                    .clamp(motor.position - lead, motor.position + lead);
                ((motor.reference - before).clamp(-stride, stride) / dt_s, max_effort)
            }
        };
        let max_effort = if motor.is_finger { max_effort.min(self.finger_max_force_n) } else { max_effort };
        let Gains { stiffness, damping, .. } = motor.gains;
        // Gravity feed-forward through the position target: at rest the motor then gives exactly the holding effort,
        // and the effort bound covers it.
        let target = motor.reference + holding / stiffness;
        if let Some((multibody, link)) = world.multibody_joints.get_mut(place.joint)
            && let Some(link) = multibody.link_mut(link)
        {
            let joint = &mut link.joint.data;
            let (stiffness, damping) = (stiffness as f32, damping as f32);
            joint.set_motor(place.axis, target as f32, velocity as f32, stiffness, damping);
            joint.set_motor_max_force(place.axis, max_effort.max(0.0) as f32);
        }
    }

    /// Reads back what the motors did during the step.
    ///
    /// Velocity is the change of position, as an encoder sees it: under a contact's load the solver's own velocities
    /// keep a share that position never follows (7 mm/s for fingers that press an apple and stand still).
    pub(super) fn after_step(&mut self, robot: &BuiltRobot, world: &PhysicsWorld, dt_s: f64) {
        for (motor, place) in self.motors.iter_mut().zip(&robot.joints) {
            let Some((multibody, link)) = world.multibody_joints.get(place.joint) else { continue };
            let Some(link) = multibody.link(link) else { continue };
            let Some(data) = link.joint.data.motor(place.axis) else { continue };
            let position = f64::from(link.joint.coords()[place.axis as usize]);
            motor.velocity = (position - motor.position) / dt_s;
            motor.position = position;
            let (stiffness, damping, max) =
                (f64::from(data.stiffness), f64::from(data.damping), f64::from(data.max_force));
            let effort = stiffness * (f64::from(data.target_pos) - position)
                + damping * (f64::from(data.target_vel) - motor.velocity);
            motor.effort = effort.clamp(-max, max);
        }
    }

    /// Measured positions, radians or metres.
    pub(super) fn positions(&self) -> impl Iterator<Item = f64> {
        self.motors.iter().map(|motor| motor.position)
    }

    /// Measured velocities, radians or metres per second.
    pub(super) fn velocities(&self) -> impl Iterator<Item = f64> {
        self.motors.iter().map(|motor| motor.velocity)
    }
}

/// The effort that holds everything the joint carries against gravity, without load.
fn holding_effort(robot: &BuiltRobot, place: &JointPlace, world: &PhysicsWorld) -> f64 {
    let Some(parent) = world.bodies.get(place.parent) else { return 0.0 };
    let world_from_axis = from_pose(parent.position()) * place.parent_from_axis;
    let axis = world_from_axis.rotation * Vector3::x();
    let origin = world_from_axis.translation.vector;
    let gravity = from_vector(world.gravity);
    let mut effort = 0.0;
    for index in &place.carries {
        let (handle, mass_kg) = robot.bodies[*index];
        let weight = gravity * mass_kg;
        if place.prismatic {
            effort -= axis.dot(&weight);
        } else if let Some(body) = world.bodies.get(handle) {
            effort -= axis.dot(&(from_vector(body.center_of_mass()) - origin).cross(&weight));
        }
    }
    effort
}
