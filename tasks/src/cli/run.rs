//! `dsm run EPISODE`.

use super::info::holds_key;
use super::output::{prepare_folder, to_json};
use super::replay::not_built_in;
use super::view::{DEFAULT_PORT, View};
use super::wire::{DriversChoice, WireArgs};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
use crate::episode::Episode;
use crate::error::TaskError;
use crate::failure_page::{FAILURE_FILE, failure_page, replay_command};
use crate::language::find_language;
use crate::perception::Tape;
use crate::replay::{EntryFile, Recorder, RecordingEnd};
use crate::run::{Drivers, Finished, Progress, RunSpec, run_kept};
use crate::session::Keep;
use crate::settings::Settings;
use crate::summary::Summary;
use dsm::store::write_atomically;
use dsm_robot::safety::StopSwitch;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::fmt::Write;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Name of the page of a run in its folder.
pub(super) const REPORT_FILE: &str = "report.html";

/// Arguments of `dsm run`.
#[derive(Debug, clap::Args)]
pub struct RunArgs {
    /// An episode file.
    episode: PathBuf,
    /// Behind which drivers the robot stands. Over ROS 2 nobody judges here: `dsm serve` does.
    #[arg(long, value_enum, default_value_t)]
    drivers: DriversChoice,
    #[command(flatten)]
    wire: WireArgs,
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
    /// Record all that the drivers are asked and answer, frames, detections and events as MCAP, which viewers open and
    /// `dsm replay` runs again. Changes no result. Needs the feature `mcap`.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Bound of the recording in megabytes; it ends there, and the run goes on.
    #[arg(long, value_name = "MB", default_value_t = 8192, value_parser = clap::value_parser!(u64).range(1..=1_000_000), requires = "record")]
    record_max_mb: u64,
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
    let (mut spec, settings) = prepare(&args.episode, &args.world)?;
    spec.drivers = args.wire.drivers(args.drivers, &spec.robot)?;
    set_threads(settings.threads.value)?;
    // Broken input is found before anything is written.
    crate::assemble::check(&spec)?;
    let open = |port| View::open(port, &spec.name, spec.seed, spec.time_limit_s);
    let view = args.view.map(open).transpose()?;
    let folder = prepare_folder(&args.out, &default_folder(&spec))?;
    let interrupted = catch_interrupt()?;
    listen_for_stop(spec.stop.clone());
    let bar = progress_bar(spec.time_limit_s);
    let mut progress: Box<dyn Progress> = Box::new(BarProgress { bar: bar.clone() });
    if let Some(view) = &view {
        tracing::warn!("watch at {}", view.address);
        progress = view.watch(progress);
    }
    let recorder = args.record.as_deref().map(|file| start_recording(file, args.record_max_mb)).transpose()?;
    let keep = Keep { tapes: Vec::new(), recorder };
    let finished = run_kept_and_write(&spec, &folder, keep, interrupted.clone(), progress)?;
    bar.finish_and_clear();
    drop(view);
    let summary = finished.summary;
    Output::new(args.result).give(&summary, || describe(&summary, &folder))?;
    tell_of_recording(finished.recorded)?;
    Ok(exit_code(&summary, interrupted.load(Ordering::Relaxed)))
}

/// Creates a recording of a run.
type Create = fn(&Path) -> Result<Box<dyn EntryFile>, TaskError>;

#[cfg(feature = "mcap")]
const CREATE: Option<Create> = Some(crate::mcap_file::create_run);
#[cfg(not(feature = "mcap"))]
const CREATE: Option<Create> = None;

pub(super) fn start_recording(file: &Path, max_mb: u64) -> Result<Recorder, TaskError> {
    let create = CREATE.ok_or_else(|| not_built_in("--record"))?;
    Ok(Recorder::start(create(file)?, max_mb << 20))
}

/// A recording that is not whole is told of; one that broke is an error, after all else is done.
pub(super) fn tell_of_recording(recorded: Option<RecordingEnd>) -> Result<(), TaskError> {
    match recorded {
        Some(RecordingEnd::Full { stamp }) => {
            tracing::warn!("the recording is full and ends at {:.2} s of the run", stamp.as_s());
            Ok(())
        }
        Some(RecordingEnd::Broken { stamp, source }) => {
            tracing::error!("the recording ends at {:.2} s of the run", stamp.as_s());
            Err(source.into())
        }
        Some(RecordingEnd::Whole { .. }) | None => Ok(()),
    }
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
        drivers: Drivers::Simulated,
        seed: settings.seed.value,
        time_limit_s: settings.time_limit_s.value,
        permute_labels: false,
        stop: StopSwitch::default(),
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
    run_kept_and_write(spec, folder, Keep { tapes, recorder: None }, interrupted, progress)
}

/// Runs an episode, keeps what `keep` says, and writes its folder: map, report, summary and wall times.
///
/// # Errors
/// Whatever is wrong with the input; a file that cannot be written.
pub fn run_kept_and_write(
    spec: &RunSpec,
    folder: &Path,
    keep: Keep,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Finished, TaskError> {
    // Wall time is measured here, at the edge, and goes into timing.json alone.
    #[expect(clippy::disallowed_methods)]
    let begin = std::time::Instant::now();
    let finished = run_kept(spec, Some(&folder.join("map.dsm")), keep, interrupted, progress)?;
    let run_s = begin.elapsed().as_secs_f64();
    let sim_time_s = finished.summary.metrics.sim_time_s;
    let timing = |wall_s: f64| Timing {
        wall_s,
        report_s: wall_s - run_s,
        sim_time_s,
        real_time_factor: sim_time_s / wall_s.max(1e-9),
    };
    let report = crate::report::page(&finished, &timing(run_s), &replay_command(spec));
    write_atomically(&folder.join(REPORT_FILE), report.as_bytes())?;
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

/// Lets whoever sits at a terminal stop the robot: `s` or a space, and Enter. Where nobody sits, nothing is read.
fn listen_for_stop(switch: StopSwitch) {
    if !std::io::stdin().is_terminal() {
        return;
    }
    tracing::info!("`s` and Enter stop the robot");
    // It ends with the process: nothing else wakes who waits for a key.
    std::thread::spawn(move || {
        let mut lines = std::io::stdin().lines().map_while(Result::ok);
        if lines.any(|line| line == " " || line.trim().eq_ignore_ascii_case("s")) {
            switch.press("the emergency stop was pressed at the terminal");
        }
    });
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
