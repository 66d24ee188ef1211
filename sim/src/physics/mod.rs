//! Physics behind one trait.
//!
//! ```text
//! SceneModel + RobotBody ──Engine::build──▶ Physics ──step──▶ poses, joint states, contacts
//!               joint targets, base twist ────▲
//! ```
//!
//! The robot is one articulated body: three force-limited drives move its base over the floor (x, y and yaw), motors
//! with the URDF's effort limits move its joints. Nothing is ever attached, snapped or teleported: what the gripper
//! holds, it holds by friction.

mod convert;
mod drive;
mod hands;
mod inertia;
mod motors;
mod rapier;
mod robot_body;
mod robot_spec;
mod scene_body;
mod scene_joint;
mod settle;
mod shapes;
mod spin;

pub(crate) use convert::{from_vector, to_pose};
pub use inertia::{BodyInertia, body_inertia};
pub use motors::{Motors, Setpoint};
pub use rapier::{Rapier, RapierPhysics};
pub use robot_spec::{BaseDrive, FingerPair, LINK_FRICTION, MovingJoint, RobotBody, RobotStart};
pub(crate) use settle::settle_scene;
pub(crate) use shapes::scene_shape;

use crate::scene::SceneModel;
use dsm::Pose;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::{JointNames, JointPositions, JointVelocities};
use nalgebra::{Point3, Vector3};
use thiserror::Error;

/// Standard gravity, m/s^2.
pub const GRAVITY_M_PER_S2: f64 = 9.80665;
/// Rolling and air resistance as damping of free bodies, 1/s: without it a round fruit would roll for ever.
pub const LINEAR_DAMPING_PER_S: f64 = 0.05;
/// The same for turning, 1/s.
pub const ANGULAR_DAMPING_PER_S: f64 = 1.0;
/// Thickness of the slab that stands for a bounded plane, metres.
pub const SLAB_M: f64 = 0.1;

/// What a contact is between.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactParty {
    /// A body of the scene: index into `SceneModel::bodies`.
    Body(usize),
    /// A link of the robot: index into [`Physics::link_names`].
    Link(usize),
}

/// Two things that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The lesser party.
    pub first: ContactParty,
    /// The greater party.
    pub second: ContactParty,
    /// Sum of the normal forces over the last step, newtons.
    pub force_n: f64,
    /// Deepest penetration, metres; 0 when they merely touch.
    pub depth_m: f64,
    /// Where the deepest contact is, in the world frame.
    pub point_in_world: Point3<f64>,
}

/// Velocity of a body in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyVelocity {
    /// Of its centre of mass, metres per second.
    pub linear_m_per_s: Vector3<f64>,
    /// Radians per second.
    pub angular_rad_per_s: Vector3<f64>,
}

/// What a joint's motor is to do until told otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointTarget {
    /// Follow a velocity (rad/s or m/s); the position target is its integral, so that nothing sags or creeps.
    Velocity(f64),
    /// Move to a position at the given speed, pushing no harder than the given effort.
    Position {
        /// Goal in radians or metres.
        position: f64,
        /// Speed of approach, rad/s or m/s.
        speed: f64,
        /// Effort bound in newtons or newton metres; the URDF's limit also holds.
        max_effort: f64,
    },
}

/// Why a world cannot be simulated.
#[derive(Debug, Error, PartialEq)]
pub enum PhysicsError {
    /// The URDF or the configuration names a link that does not exist.
    #[error("no link `{name}` in the URDF; links are {known:?}")]
    NoLink {
        /// The name asked for.
        name: String,
        /// The links that exist.
        known: Vec<String>,
    },
    /// The configuration names a joint that the URDF does not move.
    #[error("no movable joint `{name}` in the URDF; movable joints are {known:?}")]
    NoJoint {
        /// The name asked for.
        name: String,
        /// The joints that exist.
        known: Vec<String>,
    },
    /// A joint that follows another one.
    #[error("joint `{joint}` mimics `{master}`; mimic joints cannot be simulated yet")]
    Mimic {
        /// The joint.
        joint: String,
        /// What it follows.
        master: String,
    },
    /// A joint whose motor has no bounds.
    #[error(
        "joint `{joint}` has no velocity or no effort limit in the URDF; expected both > 0, or `locked_joints` to hold it"
    )]
    NoLimits {
        /// The joint.
        joint: String,
    },
    /// A shape without volume, or a mesh that has no hull.
    #[error("{owner}: {reason}")]
    BadShape {
        /// Body or link.
        owner: String,
        /// What is wrong.
        reason: String,
    },
    /// A free body or moving link without mass.
    #[error("`{name}` moves and needs a mass above 0, got {mass_kg} kg")]
    NoMass {
        /// Body or link.
        name: String,
        /// What was given.
        mass_kg: f64,
    },
    /// The gripper is not a parallel gripper of two fingers.
    #[error("the gripper needs exactly two finger joints and two finger links, got {got:?}")]
    BadGripper {
        /// The joints or links given.
        got: Vec<String>,
    },
    /// The engine refuses the world.
    #[error("{engine}: {reason}")]
    Refused {
        /// The engine.
        engine: &'static str,
        /// What it says.
        reason: String,
    },
    /// A parameter out of its range.
    #[error("{name} = {value} is out of range: {expected}")]
    OutOfRange {
        /// Which parameter.
        name: String,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: String,
    },
}

