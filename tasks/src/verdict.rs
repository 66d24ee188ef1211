//! What a run comes to when it is over: the summary, as a judge has it, or as the task alone has it.

use crate::episode::{Expectation, ExpectationKind};
use crate::journal::Journal;
use crate::judge::Judge;
use crate::run::RunSpec;
use crate::summary::{
    Failure, MapSummary, Metrics, SUMMARY_SCHEMA, Stage, StepOutcome, StepSummary, Summary, TruthSummary,
};
use dsm::map::Map;

/// What the task says of itself.
pub(crate) struct Told<'a> {
    /// Accounts of the steps.
    pub(crate) steps: Vec<StepSummary>,
    /// The first failure that it knows of.
    pub(crate) failure: Option<Failure>,
    /// The map at the end.
    pub(crate) map: &'a Map,
}

fn map_summary(map: &Map) -> MapSummary {
    MapSummary { objects: map.stable_objects().count(), relations: map.relations.len(), rooms: map.rooms.len() }
}

/// The summary as a judge has it who saw the truth all along.
pub(crate) fn judged(spec: &RunSpec, robot: String, judge: &Judge, told: Told<'_>) -> Summary {
    let Told { mut steps, failure, map } = told;
    let expectations = judge.judge(&steps, map);
    let failed = expectations.iter().position(|e| !e.passed);
    let failure = failure.or_else(|| find_refusal(&spec.episode.expectations, &steps)).or_else(|| {
        failed.map(|index| {
            let e = &expectations[index];
            let (stage, why) = judge.find_blamed_stage(&steps, map, index);
            let why = why.map_or_else(String::new, |why| format!("; {why}"));
            Failure {
                step: steps.len().saturating_sub(1),
                stage,
                reason: format!("{}: {}; required: {}{why}", e.kind, e.measured, e.required),
            }
        })
    });
    let success = failure.is_none();
    judge.measure_steps(&mut steps, success);
    Summary {
        schema: SUMMARY_SCHEMA,
        episode: spec.name.clone(),
        scene: judge.scene().to_owned(),
        robot,
        physics: spec.physics.clone(),
        perception: spec.perception.clone(),
        seed: spec.seed,
        success,
        failure,
        metrics: judge.metrics(&steps, success),
        steps,
        expectations,
        map: map_summary(map),
        truth: judge.truth(),
    }
}

/// The summary as the task alone has it: nobody judges, and what is measured is what the robot believes.
pub(crate) fn believed(spec: &RunSpec, robot: String, told: Told<'_>, journal: &Journal) -> Summary {
    let Told { steps, failure, map } = told;
    let failure = failure.or_else(|| find_refusal(&spec.episode.expectations, &steps));
    let lengths = journal.path.windows(2).map(|pair| (pair[1] - pair[0]).norm());
    let clearances = journal.samples.iter().filter_map(|sample| sample.clearance_m);
    Summary {
        schema: SUMMARY_SCHEMA,
        episode: spec.name.clone(),
        scene: spec.scene.display().to_string(),
        robot,
        physics: spec.drivers.name().to_owned(),
        perception: spec.perception.clone(),
        seed: spec.seed,
        success: failure.is_none(),
        failure,
        metrics: Metrics {
            sim_time_s: journal.samples.last().map_or(0.0, |sample| sample.stamp.as_s()),
            path_length_m: lengths.sum(),
            min_clearance_m: clearances.reduce(f64::min),
            ..Metrics::default()
        },
        steps,
        expectations: Vec::new(),
        map: map_summary(map),
        truth: TruthSummary::default(),
    }
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

#[cfg(test)]
mod tests {
    //! Contract: a refusal is a failure in grounding, unless the episode expects it.
    use super::*;

    #[test]
    fn only_an_expected_refusal_is_a_success() {
        let step = StepSummary {
            skill: "grasp".into(),
            outcome: StepOutcome::Absent,
            reason: "nothing is named so".into(),
            duration_s: 1.0,
            ..StepSummary::skipped(0, "Grasp the unicorn".into(), 0.0)
        };
        let failure = find_refusal(&[], std::slice::from_ref(&step)).unwrap();
        assert_eq!((failure.step, failure.stage), (0, Stage::Grounding));
        let expected: Expectation = toml::from_str("kind = \"refused\"").unwrap();
        assert_eq!(find_refusal(&[expected], std::slice::from_ref(&step)), None);
        let done = StepSummary { outcome: StepOutcome::Done, ..step };
        assert_eq!(find_refusal(&[], &[done]), None);
    }
}
