//! Weighted votes for words.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How often each word was said, weighted by confidence. Ties go to the alphabetically first word.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Votes {
    counts: BTreeMap<String, f32>,
}

impl Votes {
    /// Adds `weight` to `word`.
    pub fn add(&mut self, word: &str, weight: f32) {
        match self.counts.get_mut(word) {
            Some(count) => *count += weight,
            None => {
                self.counts.insert(word.to_owned(), weight);
            }
        }
    }

    /// Adds all votes of `other`.
    pub fn merge(&mut self, other: &Self) {
        for (word, weight) in &other.counts {
            self.add(word, *weight);
        }
    }

    /// The word with the most votes and its share of all votes.
    pub fn find_winner(&self) -> Option<(&str, f32)> {
        let mut best: Option<(&str, f32)> = None;
        for (word, &count) in &self.counts {
            if best.is_none_or(|(_, most)| count > most) {
                best = Some((word, count));
            }
        }
        best.map(|(word, count)| (word, count / self.total()))
    }

    /// The share of `word`, 0 to 1.
    pub fn share(&self, word: &str) -> f32 {
        let total = self.total();
        if total > 0.0 { self.counts.get(word).copied().unwrap_or(0.0) / total } else { 0.0 }
    }

    /// Sum of all weights.
    pub fn total(&self) -> f32 {
        self.counts.values().sum()
    }

    /// Words and weights in alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f32)> {
        self.counts.iter().map(|(word, &weight)| (word.as_str(), weight))
    }
}
