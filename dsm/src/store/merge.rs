//! Two maps of one place in one, when it is known how they lie to each other.

use crate::Pose;
use crate::build::{BuildConfig, relate_all};
use crate::geometry::{Aabb, OrientedBox};
use crate::knowledge::Knowledge;
use crate::map::{
    CellState, FreeSpace, Map, MapChange, MapObject, MapUpdate, ObjectId, ObjectState, Relation, Room, RoomId,
};
use nalgebra::{Point2, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Overlap of boxes (intersection over union) from which two things with a name in common are one.
const SAME_IF_NAMED: f64 = 0.25;
/// The same whatever they are called: no two solid things share half of their space.
const SAME_WHATEVER: f64 = 0.5;
/// Farther apart than this no relation holds (`used_with` reaches 1.5 m, `above` 2.5 m).
const RELATION_REACH_M: f64 = 2.5;

/// What a merge did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Merged {
    /// Objects that both maps hold.
    pub in_both: usize,
    /// Objects that only the second map holds.
    pub added: usize,
    /// Rooms that both maps hold.
    pub rooms_in_both: usize,
    /// Rooms that only the second map holds.
    pub rooms_added: usize,
}

/// Puts `other` into a copy of `map`; `map_from_other` takes points of the other map's world into that of the first.
///
/// A thing that both hold keeps the identity of the first map, and the box of the map that saw it more often; votes and
/// points of both count. What the first map knows of the free space stays. Times are taken as of one clock.
pub fn merge_maps(
    map: &Map,
    other: &Map,
    map_from_other: &Pose,
    config: &BuildConfig,
    knowledge: &Knowledge,
) -> (Map, Merged) {
    let moved: Vec<MapObject> = other.objects.values().map(|object| transformed(object, map_from_other)).collect();
    let (rooms, room_ids, mut merged) = merge_rooms(map, other, map_from_other);
    let pairs = find_pairs(map, &moved);
    let mut next = map.objects.keys().next_back().map_or(0, |id| id.0 + 1);
    let mut ids: BTreeMap<ObjectId, ObjectId> = BTreeMap::new();
    let mut objects: BTreeMap<ObjectId, MapObject> =
        map.objects.iter().map(|(id, object)| (*id, (**object).clone())).collect();
    let mut shared = BTreeSet::new();
    for mut object in moved {
        let theirs = object.id;
        object.room = object.room.and_then(|room| room_ids.get(&room).copied());
        match pairs.get(&theirs).and_then(|ours| objects.get_mut(ours)) {
            Some(known) => {
                merged.in_both += 1;
                shared.insert(known.id);
                ids.insert(theirs, known.id);
                fuse(known, &object, config.max_points);
            }
            None => {
                merged.added += 1;
                object.id = ObjectId(next);
                next += 1;
                ids.insert(theirs, object.id);
                objects.insert(object.id, object);
            }
        }
    }
    let mut relations: BTreeMap<_, Relation> = BTreeMap::new();
    let theirs = other
        .relations
        .iter()
        .filter_map(|r| Some(Relation { from: *ids.get(&r.from)?, to: *ids.get(&r.to)?, ..r.clone() }));
    let between = relate_between(map, &objects, &shared, config, knowledge);
    for relation in map.relations.iter().cloned().chain(theirs).chain(between).filter(|r| r.from != r.to) {
        // Of two that say the same, the surer one.
        let known = relations.entry((relation.from, relation.to, relation.kind)).or_insert_with(|| relation.clone());
        known.confidence = known.confidence.max(relation.confidence);
    }
    let mut result = Map::new(map.free_space.resolution_m);
    let mut changes: Vec<MapChange> = Vec::new();
    let about = objects.keys().copied().collect();
    changes.extend(objects.into_values().map(|object| MapChange::Put(Box::new(object))));
    changes.push(MapChange::Relate { about, relations: relations.into_values().collect() });
    changes.push(MapChange::Rooms(rooms));
    changes.push(MapChange::Cells(map.free_space.known_cells().collect()));
    changes.push(MapChange::Cells(new_cells(&map.free_space, &other.free_space, map_from_other)));
    result.apply(MapUpdate { stamp: map.stamp.max(other.stamp), changes });
    (result, merged)
}

