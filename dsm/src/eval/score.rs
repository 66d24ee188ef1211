//! What one map is worth against the truth.

use super::matching::{Matching, Verdict, count, match_objects, pick};
use super::scene::{TrueScene, TrueThing};
use super::statistics::{F1Count, Mean, Share};
use super::{attributes, faults, relations, rooms, segmentation};
use crate::build::BuildConfig;
use crate::geometry::upright_box_around;
use crate::knowledge::Knowledge;
use crate::map::{AttributeKind, Map, MapObject};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Points of an object whose error is measured.
const ERROR_POINTS: usize = 300;

/// Counts of one map. Rates are of stable objects.
///
/// | name | what |
/// |---|---|
/// | `precision`, `duplicate`, `ghost`, `over_merge` | shares of the map's objects, see [`Matching`] |
/// | `recall` | share of the seen things that have an object |
/// | `acc_25`, `acc_50` | share of the seen things whose object's upright oriented box has at least this IoU with the true one, which is around all visible geometry, seen or not |
/// | `acc_25_seen`, `acc_50_seen` | the same against the box around the points that were seen |
/// | `acc_25_axis`, `acc_50_axis` | `acc_25`, `acc_50` with axis-aligned boxes |
/// | `name`, `color`, `material`, `pattern`, `weight` | of matched seen things; `_prior` is the baseline |
/// | `affordance` | F1 over the words that the author of the scene uses; `affordance_prior` is the baseline, `affordance_open` counts all words |
/// | `relation`, `relation_KIND` | F1, see [`crate::map::RelationKind`] |
/// | `room_precision`, `room_recall`, `room_name` | rooms with more than half in common |
/// | `point_error_m` | mean distance of map points of matched things to the true surface |
/// | `f_miou`, `mean_accuracy`, `weighted_iou` | the Replica protocol over classes of things |
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapScore {
    /// Shares.
    pub shares: BTreeMap<String, Share>,
    /// Means.
    pub means: BTreeMap<String, Mean>,
    /// Sets of words and relations.
    pub f1: BTreeMap<String, F1Count>,
    /// Ghosts, duplicates, poor boxes and missed things, one line each.
    pub faults: Vec<String>,
}

/// Scores a map. `config` holds the definition of near.
pub fn score_map(map: &Map, truth: &TrueScene, config: &BuildConfig, knowledge: &Arc<Knowledge>) -> MapScore {
    let matching = match_objects(map, truth);
    let mut score = MapScore { faults: faults::list(map, truth, &matching), ..MapScore::default() };
    score_objects(&mut score, truth, &matching);
    let pairs: Vec<(&MapObject, &TrueThing)> = truth
        .objects
        .iter()
        .zip(&matching.object_of)
        .filter_map(|(thing, id)| Some((map.find_object((*id)?)?, thing)))
        .filter(|(_, thing)| thing.is_seen())
        .collect();
    score_boxes(&mut score, truth, &pairs);
    let attributes = attributes::compare(knowledge, truth, &pairs);
    score.shares.extend(attributes.shares.into_iter().map(|(name, share)| (name.to_owned(), share)));
    score.faults.extend(attributes.faults);
    score.f1.insert("affordance".into(), attributes.affordance);
    score.f1.insert("affordance_prior".into(), attributes.affordance_prior);
    score.f1.insert("affordance_open".into(), attributes.affordance_open);
    score_relations(&mut score, relations::compare(map, truth, &matching, config, knowledge));
    let rooms = rooms::compare(map, &truth.rooms, knowledge);
    score.shares.insert("room_precision".into(), Share { hits: rooms.matched, count: rooms.found });
    score.shares.insert("room_recall".into(), Share { hits: rooms.matched, count: rooms.visited });
    score.shares.insert("room_name".into(), Share { hits: rooms.named, count: rooms.matched });
    let mut error = Mean::default();
    pairs.iter().for_each(|(object, thing)| add_point_error(&mut error, object, thing));
    score.means.insert("point_error_m".into(), error);
    let segmentation = segmentation::segment(map, truth, knowledge);
    let of_run = |sum: f64| Mean { sum, count: 1 };
    score.means.insert("f_miou".into(), of_run(segmentation.mean_iou));
    score.means.insert("mean_accuracy".into(), of_run(segmentation.mean_accuracy));
    score.means.insert("weighted_iou".into(), of_run(segmentation.weighted_iou));
    score.means.insert("classes".into(), of_run(segmentation.classes as f64));
    list_wrong_words(&mut score.faults, &pairs);
    score
}

