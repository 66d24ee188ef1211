//! What the evaluations of own maps share: which scenes and seeds, and their drives, kept or made anew.

use super::run::set_threads;
use super::scene::write_scene;
use super::suite::parse_seeds;
use super::{PerceptionChoice, WorldArgs};
use crate::episode::Episode;
use crate::error::TaskError;
use crate::language::{Language, embedded};
use crate::run::{Drivers, RunSpec};
use crate::settings::Settings;
use crate::survey::drive;
use dsm::store::write_atomically;
use dsm_robot::safety::StopSwitch;
use dsm_sim::replay::Moment;
use dsm_sim::scene::{HomeConfig, generate_home};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tempfile::TempDir;

/// Version of recorded drives.
const VERSION: u32 = 1;
/// Rooms of a generated home.
const HOME_ROOMS: u32 = 5;
/// Objects of a generated home.
const HOME_OBJECTS: u32 = 90;

/// Scenes that are explored, and how.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct DriveArgs {
    /// Scenes: folders or MJCF files, or layouts of AI2-THOR (`.json`), which are imported with seed 0.
    #[arg(value_name = "SCENE", required_unless_present = "generate")]
    scenes: Vec<PathBuf>,
    /// Also this many generated homes, made from the seeds S, S + 1, ...
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    generate: Option<u16>,
    /// Seed S of the first generated home.
    #[arg(long, value_name = "S", default_value_t = 0, requires = "generate")]
    seed: u64,
    /// Seeds A..B (B excluded) of each scene.
    #[arg(long, value_name = "A..B", value_parser = parse_seeds, default_value = "0..1")]
    seeds: (u64, u64),
    /// Keep recorded drives in this folder, and use those that are there instead of driving again.
    #[arg(long, value_name = "DIR")]
    drives: Option<PathBuf>,
    /// Robot: a name that ships with the program, or the path of a robot.toml.
    #[arg(long)]
    robot: Option<String>,
    /// Simulated perception.
    #[arg(long)]
    perception: Option<PerceptionChoice>,
    /// Worker threads; never changes a result.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Simulated time for exploring, seconds.
    #[arg(long)]
    time_limit_s: Option<f64>,
}

/// Drives that are known or can be made.
pub(super) struct Drives {
    /// One for each scene and seed.
    pub(super) specs: Vec<RunSpec>,
    /// Name of the perception preset.
    pub(super) perception: String,
    folder: Option<PathBuf>,
    /// Generated and imported scenes; they are read again when their frames are.
    _written: TempDir,
}

/// A recorded drive in a file.
#[derive(Serialize, Deserialize)]
struct Recorded {
    version: u32,
    scene: String,
    seed: u64,
    moments: Vec<Moment>,
}

impl DriveArgs {
    /// Settles the settings, writes generated and imported scenes, and checks every scene.
    pub(super) fn prepare(&self) -> Result<Drives, TaskError> {
        let world = WorldArgs {
            robot: self.robot.clone(),
            perception: self.perception,
            threads: self.threads,
            time_limit_s: self.time_limit_s,
            ..WorldArgs::default()
        };
        let settings = Settings::resolve(&world, None, &|_| false)?;
        set_threads(settings.threads.value)?;
        let written = tempfile::tempdir().map_err(|source| TaskError::Read { path: std::env::temp_dir(), source })?;
        let mut scenes = Vec::new();
        for scene in &self.scenes {
            scenes.push(match scene.extension() {
                Some(ending) if ending.eq_ignore_ascii_case("json") => import(scene, written.path())?,
                _ => scene.clone(),
            });
        }
        for number in 0..self.generate.unwrap_or(0) {
            scenes.push(generate(self.seed + u64::from(number), written.path())?);
        }
        let seeds = self.seeds.0..self.seeds.1;
        // Drives are made without a model: what is measured comes afterwards.
        let language = embedded();
        let specs = scenes.iter().flat_map(|scene| seeds.clone().map(|seed| spec(scene, seed, &settings, &language)));
        let specs: Vec<RunSpec> = specs.collect();
        for of_scene in specs.chunk_by(|a, b| a.scene == b.scene) {
            crate::assemble::check(&of_scene[0])?;
        }
        if let Some(folder) = &self.drives {
            std::fs::create_dir_all(folder).map_err(|source| TaskError::Read { path: folder.clone(), source })?;
        }
        let perception = settings.perception.value;
        Ok(Drives { specs, perception, folder: self.drives.clone(), _written: written })
    }
}

