//! A robot behind the driver traits, shown to the ROS 2 graph as one that speaks ROS 2.
//!
//! ```text
//! topics ──▶ commands ──▶ robot ──wait_until──▶ states, pictures, detections ──▶ air ──▶ topics
//! ```

mod actions;
mod air;
mod commands;
mod follow;
mod goals;
mod mouth;
mod words;

pub use air::Weather;

use crate::error::Ros2Error;
use crate::link::{Link, LinkBuilder};
use crate::messages::{Account, Clock, Step, Text};
use crate::settings::Ros2Settings;
use crate::wall::instant;
use actions::Actions;
use air::{Air, Fate};
use commands::Command;
use dsm::perceive::Detector;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use mouth::{Mouth, Saying};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long to wait for a message before looking whether it is over.
const LOOK: Duration = Duration::from_millis(20);
/// A robot that is this late goes on from here: it does not hurry to make up for it.
const TOO_LATE: Duration = Duration::from_millis(100);

/// Transforms of moving links go out with each of so many states, and diagnostics with each of these.
const LINKS_EVERY: u64 = 10;
const DIAGNOSTICS_EVERY: u64 = 100;

/// Whoever serves a robot: hears about the run, and says when it is over.
pub trait Host {
    /// After every period, and now and then while nothing happens; `false` ends the service. `silent` is how long nobody
    /// has said anything; `None` before anybody came.
    fn goes_on(&mut self, now: Stamp, silent: Option<Duration>) -> bool;

    /// A line of the task's log.
    fn hear(&mut self, _line: String) {}

    /// What the run came to, as the task has it. By default nobody asks.
    fn take_account(&mut self, _account: Account) {}
}

/// A robot that is served.
pub struct Server {
    link: Link<Command>,
    settings: Ros2Settings,
    model: Arc<RobotModel>,
    mouth: Mouth,
    actions: Actions,
    air: Air<Saying>,
    begun: Instant,
    heard: Option<Instant>,
    said_stop: Option<String>,
    /// How often it has said how it is.
    told: u64,
    /// Its time has stopped for good.
    dead: bool,
}

/// Why a robot is served no longer.
#[derive(Debug, thiserror::Error)]
#[error("ROS 2: {0}")]
pub struct ServeError(String);

impl Server {
    /// Joins the graph as the robot of a model, under the names of its `[ros2]` or of others; what it says goes through
    /// the air of `weather`.
    ///
    /// # Errors
    /// [`Ros2Error`].
    pub fn start(model: Arc<RobotModel>, settings: Ros2Settings, weather: Weather) -> Result<Self, Ros2Error> {
        let mut link = LinkBuilder::new("dsm_robot", settings.domain)?;
        commands::listen(&mut link, &settings)?;
        let mouth = Mouth::new(&mut link, &model, &settings)?;
        let actions = Actions::offer(&mut link, &settings)?;
        let link = link.start()?;
        let (air, begun) = (Air::new(weather), instant());
        let (heard, said_stop) = (None, None);
        Ok(Self { link, settings, model, mouth, actions, air, begun, heard, said_stop, told: 0, dead: false })
    }

    /// Serves the robot in lock step: time passes as far as it is asked to.
    ///
    /// # Errors
    /// [`ServeError`]: nothing can be published.
    pub fn serve_steps(
        &mut self,
        robot: &mut dyn Robot,
        detector: &mut dyn Detector,
        host: &mut dyn Host,
    ) -> Result<(), ServeError> {
        let mut asked: Option<Step> = None;
        while host.goes_on(robot.clock().now(), self.silent()) {
            match self.link.wait(LOOK) {
                Some(Command::Advance(step)) => {
                    self.heard = Some(instant());
                    asked = Some(step);
                }
                Some(command) => self.carry_out(robot, command, host),
                None => {}
            }
            if asked.as_ref().is_some_and(|step| step.number == 0) {
                self.link.forget_taken();
                self.mouth.forget_sent();
            }
            if let Some(step) = asked.take_if(|step| is_all_here(&self.link, step)) {
                if step.number > 0 {
                    self.pass_time(robot, step.until.into());
                }
                if !self.dead {
                    self.tell(robot, detector)?;
                    self.answer(robot.clock().now(), step.number)?;
                }
            }
        }
        self.linger();
        Ok(())
    }

