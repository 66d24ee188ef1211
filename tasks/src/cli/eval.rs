//! `dsm eval`: measures against ground truth.

use super::{eval_episodes, eval_grounding, eval_map, eval_segmentation};

/// What is measured.
#[derive(Debug, clap::Subcommand)]
pub enum EvalCommand {
    /// Referring expressions over known boxes: Nr3D, Sr3D, ScanRefer.
    Grounding(eval_grounding::GroundingArgs),
    /// Own maps: explores and maps scenes, and grounds expressions that are made from their truth.
    EpisodesGrounding(eval_episodes::EpisodesArgs),
    /// Maps against ground truth: each scene and seed is explored once, and its frames are mapped at each pose noise.
    Map(eval_map::MapArgs),
    /// A map against any labelled cloud, by the paper's protocol for Replica: mAcc and F-mIoU.
    Segmentation(eval_segmentation::SegmentationArgs),
}

/// Measures; code 0 once it has measured.
pub(super) fn run(command: EvalCommand) -> anyhow::Result<u8> {
    match command {
        EvalCommand::Grounding(args) => eval_grounding::run(args),
        EvalCommand::EpisodesGrounding(args) => eval_episodes::run(args),
        EvalCommand::Map(args) => eval_map::run(args),
        EvalCommand::Segmentation(args) => eval_segmentation::run(args),
    }
}
