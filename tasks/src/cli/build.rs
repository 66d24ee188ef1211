//! `dsm build DIR`: map a recorded sequence without a simulator.

use super::output::check_file;
use super::run::{BarProgress, catch_interrupt, progress_bar, set_threads};
use super::{Output, ResultArgs};
use crate::error::TaskError;
use crate::language::{EMBEDDED, find_language};
use crate::late_sight::{LateSight, Moment, Pace, Seen};
use crate::mapping::{Mapping, Updates};
use crate::run::{CELL_M, Progress};
use crate::sequence::{Layout, Options, Sequence};
use dsm::build::BuildConfig;
use dsm::map::Map;
use dsm::perceive::{Detections, Detector, PixelSegmenter};
use dsm::store::save_map;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Arguments of `dsm build`.
#[derive(Debug, clap::Args)]
pub struct BuildArgs {
    /// Folder of a sequence: as `dsm record` writes it, TUM RGB-D, Replica or ScanNet.
    sequence: PathBuf,
    /// The map file to write.
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// The sequence's layout; told from its files when left out.
    #[arg(long)]
    layout: Option<Layout>,
    /// Where detections come from; those of the backend, if it detects, else recorded ones (detections.jsonl), if there are
    /// any.
    #[arg(long)]
    detections: Option<Source>,
    /// Focal lengths and principal point in pixels, where the layout does not tell.
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = parse_camera)]
    camera: Option<[f64; 4]>,
    /// Units of the depth images in a metre, where the layout's own (tum 5000, replica 6553.5, scannet 1000) is wrong.
    #[arg(long, value_parser = parse_scale)]
    depth_scale: Option<f64>,
    /// Use one frame in so many.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    stride: u32,
    /// Who describes frames, and with networks who detects and encodes: `embedded`, or a file of models, which needs the feature `models`.
    #[arg(long, value_name = "embedded|FILE", default_value = EMBEDDED)]
    backend: String,
    /// Worker threads; never changes a result.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    #[command(flatten)]
    result: ResultArgs,
}

/// Where detections come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Source {
    /// Those in detections.jsonl.
    Recorded,
    /// The embedded segmenter, in pixels alone, without names.
    Pixels,
    /// The detector, or the segmenter, of `--backend`.
    Backend,
}

#[derive(Serialize)]
struct Built {
    frames: usize,
    detections: usize,
    source: Source,
    objects: usize,
    relations: usize,
    rooms: usize,
}

/// Maps the sequence.
pub(super) fn run(args: BuildArgs) -> anyhow::Result<u8> {
    set_threads(args.threads)?;
    let options = Options { camera: args.camera, depth_scale: args.depth_scale };
    let sequence = Sequence::open(&args.sequence, args.layout, options)?;
    let folder = args.sequence.display();
    if sequence.is_empty() {
        return Err(TaskError::Usage(format!("{folder}: the sequence has no frame with colour, depth and pose")).into());
    }
    let language = find_language(&args.backend)?;
    // There is no robot to wait for: what a frame shows is taken in at its declared moment.
    let mut late = match args.detections {
        None | Some(Source::Backend) => language
            .looks()?
            .map(|looks| LateSight::start(looks.detector, Pace { moment: Moment::Declared, ..looks.pace })),
        Some(_) => None,
    };
    let source = match args.detections {
        Some(Source::Backend) | None if late.is_some() => Source::Backend,
        Some(Source::Backend) => {
            return Err(
                TaskError::Usage(format!("--backend {}: it has neither detector nor segmenter", args.backend)).into()
            );
        }
        Some(Source::Recorded) if !sequence.has_detections() => {
            return Err(TaskError::Usage(format!("{folder}: no detections.jsonl; use --detections pixels")).into());
        }
        Some(source) => source,
        None if sequence.has_detections() => Source::Recorded,
        None => Source::Pixels,
    };
    check_file(&args.out)?;
    let interrupted = catch_interrupt()?;
    let builder = language.builder(BuildConfig::default())?;
    let mut mapping = Mapping::new(builder, language.annotator(), Map::new(CELL_M), Updates::Dropped);
    let mut segmenter = PixelSegmenter;
    let bar = progress_bar(sequence.len() as f64);
    let mut progress = BarProgress { bar: bar.clone() };
    let (mut frames, mut detections) = (0, 0);
    for index in (0..sequence.len()).step_by(args.stride as usize) {
        if interrupted.load(Ordering::Relaxed) {
            break;
        }
        let seen = sequence.read(index)?;
        if let Some(late) = &mut late {
            mapping.builder.credit_names_to(late.name());
            let frame = Arc::new(seen.frame);
            detections += take_in(&mut mapping, late.find_seen(frame.stamp));
            if !late.take_up(&frame, &seen.carrier) {
                mapping.observe(&frame, &Detections { frame: frame.id, items: Vec::new() }, &seen.carrier);
            }
            frames += 1;
            progress.at(index as f64);
            continue;
        }
        let found = match (source, seen.detections) {
            (Source::Recorded, Some(recorded)) => {
                mapping.builder.credit_names_to(&seen.detector);
                recorded
            }
            _ => {
                mapping.builder.credit_names_to(segmenter.name());
                segmenter.detect(&seen.frame)
            }
        };
        mapping.observe(&seen.frame, &found, &seen.carrier);
        (frames, detections) = (frames + 1, detections + found.items.len());
        progress.at(index as f64);
    }
    bar.finish_and_clear();
    if let Some(late) = &mut late {
        detections += take_in(&mut mapping, late.finish());
    }
    mapping.finish();
    let map = mapping.map;
    // A sequence that breaks in the middle leaves no map, and the one that was there before.
    save_map(&args.out, &map).map_err(TaskError::from)?;
    let (objects, relations, rooms) = (map.stable_objects().count(), map.relations.len(), map.rooms.len());
    let built = Built { frames, detections, source, objects, relations, rooms };
    Output::new(args.result).give(&built, || {
        format!(
            "{objects} objects, {relations} relations, {rooms} rooms from {frames} frames; map written to {}",
            args.out.display()
        )
    })?;
    Ok(if interrupted.load(Ordering::Relaxed) { 130 } else { 0 })
}

/// Takes in what earlier frames showed; gives the number of detections.
fn take_in(mapping: &mut Mapping, seen: Vec<Seen>) -> usize {
    let take = |one: Seen| {
        mapping.observe(&one.frame, &one.detections, &one.carrier);
        one.detections.items.len()
    };
    seen.into_iter().map(take).sum()
}

fn parse_camera(text: &str) -> Result<[f64; 4], String> {
    let values: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match values[..] {
        [fx, fy, cx, cy] if fx > 0.0 && fy > 0.0 && values.iter().all(|v| v.is_finite()) => Ok([fx, fy, cx, cy]),
        _ => Err("expected four numbers fx,fy,cx,cy in pixels, for example 525,525,319.5,239.5".into()),
    }
}

fn parse_scale(text: &str) -> Result<f64, String> {
    let scale: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if (1.0..=1e6).contains(&scale) { Ok(scale) } else { Err("expected 1 to 1000000 units in a metre".into()) }
}
