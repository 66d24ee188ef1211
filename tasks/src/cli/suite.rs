//! `dsm suite PATH...`: many episodes, many seeds, one table.

use super::output::{prepare_folder, to_json};
use super::run::{catch_interrupt, prepare, run_and_write, set_threads};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
use crate::error::TaskError;
use crate::report::{IndexLine, index_page};
use crate::run::{RunSpec, Silent};
use crate::summary::{Metrics, Stage};
use dsm::store::write_atomically;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Version of `suite.json`.
const SUITE_SCHEMA: u32 = 1;

/// Arguments of `dsm suite`.
#[derive(Debug, clap::Args)]
pub struct SuiteArgs {
    /// Episode files, or folders that are searched for episodes/*.toml.
    paths: Vec<PathBuf>,
    /// Seeds A..B (B excluded); the seed of each episode file when left out.
    #[arg(long, value_name = "A..B", value_parser = parse_seeds)]
    seeds: Option<(u64, u64)>,
    /// Generated homes instead of files.
    #[arg(long, value_name = "N")]
    generate: Option<u32>,
    /// Episodes that run side by side; never changes a result.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    workers: u16,
    /// Write a JUnit file; its times are simulated.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// One line of the suite.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(super) struct SuiteEpisode {
    /// Name of the episode.
    id: String,
    /// Seed.
    seed: u64,
    /// Whether it succeeded.
    success: bool,
    /// The stage that failed.
    failed_stage: Option<Stage>,
    /// Why.
    reason: Option<String>,
    /// Metrics; null when it did not run to its end.
    metrics: Option<Metrics>,
}

/// Sums over the suite.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(super) struct Totals {
    /// Episodes run.
    episodes: usize,
    /// Episodes that succeeded.
    successes: usize,
    /// Share of successes, 0 to 1.
    success_rate: f64,
    /// Wilson interval of the share, 95 %.
    success_interval: [f64; 2],
    /// Collisions over all episodes.
    collisions: u32,
    /// Limit violations over all episodes.
    limit_violations: u32,
    /// Simulated time, seconds.
    sim_time_s: f64,
}

/// `suite.json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(super) struct Suite {
    /// Version of this layout.
    schema: u32,
    /// Episodes sorted by name and seed.
    episodes: Vec<SuiteEpisode>,
    /// Sums.
    totals: Totals,
}

pub(super) fn parse_seeds(text: &str) -> Result<(u64, u64), String> {
    let expected = || format!("expected A..B with A < B, for example 0..10, got `{text}`");
    let (a, b) = text.split_once("..").ok_or_else(expected)?;
    let (a, b) = (a.trim().parse::<u64>().map_err(|_| expected())?, b.trim().parse::<u64>().map_err(|_| expected())?);
    if a < b && b - a <= 100_000 { Ok((a, b)) } else { Err(expected()) }
}

/// Runs the suite; code 1 when an episode failed.
pub(super) fn run(args: SuiteArgs) -> anyhow::Result<u8> {
    if args.generate.is_some() {
        let hint = "give paths of episodes or of folders with episodes/*.toml".into();
        return Err(TaskError::NotBuiltIn { feature: "the generator of homes".into(), hint }.into());
    }
    let files = find_episodes(&args.paths)?;
    let mut specs = Vec::new();
    for file in &files {
        let (spec, settings) = prepare(file, &args.world)?;
        set_threads_once(settings.threads.value, specs.is_empty())?;
        crate::assemble::check(&spec)?;
        match args.seeds {
            Some((a, b)) => specs.extend((a..b).map(|seed| RunSpec { seed, ..spec.clone() })),
            None => specs.push(spec),
        }
    }
    let folder = prepare_folder(&args.out, Path::new("out/suite"))?;
    let interrupted = catch_interrupt()?;
    let mut episodes = run_all(&specs, &folder, usize::from(args.workers), args.out.force, &interrupted)?;
    episodes.sort_by(|a, b| (&a.id, a.seed).cmp(&(&b.id, b.seed)));
    let suite = Suite { schema: SUITE_SCHEMA, totals: totals(&episodes), episodes };
    write_atomically(&folder.join("suite.json"), to_json(&suite)?.as_bytes()).map_err(TaskError::from)?;
    write_atomically(&folder.join("index.html"), index(&suite, &folder).as_bytes()).map_err(TaskError::from)?;
    if let Some(path) = &args.junit {
        write_atomically(path, junit(&suite).as_bytes()).map_err(TaskError::from)?;
    }
    Output::new(args.result).give(&suite, || table(&suite))?;
    if interrupted.load(Ordering::Relaxed) {
        return Ok(130);
    }
    Ok(u8::from(suite.totals.successes < suite.totals.episodes))
}

