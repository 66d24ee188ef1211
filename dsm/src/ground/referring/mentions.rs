//! Things of the scene that a text mentions, whatever its grammar.

use super::super::scene::Scene;
use super::super::words;
use crate::knowledge::{Knowledge, normalize, singular_of};
use std::collections::{BTreeMap, BTreeSet};

/// Longest name, in words.
const MAX_WORDS: usize = 3;
/// Most mentions that are used.
const MAX_MENTIONS: usize = 8;

/// A name in the text and the things that bear it.
pub(in crate::ground) struct Mention {
    /// The name as said.
    pub(in crate::ground) phrase: String,
    /// The items, in ascending order.
    pub(in crate::ground) items: Vec<usize>,
}

/// All things that the text names by their own name, its plural or a synonym; the longest name at each place.
pub(in crate::ground) fn find_mentions(scene: &Scene<'_>, knowledge: &Knowledge, tokens: &[String]) -> Vec<Mention> {
    let mut bearers: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (i, item) in scene.items.iter().enumerate() {
        bearers.entry(normalize(item.object.name())).or_default().push(i);
    }
    let mut by_category: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (i, category) in scene.categories.iter().enumerate() {
        if let Some(category) = category {
            by_category.entry(category.name.as_str()).or_default().push(i);
        }
    }
    let find = |phrase: &str| -> Option<&Vec<usize>> {
        let own = bearers.get(phrase).or_else(|| singular_of(phrase).iter().find_map(|one| bearers.get(one)));
        own.or_else(|| knowledge.find_exact(phrase).and_then(|category| by_category.get(category.name.as_str())))
    };
    let mut mentions: Vec<Mention> = Vec::new();
    let mut seen = BTreeSet::new();
    let mut at = 0;
    while at < tokens.len() && mentions.len() < MAX_MENTIONS {
        let longest = MAX_WORDS.min(tokens.len() - at);
        let found = (1..=longest).rev().find_map(|length| {
            let run = &tokens[at..at + length];
            let named = !run.iter().any(|word| words::is_function_word(word) || words::is_anything(word));
            let phrase = run.join(" ");
            let items = if named { find(&phrase).cloned() } else { None };
            items.map(|items| (length, Mention { phrase, items }))
        });
        match found {
            Some((length, mention)) => {
                at += length;
                if seen.insert(mention.items.clone()) {
                    mentions.push(mention);
                }
            }
            None => at += 1,
        }
    }
    mentions
}
