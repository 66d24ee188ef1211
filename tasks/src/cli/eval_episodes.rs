//! `dsm eval episodes-grounding`: explores, maps, and grounds expressions that are made from the truth.

use super::eval_drives::{DriveArgs, Drives};
use super::run::catch_interrupt;
use super::{Output, ResultArgs};
use crate::assemble::knowledge;
use crate::error::TaskError;
use crate::language::{self, Language, LanguageCost, embedded, find_language, tell_cost};
use crate::run::RunSpec;
use crate::survey::{Condition, map_drive};
use dsm::build::BuildConfig;
use dsm::eval::{
    Answered, Estimate, GroundingReport, answer_expressions, compare_answers, make_expressions, pool_answers,
};
use dsm::ground::GroundConfig;
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Version of the report.
const SCHEMA: u32 = 2;

/// Arguments of `dsm eval episodes-grounding`.
#[derive(Debug, clap::Args)]
pub struct EpisodesArgs {
    #[command(flatten)]
    drives: DriveArgs,
    /// Deviation of the believed camera position along each axis, centimetres, correlated over 10 s; the default is that
    /// of the preset `noisy`, whose localiser stays within 3 cm.
    #[arg(long, value_name = "CM", default_value_t = 0.85)]
    pose_noise_cm: f64,
    /// Also ground without the relation filter, without it and each kind of attribute, and without verification.
    #[arg(long)]
    ablations: bool,
    /// Also ground by this backend: a file of models, which needs the feature `models`. May be given more than once; each
    /// gives a row.
    #[arg(long, value_name = "FILE")]
    backend: Vec<String>,
    /// List wrong answers, one line each.
    #[arg(long)]
    failures: bool,
    #[command(flatten)]
    result: ResultArgs,
}

/// The result.
#[derive(Serialize)]
struct Report {
    schema: u32,
    tier: &'static str,
    perception: String,
    pose_noise_cm: f64,
    maps: usize,
    /// Rates by row: `full`, and the ablations.
    rows: BTreeMap<String, GroundingReport>,
    /// How much higher each rate of `full` is than the row's, over the same expressions.
    gains: BTreeMap<String, GroundingReport>,
    /// What the models of the rows have cost.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    costs: BTreeMap<String, LanguageCost>,
    /// Every answer of the full row, by scene and seed.
    answers: BTreeMap<String, Vec<Answered>>,
}

/// Name, parameters and backend.
type Row = (String, GroundConfig, Arc<dyn Language>);

/// The rows of the table, in order of their names.
fn rows(ablations: bool, languages: &[Arc<dyn Language>]) -> Vec<Row> {
    let full = GroundConfig::default();
    let unfiltered = GroundConfig { relation_filter: false, ..full.clone() };
    let mut rows = vec![("full".to_owned(), full.clone(), embedded())];
    rows.extend(languages.iter().map(|language| (language.name().to_owned(), full.clone(), language.clone())));
    if ablations {
        let ablated = [
            ("without verification", GroundConfig { verify: false, ..full }),
            ("without relations and affordance", GroundConfig { affordance: false, ..unfiltered.clone() }),
            ("without relations and appearance", GroundConfig { appearance: false, ..unfiltered.clone() }),
            ("without relations and physical", GroundConfig { physical: false, ..unfiltered.clone() }),
            ("without relations", unfiltered),
        ];
        rows.extend(ablated.map(|(name, config)| (name.to_owned(), config, embedded())));
    }
    rows
}

