//! Map files.

use crate::bench::{Bench, refuse};
use dsm::geometry::OrientedBox;
use dsm::map::{Attributes, Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, ObjectState, Votes};
use dsm::store::{MapLog, load_map, save_map};
use dsm::time::Stamp;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::fs;

const SHOW: [&str; 3] = ["map", "show", "map.dsm"];
const GROUND: [&str; 3] = ["ground", "map.dsm", "the apple"];
/// Length of magic, version and cell size.
const HEADER: usize = 20;
/// Where the first object's record begins: behind the one that says how many there are.
const FIRST: usize = HEADER + 14;

fn apple(id: u64) -> MapObject {
    let mut names = Votes::default();
    names.add("apple", 1.0);
    MapObject {
        id: ObjectId(id),
        state: ObjectState::Stable,
        names,
        points: vec![MapPoint { position: Point3::new(1.0, 2.0, 0.5), color: [200, 20, 20] }; 30],
        bounds: OrientedBox {
            center: Point3::new(1.0, 2.0, 0.5),
            size: Vector3::new(0.1, 0.1, 0.1),
            rotation: UnitQuaternion::identity(),
        },
        attributes: Attributes::default(),
        visual_feature: vec![1.0],
        provenance: Default::default(),
        text_feature: vec![1.0],
        room: None,
        observations: 5,
        first_seen: Stamp::default(),
        last_seen: Stamp::default(),
    }
}

/// A folder with the map of one object.
fn map_of(object: MapObject) -> Bench {
    let bench = Bench::new();
    let mut map = Map::new(0.05);
    map.apply(MapUpdate { stamp: Stamp::default(), changes: vec![MapChange::Put(Box::new(object))] });
    save_map(&bench.path().join("map.dsm"), &map).unwrap();
    bench
}

/// A folder with a good map of which the bytes were changed.
fn damaged(change: impl FnOnce(&mut Vec<u8>)) -> Bench {
    let bench = map_of(apple(1));
    let mut bytes = fs::read(bench.path().join("map.dsm")).unwrap();
    change(&mut bytes);
    bench.file("map.dsm", bytes)
}

fn with_bounds(change: impl FnOnce(&mut OrientedBox)) -> Bench {
    let mut object = apple(3);
    change(&mut object.bounds);
    map_of(object)
}

refuse! {
    map_is_missing: Bench::new(), SHOW, ["map.dsm", "No such file"];
    map_is_a_folder: Bench::new().folder("map.dsm"), SHOW, ["map.dsm", "directory"];
    map_is_empty: Bench::new().file("map.dsm", ""), SHOW, ["map.dsm: not a map file", "expected the first bytes `DSM-MAP`"];
    map_is_something_else: Bench::new().file("map.dsm", "\u{7f}ELF, really"), SHOW, ["map.dsm: not a map file", "ELF"];
    map_header_is_cut: damaged(|b| b.truncate(11)), SHOW, ["map.dsm: no readable record at byte 11", "the header is cut off"];
    map_version_is_newer: damaged(|b| b[8] = 9), SHOW, ["map.dsm: map format version 9 is not known", "reads version 1"];
    map_cell_size_is_garbage: damaged(|b| b[12..20].fill(0xff)), SHOW, ["map.dsm", "byte 12", "outside 0.001 to 1 m"];
    map_record_is_cut: damaged(|b| b.truncate(b.len() - 1)), SHOW, ["map.dsm: no readable record at byte 34", "a record is cut off"];
    map_byte_is_flipped: damaged(|b| *b.last_mut().unwrap() ^= 1), SHOW, ["map.dsm", "byte 34", "a checksum is wrong"];
    map_length_is_absurd: damaged(|b| b[FIRST + 5..FIRST + 9].fill(0xff)), SHOW, ["map.dsm", "a record claims 4294967295 bytes"];
    map_box_is_nan: with_bounds(|b| b.center.x = f64::NAN), SHOW, ["map.dsm: object 3: its box is not finite"];
    map_box_is_negative: with_bounds(|b| b.size.y = -0.1), SHOW, ["map.dsm: object 3: its box has a negative size"];
    grounding_in_a_damaged_map: damaged(|b| *b.last_mut().unwrap() ^= 1), GROUND, ["map.dsm", "a checksum is wrong"];
    grounding_in_something_else: Bench::new().file("map.dsm", "words"), GROUND, ["map.dsm: not a map file"];
    checking_something_else: Bench::new().file("map.dsm", "words"), ["map", "check", "map.dsm"], ["map.dsm: not a map file"];
    repairing_something_else: Bench::new().file("map.dsm", "words"), ["map", "check", "map.dsm", "--repair", "new.dsm"],
        ["map.dsm: not a map file"];
    export_to_an_unknown_format: map_of(apple(1)), ["map", "export", "map.dsm", "map.docx"],
        ["map.docx: expected .ply, .json, .csv, .glb, .pgm, .yaml, .png or .svg, or --format"];
    export_without_a_file: map_of(apple(1)), ["map", "export", "map.dsm"], ["required", "OUTPUT"];
    import_of_something_else: Bench::new().file("graph.json", "{\"nodes\": 3}"),
        ["map", "import", "graph.json", "-o", "new.dsm"], ["graph.json: not spark_dsg JSON", "line 1"];
    merge_without_numbers: map_of(apple(1)), ["map", "merge", "map.dsm", "map.dsm", "--transform", "1,2,left", "-o", "new.dsm"],
        ["expected four numbers x,y,z,yaw"];
    merge_with_a_missing_map: map_of(apple(1)),
        ["map", "merge", "map.dsm", "other.dsm", "--transform", "0,0,0,0", "-o", "new.dsm"], ["other.dsm", "No such file"];
    export_of_a_damaged_map: damaged(|b| *b.last_mut().unwrap() ^= 1), ["map", "export", "map.dsm", "map.ply"],
        ["map.dsm", "a checksum is wrong"];
    drawing_of_an_empty_map: damaged(|b| b.truncate(HEADER)), ["map", "export", "map.dsm", "map.png"],
        ["the map is empty: there is nothing to draw"];
    export_into_a_missing_folder: map_of(apple(1)), ["map", "export", "map.dsm", "nowhere/map.ply"], ["nowhere", "No such file"];
    report_into_a_missing_folder: map_of(apple(1)), ["map", "show", "map.dsm", "--report", "nowhere/map.json"],
        ["nowhere", "No such file"];
}

