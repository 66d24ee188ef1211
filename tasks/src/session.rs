//! A run in the hands of a program: begin, act, finish. Episodes from files run the same way.
//!
//! ```no_run
//! use dsm_tasks::episode::{Episode, Expectation, Step};
//! use dsm_tasks::run::{RunSpec, Silent};
//! use dsm_tasks::session::Session;
//!
//! # fn main() -> Result<(), dsm_tasks::error::TaskError> {
//! let mut episode = Episode::new("scenes/apartment");
//! episode.expectations.push(Expectation::robot_near_object("fridge"));
//! let mut session = Session::begin(&RunSpec::new("to_the_fridge", episode), None, Default::default(), Box::new(Silent))?;
//! session.run(&[Step::command("Navigate to the fridge")]);
//! let finished = session.finish()?;
//! assert!(finished.summary.success);
//! # Ok(())
//! # }
//! ```

use crate::agent::{Agent, Halt};
use crate::assemble::{Judged, Present, Tell, find_present, limited};
use crate::crew::{Crew, Gear, settle};
use crate::deferred::Waiting;
use crate::episode::Step;
use crate::error::TaskError;
use crate::executor::{Account, Executor, reason_of, words_of};
use crate::journal::Moment;
use crate::judge::Judge;
use crate::perception::Tape;
use crate::replay::Recorder;
use crate::run::{CELL_M, Finished, Progress, RunSpec};
use crate::skills::Outcome;
use crate::summary::{ExpectationSummary, Failure, StepOutcome, StepSummary};
use crate::verdict::{Told, believed, judged};
use dsm::perceive::Detector;
use dsm::store::MapLog;
use dsm::time::Stamp;
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_robot::nav::NavConfig;
use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::channel;

/// A run that goes on.
pub struct Session {
    spec: RunSpec,
    nav: NavConfig,
    executor: Executor,
    /// The robot with its senses and its map.
    agent: Agent,
    /// Who judges; nobody where the world is none of ours.
    judge: Option<Rc<RefCell<Judge>>>,
    /// Hands the account to whoever judges elsewhere.
    tell: Option<Tell>,
    recorder: Option<Recorder>,
    account: Account,
}

/// What is kept of a run beside its map.
#[derive(Default)]
pub struct Keep {
    /// Keep what the map is made of.
    pub tapes: Vec<Box<dyn Tape>>,
    /// Keeps all that the robot is asked and answers, so that the run can be replayed.
    pub recorder: Option<Recorder>,
}

/// A robot of one's own, with drivers in Rust.
pub struct OwnRobot {
    /// Its drivers, without limits around them.
    pub robot: Box<dyn Robot>,
    /// What it is, by `robot.toml`.
    pub model: Arc<RobotModel>,
    /// Who finds things in its pictures.
    pub detector: Box<dyn Detector>,
    /// Whether its clock waits for slow work: [`Waiting::Never`] for whatever stands in the real world.
    pub waiting: Waiting,
}

impl Session {
    /// Assembles world, robot, detector and judge. The map is logged to `map_file` while it grows; who sets `interrupted`
    /// ends the run. The steps of the specified episode are not run by this.
    pub fn begin(
        spec: &RunSpec,
        map_file: Option<&Path>,
        interrupted: Arc<AtomicBool>,
        progress: Box<dyn Progress>,
    ) -> Result<Self, TaskError> {
        Self::begin_taped(spec, map_file, Vec::new(), interrupted, progress)
    }

    /// As [`Self::begin`]; `tapes` keep what the map is made of.
    pub fn begin_taped(
        spec: &RunSpec,
        map_file: Option<&Path>,
        tapes: Vec<Box<dyn Tape>>,
        interrupted: Arc<AtomicBool>,
        progress: Box<dyn Progress>,
    ) -> Result<Self, TaskError> {
        Self::begin_kept(spec, map_file, Keep { tapes, recorder: None }, interrupted, progress)
    }

    /// As [`Self::begin`]; what `keep` says is kept of the run.
    pub fn begin_kept(
        spec: &RunSpec,
        map_file: Option<&Path>,
        keep: Keep,
        interrupted: Arc<AtomicBool>,
        progress: Box<dyn Progress>,
    ) -> Result<Self, TaskError> {
        let present = find_present(spec, keep.recorder.as_ref().map(Recorder::sink))?;
        Self::begin_present(spec, present, map_file, keep, interrupted, progress)
    }

