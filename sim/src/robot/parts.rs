//! Base, joint groups, gripper and emergency stop: latched commands and measured states.

use super::SimRobotError;
use super::delay::Delay;
use crate::physics::{JointTarget, Physics};
use dsm::time::Stamp;
use dsm_robot::drivers::{
    Base, DRIVER_TIMEOUT, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Twist,
};
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::{Group, RobotModel};

/// Speed at which the fingers close or open, metres per second each.
const FINGER_SPEED_M_PER_S: f64 = 0.05;
/// Fingers slower than this stand still, metres per second.
const STILL_M_PER_S: f64 = 0.002;

fn refuse_when(stopped: &Option<String>) -> Result<(), DriverError> {
    stopped.clone().map_or(Ok(()), |reason| Err(DriverError::Stopped { reason }))
}

fn finite(value: f64, what: &str) -> Result<f64, DriverError> {
    if value.is_finite() { Ok(value) } else { Err(DriverError::NotFinite { what: what.into() }) }
}

/// A twist times a number.
pub(super) fn scaled(twist: Twist, by: f64) -> Twist {
    Twist { forward_m_per_s: by * twist.forward_m_per_s, turn_rad_per_s: by * twist.turn_rad_per_s }
}

fn find_joint(physics: &dyn Physics, name: &str) -> Result<usize, SimRobotError> {
    physics.find_joint(name).ok_or_else(|| SimRobotError::NoJoint {
        joint: name.into(),
        known: physics.joint_names().iter().map(|n| n.to_string()).collect(),
    })
}

/// The base.
pub(super) struct SimBase {
    pub(super) stopped: Option<String>,
    max_speed_m_per_s: f64,
    max_turn_rad_per_s: f64,
    commanded: Twist,
    commanded_at: Stamp,
    measured: Twist,
    now: Stamp,
}

impl SimBase {
    pub(super) fn new(max_speed_m_per_s: f64, max_turn_rad_per_s: f64) -> Self {
        Self {
            stopped: None,
            max_speed_m_per_s,
            max_turn_rad_per_s,
            commanded: Twist::default(),
            commanded_at: Stamp::default(),
            measured: Twist::default(),
            now: Stamp::default(),
        }
    }

    /// What the wheels are to do now: the newest command unless it is too old.
    pub(super) fn twist_at(&self, now: Stamp) -> Twist {
        if now - self.commanded_at > DRIVER_TIMEOUT { Twist::default() } else { self.commanded }
    }

    /// Reads the wheels, which have the share `grip` of their hold on the floor.
    pub(super) fn measure(&mut self, physics: &dyn Physics, grip: f64) {
        self.now = physics.now();
        self.measured = scaled(physics.base_velocity(), 1.0 / grip);
    }
}

impl Base for SimBase {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        refuse_when(&self.stopped)?;
        let forward = finite(twist.forward_m_per_s, "forward speed")?;
        let turn = finite(twist.turn_rad_per_s, "turning speed")?;
        self.commanded = Twist {
            forward_m_per_s: forward.clamp(-self.max_speed_m_per_s, self.max_speed_m_per_s),
            turn_rad_per_s: turn.clamp(-self.max_turn_rad_per_s, self.max_turn_rad_per_s),
        };
        self.commanded_at = self.now;
        Ok(self.commanded)
    }

    fn velocity(&mut self) -> Result<Twist, DriverError> {
        Ok(self.measured)
    }
}

/// A group of joints: arm with lift, or head.
pub(super) struct SimGroup {
    pub(super) stopped: Option<String>,
    joints: Vec<usize>,
    max_speeds: Vec<f64>,
    commanded: JointVelocities,
    commanded_at: Stamp,
    now: Stamp,
    state: Delay<JointState>,
}

impl SimGroup {
    pub(super) fn new(group: &Group, latency_s: f64, physics: &dyn Physics) -> Result<Self, SimRobotError> {
        let joints = group.joints.iter().map(|name| find_joint(physics, name)).collect::<Result<Vec<_>, _>>()?;
        let state = JointState {
            stamp: physics.now(),
            positions: JointPositions::zeros(&group.joints),
            velocities: JointVelocities::zeros(&group.joints),
        };
        Ok(Self {
            stopped: None,
            joints,
            max_speeds: group.limits.iter().map(|limits| limits.velocity).collect(),
            commanded: JointVelocities::zeros(&group.joints),
            commanded_at: physics.now(),
            now: physics.now(),
            state: Delay::new(latency_s, physics.now(), state),
        })
    }

