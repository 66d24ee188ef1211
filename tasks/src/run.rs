//! One episode from its file to its summary.

use crate::agent::{Agent, AgentConfig, Halt, Parts};
use crate::assemble::{Assembled, assemble, grounder, knowledge};
use crate::episode::{Episode, Expectation, ExpectationKind};
use crate::error::TaskError;
use crate::executor::Executor;
use crate::journal::Journal;
use crate::perception::Perception;
use crate::skills::grasp::GraspSettings;
use crate::summary::{Failure, MapSummary, SUMMARY_SCHEMA, Stage, StepOutcome, StepSummary, Summary};
use dsm::build::{BuildConfig, MapBuilder};
use dsm::map::Map;
use dsm::store::MapLog;
use dsm::time::Stamp;
use dsm_robot::model::RobotModel;
use dsm_robot::nav::NavConfig;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Side of a free-space cell, metres.
pub(crate) const CELL_M: f64 = 0.05;

/// All that decides a run.
#[derive(Clone, Debug)]
pub struct RunSpec {
    /// Name of the episode.
    pub name: String,
    /// The episode file.
    pub file: PathBuf,
    /// The episode.
    pub episode: Episode,
    /// The scene's MJCF file or folder.
    pub scene: PathBuf,
    /// Robot by name or path.
    pub robot: String,
    /// Physics engine.
    pub physics: String,
    /// Perception preset.
    pub perception: String,
    /// Seed.
    pub seed: u64,
    /// Simulated time limit, seconds.
    pub time_limit_s: f64,
    /// Gives the simulator's label ids another meaning in every frame: nothing may change. Default false.
    pub permute_labels: bool,
}

/// A finished run.
pub struct Finished {
    /// The account.
    pub summary: Summary,
    /// The map at the end.
    pub map: Arc<Map>,
    /// What happened along the way.
    pub journal: Journal,
}

/// Hears about a run while it goes on.
pub trait Progress {
    /// The simulated time, seconds.
    fn at(&mut self, sim_time_s: f64);
}

/// Nobody listens.
pub struct Silent;

impl Progress for Silent {
    fn at(&mut self, _: f64) {}
}

/// Runs an episode. The map is logged to `map_file` while it grows, and replaced by its compact form at the end.
pub fn run_episode(
    spec: &RunSpec,
    map_file: Option<&Path>,
    interrupted: Arc<AtomicBool>,
    mut progress: Box<dyn Progress>,
) -> Result<Finished, TaskError> {
    // Assemble: world, robot, detector, judge.
    let Assembled { robot, model, detector, truth, judge } = assemble(spec)?;
    let knowledge = knowledge()?;
    let log = map_file.map(|path| MapLog::create(path, CELL_M)).transpose()?;
    let config = AgentConfig::default();
    let map = Map::new(CELL_M);
    let builder = MapBuilder::new(BuildConfig::default(), knowledge.clone());
    let perception = Perception::start(detector, builder, map.clone(), log, config.mapping_latency);
    let judge = Rc::new(RefCell::new(judge));
    let watcher = judge.clone();
    let on_tick = Box::new(move || {
        for sample in truth.try_iter() {
            progress.at(sample.stamp.as_s());
            watcher.borrow_mut().observe(sample);
        }
    });
    let deadline = Stamp::from_s(spec.time_limit_s);
    let parts = Parts { robot, model: model.clone(), perception, map, deadline, interrupted, on_tick };
    let mut agent = Agent::new(parts, config);

    // Act.
    let mut executor = Executor::new(nav_config(&model), GraspSettings::default(), grounder()?, knowledge);
    let account = executor.run(&mut agent, &spec.episode.steps);

    // Let things come to rest under the eyes of the judge, unless the run was cut short.
    if account.halt.is_none() {
        settle(&mut agent);
    }
    let (map, journal) = agent.finish()?;
    if let Some(Halt::Failed(error)) = account.halt {
        return Err(error);
    }

    // Judge.
    let judge = judge.borrow();
    let expectations = judge.judge(&account.steps, &map);
    let failed = expectations.iter().find(|e| !e.passed);
    let failure = account.failure.or_else(|| find_refusal(&spec.episode.expectations, &account.steps)).or_else(|| {
        failed.map(|e| Failure {
            step: account.steps.len().saturating_sub(1),
            stage: Stage::Judging,
            reason: format!("{}: {}; required: {}", e.kind, e.measured, e.required),
        })
    });
    let success = failure.is_none();
    let summary = Summary {
        schema: SUMMARY_SCHEMA,
        episode: spec.name.clone(),
        scene: judge.scene().to_owned(),
        robot: model.settings.name.clone(),
        physics: spec.physics.clone(),
        perception: spec.perception.clone(),
        seed: spec.seed,
        success,
        failure,
        steps: account.steps,
        expectations,
        metrics: judge.metrics(success),
        map: MapSummary {
            objects: map.stable_objects().count(),
            relations: map.relations.len(),
            rooms: map.rooms.len(),
        },
        truth: judge.truth(),
    };
    Ok(Finished { summary, map, journal })
}

