//! What a grasp is after, as the map knew it before the robot stood there.
//!
//! From one place a detector repeats its mistakes: a mask that takes a bottle and its shelf for one thing does so in every
//! frame, and fusion believes it in the end. Until the hand holds the object, the last sound view of it counts.

use dsm::map::{Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId};
use nalgebra::{Point3, Vector3};
use std::sync::Arc;

/// An object that became wider by this factor and this length grew together with something else; metres.
const SPOILT: (f64, f64) = (1.5, 0.05);
/// Points of others this near to the object's box are its own, taken by what it grew together with, metres.
const OWN_M: f64 = 0.02;

/// The object of a grasp.
#[derive(Clone, Debug)]
pub(super) struct Target {
    object: MapObject,
    /// More is known of it than the map tells.
    known_better: bool,
}

impl Target {
    /// The object as the map knows it now.
    pub(super) fn of(map: &Map, id: ObjectId) -> Option<Self> {
        Some(Self { object: map.find_object(id)?.clone(), known_better: false })
    }

    /// The object standing on something at `support_z_m`, of which only the upper side is seen: its sides go straight down.
    /// That is how things lie in drawers, whose front hides their foot.
    pub(super) fn standing_on(map: &Map, id: ObjectId, support_z_m: f64) -> Option<Self> {
        /// Points of the sides are so far apart, metres.
        const STEP_M: f64 = 0.006;
        let mut object = map.find_object(id)?.clone();
        let low_m = object.bounds.center.z - 0.5 * object.bounds.size.z;
        let top_m = object.bounds.top_m();
        if low_m > support_z_m && top_m > support_z_m {
            let rim = object.bounds.footprint();
            let levels = ((low_m - support_z_m) / STEP_M).ceil() as i32;
            let color = object.points.first().map_or([0; 3], |point| point.color);
            for (from, to) in rim.iter().zip(rim.iter().cycle().skip(1)) {
                let steps = ((to - from).norm() / STEP_M).ceil().max(1.0) as i32;
                for (step, level) in (0..steps).flat_map(|step| (0..=levels).map(move |level| (step, level))) {
                    let at = from + (to - from) * (f64::from(step) / f64::from(steps));
                    let z = support_z_m + (low_m - support_z_m) * f64::from(level) / f64::from(levels.max(1));
                    object.points.push(MapPoint { position: Point3::new(at.x, at.y, z).cast(), color });
                }
            }
            object.bounds.center.z = 0.5 * (top_m + support_z_m);
            object.bounds.size.z = top_m - support_z_m;
        }
        Some(Self { object, known_better: true })
    }

    /// Its id.
    pub(super) fn id(&self) -> ObjectId {
        self.object.id
    }

    /// The object as it was known.
    pub(super) fn object(&self) -> &MapObject {
        &self.object
    }

    /// The map with the object in it: as the map has it, or as it was when it has left the map or grown together with
    /// something.
    pub(super) fn in_map(&self, map: &Arc<Map>) -> Arc<Map> {
        if !self.known_better && map.find_object(self.id()).is_some_and(|now| !self.is_spoilt(now)) {
            return map.clone();
        }
        let bounds = &self.object.bounds;
        let near = bounds.aabb().grown(OWN_M);
        // What carries it ends below it.
        let is_own = |p: &Point3<f64>| bounds.contains(p, OWN_M) && p.z > near.min.z + 2.0 * OWN_M;
        let mut changes: Vec<MapChange> = vec![MapChange::Put(Box::new(self.object.clone()))];
        for other in map.objects.values().filter(|other| other.id != self.id()) {
            if other.points.iter().any(|p| is_own(&p.position.cast())) {
                let mut other = MapObject::clone(other);
                other.points.retain(|p| !is_own(&p.position.cast()));
                changes.push(MapChange::Put(Box::new(other)));
            }
        }
        let mut restored = Map::clone(map);
        restored.apply(MapUpdate { stamp: map.stamp, changes });
        Arc::new(restored)
    }

