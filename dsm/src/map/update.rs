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

/// Replaces the relations that start at `about` by `new`; both lists are sorted. Costs little where nothing changes in
/// number, and no more than a copy of the list otherwise.
fn replace_outgoing(relations: &mut Vec<Relation>, about: Vec<ObjectId>, new: Vec<Relation>) {
    let mut ids: BTreeSet<ObjectId> = about.into_iter().collect();
    // What starts elsewhere was not announced, but is taken.
    let announced = ids.clone();
    ids.extend(new.iter().map(|relation| relation.from));
    let outgoing = |list: &[Relation], id: ObjectId| {
        let from = list.partition_point(|relation| relation.from < id);
        from..from + list[from..].partition_point(|relation| relation.from == id)
    };
    let spans: Vec<_> = ids.iter().map(|id| (*id, outgoing(relations, *id), outgoing(&new, *id))).collect();
    if spans.iter().all(|(id, old, new)| old.len() == new.len() && announced.contains(id)) {
        for (_, old, fresh) in spans {
            relations[old].clone_from_slice(&new[fresh]);
        }
        return;
    }
    let mut merged = Vec::with_capacity(relations.len() + new.len());
    let mut done = 0;
    for (id, old, fresh) in spans {
        merged.extend_from_slice(&relations[done..old.start]);
        let kept = if announced.contains(&id) { old.start..old.start } else { old.clone() };
        let first = merged.len();
        merged.extend_from_slice(&relations[kept]);
        merged.extend_from_slice(&new[fresh]);
        merged[first..].sort_by_key(key);
        done = old.end;
    }
    merged.extend_from_slice(&relations[done..]);
    *relations = merged;
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
                    let known = |r: &Relation| self.objects.contains_key(&r.from) && self.objects.contains_key(&r.to);
                    let mut new: Vec<Relation> = relations.into_iter().filter(known).collect();
                    new.sort_by_key(key);
                    replace_outgoing(&mut self.relations, about, new);
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

#[cfg(test)]
mod tests {
    //! Contract: relations that start at an object are replaced by its new ones, whatever their number; all others stay.
    use super::*;
    use proptest::prelude::*;

    fn relation(from: u64, to: u64, kind: usize) -> Relation {
        let kind = [RelationKind::On, RelationKind::Near, RelationKind::NextTo][kind % 3];
        Relation { from: ObjectId(from), to: ObjectId(to), kind, confidence: 1.0 }
    }

    proptest! {
        #[test]
        fn outgoing_relations_are_replaced(
            old in proptest::collection::btree_set((0u64..6, 0u64..6, 0usize..3), 0..30),
            about in proptest::collection::vec(0u64..8, 0..6),
            new in proptest::collection::btree_set((0u64..8, 0u64..6, 0usize..3), 0..20),
            keep_count in any::<bool>(),
        ) {
            let sorted = |set: &BTreeSet<(u64, u64, usize)>| {
                let mut list: Vec<Relation> = set.iter().map(|(f, t, k)| relation(*f, *t, *k)).collect();
                list.sort_by_key(key);
                list
            };
            let about: Vec<ObjectId> = about.into_iter().map(ObjectId).collect();
            let old = sorted(&old);
            let new: Vec<Relation> = if keep_count {
                // As many as before for each object.
                old.iter().filter(|r| about.contains(&r.from)).map(|r| Relation { confidence: 0.5, ..r.clone() }).collect()
            } else {
                sorted(&new).into_iter().filter(|r| about.contains(&r.from)).collect()
            };
            let mut found = old.clone();
            replace_outgoing(&mut found, about.clone(), new.clone());
            let mut wanted: Vec<Relation> = old.into_iter().filter(|r| !about.contains(&r.from)).chain(new).collect();
            wanted.sort_by_key(key);
            prop_assert_eq!(found, wanted);
        }
    }
}
