//! Who reads the words of a query.

use super::backend::BackendError;
use super::noun::Names;
use super::parse::{Attachment, parse_query};
use super::query::Query;
use crate::knowledge::Knowledge;
use std::sync::Arc;

/// What a reader gets.
#[derive(Clone, Copy)]
pub struct QueryText<'a> {
    /// The words as they were given, with a command's verb.
    pub text: &'a str,
    pub(super) words: &'a [String],
    pub(super) names: &'a Names,
}

impl<'a> QueryText<'a> {
    /// Lower-case words and marks, without a command's verb.
    pub fn words(&self) -> &'a [String] {
        self.words
    }

    /// Names that things of the map bear, in alphabetical order.
    pub fn object_names(&self) -> impl Iterator<Item = &'a str> {
        self.names.iter()
    }
}

/// Turns words into a query.
pub trait QueryReader: Send + Sync {
    /// Name for reports.
    fn name(&self) -> &str;

    /// The readings of the words, likeliest first; none when they name nothing. Every word of a reading must have been
    /// said, in these or other words; [`Grounder`](super::Grounder) holds plugged-in readers to that.
    ///
    /// # Errors
    /// [`BackendError::Backend`] when a plugged-in backend gives no answer; the grammar then reads instead.
    fn read(&self, said: &QueryText<'_>) -> Result<Vec<Query>, BackendError>;
}

/// The grammar.
#[derive(Clone, Debug)]
pub struct EmbeddedReader {
    knowledge: Arc<Knowledge>,
}

impl EmbeddedReader {
    /// A reader that knows words from `knowledge`.
    pub fn new(knowledge: Arc<Knowledge>) -> Self {
        Self { knowledge }
    }

    /// As [`QueryReader::read`], which cannot fail here. "The cup on the table next to the window" has two readings: when
    /// the table's window decides nothing, it may be the cup's.
    pub(super) fn readings(&self, said: &QueryText<'_>) -> Vec<Query> {
        let parse = |attachment| parse_query(said.words, &self.knowledge, said.names, attachment);
        let Some(near) = parse(Attachment::Nearest) else { return Vec::new() };
        let far = if said.names.lenient { None } else { parse(Attachment::Target) };
        let far = far.filter(|far| *far != near);
        std::iter::once(near).chain(far).collect()
    }
}

impl QueryReader for EmbeddedReader {
    fn name(&self) -> &str {
        super::verify::EMBEDDED
    }

    fn read(&self, said: &QueryText<'_>) -> Result<Vec<Query>, BackendError> {
        Ok(self.readings(said))
    }
}
