//! A map to measure with.

use dsm::geometry::OrientedBox;
use dsm::knowledge::Knowledge;
use dsm::map::{
    AttributeKind, Attributes, CellState, Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, ObjectState, Votes,
};
use dsm::time::Stamp;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const COLORS: [&str; 6] = ["red", "green", "blue", "white", "black", "brown"];

/// 500 objects of all categories, thrown into a flat of 12 m x 12 m.
pub(crate) fn flat(knowledge: &Knowledge) -> Map {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut map = Map::new(0.05);
    let mut changes = Vec::new();
    for id in 0..500_u64 {
        let category = &knowledge.categories()[rng.random_range(0..knowledge.categories().len())];
        let mut names = Votes::default();
        names.add(&category.name, 8.0);
        names.add(&category.similar.first().unwrap_or(&category.name).clone(), 1.0);
        let mut attributes = Attributes::default();
        attributes.add(AttributeKind::Appearance, "color", COLORS[id as usize % COLORS.len()], 5.0);
        let side = category.size_m.map_or(0.3, |[low, high]| rng.random_range(low..high)).min(2.0);
        let size = Vector3::new(side, 0.6 * side, 0.8 * side);
        let center = Point3::new(rng.random_range(0.0..12.0), rng.random_range(0.0..12.0), rng.random_range(0.2..1.5));
        let points = (0..800)
            .map(|_| {
                let at = Vector3::from_fn(|i, _| (rng.random::<f64>() - 0.5) * size[i]);
                MapPoint { position: (center + at).cast(), color: [rng.random(), 80, 60] }
            })
            .collect();
        changes.push(MapChange::Put(Box::new(MapObject {
            id: ObjectId(id),
            state: ObjectState::Stable,
            names,
            points,
            bounds: OrientedBox { center, size, rotation: UnitQuaternion::identity() },
            attributes,
            visual_feature: Vec::new(),
            provenance: Default::default(),
            text_feature: Vec::new(),
            room: None,
            observations: 9,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        })));
    }
    let floor = (0..240).flat_map(|x| (0..240).map(move |y| ([x, y], CellState::Free)));
    changes.push(MapChange::Cells(floor.collect()));
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    map
}
