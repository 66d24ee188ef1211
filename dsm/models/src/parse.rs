//! From words to a query: the model writes down what was said, and the grounder holds it to the words.

use crate::bounded::word_of;
use crate::client::Client;
use crate::question::Question;
use crate::schema::schema_of;
use crate::settings::Use;
use crate::unanswered;
use dsm::ground::{
    Article, AttributeTerm, AttributeWord, BackendError, Entity, Noun, Query, QueryReader, QueryText, RelationTerm,
    RelationWord, Selection,
};
use dsm::knowledge::Knowledge;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;
use std::sync::Arc;

/// Most things of one expression, and deepest nesting of anchors.
const MAX_THINGS: usize = 16;
const MAX_DEPTH: usize = 5;
/// Names of things nearby that the model is told.
const MAX_NAMES: usize = 80;
/// Longest text that a model is asked to read, characters.
const MAX_TEXT: usize = 600;

/// Reads queries by a model.
pub struct LanguageReader {
    client: Arc<Client>,
    knowledge: Arc<Knowledge>,
}

#[derive(Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Read {
    /// Everything that is mentioned.
    things: Vec<Mentioned>,
    /// The id of the one that is meant.
    target: String,
}

#[derive(Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Mentioned {
    /// A short name for this entry.
    id: String,
    /// What sort of thing it is.
    kind: Kind,
    /// The name as it was said, singular, lower case; empty for `anything`.
    noun: String,
    /// Whether any one will do.
    any: bool,
    /// What it is like.
    attributes: Vec<Attribute>,
    /// Where it is.
    relations: Vec<Relation>,
    /// Which one of several it is.
    selections: Vec<Selection>,
}

#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Thing,
    Room,
    Anything,
}

#[derive(Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Attribute {
    /// What it speaks about.
    kind: AttributeWord,
    /// The word as it was said.
    word: String,
    /// Whether it must not hold.
    negated: bool,
}

#[derive(Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Relation {
    /// The relation.
    word: RelationWord,
    /// Whether it must not hold.
    negated: bool,
    /// Ids of the other things.
    anchors: Vec<String>,
}

impl LanguageReader {
    /// A reader that asks `client`; canonical words are those of `knowledge`.
    pub fn new(client: Arc<Client>, knowledge: Arc<Knowledge>) -> Self {
        Self { client, knowledge }
    }

    fn query_of(&self, read: &Read) -> Result<Query, String> {
        if read.things.len() > MAX_THINGS {
            return Err(format!("there are more than {MAX_THINGS} things"));
        }
        let mut left = MAX_THINGS;
        let target = self.entity_of(read, &read.target, 0, &mut left)?;
        Ok(Query { target, viewpoint: None })
    }

    /// The thing of an id with all that is said of it; `left` counts how many more there may be, for a thing may be the
    /// anchor of many.
    fn entity_of(&self, read: &Read, id: &str, depth: usize, left: &mut usize) -> Result<Entity, String> {
        *left = left.checked_sub(1).ok_or_else(|| format!("more than {MAX_THINGS} things are spoken of"))?;
        if depth > MAX_DEPTH {
            return Err(format!("things are nested deeper than {MAX_DEPTH}, or in a circle"));
        }
        let mut same = read.things.iter().filter(|thing| thing.id == id);
        let (Some(thing), None) = (same.next(), same.next()) else {
            return Err("an id is unknown or used twice".to_owned());
        };
        let mut entity = Entity::named(self.noun_of(thing)?);
        entity.article = if thing.any { Article::Indefinite } else { Article::Definite };
        for attribute in &thing.attributes {
            entity.attributes.push(self.term_of(attribute)?);
        }
        for relation in &thing.relations {
            let anchors = relation.anchors.iter().take(3).map(|anchor| self.entity_of(read, anchor, depth + 1, left));
            let anchors = anchors.collect::<Result<Vec<Entity>, String>>()?;
            entity.relations.push(RelationTerm { word: relation.word, negated: relation.negated, anchors });
        }
        entity.selections.clone_from(&thing.selections);
        Ok(entity)
    }

    fn noun_of(&self, thing: &Mentioned) -> Result<Noun, String> {
        let word = || word_of(&thing.noun).ok_or_else(|| "a noun is no name".to_owned());
        match thing.kind {
            Kind::Anything => Ok(Noun::Anything),
            Kind::Thing => Ok(Noun::Thing(word()?)),
            Kind::Room => {
                let room = word()?;
                let known = self.knowledge.words().rooms.find(&room);
                known.map(|room| Noun::Room(room.to_owned())).ok_or_else(|| "a room is unknown".to_owned())
            }
        }
    }

    fn term_of(&self, attribute: &Attribute) -> Result<AttributeTerm, String> {
        let words = self.knowledge.words();
        let list = match attribute.kind {
            AttributeWord::Color => &words.colors,
            AttributeWord::Material => &words.materials,
            AttributeWord::Size => &words.sizes,
            AttributeWord::Shape => &words.shapes,
            AttributeWord::Pattern => &words.patterns,
            AttributeWord::Weight => &words.weights,
            AttributeWord::Purpose => &words.purposes,
        };
        let known = word_of(&attribute.word).and_then(|word| list.find(&word).map(str::to_owned));
        let word = known.ok_or_else(|| format!("an attribute is no known {:?}", attribute.kind).to_lowercase())?;
        Ok(AttributeTerm { kind: attribute.kind, word, negated: attribute.negated })
    }
}

impl QueryReader for LanguageReader {
    fn name(&self) -> &str {
        self.client.name()
    }

    fn read(&self, said: &QueryText<'_>) -> Result<Vec<Query>, BackendError> {
        // A text that is too long, or empty, is no expression that is worth a question.
        if said.words().is_empty() || said.text.chars().count() > MAX_TEXT {
            return Err(unanswered(&self.client, crate::ModelError::NotAsked));
        }
        let names: Vec<&str> = said.object_names().take(MAX_NAMES).collect();
        let data = json!({"text": said.text, "words": said.words(), "names": names});
        let question = Question::of_words(Use::Parse, include_str!("prompts/parse.txt"), data, schema_of::<Read>(&[]));
        let query = self.client.ask(&question, |read: Read| self.query_of(&read));
        query.map(|query| vec![query]).map_err(|error| unanswered(&self.client, error))
    }
}
