//! What is commonly known about household things: a compact table that ships with the crate.
//!
//! `categories.toml` gives each category its synonyms, hypernyms, rooms, materials, mass, size, uses and partners;
//! `words.toml` the words for colours, materials, sizes, shapes, patterns, rooms and purposes. Both are priors: what the
//! map observed always outweighs them.

mod category;
mod lookup;
mod room_names;
mod table;
mod whereabouts;
mod wording;
mod words;

pub use category::{Category, Knowledge, KnowledgeError};
pub use lookup::Meaning;
pub(crate) use lookup::misspelling_distance;
pub use room_names::RoomScores;
pub use whereabouts::Whereabouts;
pub use wording::{normalize, singular_of};
pub use words::{ColorPrototype, WordList, Words};
