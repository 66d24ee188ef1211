//! Categories and the knowledge that holds them.

use super::table;
use super::words::Words;
use std::collections::BTreeMap;
use thiserror::Error;

/// What is known about one category of things. All words are lower case; lists put the most specific or most likely first.
#[derive(Clone, Debug, PartialEq)]
pub struct Category {
    /// Canonical name, singular.
    pub name: String,
    /// Other names.
    pub synonyms: Vec<String>,
    /// What it is a kind of, most specific first; may name other categories.
    pub hypernyms: Vec<String>,
    /// Categories that look like it or do the same job, so that one is easily said for the other.
    pub similar: Vec<String>,
    /// Rooms in which it is usual.
    pub rooms: Vec<String>,
    /// Materials it is made of, most likely first.
    pub materials: Vec<String>,
    /// Typical mass in kilograms.
    pub mass_kg: Option<f64>,
    /// Smallest and largest plausible length of its longest side in metres.
    pub size_m: Option<[f64; 2]>,
    /// Usual extent from front to back in metres, for what stands or hangs with its back to a wall.
    pub depth_m: Option<f64>,
    /// What it is for: `sit`, `drink`, ...
    pub uses: Vec<String>,
    /// How it is operated: `pick up`, `open`, ...
    pub operate: Vec<String>,
    /// Whether a hand can pick it up as a rule.
    pub graspable: bool,
    /// Categories it is used together with.
    pub used_with: Vec<String>,
    /// Categories it is a part of.
    pub part_of: Vec<String>,
    /// Categories it is kept in or on.
    pub stored_in: Vec<String>,
}

impl Category {
    /// Whether it is the named category or a kind of it, for example an armchair is a `chair` and `furniture`.
    pub fn is_a(&self, name: &str) -> bool {
        self.name == name || self.hypernyms.iter().any(|hypernym| hypernym == name)
    }
}

/// Why a knowledge table cannot be used.
#[derive(Debug, Error)]
pub enum KnowledgeError {
    /// The text is not the TOML that is expected.
    #[error("{table}: {source}")]
    Format {
        /// Which table.
        table: &'static str,
        /// What is wrong and where.
        source: Box<toml::de::Error>,
    },
    /// The table was written for another version of the format.
    #[error("{table}: version {found} is not known, expected 1")]
    Version {
        /// Which table.
        table: &'static str,
        /// The version it states.
        found: u32,
    },
    /// A category names a kind that does not exist.
    #[error("category `{category}` has the unknown kind `{kind}`; known kinds: {known}")]
    UnknownKind {
        /// The category.
        category: String,
        /// Its kind.
        kind: String,
        /// All kinds.
        known: String,
    },
    /// Two categories claim one name.
    #[error("the name `{name}` belongs to both `{first}` and `{second}`")]
    DuplicateName {
        /// The name.
        name: String,
        /// One owner.
        first: String,
        /// The other owner.
        second: String,
    },
}

/// All categories and word lists, with fast look-up.
#[derive(Clone, Debug)]
pub struct Knowledge {
    pub(super) categories: Vec<Category>,
    /// Normalised name or synonym to index in `categories`.
    pub(super) index: BTreeMap<String, usize>,
    /// Normalised hypernym to the number of categories below it.
    pub(super) kinds: BTreeMap<String, usize>,
    words: Words,
}

impl Knowledge {
    /// The table that ships with the crate.
    pub fn embedded() -> Result<Self, KnowledgeError> {
        let categories = table::read_categories(include_str!("categories.toml"))?;
        let words = table::read_words(include_str!("words.toml"))?;
        Self::new(categories, words)
    }

    fn new(categories: Vec<Category>, words: Words) -> Result<Self, KnowledgeError> {
        let mut index: BTreeMap<String, usize> = BTreeMap::new();
        let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
        for (i, category) in categories.iter().enumerate() {
            for name in std::iter::once(&category.name).chain(&category.synonyms) {
                let name = super::wording::normalize(name);
                if let Some(other) = index.insert(name.clone(), i) {
                    return Err(KnowledgeError::DuplicateName {
                        name,
                        first: categories[other].name.clone(),
                        second: category.name.clone(),
                    });
                }
            }
            for hypernym in &category.hypernyms {
                *kinds.entry(super::wording::normalize(hypernym)).or_default() += 1;
            }
        }
        Ok(Self { categories, index, kinds, words })
    }

    /// All categories in alphabetical order.
    pub fn categories(&self) -> &[Category] {
        &self.categories
    }

    /// The word lists.
    pub fn words(&self) -> &Words {
        &self.words
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the embedded table loads, is large enough, and refers only to what it holds.
    use super::*;

    #[test]
    fn embedded_table_is_consistent() {
        let knowledge = Knowledge::embedded().unwrap();
        assert!(knowledge.categories().len() >= 150, "{}", knowledge.categories().len());
        let words = knowledge.words();
        for category in knowledge.categories() {
            let links = [&category.similar, &category.used_with, &category.part_of, &category.stored_in];
            for other in links.into_iter().flatten() {
                assert!(knowledge.index.contains_key(other), "{}: `{other}` is no category", category.name);
            }
            for room in &category.rooms {
                assert_eq!(words.rooms.find(room), Some(room.as_str()), "{}: room `{room}`", category.name);
            }
            for material in &category.materials {
                assert_eq!(words.materials.find(material), Some(material.as_str()), "{}: `{material}`", category.name);
            }
            let [smallest, largest] = category.size_m.unwrap();
            assert!(0.0 < smallest && smallest < largest, "{}", category.name);
            assert!(category.mass_kg.unwrap() > 0.0, "{}", category.name);
            assert!(category.depth_m.is_none_or(|depth| 0.0 < depth && depth < largest), "{}", category.name);
        }
    }
}
