//! `dsm eval grounding`: measures grounding over known boxes.

use super::output::to_json;
use super::{Output, ResultArgs};
use crate::error::TaskError;
use crate::language::{EMBEDDED, Language, LanguageCost, embedded, find_language, tell_cost};
use dsm::eval_grounding::{
    Prediction, QueryLine, Rate, Report, SceneLine, cross_validate, evaluate, find_contradiction, fit_all,
    list_failures, read_queries, read_referit3d, read_scanrefer, read_scenes, write_weights,
};
use dsm::ground::{GroundConfig, Grounder, RankingWeights};
use dsm::knowledge::Knowledge;
use dsm::store::write_atomically;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Arguments of `dsm eval grounding`.
#[derive(Debug, clap::Args)]
pub struct GroundingArgs {
    /// Scenes: one JSON object a line with `scene_id` and `objects`.
    #[arg(long, value_name = "FILE")]
    scenes: PathBuf,
    /// Queries: one JSON object a line with `dataset`, `query_id`, `scene_id`, `utterance` (fields of truth may be
    /// absent), or as published: ReferIt3D's .csv (Nr3D, Sr3D) or ScanRefer's .json.
    #[arg(long, value_name = "FILE")]
    queries: PathBuf,
    /// Write the answers, one JSON object a line: query_id, predicted_id, status, score, time_us.
    #[arg(long, value_name = "FILE")]
    predictions: Option<PathBuf>,
    /// Write the wrong answers, one JSON object a line, with what was understood and the kinds of language used.
    #[arg(long, value_name = "FILE")]
    failures: Option<PathBuf>,
    /// Also print the rates by kind of language, those with most wrong answers first.
    #[arg(long)]
    classes: bool,
    /// Fit the weights of evidence anew for each of so many folds of the scenes, on the other folds alone, and ground
    /// each query with the weights that have not seen its room.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(2..=20))]
    folds: Option<u16>,
    /// Fit the weights of evidence on all queries and write them as the source file that ships with the program.
    #[arg(long, value_name = "FILE", conflicts_with = "folds")]
    fit: Option<PathBuf>,
    /// Measure again with this part switched off; may be given more than once.
    #[arg(long)]
    ablate: Vec<Part>,
    /// Who reads words and scores relations: `embedded`, or a file of models, which needs the feature `models`. May be given
    /// more than once: the first gives the answers and all tables, each gives a row of its own.
    #[arg(long, value_name = "embedded|FILE", default_value = EMBEDDED, conflicts_with = "fit")]
    backend: Vec<String>,
    #[command(flatten)]
    result: ResultArgs,
}

/// What can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// The latent relation filter: relations, orders and places.
    Relations,
    /// Colour, pattern, shape, size.
    Appearance,
    /// Material, weight.
    Physical,
    /// What things are for.
    Affordance,
    /// All three kinds of attributes.
    Attributes,
    /// Verification in views. Known boxes have no views, so that nothing changes here.
    Verification,
    /// The fitted weights: every constraint counts once.
    Weights,
}

/// The result.
#[derive(Serialize)]
struct Measured {
    /// Over how many folds the weights were held out; none if those that ship with the program were used.
    #[serde(skip_serializing_if = "Option::is_none")]
    folds: Option<u16>,
    #[serde(flatten)]
    report: Report,
    /// One row per backend, in the order in which they were named.
    backends: Vec<BackendRow>,
    /// Rates without a part, by part.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    without: BTreeMap<String, BTreeMap<String, Rate>>,
}

/// What a backend is worth and what it costs.
#[derive(Serialize)]
struct BackendRow {
    backend: String,
    /// Rates by data set.
    rates: BTreeMap<String, Rate>,
    /// Wall time of all queries together, seconds.
    seconds: f64,
    /// What its model has cost.
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<LanguageCost>,
}

impl Part {
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    fn switch_off(self, config: &mut GroundConfig) {
        match self {
            Self::Relations => config.relation_filter = false,
            Self::Appearance => config.appearance = false,
            Self::Physical => config.physical = false,
            Self::Affordance => config.affordance = false,
            Self::Attributes => {
                config.appearance = false;
                config.physical = false;
                config.affordance = false;
            }
            Self::Verification => config.verify = false,
            Self::Weights => {}
        }
    }
}

