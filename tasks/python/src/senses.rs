//! All that a robot feels, for Python.

use crate::frame::pose_array;
use dsm::Pose;
use dsm::time::Stamp;
use dsm_robot::drivers::{DriverError, GripperState, JointState, Robot, Twist};
use dsm_robot::model::RobotModel;
use dsm_tasks::agent::{Agent, Halt};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What is felt at one moment. Poses are what the robot believes.
pub(crate) struct Senses {
    now: Stamp,
    base: Twist,
    world_from_base: Pose,
    odom_from_base: Pose,
    base_from_tool: Pose,
    arm: JointState,
    head: Vec<f64>,
    gripper: GripperState,
}

impl Senses {
    /// Of a robot behind its drivers.
    pub(crate) fn of_robot(robot: &mut dyn Robot, model: &RobotModel) -> Result<Self, DriverError> {
        let arm = robot.arm().state()?;
        let mut configuration = model.kinematics.zero();
        configuration.apply(&arm.positions);
        Ok(Self {
            now: robot.clock().now(),
            base: robot.base().velocity()?,
            world_from_base: robot.localisation().world_from_base()?.pose,
            odom_from_base: robot.localisation().odom_from_base()?.pose,
            base_from_tool: model.kinematics.root_from_link(&configuration, model.tool),
            arm,
            head: robot.head().state()?.positions.values().to_vec(),
            gripper: robot.gripper().state()?,
        })
    }

    /// Of an agent, which takes jumps of its localiser out.
    pub(crate) fn of_agent(agent: &mut Agent) -> Result<Self, Halt> {
        let configuration = agent.configuration()?;
        let model = agent.model().clone();
        Ok(Self {
            now: agent.now(),
            base: agent.base_velocity()?,
            world_from_base: agent.world_from_base()?,
            odom_from_base: agent.odom_from_base()?,
            base_from_tool: model.kinematics.root_from_link(&configuration, model.tool),
            arm: agent.arm_state()?,
            head: model.head.values_of(&configuration),
            gripper: agent.grip_state()?,
        })
    }

    pub(crate) fn to_python<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let array = |values: &[f64]| PyArray1::from_slice(py, values);
        let state = PyDict::new(py);
        state.set_item("time_s", self.now.as_s())?;
        state.set_item("base_velocity", array(&[self.base.forward_m_per_s, self.base.turn_rad_per_s]))?;
        state.set_item("world_from_base", pose_array(py, &self.world_from_base)?)?;
        state.set_item("odom_from_base", pose_array(py, &self.odom_from_base)?)?;
        state.set_item("base_from_tool", pose_array(py, &self.base_from_tool)?)?;
        state.set_item("arm_positions", array(self.arm.positions.values()))?;
        state.set_item("arm_velocities", array(self.arm.velocities.values()))?;
        state.set_item("head_positions", array(&self.head))?;
        state.set_item("gripper_width_m", self.gripper.width_m)?;
        state.set_item("gripper_force_n", self.gripper.force_n)?;
        Ok(state)
    }
}
