//! A map as messages. All is in the frame `map`, metres.

use crate::messages::{
    BoundingBox3D, ColorRGBA, Detection3D, Detection3DArray, Header, Marker, MarkerArray, ObjectHypothesis,
    ObjectHypothesisWithPose, Point, Pose, PoseWithCovariance, Vector3,
};
use dsm::geometry::OrientedBox;
use dsm::map::{Map, MapObject, ObjectId};
use dsm::time::Stamp;
use nalgebra::{Isometry3, Translation3};

/// Kinds of markers.
const CUBE: i32 = 1;
const LINE_STRIP: i32 = 4;
const LINE_LIST: i32 = 5;
const TEXT: i32 = 9;
/// Takes away all markers that were put before.
const REMOVE_ALL: i32 = 3;

const OBJECT: ColorRGBA = ColorRGBA { r: 0.2, g: 0.5, b: 0.9, a: 0.35 };
const WORDS: ColorRGBA = ColorRGBA { r: 1.0, g: 1.0, b: 1.0, a: 1.0 };
const RELATION: ColorRGBA = ColorRGBA { r: 0.6, g: 0.6, b: 0.6, a: 0.8 };
const ROOM: ColorRGBA = ColorRGBA { r: 0.3, g: 0.7, b: 0.4, a: 1.0 };
const MEANT: ColorRGBA = ColorRGBA { r: 1.0, g: 0.6, b: 0.0, a: 0.8 };

fn header(stamp: Stamp) -> Header {
    Header::new(stamp, "map")
}

fn pose_of(bounds: &OrientedBox) -> Pose {
    (&Isometry3::from_parts(Translation3::from(bounds.center.coords), bounds.rotation)).into()
}

fn size_of(bounds: &OrientedBox) -> Vector3 {
    Vector3 { x: bounds.size.x, y: bounds.size.y, z: bounds.size.z }
}

/// The stable objects: names by their votes, boxes, and `object ID` as id.
pub fn objects_of(map: &Map, stamp: Stamp) -> Detection3DArray {
    let one = |object: &MapObject| {
        let pose = pose_of(&object.bounds);
        let total = object.names.total().max(f32::EPSILON);
        let mut results: Vec<ObjectHypothesisWithPose> = object
            .names
            .iter()
            .map(|(name, weight)| ObjectHypothesisWithPose {
                hypothesis: ObjectHypothesis { class_id: name.to_owned(), score: f64::from(weight / total) },
                pose: PoseWithCovariance { pose, ..PoseWithCovariance::default() },
            })
            .collect();
        results.sort_by(|a, b| b.hypothesis.score.total_cmp(&a.hypothesis.score));
        let bbox = BoundingBox3D { center: pose, size: size_of(&object.bounds) };
        Detection3D { header: header(stamp), results, bbox, id: format!("object {}", object.id.0) }
    };
    Detection3DArray { header: header(stamp), detections: map.stable_objects().map(one).collect() }
}

/// A marker that stands upright at the origin; lines need no more.
fn marker(stamp: Stamp, ns: &str, id: u64, kind: i32, color: ColorRGBA) -> Marker {
    let pose = (&Isometry3::identity()).into();
    Marker { header: header(stamp), ns: ns.into(), id: id as i32, kind, pose, color, ..Marker::default() }
}

fn cube(stamp: Stamp, ns: &str, object: &MapObject, color: ColorRGBA) -> Marker {
    let (pose, scale) = (pose_of(&object.bounds), size_of(&object.bounds));
    Marker { pose, scale, ..marker(stamp, ns, object.id.0, CUBE, color) }
}

fn words(stamp: Stamp, ns: &str, id: u64, at: [f64; 3], text: &str) -> Marker {
    let at = Isometry3::translation(at[0], at[1], at[2]);
    let scale = Vector3 { z: 0.08, ..Vector3::default() };
    Marker { pose: (&at).into(), scale, text: text.into(), ..marker(stamp, ns, id, TEXT, WORDS) }
}

fn middle(object: &MapObject) -> Point {
    let center = object.bounds.center;
    Point { x: center.x, y: center.y, z: center.z }
}

