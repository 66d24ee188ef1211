//! Contract of `dsm eval segmentation`: the truth of a scene of one's own is made by one command, a map of the scene is
//! scored against it by another, and the answers of a language backend take the place of the embedded encoder.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its files fails")]

use dsm::eval::{LabelClasses, LabelledCloud};
use dsm::geometry::{Aabb, OrientedBox};
use dsm::map::{Attributes, Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, ObjectState, Votes};
use dsm::store::save_map;
use dsm::time::Stamp;
use nalgebra::Point3;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

const SCENE: &str = r#"<mujoco model="small">
  <worldbody>
    <geom name="floor" type="box" size="3 3 0.05" pos="0 0 -0.05"/>
    <body name="table_1" pos="1.5 0 0.2"><geom type="box" size="0.3 0.3 0.2"/></body>
    <body name="apple_1" pos="1.5 0 0.44"><geom type="sphere" size="0.035"/></body>
  </worldbody>
</mujoco>
"#;

const SEMANTICS: &str = r#"version = 1
name = "small"

[start]
areas = [{ x_m = 0.0, y_m = 0.0 }]

[[room]]
name = "kitchen"
polygon = [[-3, -3], [3, -3], [3, 3], [-3, 3]]

[[object]]
body = "table_1"
category = "table"

[[object]]
body = "apple_1"
category = "apple"
"#;

fn run(folder: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_dsm")).args(args).current_dir(folder).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// A map with the points of the cloud, one object for each label, called as told.
fn map_of(cloud: &LabelledCloud, names: &[(i64, &str)]) -> Map {
    let mut map = Map::new(0.05);
    let object = |(id, (label, name)): (u64, &(i64, &str))| {
        let own = cloud.points.iter().filter(|point| point.label == *label);
        let points: Vec<MapPoint> = own.map(|p| MapPoint { position: p.position, color: [9; 3] }).collect();
        let all: Vec<Point3<f64>> = points.iter().map(|p| p.position.cast()).collect();
        let mut votes = Votes::default();
        votes.add(name, 1.0);
        MapChange::Put(Box::new(MapObject {
            id: ObjectId(id),
            state: ObjectState::Stable,
            names: votes,
            points,
            bounds: OrientedBox::from(Aabb::from_points(&all).unwrap()),
            attributes: Attributes::default(),
            visual_feature: vec![1.0],
            provenance: Default::default(),
            text_feature: vec![1.0],
            room: None,
            observations: 5,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        }))
    };
    let changes = (0..).zip(names).map(object).collect();
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    map
}

#[test]
fn a_scene_makes_its_truth_and_a_map_is_scored_against_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("scene.xml"), SCENE).unwrap();
    fs::write(path.join("semantics.toml"), SEMANTICS).unwrap();
    let labels = run(path, &["scene", "labels", "scene.xml", "--out", "truth"]);
    assert_eq!(labels.0, Some(0), "{labels:?}");
    let classes = LabelClasses::parse(&fs::read_to_string(path.join("truth/classes.toml")).unwrap(), path).unwrap();
    let named: Vec<(i64, &str)> = classes.classes.iter().map(|class| (class.label, class.name.as_str())).collect();
    assert_eq!(named, [(1, "apple"), (2, "table")]);
    let bytes = fs::read(path.join("truth/labelled.ply")).unwrap();
    let cloud = LabelledCloud::parse(&bytes, path, "label").unwrap();
    // What lies on the floor does not show.
    assert!(cloud.points.iter().all(|point| point.position.z > 0.0) && cloud.points.len() > 1000);
    let table = |point: &&dsm::eval::LabelledPoint| point.label == 2;
    let top = cloud.points.iter().filter(table).map(|point| point.position.z).fold(0.0, f32::max);
    assert!((top - 0.4).abs() < 1e-3, "{top}");

    save_map(&path.join("map.dsm"), &map_of(&cloud, &[(1, "apple"), (2, "dining table")])).unwrap();
    let eval = ["eval", "segmentation", "map.dsm", "--truth", "truth/labelled.ply", "--classes", "truth/classes.toml"];
    let with = |more: &[&'static str]| run(path, &[&eval[..], more].concat());
    let (code, text, error) = with(&["--json", "--questions", "questions.jsonl"]);
    assert_eq!(code, Some(0), "{error}");
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["labeller"], "embedded");
    assert!(report["mean_accuracy"].as_f64().unwrap() > 0.99 && report["mean_iou"].as_f64().unwrap() > 0.98, "{text}");
    assert_eq!(report["points"].as_u64().unwrap() as usize, cloud.points.len());
    let questions = fs::read_to_string(path.join("questions.jsonl")).unwrap();
    let question: Value = serde_json::from_str(questions.lines().next().unwrap()).unwrap();
    assert!(question["sentence"].as_str().unwrap().starts_with("This is apple, its appearance attributes include"));
    assert_eq!(question["classes"], serde_json::json!(["apple", "table"]));

    // A backend that takes the table for an apple, too: the table's surface is lost, the apple's drowns.
    let answers = "{\"object_id\": 0, \"class\": \"apple\"}\n{\"object_id\": 1, \"class\": \"Apple\"}\n";
    fs::write(path.join("answers.jsonl"), answers).unwrap();
    let (code, text, error) = with(&["--json", "--answers", "answers.jsonl"]);
    assert_eq!(code, Some(0), "{error}");
    let report: Value = serde_json::from_str(&text).unwrap();
    let class = |i: usize, key: &str| report["classes"][i][key].as_f64().unwrap();
    assert!(class(0, "accuracy") > 0.99 && class(0, "iou") < 0.1 && class(1, "accuracy") < 0.01, "{text}");

    // Background is left out.
    let text = fs::read_to_string(path.join("truth/classes.toml")).unwrap();
    fs::write(path.join("truth/classes.toml"), text.replace("name = \"table\"", "name = \"table\"\nexclude = true"))
        .unwrap();
    let (code, text, error) = with(&[]);
    assert_eq!(code, Some(0), "{error}");
    assert!(text.contains("excluded: table") && text.contains("1 classes"), "{text}");
}
