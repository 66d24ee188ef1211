//! Whether a server answers, and how well it keeps to the form of answers: for `dsm models check`.

use crate::client::Client;
use crate::parse::LanguageReader;
use crate::picture::Canvas;
use crate::question::Question;
use crate::schema::schema_of;
use crate::settings::{SchemaSupport, Use};
use crate::tags::list_tags;
use crate::{ModelError, Spent};
use dsm::ground::{GroundConfig, GroundConfigError, Grounder};
use dsm::knowledge::Knowledge;
use dsm::map::Map;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::sync::Arc;

/// The words of the test of reading.
const TEXT: &str = "the red apple on the table";

/// What a check found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checked {
    /// The server.
    pub url: String,
    /// The model.
    pub model: String,
    /// Whether all checks that were made passed.
    pub passed: bool,
    /// How the server is told the form of answers, as it turned out.
    pub schema: SchemaSupport,
    /// The checks in their order.
    pub checks: Vec<Check>,
    /// What they cost.
    pub spent: Spent,
}

/// One check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// What was tried.
    pub name: &'static str,
    /// Whether it worked.
    pub passed: bool,
    /// What came of it.
    pub found: String,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Chosen {
    /// One of the classes.
    class: String,
}

/// Tries the server with a few small questions: a choice, reading words, and a picture where the model sees.
///
/// # Errors
/// None of its own; the grounder's default parameters are valid.
pub fn check(client: &Arc<Client>, knowledge: &Arc<Knowledge>) -> Result<Checked, GroundConfigError> {
    let mut checks = vec![made("choose one of a list", choose(client))];
    let reachable = checks[0].passed;
    if reachable && client.settings().serves(Use::Parse) {
        checks.push(made("read an expression", read(client, knowledge)?));
    }
    if reachable && client.settings().serves(Use::Tags) {
        checks.push(made("look at a picture", look(client, knowledge)));
    }
    Ok(Checked {
        url: client.settings().url.clone(),
        model: client.settings().model.clone(),
        passed: checks.iter().all(|check| check.passed),
        schema: client.schema_support(),
        checks,
        spent: client.spent(),
    })
}

fn made(name: &'static str, result: Result<String, String>) -> Check {
    let passed = result.is_ok();
    Check { name, passed, found: result.unwrap_or_else(|error| error) }
}

fn choose(client: &Client) -> Result<String, String> {
    let classes = ["apple", "table"];
    let data = json!({"sentence": "This is a small red fruit.", "classes": classes});
    let schema = schema_of::<Chosen>(&[("class", classes.iter().map(|class| json!(class)).collect())]);
    // Asked as the first use that the file allows, so that a file for one use can be checked.
    let wanted = client.settings().uses.iter().copied().find(|wanted| client.settings().serves(*wanted));
    let wanted = wanted.ok_or_else(|| ModelError::NotAsked.to_string())?;
    let question = Question::of_words(wanted, include_str!("prompts/labels.txt"), data, schema);
    let chosen = client.ask(&question, |Chosen { class }| {
        classes.contains(&class.as_str()).then_some(class).ok_or_else(|| "that is no class of the list".to_owned())
    });
    chosen.map_err(|error| error.to_string())
}

fn read(client: &Arc<Client>, knowledge: &Arc<Knowledge>) -> Result<Result<String, String>, GroundConfigError> {
    let reader = LanguageReader::new(client.clone(), knowledge.clone());
    let grounder = Grounder::new(GroundConfig::default(), knowledge.clone())?.with_reader(Box::new(reader));
    let answer = grounder.ground(&Map::new(0.05), TEXT, None);
    let reason = answer.spoken.first().and_then(|spoken| spoken.reason.clone());
    let phrase = answer.query.map_or_else(String::new, |query| query.target.phrase());
    Ok(match reason {
        None => Ok(format!("`{TEXT}` is about the {phrase}")),
        Some(reason) => Err(reason),
    })
}

/// A picture of a red disc: whatever it is called, an answer in the right form passes.
fn look(client: &Client, knowledge: &Knowledge) -> Result<String, String> {
    let (width, height) = (160_u32, 120_u32);
    let pixel = |index: u32| {
        let (x, y) = (i64::from(index % width) - 80, i64::from(index / width) - 60);
        if x * x + y * y < 1600 { [200, 30, 30] } else { [220, 220, 210] }
    };
    let canvas = Canvas { width, height, color: (0..width * height).map(pixel).collect(), step: 1 };
    let tags = list_tags(client, knowledge, &canvas).map_err(|error| error.to_string())?;
    Ok(if tags.is_empty() { "no thing is named".to_owned() } else { format!("it names {}", tags.join(", ")) })
}
