//! What physics must know of a robot.

use super::PhysicsError;
use dsm_robot::model::{Drive, JointKind, Kinematics, RobotModel};
use std::collections::BTreeSet;

/// Where the robot stands at the start.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotStart {
    /// Position on the floor, metres, and yaw, radians.
    pub x_m: f64,
    /// See [`RobotStart::x_m`].
    pub y_m: f64,
    /// Heading about +z.
    pub yaw_rad: f64,
    /// Joint values by name; joints left out start at 0 (or the limit nearest to 0).
    pub joints: Vec<(String, f64)>,
}

/// A joint that a motor moves, with its limits: radians or metres, per second, newton metres or newtons.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingJoint {
    /// Its name.
    pub name: String,
    /// Whether it slides instead of turning.
    pub prismatic: bool,
    /// Least value; minus infinity for a joint that turns for ever.
    pub lower: f64,
    /// Greatest value.
    pub upper: f64,
    /// Greatest speed.
    pub max_speed: f64,
    /// Greatest effort of its motor.
    pub max_effort: f64,
}

/// Friction coefficient of links that are not finger pads: painted metal.
pub const LINK_FRICTION: f64 = 0.4;

/// How hard the wheels can push.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseDrive {
    /// Along any direction in the floor plane, newtons; above 0.
    pub max_force_n: f64,
    /// About the vertical axis, newton metres; above 0.
    pub max_torque_nm: f64,
    /// Top speed, metres per second; above 0.
    pub max_speed_m_per_s: f64,
    /// Top turning rate, radians per second; above 0.
    pub max_turn_rad_per_s: f64,
}

/// The two fingers of the gripper. They are geared to each other: both joints always have the same value.
#[derive(Clone, Debug, PartialEq)]
pub struct FingerPair {
    /// The two prismatic joints.
    pub joints: [String; 2],
    /// The links they move.
    pub links: [String; 2],
    /// Friction coefficient of the pads, above 0 and at most 1.
    pub friction: f64,
    /// Greatest force of one finger, newtons, above 0 and at most 40.
    pub max_force_n: f64,
}

/// What physics must know of a robot: its links and joints and what its URDF cannot say.
#[derive(Clone, Debug)]
pub struct RobotBody {
    /// Links, joints, limits, masses and shapes.
    pub kinematics: Kinematics,
    /// The link on the floor that the wheels move.
    pub base_link: String,
    /// The wheels' drive.
    pub drive: BaseDrive,
    /// The gripper's fingers.
    pub fingers: FingerPair,
    /// Pairs of links that never collide.
    pub ignored_pairs: Vec<[String; 2]>,
}

impl RobotBody {
    /// What physics must know of a loaded robot.
    ///
    /// # Errors
    /// [`PhysicsError::BadGripper`] unless the gripper has exactly two fingers.
    pub fn of(model: &RobotModel) -> Result<Self, PhysicsError> {
        let settings = &model.settings;
        let two =
            |names: &[String]| <[String; 2]>::try_from(names.to_vec()).map_err(|got| PhysicsError::BadGripper { got });
        let gripper = &settings.gripper;
        Ok(Self {
            kinematics: model.kinematics.clone(),
            base_link: settings.base.link.clone(),
            drive: BaseDrive {
                max_force_n: settings.base.max_drive_force_n,
                max_torque_nm: settings.base.max_turn_torque_nm,
                max_speed_m_per_s: settings.base.max_speed_m_per_s,
                max_turn_rad_per_s: settings.base.max_turn_rate_rad_per_s,
            },
            fingers: FingerPair {
                joints: two(&gripper.joints)?,
                links: two(&gripper.finger_links)?,
                friction: gripper.finger_friction,
                max_force_n: gripper.max_force_n,
            },
            ignored_pairs: settings.collision.ignored_pairs.clone(),
        })
    }

    /// The movable joints, parents before children.
    ///
    /// # Errors
    /// [`PhysicsError::Mimic`] for joints that follow another one, [`PhysicsError::NoLimits`] for joints whose speed or
    /// effort has no limit.
    pub fn moving_joints(&self) -> Result<Vec<MovingJoint>, PhysicsError> {
        let mut moving = Vec::new();
        for joint in self.kinematics.joints.iter().filter(|joint| joint.kind != JointKind::Fixed) {
            if let Drive::Variable { variable, .. } = joint.drive
                && *self.kinematics.variables[variable] != *joint.name
            {
                let master = self.kinematics.variables[variable].to_string();
                return Err(PhysicsError::Mimic { joint: joint.name.clone(), master });
            }
            if !joint.limits.velocity.is_finite() || !joint.limits.effort.is_finite() {
                return Err(PhysicsError::NoLimits { joint: joint.name.clone() });
            }
            moving.push(MovingJoint {
                name: joint.name.clone(),
                prismatic: joint.kind == JointKind::Prismatic,
                lower: joint.limits.lower,
                upper: joint.limits.upper,
                max_speed: joint.limits.velocity,
                max_effort: joint.limits.effort,
            });
        }
        Ok(moving)
    }

