//! How time passes: by the machine's clock, by a simulation's, or step by step.

use super::inbox::Incoming;
use super::{Core, lost};
use crate::error::Ros2Error;
use crate::messages::{Clock, Step, Time};
use crate::settings::ClockSource;
use crate::wall::{instant, machine_now};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::DriverError;
use std::time::Duration;

/// Asks a simulation to let time pass.
pub(crate) const ADVANCE_TOPIC: &str = "/dsm/advance";
/// Says that time has passed.
pub(crate) const ADVANCED_TOPIC: &str = "/dsm/advanced";
/// How often is looked whether anybody is there.
const LOOK: Duration = Duration::from_millis(20);
/// When nothing has come for this long, nothing of an earlier try is on its way.
const QUIET: Duration = Duration::from_millis(200);
/// How long a try to begin lasts.
const TRY: Duration = Duration::from_secs(1);

/// The robot's clock. Moments on the wire count from the epoch, ours from the run's start.
pub(super) struct RobotClock {
    source: ClockSource,
    /// The run's start on the wire.
    start: Option<Stamp>,
    /// The newest moment, when it is not the machine's.
    now: Stamp,
    steps: u64,
}

impl RobotClock {
    pub(super) fn new(source: ClockSource) -> Self {
        let start = match source {
            ClockSource::Wall => Some(machine_now()),
            ClockSource::Topic => None,
            ClockSource::LockStep => Some(Stamp(0)),
        };
        Self { source, start, now: Stamp(0), steps: 0 }
    }

    /// A moment on the wire as one of the run.
    pub(super) fn stamp(&self, time: Time) -> Stamp {
        Stamp(Stamp::from(time).0 - self.start.unwrap_or_default().0)
    }

    /// Takes in the simulation's clock, whose first word is the run's start. It does not run backwards.
    pub(super) fn hear(&mut self, clock: &Clock) {
        let said = Stamp::from(clock.clock);
        let start = *self.start.get_or_insert(said);
        self.now = self.now.max(Stamp(said.0 - start.0));
    }

    pub(super) fn now(&self) -> Stamp {
        match self.source {
            ClockSource::Wall => Stamp(machine_now().0 - self.start.unwrap_or_default().0),
            ClockSource::Topic | ClockSource::LockStep => self.now,
        }
    }

    /// The present moment as others count it.
    pub(super) fn on_the_wire(&self) -> Stamp {
        self.now() + Span(self.start.unwrap_or_default().0)
    }
}

impl Core {
    /// Waits until somebody is at the other end of every topic and every part has said how it is.
    pub(super) fn meet(&mut self) -> Result<(), Ros2Error> {
        let (start, timeout) = (instant(), Duration::from_secs_f64(self.settings.timeout_s));
        loop {
            if let Some(message) = self.link.wait(LOOK) {
                self.accept(message);
            }
            self.take_in();
            let mut missing = self.link.find_lonely();
            if missing.is_empty() && self.settings.clock == ClockSource::LockStep && self.begin_steps().is_err() {
                missing.push(ADVANCED_TOPIC.to_owned());
            }
            missing.extend(self.inbox.find_silent(&self.settings));
            if missing.is_empty() {
                return Ok(());
            }
            if start.elapsed() > timeout {
                let (timeout_s, domain) = (self.settings.timeout_s, self.link.domain());
                return Err(Ros2Error::Silent { topics: missing, timeout_s, domain });
            }
        }
    }

    /// Lets time pass until `stamp`.
    pub(super) fn pass_time(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        self.say_log()?;
        match self.settings.clock {
            ClockSource::Wall => self.wait_for_machine(stamp),
            ClockSource::Topic => self.wait_for_clock(stamp)?,
            ClockSource::LockStep if stamp > self.clock.now => {
                self.clock.steps += 1;
                self.ask_for_step(stamp)?;
                self.await_step(Duration::from_secs_f64(self.settings.timeout_s))?;
            }
            ClockSource::LockStep => {}
        }
        self.take_in();
        Ok(())
    }

    fn wait_for_machine(&mut self, stamp: Stamp) {
        loop {
            let left = stamp.0 - self.clock.now().0;
            if left <= 0 {
                return;
            }
            if let Some(message) = self.link.wait(Duration::from_nanos(left.unsigned_abs())) {
                self.accept(message);
            }
        }
    }

    fn wait_for_clock(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        let (start, timeout) = (instant(), Duration::from_secs_f64(self.settings.timeout_s));
        while self.clock.now < stamp {
            match self.link.wait(LOOK) {
                Some(message) => self.accept(message),
                None if start.elapsed() > timeout => return Err(lost("clock", "the simulation's clock stands still")),
                None => {}
            }
        }
        Ok(())
    }

    /// Asks for step 0, by which no time passes: both sides begin to count, and the robot says how it is. Either side may
    /// know the other before it is known itself, so that messages are lost: then this is tried again.
    fn begin_steps(&mut self) -> Result<(), DriverError> {
        while let Some(message) = self.link.wait(QUIET) {
            self.accept(message);
        }
        self.link.forget_taken();
        self.forget_sent();
        self.clock.steps = 0;
        self.ask_for_step(Stamp(0))?;
        self.await_step(TRY)
    }

    fn forget_sent(&mut self) {
        self.base.forget_sent();
        self.arm.forget_sent();
        self.head.forget_sent();
        self.gripper.forget_sent();
        self.stop.forget_sent();
        self.log.forget_sent();
    }

    fn ask_for_step(&mut self, until: Stamp) -> Result<(), DriverError> {
        let spoken = [
            (self.base.topic(), self.base.sent()),
            self.arm.sent(),
            self.head.sent(),
            self.gripper.sent(),
            (self.stop.topic(), self.stop.sent()),
            (self.log.topic(), self.log.sent()),
        ];
        let (topics, counts) = spoken.into_iter().map(|(topic, count)| (topic.to_owned(), count)).unzip();
        let step = Step { until: until.into(), number: self.clock.steps, topics, counts };
        let speaker = self.step.as_mut().ok_or_else(|| lost("clock", "it is not one of steps"))?;
        speaker.say(step).map_err(|reason| lost("clock", reason))
    }

    /// Waits for the answer to the last step, and for all messages that belong to it.
    fn await_step(&mut self, timeout: Duration) -> Result<(), DriverError> {
        let start = instant();
        loop {
            let number = self.clock.steps;
            if let Some(step) =
                self.inbox.stepped.take_if(|step| step.number == number && is_all_here(&self.link, step))
            {
                self.clock.now = self.clock.stamp(step.until);
                return Ok(());
            }
            match self.link.wait(LOOK) {
                Some(message) => self.accept(message),
                None if start.elapsed() > timeout => return Err(lost("simulation", "it does not step")),
                None => {}
            }
        }
    }
}

/// Whether all messages that were sent up to a step have come.
fn is_all_here(link: &crate::link::Link<Incoming>, step: &Step) -> bool {
    let has_come = |(topic, count): (&String, &u64)| link.find_taken(topic).is_none_or(|taken| taken >= *count);
    step.topics.iter().zip(&step.counts).all(has_come)
}
