//! Relations of a map against those of the true boxes, by the same definitions ([`crate::map::RelationKind`]).
//!
//! True relations hold between seen things. A relation of the map is right when both its objects are assigned to things
//! between which it truly holds, and wrong otherwise; relations from or to things that do not count as seen are left out.
//! A copy, a fragment or a ghost makes its relations wrong.

use super::matching::{Matching, Verdict};
use super::rooms::contains;
use super::scene::{TrueScene, TrueThing};
use super::statistics::F1Count;
use crate::build::{BuildConfig, relate_all};
use crate::knowledge::Knowledge;
use crate::map::{Map, MapObject, ObjectId, RelationKind, RoomId, Votes};
use std::collections::{BTreeMap, BTreeSet};

/// Upward means steeper than this: cosine of the slope.
const UPWARD: f32 = 0.9;
/// Slices of height in which upward faces are gathered, metres.
const SLICE_M: f64 = 0.02;
/// Share of the footprint that the upward faces of a slice must cover to carry things.
const CARRYING_SHARE: f64 = 0.15;
/// Faces closer than this are one, metres.
const APART_M: f64 = 0.06;

/// Heights of the true upward faces of a thing, metres, rising; its top is the last.
fn find_surfaces(thing: &TrueThing) -> Vec<f64> {
    let (bottom, top) = (thing.bounds.bottom_m(), thing.bounds.top_m());
    let mut slices: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
    for point in thing.points.iter().filter(|p| p.normal.z >= UPWARD) {
        let (height, area) = (f64::from(point.position.z), f64::from(point.area_m2));
        let slice = slices.entry(((height - bottom) / SLICE_M) as i64).or_default();
        *slice = (slice.0 + area, slice.1 + area * height);
    }
    let footprint_m2 = thing.bounds.size.x * thing.bounds.size.y;
    let mut surfaces: Vec<f64> = Vec::new();
    for (area, moment) in slices.into_values().filter(|(area, _)| *area >= CARRYING_SHARE * footprint_m2) {
        let height = moment / area;
        if top - height > APART_M && surfaces.last().is_none_or(|last| height - last > APART_M) {
            surfaces.push(height);
        }
    }
    surfaces.push(top);
    surfaces
}

/// True relations between seen things, by their places in the scene.
fn true_relations(
    truth: &TrueScene,
    config: &BuildConfig,
    knowledge: &Knowledge,
) -> BTreeSet<(usize, usize, RelationKind)> {
    let objects: Vec<(MapObject, Vec<f64>)> = truth
        .objects
        .iter()
        .enumerate()
        .filter(|(_, thing)| thing.is_seen())
        .map(|(index, thing)| {
            let mut names = Votes::default();
            names.add(knowledge.find(&thing.category).map_or(&*thing.category, |c| &*c.name), 1.0);
            let place = thing.bounds.center.xy();
            let room = truth.rooms.iter().position(|room| contains(&room.polygon, &place));
            let room = room.map(|room| RoomId(room as u32));
            let object = MapObject { room, ..MapObject::given(ObjectId(index as u64), names, thing.bounds) };
            (object, find_surfaces(thing))
        })
        .collect();
    relate_all(config, knowledge, &objects).into_iter().map(|r| (r.from.0 as usize, r.to.0 as usize, r.kind)).collect()
}

/// Counts by kind of relation.
pub(super) fn compare(
    map: &Map,
    truth: &TrueScene,
    matching: &Matching,
    config: &BuildConfig,
    knowledge: &Knowledge,
) -> BTreeMap<RelationKind, F1Count> {
    let real = true_relations(truth, config, knowledge);
    let mut counts: BTreeMap<RelationKind, F1Count> = BTreeMap::new();
    let mut found = BTreeSet::new();
    for relation in &map.relations {
        let verdicts = [relation.from, relation.to].map(|id| matching.verdicts.get(&id).copied());
        let [Some(from), Some(to)] = verdicts else { continue };
        let unseen = |verdict: Verdict| match verdict {
            Verdict::Matched(thing) | Verdict::Duplicate(thing) => !truth.objects[thing].is_seen(),
            Verdict::Ghost => false,
        };
        if unseen(from) || unseen(to) {
            continue;
        }
        let count = counts.entry(relation.kind).or_default();
        match (from, to) {
            (Verdict::Matched(from), Verdict::Matched(to)) if real.contains(&(from, to, relation.kind)) => {
                count.right += 1;
                found.insert((from, to, relation.kind));
            }
            _ => count.wrong += 1,
        }
    }
    for relation in real.difference(&found) {
        counts.entry(relation.2).or_default().missed += 1;
    }
    counts
}
