//! `dsm scene survey`: which MJCF files load, settle and can be drawn, and what of them is done otherwise.

use super::run::set_threads;
use super::{Output, PhysicsChoice, ResultArgs, WorldArgs};
use crate::engine::find_engine;
use crate::error::TaskError;
use crate::picture::encode_png;
use crate::settings::Settings;
use dsm::store::write_atomically;
use dsm_sim::scene::{Effect, Frame, Outcome, SurveyedScene, summarise_notes, survey_scene};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments of `dsm scene survey`.
#[derive(Debug, clap::Args)]
pub struct SurveyArgs {
    /// MJCF files, and folders: all `*.xml` below them.
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// Physics engine [env: DSM_PHYSICS].
    #[arg(long)]
    physics: Option<PhysicsChoice>,
    /// Write a frame of each file that works to this folder, named by the file's path.
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Worker threads; never changes a result [env: DSM_THREADS].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    #[command(flatten)]
    result: ResultArgs,
}

#[derive(Serialize)]
struct SurveyReport {
    physics: String,
    files: usize,
    /// Files that are models, not parts of others.
    models: usize,
    works: usize,
    parts: usize,
    /// Why the others fail, by the reason without names and numbers.
    failures: BTreeMap<String, usize>,
    /// Files in which each kind of element is done otherwise than written.
    notes: BTreeMap<String, usize>,
    scenes: Vec<SurveyedScene>,
}

/// Tries every file; code 1 when a model fails.
pub(super) fn run(args: SurveyArgs) -> anyhow::Result<u8> {
    let world = WorldArgs { physics: args.physics, threads: args.threads, ..WorldArgs::default() };
    let settings = Settings::resolve(&world, None, &|_| false)?;
    set_threads(settings.threads.value)?;
    let engine = find_engine(&settings.physics.value)?;
    let mut files = Vec::new();
    for path in &args.paths {
        collect(path, &mut files)?;
    }
    if let Some(folder) = &args.frames {
        std::fs::create_dir_all(folder).map_err(|source| TaskError::Read { path: folder.clone(), source })?;
    }
    let survey = |file: &PathBuf| {
        let (scene, frame) = survey_scene(file, &*engine);
        if let (Some(folder), Some(frame)) = (&args.frames, frame) {
            write_frame(folder, file, &frame)?;
        }
        Ok(scene)
    };
    let scenes = files.par_iter().map(survey).collect::<Vec<Result<SurveyedScene, TaskError>>>();
    let scenes = scenes.into_iter().collect::<Result<Vec<_>, _>>()?;
    let report = summarise(settings.physics.value, scenes);
    Output::new(args.result).give(&report, || as_text(&report))?;
    Ok(u8::from(report.works < report.models))
}

/// Files as given, and those below folders in order.
fn collect(path: &Path, files: &mut Vec<PathBuf>) -> Result<(), TaskError> {
    let read = |source| TaskError::Read { path: path.to_owned(), source };
    if !path.is_dir() {
        std::fs::metadata(path).map_err(read)?;
        files.push(path.to_owned());
        return Ok(());
    }
    let entries = std::fs::read_dir(path).map_err(read)?.collect::<Result<Vec<_>, _>>().map_err(read)?;
    let mut inside: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    inside.sort();
    for entry in inside {
        let is_model = entry.extension().is_some_and(|ending| ending == "xml");
        // Links to folders may lead round in circles.
        if (entry.is_dir() && !entry.is_symlink()) || (is_model && entry.is_file()) {
            collect(&entry, files)?;
        }
    }
    Ok(())
}

fn write_frame(folder: &Path, file: &Path, frame: &Frame) -> Result<(), TaskError> {
    let name: Vec<String> = file
        .with_extension("")
        .components()
        .filter(|part| matches!(part, std::path::Component::Normal(_)))
        .map(|part| part.as_os_str().to_string_lossy().into_owned())
        .collect();
    // The end of a path tells files apart.
    let name = name[name.len().saturating_sub(4)..].join("-");
    write_atomically(&folder.join(format!("{name}.png")), &encode_png(frame.width, frame.height, &frame.rgb))?;
    Ok(())
}

fn summarise(physics: String, scenes: Vec<SurveyedScene>) -> SurveyReport {
    let count = |wanted: fn(Outcome) -> bool| scenes.iter().filter(|scene| wanted(scene.outcome)).count();
    let (mut failures, mut notes) = (BTreeMap::new(), BTreeMap::new());
    for scene in &scenes {
        if let Some(reason) = &scene.reason {
            *failures.entry(without_names(reason)).or_default() += 1;
        }
        let mut kinds: Vec<(Effect, &str)> = scene.notes.iter().map(|n| (n.effect, n.element.as_str())).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for (effect, element) in kinds {
            *notes.entry(format!("<{element}> is {effect}")).or_default() += 1;
        }
    }
    SurveyReport {
        physics,
        files: scenes.len(),
        models: scenes.len() - count(|outcome| outcome == Outcome::Part),
        works: count(|outcome| outcome == Outcome::Works),
        parts: count(|outcome| outcome == Outcome::Part),
        failures,
        notes,
        scenes,
    }
}

/// The reason without the place before it and with `..` for what stands in backquotes.
fn without_names(reason: &str) -> String {
    let (place, rest) = reason.split_once(": ").unwrap_or(("", reason));
    let text = if place.contains(".xml") { rest } else { reason };
    let pieces = text.split('`').enumerate();
    let text: Vec<&str> = pieces.map(|(i, piece)| if i % 2 == 1 { ".." } else { piece }).collect();
    let text = text.join("`");
    // What is known or valid differs from file to file.
    text.split(';').next().unwrap_or_default().to_owned()
}

fn as_text(report: &SurveyReport) -> String {
    let mut text = String::new();
    for scene in &report.scenes {
        let file = scene.file.display();
        let line = match scene.outcome {
            Outcome::Part => format!("part   {file}\n"),
            Outcome::Fails(_) => format!("FAILS  {}\n", scene.reason.as_deref().unwrap_or_default()),
            Outcome::Works => format!(
                "works  {file}: {} bodies ({} free, {} moved), {} geoms, {} meshes, {} textures; {}\n",
                scene.bodies,
                scene.free_bodies,
                scene.moved,
                scene.geoms,
                scene.meshes,
                scene.textures,
                scene.categories.iter().cloned().collect::<Vec<_>>().join(", "),
            ),
        };
        text.push_str(&line);
        for note in summarise_notes(&scene.notes) {
            text.push_str(&format!("         {note}\n"));
        }
    }
    text.push_str(&format!(
        "\n{} files: {} models, of which {} work on {}; {} parts for others to include\n",
        report.files, report.models, report.works, report.physics, report.parts
    ));
    for (reason, count) in &report.failures {
        text.push_str(&format!("{count:5} fail: {reason}\n"));
    }
    for (note, count) in &report.notes {
        text.push_str(&format!("{count:5} have: {note}\n"));
    }
    text
}
