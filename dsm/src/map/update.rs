//! The map and the one way to change it.

use super::free_space::{CellState, FreeSpace};
use super::object::{MapObject, ObjectId};
use super::relation::{Relation, RelationKind};
use super::room::Room;
use crate::time::Stamp;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Why an object left the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RemovalReason {
    /// It was part of another object.
    MergedInto(ObjectId),
    /// Rays passed through where it stood.
    Absent,
    /// It was never confirmed.
    Unconfirmed,
}

/// One change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum MapChange {
    /// A new object, or a new state of a known one.
    Put(Box<MapObject>),
    /// An object leaves, with all its relations.
    Remove(ObjectId, RemovalReason),
    /// Replaces all relations that start at one of the objects.
    Relate {
        /// The objects whose outgoing relations are given anew.
        about: Vec<ObjectId>,
        /// Their relations.
        relations: Vec<Relation>,
    },
    /// Replaces all rooms.
    Rooms(Vec<Room>),
    /// Sets cells of the free space, in whole cells from the world's origin.
    Cells(Vec<([i32; 2], CellState)>),
}

fn key(relation: &Relation) -> (ObjectId, ObjectId, RelationKind) {
    (relation.from, relation.to, relation.kind)
}

/// Two sorted lists as one.
fn merge_sorted(first: impl Iterator<Item = Relation>, second: impl Iterator<Item = Relation>) -> Vec<Relation> {
    let (mut first, mut second) = (first.peekable(), second.peekable());
    let mut merged = Vec::with_capacity(first.size_hint().0 + second.size_hint().0);
    while let Some(next) = match (first.peek(), second.peek()) {
        (Some(a), Some(b)) if key(b) < key(a) => second.next(),
        (Some(_), _) => first.next(),
        (None, _) => second.next(),
    } {
        merged.push(next);
    }
    merged
}

/// The changes that follow from one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapUpdate {
    /// Stamp of the frame.
    pub stamp: Stamp,
    /// Changes in the order in which they apply.
    pub changes: Vec<MapChange>,
}

/// What an update did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changed {
    /// Objects that are new.
    pub added: Vec<ObjectId>,
    /// Objects with a new state.
    pub updated: Vec<ObjectId>,
    /// Objects that left.
    pub removed: Vec<ObjectId>,
}

/// The Diverse Semantic Map G = (O, R) with rooms and free space. World frame, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// Stamp of the last update.
    pub stamp: Stamp,
    /// Objects by identity. Shared, so that a snapshot is cheap.
    pub objects: BTreeMap<ObjectId, std::sync::Arc<MapObject>>,
    /// Relations, sorted by (from, to, kind).
    pub relations: Vec<Relation>,
    /// Rooms, sorted by identity.
    pub rooms: Vec<Room>,
    /// Free space.
    pub free_space: FreeSpace,
}

impl Map {
    /// An empty map whose free space has cells of `resolution_m`.
    pub fn new(resolution_m: f64) -> Self {
        Self {
            stamp: Stamp::default(),
            objects: BTreeMap::new(),
            relations: Vec::new(),
            rooms: Vec::new(),
            free_space: FreeSpace::new(resolution_m),
        }
    }

    /// Applies an update; the only way to change a map.
    pub fn apply(&mut self, update: MapUpdate) -> Changed {
        let mut changed = Changed::default();
        self.stamp = self.stamp.max(update.stamp);
        for change in update.changes {
            match change {
                MapChange::Put(object) => {
                    let id = object.id;
                    let known = self.objects.insert(id, (*object).into()).is_some();
                    if known { changed.updated.push(id) } else { changed.added.push(id) }
                }
                MapChange::Remove(id, _) => {
                    if self.objects.remove(&id).is_some() {
                        self.relations.retain(|r| r.from != id && r.to != id);
                        changed.removed.push(id);
                    }
                }
                MapChange::Relate { about, relations } => {
                    let about: BTreeSet<_> = about.into_iter().collect();
                    let known = |r: &Relation| self.objects.contains_key(&r.from) && self.objects.contains_key(&r.to);
                    let mut new: Vec<Relation> = relations.into_iter().filter(known).collect();
                    new.sort_by_key(key);
                    let kept = std::mem::take(&mut self.relations).into_iter().filter(|r| !about.contains(&r.from));
                    self.relations = merge_sorted(kept, new.into_iter());
                }
                MapChange::Rooms(rooms) => self.rooms = rooms,
                MapChange::Cells(cells) => cells.into_iter().for_each(|(cell, state)| self.free_space.set(cell, state)),
            }
        }
        changed
    }

    /// An object by identity.
    pub fn find_object(&self, id: ObjectId) -> Option<&MapObject> {
        self.objects.get(&id).map(|object| &**object)
    }

    /// Stable objects in order of identity.
    pub fn stable_objects(&self) -> impl Iterator<Item = &MapObject> {
        self.objects.values().map(|o| &**o).filter(|o| o.state == super::object::ObjectState::Stable)
    }

    /// A room by identity.
    pub fn find_room(&self, id: super::room::RoomId) -> Option<&Room> {
        self.rooms.iter().find(|room| room.id == id)
    }
}