    /// Serves the robot while its own clock runs, period by period, as fast as real time. It begins to run when somebody
    /// follows it.
    ///
    /// # Errors
    /// [`ServeError`]: nothing can be published.
    pub fn serve_freely(
        &mut self,
        robot: &mut dyn Robot,
        detector: &mut dyn Detector,
        period: Span,
        host: &mut dyn Host,
    ) -> Result<(), ServeError> {
        let length = Duration::from_nanos(period.0.unsigned_abs());
        let every = (1.0 / (self.settings.state_rate_hz * period.as_s())).round().max(1.0) as u64;
        let (mut next, mut periods, mut runs) = (self.begun.elapsed() + length, 0_u64, false);
        while host.goes_on(robot.clock().now(), self.silent()) {
            self.listen_until(robot, next, host)?;
            runs |= self.link.is_heard(&self.mouth.clock);
            if runs {
                let until = robot.clock().now() + period;
                self.pass_time(robot, until);
            }
            periods += 1;
            if !self.dead && periods.is_multiple_of(every) {
                self.tell(robot, detector)?;
            }
            let now = self.begun.elapsed();
            next = if now > next + TOO_LATE { now } else { next } + length;
        }
        self.linger();
        Ok(())
    }

    /// Takes commands, and lets messages out of the air, until the real time `until`.
    fn listen_until(&mut self, robot: &mut dyn Robot, until: Duration, host: &mut dyn Host) -> Result<(), ServeError> {
        loop {
            let now = self.begun.elapsed();
            while let Some(saying) = self.air.find_due(now) {
                self.mouth.say(saying).map_err(ServeError)?;
            }
            let wake = self.air.next_due().map_or(until, |due| due.min(until));
            match self.link.wait(wake.saturating_sub(now)) {
                Some(command) => self.carry_out(robot, command, host),
                None if self.begun.elapsed() >= until => return Ok(()),
                None => {}
            }
        }
    }

    /// A robot whose time has stopped is dead: it does and says nothing from here on.
    fn pass_time(&mut self, robot: &mut dyn Robot, until: Stamp) {
        if !self.dead {
            self.actions.advance(robot, &self.model);
        }
        if !self.dead
            && let Err(error) = robot.clock().wait_until(until)
        {
            tracing::warn!("the robot is dead: {error}");
            self.dead = true;
        }
    }

    /// How long nobody has said anything.
    fn silent(&self) -> Option<Duration> {
        self.heard.map(|heard| heard.elapsed())
    }

    /// Says how the robot is and what it sees.
    fn tell(&mut self, robot: &mut dyn Robot, detector: &mut dyn Detector) -> Result<(), ServeError> {
        let now = robot.clock().now();
        for saying in words::joints(robot, &self.model) {
            self.send(saying)?;
        }
        for saying in words::poses(robot, &self.model) {
            self.send(saying)?;
        }
        if self.told.is_multiple_of(LINKS_EVERY) {
            self.send(words::links(robot, &self.model))?;
        }
        if self.told.is_multiple_of(DIAGNOSTICS_EVERY) {
            // Who comes late hears them again: they are few.
            self.mouth.fixed.say(words::fixed_links(&self.model, now)).map_err(ServeError)?;
            self.mouth.diagnostics.say(words::diagnostics(robot, now)).map_err(ServeError)?;
        }
        self.told += 1;
        for (camera, name) in robot.cameras().names().iter().enumerate() {
            let Some(frame) = words::answered(robot.cameras().read(name)).flatten() else { continue };
            for saying in words::picture(camera, &frame) {
                self.send(saying)?;
            }
            if self.mouth.sees() {
                let found = detector.detect(&frame);
                self.send(words::detections(&frame, detector.name(), found))?;
            }
        }
        let reason = robot.emergency_stop().find_reason();
        if reason != self.said_stop {
            self.mouth.stop.say(Text { data: reason.clone().unwrap_or_default() }).map_err(ServeError)?;
            self.said_stop = reason;
        }
        self.mouth.clock.say(Clock { clock: now.into() }).map_err(ServeError)
    }

    fn send(&mut self, saying: Saying) -> Result<(), ServeError> {
        let is_image = saying.is_image();
        match self.air.pass(self.begun.elapsed(), saying, is_image) {
            Fate::Now(saying) => self.mouth.say(saying).map_err(ServeError),
            Fate::Gone => Ok(()),
        }
    }

    /// Says that a step is done, and how many messages belong to it.
    fn answer(&mut self, now: Stamp, number: u64) -> Result<(), ServeError> {
        let (topics, counts) = self.mouth.sent();
        let step = Step { until: now.into(), number, topics, counts };
        self.mouth.advanced.as_mut().map_or(Ok(()), |speaker| speaker.say(step)).map_err(ServeError)
    }

    /// Stays until what was said last is heard, for a while.
    fn linger(&mut self) {
        let (begun, patience) = (instant(), Duration::from_secs_f64(self.settings.timeout_s.min(3.0)));
        while begun.elapsed() < patience && self.link.is_heard(&self.mouth.taken) {
            self.link.wait(LOOK);
        }
    }

    /// The names in use.
    pub fn settings(&self) -> &Ros2Settings {
        &self.settings
    }
}

fn is_all_here(link: &Link<Command>, step: &Step) -> bool {
    let has_come = |(topic, count): (&String, &u64)| link.find_taken(topic).is_none_or(|taken| taken >= *count);
    step.topics.iter().zip(&step.counts).all(has_come)
}
