//! Ranking where the thing that is meant is known to be there.
//!
//! People's descriptions of a known scene are redundant, vague and often misread, so the candidates are ranked by a
//! weighted sum of all that speaks for them: the logarithms of the relation filter's constraints, other readings of
//! left, right and behind, and single words that no constraint has used. There is one weight per [`Kind`]; the weights
//! are fitted by `dsm eval grounding --fit`, and `--folds` says what they are worth on scenes they were not fitted on.

mod features;
mod fitted;
mod kind;
mod mentions;
mod said;

pub(super) use features::{Features, MENTIONED_FIT, features_of};
pub(super) use kind::Kind;
pub(super) use mentions::{Mention, find_mentions};

use kind::{COUNT, NAMES, UNFITTED};

/// One weight per kind of evidence.
#[derive(Clone, Debug, PartialEq)]
pub struct RankingWeights([f32; COUNT]);

impl RankingWeights {
    /// The weights that ship with the crate.
    pub fn fitted() -> Self {
        Self(fitted::FITTED)
    }

    /// Weights before anything was fitted: every constraint counts once, other readings and single words not at all.
    pub fn unfitted() -> Self {
        Self(UNFITTED)
    }

    /// From one number per name of [`names`](Self::names); `None` when the count differs or one is not finite.
    pub fn new(values: &[f32]) -> Option<Self> {
        let values: [f32; COUNT] = values.try_into().ok()?;
        values.iter().all(|value| value.is_finite()).then_some(Self(values))
    }

    /// Names of the kinds of evidence.
    pub fn names() -> &'static [&'static str] {
        &NAMES
    }

    /// The weights in order of [`names`](Self::names).
    pub fn values(&self) -> &[f32] {
        &self.0
    }

    /// Probabilities of the candidates, in order.
    pub(super) fn rank(&self, features: &Features) -> Vec<f32> {
        let sums: Vec<f32> =
            features.rows.iter().map(|row| row.iter().zip(&self.0).map(|(x, weight)| x * weight).sum()).collect();
        let best = sums.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let shares: Vec<f32> = sums.iter().map(|sum| (sum - best).exp()).collect();
        let total: f32 = shares.iter().sum();
        shares.into_iter().map(|share| share / total.max(1.0)).collect()
    }
}
