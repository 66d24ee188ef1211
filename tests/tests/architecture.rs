//! Contract: the shape of the project. Crates use only those to their left, foreign libraries stay behind their fences,
//! logic knows no wall clock and no random order, ground truth is read by the judge alone, and the root stays tidy.

#![allow(clippy::unwrap_used, reason = "a test that cannot read the sources fails")]

use scenarios::root;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Each crate's folder, its package, and the packages of ours that it may use.
const CRATES: [(&str, &str, &[&str]); 9] = [
    ("dsm", "dsm", &[]),
    ("dsm/models", "dsm-models", &["dsm"]),
    ("robot", "dsm-robot", &["dsm"]),
    ("robot/ros2", "dsm-ros2", &["dsm", "dsm-robot"]),
    ("sim", "dsm-sim", &["dsm", "dsm-robot"]),
    ("sim/mujoco", "dsm-sim-mujoco", &["dsm", "dsm-robot", "dsm-sim"]),
    ("tasks", "dsm-tasks", &["dsm", "dsm-models", "dsm-robot", "dsm-ros2", "dsm-sim", "dsm-sim-mujoco"]),
    ("tasks/python", "dsm-python", &["dsm", "dsm-robot", "dsm-tasks"]),
    ("tests", "scenarios", &["dsm", "dsm-robot", "dsm-sim", "dsm-tasks"]),
];

/// A source file, by its path from the root with `/`, with comments removed line by line.
type Sources = BTreeMap<String, Vec<String>>;

fn sources() -> Sources {
    let mut found = Sources::new();
    for (folder, _, _) in CRATES {
        collect(&root().join(folder), folder, &mut found);
    }
    // This file names what it forbids.
    found.remove("tests/tests/architecture.rs");
    assert!(found.len() > 80, "only {} source files found", found.len());
    found
}

fn collect(folder: &Path, name: &str, found: &mut Sources) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap()) {
        let file_name = entry.file_name().into_string().unwrap();
        let path = format!("{name}/{file_name}");
        if entry.file_type().unwrap().is_dir() && file_name != "target" {
            collect(&entry.path(), &path, found);
        } else if file_name.ends_with(".rs") {
            let text = fs::read_to_string(entry.path()).unwrap();
            let code = |line: &str| line.find("//").map_or(line, |at| &line[..at]).to_owned();
            found.insert(path, text.lines().map(code).collect());
        }
    }
}

/// Places that hold one of the words as a whole word, as `file:line: code`.
fn find(sources: &Sources, words: &[&str], allowed: impl Fn(&str) -> bool) -> Vec<String> {
    let part_of_name = |c: char| c.is_alphanumeric() || c == '_';
    let holds = |line: &str, word: &str| {
        line.match_indices(word).any(|(at, _)| {
            let before = line[..at].chars().next_back().is_some_and(part_of_name);
            let after = line[at + word.len()..].chars().next().is_some_and(part_of_name);
            !(before || after && word.ends_with(part_of_name))
        })
    };
    let lines = sources
        .iter()
        .filter(|(path, _)| !allowed(path))
        .flat_map(|(path, lines)| lines.iter().enumerate().map(move |(i, line)| (path, i + 1, line)));
    lines
        .filter(|(_, _, line)| words.iter().any(|word| holds(line, word)))
        .map(|(path, number, line)| format!("{path}:{number}: {}", line.trim()))
        .collect()
}

fn assert_none(found: Vec<String>, rule: &str) {
    assert!(found.is_empty(), "{rule}:\n  {}", found.join("\n  "));
}

#[test]
fn the_scanner_finds_whole_words_outside_comments() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.rs"), "let a = HashMap::new();\n// HashMap\nlet b = MyHashMap;\nuse x::HashMap;\n")
        .unwrap();
    let mut found = Sources::new();
    collect(folder.path(), "x", &mut found);
    let places = find(&found, &["HashMap"], |_| false);
    assert_eq!(places, ["x/a.rs:1: let a = HashMap::new();", "x/a.rs:4: use x::HashMap;"]);
    assert!(find(&found, &["HashMap"], |path| path == "x/a.rs").is_empty());
}

#[test]
fn crates_use_only_those_to_their_left() {
    for (folder, package, allowed) in CRATES {
        let manifest: toml::Table =
            fs::read_to_string(root().join(folder).join("Cargo.toml")).unwrap().parse().unwrap();
        assert_eq!(manifest["package"]["name"].as_str(), Some(package));
        for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
            for name in manifest.get(kind).and_then(|v| v.as_table()).into_iter().flat_map(|table| table.keys()) {
                let ours = CRATES.iter().any(|(_, other, _)| other == name);
                assert!(!ours || allowed.contains(&name.as_str()), "{package} must not use {name}");
            }
        }
    }
}

