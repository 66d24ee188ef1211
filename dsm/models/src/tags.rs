//! What stands in a picture, as words for an open-vocabulary detector.

use crate::bounded::name_of;
use crate::client::Client;
use crate::error::ModelError;
use crate::picture::Canvas;
use crate::question::Question;
use crate::schema::schema_of;
use crate::settings::{Answers, Use};
use dsm::knowledge::Knowledge;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;

/// Most names that one picture brings.
const MAX_TAGS: usize = 60;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Tags {
    /// Names of things, each once.
    things: Vec<String>,
}

/// Names of the things in a picture, in alphabetical order, each once. What is no name is left out.
///
/// # Errors
/// [`ModelError`] when the model gives no answer that can be used.
pub fn list_tags(client: &Client, knowledge: &Knowledge, canvas: &Canvas) -> Result<Vec<String>, ModelError> {
    list_tags_from(client, client.settings().answers, knowledge, canvas)
}

/// As [`list_tags`], from where is said.
pub(crate) fn list_tags_from(
    client: &Client,
    answers: Answers,
    knowledge: &Knowledge,
    canvas: &Canvas,
) -> Result<Vec<String>, ModelError> {
    let question = Question {
        pictures: canvas.encode().into_iter().collect(),
        ..Question::of_words(Use::Tags, include_str!("prompts/tags.txt"), json!({}), schema_of::<Tags>(&[]))
    };
    client.ask_from(answers, &question, |Tags { things }| {
        if things.len() > MAX_TAGS {
            return Err(format!("there are more than {MAX_TAGS} things"));
        }
        let mut names: Vec<String> = things.iter().filter_map(|thing| name_of(thing, knowledge)).collect();
        names.sort_unstable();
        names.dedup();
        Ok(names)
    })
}
