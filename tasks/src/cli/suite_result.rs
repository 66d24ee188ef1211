//! What a suite comes to: one line per episode, sums with intervals, a table and a JUnit file.

use super::suite_parts::{Parts, Sequences, find_parts, sum_up};
use super::suite_recovery::{self, Recovery, find_recoveries};
use crate::summary::{Metrics, Stage, Summary};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Version of `suite.json`.
pub(super) const SUITE_SCHEMA: u32 = 1;
/// An object other than the targets counts as displaced from here on, metres.
const DISPLACED_M: f64 = 0.05;

/// One line of the suite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) struct SuiteEpisode {
    /// Name of the episode.
    pub id: String,
    /// Seed.
    pub seed: u64,
    /// Whether it succeeded.
    pub success: bool,
    /// The stage that failed.
    pub failed_stage: Option<Stage>,
    /// Why.
    pub reason: Option<String>,
    /// Metrics; null when it did not run to its end.
    pub metrics: Option<Metrics>,
    /// The skill of its last step; null when it did not run to its end.
    #[serde(default)]
    pub skill: Option<String>,
    /// Kinds of the disturbances that began.
    #[serde(default)]
    pub disturbances: Vec<String>,
    /// The parts of its sequence; null when it is none.
    #[serde(default)]
    pub parts: Option<Parts>,
}

/// A share with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub(super) struct Share {
    /// How many.
    pub count: usize,
    /// Of how many.
    pub of: usize,
    /// The share, 0 to 1.
    pub rate: f64,
    /// Wilson's interval, 95 %.
    pub interval: [f64; 2],
}

/// Sums over the suite.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(super) struct Totals {
    /// Episodes run.
    pub episodes: usize,
    /// Episodes that succeeded.
    pub successes: usize,
    /// Share of successes, 0 to 1.
    pub success_rate: f64,
    /// Wilson interval of the share, 95 %.
    pub success_interval: [f64; 2],
    /// Successes by the skill of the last step.
    pub by_skill: BTreeMap<String, Share>,
    /// Episodes by the stage in which they failed.
    failed_stages: BTreeMap<String, Share>,
    /// Mean of success weighted by path length, over the episodes that have a shortest path and begin with no map: those
    /// that explore first are in `known_map_spl`.
    spl: Option<f64>,
    /// Mean of the share of the way that was gone, weighted alike, over the same episodes.
    soft_spl: Option<f64>,
    /// Mean of the last step's success weighted by its path length, over the episodes that explore first.
    known_map_spl: Option<f64>,
    /// Successes among the episodes that explore first.
    with_known_map: Share,
    /// Collisions over all episodes.
    pub collisions: u32,
    /// Episodes with a collision.
    with_collision: Share,
    /// Episodes in which the hand touched a free object that the task does not name.
    with_others_touched: Share,
    /// Limit violations over all episodes.
    pub limit_violations: u32,
    /// Smallest distance between the robot's base and the world over all episodes, metres.
    min_clearance_m: Option<f64>,
    /// The farthest that an object other than a target was moved, metres.
    non_target_displacement_max_m: f64,
    /// Episodes in which such an object was moved by more than 5 cm.
    with_displacement: Share,
    /// Simulated time, seconds.
    pub sim_time_s: f64,
    /// Median of the simulated times, seconds.
    sim_time_median_s: Option<f64>,
    /// Driven path, metres.
    path_length_m: f64,
    /// What became of the episodes that were disturbed, by kind.
    by_disturbance: BTreeMap<String, Recovery>,
    /// What became of the sequences; null without any.
    sequences: Option<Sequences>,
}

/// `suite.json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(super) struct Suite {
    /// Version of this layout.
    schema: u32,
    /// Episodes sorted by name and seed.
    pub episodes: Vec<SuiteEpisode>,
    /// Sums.
    pub totals: Totals,
}

impl From<Summary> for SuiteEpisode {
    fn from(summary: Summary) -> Self {
        let begun = summary.truth.disturbances.iter().filter(|d| d.what.ends_with("begins"));
        let mut disturbances: Vec<String> =
            begun.filter_map(|d| d.what.split_whitespace().next().map(str::to_owned)).collect();
        disturbances.sort();
        disturbances.dedup();
        Self {
            parts: find_parts(&summary),
            disturbances,
            id: summary.episode,
            seed: summary.seed,
            success: summary.success,
            failed_stage: summary.failure.as_ref().map(|f| f.stage),
            reason: summary.failure.map(|f| f.reason),
            metrics: Some(summary.metrics),
            skill: summary.steps.last().map(|step| step.skill.clone()),
        }
    }
}

