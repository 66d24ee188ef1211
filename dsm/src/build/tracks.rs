//! All tracks, found by identity and by place.

use super::track::Track;
use crate::geometry::Aabb;
use crate::map::ObjectId;
use std::collections::{BTreeMap, BTreeSet};

/// Side of a cell of the index, metres.
const CELL_M: f64 = 1.0;

/// Cells along x and y, the last ones included.
type Cells = ([i32; 2], [i32; 2]);

/// Tracks with a grid over the floor, so that what a frame costs follows what is in view and not what was ever seen.
#[derive(Default)]
pub(super) struct Tracks {
    by_id: BTreeMap<ObjectId, Track>,
    place_of: BTreeMap<ObjectId, Cells>,
    at: BTreeMap<[i32; 2], BTreeSet<ObjectId>>,
}

impl Tracks {
    pub(super) fn find(&self, id: ObjectId) -> Option<&Track> {
        self.by_id.get(&id)
    }

    /// Identities in order.
    pub(super) fn ids(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.by_id.keys().copied()
    }

    pub(super) fn insert(&mut self, id: ObjectId, track: Track) {
        self.by_id.insert(id, track);
        self.place(id);
    }

    pub(super) fn remove(&mut self, id: ObjectId) -> Option<Track> {
        self.displace(id);
        self.by_id.remove(&id)
    }

    /// Changes a track; the index follows its box.
    pub(super) fn change<R>(&mut self, id: ObjectId, change: impl FnOnce(&mut Track) -> R) -> Option<R> {
        let result = change(self.by_id.get_mut(&id)?);
        self.place(id);
        Some(result)
    }

    /// Takes a track out to change it elsewhere; [`Self::put_back`] must follow. Until then only its place is known.
    pub(super) fn take(&mut self, id: ObjectId) -> Option<Track> {
        self.by_id.remove(&id)
    }

    /// Puts a track back that was taken out; the index follows its box.
    pub(super) fn put_back(&mut self, id: ObjectId, track: Track) {
        self.insert(id, track);
    }

    /// Tracks whose boxes meet `bounds`, in order of identity.
    pub(super) fn find_near(&self, bounds: &Aabb) -> Vec<ObjectId> {
        let mut found = self.find_over(bounds);
        found.retain(|id| self.by_id.get(id).is_some_and(|track| track.aabb.find_intersection(bounds).is_some()));
        found
    }

    /// Tracks whose outlines may meet that of `bounds`, whatever their height, in order of identity.
    pub(super) fn find_over(&self, bounds: &Aabb) -> Vec<ObjectId> {
        let (low, high) = cells(bounds);
        let count = |i: usize| i64::from(high[i]) - i64::from(low[i]) + 1;
        let mut found: Vec<ObjectId> = Vec::new();
        if count(0) * count(1) > self.at.len() as i64 {
            let inside = |cell: &[i32; 2]| (0..2).all(|i| low[i] <= cell[i] && cell[i] <= high[i]);
            self.at.iter().filter(|(cell, _)| inside(cell)).for_each(|(_, ids)| found.extend(ids));
        } else {
            for x in low[0]..=high[0] {
                self.at.range([x, low[1]]..=[x, high[1]]).for_each(|(_, ids)| found.extend(ids));
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    fn place(&mut self, id: ObjectId) {
        let Some(track) = self.by_id.get(&id) else { return };
        let now = cells(&track.aabb);
        if self.place_of.get(&id) == Some(&now) {
            return;
        }
        self.displace(id);
        for cell in iterate(now) {
            self.at.entry(cell).or_default().insert(id);
        }
        self.place_of.insert(id, now);
    }

    fn displace(&mut self, id: ObjectId) {
        let Some(before) = self.place_of.remove(&id) else { return };
        for cell in iterate(before) {
            if let Some(ids) = self.at.get_mut(&cell) {
                ids.remove(&id);
                if ids.is_empty() {
                    self.at.remove(&cell);
                }
            }
        }
    }
}

fn cells(bounds: &Aabb) -> Cells {
    // A box without bounds must not make a list without end.
    let cell = |c: f64| (c / CELL_M).floor().clamp(-1e6, 1e6) as i32;
    ([cell(bounds.min.x), cell(bounds.min.y)], [cell(bounds.max.x), cell(bounds.max.y)])
}

fn iterate((low, high): Cells) -> impl Iterator<Item = [i32; 2]> {
    (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| [x, y]))
}

#[cfg(test)]
mod tests {
    //! Contract: the index finds what a search over all tracks finds, also after they moved or went.
    use super::*;
    use crate::build::BuildConfig;
    use crate::map::{MapObject, MapPoint, ObjectState};
    use crate::time::Stamp;
    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;

    fn cube(x: f64, y: f64, side: f64) -> Aabb {
        let center = Point3::new(x, y, 0.5);
        Aabb { min: center - Vector3::repeat(0.5 * side), max: center + Vector3::repeat(0.5 * side) }
    }

    fn track(bounds: Aabb) -> Track {
        let corner = |p: Point3<f64>| MapPoint { position: p.cast(), color: [9; 3] };
        let object = MapObject {
            id: ObjectId(0),
            state: ObjectState::Stable,
            names: Default::default(),
            points: vec![corner(bounds.min), corner(bounds.max)],
            bounds: bounds.into(),
            attributes: Default::default(),
            visual_feature: vec![],
            provenance: Default::default(),
            text_feature: vec![],
            room: None,
            observations: 1,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        };
        let mut track = Track::from_object(&BuildConfig::default(), &object);
        track.aabb = bounds;
        track
    }

    proptest! {
        #[test]
        fn the_index_agrees_with_a_full_search(
            boxes in proptest::collection::vec((-6.0f64..6.0, -6.0f64..6.0, 0.05f64..3.0), 1..20),
            moves in proptest::collection::vec((0usize..20, -6.0f64..6.0, -6.0f64..6.0), 0..10),
            gone in 0usize..20,
            query in (-6.0f64..6.0, -6.0f64..6.0, 0.05f64..20.0),
        ) {
            let mut tracks = Tracks::default();
            for (i, (x, y, side)) in boxes.iter().enumerate() {
                tracks.insert(ObjectId(i as u64), track(cube(*x, *y, *side)));
            }
            for (i, x, y) in moves {
                tracks.change(ObjectId(i as u64), |track| track.aabb = cube(x, y, 0.4));
            }
            tracks.remove(ObjectId(gone as u64));
            let bounds = cube(query.0, query.1, query.2);
            let all = tracks.ids().filter(|id| tracks.find(*id).unwrap().aabb.find_intersection(&bounds).is_some());
            prop_assert_eq!(tracks.find_near(&bounds), all.collect::<Vec<_>>());
        }
    }
}
