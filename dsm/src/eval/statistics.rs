//! Counts of single runs, and estimates with intervals over many.

use super::score::MapScore;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Draws of a bootstrap.
const DRAWS: usize = 2000;
/// Scenes from which their spread tells more than the number of things in them.
const LEAST_SCENES: usize = 5;
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

/// How an interval was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Percentiles over scenes drawn with replacement: things of one scene err alike.
    Scenes,
    /// Wilson's for shares, as if all trials were independent: for fewer than five scenes, and for shares that
    /// are 0 or 1 in every scene.
    Wilson,
}

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value: a share or F1 from 0 to 1, or a mean in the unit of its name.
    pub value: f64,
    /// Lower and upper end; absent for means and F1 of one scene.
    pub interval: Option<[f64; 2]>,
    /// How the interval was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// Objects, relations or points behind it.
    pub count: usize,
    /// Scenes behind it.
    #[serde(default)]
    pub scenes: usize,
}

/// Estimates over several runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapReport {
    /// Runs: pairs of scene and seed.
    pub runs: usize,
    /// Different scenes.
    pub scenes: usize,
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
        let method = Some(Method::Wilson);
        if self.count == 0 {
            return Estimate { value: 0.0, interval: Some([0.0, 1.0]), method, count: 0, scenes: 0 };
        }
        let n = self.count as f64;
        let p = self.hits as f64 / n;
        let center = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
        let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        let interval = Some([(center - half).max(0.0), (center + half).min(1.0)]);
        Estimate { value: p, interval, method, count: self.count, scenes: 0 }
    }
}

impl F1Count {
    /// 2 right / (2 right + wrong + missed); 0 when nothing was said or true.
    pub fn f1(&self) -> f64 {
        let all = 2 * self.right + self.wrong + self.missed;
        if all == 0 { 0.0 } else { 2.0 * self.right as f64 / all as f64 }
    }
}

/// What is pooled over the runs of one scene.
trait Pooled: Copy + Default {
    fn add(&mut self, other: &Self);
    fn value(&self) -> f64;
    fn count(&self) -> usize;
    /// The interval when scenes are too few to tell.
    fn fallback(&self) -> Option<Estimate> {
        None
    }
}

impl Pooled for Share {
    fn add(&mut self, other: &Self) {
        self.hits += other.hits;
        self.count += other.count;
    }

    fn value(&self) -> f64 {
        self.hits as f64 / self.count.max(1) as f64
    }

    fn count(&self) -> usize {
        self.count
    }

    fn fallback(&self) -> Option<Estimate> {
        Some(self.estimate())
    }
}

impl Pooled for Mean {
    fn add(&mut self, other: &Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    fn value(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }

    fn count(&self) -> usize {
        self.count
    }
}

impl Pooled for F1Count {
    fn add(&mut self, other: &Self) {
        self.right += other.right;
        self.wrong += other.wrong;
        self.missed += other.missed;
    }

    fn value(&self) -> f64 {
        self.f1()
    }

