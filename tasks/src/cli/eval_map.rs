//! `dsm eval map`: measures maps against ground truth.

use super::run::{catch_interrupt, set_threads};
use super::scene::write_scene;
use super::suite::parse_seeds;
use super::{Output, PerceptionChoice, ResultArgs, WorldArgs};
use crate::episode::Episode;
use crate::error::TaskError;
use crate::run::RunSpec;
use crate::settings::Settings;
use crate::survey::{Condition, drive, score_drive};
use dsm::build::BuildConfig;
use dsm::eval::{MapReport, MapScore, pool};
use dsm::store::write_atomically;
use dsm_sim::replay::Moment;
use dsm_sim::scene::{HomeConfig, generate_home};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// Version of the report and of recorded drives.
const SCHEMA: u32 = 1;
/// Largest pose noise, centimetres.
const MAX_NOISE_CM: f64 = 50.0;

/// Rooms of a generated home.
const HOME_ROOMS: u32 = 5;
/// Objects of a generated home.
const HOME_OBJECTS: u32 = 90;

/// Arguments of `dsm eval map`.
#[derive(Debug, clap::Args)]
pub struct MapArgs {
    /// Scenes: folders or MJCF files.
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
    /// Deviations of the believed camera position along each axis, centimetres, separated by commas; attitude goes with
    /// them, 0.2 degrees per centimetre, and both are correlated over 10 s.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_noise, default_value = "0,1,3,5")]
    pose_noise_cm: Vec<f64>,
    /// Also map with this part switched off.
    #[arg(long)]
    ablate: Vec<Part>,
    /// Scenes and seeds that run side by side; never changes a result.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    workers: u16,
    /// Keep recorded drives in this folder, and use those that are there instead of driving again.
    #[arg(long, value_name = "DIR")]
    drives: Option<PathBuf>,
    /// List ghosts, duplicates, poor boxes, missed things and all words, one line each.
    #[arg(long)]
    faults: bool,
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
    #[command(flatten)]
    result: ResultArgs,
}

/// What can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Part {
    /// The geometry sliding window: all fused points stay.
    Window,
    /// Taking out each frame's pose error.
    Align,
}

/// One drive and what it gave under a condition.
#[derive(Clone, Debug, Serialize)]
struct Run {
    scene: String,
    seed: u64,
    frames: usize,
    score: MapScore,
}

/// All runs under one condition.
#[derive(Clone, Debug, Serialize)]
struct Table {
    pose_noise_cm: f64,
    window: bool,
    align: bool,
    #[serde(flatten)]
    report: MapReport,
    scores: Vec<Run>,
}

/// The result.
#[derive(Clone, Debug, Serialize)]
struct Report {
    schema: u32,
    perception: String,
    tables: Vec<Table>,
}

/// A recorded drive in a file.
#[derive(Serialize, Deserialize)]
struct Drive {
    version: u32,
    scene: String,
    seed: u64,
    moments: Vec<Moment>,
}

fn parse_noise(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|cm| (0.0..=MAX_NOISE_CM).contains(cm));
    value.ok_or_else(|| format!("expected centimetres from 0 to {MAX_NOISE_CM}, for example 0,1,3,5"))
}

