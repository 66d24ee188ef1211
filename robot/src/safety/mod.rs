//! The safety envelope: it wraps any robot, implements the same traits, and lets only what is safe through.
//!
//! ```text
//! command ──caps: depth, people, area──▶ limits: v, a, position, force ──▶ driver
//!                                            ▲ brakes
//! senses ──watches: finite, joints, stamps, silence, jumps──▶ SafetyState ◀── stop: command, switch, the robot's own
//! ```
//!
//! - Velocities, accelerations, joint positions (with the way needed to brake), grip width and force are clamped; the
//!   answer to a command is what was sent. Values that are not finite and commands to the wrong joints are refused.
//! - A part that moves and hears nothing for 0.1 s brakes at its acceleration limit.
//! - The base can always stop before what the cameras measured a moment ago, is slow near people, and stays in its area.
//! - A part that fails, a measurement that cannot be true, a sense that is silent while the robot moves, or the emergency
//!   stop: everything brakes together, as [`SafetyState`] says. Its table is the whole of it.
//!
//! Simulation and hardware are limited by this same code. Braking happens while time passes, in `wait_until`; whoever
//! does not let time pass any more leaves the robot to the watchdog that each driver has by contract
//! ([`crate::drivers`]).

mod area;
mod brake;
mod caps;
mod core;
mod depth;
mod guard;
mod joint_watch;
mod parts;
mod people;
mod place_watch;
pub mod settings;
mod state;
mod switch;

pub use state::{Cause, Event, Part, Release, SafetyState};
pub use switch::StopSwitch;

use self::core::Core;
use crate::drivers::{Base, Cameras, Clock, EmergencyStop, Gripper, JointGroup, Localisation, Robot};
use crate::model::RobotModel;
use dsm::geometry::OrientedBox;
use dsm::time::{Span, Stamp};
use nalgebra::Point3;
use std::sync::Arc;

/// Step in which braking commands are sent while time passes; also the least time between commands that may change
/// velocities.
pub const PERIOD: Span = Span(10_000_000);
/// However long ago the last command was, a velocity jumps at most by the acceleration over this time.
pub const LONGEST_STEP: Span = Span(50_000_000);

/// How often commands had to be corrected or refused, and the robot stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LimitReport {
    /// Base commands beyond a speed limit.
    pub base_speed: u64,
    /// Base commands beyond an acceleration limit.
    pub base_acceleration: u64,
    /// Base commands too fast for what the cameras measured.
    pub near_things: u64,
    /// Commands too fast for how near people are.
    pub near_people: u64,
    /// Commands that would have left the area of base or tool.
    pub area: u64,
    /// Joint commands beyond a velocity limit.
    pub joint_velocity: u64,
    /// Joint commands beyond an acceleration limit or the room left to brake before a position limit.
    pub joint_acceleration_or_position: u64,
    /// Gripper commands beyond its width or force.
    pub gripper: u64,
    /// Commands refused: not finite, wrong joints, or stopped.
    pub refused: u64,
    /// Times a part braked because it heard nothing.
    pub timeouts: u64,
    /// Times all braked until a cause was gone.
    pub holds: u64,
    /// Times all braked until a reset.
    pub stops: u64,
}

/// What a task may tell the envelope, and learn of it. A task cannot widen it.
pub trait Safety: Send {
    /// The present state.
    fn state(&self) -> &SafetyState;
    /// What was corrected so far.
    fn report(&self) -> LimitReport;
    /// Says where people are at `stamp`, base frame, metres; replaces who was told of before.
    fn note_people(&mut self, stamp: Stamp, people_in_base: &[Point3<f64>]);
    /// Says what the hand holds, as a box in the tool frame: the cameras see it as a part of the robot.
    fn note_held(&mut self, held_in_tool: Option<OrientedBox>);
}

/// A robot within its envelope.
pub struct Envelope<R: Robot> {
    parts: Arm<R>,
}

/// The arm's view of the core.
struct Arm<R: Robot>(Head<R>);

/// The head's view of the core: arm and head are the same kind of part, so each needs a type of its own.
struct Head<R: Robot>(Core<R>);

impl<R: Robot> Envelope<R> {
    /// Wraps `robot` in the limits of its model. The robot counts as standing still.
    pub fn new(robot: R, model: &Arc<RobotModel>) -> Self {
        Self { parts: Arm(Head(Core::new(robot, model))) }
    }

    /// Lets a switch stop the robot.
    pub fn with_stop_switch(mut self, switch: StopSwitch) -> Self {
        self.core_mut().switch = switch;
        self
    }

    /// The robot inside.
    pub fn inner(&self) -> &R {
        &self.parts.0.0.robot
    }

    /// The robot inside, for whoever injects faults into it.
    pub fn inner_mut(&mut self) -> &mut R {
        &mut self.core_mut().robot
    }

    fn core_mut(&mut self) -> &mut Core<R> {
        &mut self.parts.0.0
    }
}

impl<R: Robot> Safety for Envelope<R> {
    fn state(&self) -> &SafetyState {
        &self.parts.0.0.state
    }
    fn report(&self) -> LimitReport {
        self.parts.0.0.report
    }
    fn note_people(&mut self, stamp: Stamp, people_in_base: &[Point3<f64>]) {
        self.core_mut().note_people(stamp, people_in_base);
    }
    fn note_held(&mut self, held_in_tool: Option<OrientedBox>) {
        self.core_mut().note_held(held_in_tool);
    }
}

impl<R: Robot> Robot for Envelope<R> {
    fn base(&mut self) -> &mut dyn Base {
        self.core_mut()
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        &mut self.parts
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        self.core_mut()
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        &mut self.parts.0
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        self.core_mut()
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        self.core_mut()
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self.core_mut()
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        self.core_mut()
    }
    fn safety(&mut self) -> Option<&mut dyn Safety> {
        Some(self)
    }
}
