//! Relations between objects, computed anew only around what changed. Definitions: [`RelationKind`].

use super::config::BuildConfig;
use super::draft::Draft;
use super::late::{self, Late};
use super::tracks::Tracks;
use crate::geometry::{distance_m, intersection_area_m2};
use crate::knowledge::Knowledge;
use crate::map::{MapChange, MapObject, ObjectId, ObjectState, Relation, RelationKind};
use std::collections::BTreeSet;

/// Footprint overlap over the smaller footprint from which one thing is over another.
const OVERLAP: f64 = 0.3;
/// Largest distance between a lower face and the surface that carries it, metres.
const REST_M: f64 = 0.08;
/// Smallest gap of above and below, metres.
const ABOVE_GAP_M: f64 = 0.06;
/// Largest gap of above and below, metres.
const ABOVE_REACH_M: f64 = 2.5;
/// Share of a volume that lies in another box from which it is inside.
const INSIDE: f64 = 0.7;
/// Largest gap of things that touch from the side, metres.
const AGAINST_M: f64 = 0.06;
/// Near neighbours that are stored per object, the closest first.
const NEAR_COUNT: usize = 8;
/// Distance up to which a semantic relation holds between two instances, metres.
const SEMANTIC_M: f64 = 1.5;
/// Change of centre or size from which relations are computed anew, metres.
const MOVED_M: f64 = 0.01;

/// The relations of all stable objects whose box or name changed, and of their neighbours.
pub(super) fn relate(
    config: &BuildConfig,
    knowledge: &Knowledge,
    draft: &Draft,
    tracks: &mut Tracks,
    late: &Late,
) -> Option<MapChange> {
    let mut changed = Vec::new();
    for id in draft.edited() {
        let (Some(object), Some(track)) = (draft.find(id), tracks.find(id)) else { continue };
        let same = track.related.as_ref().is_some_and(|(bounds, name)| {
            name == object.name()
                && (bounds.center - object.bounds.center).norm() < MOVED_M
                && (bounds.size - object.bounds.size).norm() < MOVED_M
        });
        if object.state == ObjectState::Stable && !same {
            tracks.change(id, |track| track.related = Some((object.bounds, object.name().to_owned())));
            changed.push(id);
        }
    }
    if changed.is_empty() {
        return None;
    }
    let reach = config.near_m.max(SEMANTIC_M);
    let stable = |id: &ObjectId| draft.find(*id).is_some_and(|o| o.state == ObjectState::Stable);
    let neighbours = |id: ObjectId| -> Vec<ObjectId> {
        let Some(grown) = tracks.find(id).map(|t| t.aabb.grown(reach)) else { return Vec::new() };
        // Above and below reach further than near: let height not gate.
        let overlaps = |t: &super::track::Track| {
            (0..2).all(|i| grown.min[i] <= t.aabb.max[i] && t.aabb.min[i] <= grown.max[i])
                && t.aabb.min.z <= grown.max.z + ABOVE_REACH_M
                && grown.min.z - ABOVE_REACH_M <= t.aabb.max.z
        };
        let mut found = tracks.find_over(&grown);
        found.retain(|other| *other != id && tracks.find(*other).is_some_and(overlaps) && stable(other));
        found
    };
    let mut about: BTreeSet<ObjectId> = changed.iter().copied().collect();
    changed.iter().for_each(|id| about.extend(neighbours(*id)));
    let mut relations = Vec::new();
    for &id in &about {
        let (Some(from), Some(track)) = (draft.find(id), tracks.find(id)) else { continue };
        let mut near = Vec::new();
        for other in neighbours(id) {
            let (Some(to), Some(to_track)) = (draft.find(other), tracks.find(other)) else { continue };
            relate_pair(
                config,
                knowledge,
                (from, &track.surfaces),
                (to, &to_track.surfaces),
                &mut relations,
                &mut near,
            );
        }
        keep_nearest(near, &mut relations);
    }
    let about: Vec<ObjectId> = about.into_iter().collect();
    let held = |id: ObjectId| draft.find(id).filter(|object| object.state == ObjectState::Stable);
    late::join(&mut relations, late.relations_from(&about, held));
    Some(MapChange::Relate { about, relations })
}

/// All relations between objects whose boxes and upward faces (heights in metres) are known: the definitions of
/// [`RelationKind`] without a builder, for example for true boxes.
pub fn relate_all(config: &BuildConfig, knowledge: &Knowledge, objects: &[(MapObject, Vec<f64>)]) -> Vec<Relation> {
    let mut relations = Vec::new();
    for (from, from_surfaces) in objects {
        let mut near = Vec::new();
        for (to, to_surfaces) in objects.iter().filter(|(to, _)| to.id != from.id) {
            relate_pair(config, knowledge, (from, from_surfaces), (to, to_surfaces), &mut relations, &mut near);
        }
        keep_nearest(near, &mut relations);
    }
    relations.sort_by_key(|r| (r.from, r.to, r.kind));
    relations
}