#[test]
fn foreign_libraries_stay_behind_their_fences() {
    let sources = sources();
    let within = |folder: &'static str| move |path: &str| path.starts_with(folder);
    let physics = ["rapier3d", "rapier3d_mjcf", "mjcf_rs", "mujoco_rs"];
    assert_none(find(&sources, &physics, within("sim/")), "physics engines and MJCF only in sim");
    assert_none(find(&sources, &["pyo3", "numpy"], within("tasks/python/")), "Python only in tasks/python");
    assert_none(
        find(&sources, &["ureq", "reqwest", "ort", "rten"], within("dsm/models/")),
        "models only in dsm/models",
    );
    let networks = ["rten", "rten_tensor", "tokenizers", "fast_image_resize"];
    assert_none(find(&sources, &networks, within("dsm/models/src/onnx")), "networks run in one folder");
    let client = find(&sources, &["ureq"], |path| path == "dsm/models/src/http.rs");
    assert_none(client, "the HTTP client stands in one file");
    assert_none(find(&sources, &["ros2_client", "rustdds"], within("robot/ros2/")), "ROS 2 only in robot/ros2");
    let viewers = ["mcap::", "re_build_info", "re_chunk", "re_log_encoding", "re_log_types", "re_sdk_types"];
    let files = |path: &str| path.starts_with("tasks/src/mcap_file") || path.ends_with("/rerun_file.rs");
    assert_none(find(&sources, &viewers, files), "recordings are written and read in one place for each format");
    let solver: Vec<String> = find(&sources, &["clarabel"], |_| false);
    let files: std::collections::BTreeSet<&str> = solver.iter().filter_map(|place| place.split(':').next()).collect();
    assert_eq!(files.len(), 1, "clarabel stands in one file: {files:?}");
    assert!(files.iter().all(|file| file.starts_with("robot/src/")), "{files:?}");
}

#[test]
fn the_default_build_has_no_model_and_no_client() {
    let table = |path: &str| -> toml::Table { fs::read_to_string(root().join(path)).unwrap().parse().unwrap() };
    let workspace = table("Cargo.toml");
    let members = workspace["workspace"]["default-members"].as_array().unwrap();
    assert!(!members.iter().any(|member| member.as_str() == Some("dsm/models")));
    let tasks = table("tasks/Cargo.toml");
    assert!(!members.iter().any(|member| member.as_str() == Some("tasks/python")));
    assert_eq!(tasks["dependencies"]["dsm-models"]["optional"].as_bool(), Some(true));
    assert!(tasks["features"].get("default").is_none(), "features are chosen by who builds");
}

#[test]
fn logic_has_no_wall_clock_no_sleep_and_no_random_order() {
    let sources = sources();
    // Programs that measure time are no logic; the command line writes timing.json.
    // A robot's hardware lives in wall time: so does its clock over ROS 2. A model's server lives in wall time: one file of `dsm/models` reads it, and pauses between requests.
    let wall = |path: &str| path == "dsm/models/src/wall.rs";
    let edge = |path: &str| {
        path.starts_with("tasks/src/cli/")
            || path.contains("/examples/")
            || path.contains("/benches/")
            || wall(path)
            || path == "robot/ros2/src/wall.rs"
    };
    let clock = ["Instant::now", "SystemTime::now", "std::time::Instant", "std::time::SystemTime"];
    assert_none(find(&sources, &clock, edge), "wall time only at the edge");
    assert_none(find(&sources, &["thread::sleep"], wall), "only the clock lets time pass");
    assert_none(find(&sources, &["HashMap", "HashSet"], |path| path.contains("/examples/")), "no random order");
    assert_none(
        find(&sources, &["thread_rng", "from_entropy", "from_os_rng", "rand::rng"], |_| false),
        "all is seeded",
    );
}

#[test]
fn nothing_is_left_undone() {
    let words = ["todo!", "unimplemented!", "dbg!", "if simulated", "if is_simulated", "static mut", "lazy_static"];
    assert_none(find(&sources(), &words, |_| false), "no stub, no global state, no task that asks for the simulator");
    for (path, text) in raw_sources() {
        for word in ["TODO", "FIXME", "XXX", "HACK"] {
            assert!(!text.contains(word), "{path} holds {word}");
        }
    }
}

