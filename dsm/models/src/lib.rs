//! Language and vision-language models behind the traits of `dsm`: any server that speaks OpenAI's `chat/completions`.
//!
//! ```text
//! trait of dsm ──▶ question (task, data, pictures, form) ──▶ client: cache, budget, server ──▶ JSON ──check──▶ answer
//!                                                                └── any failure: the embedded backend answers ──┘
//! ```
//!
//! Invariants:
//! - A model's output is data. It may choose among the ids that it was given, words of closed lists and short names;
//!   everything else is refused as a whole, the model is asked once to repair it, and then the embedded backend answers.
//! - Words from scenes, maps, people and models reach a prompt only as JSON strings in its data.
//! - Every question ends within `total_timeout_s`, and nothing that a robot's control depends on waits for one.
//! - The key comes from the environment and goes into one header. It stands in no file, record, cache or error.
//! - Only [`wall`] knows wall time and the environment, and only one file the HTTP library.
//!
//! It does not know that a robot or a simulator exists.
//!
//! ```
//! use dsm_models::{Client, LanguageReader, LanguageSettings};
//! use dsm::ground::{GroundConfig, Grounder};
//! use dsm::knowledge::Knowledge;
//! use dsm::map::Map;
//! use std::sync::Arc;
//!
//! // Nobody listens at this port: the embedded grammar answers, and the answer says why.
//! let mut settings = LanguageSettings::new("http://127.0.0.1:9/v1", "any");
//! (settings.retries, settings.connect_timeout_s) = (0, 0.5);
//! let client = Arc::new(Client::open(settings, None)?);
//! let knowledge = Arc::new(Knowledge::embedded()?);
//! let reader = LanguageReader::new(client, knowledge.clone());
//! let grounder = Grounder::new(GroundConfig::default(), knowledge)?.with_reader(Box::new(reader));
//! let answer = grounder.ground(&Map::new(0.05), "the red apple on the table", None);
//! assert_eq!(answer.backend, "embedded");
//! assert!(answer.spoken[0].reason.is_some());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod annotate;
mod attributes;
mod bounded;
mod budget;
mod cache;
mod check;
mod client;
mod error;
mod fetch;
mod http;
mod labels;
mod marks;
mod networks;
#[cfg(feature = "onnx")]
pub mod onnx;
mod parse;
mod picture;
mod places;
mod question;
mod relations;
mod repair;
mod schema;
mod score;
mod settings;
mod tags;
mod thought;
mod trace;
mod verify;
pub mod wall;
mod wire;

pub use annotate::LanguageAnnotator;
pub use budget::Spent;
pub use check::{Check, Checked, check};
pub use client::{Client, open_afresh, open_client};
pub use error::ModelError;
pub use fetch::{FetchError, Fetched, fetch, find_file};
pub use http::{Reply, Transport};
pub use labels::LanguageLabeller;
pub use marks::draw_mark;
pub use networks::{
    DetectorSettings, NetworkFile, Pace, SegmenterSettings, SightSettings, TextKind, TextSettings, VisualKind,
    VisualSettings,
};
pub use parse::LanguageReader;
pub use picture::{Canvas, Picture};
pub use score::LanguageScorer;
pub use settings::{Answers, FrameSettings, LanguageSettings, ModelSettings, SchemaSupport, SettingsError, Use};
pub use tags::list_tags;
pub use trace::{Ending, Event};
pub use verify::LanguageVerifier;

use dsm::ground::{BackendError, Grounder};
use dsm::knowledge::Knowledge;
use std::path::PathBuf;
use std::sync::Arc;
use thiserror::Error;

/// Why a file of models gives no client.
#[derive(Debug, Error)]
pub enum OpenError {
    /// The file, or the key that it asks for.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The record cannot be written.
    #[error("{}: the record cannot be opened: {source}", file.display())]
    Record {
        /// The record.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// Plugs a model into a grounder, for the uses that its settings allow.
pub fn plug_in(grounder: Grounder, client: &Arc<Client>, knowledge: &Arc<Knowledge>) -> Grounder {
    let serves = |wanted| client.settings().serves(wanted);
    let mut grounder = grounder;
    if serves(Use::Parse) {
        grounder = grounder.with_reader(Box::new(LanguageReader::new(client.clone(), knowledge.clone())));
    }
    if serves(Use::Score) {
        grounder = grounder.with_scorer(Box::new(LanguageScorer::new(client.clone())));
    }
    if serves(Use::Verify) {
        grounder = grounder.with_verifier(Box::new(LanguageVerifier::new(client.clone())));
    }
    grounder
}

/// A failure as `dsm` knows it.
fn unanswered(client: &Client, error: ModelError) -> BackendError {
    BackendError::Backend { name: client.name().to_string(), source: Box::new(error) }
}
