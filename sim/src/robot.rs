//! The simulated robot: driver traits over physics and cameras.
//!
//! ```text
//! command ──▶ parts (latched) ──wait_until──▶ Physics.step ──tick──▶ measured states, captures, truth
//! ```
//!
//! Commands wait in the parts until time passes; [`Clock::wait_until`] latches them at every control tick, steps
//! physics and refreshes what the parts measure. Reading a part changes nothing. Images are rendered when they are
//! read, from the poses at the moment of their capture.

mod cameras;
mod delay;
mod localise;
mod parts;

pub use cameras::{CaptureRequest, Imager, SensorImage};
pub use localise::{LocalisationConfig, LocalisationNoise};

use crate::disturb::{Conditions, Disturber};
use crate::physics::{JointTarget, Physics};
use cameras::SimCameras;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, JointGroup, Localisation, Robot, Twist,
};
use dsm_robot::model::RobotModel;
use localise::SimLocalisation;
use parts::{SimBase, SimGripper, SimGroup, SimStop, scaled};
use thiserror::Error;

/// Why model and physics do not make a robot.
#[derive(Debug, Error, PartialEq)]
pub enum SimRobotError {
    /// The model names a joint that physics does not move.
    #[error("the simulated robot has no joint `{joint}`; it has {known:?}")]
    NoJoint {
        /// The joint.
        joint: String,
        /// The joints of the simulated robot.
        known: Vec<String>,
    },
    /// The model names a camera frame that physics does not have.
    #[error("camera `{camera}`: the simulated robot has no link `{frame}`")]
    NoFrame {
        /// The camera.
        camera: String,
        /// Its frame.
        frame: String,
    },
    /// The control period is not a whole number of physics steps.
    #[error("the control period of {period_s} s is not a multiple of the physics step of {step_s} s")]
    Step {
        /// Control period.
        period_s: f64,
        /// Physics step.
        step_s: f64,
    },
}

/// Called after every control tick with the true state of the world: for judging and for truth in logs.
pub type TickObserver = Box<dyn FnMut(&dyn Physics) + Send>;

/// Period of control: commands are latched and states measured this often.
pub const CONTROL_PERIOD: Span = Span(10_000_000);

/// A robot in the simulated world.
pub struct SimRobot {
    physics: Box<dyn Physics>,
    base: SimBase,
    arm: SimGroup,
    head: SimGroup,
    gripper: SimGripper,
    cameras: SimCameras,
    localisation: SimLocalisation,
    stop: SimStop,
    /// Steps in a control period, and steps until the next tick.
    steps_per_tick: u32,
    steps_to_tick: u32,
    disturber: Option<Disturber>,
    conditions: Conditions,
    observer: Option<TickObserver>,
}

impl SimRobot {
    /// The robot `model` in `physics`, seeing through `imager`. Time starts at the present moment of `physics`.
    ///
    /// # Errors
    /// [`SimRobotError`] when joints or frames of the model are missing in physics or the step does not divide the
    /// control period.
    pub fn new(
        physics: Box<dyn Physics>,
        model: &RobotModel,
        imager: Box<dyn Imager>,
        localisation: LocalisationConfig,
    ) -> Result<Self, SimRobotError> {
        let step = physics.step_length();
        if step.0 <= 0 || CONTROL_PERIOD.0 % step.0 != 0 {
            return Err(SimRobotError::Step { period_s: CONTROL_PERIOD.as_s(), step_s: step.as_s() });
        }
        let steps_per_tick = (CONTROL_PERIOD.0 / step.0) as u32;
        let mut robot = Self {
            base: SimBase::new(model.settings.base.max_speed_m_per_s, model.settings.base.max_turn_rate_rad_per_s),
            arm: SimGroup::new(&model.arm, model.settings.latency.joints_s, physics.as_ref())?,
            head: SimGroup::new(&model.head, model.settings.latency.joints_s, physics.as_ref())?,
            gripper: SimGripper::new(model, physics.as_ref())?,
            cameras: SimCameras::new(model, physics.as_ref(), imager, localisation.seed)?,
            localisation: SimLocalisation::new(localisation, physics.now(), physics.world_from_base())
                .heard_after(model.settings.latency.localisation_s),
            stop: SimStop::default(),
            steps_per_tick,
            steps_to_tick: steps_per_tick,
            disturber: None,
            conditions: Conditions::default(),
            observer: None,
            physics,
        };
        robot.measure();
        Ok(robot)
    }

