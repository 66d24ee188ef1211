//! The three attribute kinds of the paper: appearance, physical, affordance.

use super::votes::Votes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What an attribute speaks about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AttributeKind {
    /// a_a: colour, pattern, texture.
    Appearance,
    /// a_p: material, weight, smoothness, size.
    Physical,
    /// a_o: what it is for and how it is operated.
    Affordance,
}

/// Votes for the value of each attribute, for example `appearance.color -> {red: 12, orange: 1}`.
///
/// Keys in use: appearance `color`, `pattern`, `texture`; physical `material`, `weight`, `smoothness`, `size`;
/// affordance `use`, `operate` (these two may hold several true words at once).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Attributes {
    votes: BTreeMap<AttributeKind, BTreeMap<String, Votes>>,
}

impl Attributes {
    /// Adds one vote.
    pub fn add(&mut self, kind: AttributeKind, key: &str, word: &str, weight: f32) {
        self.votes.entry(kind).or_default().entry(key.to_owned()).or_default().add(word, weight);
    }

    /// Adds all votes of `other`.
    pub fn merge(&mut self, other: &Self) {
        for (kind, key, votes) in other.iter() {
            self.votes.entry(kind).or_default().entry(key.to_owned()).or_default().merge(votes);
        }
    }

    /// The votes for one attribute.
    pub fn find_votes(&self, kind: AttributeKind, key: &str) -> Option<&Votes> {
        self.votes.get(&kind)?.get(key)
    }

    /// The winning word of one attribute.
    pub fn find(&self, kind: AttributeKind, key: &str) -> Option<&str> {
        Some(self.find_votes(kind, key)?.find_winner()?.0)
    }

    /// All attributes in a fixed order.
    pub fn iter(&self) -> impl Iterator<Item = (AttributeKind, &str, &Votes)> {
        self.votes.iter().flat_map(|(&kind, keys)| keys.iter().map(move |(key, votes)| (kind, key.as_str(), votes)))
    }
}