    /// As [`Self::begin`], on a robot of one's own in place of a simulated one. It is held within the limits of its model;
    /// nobody judges, and of `spec` neither scene nor robot are read.
    pub fn begin_on(
        own: OwnRobot,
        spec: &RunSpec,
        map_file: Option<&Path>,
        keep: Keep,
        interrupted: Arc<AtomicBool>,
        progress: Box<dyn Progress>,
    ) -> Result<Self, TaskError> {
        let OwnRobot { robot, model, detector, waiting } = own;
        let robot = limited(robot, &model, keep.recorder.as_ref().map(Recorder::sink), spec.stop.clone());
        // Nobody else wants to hear the words of the event log.
        let (words, _) = channel();
        let present = Present { robot, model, detector, words, judged: None, waiting, tell: None };
        Self::begin_present(spec, present, map_file, keep, interrupted, progress)
    }

    fn begin_present(
        spec: &RunSpec,
        present: Present,
        map_file: Option<&Path>,
        keep: Keep,
        interrupted: Arc<AtomicBool>,
        progress: Box<dyn Progress>,
    ) -> Result<Self, TaskError> {
        let Keep { mut tapes, mut recorder } = keep;
        let Present { robot, model, detector, words, judged, waiting, tell } = present;
        let is_taped = !tapes.is_empty();
        let witness = match &mut recorder {
            Some(recorder) => {
                recorder.begin(spec, &model, detector.name())?;
                let (tape, witness) = recorder.watch();
                tapes.push(tape);
                Some(witness)
            }
            None => None,
        };
        if let Some(path) = map_file {
            tapes.push(Box::new(MapLog::create(path, CELL_M)?));
        }
        let progress = Rc::new(RefCell::new(progress));
        let listener = progress.clone();
        let (judge, on_tick): (_, Box<dyn FnMut(Stamp)>) = match judged {
            Some(Judged { truth, judge }) => {
                let judge = Rc::new(RefCell::new(judge));
                let watcher = judge.clone();
                let watch = move |_| {
                    for sample in truth.try_iter() {
                        listener.borrow_mut().at(sample.stamp.as_s());
                        watcher.borrow_mut().observe(sample);
                    }
                };
                (Some(judge), Box::new(watch))
            }
            None => (None, Box::new(move |now: Stamp| listener.borrow_mut().at(now.as_s()))),
        };
        let on_frame = Box::new(move |moment: &Moment<'_>| progress.borrow_mut().sees(moment));
        let time_limit_s = spec.time_limit_s;
        let language = spec.language.clone();
        let gear =
            Gear { robot, model, detector, language, waiting, tapes, time_limit_s, interrupted, on_tick, on_frame };
        let Crew { mut agent, executor, nav } = Crew::new(gear)?;
        agent.journal.commands = is_taped.then(Vec::new);
        agent.journal.told = Some(words);
        agent.journal.witness = witness;
        let account = Account { steps: Vec::new(), failure: None, halt: None };
        Ok(Self { spec: spec.clone(), executor, nav, agent, judge, tell, recorder, account })
    }

    /// How the robot may drive, for skills.
    pub fn nav(&self) -> &NavConfig {
        &self.nav
    }

    /// The robot with its senses and its map.
    pub fn agent(&mut self) -> &mut Agent {
        &mut self.agent
    }

    /// Runs steps as those of an episode file, and accounts for them. After a step that failed the rest is skipped.
    /// Returns the accounts of these steps.
    pub fn run(&mut self, steps: &[Step]) -> &[StepSummary] {
        let before = self.account.steps.len();
        if self.account.failure.is_some() {
            steps.iter().for_each(|step| self.skip(&words_of(step)));
            return &self.account.steps[before..];
        }
        let account = self.executor.run(&mut self.agent, steps);
        self.account.steps.extend(account.steps.into_iter().map(|s| StepSummary { index: s.index + before, ..s }));
        self.account.failure = account.failure.map(|failure| Failure { step: failure.step + before, ..failure });
        self.account.halt = account.halt;
        &self.account.steps[before..]
    }

    /// Forgets that a step failed: what comes next is begun all the same. The accounts stay.
    pub fn forgive(&mut self) {
        (self.account.failure, self.account.halt) = (None, None);
    }

    /// Runs a skill of one's own as one step, and accounts for it under `words` and the skill's name.
    pub fn run_skill(
        &mut self,
        words: &str,
        name: &str,
        skill: impl FnOnce(&mut Agent) -> Result<Outcome, Halt>,
    ) -> &StepSummary {
        let before = self.account.steps.len();
        if self.account.failure.is_some() {
            self.skip(words);
            return &self.account.steps[before];
        }
        let start = self.agent.now();
        self.agent.note(format!("step {before}: {words}"));
        let (outcome, halt) = match skill(&mut self.agent) {
            Ok(outcome) => (outcome, None),
            Err(halt) => {
                let (stage, reason) = reason_of(&halt);
                (Outcome::Failed(stage, reason), Some(halt))
            }
        };
        let (outcome, reason, failure) = match outcome {
            Outcome::Done(reason) => (StepOutcome::Done, reason, None),
            Outcome::Failed(stage, reason) => {
                let failure = Failure { step: before, stage, reason: reason.clone() };
                (StepOutcome::Failed, reason, Some(failure))
            }
        };
        let end = self.agent.now();
        self.agent.note(format!("step {before} ends: {outcome:?}: {reason}"));
        (self.account.failure, self.account.halt) = (failure, halt);
        self.account.steps.push(StepSummary {
            skill: name.into(),
            outcome,
            reason,
            duration_s: (end - start).as_s(),
            ..StepSummary::skipped(before, words.into(), start.as_s())
        });
        &self.account.steps[before]
    }

    /// What the judge says of the expectations at this moment; nothing where nobody judges.
    pub fn judged(&self) -> Vec<ExpectationSummary> {
        let map = self.agent.map();
        self.judge.as_ref().map_or_else(Vec::new, |judge| judge.borrow().judge(&self.account.steps, map))
    }

    /// Lets things come to rest under the eyes of the judge, and judges.
    pub fn finish(mut self) -> Result<Finished, TaskError> {
        if self.account.halt.is_none() {
            settle(&mut self.agent);
        }
        let robot = self.agent.model().settings.name.clone();
        let (map, mut journal) = self.agent.finish()?;
        let (spec, account) = (self.spec, self.account);
        journal.witness = None;
        let recorded = self.recorder.map(|recorder| recorder.finish(&account, &map)).transpose()?;
        if let Some(Halt::Failed(error)) = account.halt {
            return Err(error);
        }
        let told = Told { steps: account.steps, failure: account.failure, map: &map };
        let summary = match &self.judge {
            Some(judge) => judged(&spec, robot, &judge.borrow(), told),
            None => believed(&spec, robot, told, &journal),
        };
        if let Some(tell) = self.tell {
            tell(&summary, &map);
        }
        Ok(Finished { summary, map, journal, recorded })
    }

    fn skip(&mut self, words: &str) {
        let start_s = self.agent.now().as_s();
        self.account.steps.push(StepSummary::skipped(self.account.steps.len(), words.into(), start_s));
    }
}

/// Navigation within what the robot can do.
pub(crate) fn nav_config(model: &RobotModel) -> NavConfig {
    // The follower stays a little below the limits, so that they need not correct it.
    const SHARE: f64 = 0.95;
    let base = &model.settings.base;
    let mut nav = NavConfig::default();
    nav.costmap.footprint_radius_m = base.footprint_radius_m;
    if let (Some((_, camera)), Some(posture)) = (model.find_camera("head"), model.find_posture("carry")) {
        let mut driving = model.kinematics.zero();
        driving.apply(&posture);
        nav.goal.camera_height_m = model.kinematics.root_from_link(&driving, camera).translation.z;
    }
    nav.follower.max_speed_m_per_s = SHARE * base.max_speed_m_per_s;
    nav.follower.max_turn_rad_per_s = SHARE * base.max_turn_rate_rad_per_s;
    nav.follower.max_acceleration_m_per_s2 = SHARE * base.max_acceleration_m_per_s2;
    nav.follower.max_turn_acceleration_rad_per_s2 = SHARE * base.max_turn_acceleration_rad_per_s2;
    nav
}
