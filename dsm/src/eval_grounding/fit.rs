//! Fits the weights of evidence, and says what they are worth on scenes they were not fitted on.
//!
//! The probability of a candidate is the softmax of its weighted evidence (conditional logit). The weights maximise the
//! probability of the true targets, held near their unfitted values by a quadratic penalty.

use super::data::{BoxObject, QueryLine, SceneLine, TargetBox};
use super::evaluate::{Prediction, Report, evaluate, report_of};
use crate::ground::{Grounder, RankingWeights};
use crate::map::Map;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Strength of the penalty on the squared distance of a weight from its unfitted value, in queries. Chosen, not fitted.
const PENALTY: f64 = 4.0;
/// Steps of the optimiser; the likelihood changes in the fourth digit after two thirds of them.
const STEPS: usize = 400;
/// Length of the first steps; it falls linearly to a twentieth.
const STEP: f64 = 0.06;
/// How much a query of a data set counts. Templates (`sr3d`) are many and alike.
const COUNTS: [(&str, f64); 2] = [("sr3d", 0.1), ("scanrefer_det", 0.7)];
/// A box that overlaps the true one this much is the target; if there is none, one that overlaps half as much.
const SAME_IOU: f64 = 0.5;

/// The evidence of one query with the truth.
#[derive(Clone, Debug)]
struct Example {
    fold: usize,
    counts: f64,
    rows: Vec<Vec<f32>>,
    right: Vec<bool>,
}

/// The part of `folds` a scene belongs to. All scans of one room (`scene0124_00`, `scene0124_01#det`) share a fold.
pub fn fold_of(scene_id: &str, folds: usize) -> usize {
    let room = scene_id.split(['_', '#']).next().unwrap_or(scene_id);
    let hash = room
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    // The low bits of similar names are alike.
    ((hash ^ (hash >> 29)) % folds.max(1) as u64) as usize
}

/// Evidence of all queries whose truth is known and among the candidates.
fn collect_examples(
    scenes: &BTreeMap<String, SceneLine>,
    queries: &[QueryLine],
    grounder: &Grounder,
    folds: usize,
) -> Vec<Example> {
    let maps: BTreeMap<&str, Map> = scenes.iter().map(|(id, scene)| (id.as_str(), scene.import())).collect();
    let example = |query: &QueryLine| {
        let (scene, map) = (scenes.get(&query.scene_id)?, maps.get(query.scene_id.as_str())?);
        let ranking = grounder.rank_evidence(map, &scene.fronts(), &query.utterance);
        let objects = ranking.ids.iter().map(|id| &scene.objects[id.0 as usize]);
        let right = find_right(query, &objects.collect::<Vec<_>>())?;
        let counts = COUNTS.iter().find(|(name, _)| *name == query.dataset).map_or(1.0, |(_, counts)| *counts);
        Some(Example { fold: fold_of(&query.scene_id, folds), counts, rows: ranking.rows, right })
    };
    queries.par_iter().filter_map(example).collect()
}

/// Which candidates are the target; `None` when none is, or when there is nothing to choose.
fn find_right(query: &QueryLine, candidates: &[&BoxObject]) -> Option<Vec<bool>> {
    let right: Vec<bool> = match (query.target_box, &query.target_id) {
        (Some(target), _) => {
            let iou = |o: &&BoxObject| TargetBox { center: o.center, size: o.size }.aabb().iou(&target.aabb());
            let overlaps: Vec<f64> = candidates.iter().map(iou).collect();
            let same = if overlaps.iter().any(|iou| *iou >= SAME_IOU) { SAME_IOU } else { 0.5 * SAME_IOU };
            overlaps.into_iter().map(|iou| iou >= same).collect()
        }
        (None, Some(target)) => candidates.iter().map(|object| object.id == *target).collect(),
        (None, None) => return None,
    };
    (right.contains(&true) && right.contains(&false)).then_some(right)
}

/// Weights that fit the examples best.
fn fit(examples: &[&Example]) -> RankingWeights {
    let unfitted: Vec<f64> = RankingWeights::unfitted().values().iter().map(|weight| f64::from(*weight)).collect();
    let count = unfitted.len();
    let (mut weights, mut mean, mut square) = (unfitted.clone(), vec![0.0; count], vec![0.0; count]);
    for step in 0..STEPS {
        let mut gradient: Vec<f64> =
            weights.iter().zip(&unfitted).map(|(weight, start)| PENALTY * (weight - start)).collect();
        // Collected in order and folded serially: the same weights for any number of threads.
        let parts: Vec<Vec<f64>> = examples.par_chunks(256).map(|chunk| slope(chunk, &weights)).collect();
        for part in parts {
            gradient.iter_mut().zip(part).for_each(|(sum, slope)| *sum += slope);
        }
        // Adam.
        let (fade, fade_square) = (0.9_f64, 0.99_f64);
        let length = STEP * (1.0 - 0.95 * step as f64 / STEPS as f64);
        let age = step as i32 + 1;
        for i in 0..count {
            mean[i] = fade * mean[i] + (1.0 - fade) * gradient[i];
            square[i] = fade_square * square[i] + (1.0 - fade_square) * gradient[i] * gradient[i];
            let direction = mean[i] / (1.0 - fade.powi(age));
            let scale = (square[i] / (1.0 - fade_square.powi(age))).sqrt() + 1e-9;
            weights[i] -= length * direction / scale;
        }
    }
    let rounded: Vec<f32> = weights.iter().map(|weight| ((weight * 1000.0).round() / 1000.0) as f32).collect();
    RankingWeights::new(&rounded).unwrap_or_else(RankingWeights::unfitted)
}

