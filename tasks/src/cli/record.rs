//! `dsm record EPISODE`: run an episode and keep what its map was made of.

use super::output::prepare_folder;
use super::run::{
    BarProgress, catch_interrupt, describe, exit_code, prepare, progress_bar, run_and_write, set_threads,
};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
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
    #[command(flatten)]
    result: ResultArgs,
}

/// Runs and records.
pub(super) fn run(args: RecordArgs) -> anyhow::Result<u8> {
    let (spec, settings) = prepare(&args.episode, &args.world)?;
    set_threads(settings.threads.value)?;
    crate::assemble::check(&spec)?;
    let default = Path::new("out").join(format!("{}-{}-sequence", spec.name, spec.seed));
    let folder = prepare_folder(&OutArgs { out: args.out, force: args.force }, &default)?;
    let source = format!("episode {} with seed {}", spec.name, spec.seed);
    let tapes: Vec<Box<dyn Tape>> = vec![Box::new(SequenceRecorder::begin(&folder, &source, args.exact_depth)?)];
    let interrupted = catch_interrupt()?;
    let bar = progress_bar(spec.time_limit_s);
    let progress = Box::new(BarProgress { bar: bar.clone() });
    let summary = run_and_write(&spec, &folder, tapes, interrupted.clone(), progress)?;
    bar.finish_and_clear();
    Output::new(args.result).give(&summary, || describe(&summary, &folder))?;
    Ok(exit_code(&summary, interrupted.load(Ordering::Relaxed)))
}
