//! Contract: the main job. The robot explores a flat it does not know, builds its map, understands the command, drives
//! there and lifts the right object with friction alone. The run is a function of scene, configuration and seed: not of
//! the number of threads, nor of the simulator's label ids, nor of the names of bodies.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use dsm_tasks::summary::StepSummary;
use scenarios::{apartment, root, run};
use std::fs;
use std::path::Path;

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// Copies the apartment with every body renamed, in the scene and in its semantics.
fn rename_bodies(to: &Path) {
    let scene = root().join("scenes/apartment");
    for folder in ["textures", "episodes"] {
        fs::create_dir_all(to.join(folder)).unwrap();
        for entry in fs::read_dir(scene.join(folder)).unwrap().flatten() {
            fs::copy(entry.path(), to.join(folder).join(entry.file_name())).unwrap();
        }
    }
    let semantics = fs::read_to_string(scene.join("semantics.toml")).unwrap();
    let mut xml = fs::read_to_string(scene.join("scene.xml")).unwrap();
    let mut renamed = String::new();
    let mut count = 0;
    for line in semantics.lines() {
        match line.trim().strip_prefix("body = \"").and_then(|rest| rest.split('"').next()) {
            Some(name) => {
                // Names in another alphabetical order than the bodies.
                let new_name = format!("{}{count}", char::from(b'a' + (25 - count % 26) as u8));
                xml = xml.replace(&format!("<body name=\"{name}\""), &format!("<body name=\"thing_{new_name}\""));
                renamed += &line.replace(&format!("\"{name}\""), &format!("\"thing_{new_name}\""));
                count += 1;
            }
            None => renamed += line,
        }
        renamed.push('\n');
    }
    assert!(count >= 60, "the apartment has {count} objects");
    fs::write(to.join("semantics.toml"), renamed).unwrap();
    fs::write(to.join("scene.xml"), xml).unwrap();
}

#[test]
fn the_apple_is_fetched_whatever_threads_labels_and_names() {
    let folder = tempfile::tempdir().unwrap();
    let plain_map = folder.path().join("plain.dsm");
    let spec = apartment("fetch_apple", 1).unwrap();
    let plain = on_threads(2, || run(&spec, &plain_map)).unwrap().summary;
    assert!(plain.success, "{:?}", plain.failure);
    assert!(plain.metrics.sim_time_s <= 240.0);
    assert_eq!((plain.metrics.collisions, plain.metrics.limit_violations), (0, 0));
    assert!(plain.metrics.non_target_displacement_max_m <= 0.05, "{}", plain.metrics.non_target_displacement_max_m);

    let renamed_scene = folder.path().join("renamed");
    rename_bodies(&renamed_scene);
    let mut other = spec.clone();
    other.scene = renamed_scene;
    other.permute_labels = true;
    other.episode.expectations.clear();
    let other_map = folder.path().join("other.dsm");
    let changed = on_threads(1, || run(&other, &other_map)).unwrap().summary;
    assert_eq!(fs::read(&plain_map).unwrap(), fs::read(&other_map).unwrap(), "the maps differ");
    // What the judge adds is missing in the second run, which nothing is expected of.
    let decisions = |steps: &[StepSummary]| -> Vec<StepSummary> {
        steps.iter().map(|step| StepSummary { shortest_path_m: None, spl: None, ..step.clone() }).collect()
    };
    assert_eq!(decisions(&plain.steps), decisions(&changed.steps), "the decisions differ");
}

#[test]
fn another_sentence_fetches_another_apple() {
    let folder = tempfile::tempdir().unwrap();
    let spec = apartment("fetch_red_apple_table", 2).unwrap();
    let summary = run(&spec, &folder.path().join("map.dsm")).unwrap().summary;
    assert!(summary.success, "{:?}", summary.failure);
}