/// The page that links the report of every episode.
fn index(suite: &Suite, folder: &Path) -> String {
    let lines: Vec<IndexLine<'_>> = suite
        .episodes
        .iter()
        .map(|e| {
            let report = format!("{}-{}/report.html", e.id, e.seed);
            let stage = e.failed_stage.and_then(|stage| serde_json::to_value(stage).ok());
            let stage = stage.as_ref().and_then(|stage| stage.as_str()).map(|stage| format!("{stage}: "));
            IndexLine {
                episode: &e.id,
                seed: e.seed,
                success: e.success,
                why: stage.unwrap_or_default() + e.reason.as_deref().unwrap_or_default(),
                metrics: e.metrics.as_ref(),
                report: folder.join(&report).is_file().then_some(report),
            }
        })
        .collect();
    let t = &suite.totals;
    let [low, high] = t.success_interval.map(|share| 100.0 * share);
    let text = format!(
        "{} of {} episodes succeeded ({:.0} %, 95 % interval {low:.0} to {high:.0} %); {} collisions, {} limit violations, \
         {:.0} simulated seconds.",
        t.successes,
        t.episodes,
        100.0 * t.success_rate,
        t.collisions,
        t.limit_violations,
        t.sim_time_s
    );
    index_page(&text, &lines)
}

fn set_threads_once(threads: u16, first: bool) -> Result<(), TaskError> {
    if first { set_threads(threads) } else { Ok(()) }
}

/// Episode files named, and those in `episodes` folders below the folders named; sorted.
fn find_episodes(paths: &[PathBuf]) -> Result<Vec<PathBuf>, TaskError> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            collect(path, &mut files)?;
        } else if path.is_file() {
            files.push(path.clone());
        } else {
            return Err(TaskError::Usage(format!("{}: no such file or folder", path.display())));
        }
    }
    files.sort();
    files.dedup();
    if files.is_empty() {
        return Err(TaskError::Usage("no episode found; expected files, or folders that hold episodes/*.toml".into()));
    }
    Ok(files)
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), TaskError> {
    let read = |source| TaskError::Read { path: folder.to_owned(), source };
    for entry in std::fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        let in_episodes = folder.file_name().is_some_and(|n| n == "episodes");
        if path.is_dir() {
            collect(&path, files)?;
        } else if in_episodes && path.extension().is_some_and(|e| e == "toml") {
            files.push(path);
        }
    }
    Ok(())
}

