//! `dsm replay FILE`: run a recording again and compare.

use super::output::{prepare_folder, print, to_json};
use super::run::set_threads;
use super::{OutArgs, Output, ResultArgs};
use crate::error::TaskError;
use crate::replay::{
    EntrySource, FirstDifference, PlayOptions, ReplayReport, Sight, Wanted, load_test, play, write_test,
};
use dsm::store::{save_map, write_atomically};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Arguments of `dsm replay`.
#[derive(Debug, clap::Args)]
pub struct ReplayArgs {
    /// A recording that `dsm run --record` wrote, or the folder of a regression test.
    recording: PathBuf,
    /// Who detects.
    #[arg(long, value_enum, default_value_t)]
    detector: Sight,
    /// Also write the map and the report of the replay into this folder: `map.dsm`, `replay.json`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace what an earlier replay wrote into --out.
    #[arg(long, requires = "out")]
    force: bool,
    /// Write a regression test into this folder: the recording, and what its replay comes to. `dsm replay DIR` runs it.
    #[arg(long, value_name = "DIR")]
    as_test: Option<PathBuf>,
    /// Replay nothing: write what the recording holds as a ROS 2 bag, an MCAP file of standard messages. Needs the features
    /// `mcap` and `ros2`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "as_test"])]
    as_bag: Option<PathBuf>,
    /// Worker threads; never changes a result.
    #[arg(long)]
    threads: Option<u16>,
    #[command(flatten)]
    result: ResultArgs,
}

/// Replays.
pub(super) fn run(args: ReplayArgs) -> anyhow::Result<u8> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get().min(256) as u16);
    set_threads(args.threads.unwrap_or(cores))?;
    let (test, recording) = if args.recording.is_dir() {
        let (test, recording) = load_test(&args.recording)?;
        (Some(test), recording)
    } else {
        (None, args.recording)
    };
    if let Some(bag) = &args.as_bag {
        let write = WRITE_BAG.ok_or_else(|| TaskError::NotBuiltIn {
            feature: "--as-bag".into(),
            hint: "build with `--features mcap,ros2`".into(),
        })?;
        print(&format!("{} messages in {}", write(&recording, bag)?, bag.display()))?;
        return Ok(0);
    }
    let open = OPEN.ok_or_else(|| not_built_in("replay"))?;
    let folder = match &args.out {
        Some(out) => Some(prepare_folder(&OutArgs { out: Some(out.clone()), force: args.force }, out)?),
        None => None,
    };
    let mut played = play(&|wanted| open(&recording, wanted), PlayOptions { sight: args.detector })?;
    if let Some(test) = &test {
        played.report.add(test.find_differences(&played));
    }
    let report = &played.report;
    if let Some(folder) = &folder {
        save_map(&folder.join("map.dsm"), &played.map).map_err(TaskError::from)?;
        write_atomically(&folder.join("replay.json"), to_json(report)?.as_bytes()).map_err(TaskError::from)?;
    }
    if let Some(as_test) = &args.as_test {
        if !(report.identical && report.reached_end) {
            print(&describe(report, &recording))?;
            return Err(TaskError::Usage("no test is written: the replay is not that of a whole run".into()).into());
        }
        write_test(&recording, &played, as_test)?;
        tracing::warn!("`dsm replay {}` runs the test", as_test.display());
    }
    Output::new(args.result).give(report, || describe(report, &recording))?;
    Ok(u8::from(!report.identical))
}

/// What is missing without MCAP.
pub(super) fn not_built_in(feature: &str) -> TaskError {
    TaskError::NotBuiltIn { feature: feature.into(), hint: "build with `--features mcap`".into() }
}

/// Opens a recording.
pub(super) type Open = fn(&Path, Wanted) -> Result<Box<dyn EntrySource>, TaskError>;

#[cfg(feature = "mcap")]
pub(super) const OPEN: Option<Open> = Some(crate::mcap_file::open_run);
#[cfg(not(feature = "mcap"))]
pub(super) const OPEN: Option<Open> = None;

/// Writes a recording as a bag, and says how many messages it holds.
type WriteBag = fn(&Path, &Path) -> Result<u32, TaskError>;

#[cfg(all(feature = "mcap", feature = "ros2"))]
const WRITE_BAG: Option<WriteBag> = Some(crate::mcap_file::write_bag);
#[cfg(not(all(feature = "mcap", feature = "ros2")))]
const WRITE_BAG: Option<WriteBag> = None;

fn describe(report: &ReplayReport, recording: &Path) -> String {
    let mut text = format!(
        "{} (seed {}), {}: {}\n",
        report.episode,
        report.seed,
        recording.display(),
        if report.identical { "identical" } else { "DIFFERS" }
    );
    let _ = writeln!(
        text,
        "  {:.2} simulated s: {} commands in {} periods, {} frames learned from, {} events, {} steps, {} bytes of map",
        report.sim_time_s,
        report.commands,
        report.periods,
        report.frames,
        report.events,
        report.steps,
        report.map_bytes
    );
    for notice in &report.notices {
        let _ = writeln!(text, "  note: {notice}");
    }
    let line = |found: &FirstDifference| {
        format!(
            "  {:?} differs first at {:.2} s ({})\n    expected: {}\n    got:      {}\n",
            found.of, found.stamp_s, found.part, found.expected, found.got
        )
    };
    text.extend(report.differences.iter().map(line));
    text
}
