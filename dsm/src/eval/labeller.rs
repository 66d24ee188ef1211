//! Which of a cloud's classes an object of the map is.

use crate::knowledge::Knowledge;
use crate::map::{AttributeKind, MapObject, ObjectId};
use crate::perceive::{KnowledgeTextEncoder, TextEncoder, cosine};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// Why objects have no classes.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LabellerError {
    /// No point of the truth is of a class that counts.
    #[error("the cloud has no point of the listed classes: {}", classes.join(", "))]
    NoPoint {
        /// The classes.
        classes: Vec<String>,
    },
    /// A line that is no answer.
    #[error("line {line}: expected {{\"object_id\": 7, \"class\": \"chair\"}}: {reason}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// The backend did not answer for an object.
    #[error("there is no answer for object {id} (`{name}`)", id = object.0)]
    Unanswered {
        /// The object.
        object: ObjectId,
        /// Its name.
        name: String,
    },
    /// The backend answered with another word.
    #[error("line {line}: `{answer}` is no class;{} classes: {}", suggestion(nearest), classes.join(", "))]
    UnknownClass {
        /// The line, from 1.
        line: usize,
        /// The answer.
        answer: String,
        /// The class that was probably meant.
        nearest: Option<String>,
        /// All classes.
        classes: Vec<String>,
    },
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |near| format!(" did you mean `{near}`?"))
}

/// Chooses a class for an object of the map.
pub trait Labeller {
    /// What it is called in a report.
    fn name(&self) -> &str;

    /// The place among `classes` of the one that the object is. `sentence` is the paper's description of it.
    ///
    /// # Errors
    /// An answer that is missing or no class.
    fn choose(&mut self, object: &MapObject, sentence: &str, classes: &[&str]) -> Result<usize, LabellerError>;
}

/// The template sentence of the paper: "This is o_tag, its appearance attributes include a_a, its physical attributes are
/// a_p, and its affordance attributes are a_o."
pub fn describe(object: &MapObject) -> String {
    let list = |kind: AttributeKind| {
        let words = object.attributes.iter().filter(|(k, _, _)| *k == kind);
        let words: Vec<&str> = words.filter_map(|(_, _, votes)| Some(votes.find_winner()?.0)).collect();
        words.join(", ")
    };
    format!(
        "This is {}, its appearance attributes include {}, its physical attributes are {}, and its affordance attributes \
         are {}.",
        object.name(),
        list(AttributeKind::Appearance),
        list(AttributeKind::Physical),
        list(AttributeKind::Affordance)
    )
}

/// The embedded one: the class whose text feature is closest to that of the object's tag. Its encoder knows names and
/// their kinds, so the rest of the sentence would only blur it.
#[derive(Clone, Debug)]
pub struct EmbeddedLabeller {
    encoder: KnowledgeTextEncoder,
    /// Features of the classes that were asked for last.
    features: (Vec<String>, Vec<Vec<f32>>),
}

impl EmbeddedLabeller {
    /// A labeller over a knowledge table.
    pub fn new(knowledge: Arc<Knowledge>) -> Self {
        Self { encoder: KnowledgeTextEncoder::new(knowledge), features: Default::default() }
    }

    pub(super) fn find_closest(&mut self, object: &MapObject, classes: &[&str]) -> usize {
        find_closest(&self.encoder, &mut self.features, object, classes)
    }
}

impl Labeller for EmbeddedLabeller {
    fn name(&self) -> &str {
        "embedded"
    }

    fn choose(&mut self, object: &MapObject, _sentence: &str, classes: &[&str]) -> Result<usize, LabellerError> {
        Ok(self.find_closest(object, classes))
    }
}

/// The class whose text feature is closest to that of the object's tag, by any text encoder.
pub struct EncodedLabeller {
    name: String,
    encoder: Box<dyn TextEncoder>,
    /// Features of the classes that were asked for last.
    features: (Vec<String>, Vec<Vec<f32>>),
}

impl EncodedLabeller {
    /// A labeller that goes by this name in reports.
    pub fn new(name: &str, encoder: Box<dyn TextEncoder>) -> Self {
        Self { name: name.to_owned(), encoder, features: Default::default() }
    }
}

impl Labeller for EncodedLabeller {
    fn name(&self) -> &str {
        &self.name
    }

    fn choose(&mut self, object: &MapObject, _sentence: &str, classes: &[&str]) -> Result<usize, LabellerError> {
        Ok(find_closest(&*self.encoder, &mut self.features, object, classes))
    }
}

/// The place of the class that is closest to the tag of the object; `features` are those of the classes of the last time.
fn find_closest(
    encoder: &dyn TextEncoder,
    features: &mut (Vec<String>, Vec<Vec<f32>>),
    object: &MapObject,
    classes: &[&str],
) -> usize {
    if features.0 != classes {
        let all = classes.iter().map(|class| encoder.encode(class)).collect();
        *features = (classes.iter().map(|&class| class.to_owned()).collect(), all);
    }
    let tag = encoder.encode(object.name());
    let likeness = features.1.iter().map(|feature| cosine(feature, &tag));
    likeness.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(label, _)| label)
}

/// What a language backend is asked about one object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Question<'a> {
    /// The object.
    pub object_id: ObjectId,
    /// The paper's description of it.
    pub sentence: String,
    /// The classes to choose from.
    pub classes: &'a [&'a str],
}

/// What a language backend answered about one object.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Answer {
    object_id: ObjectId,
    class: String,
}

/// The answers that a language backend gave, one JSON object a line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AnsweredLabeller {
    /// With the line.
    answers: BTreeMap<ObjectId, (usize, String)>,
}

impl AnsweredLabeller {
    /// Reads answers; of two for one object the later one counts.
    ///
    /// # Errors
    /// The first line that is no answer.
    pub fn parse(text: &str) -> Result<Self, LabellerError> {
        let mut answers = BTreeMap::new();
        for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let wrong = |error: serde_json::Error| LabellerError::Line { line: index + 1, reason: error.to_string() };
            let Answer { object_id, class } = serde_json::from_str(line).map_err(wrong)?;
            answers.insert(object_id, (index + 1, class));
        }
        Ok(Self { answers })
    }
}

impl Labeller for AnsweredLabeller {
    fn name(&self) -> &str {
        "answers"
    }

    fn choose(&mut self, object: &MapObject, _sentence: &str, classes: &[&str]) -> Result<usize, LabellerError> {
        let unanswered = || LabellerError::Unanswered { object: object.id, name: object.name().to_owned() };
        let (line, answer) = self.answers.get(&object.id).ok_or_else(unanswered)?;
        let place = classes.iter().position(|class| class.eq_ignore_ascii_case(answer.trim()));
        place.ok_or_else(|| LabellerError::UnknownClass {
            line: *line,
            answer: answer.clone(),
            nearest: crate::config::find_nearest(answer, classes.iter().copied()).map(str::to_owned),
            classes: classes.iter().map(|&class| class.to_owned()).collect(),
        })
    }
}