    /// Index of a link.
    ///
    /// # Errors
    /// [`PhysicsError::NoLink`] when the URDF has none of that name.
    pub fn get_link(&self, name: &str) -> Result<usize, PhysicsError> {
        self.kinematics.find_link(name).map(|link| link.0).ok_or_else(|| PhysicsError::NoLink {
            name: name.into(),
            known: self.kinematics.links.iter().map(|link| link.name.clone()).collect(),
        })
    }

    /// Indices of the fingers' joints among `joints`.
    ///
    /// # Errors
    /// [`PhysicsError::NoJoint`] when they do not move.
    pub fn finger_joints(&self, joints: &[MovingJoint]) -> Result<[usize; 2], PhysicsError> {
        let [left, right] = &self.fingers.joints;
        Ok([get_joint(joints, left)?, get_joint(joints, right)?])
    }

    /// Indices of the links of the fingers.
    ///
    /// # Errors
    /// [`PhysicsError::NoLink`] when the URDF lacks one.
    pub fn finger_links(&self) -> Result<[usize; 2], PhysicsError> {
        let [left, right] = &self.fingers.links;
        Ok([self.get_link(left)?, self.get_link(right)?])
    }

    /// Pairs of link indices, lesser first, that never collide.
    ///
    /// # Errors
    /// [`PhysicsError::NoLink`] when the URDF lacks one.
    pub fn ignored_links(&self) -> Result<BTreeSet<(usize, usize)>, PhysicsError> {
        let pair = |[a, b]: &[String; 2]| {
            let (a, b) = (self.get_link(a)?, self.get_link(b)?);
            Ok((a.min(b), a.max(b)))
        };
        self.ignored_pairs.iter().map(pair).collect()
    }

    /// The joints' values at the start, in the order of `joints`.
    ///
    /// # Errors
    /// [`PhysicsError`] for unknown joints and values outside their limits.
    pub fn start_positions(&self, joints: &[MovingJoint], start: &RobotStart) -> Result<Vec<f64>, PhysicsError> {
        let mut positions: Vec<f64> = joints.iter().map(|joint| 0.0_f64.clamp(joint.lower, joint.upper)).collect();
        for (name, value) in &start.joints {
            let index = get_joint(joints, name)?;
            let MovingJoint { lower, upper, .. } = joints[index];
            if !(lower..=upper).contains(value) {
                let expected = format!("{lower} to {upper}");
                return Err(PhysicsError::OutOfRange { name: name.clone(), value: *value, expected });
            }
            positions[index] = *value;
        }
        Ok(positions)
    }

    /// Checks that forces, speeds and friction are in range.
    ///
    /// # Errors
    /// [`PhysicsError::OutOfRange`].
    pub fn check(&self) -> Result<(), PhysicsError> {
        let positive = [
            ("max_drive_force_n", self.drive.max_force_n, f64::INFINITY),
            ("max_turn_torque_nm", self.drive.max_torque_nm, f64::INFINITY),
            ("max_speed_m_per_s", self.drive.max_speed_m_per_s, f64::INFINITY),
            ("max_turn_rate_rad_per_s", self.drive.max_turn_rad_per_s, f64::INFINITY),
            ("finger_friction", self.fingers.friction, 1.0),
            ("gripper.max_force_n", self.fingers.max_force_n, 40.0),
        ];
        for (name, value, highest) in positive {
            if !(value > 0.0 && value <= highest) {
                let expected = format!("above 0 and at most {highest}");
                return Err(PhysicsError::OutOfRange { name: name.into(), value, expected });
            }
        }
        Ok(())
    }
}

fn get_joint(joints: &[MovingJoint], name: &str) -> Result<usize, PhysicsError> {
    joints.iter().position(|joint| joint.name == name).ok_or_else(|| PhysicsError::NoJoint {
        name: name.into(),
        known: joints.iter().map(|joint| joint.name.clone()).collect(),
    })
}