    fn count(&self) -> usize {
        self.right + self.missed
    }
}

fn total<'a, T: Pooled + 'a>(parts: impl Iterator<Item = &'a T>) -> T {
    parts.fold(T::default(), |mut sum, part| {
        sum.add(part);
        sum
    })
}

/// Puts the scores of several runs together, each with the name of its scene. Shares and F1 pool their counts; means count
/// each value once. Intervals take the scenes, not the things in them, for independent.
pub fn pool(runs: &[(&str, &MapScore)]) -> MapReport {
    let mut estimates = BTreeMap::new();
    gather(runs, |score| &score.shares, |key, parts| estimates.insert(key, estimate(&parts)));
    gather(runs, |score| &score.means, |key, parts| estimates.insert(key, estimate(&parts)));
    gather(runs, |score| &score.f1, |key, parts| estimates.insert(key, estimate(&parts)));
    MapReport { runs: runs.len(), scenes: scenes(runs).len(), estimates }
}

/// How much larger each value is with the first scores than with the second ones, which are of the same runs in the same
/// order. Intervals are of the difference itself: scenes are drawn with both of their scores.
pub fn compare(runs: &[(&str, &MapScore)], others: &[(&str, &MapScore)]) -> BTreeMap<String, Estimate> {
    let mut differences = BTreeMap::new();
    difference(runs, others, |score| &score.shares, &mut differences);
    difference(runs, others, |score| &score.means, &mut differences);
    difference(runs, others, |score| &score.f1, &mut differences);
    differences
}

fn difference<T: Pooled>(
    runs: &[(&str, &MapScore)],
    others: &[(&str, &MapScore)],
    of: impl Fn(&MapScore) -> &BTreeMap<String, T>,
    differences: &mut BTreeMap<String, Estimate>,
) {
    let mut first: BTreeMap<String, Vec<T>> = BTreeMap::new();
    gather(runs, &of, |key, parts| first.insert(key, parts));
    gather(others, &of, |key, parts| {
        let own = first.get(&key).filter(|own| own.len() == parts.len())?;
        let pairs: Vec<(T, T)> = own.iter().copied().zip(parts).collect();
        let value = |drawn: &mut dyn Iterator<Item = &(T, T)>| {
            let (mut one, mut two) = (T::default(), T::default());
            drawn.for_each(|(a, b)| {
                one.add(a);
                two.add(b);
            });
            one.value() - two.value()
        };
        let count = total(own.iter()).count();
        differences.insert(key, bootstrap(&pairs, count, value))
    });
}

/// Names of the scenes in order.
fn scenes<'a>(runs: &[(&'a str, &MapScore)]) -> Vec<&'a str> {
    let mut names: Vec<&str> = runs.iter().map(|(scene, _)| *scene).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// Hands out every value that any run has, pooled over the runs of each scene that has it.
fn gather<T: Pooled, R>(
    runs: &[(&str, &MapScore)],
    of: impl Fn(&MapScore) -> &BTreeMap<String, T>,
    mut take: impl FnMut(String, Vec<T>) -> R,
) {
    let mut by_key: BTreeMap<&String, BTreeMap<&str, T>> = BTreeMap::new();
    for (scene, score) in runs {
        for (key, value) in of(score) {
            by_key.entry(key).or_default().entry(scene).or_default().add(value);
        }
    }
    by_key.into_iter().for_each(|(key, by_scene)| {
        take(key.clone(), by_scene.into_values().collect());
    });
}

fn estimate<T: Pooled>(parts: &[T]) -> Estimate {
    let all = total(parts.iter());
    let drawn = bootstrap(parts, all.count(), |parts| total(parts).value());
    let settled = drawn.interval.is_some_and(|[low, high]| low < high) && parts.len() >= LEAST_SCENES;
    match all.fallback() {
        Some(wilson) if !settled => Estimate { scenes: parts.len(), ..wilson },
        _ => drawn,
    }
}

