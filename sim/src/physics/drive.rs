//! Rapier's motors: set points and gravity feed-forward in, what they did out.

use super::convert::{from_pose, from_vector};
use super::motors::{Motors, Setpoint};
use super::robot_body::{BuiltRobot, JointPlace};
use nalgebra::Vector3;
use rapier3d::prelude::*;

/// The degrees of freedom of the base's joint, in the order of [`Motors::plan_base`].
const BASE_AXES: [JointAxis; 3] = [JointAxis::LinX, JointAxis::LinY, JointAxis::AngZ];

/// Sets the engine's motors for the next step of `dt_s`.
pub(super) fn before_step(motors: &mut Motors, robot: &BuiltRobot, world: &mut PhysicsWorld, dt_s: f64) {
    if let Some((multibody, link)) = world.multibody_joints.get_mut(robot.base_joint)
        && let Some(link) = multibody.link_mut(link)
    {
        let coords = link.joint.coords();
        let setpoints = motors.plan_base(BASE_AXES.map(|axis| f64::from(coords[axis as usize])), dt_s);
        for (axis, setpoint) in BASE_AXES.into_iter().zip(setpoints) {
            link.joint.data.set_motor_model(axis, MotorModel::ForceBased);
            set_motor(&mut link.joint.data, axis, &setpoint, 0.0);
        }
    }
    for (index, place) in robot.joints.iter().enumerate() {
        let holding = holding_effort(robot, place, world);
        let setpoint = motors.plan_joint(index, dt_s);
        if let Some((multibody, link)) = world.multibody_joints.get_mut(place.joint)
            && let Some(link) = multibody.link_mut(link)
        {
            set_motor(&mut link.joint.data, place.axis, &setpoint, holding);
        }
    }
}

/// Gravity feed-forward goes through the position target: at rest the motor then gives exactly the holding effort, and
/// the effort bound covers it.
fn set_motor(joint: &mut GenericJoint, axis: JointAxis, setpoint: &Setpoint, holding: f64) {
    let Setpoint { position, velocity, stiffness, damping, max_effort, spare_effort } = *setpoint;
    let target = position + holding / stiffness;
    joint.set_motor(axis, target as f32, velocity as f32, stiffness as f32, damping as f32);
    joint.set_motor_max_force(axis, max_effort.min(holding.abs() + spare_effort) as f32);
}

/// Reads back what the motors did during the step.
///
/// Velocity is the change of position, as an encoder sees it: under a contact's load the solver's own velocities
/// keep a share that position never follows (7 mm/s for fingers that press an apple and stand still).
pub(super) fn after_step(motors: &mut Motors, robot: &BuiltRobot, world: &PhysicsWorld, dt_s: f64) {
    for (index, place) in robot.joints.iter().enumerate() {
        let Some((multibody, link)) = world.multibody_joints.get(place.joint) else { continue };
        let Some(link) = multibody.link(link) else { continue };
        let Some(data) = link.joint.data.motor(place.axis) else { continue };
        let position = f64::from(link.joint.coords()[place.axis as usize]);
        let velocity = (position - motors.position(index)) / dt_s;
        let (stiffness, damping, max) = (f64::from(data.stiffness), f64::from(data.damping), f64::from(data.max_force));
        let effort =
            stiffness * (f64::from(data.target_pos) - position) + damping * (f64::from(data.target_vel) - velocity);
        motors.measure(index, position, velocity, effort.clamp(-max, max));
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