/// Boxes with names, lines for relations, outlines of rooms. They take the place of all that was drawn before.
pub fn markers_of(map: &Map, stamp: Stamp) -> MarkerArray {
    let mut markers = vec![Marker { action: REMOVE_ALL, ..marker(stamp, "objects", 0, CUBE, OBJECT) }];
    for object in map.stable_objects() {
        let center = object.bounds.center;
        let above = [center.x, center.y, center.z + 0.5 * object.bounds.size.z + 0.06];
        markers.push(cube(stamp, "objects", object, OBJECT));
        markers.push(words(stamp, "names", object.id.0, above, object.name()));
    }
    for (index, relation) in map.relations.iter().enumerate() {
        let (Some(from), Some(to)) = (map.find_object(relation.from), map.find_object(relation.to)) else { continue };
        let line = marker(stamp, "relations", index as u64, LINE_LIST, RELATION);
        let scale = Vector3 { x: 0.01, ..Vector3::default() };
        let text = format!("{:?}", relation.kind).to_lowercase();
        markers.push(Marker { scale, points: vec![middle(from), middle(to)], text, ..line });
    }
    for room in &map.rooms {
        let corners = room.polygon.iter().chain(room.polygon.first());
        let points = corners.map(|corner| Point { x: corner.x, y: corner.y, z: 0.01 }).collect();
        let scale = Vector3 { x: 0.03, ..Vector3::default() };
        markers.push(Marker { scale, points, ..marker(stamp, "rooms", u64::from(room.id.0), LINE_STRIP, ROOM) });
        markers.push(words(stamp, "room names", u64::from(room.id.0), [room.center.x, room.center.y, 0.3], &room.name));
    }
    MarkerArray { markers }
}

/// The object that is meant, drawn out; without one, nothing is left of an earlier answer.
pub fn meant_markers(map: &Map, meant: Option<ObjectId>, text: &str, stamp: Stamp) -> MarkerArray {
    let mut markers = vec![Marker { action: REMOVE_ALL, ..marker(stamp, "meant", 0, CUBE, MEANT) }];
    if let Some(object) = meant.and_then(|id| map.find_object(id)) {
        let center = object.bounds.center;
        let above = [center.x, center.y, center.z + 0.5 * object.bounds.size.z + 0.15];
        markers.push(cube(stamp, "meant", object, MEANT));
        markers.push(words(stamp, "meant words", object.id.0, above, text));
    }
    MarkerArray { markers }
}

#[cfg(test)]
mod tests {
    //! Contract: every stable object is told with its names by their votes and its box, and drawn once; what is meant is
    //! drawn out, and nothing where nothing is meant.
    use super::*;
    use dsm::map::{MapChange, MapUpdate, Votes};
    use nalgebra::{Point3, UnitQuaternion, Vector3 as Size};

    fn map() -> Map {
        let mut map = Map::new(0.05);
        for (id, x) in [(1, 0.0), (2, 1.0)] {
            let mut names = Votes::default();
            names.add("mug", 3.0);
            names.add("cup", 1.0);
            let bounds = OrientedBox {
                center: Point3::new(x, 0.5, 0.8),
                size: Size::new(0.1, 0.2, 0.3),
                rotation: UnitQuaternion::identity(),
            };
            let object = MapObject::given(ObjectId(id), names, bounds);
            map.apply(MapUpdate { changes: vec![MapChange::Put(Box::new(object))], ..MapUpdate::default() });
        }
        map
    }

    #[test]
    fn objects_have_names_by_votes_and_boxes() {
        let told = objects_of(&map(), Stamp(0));
        assert_eq!(told.detections.len(), 2);
        let second = &told.detections[1];
        assert_eq!(second.id, "object 2");
        let names: Vec<(&str, f64)> =
            second.results.iter().map(|r| (r.hypothesis.class_id.as_str(), r.hypothesis.score)).collect();
        assert_eq!(names, [("mug", 0.75), ("cup", 0.25)]);
        assert_eq!((second.bbox.center.position.x, second.bbox.size.z), (1.0, 0.3));
    }

    #[test]
    fn everything_is_drawn_once_and_what_is_meant_is_drawn_out() {
        let map = map();
        let MarkerArray { markers } = markers_of(&map, Stamp(0));
        assert_eq!(markers[0].action, REMOVE_ALL);
        let mut keys: Vec<(&str, i32)> = markers[1..].iter().map(|m| (m.ns.as_str(), m.id)).collect();
        keys.sort_unstable();
        assert_eq!(keys, [("names", 1), ("names", 2), ("objects", 1), ("objects", 2)]);
        assert_eq!(meant_markers(&map, Some(ObjectId(2)), "the mug", Stamp(0)).markers.len(), 3);
        assert_eq!(meant_markers(&map, Some(ObjectId(9)), "the mug", Stamp(0)).markers.len(), 1);
        assert_eq!(meant_markers(&map, None, "the mug", Stamp(0)).markers.len(), 1);
    }
}
