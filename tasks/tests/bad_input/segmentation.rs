//! Scoring a map against a labelled cloud.

use crate::bench::{Bench, refuse};
use dsm::map::Map;
use dsm::store::save_map;

const EVAL: [&str; 7] = ["eval", "segmentation", "map.dsm", "--truth", "t.ply", "--classes", "c.toml"];
const CLASSES: &str =
    "version = 1\n\n[[class]]\nlabel = 1\nname = \"chair\"\n\n[[class]]\nlabel = 2\nname = \"table\"\n";
const CLOUD: &str = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                     property int label\nend_header\n0 0 0 1\n0 0 1 2\n";

/// A folder with an empty map, a cloud and its classes that are right.
fn good() -> Bench {
    let bench = Bench::new().file("t.ply", CLOUD).file("c.toml", CLASSES);
    save_map(&bench.path().join("map.dsm"), &Map::new(0.05)).unwrap();
    bench
}

refuse! {
    cloud_is_missing: good().without("t.ply"), EVAL, ["t.ply", "No such file"];
    cloud_is_something_else: good().file("t.ply", "solid cube\n"), EVAL, ["t.ply:1: expected `ply`"];
    cloud_is_big_endian: good().edit("t.ply", "ascii", "binary_big_endian"), EVAL,
        ["t.ply:2", "binary_little_endian", "binary_big_endian"];
    cloud_has_a_word: good().edit("t.ply", "0 0 1 2", "0 0 one 2"), EVAL, ["t.ply:10: expected a number, got `one`"];
    cloud_is_cut: good().edit("t.ply", "0 0 1 2\n", ""), EVAL, ["t.ply:", "the file ends after 1 of 2 points"];
    cloud_has_no_label: good(), ["eval", "segmentation", "map.dsm", "--truth", "t.ply", "--classes", "c.toml",
        "--label-property", "object_id"], ["t.ply:8: a point has no property `object_id`; it has: x, y, z, label"];
    cloud_label_is_a_float: good().edit("t.ply", "int label", "float label"), EVAL, ["t.ply:8", "must be an integer"];
    cloud_has_other_labels: good().edit("t.ply", "0 0 0 1\n0 0 1 2", "0 0 0 8\n0 0 1 9"), EVAL,
        ["t.ply: the cloud has no point of the listed classes: chair, table"];
    class_key_is_misspelt: good().edit("c.toml", "label = 1", "lable = 1"), EVAL,
        ["c.toml:4: unknown key", "did you mean `label`?"];
    class_label_is_there_twice: good().edit("c.toml", "label = 2", "label = 1"), EVAL,
        ["c.toml:8: label 1 is `chair` already"];
    class_file_is_of_another_version: good().edit("c.toml", "version = 1", "version = 3"), EVAL,
        ["c.toml:1: expected version 1"];
    answers_are_garbage: good().file("a.jsonl", "{\"object_id\": 1, \"class\": \"chair\"}\nchair\n"),
        ["eval", "segmentation", "map.dsm", "--truth", "t.ply", "--classes", "c.toml", "--answers", "a.jsonl"],
        ["a.jsonl: line 2", "expected {\"object_id\""];
    map_to_score_is_missing: good().without("map.dsm"), EVAL, ["map.dsm", "No such file"];
    scene_to_label_is_missing: Bench::new().without("scene.xml"), ["scene", "labels", "scene.xml", "--out", "truth"],
        ["scene.xml", "cannot be read"];
}