impl SuiteEpisode {
    /// The line of an episode that did not come to its end.
    pub(super) fn without_metrics(id: &str, seed: u64, stage: Stage, reason: String) -> Self {
        Self {
            id: id.to_owned(),
            seed,
            success: false,
            failed_stage: Some(stage),
            reason: Some(reason),
            metrics: None,
            skill: None,
            disturbances: Vec::new(),
            parts: None,
        }
    }

    fn known_map_spl(&self) -> Option<f64> {
        self.metrics.as_ref()?.known_map_spl
    }

    fn sim_time_s(&self) -> f64 {
        self.metrics.as_ref().map_or(0.0, |m| m.sim_time_s)
    }
}

impl Suite {
    /// Sums up; the episodes are sorted.
    pub(super) fn new(episodes: Vec<SuiteEpisode>) -> Self {
        Self { schema: SUITE_SCHEMA, totals: totals(&episodes), episodes }
    }

    /// Whether no episode failed.
    pub(super) fn all_succeed(&self) -> bool {
        self.totals.successes == self.totals.episodes
    }

    /// A table for people.
    pub(super) fn table(&self) -> String {
        let mut text = String::new();
        for e in &self.episodes {
            let mark = if e.success { "ok    " } else { "FAILED" };
            let _ = write!(text, "{mark} {:<32} seed {:<4} {:6.1} s", e.id, e.seed, e.sim_time_s());
            if let (Some(stage), Some(reason)) = (e.failed_stage, &e.reason) {
                let _ = write!(text, "  {}: {reason}", word(stage));
            }
            text.push('\n');
        }
        let t = &self.totals;
        let all = share(t.successes, t.episodes);
        let _ = writeln!(text, "\nsuccess                {}", describe(&all));
        for (skill, share) in &t.by_skill {
            let _ = writeln!(text, "  {skill:<20} {}", describe(share));
        }
        for (stage, share) in &t.failed_stages {
            let _ = writeln!(text, "failed in {stage:<12} {}", describe(share));
        }
        let figure = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
        let _ = writeln!(text, "SPL {}, soft SPL {} where nothing was known", figure(t.spl), figure(t.soft_spl));
        if t.with_known_map.of > 0 {
            let _ =
                writeln!(text, "SPL {} on a finished map, {}", figure(t.known_map_spl), describe(&t.with_known_map));
        }
        let _ = writeln!(text, "collisions {}, in {}", t.collisions, describe(&t.with_collision));
        let _ = writeln!(text, "the hand touched others in {}", describe(&t.with_others_touched));
        let _ =
            writeln!(text, "limit violations {}, least clearance {} m", t.limit_violations, figure(t.min_clearance_m));
        let _ = writeln!(
            text,
            "others moved at most {:.3} m; by more than {DISPLACED_M} m in {}",
            t.non_target_displacement_max_m,
            describe(&t.with_displacement)
        );
        let median = t.sim_time_median_s.unwrap_or(0.0);
        let _ =
            writeln!(text, "simulated {:.0} s, median {median:.1} s; driven {:.0} m", t.sim_time_s, t.path_length_m);
        text.push_str(&suite_recovery::table(&t.by_disturbance));
        if let Some(sequences) = &t.sequences {
            let _ = writeln!(
                text,
                "sequences complete {}\nparts done {}\naccounts true {}",
                describe(&sequences.complete),
                describe(&sequences.parts),
                describe(&sequences.truthful)
            );
        }
        text
    }

    /// A JUnit file; its times are simulated.
    pub(super) fn junit(&self) -> String {
        let t = &self.totals;
        let crashes = self.episodes.iter().filter(|e| e.failed_stage == Some(Stage::Crash)).count();
        let counts = format!(
            "tests=\"{}\" failures=\"{}\" errors=\"{crashes}\" time=\"{:.2}\"",
            t.episodes,
            t.episodes - t.successes - crashes,
            t.sim_time_s
        );
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"dsm\" {counts}>\n<testsuite name=\"dsm\" {counts}>\n"
        );
        for e in &self.episodes {
            let (id, time) = (escape(&e.id), e.sim_time_s());
            let _ = write!(text, "  <testcase classname=\"{id}\" name=\"seed {}\" time=\"{time:.2}\"", e.seed);
            if e.success {
                text.push_str("/>\n");
                continue;
            }
            let kind = if e.failed_stage == Some(Stage::Crash) { "error" } else { "failure" };
            let stage = e.failed_stage.map_or(String::new(), word);
            let reason = escape(e.reason.as_deref().unwrap_or(""));
            let _ = writeln!(text, "><{kind} type=\"{stage}\" message=\"{reason}\"/></testcase>");
        }
        text.push_str("</testsuite>\n</testsuites>\n");
        text
    }
}

