//! `dsm run EPISODE`.

use super::info::holds_key;
use super::output::{prepare_folder, to_json};
use super::view::{DEFAULT_PORT, View};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
use crate::episode::Episode;
use crate::error::TaskError;
use crate::failure_page::{FAILURE_FILE, failure_page};
use crate::language::find_language;
use crate::perception::Tape;
use crate::run::{Finished, Progress, RunSpec, run_taped};
use crate::settings::Settings;
use crate::summary::Summary;
use dsm::store::write_atomically;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `dsm run`.
#[derive(Debug, clap::Args)]
pub struct RunArgs {
    /// An episode file.
    episode: PathBuf,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    result: ResultArgs,
    /// Show camera and map in a browser while the run goes on: serve http://127.0.0.1:PORT/, by default at port 8350; 0
    /// takes a free port. Changes no result.
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = DEFAULT_PORT)]
    view: Option<u16>,
}

/// All wall times of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// Wall time of all, from loading the scene to the last file, seconds. The report, which is one of the files, shows it
    /// without its own writing.
    pub wall_s: f64,
    /// Wall time of writing the report and the summary, seconds.
    pub report_s: f64,
    /// Simulated time, seconds.
    pub sim_time_s: f64,
    /// Simulated time over wall time.
    pub real_time_factor: f64,
}

/// Runs one episode.
pub(super) fn run(args: RunArgs) -> anyhow::Result<u8> {
    let (spec, settings) = prepare(&args.episode, &args.world)?;
    set_threads(settings.threads.value)?;
    // Broken input is found before anything is written.
    crate::assemble::check(&spec)?;
    let open = |port| View::open(port, &spec.name, spec.seed, spec.time_limit_s);
    let view = args.view.map(open).transpose()?;
    let folder = prepare_folder(&args.out, &default_folder(&spec))?;
    let interrupted = catch_interrupt()?;
    let bar = progress_bar(spec.time_limit_s);
    let mut progress: Box<dyn Progress> = Box::new(BarProgress { bar: bar.clone() });
    if let Some(view) = &view {
        tracing::warn!("watch at {}", view.address);
        progress = view.watch(progress);
    }
    let summary = run_and_write(&spec, &folder, interrupted.clone(), progress)?;
    bar.finish_and_clear();
    drop(view);
    Output::new(args.result).give(&summary, || describe(&summary, &folder))?;
    Ok(exit_code(&summary, interrupted.load(Ordering::Relaxed)))
}

/// Reads the episode and resolves the settings.
pub fn prepare(file: &Path, world: &WorldArgs) -> Result<(RunSpec, Settings), TaskError> {
    let episode = Episode::load(file)?;
    let text = std::fs::read_to_string(file).map_err(|source| TaskError::Read { path: file.to_owned(), source })?;
    let settings = Settings::resolve(world, Some(&episode), &|key| holds_key(&text, key))?;
    let spec = RunSpec {
        name: file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default(),
        scene: episode.scene_path(file),
        file: file.to_owned(),
        robot: settings.robot.value.clone(),
        physics: settings.physics.value.clone(),
        perception: settings.perception.value.clone(),
        language: find_language(&settings.backend.value)?,
        seed: settings.seed.value,
        time_limit_s: settings.time_limit_s.value,
        permute_labels: false,
        episode,
    };
    Ok((spec, settings))
}