/// Parameters of rapier. The defaults were measured by `examples/spike.rs`: the cheapest setting that holds every object
/// of the table with less than 6 mm of slip, 5 degrees of turning between the pads and 0.5 mm of tool error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhysicsConfig {
    /// Length of a step; default 5 ms, range 0.5 to 5 ms. A multiple of it must make the control period.
    pub step: Span,
    /// Solver iterations (substeps) of a step; default 4, range 1 to 32.
    pub solver_iterations: usize,
    /// Sweeps over all constraints in each of them; default 8, range 1 to 8.
    pub sweeps: usize,
}

impl Default for PhysicsConfig {
    fn default() -> Self {
        Self { step: Span(5_000_000), solver_iterations: 4, sweeps: 8 }
    }
}

/// What makes worlds: which engine runs, and its parameters.
pub trait Engine: std::fmt::Debug + Send + Sync {
    /// Puts the scene and the robot into a world of this engine.
    ///
    /// # Errors
    /// [`PhysicsError`] for shapes without volume, free bodies without mass, unknown links or joints, values out of
    /// range.
    fn build(
        &self,
        scene: &SceneModel,
        robot: &RobotBody,
        start: &RobotStart,
    ) -> Result<Box<dyn Physics>, PhysicsError>;

    /// Leaves the scene to itself for `span`, without a robot, and gives the poses of its bodies in their order.
    ///
    /// # Errors
    /// As [`Engine::build`].
    fn settle(&self, scene: &SceneModel, span: Span) -> Result<Vec<Pose>, PhysicsError>;
}

/// A world in motion. Only [`Physics::step`] changes it; reading never does.
pub trait Physics: Send {
    /// Simulated time.
    fn now(&self) -> Stamp;
    /// Length of a step.
    fn step_length(&self) -> Span;
    /// Lets one step pass.
    fn step(&mut self);

    /// Number of scene bodies.
    fn body_count(&self) -> usize;
    /// Pose of the scene body with this index in `SceneModel::bodies`.
    fn world_from_body(&self, body: usize) -> Pose;
    /// Velocity of a scene body.
    fn body_velocity(&self, body: usize) -> BodyVelocity;

    /// Names of the robot's links, fixed frames included, in URDF order.
    fn link_names(&self) -> &[String];
    /// Pose of a link.
    fn world_from_link(&self, link: usize) -> Pose;
    /// Pose of the base link on the floor.
    fn world_from_base(&self) -> Pose;
    /// Velocity of the base in its own frame.
    fn base_velocity(&self) -> Twist;
    /// Sets the velocity that the wheels drive at until the next command.
    fn command_base(&mut self, twist: Twist);

    /// Names of the movable joints in URDF order.
    fn joint_names(&self) -> &JointNames;
    /// Their positions.
    fn joint_positions(&self) -> JointPositions;
    /// Their velocities.
    fn joint_velocities(&self) -> JointVelocities;
    /// Effort that the motor of a joint applied during the last step, newtons or newton metres.
    fn joint_effort(&self, joint: usize) -> f64;
    /// Sets what a joint's motor does, by index into [`Physics::joint_names`].
    fn command_joint(&mut self, joint: usize, target: JointTarget);

    /// Everything that touches something, sorted by the parties. Links that may overlap are left out.
    fn contacts(&self) -> Vec<Contact>;
    /// Force between the fingers and what they hold: the smaller of the two sides, newtons; 0 when nothing is held.
    fn grip_force_n(&self) -> f64;

    /// What changes bodies from outside while the world runs; `None` when this engine has no such thing.
    fn hands(&mut self) -> Option<&mut dyn Hands> {
        None
    }

    /// Index of a link by name.
    fn find_link(&self, name: &str) -> Option<usize> {
        self.link_names().iter().position(|n| n == name)
    }
    /// Index of a joint by name.
    fn find_joint(&self, name: &str) -> Option<usize> {
        self.joint_names().iter().position(|n| &**n == name)
    }
}

/// Changes bodies of a world from outside, as somebody who is no robot would. Only disturbances do that.
pub trait Hands {
    /// Puts a scene body somewhere else, at rest.
    fn put_body(&mut self, body: usize, world_from_body: &Pose);
    /// Takes a scene body out of the world for good.
    fn take_away(&mut self, body: usize);
    /// Gives a scene body a share of the friction that the scene says.
    fn set_friction_share(&mut self, body: usize, share: f64);
}