/// Text for an XML attribute; characters that XML does not allow are left out.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\n' | '\r' | '\t' => escaped.push(' '),
            c if c < ' ' || matches!(c, '\u{fffe}' | '\u{ffff}') => {}
            c => escaped.push(c),
        }
    }
    escaped
}

/// The stage as `suite.json` writes it.
pub(super) fn word(stage: Stage) -> String {
    let value = serde_json::to_value(stage).ok();
    value.as_ref().and_then(|value| value.as_str()).unwrap_or("unknown").to_owned()
}

pub(super) fn describe(share: &Share) -> String {
    let [rate, low, high] = [share.rate, share.interval[0], share.interval[1]].map(|v| 100.0 * v);
    format!("{} of {} ({rate:.1} %, 95 % interval {low:.1} to {high:.1} %)", share.count, share.of)
}

fn totals(episodes: &[SuiteEpisode]) -> Totals {
    let n = episodes.len();
    let successes = episodes.iter().filter(|e| e.success).count();
    let metrics = || episodes.iter().filter_map(|e| e.metrics.as_ref());
    let all = share(successes, n);
    let mean = |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let mut by_skill: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    let mut failed_stages: BTreeMap<String, usize> = BTreeMap::new();
    for episode in episodes {
        if let Some(skill) = &episode.skill {
            let (good, of) = by_skill.entry(skill.clone()).or_default();
            (*good, *of) = (*good + usize::from(episode.success), *of + 1);
        }
        if let Some(stage) = episode.failed_stage {
            *failed_stages.entry(word(stage)).or_default() += 1;
        }
    }
    let mut times: Vec<f64> = metrics().map(|m| m.sim_time_s).collect();
    times.sort_by(f64::total_cmp);
    Totals {
        episodes: n,
        successes,
        success_rate: all.rate,
        success_interval: all.interval,
        by_skill: by_skill.into_iter().map(|(skill, (good, of))| (skill, share(good, of))).collect(),
        failed_stages: failed_stages.into_iter().map(|(stage, count)| (stage, share(count, n))).collect(),
        spl: mean(metrics().filter(|m| m.known_map_spl.is_none()).filter_map(|m| m.spl).collect()),
        soft_spl: mean(metrics().filter(|m| m.known_map_spl.is_none()).filter_map(|m| m.soft_spl).collect()),
        known_map_spl: mean(metrics().filter_map(|m| m.known_map_spl).collect()),
        with_known_map: share(
            episodes.iter().filter(|e| e.success && e.known_map_spl().is_some()).count(),
            episodes.iter().filter(|e| e.known_map_spl().is_some()).count(),
        ),
        collisions: metrics().map(|m| m.collisions).sum(),
        with_collision: share(metrics().filter(|m| m.collisions > 0).count(), n),
        with_others_touched: share(metrics().filter(|m| m.others_touched > 0).count(), n),
        limit_violations: metrics().map(|m| m.limit_violations).sum(),
        min_clearance_m: metrics().filter_map(|m| m.min_clearance_m).min_by(f64::total_cmp),
        non_target_displacement_max_m: metrics().map(|m| m.non_target_displacement_max_m).fold(0.0, f64::max),
        with_displacement: share(metrics().filter(|m| m.non_target_displacement_max_m > DISPLACED_M).count(), n),
        sim_time_s: metrics().map(|m| m.sim_time_s).sum(),
        sim_time_median_s: times.get(times.len() / 2).copied(),
        path_length_m: metrics().map(|m| m.path_length_m).sum(),
        by_disturbance: find_recoveries(episodes),
        sequences: sum_up(episodes),
    }
}

pub(super) fn share(count: usize, of: usize) -> Share {
    Share { count, of, rate: count as f64 / of.max(1) as f64, interval: wilson(count, of) }
}

/// Wilson's score interval of a share at 95 %.
fn wilson(successes: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (n, z) = (n as f64, 1.959_963_985);
    let p = successes as f64 / n;
    let center = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    [(center - half).max(0.0), (center + half).min(1.0)]
}

#[cfg(test)]
mod tests;