/// Runs an episode and writes its folder.
pub(super) fn run_and_write(
    spec: &RunSpec,
    folder: &Path,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Summary, TaskError> {
    Ok(run_taped_and_write(spec, folder, Vec::new(), interrupted, progress)?.summary)
}

/// As [`run_and_write`]; `tapes` keep what the map is made of.
pub(super) fn run_taped_and_write(
    spec: &RunSpec,
    folder: &Path,
    tapes: Vec<Box<dyn Tape>>,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Finished, TaskError> {
    // Wall time is measured here, at the edge, and goes into timing.json alone.
    #[expect(clippy::disallowed_methods)]
    let begin = std::time::Instant::now();
    let finished = run_taped(spec, Some(&folder.join("map.dsm")), tapes, interrupted, progress)?;
    let run_s = begin.elapsed().as_secs_f64();
    let sim_time_s = finished.summary.metrics.sim_time_s;
    let timing = |wall_s: f64| Timing {
        wall_s,
        report_s: wall_s - run_s,
        sim_time_s,
        real_time_factor: sim_time_s / wall_s.max(1e-9),
    };
    write_atomically(&folder.join("report.html"), crate::report::page(&finished, &timing(run_s)).as_bytes())?;
    if let Some(page) = failure_page(&finished, spec) {
        write_atomically(&folder.join(FAILURE_FILE), page.as_bytes())?;
    }
    write_atomically(&folder.join("summary.json"), to_json(&finished.summary)?.as_bytes())?;
    write_atomically(&folder.join("timing.json"), to_json(&timing(begin.elapsed().as_secs_f64()))?.as_bytes())?;
    Ok(finished)
}

/// Where results go when nothing is said: `out/<episode>-<seed>`.
pub(super) fn default_folder(spec: &RunSpec) -> PathBuf {
    Path::new("out").join(format!("{}-{}", spec.name, spec.seed))
}

/// The process exit code of a run.
pub(super) fn exit_code(summary: &Summary, interrupted: bool) -> u8 {
    use crate::summary::Stage;
    match &summary.failure {
        _ if interrupted => 130,
        _ if summary.success => 0,
        Some(failure) if failure.stage == Stage::Safety => 3,
        _ => 1,
    }
}

/// Ctrl-C sets the flag; the loop then stops the robot and writes the summary.
pub(super) fn catch_interrupt() -> Result<Arc<AtomicBool>, TaskError> {
    let flag = Arc::new(AtomicBool::new(false));
    let set = flag.clone();
    ctrlc::set_handler(move || set.store(true, Ordering::Relaxed)).map_err(|e| TaskError::Internal(e.to_string()))?;
    Ok(flag)
}

/// Sets the number of worker threads, once per process.
pub(super) fn set_threads(threads: u16) -> Result<(), TaskError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(threads))
        .build_global()
        .map_err(|e| TaskError::Internal(e.to_string()))
}

/// Shows the simulated time of a run as a bar.
pub(super) struct BarProgress {
    pub(super) bar: ProgressBar,
}

impl Progress for BarProgress {
    fn at(&mut self, sim_time_s: f64) {
        self.bar.set_position(sim_time_s as u64);
    }
}

/// A bar on stderr; hidden when stderr is no terminal.
pub(super) fn progress_bar(limit_s: f64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(limit_s as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos:>3} of {len} simulated s") {
        bar.set_style(style);
    }
    bar
}

pub(super) fn describe(summary: &Summary, folder: &Path) -> String {
    let mut text = format!(
        "{} (seed {}): {}\n",
        summary.episode,
        summary.seed,
        if summary.success { "success" } else { "FAILED" }
    );
    for step in &summary.steps {
        let _ = writeln!(text, "  step {}: {} -> {:?}: {}", step.index, step.command, step.outcome, step.reason);
    }
    for e in &summary.expectations {
        let mark = if e.passed { "ok  " } else { "FAIL" };
        let _ = writeln!(text, "  {mark} {}: {} (required: {})", e.kind, e.measured, e.required);
    }
    let m = &summary.metrics;
    let _ = writeln!(
        text,
        "  {:.1} simulated s, path {:.1} m, {} collisions, {} limit violations, others moved at most {:.3} m",
        m.sim_time_s, m.path_length_m, m.collisions, m.limit_violations, m.non_target_displacement_max_m
    );
    let _ = writeln!(
        text,
        "  map: {} objects, {} relations, {} rooms; written to {}",
        summary.map.objects,
        summary.map.relations,
        summary.map.rooms,
        folder.display()
    );
    text
}