/// Measures; code 0 once it has measured.
pub(super) fn run(args: MapArgs) -> anyhow::Result<u8> {
    let world = WorldArgs {
        robot: args.robot.clone(),
        perception: args.perception,
        threads: args.threads,
        time_limit_s: args.time_limit_s,
        ..WorldArgs::default()
    };
    let settings = Settings::resolve(&world, None, &|_| false)?;
    set_threads(settings.threads.value)?;
    // Kept until the end: scenes are read again when their frames are.
    let homes = tempfile::tempdir().map_err(|source| TaskError::Read { path: std::env::temp_dir(), source })?;
    let mut scenes = args.scenes.clone();
    scenes.extend(generate_homes(&args, homes.path())?);
    let specs: Vec<RunSpec> = scenes
        .iter()
        .flat_map(|scene| (args.seeds.0..args.seeds.1).map(move |seed| (scene, seed)))
        .map(|(scene, seed)| spec(scene, seed, &settings))
        .collect();
    for scene_specs in specs.chunk_by(|a, b| a.scene == b.scene) {
        crate::assemble::check(&scene_specs[0])?;
    }
    if let Some(folder) = &args.drives {
        std::fs::create_dir_all(folder).map_err(|source| TaskError::Read { path: folder.clone(), source })?;
    }
    let conditions = conditions(&args);
    let interrupted = catch_interrupt()?;
    let runs = run_all(&specs, &conditions, &args, &interrupted)?;
    if interrupted.load(Ordering::Relaxed) {
        return Ok(130);
    }
    let tables = conditions.iter().enumerate().map(|(index, condition)| {
        let of_run = |(spec, frames, scores): &(RunSpec, usize, Vec<MapScore>)| Run {
            scene: spec.name.clone(),
            seed: spec.seed,
            frames: *frames,
            score: scores[index].clone(),
        };
        let scores: Vec<Run> = runs.iter().map(of_run).collect();
        let report = pool(&scores.iter().map(|run| run.score.clone()).collect::<Vec<_>>());
        let (window, align) = (condition.build.window, condition.build.align);
        Table { pose_noise_cm: 100.0 * condition.pose_noise_m, window, align, report, scores }
    });
    let report = Report { schema: SCHEMA, perception: settings.perception.value.clone(), tables: tables.collect() };
    Output::new(args.result.clone()).give(&report, || describe(&report, args.faults))?;
    Ok(0)
}

/// Writes the generated homes into a folder.
fn generate_homes(args: &MapArgs, folder: &Path) -> Result<Vec<PathBuf>, TaskError> {
    let home = |number: u16| {
        let config = HomeConfig { seed: args.seed + u64::from(number), rooms: HOME_ROOMS, objects: HOME_OBJECTS };
        let made = generate_home(&config).map_err(|error| TaskError::Usage(error.to_string()))?;
        let scene = folder.join(format!("home-{}", config.seed));
        write_scene(&made, &scene, false)?;
        Ok(scene)
    };
    (0..args.generate.unwrap_or(0)).map(home).collect()
}

pub(super) fn spec(scene: &Path, seed: u64, settings: &Settings) -> RunSpec {
    let folder = if scene.is_dir() { scene.file_name() } else { scene.parent().and_then(Path::file_name) };
    RunSpec {
        name: folder.map_or("scene".into(), |name| name.to_string_lossy().into_owned()),
        file: scene.to_owned(),
        episode: Episode::exploration(scene.to_owned(), settings.time_limit_s.value),
        scene: scene.to_owned(),
        robot: settings.robot.value.clone(),
        physics: settings.physics.value.clone(),
        perception: settings.perception.value.clone(),
        seed,
        time_limit_s: settings.time_limit_s.value,
        permute_labels: false,
    }
}

/// Every noise as it is, and with each part switched off.
fn conditions(args: &MapArgs) -> Vec<Condition> {
    let whole = BuildConfig::default();
    let mut builds = vec![whole.clone()];
    builds.extend(args.ablate.iter().map(|part| match part {
        Part::Window => BuildConfig { window: false, ..whole.clone() },
        Part::Align => BuildConfig { align: false, ..whole.clone() },
    }));
    let noises = args.pose_noise_cm.iter().map(|cm| cm / 100.0);
    noises.flat_map(|m| builds.iter().map(move |build| Condition { pose_noise_m: m, build: build.clone() })).collect()
}

/// Frames of a drive, and one score for each condition.
type Scored = Result<(usize, Vec<MapScore>), TaskError>;

