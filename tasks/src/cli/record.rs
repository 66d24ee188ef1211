//! `dsm record EPISODE`: run an episode and keep what its map was made of.

use super::output::{check_file, prepare_folder};
use super::run::{
    BarProgress, catch_interrupt, describe, exit_code, prepare, progress_bar, run_taped_and_write, set_threads,
};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
use crate::error::TaskError;
use crate::perception::Tape;
use crate::recording::{RecordingFile, record_into};
use crate::sequence::SequenceRecorder;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Arguments of `dsm record`.
#[derive(Debug, clap::Args)]
pub struct RecordArgs {
    /// An episode file.
    episode: PathBuf,
    #[command(flatten)]
    world: WorldArgs,
    /// Folder of the sequence; map and summary of the run are written there, too. Default: `out/EPISODE-SEED-sequence`.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace a folder that is not empty.
    #[arg(long)]
    force: bool,
    /// Also keep depth as measured: the images round it to millimetres. A map of the sequence is then the run's own map.
    #[arg(long)]
    exact_depth: bool,
    /// Also write an MCAP file with Foxglove's schemas: images, detections, what they were taken for, poses, map,
    /// commands, margins and events. Needs the feature `mcap`.
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    /// Also write the same as a recording for the Rerun viewer (.rrd). Needs the feature `rerun`.
    #[arg(long, value_name = "FILE")]
    rerun: Option<PathBuf>,
    #[command(flatten)]
    result: ResultArgs,
}

/// Runs and records.
pub(super) fn run(args: RecordArgs) -> anyhow::Result<u8> {
    let (spec, settings) = prepare(&args.episode, &args.world)?;
    set_threads(settings.threads.value)?;
    crate::assemble::check(&spec)?;
    let default = Path::new("out").join(format!("{}-{}-sequence", spec.name, spec.seed));
    let folder = args.out.unwrap_or(default);
    let asked = [("mcap", args.mcap, MCAP), ("rerun", args.rerun, RERUN)];
    let mut wanted: Vec<(PathBuf, Create)> = Vec::new();
    for (name, path, create) in asked {
        match (path, create) {
            (None, _) => {}
            (Some(path), Some(create)) => {
                // A file in the run's own folder can be checked when that is there.
                if path.parent().is_some_and(|parent| parent != folder) {
                    check_file(&path)?;
                }
                wanted.push((path, create));
            }
            (Some(_), None) => {
                let hint = format!("build with `--features {name}`");
                return Err(TaskError::NotBuiltIn { feature: format!("--{name}"), hint }.into());
            }
        }
    }
    if let [(first, _), (second, _)] = &wanted[..]
        && first == second
    {
        return Err(TaskError::Usage(format!("{}: two recordings cannot be one file", first.display())).into());
    }
    let folder = prepare_folder(&OutArgs { out: Some(folder.clone()), force: args.force }, &folder)?;
    let source = format!("episode {} with seed {}", spec.name, spec.seed);
    let mut tapes: Vec<Box<dyn Tape>> = vec![Box::new(SequenceRecorder::begin(&folder, &source, args.exact_depth)?)];
    let of = format!("{source}, {}, {}, {}, {} s", spec.robot, spec.physics, spec.perception, spec.time_limit_s);
    let mut rests = Vec::new();
    for (path, create) in wanted {
        let (tape, rest) = record_into(create(&path, &of)?);
        tapes.push(Box::new(tape));
        rests.push(rest);
    }
    let interrupted = catch_interrupt()?;
    let bar = progress_bar(spec.time_limit_s);
    let progress = Box::new(BarProgress { bar: bar.clone() });
    let finished = run_taped_and_write(&spec, &folder, tapes, interrupted.clone(), progress)?;
    for rest in rests {
        rest.write(&finished.journal)?;
    }
    bar.finish_and_clear();
    let summary = finished.summary;
    Output::new(args.result).give(&summary, || describe(&summary, &folder))?;
    Ok(exit_code(&summary, interrupted.load(Ordering::Relaxed)))
}

/// Creates a recording of a run, which is told in words.
type Create = fn(&Path, &str) -> Result<Box<dyn RecordingFile>, TaskError>;

#[cfg(feature = "mcap")]
const MCAP: Option<Create> = Some(|path, _| Ok(Box::new(crate::mcap_file::create(path)?)));
#[cfg(not(feature = "mcap"))]
const MCAP: Option<Create> = None;

#[cfg(feature = "rerun")]
const RERUN: Option<Create> = Some(|path, of| Ok(Box::new(crate::rerun_file::create(path, of)?)));
#[cfg(not(feature = "rerun"))]
const RERUN: Option<Create> = None;
