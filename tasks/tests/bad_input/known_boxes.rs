//! Files of `dsm eval grounding`.

use crate::bench::{Bench, refuse};

const GROUNDING: [&str; 6] = ["eval", "grounding", "--scenes", "scenes.jsonl", "--queries", "queries.jsonl"];
const CSV: [&str; 6] = ["eval", "grounding", "--scenes", "scenes.jsonl", "--queries", "nr3d.csv"];
const JSON: [&str; 6] = ["eval", "grounding", "--scenes", "scenes.jsonl", "--queries", "scanrefer.json"];

/// A scene with one box and a query about it.
fn boxes() -> Bench {
    let scene = r#"{"scene_id": "a", "objects": [{"id": 1, "label": "lamp", "center": [0,0,1], "size": [1,1,1], "mean_rgb": null}]}"#;
    let query = r#"{"dataset": "d", "query_id": "1", "scene_id": "a", "utterance": "the lamp", "target_id": 1}"#;
    Bench::new()
        .file("scenes.jsonl", scene)
        .file("queries.jsonl", query)
        .file("nr3d.csv", "scan_id,target_id,utterance,instance_type\na,1,the lamp,lamp\n")
        .file("scanrefer.json", "[]")
}

refuse! {
    no_scenes: boxes().without("scenes.jsonl"), GROUNDING, ["scenes.jsonl"];
    a_scene_that_is_none: boxes().file("scenes.jsonl", "{}\n"), GROUNDING, ["scenes.jsonl", "line 1", "scene_id"];
    a_broken_query: boxes().file("queries.jsonl", "\n{\"dataset\": 3}\n"), GROUNDING, ["queries.jsonl", "line 2"];
    a_table_without_a_column: boxes().file("nr3d.csv", "scan_id,target_id,utterance\n"), CSV, ["nr3d.csv", "line 1", "instance_type"];
    a_target_that_is_no_number: boxes().edit("nr3d.csv", "a,1,", "a,one,"), CSV, ["nr3d.csv", "line 2", "target_id", "one"];
    a_quote_that_does_not_end: boxes().edit("nr3d.csv", "the lamp", "\"the lamp"), CSV, ["nr3d.csv", "line 2", "does not end"];
    descriptions_that_are_none: boxes().file("scanrefer.json", "[\n{\"scene_id\": 1}\n]"), JSON, ["scanrefer.json", "line 2"];
    one_fold: boxes(), ["eval", "grounding", "--scenes", "scenes.jsonl", "--queries", "queries.jsonl", "--folds", "1"], ["--folds"];
    an_unknown_part: boxes(), ["eval", "grounding", "--scenes", "scenes.jsonl", "--queries", "queries.jsonl", "--ablate", "luck"], ["luck", "relations"];
}

#[test]
fn published_files_are_measured() {
    let bench = boxes();
    for args in [GROUNDING, CSV, JSON] {
        let output = bench.run(&args);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let output = bench.run(&CSV);
    assert!(String::from_utf8_lossy(&output.stdout).contains("nr3d"), "{output:?}");
}
