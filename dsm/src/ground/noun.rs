//! The noun of a phrase: its head among the words before a preposition or the end.

use super::query::{AttributeTerm, AttributeWord, Noun};
use super::words;
use crate::knowledge::{Knowledge, misspelling_distance, normalize, singular_of};
use std::collections::BTreeSet;

/// The head of a run of content words.
pub(super) struct Head {
    /// What it names.
    pub(super) noun: Noun,
    /// Index of its first word in the run; the words before describe it.
    pub(super) start: usize,
    /// Whether any list knows it.
    pub(super) known: bool,
    /// Whether it names a part or a group of what follows "of".
    pub(super) part_or_group: bool,
}

/// The names that the map's objects bear: known words, whatever the tables hold.
pub(super) struct Names {
    known: BTreeSet<String>,
    /// Whether what is described is known to be there.
    pub(super) lenient: bool,
}

impl Names {
    /// These names with their singular forms.
    pub(super) fn of<'n>(said: impl Iterator<Item = &'n str>, lenient: bool) -> Self {
        let mut names = BTreeSet::new();
        for name in said {
            let name = normalize(name);
            names.extend(singular_of(&name));
            names.insert(name);
        }
        names.remove("");
        Self { known: names, lenient }
    }

    /// Whether some object is called so, in singular or plural.
    pub(super) fn contain(&self, phrase: &str) -> bool {
        self.known.contains(phrase) || singular_of(phrase).iter().any(|singular| self.known.contains(singular))
    }

    /// The names, in alphabetical order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &str> {
        self.known.iter().map(String::as_str)
    }

    /// The shortest name that holds all words of a phrase: "bathroom stall door" for "stall door".
    pub(super) fn find_fuller(&self, phrase: &str) -> Option<&str> {
        let holds = |name: &&String| {
            phrase.split(' ').all(|word| name.split(' ').any(|part| part == word)) && name.len() > phrase.len()
        };
        self.known.iter().filter(holds).min_by_key(|name| name.len()).map(String::as_str)
    }

    /// The one name that a misspelt phrase comes close to.
    fn find_misspelt(&self, phrase: &str) -> Option<&str> {
        let mut close = self.known.iter().filter(|name| misspelling_distance(phrase, name).is_some());
        match (close.next(), close.next()) {
            (Some(only), None) => Some(only),
            _ => None,
        }
    }
}

/// Finds the head of a run of words: its longest ending that names something, else its last word.
///
/// English puts describing words first, so "black leather office chair" has the head "office chair". When the words
/// before the head's last word only describe it ("plastic bottle"), they stay descriptions.
pub(super) fn find_head(run: &[String], knowledge: &Knowledge, names: &Names) -> Head {
    let head = |noun, start, known| Head { noun, start, known, part_or_group: false };
    let last = run.len() - 1;
    if words::is_part_or_group(&run[last]) && run.len() == 1 {
        if names.lenient && matches!(run[last].as_str(), "surface" | "piece" | "kind" | "type") {
            return Head { part_or_group: true, ..head(Noun::Anything, last, false) };
        }
        return Head { part_or_group: true, ..head(Noun::Thing(run[last].clone()), last, false) };
    }
    for start in 0..run.len() {
        let phrase = run[start..].join(" ");
        // "the object is ..." speaks of any thing, even where something has no better name than "object".
        let vague = names.lenient && run.len() == 1 && words::is_anything(&phrase);
        if !vague && names.contain(&phrase) {
            return head(Noun::Thing(phrase), start, true);
        }
        if let Some(room) = knowledge.words().rooms.find(&phrase) {
            return head(Noun::Room(room.to_owned()), start, true);
        }
        if let Some(category) = knowledge.find_exact(&phrase) {
            let rest = run[start + 1..].join(" ");
            let only_described = start < last
                && find_attribute(&run[start], knowledge).is_some()
                && knowledge.find_exact(&rest).is_some_and(|same| same.name == category.name);
            if !only_described {
                return head(Noun::Thing(phrase), start, true);
            }
        }
        if knowledge.find_kind(&phrase).is_some() {
            return head(Noun::Thing(phrase), start, true);
        }
    }
    if words::is_anything(&run[last]) {
        return head(Noun::Anything, last, true);
    }
    // Misspelt: two words first, then one; but no word that means something else.
    let means_else = is_description(&run[last], knowledge);
    if names.lenient && !means_else && names.find_fuller(&run[last]).is_some() {
        return head(Noun::Thing(run[last].clone()), last, true);
    }
    for start in [last.saturating_sub(1), last].into_iter().filter(|_| !means_else) {
        let phrase = run[start..].join(" ");
        if let Some(name) = names.find_misspelt(&phrase) {
            return head(Noun::Thing(name.to_owned()), start, true);
        }
        if let Some(category) = knowledge.find_tolerant(&phrase) {
            return head(Noun::Thing(category.name.clone()), start, true);
        }
    }
    // "printer machine": the last word that names something.
    for start in (0..last).rev() {
        let known = (start + 1..=last).rev().find(|&end| knowledge.find_exact(&run[start..end].join(" ")).is_some());
        if let Some(end) = known {
            return head(Noun::Thing(run[start..end].join(" ")), start, true);
        }
    }
    // "the red": a description without a noun.
    if means_else {
        return head(Noun::Anything, run.len(), true);
    }
    head(Noun::Thing(run[last].clone()), last, false)
}

/// Words that describe and are spelt like things: "open" is no oven.
const DESCRIBING: [&str; 10] =
    ["open", "opened", "closed", "shaped", "colored", "coloured", "stacked", "wheeled", "lit", "empty"];

/// Whether a word says how or which a thing is, and not what.
pub(super) fn is_description(word: &str, knowledge: &Knowledge) -> bool {
    DESCRIBING.contains(&word)
        || words::find_ordinal(word).is_some()
        || words::find_superlative(word).is_some()
        || find_attribute(word, knowledge).is_some()
}

/// The attribute that a word states.
pub(super) fn find_attribute(word: &str, knowledge: &Knowledge) -> Option<AttributeTerm> {
    let lists = knowledge.words();
    let colored = word.strip_suffix("colored").or_else(|| word.strip_suffix("coloured")).unwrap_or(word);
    let tables = [
        (AttributeWord::Color, &lists.colors),
        (AttributeWord::Material, &lists.materials),
        (AttributeWord::Size, &lists.sizes),
        (AttributeWord::Shape, &lists.shapes),
        (AttributeWord::Pattern, &lists.patterns),
        (AttributeWord::Weight, &lists.weights),
    ];
    tables.into_iter().find_map(|(kind, list)| {
        list.find(colored).map(|word| AttributeTerm { kind, word: word.to_owned(), negated: false })
    })
}
