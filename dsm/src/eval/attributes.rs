//! Names and attributes of matched objects against the words of the scene's author, beside what the category alone says.
//!
//! Words are compared after the synonyms of the knowledge table ("silver" is gray, "porcelain" ceramic). Only objects
//! whose author gave a word count.
//!
//! - colour: the winning word. Things that their author calls multicolored have no one colour and are left out.
//! - material: the winning word; the baseline is the likeliest material of the category that the map names.
//! - pattern: plain or not; what the author gave no pattern and one colour is plain. The baseline is `plain` always.
//! - weight: light, medium or heavy; the baseline is the class of the category's typical mass.
//! - affordances: F1 over the words of uses and of how it is operated, among those that the author of the scene uses at all:
//!   who only says what opens has not said that nobody drinks from mugs. `affordance_open` counts every word. The baseline is
//!   the category's own list.
//!
//! The baseline of colour is the commonest true colour of the scene: more than a prior could know.

use super::scene::{TrueScene, TrueThing};
use super::statistics::{F1Count, Share};
use crate::knowledge::{Category, Knowledge, WordList};
use crate::map::{AttributeKind, MapObject};
use std::collections::{BTreeMap, BTreeSet};

/// What matched objects got right.
#[derive(Clone, Debug, Default)]
pub(super) struct AttributeCounts {
    /// By attribute, and with `_prior` for its baseline.
    pub(super) shares: BTreeMap<&'static str, Share>,
    /// Affordances, and their baseline.
    pub(super) affordance: F1Count,
    pub(super) affordance_prior: F1Count,
    /// Affordances, where words that the author never uses count as wrong.
    pub(super) affordance_open: F1Count,
    /// Things whose affordances are not as they should be, one line each.
    pub(super) faults: Vec<String>,
}

/// Words that mean the same affordance, canonical first.
const SAME_AFFORDANCE: [(&str, &[&str]); 11] = [
    ("move", &["push"]),
    ("play", &["roll"]),
    ("pick up", &["grasp", "lift", "hold", "carry"]),
    ("lie", &["lie on", "sleep"]),
    ("look at", &["see", "decorate", "view"]),
    ("work", &["work at", "write"]),
    ("cook", &["heat"]),
    ("store", &["contain", "keep", "fill"]),
    ("walk on", &["step on"]),
    ("support", &["put things on", "place on"]),
    ("type", &["press"]),
];

fn canonical(list: &WordList, word: &str) -> String {
    let last = word.split_whitespace().last().unwrap_or(word);
    list.find(word).or_else(|| list.find(last)).unwrap_or(word).to_owned()
}

fn material(knowledge: &Knowledge, word: &str) -> String {
    if word == "cloth" { "fabric".to_owned() } else { canonical(&knowledge.words().materials, word) }
}

fn affordance(word: &str) -> &str {
    SAME_AFFORDANCE.iter().find(|(_, others)| others.contains(&word)).map_or(word, |(first, _)| first)
}

/// The class of a typical mass.
fn weight_class(mass_kg: f64) -> &'static str {
    match mass_kg {
        m if m < 0.5 => "light",
        m if m < 5.0 => "medium",
        _ => "heavy",
    }
}

fn is_plain(thing: &TrueThing) -> bool {
    let plain = thing.attributes.pattern.as_deref().is_none_or(|pattern| pattern == "plain");
    plain && thing.attributes.color.as_deref() != Some("multicolored")
}

/// Words of one set that the other lacks.
fn list_missing(first: &BTreeSet<&str>, second: &BTreeSet<&str>) -> String {
    first.difference(second).copied().collect::<Vec<_>>().join(", ")
}

fn compare_affordances(count: &mut F1Count, said: &BTreeSet<&str>, real: &BTreeSet<&str>) {
    count.right += said.intersection(real).count();
    count.wrong += said.difference(real).count();
    count.missed += real.difference(said).count();
}

/// Compares all matched pairs.
pub(super) fn compare(knowledge: &Knowledge, truth: &TrueScene, pairs: &[(&MapObject, &TrueThing)]) -> AttributeCounts {
    let mut counts = AttributeCounts::default();
    let authored = truth.objects.iter().flat_map(|thing| &thing.attributes.affordances);
    let authored: BTreeSet<&str> = authored.map(|word| affordance(word)).collect();
    let colors = |word: &str| canonical(&knowledge.words().colors, word);
    let true_color = |thing: &TrueThing| thing.attributes.color.as_deref().filter(|c| *c != "multicolored").map(colors);
    let mut common: BTreeMap<String, usize> = BTreeMap::new();
    pairs.iter().filter_map(|(_, thing)| true_color(thing)).for_each(|color| *common.entry(color).or_default() += 1);
    let commonest = common.iter().max_by_key(|(_, count)| **count).map(|(color, _)| color.clone());
    for (object, thing) in pairs {
        let category: Option<&Category> = knowledge.find(object.name());
        let mut add = |name: &'static str, hit: bool| counts.shares.entry(name).or_default().add(hit);
        add("name", category.map(|c| &c.name) == knowledge.find(&thing.category).map(|c| &c.name));
        let found = |kind, key| object.attributes.find(kind, key);
        if let Some(real) = true_color(thing) {
            add("color", found(AttributeKind::Appearance, "color").map(colors).as_ref() == Some(&real));
            add("color_prior", commonest.as_ref() == Some(&real));
        }
        if let Some(real) = thing.attributes.material.as_deref().map(|word| material(knowledge, word)) {
            let said = found(AttributeKind::Physical, "material").map(|word| material(knowledge, word));
            add("material", said.as_ref() == Some(&real));
            let prior = category.and_then(|c| c.materials.first()).map(|word| material(knowledge, word));
            add("material_prior", prior.as_ref() == Some(&real));
        }
        let plain = found(AttributeKind::Appearance, "pattern").is_none_or(|pattern| pattern == "plain");
        add("pattern", plain == is_plain(thing));
        add("pattern_prior", is_plain(thing));
        if let Some(real) = thing.attributes.weight.as_deref() {
            add("weight", found(AttributeKind::Physical, "weight") == Some(real));
            add("weight_prior", category.and_then(|c| c.mass_kg).map(weight_class) == Some(real));
        }
        if !thing.attributes.affordances.is_empty() {
            let real: BTreeSet<&str> = thing.attributes.affordances.iter().map(|word| affordance(word)).collect();
            let said = ["use", "operate"].into_iter().filter_map(|key| {
                let votes = object.attributes.find_votes(AttributeKind::Affordance, key)?;
                let most = votes.iter().map(|(_, weight)| weight).fold(0.0, f32::max);
                // Words of a name that was said now and then only do not count.
                Some(votes.iter().filter(move |(_, weight)| *weight >= 0.5 * most).map(|(word, _)| affordance(word)))
            });
            let all: BTreeSet<&str> = said.flatten().collect();
            let said: BTreeSet<&str> = all.intersection(&authored).copied().collect();
            compare_affordances(&mut counts.affordance, &said, &real);
            compare_affordances(&mut counts.affordance_open, &all, &real);
            if said != real {
                counts.faults.push(format!(
                    "affordances: {} (truth {}): missed {}; wrong {}",
                    object.name(),
                    thing.category,
                    list_missing(&real, &said),
                    list_missing(&said, &real)
                ));
            }
            let prior = category.into_iter().flat_map(|c| c.uses.iter().chain(&c.operate)).map(|word| affordance(word));
            let prior = prior.filter(|word| authored.contains(word));
            compare_affordances(&mut counts.affordance_prior, &prior.collect(), &real);
        }
    }
    counts
}
