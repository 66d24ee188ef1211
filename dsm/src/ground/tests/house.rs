//! Small maps made by hand.

use crate::Pose;
use crate::geometry::{Aabb, OrientedBox};
use crate::ground::{GroundConfig, Grounder, Grounding};
use crate::knowledge::Knowledge;
use crate::map::{
    AttributeKind, Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, ObjectState, Relation, RelationKind, Room,
    RoomId, Votes,
};
use crate::time::Stamp;
use nalgebra::{Point2, Point3};
use std::sync::Arc;

/// An object under construction; boxes along the world axes.
pub(in crate::ground) struct Thing(MapObject);

/// An object with this identity, name, centre and size (metres).
pub(in crate::ground) fn thing(id: u64, name: &str, center: [f64; 3], size: [f64; 3]) -> Thing {
    let mut names = Votes::default();
    names.add(name, 9.0);
    let half = nalgebra::Vector3::from(size) * 0.5;
    let bounds = Aabb { min: Point3::from(center) - half, max: Point3::from(center) + half };
    Thing(MapObject { observations: 9, ..MapObject::given(ObjectId(id), names, OrientedBox::from(bounds)) })
}

impl Thing {
    pub(super) fn also_called(mut self, name: &str, weight: f32) -> Self {
        self.0.names.add(name, weight);
        self
    }

    pub(super) fn color(mut self, color: &str) -> Self {
        self.0.attributes.add(AttributeKind::Appearance, "color", color, 8.0);
        self.0.attributes.add(AttributeKind::Appearance, "color", "gray", 2.0);
        self
    }

    pub(super) fn material(mut self, material: &str) -> Self {
        self.0.attributes.add(AttributeKind::Physical, "material", material, 8.0);
        self
    }

    pub(super) fn pattern(mut self, pattern: &str) -> Self {
        self.0.attributes.add(AttributeKind::Appearance, "pattern", pattern, 8.0);
        self
    }

    pub(super) fn in_room(mut self, room: u32) -> Self {
        self.0.room = Some(RoomId(room));
        self
    }

    /// Points of one colour on the surface of its box.
    pub(in crate::ground) fn points(mut self, color: [u8; 3]) -> Self {
        let (center, size) = (self.0.bounds.center, self.0.bounds.size);
        for face in 0..6 {
            let (axis, sign) = (face / 2, if face % 2 == 0 { 0.5 } else { -0.5 });
            for (i, j) in (0..15).flat_map(|i| (0..15).map(move |j| (i, j))) {
                let mut at = nalgebra::Vector3::zeros();
                at[axis] = sign;
                at[(axis + 1) % 3] = f64::from(i) / 14.0 - 0.5;
                at[(axis + 2) % 3] = f64::from(j) / 14.0 - 0.5;
                let position = (center + at.component_mul(&size)).cast();
                self.0.points.push(MapPoint { position, color });
            }
        }
        self
    }

    pub(super) fn seen(mut self, observations: u32) -> Self {
        self.0.observations = observations;
        self
    }

    pub(super) fn provisional(mut self) -> Self {
        self.0.state = ObjectState::Provisional;
        self
    }
}

/// A map of these objects.
pub(in crate::ground) fn map_of(things: impl IntoIterator<Item = Thing>) -> Map {
    let mut map = Map::new(0.05);
    let changes = things.into_iter().map(|thing| MapChange::Put(Box::new(thing.0))).collect();
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    map
}

/// Adds stored relations (from, kind, to).
pub(super) fn relate(map: &mut Map, edges: &[(u64, RelationKind, u64)]) {
    let relation = |&(from, kind, to): &(u64, RelationKind, u64)| Relation {
        from: ObjectId(from),
        to: ObjectId(to),
        kind,
        confidence: 0.9,
    };
    let about = edges.iter().map(|edge| ObjectId(edge.0)).collect();
    let relations = edges.iter().map(relation).collect();
    map.apply(MapUpdate { stamp: Stamp::default(), changes: vec![MapChange::Relate { about, relations }] });
}

