//! The changes of one frame while they are made.

use crate::map::{Map, MapChange, MapObject, ObjectId, ObjectState, RemovalReason};
use std::collections::BTreeMap;

/// A view of the map with pending changes on top.
pub(super) struct Draft<'a> {
    map: &'a Map,
    put: BTreeMap<ObjectId, MapObject>,
    removed: BTreeMap<ObjectId, RemovalReason>,
}

impl<'a> Draft<'a> {
    pub(super) fn new(map: &'a Map) -> Self {
        Self { map, put: BTreeMap::new(), removed: BTreeMap::new() }
    }

    /// The object as it is after the pending changes.
    pub(super) fn find(&self, id: ObjectId) -> Option<&MapObject> {
        if self.removed.contains_key(&id) {
            return None;
        }
        self.put.get(&id).or_else(|| self.map.find_object(id))
    }

    /// The object for changing; it will be put into the map.
    pub(super) fn edit(&mut self, id: ObjectId) -> Option<&mut MapObject> {
        if !self.put.contains_key(&id) {
            let object = self.find(id)?.clone();
            self.put.insert(id, object);
        }
        self.put.get_mut(&id)
    }

    /// Adds an object, or a new state of a known one.
    pub(super) fn add(&mut self, object: MapObject) {
        self.put.insert(object.id, object);
    }

    pub(super) fn remove(&mut self, id: ObjectId, reason: RemovalReason) {
        self.put.remove(&id);
        self.removed.insert(id, reason);
    }

    /// Objects that nothing has confirmed yet.
    pub(super) fn provisional(&self) -> Vec<ObjectId> {
        let known = self.map.objects.values().map(|object| &**object).chain(self.put.values());
        known.filter(|object| object.state == ObjectState::Provisional).map(|object| object.id).collect()
    }

    /// Objects put so far.
    pub(super) fn edited(&self) -> Vec<ObjectId> {
        self.put.keys().copied().collect()
    }

    /// The changes in the order in which they apply.
    pub(super) fn into_changes(self) -> Vec<MapChange> {
        let map = self.map;
        let put = self.put.into_values().map(|object| MapChange::Put(Box::new(object)));
        let removed = self.removed.into_iter().filter(|(id, _)| map.objects.contains_key(id));
        put.chain(removed.map(|(id, reason)| MapChange::Remove(id, reason))).collect()
    }
}
