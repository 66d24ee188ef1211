//! A record of what was asked and answered, without keys and without pictures.

use crate::error::ModelError;
use crate::settings::Use;
use serde::Serialize;
use serde_json::Value;
use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Events that are kept in memory, the latest.
const KEPT: usize = 512;
/// What stands in place of a key.
const HIDDEN: &str = "[key]";

/// How a question ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// The server answered.
    Answered,
    /// The server answered after it was asked to repair its answer.
    Repaired,
    /// The cache answered.
    Cached,
    /// There is no answer that can be used.
    Failed,
}

/// One question from its beginning to its end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// What was asked for.
    #[serde(rename = "use")]
    pub wanted: Use,
    /// The model.
    pub model: String,
    /// The name of the question: equal questions bear one name.
    pub question: String,
    /// How it ended.
    pub ending: Ending,
    /// Why there is no answer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// The same in one word.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_kind: Option<&'static str>,
    /// Requests that were sent.
    pub requests: u32,
    /// Pauses between them, seconds.
    pub paused_s: f64,
    /// Wall time, seconds.
    pub wall_s: f64,
    /// Tokens read and written.
    pub tokens: [u64; 2],
    /// The task as the model reads it.
    pub task: String,
    /// The data of the question.
    pub data: Value,
    /// Number of pictures.
    pub pictures: usize,
    /// What the model wrote, without thoughts.
    pub answer: String,
    /// Its thoughts.
    pub thought: String,
}

/// Takes events; keeps the latest in memory and all in a file, if one is given.
pub(crate) struct Trace {
    key: Option<String>,
    state: Mutex<State>,
}

struct State {
    events: VecDeque<Event>,
    file: Option<File>,
}

impl Trace {
    /// A trace; `key` is what must not be found in it.
    pub(crate) fn open(file: Option<&Path>, key: Option<&str>) -> std::io::Result<Self> {
        let open = |path: &Path| OpenOptions::new().create(true).append(true).open(path);
        if let Some(folder) = file.and_then(Path::parent) {
            std::fs::create_dir_all(folder)?;
        }
        let file = file.map(open).transpose()?;
        let key = key.filter(|key| !key.is_empty()).map(str::to_owned);
        Ok(Self { key, state: Mutex::new(State { events: VecDeque::new(), file }) })
    }

    /// A text without the key: servers repeat what they were sent.
    pub(crate) fn hide(&self, text: &str) -> String {
        match &self.key {
            Some(key) if text.contains(key.as_str()) => text.replace(key.as_str(), HIDDEN),
            _ => text.to_owned(),
        }
    }

    /// Takes an event. That a disk is full must not stop a robot: the file then lacks it.
    pub(crate) fn take(&self, event: Event) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if let (Some(file), Ok(line)) = (&mut state.file, serde_json::to_string(&event)) {
            let _ = writeln!(file, "{}", self.hide(&line));
        }
        if state.events.len() == KEPT {
            state.events.pop_front();
        }
        state.events.push_back(event);
    }

    /// The latest events, oldest first.
    pub(crate) fn events(&self) -> Vec<Event> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).events.iter().cloned().collect()
    }
}

impl Event {
    /// Says that it failed, and why.
    pub(crate) fn fail(&mut self, error: &ModelError) {
        self.ending = Ending::Failed;
        self.error = Some(error.to_string());
        self.error_kind = Some(error.word());
    }
}