/// The value over all parts with the percentiles of what it is over parts drawn with replacement.
fn bootstrap<T>(parts: &[T], count: usize, value: impl Fn(&mut dyn Iterator<Item = &T>) -> f64) -> Estimate {
    let all = value(&mut parts.iter());
    let scenes = parts.len();
    if scenes < 2 {
        return Estimate { value: all, interval: None, method: None, count, scenes };
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
    Estimate { value: all, interval: Some([at(0.025), at(0.975)]), method: Some(Method::Scenes), count, scenes }
}

#[cfg(test)]
mod tests {
    //! Contract: the interval of a share is Wilson's when scenes are few and follows the scenes when they are many; the
    //! bootstrap of equal scenes has no width; F1 is the harmonic mean; a difference common to all scenes has no width.
    use super::*;

    fn run(hits: usize, sum: f64) -> MapScore {
        let mut score = MapScore::default();
        score.shares.insert("a".into(), Share { hits, count: 4 });
        score.means.insert("b".into(), Mean { sum, count: 2 });
        score.f1.insert("c".into(), F1Count { right: 3, wrong: 1, missed: 2 });
        score
    }

    #[test]
    fn wilson_interval_of_nine_in_ten() {
        // Value from R: binom::binom.wilson(9, 10).
        let [low, high] = Share { hits: 9, count: 10 }.estimate().interval.unwrap();
        assert!((low - 0.5958).abs() < 1e-3 && (high - 0.9821).abs() < 1e-3, "{low} {high}");
    }

    #[test]
    fn runs_are_pooled_by_their_counts() {
        let (one, two) = (run(1, 2.0), run(3, 6.0));
        let report = pool(&[("x", &one), ("y", &two)]);
        assert_eq!((report.estimates["a"].value, report.estimates["a"].count), (0.5, 8));
        assert_eq!(report.estimates["a"].method, Some(Method::Wilson));
        assert_eq!((report.estimates["b"].value, report.estimates["b"].interval), (2.0, Some([1.0, 3.0])));
        let precision_recall: (f64, f64) = (0.75, 0.6);
        let harmonic = 2.0 * precision_recall.0 * precision_recall.1 / (precision_recall.0 + precision_recall.1);
        assert!((report.estimates["c"].value - harmonic).abs() < 1e-12);
        assert_eq!(report.estimates["c"].interval.map(|[a, b]| b - a), Some(0.0));
        assert_eq!(pool(&[("x", &one)]).estimates["b"].interval, None);
        // Two seeds of one scene are one scene.
        let report = pool(&[("x", &one), ("x", &two)]);
        assert_eq!((report.runs, report.scenes, report.estimates["b"].interval), (2, 1, None));
    }

    #[test]
    fn scenes_that_differ_make_the_interval_wide() {
        let names: Vec<String> = (0..12).map(|i| format!("scene {i}")).collect();
        let whole = |good: usize| {
            let scores: Vec<MapScore> = (0..12).map(|i| run(if i < good { 4 } else { 0 }, 1.0)).collect();
            let runs: Vec<(&str, &MapScore)> = names.iter().map(String::as_str).zip(&scores).collect();
            pool(&runs).estimates["a"]
        };
        let half = whole(6);
        let [low, high] = half.interval.unwrap();
        let [wilson_low, wilson_high] = Share { hits: 24, count: 48 }.estimate().interval.unwrap();
        assert_eq!((half.method, half.scenes), (Some(Method::Scenes), 12));
        assert!(high - low > 1.5 * (wilson_high - wilson_low), "{low} {high}");
        // What never happened may still happen.
        let none = whole(0);
        assert_eq!(none.method, Some(Method::Wilson));
        assert!(none.interval.unwrap()[1] > 0.05);
    }

    #[test]
    fn a_difference_common_to_all_scenes_is_sure() {
        let names: Vec<String> = (0..6).map(|i| format!("scene {i}")).collect();
        let (better, worse): (Vec<_>, Vec<_>) =
            (0..6).map(|i| (run(3, f64::from(i)), run(2, f64::from(i) + 0.5))).unzip();
        let named = |scores: &[MapScore], compared: &[MapScore]| {
            let runs: Vec<(&str, &MapScore)> = names.iter().map(String::as_str).zip(scores).collect();
            let others: Vec<(&str, &MapScore)> = names.iter().map(String::as_str).zip(compared).collect();
            compare(&runs, &others)
        };
        let differences = named(&better, &worse);
        assert_eq!(differences["b"].value, -0.25);
        for (name, value) in [("a", 0.25), ("b", -0.25)] {
            let [low, high] = differences[name].interval.unwrap();
            assert!((low - value).abs() < 1e-9 && (high - value).abs() < 1e-9, "{name}: {low} {high}");
        }
    }
}