/// Measures; code 0 once it has measured.
pub(super) fn run(args: EpisodesArgs) -> anyhow::Result<u8> {
    if !(0.0..=50.0).contains(&args.pose_noise_cm) {
        return Err(TaskError::Usage("--pose-noise-cm: expected 0 to 50".into()).into());
    }
    let drives = args.drives.prepare()?;
    let languages = args.backend.iter().map(|name| find_language(name)).collect::<Result<Vec<_>, TaskError>>()?;
    let rows = rows(args.ablations, &languages);
    let interrupted = catch_interrupt()?;
    let mut answers: BTreeMap<String, Vec<(&str, Vec<Answered>)>> = BTreeMap::new();
    let mut listed = BTreeMap::new();
    let bar = ProgressBar::with_draw_target(Some(drives.specs.len() as u64), ProgressDrawTarget::stderr());
    for spec in &drives.specs {
        let made = ground_drive(&drives, spec, args.pose_noise_cm, &rows, &interrupted)?;
        if interrupted.load(Ordering::Relaxed) {
            return Ok(130);
        }
        for (row, of_row) in made {
            if row == "full" {
                listed.insert(format!("{}-{}", spec.name, spec.seed), of_row.clone());
            }
            answers.entry(row).or_default().push((spec.name.as_str(), of_row));
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let by_row: BTreeMap<&str, Vec<(&str, &[Answered])>> = answers
        .iter()
        .map(|(row, runs)| (row.as_str(), runs.iter().map(|(scene, answers)| (*scene, answers.as_slice())).collect()))
        .collect();
    let full = by_row.get("full").map_or(&[][..], Vec::as_slice);
    let ablated = by_row.iter().filter(|(row, _)| **row != "full");
    let report = Report {
        schema: SCHEMA,
        tier: "own map",
        perception: drives.perception.clone(),
        pose_noise_cm: args.pose_noise_cm,
        maps: drives.specs.len(),
        rows: by_row.iter().map(|(row, runs)| ((*row).to_owned(), pool_answers(runs))).collect(),
        gains: ablated.map(|(row, runs)| ((*row).to_owned(), compare_answers(full, runs))).collect(),
        costs: languages.iter().filter_map(|language| Some((language.name().to_owned(), language.cost()?))).collect(),
        answers: listed,
    };
    Output::new(args.result).give(&report, || describe(&report, args.failures))?;
    Ok(0)
}

/// Explores or reads the drive, maps it, and grounds all expressions for every row.
fn ground_drive(
    drives: &Drives,
    spec: &RunSpec,
    pose_noise_cm: f64,
    rows: &[Row],
    interrupted: &Arc<AtomicBool>,
) -> Result<Vec<(String, Vec<Answered>)>, TaskError> {
    let knowledge = knowledge()?;
    let moments = drives.find(spec, interrupted)?;
    let condition = Condition { pose_noise_m: pose_noise_cm / 100.0, build: BuildConfig::default() };
    let (maps, truth) = map_drive(spec, &moments, &[condition])?;
    let expressions = make_expressions(&truth, &knowledge, spec.seed);
    let mut made = Vec::new();
    for (row, config, language) in rows {
        let grounder = language::grounder(&**language, config.clone())?;
        let answers = maps.iter().flat_map(|map| answer_expressions(map, &truth, &expressions, &grounder)).collect();
        made.push((row.clone(), answers));
    }
    Ok(made)
}

fn describe(report: &Report, failures: bool) -> String {
    let mut text = format!("tier: {}, {} maps, pose noise {} cm\n", report.tier, report.maps, report.pose_noise_cm);
    let line = |name: &str, estimate: &Estimate| {
        let interval = estimate.interval.map_or(String::new(), |[low, high]| format!("[{low:.4}, {high:.4}]"));
        let (value, count, scenes) = (estimate.value, estimate.count, estimate.scenes);
        format!("  {name:<26} {value:>8.4}  {interval:>18}  {count:>6} in {scenes} scenes\n")
    };
    for (row, table) in &report.rows {
        let _ = writeln!(text, "{row}");
        table.estimates.iter().for_each(|(name, estimate)| text.push_str(&line(name, estimate)));
    }
    report.costs.values().for_each(|cost| text += &tell_cost(Some(cost)));
    for (row, table) in &report.gains {
        let _ = writeln!(text, "full against {row}: how much higher");
        let said = |name: &str| ["right", "right/multiple", "right/unique", "absent_refused"].contains(&name);
        let gains = table.estimates.iter().filter(|(name, _)| said(name));
        gains.for_each(|(name, estimate)| text.push_str(&line(name, estimate)));
    }
    let wrong = |answered: &&Answered| match answered.expression.meant {
        dsm::eval::Meant::Thing(_) => !answered.right,
        dsm::eval::Meant::Absent => answered.status != dsm::ground::GroundingStatus::Absent,
        dsm::eval::Meant::Ambiguous => answered.status != dsm::ground::GroundingStatus::Ambiguous,
    };
    for (run, answers) in report.answers.iter().filter(|_| failures) {
        for answered in answers.iter().filter(wrong) {
            let Answered { expression, status, mapped, decided_by, .. } = answered;
            let mapped = if *mapped { "" } else { ", not mapped" };
            let _ =
                writeln!(text, "  {run}  {} `{}`: {status:?}{mapped}; {decided_by}", expression.kind, expression.text);
        }
    }
    text
}