/// A log that ends in the middle of a record is no broken input: it opens up to there, and says what is lost.
#[test]
fn a_log_that_breaks_off_opens_up_to_its_last_whole_record() {
    let bench = Bench::new();
    let path = bench.path().join("map.dsm");
    let mut log = MapLog::create(&path, 0.05).unwrap();
    let mut map = Map::new(0.05);
    for (second, id) in [(2, 1), (4, 2)] {
        let changes = vec![MapChange::Put(Box::new(apple(id)))];
        let update = MapUpdate { stamp: Stamp::from_s(f64::from(second)), changes };
        map.apply(update.clone());
        log.append(update, &map).unwrap();
    }
    drop(log);
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 5]).unwrap();
    let checked = bench.run(&["map", "check", "map.dsm"]);
    let text = String::from_utf8_lossy(&checked.stdout);
    assert_eq!(checked.status.code(), Some(1), "{text}");
    assert!(text.contains("a record is cut off; 1 records with 1 objects are whole"), "{text}");
    let repaired = bench.run(&["map", "check", "map.dsm", "--repair", "new.dsm"]);
    assert_eq!(repaired.status.code(), Some(1));
    assert_eq!(bench.run(&["map", "check", "new.dsm"]).status.code(), Some(0));
}

/// Two maps of one apple, the second's world two metres ahead and turned by half a circle.
#[test]
fn merged_maps_hold_what_both_show_once() {
    let bench = map_of(apple(1));
    let mut turned = apple(7);
    turned.bounds.center = Point3::new(1.0, -2.0, 0.5);
    turned.points.iter_mut().for_each(|point| point.position = Point3::new(1.0, -2.0, 0.5));
    let mut second = apple(8);
    second.bounds.center.x = -3.0;
    let mut map = Map::new(0.05);
    let changes = [turned, second].map(|object| MapChange::Put(Box::new(object))).to_vec();
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    save_map(&bench.path().join("other.dsm"), &map).unwrap();
    let transform = format!("2,0,0,{}", std::f64::consts::PI);
    let merged = bench.run(&["map", "merge", "map.dsm", "other.dsm", "--transform", &transform, "-o", "both.dsm"]);
    let text = String::from_utf8_lossy(&merged.stdout);
    assert!(
        text.starts_with("2 objects: 1 in both maps, 1 added"),
        "{text} {}",
        String::from_utf8_lossy(&merged.stderr)
    );
    let both = load_map(&bench.path().join("both.dsm")).unwrap().map;
    let centers: Vec<[f64; 2]> = both.objects.values().map(|o| [o.bounds.center.x, o.bounds.center.y]).collect();
    assert!((centers[0][0] - 1.0).abs() < 1e-9 && (centers[0][1] - 2.0).abs() < 1e-9, "{centers:?}");
    assert!((centers[1][0] - 5.0).abs() < 1e-9 && (centers[1][1] + 2.0).abs() < 1e-9, "{centers:?}");
    let shared = &both.objects[&ObjectId(1)];
    assert_eq!((shared.observations, shared.points.len(), shared.names.total()), (10, 60, 2.0));
}