/// Measures; code 0 once it has measured.
pub(super) fn run(args: GroundingArgs) -> anyhow::Result<u8> {
    let scenes = read_scenes(&read(&args.scenes)?)
        .map_err(|error| TaskError::Usage(format!("{}: {error}", args.scenes.display())))?;
    let queries = queries_of(&args.queries, &scenes)?;
    let knowledge = crate::assemble::knowledge()?;
    let languages = args.backend.iter().map(|name| find_language(name)).collect::<Result<Vec<_>, TaskError>>()?;
    let grounder = |language: &dyn Language, without: Option<Part>, weights: RankingWeights| {
        let mut config = GroundConfig::referring();
        if let Some(part) = without {
            part.switch_off(&mut config);
        }
        let grounder = make(&config, &knowledge)?.with_weights(weights);
        Ok::<Grounder, TaskError>(language.plug_into(grounder))
    };
    if let Some(path) = &args.fit {
        let weights = fit_all(&scenes, &queries, &grounder(&*embedded(), None, RankingWeights::unfitted())?);
        write_atomically(path, write_weights(&weights).as_bytes()).map_err(TaskError::from)?;
    }
    // Wall time per query is measured here, at the edge.
    #[expect(clippy::disallowed_methods)]
    let start = Instant::now();
    let now_us = || start.elapsed().as_micros() as u64;
    let measure = |language: &dyn Language, without: Option<Part>| -> Result<(Vec<Prediction>, Report), TaskError> {
        let shipped =
            if without == Some(Part::Weights) { RankingWeights::unfitted() } else { RankingWeights::fitted() };
        let plain = grounder(language, without, shipped)?;
        Ok(match args.folds {
            Some(folds) if without != Some(Part::Weights) => {
                // The configuration was valid a moment ago.
                let with = |weights: RankingWeights| match grounder(language, without, weights) {
                    Ok(grounder) => grounder,
                    Err(_) => unreachable!("the same configuration was accepted before"),
                };
                cross_validate(&scenes, &queries, usize::from(folds), with, now_us)
            }
            _ => evaluate(&scenes, &queries, &plain, now_us),
        })
    };
    let mut measured = Vec::new();
    for language in &languages {
        let (predictions, report) = measure(&**language, None)?;
        refuse_contradiction(&report)?;
        measured.push((row_of(&**language, &predictions, &report), predictions, report));
    }
    let mut backends = Vec::new();
    let mut first = None;
    for (row, predictions, report) in measured {
        backends.push(row);
        first.get_or_insert((predictions, report));
    }
    let Some((predictions, report)) = first else {
        return Err(TaskError::Usage("--backend: expected embedded or a file of models".into()).into());
    };
    if let Some(path) = &args.predictions {
        write_lines(path, &predictions)?;
    }
    if let Some(path) = &args.failures {
        write_lines(path, &list_failures(&scenes, &queries, &predictions))?;
    }
    let mut without = BTreeMap::new();
    for part in &args.ablate {
        let (_, report) = measure(&*languages[0], Some(*part))?;
        refuse_contradiction(&report)?;
        without.insert(part.name(), report.rates);
    }
    let measured = Measured { folds: args.folds, report, backends, without };
    Output::new(args.result).give(&measured, || describe(&measured, args.classes))?;
    Ok(0)
}

fn row_of(language: &dyn Language, predictions: &[Prediction], report: &Report) -> BackendRow {
    let whole = |(name, _): &(&String, &Rate)| !name.contains('/');
    BackendRow {
        backend: language.name().to_owned(),
        rates: report.rates.iter().filter(whole).map(|(name, rate)| (name.clone(), *rate)).collect(),
        seconds: predictions.iter().map(|prediction| prediction.time_us as f64).sum::<f64>() * 1e-6,
        cost: language.cost(),
    }
}

fn make(config: &GroundConfig, knowledge: &Arc<Knowledge>) -> Result<Grounder, TaskError> {
    Grounder::new(config.clone(), knowledge.clone()).map_err(|error| TaskError::Internal(error.to_string()))
}

fn refuse_contradiction(report: &Report) -> anyhow::Result<()> {
    if let Some(reason) = find_contradiction(report) {
        let json = to_json(report)?;
        return Err(TaskError::Internal(format!("the table contradicts itself: {reason}\n{json}")).into());
    }
    Ok(())
}

fn queries_of(path: &Path, scenes: &BTreeMap<String, SceneLine>) -> Result<Vec<QueryLine>, TaskError> {
    let text = read(path)?;
    let said = |error: &dyn std::fmt::Display| TaskError::Usage(format!("{}: {error}", path.display()));
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("csv") => read_referit3d(&text, scenes).map_err(|error| said(&error)),
        Some("json") => read_scanrefer(&text, scenes).map_err(|error| said(&error)),
        _ => read_queries(&text).map_err(|error| said(&error)),
    }
}

fn write_lines<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), TaskError> {
    let mut lines = String::new();
    for row in rows {
        lines += &serde_json::to_string(row).map_err(|e| TaskError::Internal(e.to_string()))?;
        lines.push('\n');
    }
    write_atomically(path, lines.as_bytes()).map_err(TaskError::from)
}

fn read(path: &Path) -> Result<String, TaskError> {
    std::fs::read_to_string(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })
}

fn describe(measured: &Measured, classes: bool) -> String {
    let Measured { folds, report, backends, without } = measured;
    let mut text = String::new();
    for (dataset, tier) in &report.tiers {
        let _ = writeln!(text, "tier of {dataset}: {tier}");
    }
    if let Some(folds) = folds {
        let _ = writeln!(text, "weights: fitted on the other {} of {folds} folds of rooms", folds - 1);
    }
    let _ = writeln!(text, "{:<34} {:>6}  {:>14}  {:>6}", "", "%", "95 % interval", "N");
    for (key, rate) in &report.rates {
        text += &row(key, rate);
    }
    for BackendRow { backend, rates, seconds, cost } in backends.iter().filter(|_| backends.len() > 1) {
        let _ = writeln!(text, "backend {backend}: {seconds:.1} s of all queries");
        rates.iter().for_each(|(key, rate)| text += &row(key, rate));
        text += &tell_cost(cost.as_ref());
    }
    if let [BackendRow { cost: Some(cost), .. }] = backends.as_slice() {
        text += &tell_cost(Some(cost));
    }
    for (part, rates) in without {
        let _ = writeln!(text, "without {part}:");
        for (key, rate) in rates.iter().filter(|(key, _)| !key.contains('/') || key.ends_with("multiple")) {
            text += &row(key, rate);
        }
    }
    if classes {
        let _ = writeln!(text, "kinds of language, most wrong answers first:");
        let mut rows: Vec<(&String, &Rate)> = report.classes.iter().collect();
        rows.sort_by_key(|(_, rate)| std::cmp::Reverse(rate.count - rate.right));
        for (key, rate) in rows {
            text += &row(key, rate);
        }
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

fn row(key: &str, rate: &Rate) -> String {
    let interval = format!("[{:.1}, {:.1}]", rate.interval[0], rate.interval[1]);
    format!("{key:<34} {:>6.2}  {interval:>14}  {:>6}\n", rate.percent, rate.count)
}