/// Keeps the closest neighbours.
fn keep_nearest(mut near: Vec<(f64, Relation)>, relations: &mut Vec<Relation>) {
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.to.cmp(&b.1.to)));
    relations.extend(near.into_iter().take(NEAR_COUNT).map(|(_, relation)| relation));
}

/// Distance from the lower face of `upper` to the closest surface of `lower`, if it rests there.
fn find_rest_gap_m(upper: &MapObject, lower: &MapObject, surfaces: &[f64], overlap: f64) -> Option<f64> {
    let bottom = upper.bounds.bottom_m();
    // A support reaches below what it carries, or a floor-standing neighbour would rest on the mat beside it.
    if overlap < OVERLAP || lower.bounds.bottom_m() > bottom - 0.01 {
        return None;
    }
    let gap = surfaces.iter().map(|surface| (bottom - surface).abs()).fold(f64::INFINITY, f64::min);
    (gap <= REST_M).then_some(gap)
}

fn relate_pair(
    config: &BuildConfig,
    knowledge: &Knowledge,
    (from, from_surfaces): (&MapObject, &[f64]),
    (to, to_surfaces): (&MapObject, &[f64]),
    relations: &mut Vec<Relation>,
    near: &mut Vec<(f64, Relation)>,
) {
    let (a, b) = (&from.bounds, &to.bounds);
    let (a_outline, b_outline) = (a.footprint(), b.footprint());
    let common_m2 = intersection_area_m2(&a_outline, &b_outline);
    let overlap = common_m2 / (a.size.x * a.size.y).min(b.size.x * b.size.y).max(1e-6);
    let gap_up = a.bottom_m() - b.top_m();
    let gap_down = b.bottom_m() - a.top_m();
    let common_height = a.top_m().min(b.top_m()) - a.bottom_m().max(b.bottom_m());
    let shared_height = common_height / a.size.z.min(b.size.z).max(1e-6);
    let side_gap = distance_m(&a_outline, &b_outline);
    let distance = side_gap.hypot(gap_up.max(gap_down).max(0.0));
    let mut say = |kind, confidence: f64| {
        relations.push(Relation { from: from.id, to: to.id, kind, confidence: confidence.clamp(0.05, 1.0) as f32 });
    };
    let rests = |upper, lower, surfaces: &[f64]| find_rest_gap_m(upper, lower, surfaces, overlap);
    let (on, under) = (rests(from, to, to_surfaces), rests(to, from, from_surfaces));
    let certainty = |gap: f64| overlap.min(1.0) * (1.0 - gap / (2.0 * REST_M));
    if let Some(gap) = on {
        say(RelationKind::On, certainty(gap));
    } else if let Some(gap) = under {
        say(RelationKind::Under, certainty(gap));
    } else if overlap > OVERLAP && gap_up > ABOVE_GAP_M && gap_up < ABOVE_REACH_M {
        say(RelationKind::Above, overlap);
    } else if overlap > OVERLAP && gap_down > ABOVE_GAP_M && gap_down < ABOVE_REACH_M {
        say(RelationKind::Below, overlap);
    }
    let within = a.intersection_volume_m3(b) / a.volume_m3().max(1e-9);
    let inside = within >= INSIDE && a.volume_m3() < 0.7 * b.volume_m3();
    if inside {
        say(RelationKind::Inside, within);
    }
    let holds = b.volume_m3() < 0.7 * a.volume_m3() && a.intersection_volume_m3(b) >= INSIDE * b.volume_m3();
    let apart = on.is_none() && under.is_none() && !inside && !holds;
    if apart && shared_height > 0.3 {
        let reach = (0.25 * (a.size.xy().norm() + b.size.xy().norm())).clamp(0.15, 0.6);
        if side_gap <= reach && overlap < OVERLAP {
            say(RelationKind::NextTo, 1.0 - 0.5 * side_gap / reach);
        }
        if side_gap <= AGAINST_M && overlap < OVERLAP {
            say(RelationKind::Against, 1.0 - side_gap / (2.0 * AGAINST_M));
        }
    }
    let one_room = from.room.is_none() || to.room.is_none() || from.room == to.room;
    if apart && one_room && distance <= config.near_m {
        let relation = |kind| Relation {
            from: from.id,
            to: to.id,
            kind,
            confidence: (1.0 - 0.5 * distance / config.near_m) as f32,
        };
        near.push((distance, relation(RelationKind::Near)));
    }
    if let (Some(category), true) = (knowledge.find(from.name()), distance <= SEMANTIC_M) {
        let names = |list: &[String]| {
            list.iter().any(|name| name == to.name() || knowledge.find(name).is_some_and(|c| c.name == to.name()))
        };
        let nearness = 1.0 - 0.5 * distance / SEMANTIC_M;
        if names(&category.used_with) {
            say(RelationKind::UsedWith, nearness);
        }
        if names(&category.part_of) && distance <= 0.1 {
            say(RelationKind::PartOf, nearness);
        }
        if names(&category.stored_in) && (inside || on.is_some()) {
            say(RelationKind::StoredIn, nearness);
        }
    }
}