/// A refusal that nobody expected: the words found nothing, or several things.
fn find_refusal(expectations: &[Expectation], steps: &[StepSummary]) -> Option<Failure> {
    if expectations.iter().any(|e| e.kind == ExpectationKind::Refused) {
        return None;
    }
    let refused = steps.iter().find(|s| matches!(s.outcome, StepOutcome::Absent | StepOutcome::Ambiguous))?;
    let word = if refused.outcome == StepOutcome::Absent { "absent" } else { "ambiguous" };
    Some(Failure { step: refused.index, stage: Stage::Grounding, reason: format!("{word}: {}", refused.reason) })
}

/// Two seconds at rest, so that what is held is seen to be held.
fn settle(agent: &mut Agent) {
    // A time limit during these seconds changes nothing that is judged.
    let _ = agent.rest(dsm::time::Span::from_s(2.2));
}

/// Navigation within what the robot can do.
pub(crate) fn nav_config(model: &RobotModel) -> NavConfig {
    // The follower stays a little below the limits, so that they need not correct it.
    const SHARE: f64 = 0.95;
    let base = &model.settings.base;
    let mut nav = NavConfig::default();
    nav.costmap.footprint_radius_m = base.footprint_radius_m;
    nav.follower.max_speed_m_per_s = SHARE * base.max_speed_m_per_s;
    nav.follower.max_turn_rad_per_s = SHARE * base.max_turn_rate_rad_per_s;
    nav.follower.max_acceleration_m_per_s2 = SHARE * base.max_acceleration_m_per_s2;
    nav.follower.max_turn_acceleration_rad_per_s2 = SHARE * base.max_turn_acceleration_rad_per_s2;
    nav
}

#[cfg(test)]
mod tests {
    //! Contract: a refusal is a failure in grounding, unless the episode expects it.
    use super::*;

    #[test]
    fn only_an_expected_refusal_is_a_success() {
        let step = StepSummary {
            index: 0,
            command: "Grasp the unicorn".into(),
            skill: "grasp".into(),
            outcome: StepOutcome::Absent,
            reason: "nothing is named so".into(),
            start_s: 0.0,
            duration_s: 1.0,
            grounding: None,
        };
        let failure = find_refusal(&[], std::slice::from_ref(&step)).unwrap();
        assert_eq!((failure.step, failure.stage), (0, Stage::Grounding));
        let expected: Expectation = toml::from_str("kind = \"refused\"").unwrap();
        assert_eq!(find_refusal(&[expected], std::slice::from_ref(&step)), None);
        let done = StepSummary { outcome: StepOutcome::Done, ..step };
        assert_eq!(find_refusal(&[], &[done]), None);
    }
}
