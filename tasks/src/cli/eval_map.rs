//! `dsm eval map`: measures maps against ground truth.

use super::eval_drives::{DriveArgs, Drives};
use super::run::catch_interrupt;
use super::{Output, ResultArgs};
use crate::error::TaskError;
use crate::language::{EMBEDDED, LanguageCost, find_language, tell_cost};
use crate::run::RunSpec;
use crate::survey::{Condition, score_drive};
use dsm::build::BuildConfig;
use dsm::eval::{Estimate, MapReport, MapScore, Method, compare, pool};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// Version of the report.
const SCHEMA: u32 = 1;
/// Largest pose noise, centimetres.
const MAX_NOISE_CM: f64 = 50.0;

/// Arguments of `dsm eval map`.
#[derive(Debug, clap::Args)]
pub struct MapArgs {
    #[command(flatten)]
    drives: DriveArgs,
    /// Deviations of the believed camera position along each axis, centimetres, separated by commas; attitude goes with
    /// them, 0.2 degrees per centimetre, and both are correlated over 10 s.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_noise, default_value = "0,1,3,5")]
    pose_noise_cm: Vec<f64>,
    /// Also map with this part switched off.
    #[arg(long)]
    ablate: Vec<Part>,
    /// Switch parts off at these noises only, centimetres, separated by commas; at all when left out.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_noise, requires = "ablate")]
    ablate_at_cm: Vec<f64>,
    /// Who describes frames while they are mapped: `embedded`, or a file of models, which needs the feature `models`.
    #[arg(long, value_name = "embedded|FILE", default_value = EMBEDDED)]
    backend: String,
    /// Scenes and seeds that run side by side; never changes a result.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    workers: u16,
    /// List ghosts, duplicates, poor boxes, missed things and all words, one line each.
    #[arg(long)]
    faults: bool,
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
    /// With a part switched off: by how much each value is larger with all parts, same drives and noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    complete_minus_this: Option<BTreeMap<String, Estimate>>,
    scores: Vec<Run>,
}

/// The result.
#[derive(Clone, Debug, Serialize)]
struct Report {
    schema: u32,
    perception: String,
    backend: String,
    /// What its model has cost.
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<LanguageCost>,
    tables: Vec<Table>,
}

fn parse_noise(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|cm| (0.0..=MAX_NOISE_CM).contains(cm));
    value.ok_or_else(|| format!("expected centimetres from 0 to {MAX_NOISE_CM}, for example 0,1,3,5"))
}

/// Measures; code 0 once it has measured.
pub(super) fn run(args: MapArgs) -> anyhow::Result<u8> {
    let mut drives = args.drives.prepare()?;
    let language = find_language(&args.backend)?;
    drives.specs.iter_mut().for_each(|spec| spec.language = language.clone());
    let conditions = conditions(&args);
    let interrupted = catch_interrupt()?;
    let runs = run_all(&drives, &conditions, args.workers, &interrupted)?;
    if interrupted.load(Ordering::Relaxed) {
        return Ok(130);
    }
    let of_condition = |index: usize| -> Vec<(&str, &MapScore)> {
        runs.iter().map(|(spec, _, scores)| (spec.name.as_str(), &scores[index])).collect()
    };
    let whole = BuildConfig::default();
    let tables = conditions.iter().enumerate().map(|(index, condition)| {
        let of_run = |(spec, frames, scores): &(RunSpec, usize, Vec<MapScore>)| Run {
            scene: spec.name.clone(),
            seed: spec.seed,
            frames: *frames,
            score: scores[index].clone(),
        };
        let complete = conditions.iter().position(|c| c.pose_noise_m == condition.pose_noise_m && c.build == whole);
        let against = complete.filter(|complete| *complete != index);
        Table {
            pose_noise_cm: 100.0 * condition.pose_noise_m,
            window: condition.build.window,
            align: condition.build.align,
            report: pool(&of_condition(index)),
            complete_minus_this: against.map(|complete| compare(&of_condition(complete), &of_condition(index))),
            scores: runs.iter().map(of_run).collect(),
        }
    });
    let report = Report {
        schema: SCHEMA,
        perception: drives.perception.clone(),
        backend: language.name().to_owned(),
        cost: language.cost(),
        tables: tables.collect(),
    };
    Output::new(args.result.clone()).give(&report, || describe(&report, args.faults))?;
    Ok(0)
}

