//! Which of a benchmark's labels an object is, by the paper's sentence about it.

use crate::client::Client;
use crate::question::Question;
use crate::schema::schema_of;
use crate::settings::Use;
use dsm::eval::{EmbeddedLabeller, Labeller, LabellerError};
use dsm::knowledge::Knowledge;
use dsm::map::MapObject;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;
use std::sync::Arc;

/// Chooses labels by a model; the embedded one chooses where it does not.
pub struct LanguageLabeller {
    client: Arc<Client>,
    embedded: EmbeddedLabeller,
    asked: usize,
    left: usize,
    name: String,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Chosen {
    /// One of the classes, letter for letter.
    class: String,
}

impl LanguageLabeller {
    /// A labeller that asks `client`.
    pub fn new(client: Arc<Client>, knowledge: Arc<Knowledge>) -> Self {
        let name = client.name().to_string();
        Self { client, embedded: EmbeddedLabeller::new(knowledge), asked: 0, left: 0, name }
    }
}

impl Labeller for LanguageLabeller {
    fn name(&self) -> &str {
        &self.name
    }

    fn choose(&mut self, object: &MapObject, sentence: &str, classes: &[&str]) -> Result<usize, LabellerError> {
        let mut names: Vec<&str> = classes.to_vec();
        names.sort_unstable();
        names.dedup();
        let data = json!({"sentence": sentence, "classes": names});
        let schema = schema_of::<Chosen>(&[("class", names.iter().map(|name| json!(name)).collect())]);
        let question = Question::of_words(Use::Labels, include_str!("prompts/labels.txt"), data, schema);
        self.asked += 1;
        let chosen = self.client.ask(&question, |Chosen { class }| {
            let place = classes.iter().position(|known| known.eq_ignore_ascii_case(class.trim()));
            place.ok_or_else(|| "that is no class of the list".to_owned())
        });
        if let Ok(place) = chosen {
            return Ok(place);
        }
        self.left += 1;
        self.name = format!("{}; embedded for {} of {}", self.client.name(), self.left, self.asked);
        self.embedded.choose(object, sentence, classes)
    }
}
