//! Names and the three kinds of attributes (a_a, a_p, a_o) of marked things, several in one question.

use crate::bounded::{name_of, word_of};
use crate::client::Client;
use crate::error::ModelError;
use crate::picture::Picture;
use crate::question::Question;
use crate::schema::schema_of;
use crate::settings::{Answers, Use};
use dsm::knowledge::Knowledge;
use dsm::map::AttributeKind::{self, Affordance, Appearance, Physical};
use dsm::perceive::AttributeVote;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// What a model chooses when it cannot tell.
const UNKNOWN: &str = "unknown";
/// Most words of one attribute that count, by place.
const MOST_WORDS: usize = 3;

/// A thing that bears a number in the picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Marked {
    /// Its number.
    pub(crate) mark: u32,
    /// Its name so far.
    pub(crate) name: String,
}

/// What a model says of a marked thing.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Described {
    /// The number.
    pub(crate) mark: u32,
    /// Its name; `None` when what the model wrote is no name.
    pub(crate) name: Option<String>,
    /// Its attributes, each with a weight of at most 1.
    pub(crate) attributes: Vec<AttributeVote>,
}

/// The words that describe: closed lists, all from the knowledge table.
pub(crate) struct Vocabulary {
    lists: Vec<(&'static str, BTreeSet<String>)>,
}

/// Property of the answer, kind of attribute and its key in the map.
const KEYS: [(&str, AttributeKind, &str); 9] = [
    ("colors", Appearance, "color"),
    ("pattern", Appearance, "pattern"),
    ("texture", Appearance, "texture"),
    ("materials", Physical, "material"),
    ("weight", Physical, "weight"),
    ("smoothness", Physical, "smoothness"),
    ("size", Physical, "size"),
    ("uses", Affordance, "use"),
    ("operate", Affordance, "operate"),
];

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Descriptions {
    /// One entry for each mark.
    objects: Vec<Description>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Description {
    /// The number in the picture.
    mark: u32,
    /// Plain English name, one to three words, lower case.
    name: String,
    /// Main colours, the largest first.
    colors: Vec<String>,
    /// Pattern of its surface.
    pattern: String,
    /// Texture as it looks.
    texture: String,
    /// What it is made of, the likeliest first.
    materials: Vec<String>,
    /// Weight as a hand would feel it.
    weight: String,
    /// How its surface feels.
    smoothness: String,
    /// Size among household things.
    size: String,
    /// What it is for.
    uses: Vec<String>,
    /// How it is operated.
    operate: Vec<String>,
}

impl Vocabulary {
    pub(crate) fn new(knowledge: &Knowledge) -> Self {
        let words = knowledge.words();
        let listed = |list: &[String]| list.iter().cloned().collect::<BTreeSet<String>>();
        let given = |list: &[&str]| list.iter().map(|&word| word.to_owned()).collect::<BTreeSet<String>>();
        let operate = knowledge.categories().iter().flat_map(|category| category.operate.iter().cloned());
        let lists = vec![
            ("colors", listed(words.colors.canonical())),
            ("pattern", listed(words.patterns.canonical())),
            ("texture", given(&["smooth", "rough"])),
            ("materials", listed(words.materials.canonical())),
            ("weight", given(&["light", "medium", "heavy"])),
            ("smoothness", given(&["smooth", "even", "soft"])),
            ("size", given(&["small", "medium", "large"])),
            ("uses", listed(words.purposes.canonical())),
            ("operate", operate.collect()),
        ];
        Self { lists }
    }

    /// Choices of each property for the schema.
    fn choices(&self, marks: &[Marked]) -> Vec<(&'static str, Vec<Value>)> {
        let words = |list: &BTreeSet<String>| {
            list.iter().map(String::as_str).chain([UNKNOWN]).map(|word| json!(word)).collect::<Vec<Value>>()
        };
        let mut choices: Vec<_> = self.lists.iter().map(|(key, list)| (*key, words(list))).collect();
        choices.push(("mark", marks.iter().map(|marked| json!(marked.mark)).collect()));
        choices
    }

    /// The word as the map knows it; `None` when the list does not hold it.
    fn find(&self, property: &str, word: &str) -> Option<String> {
        let word = word_of(word)?;
        let (_, list) = self.lists.iter().find(|(key, _)| *key == property)?;
        list.get(&word).cloned()
    }
}

impl Description {
    fn words_of(&self, property: &str) -> &[String] {
        let one = std::slice::from_ref::<String>;
        match property {
            "colors" => &self.colors,
            "materials" => &self.materials,
            "uses" => &self.uses,
            "operate" => &self.operate,
            "pattern" => one(&self.pattern),
            "texture" => one(&self.texture),
            "weight" => one(&self.weight),
            "smoothness" => one(&self.smoothness),
            _ => one(&self.size),
        }
    }

    /// Votes for words of the lists; the first of several weighs most. Other words are left out.
    fn votes(&self, vocabulary: &Vocabulary) -> Vec<AttributeVote> {
        let mut votes = Vec::new();
        for (property, kind, key) in KEYS {
            let mut said: Vec<String> = Vec::new();
            for word in self.words_of(property).iter().filter_map(|word| vocabulary.find(property, word)) {
                if !said.contains(&word) {
                    said.push(word);
                }
            }
            for (place, word) in said.into_iter().take(MOST_WORDS).enumerate() {
                // Several uses are true at once; of colours and materials the first is meant.
                let weight = if kind == Affordance { 1.0 } else { 1.0 / (1.0 + place as f32) };
                votes.push(AttributeVote { kind, key, word, weight });
            }
        }
        votes
    }
}

/// Asks for names and attributes of the marked things in a picture; gives them in the order of the marks. A mark that the
/// model leaves out is missing.
pub(crate) fn describe(
    client: &Client,
    answers: Answers,
    (knowledge, vocabulary): (&Knowledge, &Vocabulary),
    picture: &Picture,
    marks: &[Marked],
) -> Result<Vec<Described>, ModelError> {
    let listed = |marked: &Marked| json!({"mark": marked.mark, "guess": marked.name});
    let data = json!({"marks": marks.iter().map(listed).collect::<Vec<Value>>()});
    let schema = schema_of::<Descriptions>(&vocabulary.choices(marks));
    let question = Question {
        pictures: vec![picture.clone()],
        ..Question::of_words(Use::Attributes, include_str!("prompts/attributes.txt"), data, schema)
    };
    client.ask_from(answers, &question, |Descriptions { objects }| {
        check_marks(objects.iter().map(|object| object.mark), marks)?;
        let described = |object: &Description| Described {
            mark: object.mark,
            name: name_of(&object.name, knowledge),
            attributes: object.votes(vocabulary),
        };
        let mut all: Vec<Described> = objects.iter().map(described).collect();
        all.sort_by_key(|described| described.mark);
        Ok(all)
    })
}

/// Every mark must be one of those that were asked about, and may be spoken of once.
fn check_marks(said: impl Iterator<Item = u32>, marks: &[Marked]) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    for mark in said {
        if !marks.iter().any(|marked| marked.mark == mark) {
            return Err(format!("there is no mark {mark}"));
        }
        if !seen.insert(mark) {
            return Err(format!("mark {mark} is described twice"));
        }
    }
    if seen.is_empty() && !marks.is_empty() {
        return Err("no mark is described".to_owned());
    }
    Ok(())
}
