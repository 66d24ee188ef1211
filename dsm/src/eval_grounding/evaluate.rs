//! Answers and rates.

use super::classes::{classes_of, rates_by_class};
use super::data::{BoxObject, QueryLine, SceneLine, TargetBox};
use crate::ground::{Grounder, GroundingStatus, Query};
use crate::map::Map;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// The answer to one query, as it is written to a predictions file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prediction {
    /// The query.
    pub query_id: String,
    /// The best guess in the scene's own type of identity; null when absent or unparsed.
    pub predicted_id: Option<serde_json::Value>,
    /// How grounding ended.
    pub status: GroundingStatus,
    /// Its score.
    pub score: f32,
    /// Wall time in microseconds.
    pub time_us: u64,
    /// What kinds of language the query uses.
    #[serde(skip)]
    pub classes: Vec<String>,
    /// What was understood.
    #[serde(skip)]
    pub query: Option<Query>,
}

/// A rate with its 95 % Wilson interval, in percent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Right answers.
    pub right: usize,
    /// All queries.
    pub count: usize,
    /// Share of right answers.
    pub percent: f64,
    /// Lower and upper end of the interval.
    pub interval: [f64; 2],
}

/// Rates by split. Splits of Acc@IoU are named `dataset@25` and `dataset@50`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// What the reasoner was given.
    pub tier: String,
    /// What it was given by data set: true boxes and labels, or detected boxes.
    pub tiers: BTreeMap<String, String>,
    /// Rates by `dataset` and `dataset/split`.
    pub rates: BTreeMap<String, Rate>,
    /// Queries by data set.
    pub queries: BTreeMap<String, usize>,
    /// Queries whose truth is known.
    pub judged: usize,
    /// Queries without a guess, by data set.
    pub abstained: BTreeMap<String, usize>,
    /// Wall time per query.
    pub time_us: TimeUs,
    /// Rates by `dataset/kind of language`.
    pub classes: BTreeMap<String, Rate>,
}

/// Wall times in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TimeUs {
    /// Half of the queries took no longer.
    pub p50: u64,
    /// 95 % of the queries took no longer.
    pub p95: u64,
    /// The slowest query.
    pub max: u64,
}

impl TimeUs {
    fn of(predictions: &[Prediction]) -> Self {
        let mut times: Vec<u64> = predictions.iter().map(|prediction| prediction.time_us).collect();
        times.sort_unstable();
        let at = |place: usize| times.get(place.min(times.len().saturating_sub(1))).copied().unwrap_or(0);
        Self { p50: at(times.len() / 2), p95: at(times.len() * 95 / 100), max: at(times.len()) }
    }
}

/// Pairs of splits that share out a data set between them.
const PARTITIONS: [[&str; 2]; 3] = [["easy", "hard"], ["view_dep", "view_indep"], ["unique", "multiple"]];

/// Why a report cannot be right: an overall rate outside the range of its splits, or splits that do not add up.
pub fn find_contradiction(report: &Report) -> Option<String> {
    for (name, all) in report.rates.iter().filter(|(name, _)| !name.contains('/')) {
        for pair in PARTITIONS {
            let parts: Vec<&Rate> =
                pair.iter().filter_map(|part| report.rates.get(&format!("{name}/{part}"))).collect();
            // A split that is not stated for every query says nothing of the whole.
            if parts.is_empty() || parts.iter().map(|part| part.count).sum::<usize>() < all.count {
                continue;
            }
            let low = parts.iter().map(|part| part.percent).fold(f64::INFINITY, f64::min);
            let high = parts.iter().map(|part| part.percent).fold(f64::NEG_INFINITY, f64::max);
            let outside = all.percent < low - 1e-9 || all.percent > high + 1e-9;
            let right: usize = parts.iter().map(|part| part.right).sum();
            let count: usize = parts.iter().map(|part| part.count).sum();
            if outside || right != all.right || count != all.count {
                return Some(format!(
                    "{name} is {:.2} % of {}, but {} are {low:.2} to {high:.2} %",
                    all.percent,
                    all.count,
                    pair.join(" and ")
                ));
            }
        }
    }
    None
}

impl Rate {
    /// The rate of `right` out of `count`; zero for none.
    pub fn new(right: usize, count: usize) -> Self {
        if count == 0 {
            return Self { right, count, percent: 0.0, interval: [0.0, 0.0] };
        }
        let (n, z) = (count as f64, 1.96_f64);
        let p = right as f64 / n;
        let width = 1.0 + z * z / n;
        let middle = p + z * z / (2.0 * n);
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
        let interval = [100.0 * (middle - half) / width, 100.0 * (middle + half) / width];
        Self { right, count, percent: 100.0 * p, interval }
    }
}

