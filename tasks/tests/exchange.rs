//! Contract: every exported format is read by the libraries that others use, with counts, poses, colours and names equal;
//! a scene graph that spark_dsg saved again gives the same map. Skipped where these libraries cannot be had.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its map fails")]

mod python;

use dsm::geometry::OrientedBox;
use dsm::map::{
    AttributeKind, Attributes, CellState, Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, ObjectState,
    Relation, RelationKind, Room, RoomId, Votes,
};
use dsm::store::{load_map, save_map};
use dsm::time::Stamp;
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};
use python::{find_python, run_script, skip};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn object(id: u64, name: &str, center: [f64; 3], yaw: f64, points: usize) -> MapObject {
    let mut names = Votes::default();
    names.add(name, 3.25);
    names.add("thing", 0.1);
    let mut attributes = Attributes::default();
    attributes.add(AttributeKind::Appearance, "color", "red", 2.5);
    attributes.add(AttributeKind::Affordance, "use", "eat", 1.0);
    let point = |i: usize| MapPoint {
        position: Point3::from(center).cast::<f32>() + Vector3::new(0.01, 0.003, 0.007) * (i as f32 * 0.37),
        color: [(i * 7 % 256) as u8, (i * 31 % 256) as u8, (255 - i % 256) as u8],
    };
    MapObject {
        id: ObjectId(id),
        state: ObjectState::Stable,
        names,
        points: (0..points).map(point).collect(),
        bounds: OrientedBox {
            center: center.into(),
            size: Vector3::new(0.11, 0.23, 0.35),
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.2, yaw),
        },
        attributes,
        visual_feature: vec![0.6, 0.8, 0.1],
        provenance: Default::default(),
        text_feature: vec![1.0 / 3.0, 0.2],
        room: Some(RoomId(id as u32 % 2)),
        observations: 5 + id as u32,
        first_seen: Stamp(1_234_567_891),
        last_seen: Stamp(9_876_543_210_123),
    }
}

fn map() -> Map {
    let mut map = Map::new(0.05);
    let mut provisional = object(9, "mug", [0.0, 0.1, 0.2], 0.5, 3);
    provisional.state = ObjectState::Provisional;
    let objects = [
        object(1, "apple", [1.0 / 3.0, -2.0, 0.87], 0.3, 40),
        object(2, "a \"table\", round", [1.5, 0.7, 0.4], -2.9, 300),
        object(7, "shelf", [-4.25, 3.125, 1.0], 1.6, 0),
        provisional,
    ];
    let relation = |from, to, kind, confidence| Relation { from: ObjectId(from), to: ObjectId(to), kind, confidence };
    let relations = vec![
        relation(1, 2, RelationKind::On, 0.9),
        relation(1, 2, RelationKind::Near, 0.3),
        relation(2, 1, RelationKind::Under, 0.9),
        relation(7, 2, RelationKind::NextTo, 0.55),
        relation(9, 2, RelationKind::On, 0.1),
    ];
    let room = |id: u32, name: &str, x: f64| Room {
        id: RoomId(id),
        name: name.into(),
        polygon: [[x, 0.0], [x + 3.0, 0.0], [x + 3.0, 2.5], [x, 2.5]].map(Point2::from).to_vec(),
        center: Point2::new(x + 1.5, 1.25),
        area_m2: 7.5,
        neighbours: vec![RoomId(1 - id)],
    };
    let mut changes = objects.map(|object| MapChange::Put(Box::new(object))).to_vec();
    changes.push(MapChange::Relate { about: relations.iter().map(|r| r.from).collect(), relations });
    changes.push(MapChange::Rooms(vec![room(0, "kitchen", -3.0), room(1, "room", 0.1)]));
    let state = |i: i32| if i % 3 == 0 { CellState::Occupied } else { CellState::Free };
    changes.push(MapChange::Cells((0..200).map(|i| ([i % 20 - 7, i / 20], state(i))).collect()));
    map.apply(MapUpdate { stamp: Stamp(10_000_000_000_123), changes });
    map
}

fn dsm(folder: &Path, args: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_dsm")).args(args).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
fn exports_are_read_by_others_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let map = map();
    save_map(&path.join("map.dsm"), &map).unwrap();
    for name in ["map.ply", "map.json", "map.csv", "map.glb", "map.pgm"] {
        dsm(path, &["map", "export", "map.dsm", name]);
    }
    dsm(path, &["map", "export", "map.dsm", "--format", "spark-dsg", "-o", "map.dsg.json"]);
    // Without the library in between.
    dsm(path, &["map", "import", "map.dsg.json", "-o", "back.dsm"]);
    assert_eq!(load_map(&path.join("back.dsm")).unwrap().map, map);
    // The Nav2 image shows each cell, the last row first.
    let (image, free) = (fs::read(path.join("map.pgm")).unwrap(), &map.free_space);
    assert!(image.starts_with(format!("P5\n{} {}\n255\n", free.columns, free.rows).as_bytes()));
    let count = |value: u8| image[image.len() - free.cells.len()..].iter().filter(|pixel| **pixel == value).count();
    assert_eq!([count(0), count(254)], [67, 133]);
    assert!(fs::read_to_string(path.join("map.yaml")).unwrap().contains("resolution: 0.05"));
    // Whichever of the two files is named, the image is none of text and the text names the image.
    for (named, files) in [("floor.yaml", "floor"), ("named.pgm", "named"), ("v1.2", "v1.2")] {
        dsm(path, &["map", "export", "map.dsm", "--format", "nav2", "-o", named]);
        assert_eq!(fs::read(path.join(format!("{files}.pgm"))).unwrap(), image, "{named}");
        let text = fs::read_to_string(path.join(format!("{files}.yaml"))).unwrap();
        assert!(text.starts_with(&format!("image: {files}.pgm\n")), "{named}: {text}");
    }

    let shown = dsm(path, &["map", "show", "map.dsm", "--json"]).stdout;
    fs::write(path.join("shown.json"), shown).unwrap();
    let points: BTreeMap<u64, Vec<[f64; 6]>> = map
        .stable_objects()
        .map(|object| {
            let list = |p: &MapPoint| {
                let (q, [r, g, b]) = (p.position.cast::<f64>(), p.color.map(f64::from));
                [q.x, q.y, q.z, r, g, b]
            };
            (object.id.0, object.points.iter().map(list).collect())
        })
        .collect();
    fs::write(path.join("points.json"), serde_json::to_string(&points).unwrap()).unwrap();
    let packages = ["plyfile==1.1.5", "pygltflib==1.16.5", "spark-dsg==1.1.3"];
    let Some(python) = find_python("exchange-python", &packages) else {
        return skip("exchange: PyPI's plyfile, pygltflib and spark-dsg cannot be had");
    };
    let said = run_script(&python, "exchange.py", path);
    assert!(said.contains("3 objects, 340 points, 2 edges"), "{said}");
    // What spark_dsg loaded and saved again is the same map.
    dsm(path, &["map", "import", "again.dsg.json", "-o", "again.dsm"]);
    assert_eq!(load_map(&path.join("again.dsm")).unwrap().map, map);
}
