//! Contract of map scores: a map like the truth is without fault, and each fault shows in its own rate.

use dsm::build::BuildConfig;
use dsm::eval::{
    MapScore, SurfacePoint, TrueAttributes, TrueRoom, TrueScene, TrueThing, Verdict, match_objects, score_map,
};
use dsm::geometry::{Aabb, OrientedBox};
use dsm::knowledge::Knowledge;
use dsm::map::{AttributeKind, Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, ObjectState, RoomId};
use dsm::map::{Relation, RelationKind};
use dsm::time::Stamp;
use nalgebra::{Point2, Point3, Vector3};
use std::sync::Arc;

/// A box with points every 2 cm on all faces.
fn thing(category: &str, center: [f64; 3], size: [f64; 3], color: &str) -> TrueThing {
    let (center, size) = (Point3::from(center), Vector3::from(size));
    let bounds = OrientedBox { center, size, rotation: nalgebra::UnitQuaternion::identity() };
    let mut points = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (nu, nv) = ((size[u] / 0.02).round() as i32, (size[v] / 0.02).round() as i32);
        for (i, j, side) in (0..nu).flat_map(|i| (0..nv).flat_map(move |j| [(i, j, -0.5), (i, j, 0.5)])) {
            let mut at = center;
            at[axis] += side * size[axis];
            at[u] += size[u] * ((f64::from(i) + 0.5) / f64::from(nu) - 0.5);
            at[v] += size[v] * ((f64::from(j) + 0.5) / f64::from(nv) - 0.5);
            let mut normal = Vector3::zeros();
            normal[axis] = 2.0 * side as f32;
            points.push(SurfacePoint { position: at.cast(), normal, area_m2: 4e-4, seen: true });
        }
    }
    let attributes = TrueAttributes { color: Some(color.into()), ..TrueAttributes::default() };
    TrueThing { category: category.into(), attributes, bounds, points, frames_seen: 9 }
}

fn truth() -> TrueScene {
    TrueScene {
        name: "test".into(),
        rooms: vec![TrueRoom {
            name: "kitchen".into(),
            polygon: [[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]].map(Point2::from).to_vec(),
        }],
        objects: vec![
            thing("table", [0.0, 0.0, 0.36], [1.2, 0.8, 0.72], "brown"),
            thing("mug", [0.2, 0.1, 0.77], [0.1, 0.1, 0.1], "red"),
            thing("box", [-0.31, 0.01, 0.82], [0.2, 0.2, 0.2], "silver"),
        ],
    }
}

fn object(id: u64, name: &str, points: Vec<MapPoint>, color: &str) -> MapObject {
    let all: Vec<Point3<f64>> = points.iter().map(|p| p.position.cast()).collect();
    let mut object = MapObject {
        id: ObjectId(id),
        state: ObjectState::Stable,
        names: Default::default(),
        bounds: Aabb::from_points(&all).expect("a thing has points").into(),
        points,
        attributes: Default::default(),
        visual_feature: vec![],
        provenance: Default::default(),
        text_feature: vec![],
        room: Some(RoomId(0)),
        observations: 9,
        first_seen: Stamp::default(),
        last_seen: Stamp::default(),
    };
    object.names.add(name, 1.0);
    object.attributes.add(AttributeKind::Appearance, "color", color, 1.0);
    object
}

fn points(thing: &TrueThing, keep: impl Fn(&Point3<f32>) -> bool) -> Vec<MapPoint> {
    let kept = thing.points.iter().filter(|p| keep(&p.position));
    kept.map(|p| MapPoint { position: p.position, color: [9; 3] }).collect()
}

/// A map that holds exactly the truth.
fn copy(truth: &TrueScene) -> Vec<MapObject> {
    let words = ["brown", "red", "gray"];
    let copied = truth.objects.iter().zip(words).enumerate();
    copied.map(|(i, (thing, word))| object(i as u64, &thing.category, points(thing, |_| true), word)).collect()
}

