//! MJCF files that others wrote, from the folder that the environment variable DSM_MJCF names.

use dsm_sim::physics::Engine;
use dsm_sim::scene::{Outcome, SurveyedScene, survey_scene};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Tries all files on an engine; `None`, and a line in the log of skipped tests, without the folder.
// The message is how a reader of the test's output learns that nothing was tried.
#[allow(clippy::print_stderr)]
pub(crate) fn survey_all(test: &str, engine: &dyn Engine) -> Option<Vec<SurveyedScene>> {
    let Some(folder) = std::env::var_os("DSM_MJCF") else {
        eprintln!("skipped: DSM_MJCF does not name a folder with MJCF files; see docs/mjcf.md");
        if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
            let mut log = std::fs::OpenOptions::new().append(true).create(true).open(log).expect("the log opens");
            writeln!(log, "{test}: DSM_MJCF is not set").expect("the log can be written");
        }
        return None;
    };
    let mut files = Vec::new();
    collect(Path::new(&folder), &mut files);
    assert!(!files.is_empty(), "there are MJCF files below DSM_MJCF");
    Some(files.iter().map(|file| survey_scene(file, engine).0).collect())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).expect("a folder that can be read");
    let mut inside: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    inside.sort();
    for path in inside {
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|ending| ending == "xml") {
            files.push(path);
        }
    }
}

/// Holds the survey against the contract: a model works, or fails at loading with the line of what is wrong.
pub(crate) fn check(scenes: &[SurveyedScene]) {
    for scene in scenes {
        let file = scene.file.display();
        match scene.outcome {
            Outcome::Works => assert!(scene.geoms == 0 || scene.seen.is_finite(), "{file}"),
            Outcome::Part => {}
            Outcome::Fails(stage) => {
                let reason = scene.reason.as_deref().unwrap_or_default();
                assert_eq!(stage, dsm_sim::scene::Stage::Load, "{file} loads and then fails: {reason}");
                let named =
                    reason.split_once(".xml:").is_some_and(|(_, rest)| rest.starts_with(|c: char| c.is_ascii_digit()));
                assert!(named, "{reason}");
            }
        }
    }
    let works = scenes.iter().filter(|scene| scene.outcome == Outcome::Works).count();
    let models = scenes.iter().filter(|scene| scene.outcome != Outcome::Part).count();
    // Of the public files of docs/mjcf.md a tenth is broken: MuJoCo refuses them too.
    assert!(works * 10 >= models * 8, "{works} of {models} models work");
}
