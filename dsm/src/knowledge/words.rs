//! Lists of describing words.

use super::wording::normalize;
use std::collections::{BTreeMap, BTreeSet};

/// Words of one sort; each synonym leads to its canonical word.
#[derive(Clone, Debug, Default)]
pub struct WordList {
    canonical_of: BTreeMap<String, String>,
    canonical: Vec<String>,
}

/// What a colour word looks like on a well-lit matt surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColorPrototype {
    /// Canonical colour word.
    pub name: String,
    /// Its sRGB colour.
    pub srgb: [u8; 3],
}

/// All word lists.
#[derive(Clone, Debug)]
pub struct Words {
    /// Colours.
    pub colors: WordList,
    /// One prototype per colour, in alphabetical order.
    pub prototypes: Vec<ColorPrototype>,
    /// Materials.
    pub materials: WordList,
    /// Sizes: large, small, tall, short, long, wide, narrow, thick.
    pub sizes: WordList,
    /// Shapes.
    pub shapes: WordList,
    /// Surface patterns.
    pub patterns: WordList,
    /// Heavy and light.
    pub weights: WordList,
    /// Room names; `room` stands for any.
    pub rooms: WordList,
    /// Purposes: `sit`, `drink`, ... as in [`super::Category::uses`].
    pub purposes: WordList,
    /// Categories of which a room of a name rarely has none.
    pub room_marks: BTreeMap<String, Vec<String>>,
    /// Names of rooms that may well hold nothing of what marks them.
    pub unmarked_rooms: BTreeSet<String>,
    /// Names that several rooms of one home often bear.
    pub repeated_rooms: BTreeSet<String>,
}

impl WordList {
    pub(super) fn new(rows: impl IntoIterator<Item = (String, Vec<String>)>) -> Self {
        let mut list = Self::default();
        for (word, synonyms) in rows {
            for synonym in &synonyms {
                list.canonical_of.insert(normalize(synonym), word.clone());
            }
            list.canonical_of.insert(normalize(&word), word.clone());
            list.canonical.push(word);
        }
        list
    }

    /// The canonical word of a word or synonym, whatever its case.
    pub fn find(&self, word: &str) -> Option<&str> {
        match self.canonical_of.get(word) {
            Some(canonical) => Some(canonical),
            None => self.canonical_of.get(&normalize(word)).map(String::as_str),
        }
    }

    /// All canonical words in alphabetical order.
    pub fn canonical(&self) -> &[String] {
        &self.canonical
    }
}