/// Every noise as it is, and with each part switched off.
fn conditions(args: &MapArgs) -> Vec<Condition> {
    let whole = BuildConfig::default();
    let ablated = args.ablate.iter().map(|part| match part {
        Part::Window => BuildConfig { window: false, ..whole.clone() },
        Part::Align => BuildConfig { align: false, ..whole.clone() },
    });
    let ablated: Vec<BuildConfig> = ablated.collect();
    let of_noise = |cm: &f64| {
        let also = args.ablate_at_cm.is_empty() || args.ablate_at_cm.contains(cm);
        let builds = std::iter::once(whole.clone()).chain(ablated.iter().filter(|_| also).cloned());
        let pose_noise_m = cm / 100.0;
        builds.map(|build| Condition { pose_noise_m, build }).collect::<Vec<_>>()
    };
    args.pose_noise_cm.iter().flat_map(of_noise).collect()
}

/// Frames of a drive, and one score for each condition.
type Scored = Result<(usize, Vec<MapScore>), TaskError>;

fn run_all(
    drives: &Drives,
    conditions: &[Condition],
    workers: u16,
    interrupted: &Arc<AtomicBool>,
) -> Result<Vec<(RunSpec, usize, Vec<MapScore>)>, TaskError> {
    let specs = &drives.specs;
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<Option<Scored>>> = Mutex::new(specs.iter().map(|_| None).collect());
    let bar = ProgressBar::with_draw_target(Some(specs.len() as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos} of {len} drives  {elapsed}  {msg}") {
        bar.set_style(style);
    }
    std::thread::scope(|scope| {
        for _ in 0..usize::from(workers).min(specs.len()) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(spec) = specs.get(index).filter(|_| !interrupted.load(Ordering::Relaxed)) else { break };
                    let scored = drives
                        .find(spec, interrupted)
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

fn describe(report: &Report, with_faults: bool) -> String {
    let mut text = tell_cost(report.cost.as_ref());
    for table in &report.tables {
        let off = |on: bool, name: &str| if on { String::new() } else { format!(", {name} off") };
        let (window, align) = (off(table.window, "window"), off(table.align, "align"));
        let noise = table.pose_noise_cm;
        let (runs, scenes) = (table.report.runs, table.report.scenes);
        let _ = writeln!(text, "pose noise {noise} cm{window}{align}, {runs} runs, {scenes} scenes");
        write_estimates(&mut text, &table.report.estimates);
        if let Some(differences) = &table.complete_minus_this {
            let _ = writeln!(text, "  by how much the values with all parts are larger:");
            write_estimates(&mut text, differences);
        }
        for run in table.scores.iter().filter(|_| with_faults) {
            for fault in &run.score.faults {
                let _ = writeln!(text, "  {} {}  {fault}", run.scene, run.seed);
            }
        }
    }
    text
}

/// One line each: value, 95 % interval (`~` when it takes all trials for independent), trials, scenes.
fn write_estimates(text: &mut String, estimates: &BTreeMap<String, Estimate>) {
    for (name, estimate) in estimates {
        let sign = if estimate.method == Some(Method::Wilson) { "~" } else { "" };
        let interval = estimate.interval.map_or(String::new(), |[low, high]| format!("{sign}[{low:.4}, {high:.4}]"));
        let Estimate { value, count, scenes, .. } = estimate;
        let _ = writeln!(text, "  {name:<22} {value:>8.4}  {interval:>19}  {count:>6} in {scenes}");
    }
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
    fn parts_are_switched_off_at_some_noises_only() {
        let args = args(&["s", "--pose-noise-cm", "0,1", "--ablate", "align", "--ablate-at-cm", "1"]).unwrap();
        let short: Vec<(f64, bool)> = conditions(&args).iter().map(|c| (c.pose_noise_m, c.build.align)).collect();
        assert_eq!(short, [(0.0, true), (0.01, true), (0.01, false)]);
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