    /// What the motors are to do now: the newest command unless it is too old.
    pub(super) fn commands_at(&self, now: Stamp) -> impl Iterator<Item = (usize, f64)> {
        let share = if now - self.commanded_at > DRIVER_TIMEOUT { 0.0 } else { 1.0 };
        self.joints.iter().copied().zip(self.commanded.values().iter().map(move |velocity| share * velocity))
    }

    pub(super) fn measure(&mut self, physics: &dyn Physics) {
        self.now = physics.now();
        let (positions, velocities) = (physics.joint_positions(), physics.joint_velocities());
        let mut state = JointState { stamp: physics.now(), ..self.state.heard().clone() };
        for (index, joint) in self.joints.iter().enumerate() {
            state.positions.values_mut()[index] = positions.values()[*joint];
            state.velocities.values_mut()[index] = velocities.values()[*joint];
        }
        self.state.measure(physics.now(), state);
    }
}

impl JointGroup for SimGroup {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        refuse_when(&self.stopped)?;
        if velocities.names() != self.commanded.names() {
            let list = |v: &JointVelocities| v.names().iter().map(|n| n.to_string()).collect();
            return Err(DriverError::WrongJoints { expected: list(&self.commanded), got: list(velocities) });
        }
        let mut sent = JointVelocities::zeros(self.commanded.names());
        for (index, (name, velocity)) in velocities.iter().enumerate() {
            let max = self.max_speeds[index];
            sent.values_mut()[index] = finite(velocity, &format!("velocity of {name}"))?.clamp(-max, max);
        }
        self.commanded = sent.clone();
        self.commanded_at = self.now;
        Ok(sent)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        Ok(self.state.heard().clone())
    }
}

/// The gripper.
pub(super) struct SimGripper {
    pub(super) stopped: Option<String>,
    joints: Vec<usize>,
    max_width_m: f64,
    max_force_n: f64,
    /// Width and force; `None` until the first command: the fingers hold where they are.
    commanded: Option<(f64, f64)>,
    state: GripperState,
}

impl SimGripper {
    pub(super) fn new(model: &RobotModel, physics: &dyn Physics) -> Result<Self, SimRobotError> {
        let gripper = &model.settings.gripper;
        let joints = gripper.joints.iter().map(|name| find_joint(physics, name)).collect::<Result<Vec<_>, _>>()?;
        let state = GripperState { stamp: physics.now(), width_m: 0.0, force_n: 0.0, moving: false };
        Ok(Self {
            stopped: None,
            joints,
            max_width_m: gripper.max_aperture_m,
            max_force_n: gripper.max_force_n,
            commanded: None,
            state,
        })
    }

    pub(super) fn commands(&self) -> impl Iterator<Item = (usize, JointTarget)> {
        let target = self.commanded.map(|(width_m, force_n)| JointTarget::Position {
            position: width_m / self.joints.len() as f64,
            speed: FINGER_SPEED_M_PER_S,
            max_effort: force_n,
        });
        self.joints.iter().copied().filter_map(move |joint| Some((joint, target?)))
    }

    pub(super) fn measure(&mut self, physics: &dyn Physics) {
        let (positions, velocities) = (physics.joint_positions(), physics.joint_velocities());
        let efforts: f64 = self.joints.iter().map(|j| physics.joint_effort(*j).abs()).sum();
        self.state = GripperState {
            stamp: physics.now(),
            width_m: self.joints.iter().map(|j| positions.values()[*j]).sum::<f64>().max(0.0),
            force_n: efforts / self.joints.len() as f64,
            moving: self.joints.iter().any(|j| velocities.values()[*j].abs() > STILL_M_PER_S),
        };
    }
}

impl Gripper for SimGripper {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        refuse_when(&self.stopped)?;
        let width = finite(width_m, "gripper width")?.clamp(0.0, self.max_width_m);
        let force = finite(max_force_n, "grip force")?.clamp(0.0, self.max_force_n);
        self.commanded = Some((width, force));
        Ok((width, force))
    }

    fn state(&mut self) -> Result<GripperState, DriverError> {
        Ok(self.state)
    }
}

/// The latched emergency stop.
#[derive(Default)]
pub(super) struct SimStop {
    reason: Option<String>,
}

impl EmergencyStop for SimStop {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        // The first reason stays: it is what went wrong.
        self.reason.get_or_insert_with(|| reason.to_owned());
        Ok(())
    }

    fn find_reason(&self) -> Option<String> {
        self.reason.clone()
    }

    fn reset(&mut self) -> Result<(), DriverError> {
        self.reason = None;
        Ok(())
    }
}
