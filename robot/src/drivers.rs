//! The traits behind which a robot stands: simulated, recorded or real.
//!
//! One [`Robot`] hands out its parts. Every command returns what was actually sent; reading never lets time pass.
//!
//! Each driver watches over itself: base and joints that hear nothing for [`DRIVER_TIMEOUT`] stop, so that a process that
//! is dead, hangs or is cut off leaves a robot that stands. `dsm drivers check` holds a driver to this and to the rest of
//! its contract ([`crate::conformance`]).

use crate::joints::{JointPositions, JointVelocities};
use crate::safety::Safety;
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::time::{Span, Stamp};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A driver whose base or joints hear nothing for this long stops them by itself.
pub const DRIVER_TIMEOUT: Span = Span(500_000_000);

/// Velocity of the base in its own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Forward speed in metres per second.
    pub forward_m_per_s: f64,
    /// Turning speed about +z in radians per second.
    pub turn_rad_per_s: f64,
}

/// State of a group of joints at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct JointState {
    /// When it was measured.
    pub stamp: Stamp,
    /// Positions.
    pub positions: JointPositions,
    /// Velocities.
    pub velocities: JointVelocities,
}

/// State of the gripper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GripperState {
    /// When it was measured.
    pub stamp: Stamp,
    /// Free distance between the finger pads in metres.
    pub width_m: f64,
    /// Grip force in newtons (from the motor's effort).
    pub force_n: f64,
    /// Whether the fingers move.
    pub moving: bool,
}

/// A pose with the moment it holds for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StampedPose {
    /// The moment.
    pub stamp: Stamp,
    /// The pose.
    pub pose: Pose,
}

/// Why a driver could not do what was asked.
#[derive(Clone, Debug, Error, PartialEq, Serialize, Deserialize)]
pub enum DriverError {
    /// The emergency stop is latched.
    #[error("the emergency stop is latched: {reason}")]
    Stopped {
        /// What latched it.
        reason: String,
    },
    /// The command names joints that this part does not have, or in another order.
    #[error("expected joints {expected:?}, got {got:?}")]
    WrongJoints {
        /// The joints of this part.
        expected: Vec<String>,
        /// The joints of the command.
        got: Vec<String>,
    },
    /// A value is not finite.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which value.
        what: String,
    },
    /// There is no such camera.
    #[error("no camera `{name}`; the robot has {known:?}")]
    NoCamera {
        /// The name asked for.
        name: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// The connection to the robot or the world is lost.
    #[error("{part} does not answer: {reason}")]
    Lost {
        /// Which part.
        part: String,
        /// Why.
        reason: String,
    },
}

/// The mobile base.
pub trait Base: Send {
    /// Commands a velocity until the next command; returns what was sent. A base that hears nothing for 0.5 s stops.
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError>;
    /// The measured velocity.
    fn velocity(&mut self) -> Result<Twist, DriverError>;
}

/// A group of joints that follows velocities: the arm (with its lift) or the head.
pub trait JointGroup: Send {
    /// Commands velocities until the next command; returns what was sent. Joints that hear nothing for 0.5 s stop.
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError>;
    /// The measured state.
    fn state(&mut self) -> Result<JointState, DriverError>;
}

/// A parallel gripper.
pub trait Gripper: Send {
    /// Moves to a width with at most the given force; returns the (width, force) sent.
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError>;
    /// The measured state.
    fn state(&mut self) -> Result<GripperState, DriverError>;
}

/// The cameras.
pub trait Cameras: Send {
    /// Names of the cameras.
    fn names(&self) -> Vec<String>;
    /// The newest frame of a camera that was not read yet, if any. Frames are rendered when read.
    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError>;
}

/// Where the robot believes it is.
pub trait Localisation: Send {
    /// `world_from_base`, globally consistent; it may jump.
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError>;
    /// `odom_from_base`, smooth; it drifts.
    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError>;
}

/// The only thing that lets time pass.
pub trait Clock: Send {
    /// The present moment.
    fn now(&self) -> Stamp;
    /// Lets time pass until `stamp`: the simulator steps, hardware waits, a replay advances.
    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError>;
}

/// The emergency stop, latched until reset.
pub trait EmergencyStop: Send {
    /// Stops all motion now and stays stopped.
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError>;
    /// The reason when latched.
    fn find_reason(&self) -> Option<String>;
    /// Releases the latch.
    fn reset(&mut self) -> Result<(), DriverError>;
}

/// A mobile manipulator: one object that hands out its parts.
pub trait Robot: Send {
    /// The base.
    fn base(&mut self) -> &mut dyn Base;
    /// The arm with its lift, in the order of the robot model's arm group.
    fn arm(&mut self) -> &mut dyn JointGroup;
    /// The gripper.
    fn gripper(&mut self) -> &mut dyn Gripper;
    /// The pan-tilt head.
    fn head(&mut self) -> &mut dyn JointGroup;
    /// The cameras.
    fn cameras(&mut self) -> &mut dyn Cameras;
    /// Localisation.
    fn localisation(&mut self) -> &mut dyn Localisation;
    /// The clock.
    fn clock(&mut self) -> &mut dyn Clock;
    /// The emergency stop.
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop;
    /// The safety envelope, when this robot has one around it.
    fn safety(&mut self) -> Option<&mut dyn Safety> {
        None
    }
}

impl<R: Robot + ?Sized> Robot for Box<R> {
    fn base(&mut self) -> &mut dyn Base {
        (**self).base()
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        (**self).arm()
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        (**self).gripper()
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        (**self).head()
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        (**self).cameras()
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        (**self).localisation()
    }
    fn clock(&mut self) -> &mut dyn Clock {
        (**self).clock()
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        (**self).emergency_stop()
    }
    fn safety(&mut self) -> Option<&mut dyn Safety> {
        (**self).safety()
    }
}