#[test]
fn ground_truth_is_read_by_the_judge_alone() {
    let sources = sources();
    let judge = |path: &str| path == "tasks/src/judge.rs" || path.starts_with("tasks/src/judge/");
    let tasks_apart_from_judge = |path: &str| !path.starts_with("tasks/src/") || judge(path);
    // Assembling hands the judge's feed on without looking into it.
    let reads = ["TrueObject", "TruePart", "TrueWorld", "TrueContact", "eval::TrueWorld", "eval::TrueObject"];
    assert_none(find(&sources, &reads, tasks_apart_from_judge), "truth is read by the judge alone");
    let handles = |path: &str| tasks_apart_from_judge(path) || path == "tasks/src/assemble.rs";
    assert_none(find(&sources, &["eval::Truth", "Truth"], handles), "truth is handed from assemble.rs to the judge");
    // Scoring a map hands the truth from the replayed scene to the scores without looking into it.
    let scores = |path: &str| !path.starts_with("tasks/src/") || path == "tasks/src/survey.rs";
    let things = ["TrueScene", "TrueThing", "TrueAttributes", "SurfacePoint", "score_map", "match_objects"];
    assert_none(find(&sources, &things, scores), "maps are scored in tasks/src/survey.rs alone");
    // What bodies are (colour, material, room) is truth, too: the generator of episodes writes commands from it.
    let generator = |path: &str| !path.starts_with("tasks/src/") || path.starts_with("tasks/src/episode_generator/");
    let edge = |path: &str| generator(path) || path.starts_with("tasks/src/cli/");
    assert_none(find(&sources, &["SceneModel", "Semantics"], edge), "scenes are read where episodes are written");
    assert_none(
        find(&sources, &["find_object", "ObjectSemantics"], |path| {
            generator(path) || !path.starts_with("tasks/src/cli/suite")
        }),
        "the suite hands scenes to the generator without looking into them",
    );
    assert_none(
        find(&sources, &["episode_generator"], |path| edge(path) || path == "tasks/src/lib.rs"),
        "no task knows the generator of episodes",
    );
    let python = |path: &str| !path.starts_with("tasks/python/");
    assert_none(
        find(&sources, &["Truth", "TrueObject", "TruePart", "TrueWorld", "SceneModel", "Semantics"], python),
        "Python gets the judge's verdict and no truth",
    );
    let robot = |path: &str| !path.starts_with("robot/");
    assert_none(find(&sources, &["eval::", "dsm::eval"], robot), "a robot knows no truth");
    let mapping = ["dsm/src/build/", "dsm/src/ground/", "dsm/src/perceive/", "dsm/src/map/"];
    let outside = |path: &str| !mapping.iter().any(|folder| path.starts_with(folder));
    assert_none(find(&sources, &["crate::eval"], outside), "the map knows no truth");
}

#[test]
fn an_observed_frame_has_no_labels() {
    let frame = fs::read_to_string(root().join("dsm/src/frame.rs")).unwrap();
    let fields: Vec<&str> = frame.lines().filter(|line| line.trim_start().starts_with("pub ")).collect();
    assert!(fields.iter().any(|line| line.contains("depth_m")));
    assert!(!fields.iter().any(|line| line.contains("label") || line.contains("instance")), "{fields:?}");
}

#[test]
fn every_crate_tells_what_it_is() {
    for (folder, package, _) in CRATES {
        let text = fs::read_to_string(root().join(folder).join("src/lib.rs")).unwrap();
        assert!(text.starts_with("//! "), "{package} opens without a description");
        assert!(!text.contains("Placeholder"), "{package} is a placeholder");
    }
}

#[test]
fn files_stay_short() {
    // About 400 lines; a table of cases in a test may be longer.
    let long: Vec<String> = raw_sources()
        .into_iter()
        .filter(|(path, _)| !path.contains("/tests/") && !path.ends_with("_tests.rs"))
        .map(|(path, text)| (path, text.lines().count()))
        .filter(|(_, lines)| *lines > 500)
        .map(|(path, lines)| format!("{path}: {lines} lines"))
        .collect();
    assert_none(long, "a file holds one thing");
}

#[test]
fn the_root_holds_what_it_should() {
    const KNOWN: [&str; 16] = [
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "Cargo.lock",
        "Cargo.toml",
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "README.md",
        "THIRD_PARTY.md",
        "docs",
        "dsm",
        "robot",
        "scenes",
        "sim",
        "tasks",
        "tests",
    ];
    let entries = fs::read_dir(root()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    // What building and running leave behind is ignored by version control.
    let mut found: Vec<String> =
        entries.filter(|name| !name.starts_with('.') && name != "target" && name != "out").collect();
    found.sort();
    let strangers: Vec<&String> = found.iter().filter(|name| !KNOWN.contains(&name.as_str())).collect();
    assert!(strangers.is_empty(), "not expected in the root: {strangers:?}");
    for name in KNOWN {
        assert!(name == "docs" || found.iter().any(|other| other == name), "{name} is missing");
    }
}

fn raw_sources() -> Vec<(String, String)> {
    let read = |path: PathBuf| fs::read_to_string(path).unwrap();
    sources().into_keys().map(|path| (path.clone(), read(root().join(&path)))).collect()
}
