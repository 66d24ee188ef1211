//! The loop of the system: command, let time pass, look, learn.
//!
//! Skills are plain functions that call [`Agent::tick`] until they are done. Every tick is one control period; planning
//! and perception run beside it and show at a declared latency.

mod senses;

use crate::deferred::{Deferred, Waiting};
use crate::error::TaskError;
pub use crate::gaze::Gaze;
use crate::gaze::View;
use crate::journal::{Journal, Moment, SentCommands};
use crate::light::Light;
use crate::pace::{Pace, Posture};
use crate::perception::Perception;
use crate::pose_watch::PoseWatch;
use crate::touch::{Motion, Touch};
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::geometry::OrientedBox;
use dsm::map::{Map, ObjectId};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DriverError, JointState, Robot, Twist};
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::{Configuration, RobotModel};
use dsm_robot::nav::{LiveConfig, LiveObstacles};
use dsm_robot::safety::Cause;
use nalgebra::{Point2, Vector3};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Why a skill was cut short from outside.
#[derive(Debug)]
pub enum Halt {
    /// The simulated time limit of the episode.
    TimeUp,
    /// Ctrl-C.
    Interrupted,
    /// The emergency stop, or a driver that fails.
    Stopped(DriverError),
    /// The program itself.
    Failed(TaskError),
}

impl From<DriverError> for Halt {
    fn from(error: DriverError) -> Self {
        Self::Stopped(error)
    }
}

impl From<TaskError> for Halt {
    fn from(error: TaskError) -> Self {
        Self::Failed(error)
    }
}

/// Parameters of the loop.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentConfig {
    /// Control period; default 10 ms.
    pub period: Span,
    /// A frame's map shows this long after the frame; default 0.2 s.
    pub mapping_latency: Span,
    /// A plan shows this long after it is asked for; default 0.1 s.
    pub planning_latency: Span,
    /// What happens to results that are later than that; default: time waits for them.
    pub waiting: Waiting,
    /// Proportional gain of the head, 1/s; default 4.
    pub head_gain_per_s: f64,
    /// What counts as an obstacle in a single frame.
    pub live: LiveConfig,
}

impl Default for AgentConfig {
    fn default() -> Self {
        Self {
            period: Span(10_000_000),
            mapping_latency: Span(200_000_000),
            planning_latency: Span(100_000_000),
            waiting: Waiting::default(),
            head_gain_per_s: 4.0,
            live: LiveConfig::default(),
        }
    }
}

/// A frame, and where the robot believed to be when it was read.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The frame.
    pub frame: Arc<RgbdFrame>,
    /// The believed pose of the base.
    pub world_from_base: Pose,
}

/// A robot with its senses and its map.
pub struct Agent {
    robot: Box<dyn Robot>,
    model: Arc<RobotModel>,
    config: AgentConfig,
    perception: Perception,
    map: Arc<Map>,
    deadline: Stamp,
    interrupted: Arc<AtomicBool>,
    on_tick: Box<dyn FnMut(Stamp)>,
    on_frame: OnFrame,
    /// Cameras that are read; the head's always is.
    pub watched: Vec<String>,
    /// Where the head looks.
    pub gaze: Gaze,
    grip: Option<(f64, f64)>,
    empty_handed: Arc<RobotModel>,
    held: Option<OrientedBox>,
    /// Where the base was held up by something that the map does not show, world frame.
    pub bumps: Vec<Point2<f64>>,
    /// When a drive last gave up before what stood in its way.
    pub held_up: Option<Stamp>,
    /// Objects that were moved since the last frame, and by what, world frame: what lies in a drawer goes with it.
    pub moved: Vec<(ObjectId, Vector3<f64>)>,
    /// Boxes through which the leaf of a door was moved since the last frame, world frame.
    pub swept: Vec<OrientedBox>,
    /// Objects that were found not to be where the map has them since the last frame.
    pub missed: Vec<ObjectId>,
    /// What the cameras measured around the base a moment ago.
    pub live: LiveObstacles,
    frames: BTreeMap<String, Seen>,
    pace: Pace,
    touch: Touch,
    watch: PoseWatch,
    light: Light,
    /// Why the envelope brakes, as far as it was noted.
    braking: Option<Cause>,
    /// Whether the envelope was told of people.
    people: bool,
    /// What happened, for the report.
    pub journal: Journal,
}