/// A rectangular room from (`x0`, `y0`) to (`x1`, `y1`).
pub(super) fn room(id: u32, name: &str, [x0, y0, x1, y1]: [f64; 4], neighbours: &[u32]) -> Room {
    Room {
        id: RoomId(id),
        name: name.to_owned(),
        polygon: vec![Point2::new(x0, y0), Point2::new(x1, y0), Point2::new(x1, y1), Point2::new(x0, y1)],
        center: Point2::new(0.5 * (x0 + x1), 0.5 * (y0 + y1)),
        area_m2: (x1 - x0) * (y1 - y0),
        neighbours: neighbours.iter().map(|&n| RoomId(n)).collect(),
    }
}

/// Gives the map its rooms.
pub(super) fn with_rooms(mut map: Map, rooms: Vec<Room>) -> Map {
    map.apply(MapUpdate { stamp: Stamp::default(), changes: vec![MapChange::Rooms(rooms)] });
    map
}

/// A grounder with default parameters.
pub(super) fn grounder() -> Grounder {
    Grounder::new(GroundConfig::default(), Arc::new(Knowledge::embedded().unwrap())).unwrap()
}

/// Grounds without a viewer.
pub(super) fn ground(map: &Map, text: &str) -> Grounding {
    grounder().ground(map, text, None)
}

/// Grounds for a viewer at (`x`, `y`).
pub(super) fn ground_from(map: &Map, text: &str, x: f64, y: f64) -> Grounding {
    grounder().ground(map, text, Some(&Pose::translation(x, y, 1.2)))
}

/// A kitchen and living room with two shelves, two tables, apples, mugs and books.
pub(super) fn home() -> Map {
    let things = [
        thing(1, "table", [2.0, 0.0, 0.375], [1.4, 0.8, 0.75]).color("brown").in_room(1),
        thing(2, "apple", [2.2, 0.1, 0.79], [0.08, 0.08, 0.08]).color("red").in_room(1),
        thing(3, "apple", [1.8, -0.2, 0.79], [0.08, 0.08, 0.08]).color("green").in_room(1),
        thing(4, "shelf", [5.0, 2.0, 0.9], [0.9, 0.35, 1.8]).color("white").in_room(2),
        thing(5, "cabinet", [5.9, 2.0, 0.45], [0.8, 0.4, 0.9]).color("white").in_room(2),
        thing(6, "apple", [5.0, 2.0, 0.94], [0.08, 0.08, 0.08]).color("red").in_room(2),
        thing(7, "shelf", [0.0, 3.0, 0.9], [0.9, 0.35, 1.8]).color("brown").in_room(1),
        thing(8, "apple", [0.1, 3.0, 0.94], [0.08, 0.08, 0.08]).color("red").in_room(1),
        thing(9, "laptop", [5.0, -2.0, 0.85], [0.35, 0.25, 0.2]).color("gray").in_room(2),
        thing(10, "desk", [5.0, -2.0, 0.375], [1.6, 0.7, 0.75]).color("white").in_room(2),
        thing(11, "mug", [5.0, -1.7, 0.8], [0.09, 0.09, 0.1]).color("green").material("metal").in_room(2),
        thing(12, "mug", [5.0, -2.4, 0.8], [0.09, 0.09, 0.1]).color("green").material("ceramic").in_room(2),
        thing(13, "book", [5.9, 2.0, 0.92], [0.2, 0.15, 0.04]).color("blue").in_room(2),
        thing(14, "sofa", [2.0, 4.0, 0.4], [2.0, 0.9, 0.8]).color("gray").in_room(1),
        thing(15, "chair", [2.0, -0.9, 0.45], [0.45, 0.45, 0.9]).in_room(1),
        thing(16, "chair", [3.1, 0.0, 0.45], [0.45, 0.45, 0.9]).in_room(1),
        thing(17, "bed", [9.0, 0.0, 0.3], [2.0, 1.6, 0.6]).in_room(3),
        thing(18, "stool", [9.0, 2.0, 0.25], [0.35, 0.35, 0.5]).in_room(3),
        thing(19, "wardrobe", [10.0, 2.0, 1.0], [1.0, 0.6, 2.0]).in_room(3),
    ];
    with_rooms(
        map_of(things),
        vec![
            room(1, "living room", [-1.0, -2.0, 4.0, 5.0], &[2]),
            room(2, "office", [4.0, -3.0, 7.0, 3.0], &[1, 3]),
            room(3, "bedroom", [7.0, -2.0, 11.0, 3.0], &[2]),
        ],
    )
}
