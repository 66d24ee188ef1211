//! What changed between two suites, by episode and seed.

use super::suite_file::SuiteFolder;
use super::suite_result::{Share, SuiteEpisode, describe, share, word};
use crate::summary::{Metrics, Stage};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// Version of what `--json` prints.
const COMPARISON_SCHEMA: u32 = 1;

/// How an episode and seed changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Change {
    /// It succeeded in the first suite and fails in the second.
    Worse,
    /// It failed in the first suite and succeeds in the second.
    Better,
    /// It fails in both, in another stage.
    OtherStage,
    /// It ends alike in both.
    Alike,
}

/// An episode and seed that both suites hold.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    /// As in the first suite.
    pub a: &'a SuiteEpisode,
    /// As in the second suite.
    pub b: &'a SuiteEpisode,
}

impl Pair<'_> {
    /// How it changed.
    pub(super) fn change(&self) -> Change {
        match (self.a.success, self.b.success) {
            (true, false) => Change::Worse,
            (false, true) => Change::Better,
            (false, false) if self.a.failed_stage != self.b.failed_stage => Change::OtherStage,
            _ => Change::Alike,
        }
    }
}

/// One suite of two.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Side {
    /// Its folder.
    folder: PathBuf,
    /// Successes of all its episodes.
    pub all: Share,
    /// Successes of those that the other suite holds, too.
    pub shared: Share,
}

/// How an episode ended.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Ending {
    success: bool,
    failed_stage: Option<Stage>,
    reason: Option<String>,
}

/// An episode that ends otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Changed {
    id: String,
    seed: u64,
    change: Change,
    a: Ending,
    b: Ending,
}

/// An episode that one suite holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Unpaired {
    /// Its name.
    pub id: String,
    /// Its seed.
    pub seed: u64,
}

/// A figure of the episodes that both suites hold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Figure {
    /// What it is, with its unit.
    pub name: &'static str,
    /// In the first suite.
    pub a: f64,
    /// In the second suite.
    pub b: f64,
    /// Pairs of episodes that it is made of.
    pub of: usize,
}

/// Two suites side by side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Comparison {
    schema: u32,
    /// The first suite.
    pub a: Side,
    /// The second suite.
    pub b: Side,
    /// Pairs that end alike with the same figures, to the last digit.
    pub identical: usize,
    /// Pairs that got worse.
    pub worse: usize,
    /// Pairs that got better.
    pub better: usize,
    /// Pairs that fail in another stage.
    pub other_stage: usize,
    /// How often chance alone would change at least so unevenly: the exact sign test on what got better or worse, both
    /// sides, 0 to 1.
    pub sign_test_p: f64,
    changes: Vec<Changed>,
    /// Failures by stage in both suites, over the pairs.
    pub failed_stages: BTreeMap<String, [usize; 2]>,
    /// Means over the pairs that succeed in both, and sums over all that came to their end in both.
    pub figures: Vec<Figure>,
    /// What the second suite does not hold.
    pub only_in_a: Vec<Unpaired>,
    /// What the first suite does not hold.
    pub only_in_b: Vec<Unpaired>,
}

/// The episodes and seeds that both suites hold, by name and seed.
pub(super) fn pairs<'a>(a: &'a [SuiteEpisode], b: &'a [SuiteEpisode]) -> Vec<Pair<'a>> {
    let others: BTreeMap<_, _> = b.iter().map(|episode| ((&episode.id, episode.seed), episode)).collect();
    a.iter().filter_map(|a| Some(Pair { a, b: others.get(&(&a.id, a.seed))? })).collect()
}

fn unpaired(all: &[SuiteEpisode], other: &[SuiteEpisode]) -> Vec<Unpaired> {
    let others: std::collections::BTreeSet<_> = other.iter().map(|episode| (&episode.id, episode.seed)).collect();
    let alone = all.iter().filter(|episode| !others.contains(&(&episode.id, episode.seed)));
    alone.map(|episode| Unpaired { id: episode.id.clone(), seed: episode.seed }).collect()
}

impl Comparison {
    /// Holds two suites side by side.
    pub(super) fn of(a: &SuiteFolder, b: &SuiteFolder) -> Self {
        let (first, second) = (&a.suite.episodes, &b.suite.episodes);
        let pairs = pairs(first, second);
        let count = |change| pairs.iter().filter(|pair| pair.change() == change).count();
        let (worse, better) = (count(Change::Worse), count(Change::Better));
        let side = |suite: &SuiteFolder, succeeds: &dyn Fn(&Pair<'_>) -> bool| Side {
            folder: suite.folder.clone(),
            all: share(suite.suite.totals.successes, suite.suite.totals.episodes),
            shared: share(pairs.iter().filter(|pair| succeeds(pair)).count(), pairs.len()),
        };
        Self {
            schema: COMPARISON_SCHEMA,
            a: side(a, &|pair| pair.a.success),
            b: side(b, &|pair| pair.b.success),
            identical: pairs.iter().filter(|pair| pair.a == pair.b).count(),
            worse,
            better,
            other_stage: count(Change::OtherStage),
            sign_test_p: sign_test(better, worse),
            changes: changes(&pairs),
            failed_stages: failed_stages(&pairs),
            figures: figures(&pairs),
            only_in_a: unpaired(first, second),
            only_in_b: unpaired(second, first),
        }
    }

