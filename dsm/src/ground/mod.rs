//! DSM-Grounding: from words to one object or room of the map.
//!
//! ```text
//! text ──parse──▶ Query ──retrieve──▶ noun and attribute scores ──filter──▶ top-k ──verify──▶ Grounding
//! ```
//!
//! The query is a tree of entities and relations. Candidates are retrieved by all their name votes, kinds and
//! attributes ([`Noun`], [`AttributeTerm`]); relations are scored softly and jointly over the target and its anchors;
//! the best few are verified in views rendered from the map's own points. The answer names what decided. Only stable
//! objects count. It runs without a network, and the same inputs give the same answer.
//!
//! ```
//! use dsm::ground::{GroundConfig, Grounder, GroundingStatus};
//! use dsm::knowledge::Knowledge;
//! use dsm::map::Map;
//! use std::sync::Arc;
//!
//! let grounder = Grounder::new(GroundConfig::default(), Arc::new(Knowledge::embedded()?))?;
//! let answer = grounder.ground(&Map::new(0.05), "the red apple on the table", None);
//! assert_eq!(answer.status, GroundingStatus::Absent);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod anchors;
mod answer;
mod backend;
mod bounds;
mod clauses;
mod color;
mod command;
mod command_words;
mod config;
mod constraint;
mod decide;
mod filter;
mod founded;
mod grounder;
mod lexicon;
mod likeness;
mod modifiers;
mod noun;
mod parse;
mod part;
mod plugged;
mod query;
mod reader;
mod referring;
mod relate;
mod retrieve;
mod rooms;
mod scene;
mod scorer;
mod select;
mod sequence;
mod spoken_names;
mod subject;
mod verify;
mod viewpoint;
mod views;
mod words;

#[cfg(test)]
mod tests;

pub use answer::{Candidate, Grounding, GroundingStatus, ReferenceFrame};
pub use backend::{BackendError, GroundingStage, LEAST_FACTOR, Spoken};
pub use command::{Action, Command, Unparsed, parse_command};
pub use config::{GroundConfig, GroundConfigError};
pub use grounder::{Grounder, Ranking};
pub use part::{Part, PartKind, PartPlace};
pub use query::{
    Article, AttributeTerm, AttributeWord, Entity, Noun, Order, Query, RelationTerm, RelationWord, Selection, Viewpoint,
};
pub use reader::{EmbeddedReader, QueryReader, QueryText};
pub use referring::RankingWeights;
pub use scorer::{RelatedCandidate, RelationScorer};
pub use sequence::split_sequence;
pub use verify::{EmbeddedVerifier, Evidence, Verdict, Verifier, find_color_share};
pub use views::{CandidateViews, Levels};