/// Grounds all queries, and scores those whose truth is known. `now_us` reads a clock for `time_us` alone.
///
/// Queries of an unknown scene get no guess. The result does not depend on the number of threads.
pub fn evaluate(
    scenes: &BTreeMap<String, SceneLine>,
    queries: &[QueryLine],
    grounder: &Grounder,
    now_us: impl Fn() -> u64 + Sync,
) -> (Vec<Prediction>, Report) {
    let maps: BTreeMap<&str, Map> = scenes.iter().map(|(id, scene)| (id.as_str(), scene.import())).collect();
    let fronts: BTreeMap<&str, _> = scenes.iter().map(|(id, scene)| (id.as_str(), scene.fronts())).collect();
    let answer = |query: &QueryLine| {
        let before_us = now_us();
        let scene = scenes.get(&query.scene_id);
        let map = maps.get(query.scene_id.as_str());
        let fronts = fronts.get(query.scene_id.as_str());
        let grounding =
            map.zip(fronts).map(|(map, fronts)| grounder.ground_with_fronts(map, fronts, &query.utterance, None));
        let guess = grounding.as_ref().and_then(|g| g.object_id);
        let object = scene.zip(guess).and_then(|(scene, id)| scene.objects.get(id.0 as usize));
        Prediction {
            query_id: query.query_id.clone(),
            predicted_id: object.map(|object| object.id.clone()),
            status: grounding.as_ref().map_or(GroundingStatus::Unparsed, |g| g.status),
            score: grounding.as_ref().map_or(0.0, |g| g.score),
            time_us: now_us().saturating_sub(before_us),
            classes: classes_of(grounding.as_ref().and_then(|g| g.query.as_ref()), &query.utterance),
            query: grounding.and_then(|g| g.query),
        }
    };
    let predictions: Vec<Prediction> = queries.par_iter().map(answer).collect();
    let report = report_of(scenes, queries, &predictions);
    (predictions, report)
}

/// Scores predictions, one per query in the same order, where the truth is known.
pub(super) fn report_of(
    scenes: &BTreeMap<String, SceneLine>,
    queries: &[QueryLine],
    predictions: &[Prediction],
) -> Report {
    let mut counts: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    let mut abstained: BTreeMap<String, usize> = BTreeMap::new();
    let mut asked: BTreeMap<String, usize> = BTreeMap::new();
    for (query, prediction) in queries.iter().zip(predictions) {
        *abstained.entry(query.dataset.clone()).or_default() += usize::from(prediction.predicted_id.is_none());
        *asked.entry(query.dataset.clone()).or_default() += 1;
        for (name, right) in outcomes(scenes.get(&query.scene_id), query, prediction) {
            for key in std::iter::once(name.clone()).chain(splits(query).map(|split| format!("{name}/{split}"))) {
                let count = counts.entry(key).or_default();
                count[0] += usize::from(right);
                count[1] += 1;
            }
        }
    }
    let rates = counts.into_iter().map(|(key, [right, count])| (key, Rate::new(right, count))).collect();
    let detected = queries.iter().any(|query| query.scene_id.ends_with("#det"));
    let tier = if detected { "true boxes and labels; `det`: detected boxes" } else { "true boxes and labels" };
    let judged = queries.iter().filter(|query| query.target_id.is_some() || query.target_box.is_some()).count();
    let time_us = TimeUs::of(predictions);
    let classes = rates_by_class(scenes, queries, predictions);
    let tier_of = |query: &QueryLine| {
        let tier = if query.scene_id.ends_with("#det") { "detected boxes" } else { "true boxes and labels" };
        (query.dataset.clone(), tier.to_owned())
    };
    let tiers = queries.iter().map(tier_of).collect();
    Report { tier: tier.to_owned(), tiers, rates, queries: asked, judged, abstained, time_us, classes }
}

/// Whether an answer is right (for a box, Acc@.25); `None` when the truth is not known.
pub(super) fn is_right(scene: Option<&SceneLine>, query: &QueryLine, prediction: &Prediction) -> Option<bool> {
    outcomes(scene, query, prediction).first().map(|(_, right)| *right)
}

/// What is scored of a query: top-1 where the target's identity is known, Acc@.25 and @.5 where its box is.
fn outcomes(scene: Option<&SceneLine>, query: &QueryLine, prediction: &Prediction) -> Vec<(String, bool)> {
    let guessed = |object: &&BoxObject| Some(&object.id) == prediction.predicted_id.as_ref();
    if let Some(target) = query.target_box {
        let found = scene.and_then(|scene| scene.objects.iter().find(guessed));
        let overlap = |o: &BoxObject| TargetBox { center: o.center, size: o.size }.aabb().iou(&target.aabb());
        let iou = found.map_or(0.0, overlap);
        return [(25, 0.25), (50, 0.5)].map(|(p, t)| (format!("{}@{p}", query.dataset), iou >= t)).to_vec();
    }
    match &query.target_id {
        Some(target) => vec![(query.dataset.clone(), prediction.predicted_id.as_ref() == Some(target))],
        None => Vec::new(),
    }
}

fn splits(query: &QueryLine) -> impl Iterator<Item = &str> {
    let choose = |value: Option<bool>, yes, no| value.map(|value| if value { yes } else { no });
    [
        choose(query.hard, "hard", "easy"),
        choose(query.view_dependent, "view_dep", "view_indep"),
        choose(query.unique, "unique", "multiple"),
        query.reference_type.as_deref(),
    ]
    .into_iter()
    .flatten()
}