fn run_all(
    specs: &[RunSpec],
    folder: &Path,
    workers: usize,
    force: bool,
    interrupted: &Arc<AtomicBool>,
) -> Result<Vec<SuiteEpisode>, TaskError> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    let bar = ProgressBar::with_draw_target(Some(specs.len() as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos} of {len} episodes  {elapsed}  {msg}") {
        bar.set_style(style);
    }
    std::thread::scope(|scope| {
        for _ in 0..workers.min(specs.len()) {
            scope.spawn(|| {
                while let Some(spec) = specs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if interrupted.load(Ordering::Relaxed) {
                        break;
                    }
                    let line = run_one(spec, folder, force, interrupted);
                    let word = if line.success { "success" } else { "failed" };
                    bar.set_message(format!("{} seed {}: {word}", line.id, line.seed));
                    bar.inc(1);
                    if let Ok(mut done) = done.lock() {
                        done.push(line);
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    done.into_inner().map_err(|_| TaskError::Internal("a worker panicked".into()))
}

/// Runs one episode; whatever goes wrong becomes a line.
fn run_one(spec: &RunSpec, folder: &Path, force: bool, interrupted: &Arc<AtomicBool>) -> SuiteEpisode {
    let out = OutArgs { out: Some(folder.join(format!("{}-{}", spec.name, spec.seed))), force };
    let result = catch_unwind(AssertUnwindSafe(|| {
        let folder = prepare_folder(&out, Path::new("."))?;
        run_and_write(spec, &folder, interrupted.clone(), Box::new(Silent))
    }));
    let crashed = |reason: String| SuiteEpisode {
        id: spec.name.clone(),
        seed: spec.seed,
        success: false,
        failed_stage: Some(Stage::Safety),
        reason: Some(reason),
        metrics: None,
    };
    match result {
        Ok(Ok(summary)) => SuiteEpisode {
            id: summary.episode,
            seed: summary.seed,
            success: summary.success,
            failed_stage: summary.failure.as_ref().map(|f| f.stage),
            reason: summary.failure.map(|f| f.reason),
            metrics: Some(summary.metrics),
        },
        Ok(Err(error)) => crashed(error.to_string()),
        Err(_) => crashed("the episode panicked".into()),
    }
}

fn totals(episodes: &[SuiteEpisode]) -> Totals {
    let successes = episodes.iter().filter(|e| e.success).count();
    let metrics = || episodes.iter().filter_map(|e| e.metrics.as_ref());
    Totals {
        episodes: episodes.len(),
        successes,
        success_rate: successes as f64 / episodes.len().max(1) as f64,
        success_interval: wilson(successes, episodes.len()),
        collisions: metrics().map(|m| m.collisions).sum(),
        limit_violations: metrics().map(|m| m.limit_violations).sum(),
        sim_time_s: metrics().map(|m| m.sim_time_s).sum(),
    }
}

/// Wilson's score interval of a share at 95 %.
fn wilson(successes: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (n, z) = (n as f64, 1.959_963_985);
    let p = successes as f64 / n;
    let center = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    [(center - half).max(0.0), (center + half).min(1.0)]
}

fn table(suite: &Suite) -> String {
    let mut text = String::new();
    for e in &suite.episodes {
        let word = if e.success { "ok    " } else { "FAILED" };
        let time = e.metrics.as_ref().map_or(0.0, |m| m.sim_time_s);
        let _ = write!(text, "{word} {:<32} seed {:<4} {time:6.1} s", e.id, e.seed);
        if let (Some(stage), Some(reason)) = (e.failed_stage, &e.reason) {
            let _ = write!(text, "  {stage:?}: {reason}");
        }
        text.push('\n');
    }
    let t = &suite.totals;
    let [low, high] = t.success_interval;
    let _ = writeln!(
        text,
        "{} of {} succeed ({:.1} %, 95 % interval {:.1} to {:.1} %); {} collisions, {} limit violations",
        t.successes,
        t.episodes,
        100.0 * t.success_rate,
        100.0 * low,
        100.0 * high,
        t.collisions,
        t.limit_violations
    );
    text
}

fn junit(suite: &Suite) -> String {
    let escape = |s: &str| s.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
    let t = &suite.totals;
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"dsm\" tests=\"{}\" failures=\"{}\" time=\"{:.2}\">\n",
        t.episodes,
        t.episodes - t.successes,
        t.sim_time_s
    );
    for e in &suite.episodes {
        let time = e.metrics.as_ref().map_or(0.0, |m| m.sim_time_s);
        let _ = write!(text, "  <testcase classname=\"{}\" name=\"seed {}\" time=\"{time:.2}\"", escape(&e.id), e.seed);
        if e.success {
            text.push_str("/>\n");
        } else {
            let stage = e.failed_stage.map_or(String::new(), |s| format!("{s:?}").to_lowercase());
            let reason = escape(e.reason.as_deref().unwrap_or(""));
            let _ = writeln!(text, "><failure type=\"{stage}\" message=\"{reason}\"/></testcase>");
        }
    }
    text.push_str("</testsuite>\n");
    text
}

#[cfg(test)]
mod tests {
    //! Contract: seeds are A..B with A < B; the interval is Wilson's.
    use super::*;

    #[test]
    fn seeds_are_a_half_open_range() {
        assert_eq!(parse_seeds("0..10"), Ok((0, 10)));
        for wrong in ["3", "5..5", "9..2", "a..b", "-1..3", "0..999999999"] {
            assert!(parse_seeds(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn wilson_interval_of_nine_in_ten() {
        // Value from R: binom::binom.wilson(9, 10).
        let [low, high] = wilson(9, 10);
        assert!((low - 0.5958).abs() < 1e-3 && (high - 0.9821).abs() < 1e-3, "{low} {high}");
    }
}
