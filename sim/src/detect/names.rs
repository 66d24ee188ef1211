//! What the simulated detector confuses, and other words that it uses.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use std::collections::BTreeMap;

const TABLE: &str = include_str!("../../data/lookalikes.toml");

/// Look-alike groups and synonyms; known to the simulation alone.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Names {
    #[serde(rename = "version")]
    _version: u32,
    groups: Vec<Vec<String>>,
    synonyms: BTreeMap<String, Vec<String>>,
}

impl Names {
    /// The table of this crate.
    pub(super) fn embedded() -> Self {
        // A test parses the embedded table, so that this never falls back.
        toml::from_str(TABLE).unwrap_or_default()
    }

    /// Another member of a group of `category`; `None` when nothing looks like it.
    pub(super) fn find_lookalike(&self, category: &str, stream: &mut ChaCha8Rng) -> Option<&str> {
        let group = self.groups.iter().find(|group| group.iter().any(|name| name == category))?;
        let others: Vec<&String> = group.iter().filter(|name| *name != category).collect();
        (!others.is_empty()).then(|| others[stream.random_range(0..others.len())].as_str())
    }

    /// Another word for `category`; `None` when there is none.
    pub(super) fn find_synonym(&self, category: &str, stream: &mut ChaCha8Rng) -> Option<&str> {
        let words = self.synonyms.get(category).filter(|words| !words.is_empty())?;
        Some(words[stream.random_range(0..words.len())].as_str())
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the embedded table is valid and knows the common things of a flat.
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_embedded_table_parses_and_never_confuses_a_thing_with_itself() {
        let names: Names = toml::from_str(TABLE).expect("valid");
        let mut stream = ChaCha8Rng::seed_from_u64(1);
        for category in ["apple", "book", "mug", "chair", "shelf", "cabinet", "computer desk"] {
            let other = names.find_lookalike(category, &mut stream).expect("has look-alikes");
            assert_ne!(other, category);
            assert!(names.find_synonym(category, &mut stream).is_some(), "{category}");
        }
        assert_eq!(names.find_lookalike("zebra", &mut stream), None);
        for (category, words) in &names.synonyms {
            assert!(!words.is_empty() && !words.contains(category), "{category}");
        }
    }
}