#[cfg(test)]
mod tests {
    //! Contract: lines are read, grounded without truth, and counted per split with their interval.
    use super::super::{read_queries, read_scenes};
    use super::*;
    use crate::ground::GroundConfig;
    use crate::knowledge::Knowledge;
    use std::sync::Arc;

    const SCENES: &str = r#"{"scene_id": "a", "objects": [
        {"id": 7, "label": "table", "center": [0,0,0.4], "size": [1,1,0.8], "mean_rgb": [120,80,40], "front": null, "score": null},
        {"id": "x", "label": "lamp", "center": [0,0,1.0], "size": [0.2,0.2,0.4], "mean_rgb": null, "front": null, "score": null},
        {"id": 9, "label": "lamp", "center": [3,0,1.0], "size": [0.2,0.2,0.4], "mean_rgb": null, "front": null, "score": null}]}"#;

    #[test]
    fn queries_are_counted_by_split() {
        let scenes = read_scenes(&SCENES.replace('\n', " ")).unwrap();
        let queries = read_queries(concat!(
            r#"{"dataset": "d", "query_id": "1", "scene_id": "a", "utterance": "the lamp on the table", "target_id": "x", "hard": false}"#,
            "\n\n",
            r#"{"dataset": "d", "query_id": "2", "scene_id": "a", "utterance": "the fridge", "target_id": 7, "hard": true}"#,
            "\n",
            r#"{"dataset": "b", "query_id": "3", "scene_id": "a", "utterance": "the table", "target_box": {"center": [0,0,0.4], "size": [1,1,0.8]}}"#,
            "\n",
            r#"{"dataset": "d", "query_id": "4", "scene_id": "nowhere", "utterance": "the table"}"#,
        ))
        .unwrap();
        let knowledge = Arc::new(Knowledge::embedded().unwrap());
        let grounder = Grounder::new(GroundConfig::default(), knowledge).unwrap();
        let (predictions, report) = evaluate(&scenes, &queries, &grounder, || 0);
        assert_eq!(predictions[0].predicted_id, Some("x".into()));
        assert_eq!(predictions[1].predicted_id, None);
        assert_eq!((report.rates["d"].right, report.rates["d"].count), (1, 2));
        assert_eq!(report.rates["d/easy"].percent, 100.0);
        assert_eq!(report.rates["b@50"].right, 1);
        assert_eq!(report.abstained["d"], 2);
        assert!(read_queries("{\"dataset\": 1}").is_err());
    }

    #[test]
    fn a_table_outside_its_splits_is_refused() {
        let rates = [("d", 5, 10), ("d/easy", 4, 6), ("d/hard", 1, 4)];
        let rates = rates.map(|(name, right, count)| (name.to_owned(), Rate::new(right, count)));
        let (queries, abstained) = (BTreeMap::new(), BTreeMap::new());
        let tier = String::new();
        let time_us = TimeUs::default();
        let (tiers, classes) = (BTreeMap::new(), BTreeMap::new());
        let mut report = Report { tier, tiers, rates: rates.into(), queries, judged: 10, abstained, time_us, classes };
        assert_eq!(find_contradiction(&report), None);
        report.rates.insert("d".to_owned(), Rate::new(9, 10));
        assert!(find_contradiction(&report).is_some());
    }

    #[test]
    fn what_is_meant_is_there() {
        let scenes = read_scenes(
            &r#"{"scene_id": "a", "objects": [
            {"id": 1, "label": "bed", "center": [0,0,0.3], "size": [2,1.6,0.6], "mean_rgb": null, "front": [1,0,0]},
            {"id": 2, "label": "nightstand", "center": [-0.5,1.2,0.3], "size": [0.4,0.4,0.5], "mean_rgb": null},
            {"id": 3, "label": "nightstand", "center": [-0.5,-1.2,0.3], "size": [0.4,0.4,0.5], "mean_rgb": null},
            {"id": 4, "label": "flurb", "center": [4,0,0.3], "size": [0.4,0.4,0.5], "mean_rgb": null}]}"#
                .replace('\n', " "),
        )
        .unwrap();
        let grounder = Grounder::new(GroundConfig::referring(), Arc::new(Knowledge::embedded().unwrap())).unwrap();
        let (map, fronts) = (scenes["a"].import(), scenes["a"].fronts());
        // A viewer who faces the front of the bed looks along -x, so that its left is -y.
        for (text, position) in [
            ("the nightstand to the left of the bed", 2),
            ("facing the front of the bed, choose the nightstand that is on the right of it", 1),
            ("the flurb", 3),
            ("the object is a flurb. it has a bed next to it.", 3),
            ("the nightstand with a bed to its right", 2),
            ("facing the bed, the one on the left", 0),
        ] {
            let answer = grounder.ground_with_fronts(&map, &fronts, text, None);
            assert_eq!(answer.object_id.map(|id| id.0), Some(position), "{text}: {:#?}", answer.query);
        }
    }
}