    /// Lets an observer see the world after every control tick.
    pub fn with_observer(mut self, observer: TickObserver) -> Self {
        self.observer = Some(observer);
        self
    }

    /// Lets the world be disturbed.
    pub(crate) fn with_disturber(mut self, disturber: Disturber) -> Self {
        self.disturber = Some(disturber);
        self
    }

    /// The world, for judging and for tests.
    pub fn physics(&self) -> &dyn Physics {
        self.physics.as_ref()
    }

    /// Sends the latched commands to the motors.
    fn actuate(&mut self) {
        let stopped = self.stop.find_reason().is_some();
        let now = self.physics.now();
        let twist = if stopped { Twist::default() } else { self.base.twist_at(now) };
        self.physics.command_base(scaled(twist, self.conditions.grip));
        for group in [&mut self.arm, &mut self.head] {
            for (joint, velocity) in group.commands_at(now) {
                let velocity = if stopped { 0.0 } else { velocity };
                self.physics.command_joint(joint, JointTarget::Velocity(velocity));
            }
        }
        // A stopped gripper keeps its grip.
        for (joint, target) in self.gripper.commands() {
            self.physics.command_joint(joint, target);
        }
    }

    /// Refreshes what the parts measure.
    fn measure(&mut self) {
        let physics = self.physics.as_ref();
        self.base.measure(physics, self.conditions.grip);
        self.arm.measure(physics);
        self.head.measure(physics);
        self.gripper.measure(physics);
    }

    /// What happens once in a control period.
    fn tick(&mut self) {
        self.measure();
        self.localisation.tick(self.physics.now(), &self.physics.world_from_base(), self.conditions.grip);
        if let Some(disturber) = &mut self.disturber {
            self.conditions = disturber.advance(self.physics.as_mut());
            self.localisation.set_jump(self.conditions.jump);
        }
        let believed = self.localisation.world_from_base_now();
        self.cameras.tick(self.physics.as_ref(), &believed, &self.conditions);
        if let Some(observer) = &mut self.observer {
            observer(self.physics.as_ref());
        }
    }
}

impl Clock for SimRobot {
    fn now(&self) -> Stamp {
        self.physics.now()
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        while self.physics.now() < stamp {
            if self.steps_to_tick == self.steps_per_tick {
                self.actuate();
            }
            self.physics.step();
            self.steps_to_tick -= 1;
            if self.steps_to_tick == 0 {
                self.steps_to_tick = self.steps_per_tick;
                self.tick();
            }
        }
        Ok(())
    }
}

impl Robot for SimRobot {
    fn base(&mut self) -> &mut dyn Base {
        self.base.stopped = self.stop.find_reason();
        &mut self.base
    }

    fn arm(&mut self) -> &mut dyn JointGroup {
        self.arm.stopped = self.stop.find_reason();
        &mut self.arm
    }

    fn gripper(&mut self) -> &mut dyn Gripper {
        self.gripper.stopped = self.stop.find_reason();
        &mut self.gripper
    }

    fn head(&mut self) -> &mut dyn JointGroup {
        self.head.stopped = self.stop.find_reason();
        &mut self.head
    }

    fn cameras(&mut self) -> &mut dyn Cameras {
        &mut self.cameras
    }

    fn localisation(&mut self) -> &mut dyn Localisation {
        &mut self.localisation
    }

    fn clock(&mut self) -> &mut dyn Clock {
        self
    }

    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        &mut self.stop
    }
}