fn score_objects(score: &mut MapScore, truth: &TrueScene, matching: &Matching) {
    let all = matching.verdicts.len();
    let mut add = |name: &str, hits: usize, count: usize| {
        score.shares.insert(name.into(), Share { hits, count });
    };
    add("precision", count(matching, |v| matches!(v, Verdict::Matched(_))), all);
    add("duplicate", count(matching, |v| matches!(v, Verdict::Duplicate(_))), all);
    add("ghost", count(matching, |v| *v == Verdict::Ghost), all);
    add("over_merge", matching.over_merged.len(), all);
    let seen = truth.objects.iter().zip(&matching.object_of).filter(|(thing, _)| thing.is_seen());
    let found = seen.clone().filter(|(_, object)| object.is_some()).count();
    add("recall", found, seen.count());
}

fn score_boxes(score: &mut MapScore, truth: &TrueScene, pairs: &[(&MapObject, &TrueThing)]) {
    let seen = truth.objects.iter().filter(|thing| thing.is_seen()).count();
    let mut add = |name: &str, ious: &[f64]| {
        for (least, percent) in [(0.25, 25), (0.5, 50)] {
            let hits = ious.iter().filter(|iou| **iou >= least).count();
            score.shares.insert(format!("acc_{percent}{name}"), Share { hits, count: seen });
        }
    };
    let oriented = |(object, thing): &(&MapObject, &TrueThing)| object.bounds.iou(&thing.bounds);
    let axis = |(object, thing): &(&MapObject, &TrueThing)| object.bounds.aabb().iou(&thing.bounds.aabb());
    let of_seen = |(object, thing): &(&MapObject, &TrueThing)| {
        let points: Vec<_> = thing.points.iter().filter(|p| p.seen).map(|p| p.position.cast::<f64>()).collect();
        upright_box_around(&points).map_or(0.0, |bounds| object.bounds.iou(&bounds))
    };
    add("", &pairs.iter().map(oriented).collect::<Vec<_>>());
    add("_axis", &pairs.iter().map(axis).collect::<Vec<_>>());
    add("_seen", &pairs.iter().map(of_seen).collect::<Vec<_>>());
    let mut iou = Mean::default();
    pairs.iter().map(oriented).for_each(|value| {
        iou.sum += value;
        iou.count += 1;
    });
    score.means.insert("box_iou".into(), iou);
}

fn score_relations(score: &mut MapScore, kinds: BTreeMap<crate::map::RelationKind, F1Count>) {
    let mut all = F1Count::default();
    for (kind, count) in kinds {
        all.right += count.right;
        all.wrong += count.wrong;
        all.missed += count.missed;
        let name = serde_json::to_value(kind).ok().and_then(|value| value.as_str().map(str::to_owned));
        score.f1.insert(format!("relation_{}", name.unwrap_or_default()), count);
    }
    score.f1.insert("relation".into(), all);
}

/// Distance of each point to the tangent plane of the nearest surface point, or to that point where the plane ends.
fn add_point_error(error: &mut Mean, object: &MapObject, thing: &TrueThing) {
    for point in pick(&object.points, ERROR_POINTS) {
        let nearest = thing.points.iter().map(|p| ((point.position - p.position).norm_squared(), p));
        let Some((square, surface)) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        let along = (point.position - surface.position).dot(&surface.normal).abs();
        let aside = (square - along * along).max(0.0).sqrt();
        // Half the diagonal of the square that the point stands for.
        let within = aside <= 0.71 * surface.area_m2.sqrt();
        error.sum += f64::from(if within { along } else { square.sqrt() });
        error.count += 1;
    }
}

fn list_wrong_words(faults: &mut Vec<String>, pairs: &[(&MapObject, &TrueThing)]) {
    for (object, thing) in pairs {
        let real = &thing.attributes;
        let said = |kind, key: &str| object.attributes.find(kind, key).unwrap_or("-").to_owned();
        faults.push(format!(
            "words: {} (truth {}): color {} ({}), material {} ({}), pattern {} ({}), weight {} ({})",
            object.name(),
            thing.category,
            said(AttributeKind::Appearance, "color"),
            real.color.as_deref().unwrap_or("-"),
            said(AttributeKind::Physical, "material"),
            real.material.as_deref().unwrap_or("-"),
            said(AttributeKind::Appearance, "pattern"),
            real.pattern.as_deref().unwrap_or("-"),
            said(AttributeKind::Physical, "weight"),
            real.weight.as_deref().unwrap_or("-"),
        ));
    }
}