    fn is_spoilt(&self, now: &MapObject) -> bool {
        let widest = |size: &Vector3<f64>| size.x.max(size.y).max(size.z);
        let (before_m, now_m) = (widest(&self.object.bounds.size), widest(&now.bounds.size));
        now_m > SPOILT.0 * before_m && now_m > before_m + SPOILT.1
    }
}

#[cfg(test)]
pub(super) mod tests {
    //! Contract: a target that a nearer look widens a little is believed; one that grew together with its shelf, or left
    //! the map, is as it was, and its points are nobody else's.
    use super::*;
    use dsm::geometry::OrientedBox;
    use dsm::map::{Attributes, ObjectState, Votes};
    use dsm::time::Stamp;
    use nalgebra::UnitQuaternion;

    pub(in crate::skills) fn object(id: u64, center: [f64; 3], size: [f64; 3], points: &[[f32; 3]]) -> MapObject {
        MapObject {
            id: ObjectId(id),
            state: ObjectState::Stable,
            names: Votes::default(),
            points: points.iter().map(|p| MapPoint { position: Point3::from(*p), color: [0; 3] }).collect(),
            bounds: OrientedBox {
                center: Point3::from(center),
                size: Vector3::from(size),
                rotation: UnitQuaternion::identity(),
            },
            attributes: Attributes::default(),
            visual_feature: Vec::new(),
            provenance: Default::default(),
            text_feature: Vec::new(),
            room: None,
            observations: 9,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        }
    }

    pub(in crate::skills) fn map_of(objects: Vec<MapObject>) -> Arc<Map> {
        let mut map = Map::new(0.05);
        let changes = objects.into_iter().map(|o| MapChange::Put(Box::new(o))).collect();
        map.apply(MapUpdate { stamp: Stamp::default(), changes });
        Arc::new(map)
    }

    #[test]
    fn what_stands_in_a_drawer_reaches_down_to_its_floor() {
        let seen = object(1, [1.0, 2.0, 0.35], [0.06, 0.06, 0.01], &[[1.0, 2.0, 0.355]]);
        let map = map_of(vec![seen.clone()]);
        let target = Target::standing_on(&map, ObjectId(1), 0.29).unwrap();
        let known = target.in_map(&map);
        let known = known.find_object(ObjectId(1)).unwrap();
        assert!((known.bounds.size.z - 0.065).abs() < 1e-9 && (known.bounds.top_m() - 0.355).abs() < 1e-9);
        assert!(known.points.len() > 100 && known.points.iter().all(|p| p.position.z > 0.289));
        let whole = Target::standing_on(&map, ObjectId(1), 0.4).unwrap();
        assert_eq!(whole.in_map(&map).find_object(ObjectId(1)), Some(&seen), "it reaches down already");
    }

    #[test]
    fn a_bottle_that_grew_together_with_its_shelf_is_as_it_was() {
        let bottle = object(1, [1.0, 2.0, 0.5], [0.07, 0.07, 0.25], &[[1.0, 2.0, 0.5]]);
        let target = Target::of(&map_of(vec![bottle.clone()]), ObjectId(1)).unwrap();
        let widened = object(1, [1.0, 2.0, 0.5], [0.09, 0.08, 0.26], &[[1.0, 2.0, 0.5], [1.04, 2.0, 0.5]]);
        let now = map_of(vec![widened]);
        assert!(Arc::ptr_eq(&target.in_map(&now), &now), "a better view is believed");
        let grown = object(1, [1.0, 2.0, 0.5], [0.74, 0.32, 0.53], &[[1.0, 2.0, 0.5], [1.3, 2.0, 0.4]]);
        assert_eq!(target.in_map(&map_of(vec![grown])).find_object(ObjectId(1)), Some(&bottle));
        // Merged into the shelf: the bottle is there again, and the shelf keeps its board alone.
        let shelf = object(2, [1.0, 2.0, 0.4], [0.8, 0.3, 0.8], &[[1.0, 2.0, 0.5], [1.0, 2.0, 0.37]]);
        let restored = target.in_map(&map_of(vec![shelf]));
        assert_eq!(restored.find_object(ObjectId(1)), Some(&bottle));
        assert_eq!(restored.find_object(ObjectId(2)).unwrap().points.len(), 1);
    }
}
