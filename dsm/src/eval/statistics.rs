//! Counts of single runs, and estimates with intervals over many.

use super::score::MapScore;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Draws of a bootstrap.
const DRAWS: usize = 2000;
/// Normal quantile of a two-sided 95 % interval.
const Z: f64 = 1.959_963_985;

/// Hits among a number of trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Share {
    /// Hits.
    pub hits: usize,
    /// Trials.
    pub count: usize,
}

/// A sum of measured values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mean {
    /// Sum.
    pub sum: f64,
    /// Number of values.
    pub count: usize,
}

/// Right, wrong and missed answers of a set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct F1Count {
    /// Said and true.
    pub right: usize,
    /// Said and not true.
    pub wrong: usize,
    /// True and not said.
    pub missed: usize,
}

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value: a share or F1 from 0 to 1, or a mean in the unit of its name.
    pub value: f64,
    /// Lower and upper end: Wilson's for shares, a percentile bootstrap over runs for means and F1; absent for these
    /// when there is one run.
    pub interval: Option<[f64; 2]>,
    /// Objects, relations or points behind it.
    pub count: usize,
}

/// Estimates over several runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapReport {
    /// Runs: pairs of scene and seed.
    pub runs: usize,
    /// By name, see [`MapScore`].
    pub estimates: BTreeMap<String, Estimate>,
}

impl Share {
    /// Counts one trial.
    pub fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.count += 1;
    }

    /// The share with Wilson's interval.
    pub fn estimate(&self) -> Estimate {
        if self.count == 0 {
            return Estimate { value: 0.0, interval: Some([0.0, 1.0]), count: 0 };
        }
        let n = self.count as f64;
        let p = self.hits as f64 / n;
        let center = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
        let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        let interval = Some([(center - half).max(0.0), (center + half).min(1.0)]);
        Estimate { value: p, interval, count: self.count }
    }
}

impl F1Count {
    /// 2 right / (2 right + wrong + missed); 0 when nothing was said or true.
    pub fn f1(&self) -> f64 {
        let all = 2 * self.right + self.wrong + self.missed;
        if all == 0 { 0.0 } else { 2.0 * self.right as f64 / all as f64 }
    }
}

/// Puts the scores of several runs together. Shares and F1 pool their counts; means count each value once.
pub fn pool(runs: &[MapScore]) -> MapReport {
    let mut estimates = BTreeMap::new();
    for key in keys(runs, |run| run.shares.keys()) {
        let add = |sum: Share, s: &Share| Share { hits: sum.hits + s.hits, count: sum.count + s.count };
        let share = runs.iter().filter_map(|run| run.shares.get(&key)).fold(Share::default(), add);
        estimates.insert(key, share.estimate());
    }
    for key in keys(runs, |run| run.means.keys()) {
        let parts: Vec<Mean> = runs.iter().filter_map(|run| run.means.get(&key)).copied().collect();
        let mean = |parts: &mut dyn Iterator<Item = &Mean>| {
            let (sum, count) = parts.fold((0.0, 0), |(sum, count), m| (sum + m.sum, count + m.count));
            sum / count.max(1) as f64
        };
        let count = parts.iter().map(|m| m.count).sum();
        estimates.insert(key, bootstrap(&parts, count, mean));
    }
    for key in keys(runs, |run| run.f1.keys()) {
        let parts: Vec<F1Count> = runs.iter().filter_map(|run| run.f1.get(&key)).copied().collect();
        let f1 = |parts: &mut dyn Iterator<Item = &F1Count>| {
            let sum = parts.fold(F1Count::default(), |sum, p| F1Count {
                right: sum.right + p.right,
                wrong: sum.wrong + p.wrong,
                missed: sum.missed + p.missed,
            });
            sum.f1()
        };
        let count = parts.iter().map(|p| p.right + p.missed).sum();
        estimates.insert(key, bootstrap(&parts, count, f1));
    }
    MapReport { runs: runs.len(), estimates }
}

fn keys<'a, I: Iterator<Item = &'a String>>(runs: &'a [MapScore], of: impl Fn(&'a MapScore) -> I) -> Vec<String> {
    let mut keys: Vec<String> = runs.iter().flat_map(of).cloned().collect();
    keys.sort();
    keys.dedup();
    keys
}

/// The value over all parts with the percentiles of what it is over parts drawn with replacement.
fn bootstrap<T>(parts: &[T], count: usize, value: impl Fn(&mut dyn Iterator<Item = &T>) -> f64) -> Estimate {
    let all = value(&mut parts.iter());
    if parts.len() < 2 {
        return Estimate { value: all, interval: None, count };
    }
    let mut random = ChaCha8Rng::seed_from_u64(parts.len() as u64);
    let mut values: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let drawn: Vec<usize> = parts.iter().map(|_| random.random_range(0..parts.len())).collect();
            value(&mut drawn.iter().map(|i| &parts[*i]))
        })
        .collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((share * DRAWS as f64) as usize).min(DRAWS - 1)];
    Estimate { value: all, interval: Some([at(0.025), at(0.975)]), count }
}

#[cfg(test)]
mod tests {
    //! Contract: the interval of a share is Wilson's; the bootstrap of equal runs has no width; F1 is the harmonic mean.
    use super::*;

    #[test]
    fn wilson_interval_of_nine_in_ten() {
        // Value from R: binom::binom.wilson(9, 10).
        let [low, high] = Share { hits: 9, count: 10 }.estimate().interval.unwrap();
        assert!((low - 0.5958).abs() < 1e-3 && (high - 0.9821).abs() < 1e-3, "{low} {high}");
    }

    #[test]
    fn runs_are_pooled_by_their_counts() {
        let run = |hits, sum| {
            let mut score = MapScore::default();
            score.shares.insert("a".into(), Share { hits, count: 4 });
            score.means.insert("b".into(), Mean { sum, count: 2 });
            score.f1.insert("c".into(), F1Count { right: 3, wrong: 1, missed: 2 });
            score
        };
        let report = pool(&[run(1, 2.0), run(3, 6.0)]);
        assert_eq!((report.estimates["a"].value, report.estimates["a"].count), (0.5, 8));
        assert_eq!((report.estimates["b"].value, report.estimates["b"].interval), (2.0, Some([1.0, 3.0])));
        let precision_recall: (f64, f64) = (0.75, 0.6);
        let harmonic = 2.0 * precision_recall.0 * precision_recall.1 / (precision_recall.0 + precision_recall.1);
        assert!((report.estimates["c"].value - harmonic).abs() < 1e-12);
        assert_eq!(report.estimates["c"].interval.map(|[a, b]| b - a), Some(0.0));
        assert_eq!(pool(&[run(1, 2.0)]).estimates["b"].interval, None);
    }
}