fn transformed(object: &MapObject, pose: &Pose) -> MapObject {
    let mut moved = object.clone();
    let b = &object.bounds;
    moved.bounds = OrientedBox { center: pose * b.center, size: b.size, rotation: pose.rotation * b.rotation };
    for point in &mut moved.points {
        point.position = (pose * point.position.cast::<f64>()).cast();
    }
    moved
}

/// For things of the other map the thing of the first that they are: closest fits first, one to one.
fn find_pairs(map: &Map, moved: &[MapObject]) -> BTreeMap<ObjectId, ObjectId> {
    let ours: Vec<(Aabb, &MapObject)> = map.stable_objects().map(|object| (object.bounds.aabb(), object)).collect();
    let mut found = Vec::new();
    for theirs in moved.iter().filter(|object| object.state == ObjectState::Stable) {
        let around = theirs.bounds.aabb();
        for (_, ours) in ours.iter().filter(|(aabb, _)| aabb.find_intersection(&around).is_some()) {
            let iou = ours.bounds.iou(&theirs.bounds);
            let named = ours.names.share(theirs.name()) > 0.0 || theirs.names.share(ours.name()) > 0.0;
            if iou >= if named { SAME_IF_NAMED } else { SAME_WHATEVER } {
                found.push((iou, ours.id, theirs.id));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut pairs, mut taken) = (BTreeMap::new(), BTreeSet::new());
    for (_, ours, theirs) in found {
        if !pairs.contains_key(&theirs) && taken.insert(ours) {
            pairs.insert(theirs, ours);
        }
    }
    pairs
}

fn fuse(known: &mut MapObject, other: &MapObject, max_points: usize) {
    let (a, b) = (known.observations as f32, other.observations as f32);
    let blend = |ours: &mut Vec<f32>, theirs: &[f32]| {
        if ours.len() == theirs.len() {
            let sum = ours.iter().zip(theirs).map(|(x, y)| a * x + b * y).collect();
            *ours = crate::perceive::normalize(sum);
        }
    };
    blend(&mut known.visual_feature, &other.visual_feature);
    blend(&mut known.text_feature, &other.text_feature);
    known.names.merge(&other.names);
    known.attributes.merge(&other.attributes);
    known.provenance.merge(&other.provenance);
    if other.observations > known.observations {
        known.bounds = other.bounds;
    }
    known.points.extend_from_slice(&other.points);
    let count = known.points.len();
    if count > max_points {
        // Evenly, so that both parts keep their share.
        known.points = (0..max_points).map(|i| known.points[i * count / max_points]).collect();
    }
    known.room = known.room.or(other.room);
    known.observations = known.observations.saturating_add(other.observations);
    known.first_seen = known.first_seen.min(other.first_seen);
    known.last_seen = known.last_seen.max(other.last_seen);
}

/// Relations between things that only one of the maps holds each: neither map could know them. A thing's upward face is
/// its top here; boards inside it are known to its own map alone.
fn relate_between(
    map: &Map,
    objects: &BTreeMap<ObjectId, MapObject>,
    shared: &BTreeSet<ObjectId>,
    config: &BuildConfig,
    knowledge: &Knowledge,
) -> Vec<Relation> {
    let stable =
        || objects.values().filter(|object| object.state == ObjectState::Stable && !shared.contains(&object.id));
    let (ours, theirs): (Vec<&MapObject>, Vec<&MapObject>) =
        stable().partition(|object| map.objects.contains_key(&object.id));
    let close = |object: &MapObject, others: &[&MapObject]| {
        let around = object.bounds.aabb().grown(RELATION_REACH_M);
        others.iter().any(|other| other.bounds.aabb().find_intersection(&around).is_some())
    };
    let pick = |from: &[&MapObject], others: &[&MapObject]| -> Vec<(MapObject, Vec<f64>)> {
        let near = from.iter().filter(|object| close(object, others));
        near.map(|object| ((**object).clone(), vec![object.bounds.top_m()])).collect()
    };
    let mut all = pick(&ours, &theirs);
    all.extend(pick(&theirs, &ours));
    let is_ours = |id| map.objects.contains_key(&id);
    relate_all(config, knowledge, &all).into_iter().filter(|r| is_ours(r.from) != is_ours(r.to)).collect()
}

fn merge_rooms(map: &Map, other: &Map, map_from_other: &Pose) -> (Vec<Room>, BTreeMap<RoomId, RoomId>, Merged) {
    let place = |p: &Point2<f64>| (map_from_other * Point3::new(p.x, p.y, 0.0)).xy();
    let mut rooms = map.rooms.clone();
    let known = rooms.len();
    let (mut ids, mut merged) = (BTreeMap::new(), Merged::default());
    let mut next = rooms.iter().map(|room| room.id.0 + 1).max().unwrap_or(0);
    for theirs in &other.rooms {
        let mut moved = Room {
            polygon: theirs.polygon.iter().map(place).collect(),
            center: place(&theirs.center),
            ..theirs.clone()
        };
        let same = |ours: &Room| contains(&ours.polygon, &moved.center) || contains(&moved.polygon, &ours.center);
        if let Some(ours) = rooms[..known].iter_mut().find(|ours| same(ours)) {
            merged.rooms_in_both += 1;
            ids.insert(theirs.id, ours.id);
            if moved.area_m2 > ours.area_m2 {
                (ours.polygon, ours.center, ours.area_m2) = (moved.polygon, moved.center, moved.area_m2);
            }
            // `room` is what a room is called of which nothing tells.
            if ours.name == "room" {
                ours.name = moved.name;
            }
        } else {
            merged.rooms_added += 1;
            moved.id = RoomId(next);
            ids.insert(theirs.id, moved.id);
            next += 1;
            moved.neighbours.clear();
            rooms.push(moved);
        }
    }
    for theirs in &other.rooms {
        let neighbours: Vec<RoomId> = theirs.neighbours.iter().filter_map(|id| ids.get(id).copied()).collect();
        let Some(ours) = ids.get(&theirs.id).and_then(|id| rooms.iter_mut().find(|room| room.id == *id)) else {
            continue;
        };
        let own = ours.id;
        ours.neighbours.extend(neighbours.into_iter().filter(|id| *id != own));
        ours.neighbours.sort_unstable();
        ours.neighbours.dedup();
    }
    (rooms, ids, merged)
}

/// Whether a point lies inside an outline, by the number of edges to its right.
fn contains(polygon: &[Point2<f64>], point: &Point2<f64>) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crosses = |(a, b): &(&Point2<f64>, &Point2<f64>)| {
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    edges.filter(crosses).count() % 2 == 1
}

/// Cells that only the other map knows, looked up backwards so that a turn leaves no holes.
fn new_cells(ours: &FreeSpace, theirs: &FreeSpace, map_from_other: &Pose) -> Vec<([i32; 2], CellState)> {
    let place = |cell: [i32; 2]| {
        let p = theirs.center_of(cell);
        ours.cell_at(&(map_from_other * Point3::new(p.x, p.y, 0.0)).xy())
    };
    let [x, y] = theirs.origin_cell;
    let (last_x, last_y) = (x + theirs.columns as i32, y + theirs.rows as i32);
    let corners = [[x, y], [last_x, y], [x, last_y], [last_x, last_y]].map(place);
    let range = |k: usize| {
        let of = |corner: &[i32; 2]| corner[k];
        corners.iter().map(of).min().unwrap_or(0) - 1..=corners.iter().map(of).max().unwrap_or(0) + 1
    };
    let other_from_map = map_from_other.inverse();
    let mut cells = Vec::new();
    for cell in range(1).flat_map(|row| range(0).map(move |column| [column, row])) {
        let p = ours.center_of(cell);
        let state = theirs.state_at(&(other_from_map * Point3::new(p.x, p.y, 0.0)).xy());
        if state != CellState::Unknown && ours.state(cell) == CellState::Unknown {
            cells.push((cell, state));
        }
    }
    cells
}