fn run_all(
    specs: &[RunSpec],
    conditions: &[Condition],
    args: &MapArgs,
    interrupted: &Arc<AtomicBool>,
) -> Result<Vec<(RunSpec, usize, Vec<MapScore>)>, TaskError> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<Option<Scored>>> = Mutex::new(specs.iter().map(|_| None).collect());
    let bar = ProgressBar::with_draw_target(Some(specs.len() as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos} of {len} drives  {elapsed}  {msg}") {
        bar.set_style(style);
    }
    std::thread::scope(|scope| {
        for _ in 0..usize::from(args.workers).min(specs.len()) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(spec) = specs.get(index).filter(|_| !interrupted.load(Ordering::Relaxed)) else { break };
                    let scored = find_drive(spec, args.drives.as_deref(), interrupted)
                        .and_then(|moments| Ok((moments.len(), score_drive(spec, &moments, conditions)?)));
                    tracing::info!("{} seed {}: mapped", spec.name, spec.seed);
                    bar.inc(1);
                    if let Ok(mut done) = done.lock() {
                        done[index] = Some(scored);
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    let done = done.into_inner().map_err(|_| TaskError::Internal("a worker panicked".into()))?;
    let finished = specs.iter().zip(done).filter_map(|(spec, result)| Some((spec, result?)));
    finished.map(|(spec, result)| result.map(|(frames, scores)| (spec.clone(), frames, scores))).collect()
}

/// The drive from its file, if there is one, or a new one.
pub(super) fn find_drive(
    spec: &RunSpec,
    folder: Option<&Path>,
    interrupted: &Arc<AtomicBool>,
) -> Result<Vec<Moment>, TaskError> {
    let file = folder.map(|folder| folder.join(format!("{}-{}.json", spec.name, spec.seed)));
    if let Some(file) = file.as_ref().filter(|file| file.exists()) {
        return read_drive(file, spec);
    }
    let moments = drive(spec, interrupted.clone())?;
    if let Some(file) = file.filter(|_| !interrupted.load(Ordering::Relaxed)) {
        let drive = Drive { version: SCHEMA, scene: spec.name.clone(), seed: spec.seed, moments };
        let text = serde_json::to_vec(&drive).map_err(|e| TaskError::Internal(e.to_string()))?;
        write_atomically(&file, &text)?;
        return Ok(drive.moments);
    }
    Ok(moments)
}

fn read_drive(file: &Path, spec: &RunSpec) -> Result<Vec<Moment>, TaskError> {
    let text = std::fs::read(file).map_err(|source| TaskError::Read { path: file.to_owned(), source })?;
    let wrong = |why: String| TaskError::Usage(format!("{}: {why}", file.display()));
    let drive: Drive =
        serde_json::from_slice(&text).map_err(|error| wrong(format!("not a recorded drive: {error}")))?;
    if drive.version != SCHEMA {
        return Err(wrong(format!("version {} of a recorded drive is not known, expected {SCHEMA}", drive.version)));
    }
    if drive.scene != spec.name || drive.seed != spec.seed {
        return Err(wrong(format!("a drive of {} with seed {}", drive.scene, drive.seed)));
    }
    Ok(drive.moments)
}

fn describe(report: &Report, with_faults: bool) -> String {
    let mut text = String::new();
    for table in &report.tables {
        let off = |on: bool, name: &str| if on { String::new() } else { format!(", {name} off") };
        let (window, align) = (off(table.window, "window"), off(table.align, "align"));
        let noise = table.pose_noise_cm;
        let _ = writeln!(text, "pose noise {noise} cm{window}{align}, {} runs", table.report.runs);
        for (name, estimate) in &table.report.estimates {
            let interval = estimate.interval.map_or(String::new(), |[low, high]| format!("[{low:.4}, {high:.4}]"));
            let _ = writeln!(text, "  {name:<22} {:>8.4}  {interval:>18}  {:>6}", estimate.value, estimate.count);
        }
        for run in table.scores.iter().filter(|_| with_faults) {
            for fault in &run.score.faults {
                let _ = writeln!(text, "  {} {}  {fault}", run.scene, run.seed);
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    //! Contract: noise is a list of centimetres, and each part that is switched off makes one more condition per noise.
    use super::*;
    use clap::Parser;

    fn args(words: &[&str]) -> Result<MapArgs, clap::Error> {
        let cli = super::super::Cli::try_parse_from(["dsm", "eval", "map"].iter().chain(words))?;
        match cli.command {
            super::super::Command::Eval(super::super::eval::EvalCommand::Map(args)) => Ok(args),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn conditions_are_noises_times_parts() {
        let args = args(&["s", "--pose-noise-cm", "0,2.5", "--ablate", "window"]).unwrap();
        let conditions = conditions(&args);
        let short: Vec<(f64, bool)> = conditions.iter().map(|c| (c.pose_noise_m, c.build.window)).collect();
        assert_eq!(short, [(0.0, true), (0.0, false), (0.025, true), (0.025, false)]);
    }

    #[test]
    fn wrong_noise_and_no_scene_are_refused() {
        assert!(args(&["--generate", "3", "--seed", "7"]).is_ok());
        assert!(args(&["s", "--seed", "7"]).is_err());
        assert!(args(&["s", "--pose-noise-cm", "1,x"]).is_err());
        assert!(args(&["s", "--pose-noise-cm", "-1"]).is_err());
        assert!(args(&[]).is_err());
    }
}