fn map(objects: Vec<MapObject>, relations: &[(u64, RelationKind, u64)]) -> Map {
    let mut map = Map::new(0.05);
    let about = objects.iter().map(|object| object.id).collect();
    let mut changes: Vec<MapChange> = objects.into_iter().map(|object| MapChange::Put(Box::new(object))).collect();
    let relations = relations.iter().map(|(from, kind, to)| Relation {
        from: ObjectId(*from),
        to: ObjectId(*to),
        kind: *kind,
        confidence: 1.0,
    });
    changes.push(MapChange::Relate { about, relations: relations.collect() });
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    map
}

fn score(map: &Map) -> MapScore {
    score_map(map, &truth(), &BuildConfig::default(), &Arc::new(Knowledge::embedded().expect("the table is whole")))
}

fn value(score: &MapScore, name: &str) -> f64 {
    score.shares[name].estimate().value
}

#[test]
fn the_truth_itself_is_without_fault() {
    let truth = truth();
    let score = score(&map(copy(&truth), &[(1, RelationKind::On, 0), (0, RelationKind::Under, 1)]));
    for name in ["precision", "recall", "acc_25", "acc_50", "name", "color"] {
        assert_eq!(value(&score, name), 1.0, "{name}");
    }
    for name in ["duplicate", "ghost", "over_merge"] {
        assert_eq!(value(&score, name), 0.0, "{name}");
    }
    assert!(score.means["point_error_m"].sum < 1e-3);
    assert!(score.means["f_miou"].sum > 0.97 && score.means["mean_accuracy"].sum > 0.97);
    let on = score.f1["relation_on"];
    assert_eq!((on.right, on.wrong, on.missed), (1, 0, 1), "the box on the table was not said");
}

#[test]
fn each_fault_shows_in_its_own_rate() {
    let truth = truth();
    // The table in two parts, the larger one first.
    let mut parts = copy(&truth);
    parts[0] = object(0, "table", points(&truth.objects[0], |p| p.x < 0.3), "brown");
    parts.push(object(7, "table", points(&truth.objects[0], |p| p.x >= 0.3), "brown"));
    let matching = match_objects(&map(parts.clone(), &[]), &truth);
    assert_eq!(matching.verdicts[&ObjectId(7)], Verdict::Duplicate(0));
    assert_eq!(value(&score(&map(parts, &[])), "duplicate"), 0.25);
    // A box in the air.
    let mut ghosts = copy(&truth);
    ghosts.push(object(7, "box", points(&thing("box", [2.0, 2.0, 1.0], [0.2; 3], "red"), |_| true), "red"));
    let found = score(&map(ghosts, &[]));
    assert_eq!((value(&found, "ghost"), value(&found, "duplicate")), (0.25, 0.0));
    // The mug is part of the table.
    let mut merged = copy(&truth);
    let mug = merged.remove(1);
    let mut all = merged[0].points.clone();
    all.extend(mug.points);
    merged[0] = object(0, "table", all, "brown");
    let found = score(&map(merged, &[]));
    assert_eq!(found.shares["over_merge"].hits, 1);
    assert_eq!((found.shares["recall"].hits, found.shares["recall"].count), (2, 3));
    // The mug is not there at all: missed, and nothing else.
    let mut missed = copy(&truth);
    missed.remove(1);
    let found = score(&map(missed, &[]));
    assert_eq!((value(&found, "over_merge"), value(&found, "precision")), (0.0, 1.0));
    assert_eq!(found.shares["recall"].hits, 2);
}

#[test]
fn a_shifted_box_and_a_wrong_word_lower_their_scores() {
    let truth = truth();
    let mut objects = copy(&truth);
    let shifted = points(&truth.objects[1], |_| true);
    let shifted = shifted.into_iter().map(|p| MapPoint { position: p.position + Vector3::new(0.04, 0.04, 0.0), ..p });
    objects[1] = object(1, "cup", shifted.collect(), "blue");
    let found = score(&map(objects, &[]));
    // 6 x 6 of 10 x 10 cm in common: 36 / 164.
    assert_eq!((found.shares["acc_25"].hits, found.shares["acc_50"].hits), (2, 2));
    assert_eq!((found.shares["name"].hits, found.shares["color"].hits), (2, 2));
    assert!(found.means["point_error_m"].sum / found.means["point_error_m"].count as f64 > 1e-3);
}