/// Gradient of the negative log-likelihood.
fn slope(examples: &[&Example], weights: &[f64]) -> Vec<f64> {
    let mut slope = vec![0.0; weights.len()];
    for example in examples {
        let sum = |row: &Vec<f32>| row.iter().zip(weights).map(|(x, weight)| f64::from(*x) * weight).sum::<f64>();
        let sums: Vec<f64> = example.rows.iter().map(sum).collect();
        let best = sums.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = sums.iter().map(|sum| (sum - best).exp()).collect();
        let all: f64 = shares.iter().sum();
        let right: f64 = shares.iter().zip(&example.right).filter(|(_, right)| **right).map(|(share, _)| share).sum();
        for ((row, share), is_right) in example.rows.iter().zip(&shares).zip(&example.right) {
            let wanted = if *is_right { share / right.max(1e-300) } else { 0.0 };
            let pull = example.counts * (share / all - wanted);
            if pull.abs() > 1e-9 {
                slope.iter_mut().zip(row).for_each(|(slope, x)| *slope += pull * f64::from(*x));
            }
        }
    }
    slope
}

/// Grounds every query with weights that were fitted on the other folds alone. `make` builds a grounder from weights.
pub fn cross_validate(
    scenes: &BTreeMap<String, SceneLine>,
    queries: &[QueryLine],
    folds: usize,
    make: impl Fn(RankingWeights) -> Grounder,
    now_us: impl Fn() -> u64 + Sync,
) -> (Vec<Prediction>, Report) {
    let examples = collect_examples(scenes, queries, &make(RankingWeights::unfitted()), folds);
    let mut held_out: BTreeMap<String, Prediction> = BTreeMap::new();
    for fold in 0..folds {
        let others: Vec<&Example> = examples.iter().filter(|example| example.fold != fold).collect();
        let grounder = make(fit(&others));
        let asked: Vec<QueryLine> =
            queries.iter().filter(|query| fold_of(&query.scene_id, folds) == fold).cloned().collect();
        let (predictions, _) = evaluate(scenes, &asked, &grounder, &now_us);
        held_out.extend(predictions.into_iter().map(|prediction| (prediction.query_id.clone(), prediction)));
    }
    let predictions: Vec<Prediction> =
        queries.iter().filter_map(|query| held_out.get(&query.query_id).cloned()).collect();
    let report = report_of(scenes, queries, &predictions);
    (predictions, report)
}

/// The weights as the source file that ships with the crate.
pub fn write_weights(weights: &RankingWeights) -> String {
    let mut text = "//! The fitted weights, as `dsm eval grounding --fit FILE` writes them.\n\n\
        use super::kind::COUNT;\n\n/// Weight by kind.\npub(super) const FITTED: [f32; COUNT] = [\n"
        .to_owned();
    for (name, weight) in RankingWeights::names().iter().zip(weights.values()) {
        text += &format!("    {weight:?}, // {name}\n");
    }
    text + "];\n"
}

/// Fits the weights on all queries whose truth is known.
pub fn fit_all(scenes: &BTreeMap<String, SceneLine>, queries: &[QueryLine], grounder: &Grounder) -> RankingWeights {
    let examples = collect_examples(scenes, queries, grounder, 1);
    fit(&examples.iter().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    //! Contract: fitting finds which evidence tells, and the scans of one room are never on both sides of a fold.
    use super::*;

    #[test]
    fn telling_evidence_gains_weight() {
        let count = RankingWeights::names().len();
        let example = |i: usize| {
            let mut rows = vec![vec![0.0; count]; 3];
            // Evidence 2 always speaks for the target, evidence 3 always against it.
            rows[i % 3][2] = 1.0;
            rows[(i + 1) % 3][3] = 1.0;
            Example { fold: 0, counts: 1.0, rows, right: (0..3).map(|c| c == i % 3).collect() }
        };
        let examples: Vec<Example> = (0..60).map(example).collect();
        let weights = fit(&examples.iter().collect::<Vec<_>>());
        let start = RankingWeights::unfitted();
        assert!(weights.values()[2] > start.values()[2] + 0.5, "{:?}", weights.values());
        assert!(weights.values()[3] < start.values()[3] - 0.5, "{:?}", weights.values());
        assert_eq!(weights.values()[5], start.values()[5]);
    }

    #[test]
    fn a_room_has_one_fold() {
        assert_eq!(fold_of("scene0124_00", 5), fold_of("scene0124_01#det", 5));
        let used: std::collections::BTreeSet<usize> = (0..60).map(|i| fold_of(&format!("scene{i:04}_00"), 5)).collect();
        assert_eq!(used.len(), 5);
    }
}