    /// A table for people.
    pub(super) fn table(&self) -> String {
        let mut text = String::new();
        for changed in &self.changes {
            let stage = |ending: &Ending| ending.failed_stage.map_or("success".to_owned(), word);
            let reason = changed.b.reason.as_ref().or(changed.a.reason.as_ref());
            let _ = writeln!(
                text,
                "{:<11} {:<32} seed {:<4} {} -> {}  {}",
                changed.change.word(),
                changed.id,
                changed.seed,
                stage(&changed.a),
                stage(&changed.b),
                reason.map_or("", |reason| reason)
            );
        }
        let _ = writeln!(
            text,
            "\nA {}  {}\nB {}  {}",
            self.a.folder.display(),
            describe(&self.a.shared),
            self.b.folder.display(),
            describe(&self.b.shared)
        );
        let _ = writeln!(
            text,
            "{} in both: {} better, {} worse, {} fail in another stage, {} the same to the last digit; sign test p = {:.3}",
            self.a.shared.of, self.better, self.worse, self.other_stage, self.identical, self.sign_test_p
        );
        for (stage, [a, b]) in &self.failed_stages {
            let _ = writeln!(text, "failed in {stage:<12} {a} -> {b}");
        }
        for figure in &self.figures {
            let _ = writeln!(text, "{:<36} {:.2} -> {:.2} (N = {})", figure.name, figure.a, figure.b, figure.of);
        }
        if !(self.only_in_a.is_empty() && self.only_in_b.is_empty()) {
            let _ = writeln!(text, "{} only in A, {} only in B", self.only_in_a.len(), self.only_in_b.len());
        }
        text
    }
}

impl Change {
    /// In words for people.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Worse => "worse",
            Self::Better => "better",
            Self::OtherStage => "other stage",
            Self::Alike => "alike",
        }
    }
}

/// What ends otherwise: what got worse first.
fn changes(pairs: &[Pair<'_>]) -> Vec<Changed> {
    let ending =
        |e: &SuiteEpisode| Ending { success: e.success, failed_stage: e.failed_stage, reason: e.reason.clone() };
    let changed = |pair: &Pair<'_>| Changed {
        id: pair.a.id.clone(),
        seed: pair.a.seed,
        change: pair.change(),
        a: ending(pair.a),
        b: ending(pair.b),
    };
    let mut changes: Vec<Changed> = pairs.iter().filter(|pair| pair.change() != Change::Alike).map(changed).collect();
    changes.sort_by_key(|changed| changed.change);
    changes
}

fn failed_stages(pairs: &[Pair<'_>]) -> BTreeMap<String, [usize; 2]> {
    let mut stages: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for pair in pairs {
        for (i, episode) in [pair.a, pair.b].into_iter().enumerate() {
            if let Some(stage) = episode.failed_stage {
                stages.entry(word(stage)).or_default()[i] += 1;
            }
        }
    }
    stages
}

fn figures(pairs: &[Pair<'_>]) -> Vec<Figure> {
    let both = |pair: &Pair<'_>, value: fn(&Metrics) -> Option<f64>| {
        Some([value(pair.a.metrics.as_ref()?)?, value(pair.b.metrics.as_ref()?)?])
    };
    let values = |only_successes: bool, value| -> Vec<[f64; 2]> {
        let counts = |pair: &&Pair<'_>| !only_successes || pair.a.success && pair.b.success;
        pairs.iter().filter(counts).filter_map(|pair| both(pair, value)).collect()
    };
    let sum = |values: &[[f64; 2]], i: usize| values.iter().map(|pair| pair[i]).sum::<f64>();
    let mean = |name, value| {
        let values = values(true, value);
        let of = values.len();
        (of > 0).then(|| Figure { name, a: sum(&values, 0) / of as f64, b: sum(&values, 1) / of as f64, of })
    };
    let total = |name, value| {
        let values = values(false, value);
        Figure { name, a: sum(&values, 0), b: sum(&values, 1), of: values.len() }
    };
    let means = [
        mean("simulated time where both succeed, s", |m| Some(m.sim_time_s)),
        mean("path where both succeed, m", |m| Some(m.path_length_m)),
        mean("SPL where both succeed", |m| m.known_map_spl.or(m.spl)),
    ];
    let totals = [
        total("collisions", |m| Some(f64::from(m.collisions))),
        total("limit violations", |m| Some(f64::from(m.limit_violations))),
    ];
    means.into_iter().flatten().chain(totals).collect()
}

/// The exact sign test, both sides: chance of a split at least as uneven when better and worse are equally likely.
fn sign_test(better: usize, worse: usize) -> f64 {
    let n = better + worse;
    // The logarithm of C(n, i) / 2^n, from one i to the next, does not overflow.
    let mut ln_chance = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for i in 0..=better.min(worse) {
        tail += ln_chance.exp();
        ln_chance += ((n - i) as f64 / (i + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests;
