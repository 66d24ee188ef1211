//! The map as plain data for scripts: `dsm map show --json`.

use crate::map::{AttributeKind, Map, MapObject, RelationKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Attribute values of one object by key, winners only; uses may hold several words.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownAttributes {
    /// Colour, pattern, texture.
    pub appearance: BTreeMap<String, String>,
    /// Material, weight, smoothness, size.
    pub physical: BTreeMap<String, String>,
    /// What it is for and how it is operated.
    pub affordance: BTreeMap<String, Vec<String>>,
}

/// One object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownObject {
    /// Identity.
    pub id: u64,
    /// Name.
    pub name: String,
    /// Centre of its box, world frame, metres.
    pub center: [f64; 3],
    /// Side lengths of its box, metres.
    pub size: [f64; 3],
    /// Rotation of its box, world from box, w first.
    pub quat_wxyz: [f64; 4],
    /// Attributes.
    pub attributes: ShownAttributes,
    /// Name of its room.
    pub room: Option<String>,
    /// Number of frames it was seen in.
    pub observations: u32,
    /// Confidence, 0 to 1.
    pub confidence: f32,
}

/// One relation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownRelation {
    /// The object that is described.
    pub from: u64,
    /// The anchor.
    pub to: u64,
    /// The relation.
    pub kind: RelationKind,
    /// Confidence, 0 to 1.
    pub confidence: f32,
}

/// One room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownRoom {
    /// Identity.
    pub id: u32,
    /// Name.
    pub name: String,
    /// Outline, world frame, metres.
    pub polygon: Vec<[f64; 2]>,
}

/// The stable part of a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownMap {
    /// Stable objects.
    pub objects: Vec<ShownObject>,
    /// Relations between them.
    pub relations: Vec<ShownRelation>,
    /// Rooms.
    pub rooms: Vec<ShownRoom>,
}

/// Lists the stable objects of a map, their relations and the rooms.
pub fn show_map(map: &Map) -> ShownMap {
    let stable = |id| map.find_object(id).is_some_and(|o| o.state == crate::map::ObjectState::Stable);
    ShownMap {
        objects: map.stable_objects().map(|o| show_object(map, o)).collect(),
        relations: map
            .relations
            .iter()
            .filter(|r| stable(r.from) && stable(r.to))
            .map(|r| ShownRelation { from: r.from.0, to: r.to.0, kind: r.kind, confidence: r.confidence })
            .collect(),
        rooms: map
            .rooms
            .iter()
            .map(|r| ShownRoom {
                id: r.id.0,
                name: r.name.clone(),
                polygon: r.polygon.iter().map(|p| [p.x, p.y]).collect(),
            })
            .collect(),
    }
}

fn show_object(map: &Map, object: &MapObject) -> ShownObject {
    let b = &object.bounds;
    ShownObject {
        id: object.id.0,
        name: object.name().to_owned(),
        center: b.center.coords.into(),
        size: b.size.into(),
        quat_wxyz: [b.rotation.w, b.rotation.i, b.rotation.j, b.rotation.k],
        attributes: show_attributes(object),
        room: object.room.and_then(|id| map.find_room(id)).map(|room| room.name.clone()),
        observations: object.observations,
        confidence: object.confidence(),
    }
}

fn show_attributes(object: &MapObject) -> ShownAttributes {
    let mut shown = ShownAttributes::default();
    for (kind, key, votes) in object.attributes.iter() {
        let Some((winner, share)) = votes.find_winner() else { continue };
        match kind {
            AttributeKind::Appearance => drop(shown.appearance.insert(key.to_owned(), winner.to_owned())),
            AttributeKind::Physical => drop(shown.physical.insert(key.to_owned(), winner.to_owned())),
            AttributeKind::Affordance => {
                // Words that were said about as often as the winner all hold.
                let words =
                    votes.iter().filter(|(word, _)| votes.share(word) >= 0.5 * share).map(|(word, _)| word.to_owned());
                shown.affordance.insert(key.to_owned(), words.collect());
            }
        }
    }
    shown
}
