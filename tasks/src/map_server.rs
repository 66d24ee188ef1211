//! Questions about one map and their answers, as HTTP and MCP ask them. Nothing here changes the map.

use crate::error::TaskError;
use dsm::ground::Grounder;
use dsm::map::{Map, ObjectId};
use dsm::store::{ShownMap, show_map};
use nalgebra::{Point2, Point3};
use serde_json::{Map as Object, Value, json};
use std::path::Path;
use std::sync::Arc;

/// Longest text that is grounded, bytes: a grounder's time grows with its words.
pub const LONGEST_TEXT: usize = 500;
/// Most objects in one answer; `offset` turns the pages.
pub const MOST_OBJECTS: usize = 1000;

/// A map that answers.
pub struct MapServer {
    map: Map,
    shown: ShownMap,
    grounder: Arc<Grounder>,
}

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The question makes no sense.
    Bad(String),
    /// What is asked for is not there.
    Unknown(String),
}

/// A question with what it takes: name, what it is for, and its parameters as (name, JSON type, whether it must be there,
/// what it is).
pub struct Question {
    /// Name, also of the MCP tool; the path of HTTP is `/NAME`.
    pub name: &'static str,
    /// What it answers.
    pub about: &'static str,
    /// Its parameters.
    pub parameters: &'static [(&'static str, &'static str, bool, &'static str)],
}

/// All questions.
pub const QUESTIONS: [Question; 6] = [
    Question {
        name: "summary",
        about: "How many objects, relations and rooms the map has, and its free space.",
        parameters: &[],
    },
    Question {
        name: "ground",
        about: "The one object or room that English words mean, with its rivals and reasons: `the apple on the white shelf`.",
        parameters: &[("text", "string", true, "What to find, at most 500 bytes.")],
    },
    Question {
        name: "objects",
        about: "Objects in order of identity, all or by name, room or distance to a point.",
        parameters: &[
            ("name", "string", false, "Only those of this name."),
            ("room", "string", false, "Only those in rooms of this name."),
            ("x", "number", false, "With y, z and radius: only those whose centre is near this point, metres."),
            ("y", "number", false, "See x."),
            ("z", "number", false, "See x."),
            ("radius", "number", false, "See x."),
            ("offset", "integer", false, "Leave out so many; default 0."),
            ("limit", "integer", false, "At most so many, up to 1000; default 100."),
        ],
    },
    Question {
        name: "object",
        about: "One object with its relations, and who gave the votes for its name and attributes.",
        parameters: &[("id", "integer", true, "Its identity.")],
    },
    Question { name: "rooms", about: "Rooms with their outlines.", parameters: &[] },
    Question {
        name: "free",
        about: "What is known of the floor at a place: free, occupied or unknown.",
        parameters: &[("x", "number", true, "Metres."), ("y", "number", true, "Metres.")],
    },
];

impl MapServer {
    /// Reads a map.
    ///
    /// # Errors
    /// [`TaskError`]: the file cannot be read.
    pub fn open(path: &Path) -> Result<Self, TaskError> {
        let map = dsm::store::load_map(path)?.map;
        Ok(Self { shown: show_map(&map), map, grounder: crate::assemble::grounder()? })
    }

