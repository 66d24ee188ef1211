//! `dsm eval grounding`: measures grounding over known boxes.

use super::output::to_json;
use super::{Output, ResultArgs, eval_map};
use crate::error::TaskError;
use dsm::eval_grounding::{Report, evaluate, find_contradiction, read_queries, read_scenes};
use dsm::ground::{GroundConfig, Grounder};
use dsm::store::write_atomically;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What is measured.
#[derive(Debug, clap::Subcommand)]
pub enum EvalCommand {
    /// Referring expressions over known boxes: one scene and one query a line (JSON).
    Grounding(GroundingArgs),
    /// Maps against ground truth: each scene and seed is explored once, and its frames are mapped at each pose noise.
    Map(eval_map::MapArgs),
}

/// Arguments of `dsm eval grounding`.
#[derive(Debug, clap::Args)]
pub struct GroundingArgs {
    /// Scenes: one JSON object a line with `scene_id` and `objects`.
    #[arg(long, value_name = "FILE")]
    scenes: PathBuf,
    /// Queries: one JSON object a line with `dataset`, `query_id`, `scene_id`, `utterance`; fields of truth may be absent.
    #[arg(long, value_name = "FILE")]
    queries: PathBuf,
    /// Write the answers, one JSON object a line: query_id, predicted_id, status, score, time_us.
    #[arg(long, value_name = "FILE")]
    predictions: Option<PathBuf>,
    #[command(flatten)]
    result: ResultArgs,
}

/// Measures; code 0 once it has measured.
pub(super) fn run(command: EvalCommand) -> anyhow::Result<u8> {
    match command {
        EvalCommand::Grounding(args) => run_grounding(args),
        EvalCommand::Map(args) => eval_map::run(args),
    }
}

fn run_grounding(args: GroundingArgs) -> anyhow::Result<u8> {
    let scenes = read_scenes(&read(&args.scenes)?)
        .map_err(|error| TaskError::Usage(format!("{}: {error}", args.scenes.display())))?;
    let queries = read_queries(&read(&args.queries)?)
        .map_err(|error| TaskError::Usage(format!("{}: {error}", args.queries.display())))?;
    let grounder = Grounder::new(GroundConfig::referring(), crate::assemble::knowledge()?)
        .map_err(|error| TaskError::Internal(error.to_string()))?;
    // Wall time per query is measured here, at the edge.
    #[expect(clippy::disallowed_methods)]
    let start = Instant::now();
    let (predictions, report) = evaluate(&scenes, &queries, &grounder, || start.elapsed().as_micros() as u64);
    if let Some(path) = &args.predictions {
        let mut lines = String::new();
        for prediction in &predictions {
            lines += &serde_json::to_string(prediction).map_err(|e| TaskError::Internal(e.to_string()))?;
            lines.push('\n');
        }
        write_atomically(path, lines.as_bytes()).map_err(TaskError::from)?;
    }
    if let Some(reason) = find_contradiction(&report) {
        let json = to_json(&report)?;
        return Err(TaskError::Internal(format!("the table contradicts itself: {reason}\n{json}")).into());
    }
    Output::new(args.result).give(&report, || describe(&report))?;
    Ok(0)
}

fn read(path: &Path) -> Result<String, TaskError> {
    std::fs::read_to_string(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })
}

fn describe(report: &Report) -> String {
    let mut text = format!("tier: {}\n{:<34} {:>6}  {:>14}  {:>6}\n", report.tier, "", "%", "95 % interval", "N");
    for (key, rate) in &report.rates {
        let interval = format!("[{:.1}, {:.1}]", rate.interval[0], rate.interval[1]);
        let _ = writeln!(text, "{key:<34} {:>6.2}  {interval:>14}  {:>6}", rate.percent, rate.count);
    }
    let count: usize = report.queries.values().sum();
    let _ = writeln!(text, "queries {count}, with truth {}", report.judged);
    for (dataset, abstained) in &report.abstained {
        let _ = writeln!(text, "abstained {dataset}: {abstained} of {}", report.queries[dataset]);
    }
    let time = &report.time_us;
    let _ = write!(text, "time per query, us: p50 {} p95 {} max {}", time.p50, time.p95, time.max);
    text
}
