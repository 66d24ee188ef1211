//! What physics must know of a robot.

use super::PhysicsError;
use dsm_robot::model::RobotModel;
use urdf_rs::Robot as Urdf;

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

/// What physics must know of a robot: the URDF and what the URDF cannot say.
#[derive(Clone, Debug)]
pub struct RobotBody {
    /// Links, joints, limits, masses and collision shapes.
    pub urdf: Urdf,
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
    /// What physics must know of a loaded robot; reads its URDF again.
    ///
    /// # Errors
    /// [`PhysicsError::Unreadable`] when the URDF cannot be read, [`PhysicsError::BadGripper`] unless the gripper has
    /// exactly two fingers.
    pub fn load(model: &RobotModel) -> Result<Self, PhysicsError> {
        let settings = &model.settings;
        let file = model.file.with_file_name(&settings.urdf);
        let urdf = urdf_rs::read_file(&file)
            .map_err(|error| PhysicsError::Unreadable { file: file.clone(), reason: error.to_string() })?;
        let two =
            |names: &[String]| <[String; 2]>::try_from(names.to_vec()).map_err(|got| PhysicsError::BadGripper { got });
        let gripper = &settings.gripper;
        Ok(Self {
            urdf,
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
}