    /// Answers a question; parameters may be JSON values or their text.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn answer(&self, question: &str, parameters: &Object<String, Value>) -> Result<Value, Refusal> {
        let Some(known) = QUESTIONS.iter().find(|known| known.name == question) else {
            let names: Vec<&str> = QUESTIONS.iter().map(|known| known.name).collect();
            return Err(Refusal::Unknown(format!("`{question}` is no question; there are: {}", names.join(", "))));
        };
        if let Some(stranger) = parameters.keys().find(|key| !known.parameters.iter().any(|p| p.0 == key.as_str())) {
            let names: Vec<&str> = known.parameters.iter().map(|p| p.0).collect();
            return Err(Refusal::Bad(format!("`{question}` takes no `{stranger}`; it takes: {}", names.join(", "))));
        }
        match question {
            "ground" => {
                let text = text(parameters, "text")?.ok_or_else(|| missing("text"))?;
                if text.len() > LONGEST_TEXT {
                    return Err(Refusal::Bad(format!("`text` has {} bytes, at most {LONGEST_TEXT}", text.len())));
                }
                give(&self.grounder.ground(&self.map, text, None))
            }
            "objects" => self.objects(parameters),
            "object" => {
                let id = whole(parameters, "id")?.ok_or_else(|| missing("id"))?;
                let object = self.shown.objects.iter().find(|object| object.id == id);
                let object = object.ok_or_else(|| Refusal::Unknown(format!("there is no object {id}")))?;
                let relations: Vec<_> = self.shown.relations.iter().filter(|r| r.from == id || r.to == id).collect();
                let points = self.map.find_object(ObjectId(id)).map_or(0, |object| object.points.len());
                let votes = self.map.find_object(ObjectId(id)).map(|object| object.provenance.credits());
                Ok(json!({"object": object, "relations": relations, "points": points, "votes": votes}))
            }
            "rooms" => Ok(json!({"rooms": self.shown.rooms})),
            "free" => {
                let [x, y] = ["x", "y"].map(|key| number(parameters, key)?.ok_or_else(|| missing(key)));
                let state = self.map.free_space.state_at(&Point2::new(x?, y?));
                Ok(json!({"state": format!("{state:?}").to_lowercase(), "cell_m": self.map.free_space.resolution_m}))
            }
            _ => {
                let cells = self.map.free_space.known_cells().count() as f64;
                let known_m2 = cells * self.map.free_space.resolution_m.powi(2);
                Ok(json!({"objects": self.shown.objects.len(), "relations": self.shown.relations.len(),
                    "rooms": self.shown.rooms.len(), "stamp_s": self.map.stamp.as_s(), "known_floor_m2": known_m2}))
            }
        }
    }

    fn objects(&self, parameters: &Object<String, Value>) -> Result<Value, Refusal> {
        let (name, room) = (text(parameters, "name")?, text(parameters, "room")?);
        let place = ["x", "y", "z", "radius"].map(|key| number(parameters, key));
        let [x, y, z, radius] = place;
        let ball = match (x?, y?, z?, radius?) {
            (Some(x), Some(y), Some(z), Some(radius)) => Some((Point3::new(x, y, z), radius)),
            (None, None, None, None) => None,
            _ => return Err(Refusal::Bad("x, y, z and radius go together".into())),
        };
        let offset = whole(parameters, "offset")?.unwrap_or(0) as usize;
        let limit = whole(parameters, "limit")?.unwrap_or(100) as usize;
        if limit > MOST_OBJECTS {
            return Err(Refusal::Bad(format!("`limit` is at most {MOST_OBJECTS}")));
        }
        let fits = |object: &&dsm::store::ShownObject| {
            name.is_none_or(|name| object.name == name)
                && room.is_none_or(|room| object.room.as_deref() == Some(room))
                && ball.is_none_or(|(center, radius)| nalgebra::distance(&object.center.into(), &center) <= radius)
        };
        let found: Vec<_> = self.shown.objects.iter().filter(fits).collect();
        let page: Vec<_> = found.iter().skip(offset).take(limit).collect();
        Ok(json!({"total": found.len(), "offset": offset, "objects": page}))
    }
}

fn give<T: serde::Serialize>(value: &T) -> Result<Value, Refusal> {
    serde_json::to_value(value).map_err(|error| Refusal::Bad(error.to_string()))
}

fn missing(key: &str) -> Refusal {
    Refusal::Bad(format!("`{key}` is missing"))
}

fn text<'a>(parameters: &'a Object<String, Value>, key: &str) -> Result<Option<&'a str>, Refusal> {
    match parameters.get(key) {
        None => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(_) => Err(Refusal::Bad(format!("`{key}` is no text"))),
    }
}

fn number(parameters: &Object<String, Value>, key: &str) -> Result<Option<f64>, Refusal> {
    let value = match parameters.get(key) {
        None => return Ok(None),
        Some(Value::String(text)) => text.parse().ok(),
        Some(value) => value.as_f64(),
    };
    let value = value.filter(|value: &f64| value.is_finite() && value.abs() < 1e6);
    value.map(Some).ok_or_else(|| Refusal::Bad(format!("`{key}` is no number of at most a million")))
}

fn whole(parameters: &Object<String, Value>, key: &str) -> Result<Option<u64>, Refusal> {
    let value = match parameters.get(key) {
        None => return Ok(None),
        Some(Value::String(text)) => text.parse().ok(),
        Some(value) => value.as_u64(),
    };
    value.map(Some).ok_or_else(|| Refusal::Bad(format!("`{key}` is no whole number")))
}
