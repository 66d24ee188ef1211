//! Parameters of grounding.

use super::query::AttributeWord;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Parameters of grounding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GroundConfig {
    /// Number of candidates that are verified (k of the paper). Default 3, range 1 to 20.
    pub top_k: usize,
    /// A constraint that scores below this for a candidate is violated by it. No unit, default 0.2, range 0.05 to 0.9.
    pub violated_below: f32,
    /// A rival whose score reaches this share of the best score makes the answer ambiguous. No unit, default 0.88, range 0.5 to 1.
    pub rival_share: f32,
    /// Score of a relation whose anchor is not in the map although its word is known: below `violated_below`, the
    /// target counts as absent. No unit, default 0.15, range 0.01 to 1.
    pub missing_anchor: f32,
    /// Score of a relation whose anchor has a name that nobody knows: it is ignored for all candidates alike.
    /// No unit, default 0.6, range 0.01 to 1.
    pub unknown_anchor: f32,
    /// Lowest score of a relation, so that one wrong edge does not outweigh everything. No unit, default 0.03, range 0.001 to 0.2.
    pub relation_floor: f32,
    /// Whether the thing that is meant is known to be in the map, as in tests over known boxes: relations compare the
    /// candidates with each other, and the best guess is given whenever anything bears the name. A robot does not know
    /// that. Default false.
    pub presume_present: bool,
    /// Whether the latent relation filter runs (off only for ablations). Default true.
    pub relation_filter: bool,
    /// Whether colour, pattern, shape and size count (off only for ablations). Default true.
    pub appearance: bool,
    /// Whether material and weight count (off only for ablations). Default true.
    pub physical: bool,
    /// Whether it counts what a thing is for (off only for ablations). Default true.
    pub affordance: bool,
    /// Whether candidates are verified in rendered views (off for ablations and where only geometry is known). Default true.
    pub verify: bool,
}

impl Default for GroundConfig {
    fn default() -> Self {
        Self {
            top_k: 3,
            violated_below: 0.2,
            rival_share: 0.88,
            missing_anchor: 0.15,
            unknown_anchor: 0.6,
            relation_floor: 0.03,
            presume_present: false,
            relation_filter: true,
            appearance: true,
            physical: true,
            affordance: true,
            verify: true,
        }
    }
}

/// A parameter outside its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("ground.{name} is {value}, expected {low} to {high}")]
pub struct GroundConfigError {
    /// The parameter.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Lowest valid value.
    pub low: f64,
    /// Highest valid value.
    pub high: f64,
}

impl GroundConfig {
    /// For referring expressions over known boxes: what is meant is there, and boxes have no points to be verified in.
    pub fn referring() -> Self {
        Self { presume_present: true, verify: false, ..Self::default() }
    }

    /// Whether attribute words of this sort count.
    pub(super) fn counts(&self, word: AttributeWord) -> bool {
        match word {
            AttributeWord::Color | AttributeWord::Pattern | AttributeWord::Shape | AttributeWord::Size => {
                self.appearance
            }
            AttributeWord::Material | AttributeWord::Weight => self.physical,
            AttributeWord::Purpose => self.affordance,
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first parameter that lies outside its range.
    pub fn validate(&self) -> Result<(), GroundConfigError> {
        let rows = [
            ("top_k", self.top_k as f64, 1.0, 20.0),
            ("violated_below", f64::from(self.violated_below), 0.05, 0.9),
            ("rival_share", f64::from(self.rival_share), 0.5, 1.0),
            ("missing_anchor", f64::from(self.missing_anchor), 0.01, 1.0),
            ("unknown_anchor", f64::from(self.unknown_anchor), 0.01, 1.0),
            ("relation_floor", f64::from(self.relation_floor), 0.001, 0.2),
        ];
        match rows.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => Err(GroundConfigError { name, value, low, high }),
            None => Ok(()),
        }
    }
}
