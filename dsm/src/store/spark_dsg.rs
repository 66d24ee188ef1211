//! Scene graphs as spark_dsg (Hydra) reads and writes them as JSON, format version 1.1.
//!
//! Stable objects are nodes of the layer OBJECTS, rooms of the layer ROOMS. What spark_dsg has no place for (votes,
//! points, features, relations with their kinds, free space) stands in `metadata.dsm`, which spark_dsg keeps.

use super::StoreError;
use crate::geometry::OrientedBox;
use crate::map::{
    CellState, Map, MapChange, MapObject, MapUpdate, ObjectId, ObjectState, Provenance, Relation, Room, RoomId, Votes,
};
use crate::time::Stamp;
use nalgebra::{Point2, Point3, Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

const OBJECTS: u64 = 2;
const ROOMS: u64 = 4;
/// Labels that stand for none.
const NO_LABEL: u32 = u32::MAX;
/// Cell size of the free space of a map that has none, metres.
const CELL_M: f64 = 0.05;
/// Farther from what `metadata.dsm` says than by rounding: somebody moved it, metres (or parts of a quaternion).
const MOVED: f64 = 1e-5;

/// A node's identity: its letter in the highest byte.
fn symbol(letter: u8, number: u64) -> u64 {
    u64::from(letter) << 56 | number & 0x00ff_ffff_ffff_ffff
}

/// The graph.
pub(super) fn spark_dsg(map: &Map) -> Value {
    let mut nodes = Vec::new();
    let mut edges = Vec::new();
    let labels: BTreeMap<&str, u32> = {
        let mut names: Vec<&str> = map.stable_objects().map(|object| object.name()).collect();
        names.sort_unstable();
        names.dedup();
        names.into_iter().zip(0..).collect()
    };
    for object in map.stable_objects() {
        let id = symbol(b'O', object.id.0);
        nodes.push(
            json!({"id": id, "layer": OBJECTS, "partition": 0, "attributes": object_attributes(object, &labels)}),
        );
        if let Some(room) = object.room.filter(|room| map.find_room(*room).is_some()) {
            edges.push(edge(symbol(b'R', u64::from(room.0)), id, &[]));
        }
    }
    for room in &map.rooms {
        let id = symbol(b'R', u64::from(room.id.0));
        nodes.push(json!({"id": id, "layer": ROOMS, "partition": 0, "attributes": room_attributes(room)}));
        for other in room.neighbours.iter().filter(|other| **other > room.id && map.find_room(**other).is_some()) {
            edges.push(edge(id, symbol(b'R', u64::from(other.0)), &[]));
        }
    }
    // One edge for each pair; it holds the relations of both directions.
    let stable = |id| map.find_object(id).is_some_and(|object| object.state == ObjectState::Stable);
    let mut pairs: BTreeMap<(ObjectId, ObjectId), Vec<&Relation>> = BTreeMap::new();
    let (drawn, kept): (Vec<&Relation>, Vec<&Relation>) =
        map.relations.iter().partition(|r| stable(r.from) && stable(r.to) && r.from != r.to);
    for relation in drawn {
        pairs.entry((relation.from.min(relation.to), relation.from.max(relation.to))).or_default().push(relation);
    }
    edges.extend(pairs.iter().map(|((a, b), relations)| edge(symbol(b'O', a.0), symbol(b'O', b.0), relations)));
    let provisional: Vec<&MapObject> =
        map.objects.values().map(|object| &**object).filter(|object| object.state != ObjectState::Stable).collect();
    let cells: Vec<[i32; 3]> =
        map.free_space.known_cells().map(|([x, y], state)| [x, y, i32::from(state == CellState::Occupied)]).collect();
    let layer = |layer: u64| json!({"layer": layer, "partition": 0});
    json!({
        "SPARK_DSG_header": {"project_name": "main", "version": {"major": 1, "minor": 1, "patch": 3}},
        "directed": false, "multigraph": false, "nodes": nodes, "edges": edges,
        "layer_keys": [layer(2), layer(3), layer(4), layer(5)],
        "layer_names": {"AGENTS": layer(2), "OBJECTS": layer(2), "PLACES": layer(3), "ROOMS": layer(4), "BUILDINGS": layer(5)},
        "metadata": {
            "labelspaces": {"_l2p0": labels.iter().map(|(name, label)| json!([label, name])).collect::<Vec<_>>()},
            "dsm": {"stamp": map.stamp, "cell_m": map.free_space.resolution_m, "cells": cells,
                "provisional": provisional, "relations": kept,
                "provisional_provenance": provisional.iter().map(|object| &object.provenance).collect::<Vec<_>>()},
        },
    })
}

fn edge(from: u64, to: u64, relations: &[&Relation]) -> Value {
    let surest = relations.iter().map(|relation| relation.confidence).fold(0.0, f32::max);
    let metadata = if relations.is_empty() { json!({}) } else { json!({"dsm": {"relations": relations}}) };
    let (weight, weighted) = if relations.is_empty() { (1.0, false) } else { (surest, true) };
    let info = json!({"type": "EdgeAttributes", "weight": weight, "weighted": weighted, "metadata": metadata});
    json!({"source": from, "target": to, "info": info})
}

fn object_attributes(object: &MapObject, labels: &BTreeMap<&str, u32>) -> Value {
    let b = &object.bounds;
    let q = b.rotation.coords;
    let count = object.points.len().max(1) as u64;
    let mean = |k: usize| object.points.iter().map(|point| u64::from(point.color[k])).sum::<u64>() / count;
    let position: [f64; 3] = b.center.coords.into();
    let size: [f64; 3] = b.size.into();
    json!({
        "type": "ObjectNodeAttributes", "name": object.name(), "position": position,
        "semantic_label": labels.get(object.name()).copied().unwrap_or(NO_LABEL),
        "color": {"r": mean(0), "g": mean(1), "b": mean(2), "a": 255},
        "bounding_box": {"type": "OBB", "dimensions": size.map(|v| v as f32),
            "world_P_center": position.map(|v| v as f32),
            "world_R_center": {"w": q.w as f32, "x": q.x as f32, "y": q.y as f32, "z": q.z as f32}},
        "world_R_object": {"w": q.w, "x": q.x, "y": q.y, "z": q.z},
        "semantic_feature": {"rows": object.visual_feature.len(), "cols": 1, "data": object.visual_feature},
        "is_active": false, "is_predicted": false, "registered": false, "mesh_connections": [],
        "last_update_time_ns": object.last_seen.0.max(0), "metadata": {"dsm": object, "dsm_provenance": object.provenance},
    })
}

fn room_attributes(room: &Room) -> Value {
    let none = json!({"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0});
    json!({
        "type": "RoomNodeAttributes", "name": room.name, "position": [room.center.x, room.center.y, 0.0],
        "semantic_label": NO_LABEL, "color": {"r": 0, "g": 0, "b": 0, "a": 255},
        "bounding_box": {"type": "INVALID", "dimensions": [0.0, 0.0, 0.0], "world_P_center": [0.0, 0.0, 0.0],
            "world_R_center": none},
        "semantic_feature": {"rows": 0, "cols": 0, "data": null}, "semantic_class_probabilities": {},
        "is_active": false, "is_predicted": false, "last_update_time_ns": 0, "metadata": {"dsm": room},
    })
}

#[derive(Deserialize)]
struct Graph {
    nodes: Vec<Node>,
    #[serde(default)]
    edges: Vec<Edge>,
    #[serde(default)]
    metadata: Value,
}

#[derive(Deserialize)]
struct Node {
    id: u64,
    layer: u64,
    #[serde(default)]
    partition: u64,
    attributes: NodeAttributes,
}

#[derive(Deserialize)]
struct NodeAttributes {
    #[serde(default)]
    name: String,
    #[serde(default)]
    position: [f64; 3],
    bounding_box: Option<BoundingBox>,
    #[serde(default)]
    semantic_label: u64,
    #[serde(default)]
    metadata: Value,
}

#[derive(Deserialize)]
struct BoundingBox {
    #[serde(rename = "type")]
    kind: String,
    dimensions: [f64; 3],
    #[serde(rename = "world_P_center")]
    center: [f64; 3],
    #[serde(rename = "world_R_center")]
    rotation: Rotation,
}

#[derive(Deserialize)]
struct Rotation {
    w: f64,
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Deserialize)]
struct Edge {
    source: u64,
    target: u64,
    #[serde(default)]
    info: EdgeInfo,
}

#[derive(Default, Deserialize)]
struct EdgeInfo {
    #[serde(default)]
    metadata: Value,
}

/// What stands in the graph's `metadata.dsm`.
#[derive(Deserialize)]
struct Rest {
    stamp: Stamp,
    cell_m: f64,
    cells: Vec<[i32; 3]>,
    provisional: Vec<MapObject>,
    #[serde(default)]
    provisional_provenance: Vec<Provenance>,
    relations: Vec<Relation>,
}

fn ours<T: for<'a> Deserialize<'a>>(metadata: &Value) -> Option<T> {
    T::deserialize(metadata.get("dsm")?).ok()
}

/// Reads a graph as spark_dsg writes it, ours or another's. Objects and rooms are taken, with their names and boxes as the
/// graph has them; from `metadata.dsm` whatever else is known. Other layers (places, agents, the mesh) are left out.
///
/// # Errors
/// [`StoreError`]: the file cannot be read, or is no such graph.
pub fn import_spark_dsg(path: &Path) -> Result<Map, StoreError> {
    let text = std::fs::read(path).map_err(|source| StoreError::Io { path: path.to_owned(), source })?;
    let foreign = |reason: String| StoreError::Foreign { path: path.to_owned(), expected: "spark_dsg JSON", reason };
    let graph: Graph = serde_json::from_slice(&text).map_err(|error| foreign(error.to_string()))?;
    let rest: Option<Rest> = ours(&graph.metadata);
    let cell_m = rest.as_ref().map_or(CELL_M, |rest| rest.cell_m);
    let far = |cells: &[[i32; 3]]| cells.iter().any(|[x, y, _]| x.abs().max(y.abs()) > 5_000);
    if !(0.001..=1.0).contains(&cell_m) || rest.as_ref().is_some_and(|rest| far(&rest.cells)) {
        return Err(foreign("its free space cannot be: cells of 0.001 to 1 m within 5000 of the origin".into()));
    }
    let labels = label_names(&graph.metadata);
    let (mut objects, mut rooms) = (BTreeMap::new(), BTreeMap::new());
    for node in graph.nodes.iter().filter(|node| node.partition == 0) {
        match node.layer {
            OBJECTS => drop(objects.insert(node.id, import_object(node, &labels).map_err(foreign)?)),
            ROOMS => drop(rooms.insert(node.id, import_room(node))),
            _ => {}
        }
    }
    let mut relations = Vec::new();
    for edge in &graph.edges {
        let known: Option<Vec<Relation>> = edge
            .info
            .metadata
            .get("dsm")
            .and_then(|dsm| dsm.get("relations"))
            .and_then(|list| Vec::deserialize(list).ok());
        relations.extend(known.into_iter().flatten());
        for (a, b) in [(edge.source, edge.target), (edge.target, edge.source)] {
            if let (Some(room), Some(object)) = (rooms.get(&a).map(|room: &Room| room.id), objects.get_mut(&b)) {
                let object: &mut MapObject = object;
                object.room = Some(room);
            }
            if let (Some(room), Some(other)) = (rooms.get(&a).map(|room| room.id), rooms.get_mut(&b))
                && !other.neighbours.contains(&room)
            {
                other.neighbours.push(room);
                other.neighbours.sort_unstable();
            }
        }
    }
    let mut map = Map::new(cell_m);
    let mut rooms: Vec<Room> = rooms.into_values().collect();
    rooms.sort_by_key(|room| room.id);
    let mut changes: Vec<MapChange> = objects.into_values().map(|object| MapChange::Put(Box::new(object))).collect();
    let mut stamp = Stamp::default();
    if let Some(rest) = rest {
        stamp = rest.stamp;
        relations.extend(rest.relations);
        let mut provenance = rest.provisional_provenance.into_iter();
        changes.extend(rest.provisional.into_iter().map(|mut object| {
            object.provenance = provenance.next().filter(Provenance::is_sound).unwrap_or_default();
            MapChange::Put(Box::new(object))
        }));
        let state = |occupied: i32| if occupied == 0 { CellState::Free } else { CellState::Occupied };
        changes.push(MapChange::Cells(rest.cells.iter().map(|[x, y, s]| ([*x, *y], state(*s))).collect()));
    }
    changes.push(MapChange::Relate { about: relations.iter().map(|relation| relation.from).collect(), relations });
    changes.push(MapChange::Rooms(rooms));
    map.apply(MapUpdate { stamp, changes });
    Ok(map)
}

/// Names of the labels of objects.
fn label_names(metadata: &Value) -> BTreeMap<u64, String> {
    let pairs = metadata.get("labelspaces").and_then(|spaces| spaces.get("_l2p0")).and_then(Value::as_array);
    let name = |pair: &Value| Some((pair.get(0)?.as_u64()?, pair.get(1)?.as_str()?.to_owned()));
    pairs.into_iter().flatten().filter_map(name).collect()
}

fn import_object(node: &Node, labels: &BTreeMap<u64, String>) -> Result<MapObject, String> {
    let a = &node.attributes;
    let bounds = bounds_of(a).map_err(|reason| format!("node {}: {reason}", node.id))?;
    let id = ObjectId(node.id & 0x00ff_ffff_ffff_ffff);
    if let Some(mut known) = ours::<MapObject>(&a.metadata) {
        known.id = id;
        let provenance = a.metadata.get("dsm_provenance").and_then(|value| Provenance::deserialize(value).ok());
        known.provenance = provenance.filter(Provenance::is_sound).unwrap_or_default();
        let moved = (known.bounds.center - bounds.center).amax() > MOVED
            || (known.bounds.size - bounds.size).amax() > MOVED
            || known.bounds.rotation.angle_to(&bounds.rotation) > MOVED.sqrt();
        if moved {
            known.bounds = bounds;
        }
        if !a.name.is_empty() && a.name != known.name() {
            // Whoever gave it another name outvotes what was said before.
            let total = known.names.total();
            known.names.add(&a.name, total + 1.0);
        }
        return Ok(known);
    }
    let label = labels.get(&a.semantic_label).cloned().unwrap_or_default();
    let name = if a.name.is_empty() || !label.is_empty() { label } else { a.name.clone() };
    let mut names = Votes::default();
    names.add(if name.is_empty() { "object" } else { &name }, 1.0);
    Ok(MapObject::given(id, names, bounds))
}

fn bounds_of(attributes: &NodeAttributes) -> Result<OrientedBox, String> {
    let point = |p: [f64; 3]| Point3::from(Vector3::from(p));
    let bounds = match &attributes.bounding_box {
        Some(b) if b.kind != "INVALID" => {
            let r = &b.rotation;
            let rotation = UnitQuaternion::try_new(Quaternion::new(r.w, r.x, r.y, r.z), 1e-6);
            let rotation = rotation.ok_or("the rotation of its box has no length")?;
            OrientedBox { center: point(b.center), size: b.dimensions.into(), rotation }
        }
        _ => OrientedBox {
            center: point(attributes.position),
            size: Vector3::zeros(),
            rotation: UnitQuaternion::identity(),
        },
    };
    let finite = bounds.center.coords.iter().chain(bounds.size.iter()).all(|v| v.is_finite());
    if finite && bounds.size.iter().all(|v| *v >= 0.0) { Ok(bounds) } else { Err("its box cannot be".into()) }
}

fn import_room(node: &Node) -> Room {
    let a = &node.attributes;
    let id = RoomId((node.id & 0xffff_ffff) as u32);
    if let Some(known) = ours::<Room>(&a.metadata) {
        let name = if a.name.is_empty() { known.name.clone() } else { a.name.clone() };
        return Room { id, name, ..known };
    }
    // Without an outline: a square around its place.
    let (x, y) = (a.position[0], a.position[1]);
    let corner = |dx: f64, dy: f64| Point2::new(x + dx, y + dy);
    Room {
        id,
        name: if a.name.is_empty() { "room".into() } else { a.name.clone() },
        polygon: vec![corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)],
        center: Point2::new(x, y),
        area_m2: 1.0,
        neighbours: Vec::new(),
    }
}