fn scaled(twist: Twist, share: f64) -> Twist {
    Twist { forward_m_per_s: share * twist.forward_m_per_s, turn_rad_per_s: share * twist.turn_rad_per_s }
}

fn most(velocities: &JointVelocities) -> f64 {
    velocities.values().iter().fold(0.0, |most, velocity| velocity.abs().max(most))
}

/// Is shown each frame.
pub type OnFrame = Box<dyn FnMut(&Moment<'_>)>;

/// What [`Agent::new`] needs.
pub struct Parts {
    /// The robot, with its limits.
    pub robot: Box<dyn Robot>,
    /// Its model.
    pub model: Arc<RobotModel>,
    /// Perception and mapping.
    pub perception: Perception,
    /// The map to begin with.
    pub map: Map,
    /// When the episode ends.
    pub deadline: Stamp,
    /// Set by Ctrl-C.
    pub interrupted: Arc<AtomicBool>,
    /// Called once a tick, after time has passed, with the present moment.
    pub on_tick: Box<dyn FnMut(Stamp)>,
    /// Called with each frame, before it is learned from.
    pub on_frame: OnFrame,
}

impl Agent {
    /// Puts the parts together.
    pub fn new(parts: Parts, config: AgentConfig) -> Self {
        Self {
            robot: parts.robot,
            empty_handed: parts.model.clone(),
            model: parts.model,
            config,
            perception: parts.perception,
            map: Arc::new(parts.map),
            deadline: parts.deadline,
            interrupted: parts.interrupted,
            on_tick: parts.on_tick,
            on_frame: parts.on_frame,
            watched: vec!["head".into()],
            gaze: Gaze::AHEAD,
            grip: None,
            held: None,
            bumps: Vec::new(),
            held_up: None,
            moved: Vec::new(),
            swept: Vec::new(),
            missed: Vec::new(),
            live: LiveObstacles::default(),
            frames: BTreeMap::new(),
            pace: Pace::default(),
            touch: Touch::default(),
            watch: PoseWatch::default(),
            light: Light::default(),
            braking: None,
            people: false,
            journal: Journal::default(),
        }
    }

    /// One control period: command, let time pass, look, learn.
    pub fn tick(&mut self, base: Twist, arm: &JointVelocities) -> Result<(), Halt> {
        // Whoever wants to end the run is heard first.
        if self.interrupted.load(Ordering::Relaxed) {
            return Err(Halt::Interrupted);
        }
        let now = self.now();
        if now >= self.deadline {
            return Err(Halt::TimeUp);
        }
        // Command.
        let head = self.head_velocities()?;
        let share = self.share_of(base, arm)?;
        let base = self.robot.base().command(scaled(base, share))?;
        let mut arm = arm.clone();
        if share < 1.0 {
            arm.values_mut().iter_mut().for_each(|velocity| *velocity *= share);
        }
        let arm = self.robot.arm().command(&arm)?;
        let head = self.robot.head().command(&head)?;
        let gripper = match self.grip {
            Some((width_m, force_n)) => Some(self.robot.gripper().command(width_m, force_n)?),
            None => None,
        };
        self.journal.note_commands(SentCommands { stamp: now, base, arm: arm.clone(), head, gripper });
        // Let time pass.
        self.robot.clock().wait_until(now + self.config.period)?;
        (self.on_tick)(self.robot.clock().now());
        // Feel.
        let measured = Motion { base: self.robot.base().velocity()?, arm: self.robot.arm().state()?.velocities };
        self.touch.note(&Motion { base, arm }, &measured, self.config.period.as_s());
        self.watch_pose()?;
        self.watch_safety();
        // Look.
        for i in 0..self.watched.len() {
            if let Some(frame) = self.robot.cameras().read(&self.watched[i])? {
                self.see(frame)?;
            }
        }
        // Learn.
        let now = self.now();
        while let Some(learned) = self.perception.find_learned(now)? {
            self.journal.note_learned(&learned);
            self.map = learned.map;
            self.tell_of_people()?;
        }
        self.sample(now)
    }

    /// The share of these velocities at which the arm is slow enough for what is near it; a tick sends no more.
    fn share_of(&mut self, base: Twist, arm: &JointVelocities) -> Result<f64, Halt> {
        if base == Twist::default() && arm.values().iter().all(|velocity| *velocity == 0.0) {
            return Ok(1.0);
        }
        let now = self.now();
        let due = self.pace.is_due(now);
        if !due && self.pace.is_free() {
            return Ok(1.0);
        }
        let configuration = self.configuration()?;
        if due {
            let world_from_base = self.world_from_base()?;
            let (model, held) = (&self.model, self.held.as_ref());
            let posture = Posture { model, configuration: &configuration, world_from_base: &world_from_base, held };
            self.pace.measure(now, &self.map, &self.live, &posture);
        }
        Ok(self.pace.share(&self.model, &configuration, base, arm))
    }

    /// Whether something has held up base or arm since this was last asked, and forgets it.
    pub fn take_touch(&mut self) -> bool {
        self.touch.take()
    }

    /// What the joints of the arm lag behind what was sent to them, radians or metres.
    pub(crate) fn joint_lags(&self) -> &[f64] {
        self.touch.joint_lags()
    }

    /// What a tick sends of a motion of the base alone.
    pub fn slowed(&mut self, base: Twist) -> Result<Twist, Halt> {
        let still = JointVelocities::zeros(&self.model.arm.joints);
        Ok(scaled(base, self.share_of(base, &still)?))
    }

    /// Whether the arm would touch something if the base drove on.
    pub fn is_close_ahead(&self) -> bool {
        self.pace.is_close_ahead()
    }

    /// Notes clearance and margins for the report, when that is due.
    fn sample(&mut self, now: Stamp) -> Result<(), Halt> {
        if self.journal.is_sample_due(now) {
            let position = Point2::from(self.world_from_base()?.translation.vector.xy());
            let speed_m_per_s = self.base_velocity()?.forward_m_per_s.abs();
            let radius_m = self.model.settings.base.footprint_radius_m;
            self.journal.note_sample(now, &self.map.free_space, &position, radius_m, speed_m_per_s);
        }
        Ok(())
    }

    /// Ticks without moving base or arm.
    pub fn rest(&mut self, duration: Span) -> Result<(), Halt> {
        let still = JointVelocities::zeros(&self.model.arm.joints);
        let end = self.now() + duration;
        while self.now() < end {
            self.tick(Twist::default(), &still)?;
        }
        Ok(())
    }

    /// Runs `plan` beside the loop while the robot stands still; its result shows after the declared planning latency.
    pub fn plan<T: Send + 'static>(&mut self, plan: impl FnOnce() -> T + Send + 'static) -> Result<T, Halt> {
        let mut deferred = self.plan_beside(plan);
        let still = JointVelocities::zeros(&self.model.arm.joints);
        loop {
            if let Some(result) = deferred.find(self.now()) {
                return Ok(result);
            }
            if !deferred.is_pending() {
                return Err(TaskError::Internal("a plan panicked".into()).into());
            }
            self.tick(Twist::default(), &still)?;
        }
    }

    /// Starts `plan`; the caller goes on ticking and asks for the result.
    pub fn plan_beside<T: Send + 'static>(&mut self, plan: impl FnOnce() -> T + Send + 'static) -> Deferred<T> {
        Deferred::start(self.now() + self.config.planning_latency, self.config.waiting, plan)
    }

    /// The present moment.
    pub fn now(&mut self) -> Stamp {
        self.robot.clock().now()
    }

    /// When the episode ends.
    pub fn deadline(&self) -> Stamp {
        self.deadline
    }

    /// Length of a control period.
    pub fn period(&self) -> Span {
        self.config.period
    }

    /// The newest map.
    pub fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// The robot's model.
    pub fn model(&self) -> &Arc<RobotModel> {
        &self.model
    }

    /// The newest frame of a camera.
    pub fn find_frame(&self, camera: &str) -> Option<&Seen> {
        self.frames.get(camera)
    }

    /// Notes an event of this moment with what the head camera saw last.
    pub fn note(&mut self, what: impl Into<String>) {
        let now_s = self.now().as_s();
        let frame = self.find_frame("head").map(|seen| seen.frame.clone());
        self.journal.note(now_s, what, frame.as_ref());
    }

    /// Notes an event of this moment without a picture.
    pub fn mark(&mut self, what: impl Into<String>) {
        let now_s = self.now().as_s();
        self.journal.note(now_s, what, None);
    }

    /// Sets what the gripper does until told otherwise: width in metres, greatest force in newtons.
    pub fn grip(&mut self, width_m: f64, max_force_n: f64) {
        self.grip = Some((width_m, max_force_n));
    }

    /// Says what the hand holds, as a box in the tool frame: it belongs to the robot from here on, is left out of the map
    /// and counts in collision checks. `None` when it holds nothing any more.
    pub fn hold(&mut self, held_in_tool: Option<OrientedBox>) {
        self.held = held_in_tool;
        self.model = match &self.held {
            Some(held) => Arc::new(self.empty_handed.holding(held)),
            None => self.empty_handed.clone(),
        };
        if let Some(safety) = self.robot.safety() {
            safety.note_held(self.held);
        }
    }

    /// What the hand holds, as a box in the tool frame.
    pub fn held(&self) -> Option<&OrientedBox> {
        self.held.as_ref()
    }

    /// The gripper's free width in metres, and whether the fingers move.
    pub fn grip_state(&mut self) -> Result<dsm_robot::drivers::GripperState, Halt> {
        Ok(self.robot.gripper().state()?)
    }

    /// Where the robot believes it is.
    pub fn world_from_base(&mut self) -> Result<Pose, Halt> {
        let now = self.now();
        Ok(self.watch.believed(now, &self.robot.localisation().world_from_base()?.pose))
    }

    /// Smooth pose that drifts, for short motions.
    pub fn odom_from_base(&mut self) -> Result<Pose, Halt> {
        Ok(self.robot.localisation().odom_from_base()?.pose)
    }

    /// Measured velocity of the base.
    pub fn base_velocity(&mut self) -> Result<Twist, Halt> {
        Ok(self.robot.base().velocity()?)
    }

    /// State of the arm.
    pub fn arm_state(&mut self) -> Result<JointState, Halt> {
        Ok(self.robot.arm().state()?)
    }

    /// Pan of the head to the left, radians.
    pub fn pan_rad(&mut self) -> Result<f64, Halt> {
        let pan = self.robot.head().state()?.positions.values().first().copied().unwrap_or(0.0);
        Ok(self.model.head_signs()[0] * pan)
    }

    /// All measured joints as one configuration of the model.
    pub fn configuration(&mut self) -> Result<Configuration, Halt> {
        let mut configuration = self.model.kinematics.zero();
        let arm = self.robot.arm().state()?;
        let head = self.robot.head().state()?;
        let width_m = self.robot.gripper().state()?.width_m;
        configuration.apply(&arm.positions);
        configuration.apply(&head.positions);
        Ok(self.model.with_gripper_width(configuration, width_m))
    }

    /// A line in the log with the simulated time.
    pub fn log(&mut self, what: impl AsRef<str>) {
        let now_s = self.now().as_s();
        tracing::debug!("{now_s:7.2} s  {}", what.as_ref());
    }

    /// Brings everything to rest, best effort, at the end of a run.
    pub fn stop(&mut self) {
        const PATIENCE_S: f64 = 3.0;
        let still = [&self.model.arm, &self.model.head].map(|group| JointVelocities::zeros(&group.joints));
        for _ in 0..(PATIENCE_S / self.config.period.as_s()) as usize {
            // The run is over whatever they answer; the envelope and the drivers' watchdogs stop a part that does not.
            let _ = self.robot.base().command(Twist::default());
            let _ = self.robot.arm().command(&still[0]);
            let _ = self.robot.head().command(&still[1]);
            let next = self.now() + self.config.period;
            if self.is_at_rest() || self.robot.clock().wait_until(next).is_err() {
                return;
            }
        }
    }

    fn is_at_rest(&mut self) -> bool {
        const RESTS: f64 = 0.02;
        let base = self.robot.base().velocity().unwrap_or_default();
        let arm = self.robot.arm().state().map_or(0.0, |state| most(&state.velocities));
        base.forward_m_per_s.abs().max(base.turn_rad_per_s.abs()).max(arm) < RESTS
    }

    /// Ends perception and gives back the final map and the journal.
    pub fn finish(mut self) -> Result<(Arc<Map>, Journal), TaskError> {
        self.stop();
        for learned in self.perception.finish()? {
            self.journal.note_learned(&learned);
            self.map = learned.map;
        }
        Ok((self.map, self.journal))
    }

    /// Velocities that turn the head towards its gaze.
    fn head_velocities(&mut self) -> Result<JointVelocities, Halt> {
        let configuration = self.configuration()?;
        let world_from_base = self.world_from_base()?;
        let head = self.robot.head().state()?;
        let view = View {
            model: &self.model,
            configuration: &configuration,
            world_from_base: &world_from_base,
            head: head.positions.values(),
            now: self.robot.clock().now(),
        };
        Ok(self.gaze.velocities(&view, self.config.head_gain_per_s))
    }
}
