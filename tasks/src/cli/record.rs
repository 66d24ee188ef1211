//! `dsm record EPISODE`: run an episode and keep what its map was made of.

use super::output::prepare_folder;
use super::run::{
    BarProgress, catch_interrupt, describe, exit_code, prepare, progress_bar, run_taped_and_write, set_threads,
};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
use crate::error::TaskError;
use crate::journal::Journal;
use crate::perception::Tape;
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
    #[command(flatten)]
    result: ResultArgs,
}

/// Runs and records.
pub(super) fn run(args: RecordArgs) -> anyhow::Result<u8> {
    let (spec, settings) = prepare(&args.episode, &args.world)?;
    set_threads(settings.threads.value)?;
    crate::assemble::check(&spec)?;
    if args.mcap.is_some() && !cfg!(feature = "mcap") {
        return Err(not_built_in().into());
    }
    let default = Path::new("out").join(format!("{}-{}-sequence", spec.name, spec.seed));
    let folder = prepare_folder(&OutArgs { out: args.out, force: args.force }, &default)?;
    let source = format!("episode {} with seed {}", spec.name, spec.seed);
    let mut tapes: Vec<Box<dyn Tape>> = vec![Box::new(SequenceRecorder::begin(&folder, &source, args.exact_depth)?)];
    let mut endings: Vec<Ending> = Vec::new();
    if let Some(path) = &args.mcap {
        let (tape, ending) = mcap_tape(path)?;
        tapes.push(tape);
        endings.push(ending);
    }
    let interrupted = catch_interrupt()?;
    let bar = progress_bar(spec.time_limit_s);
    let progress = Box::new(BarProgress { bar: bar.clone() });
    let finished = run_taped_and_write(&spec, &folder, tapes, interrupted.clone(), progress)?;
    for end in endings {
        end(&finished.journal)?;
    }
    bar.finish_and_clear();
    let summary = finished.summary;
    Output::new(args.result).give(&summary, || describe(&summary, &folder))?;
    Ok(exit_code(&summary, interrupted.load(Ordering::Relaxed)))
}

/// Brings a recording to its end with what the robot noted itself.
type Ending = Box<dyn FnOnce(&Journal) -> Result<(), TaskError>>;

#[cfg(feature = "mcap")]
fn mcap_tape(path: &Path) -> Result<(Box<dyn Tape>, Ending), TaskError> {
    let (tape, rest) = crate::mcap_tape::create(path)?;
    Ok((Box::new(tape), Box::new(move |journal| rest.write(journal))))
}

#[cfg(not(feature = "mcap"))]
fn mcap_tape(_: &Path) -> Result<(Box<dyn Tape>, Ending), TaskError> {
    Err(not_built_in())
}

fn not_built_in() -> TaskError {
    TaskError::NotBuiltIn { feature: "--mcap".into(), hint: "build with `--features mcap`".into() }
}