impl Drives {
    /// The drive from its file, if there is one, or a new one.
    pub(super) fn find(&self, spec: &RunSpec, interrupted: &Arc<AtomicBool>) -> Result<Vec<Moment>, TaskError> {
        let file = self.folder.as_ref().map(|folder| folder.join(format!("{}-{}.json", spec.name, spec.seed)));
        if let Some(file) = file.as_ref().filter(|file| file.exists()) {
            return read(file, spec);
        }
        let moments = drive(spec, interrupted.clone())?;
        if let Some(file) = file.filter(|_| !interrupted.load(Ordering::Relaxed)) {
            let recorded = Recorded { version: VERSION, scene: spec.name.clone(), seed: spec.seed, moments };
            let text = serde_json::to_vec(&recorded).map_err(|e| TaskError::Internal(e.to_string()))?;
            write_atomically(&file, &text)?;
            return Ok(recorded.moments);
        }
        Ok(moments)
    }
}

/// Writes a generated home below a folder.
fn generate(seed: u64, folder: &Path) -> Result<PathBuf, TaskError> {
    let config = HomeConfig { seed, rooms: HOME_ROOMS, objects: HOME_OBJECTS, ..HomeConfig::default() };
    let made = generate_home(&config).map_err(|error| TaskError::Usage(error.to_string()))?;
    let scene = folder.join(format!("home-{seed}"));
    write_scene(&made, &scene, false)?;
    Ok(scene)
}

/// Writes an imported layout below a folder, named like its file.
fn import(layout: &Path, folder: &Path) -> Result<PathBuf, TaskError> {
    let made = super::scene::import(layout, 0)?;
    let scene = folder.join(layout.file_stem().unwrap_or(layout.as_os_str()));
    write_scene(&made, &scene, false)?;
    Ok(scene)
}

fn spec(scene: &Path, seed: u64, settings: &Settings, language: &Arc<dyn Language>) -> RunSpec {
    let folder = if scene.is_dir() { scene.file_name() } else { scene.parent().and_then(Path::file_name) };
    RunSpec {
        name: folder.map_or("scene".into(), |name| name.to_string_lossy().into_owned()),
        file: scene.to_owned(),
        episode: Episode::exploration(scene.to_owned(), settings.time_limit_s.value),
        scene: scene.to_owned(),
        robot: settings.robot.value.clone(),
        physics: settings.physics.value.clone(),
        perception: settings.perception.value.clone(),
        language: language.clone(),
        drivers: Drivers::Simulated,
        seed,
        time_limit_s: settings.time_limit_s.value,
        permute_labels: false,
        stop: StopSwitch::default(),
    }
}

fn read(file: &Path, spec: &RunSpec) -> Result<Vec<Moment>, TaskError> {
    let text = std::fs::read(file).map_err(|source| TaskError::Read { path: file.to_owned(), source })?;
    let wrong = |why: String| TaskError::Usage(format!("{}: {why}", file.display()));
    let recorded: Recorded =
        serde_json::from_slice(&text).map_err(|error| wrong(format!("not a recorded drive: {error}")))?;
    if recorded.version != VERSION {
        let found = recorded.version;
        return Err(wrong(format!("version {found} of a recorded drive is not known, expected {VERSION}")));
    }
    if recorded.scene != spec.name || recorded.seed != spec.seed {
        return Err(wrong(format!("a drive of {} with seed {}", recorded.scene, recorded.seed)));
    }
    Ok(recorded.moments)
}
