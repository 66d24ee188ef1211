//! One question from the cache or the server to an answer that has been checked.
//!
//! ```text
//! question ──▶ cache? ──▶ budget ──▶ one of few places ──▶ request, retries ──▶ JSON ──▶ check ──▶ answer
//!                                                              ▲                          │ once
//!                                                              └────────── repair ◀───────┘
//! ```

use crate::budget::{Budget, Spent, Tokens};
use crate::cache::Cache;
use crate::error::{ModelError, shortened};
use crate::http::{Reply, Server, Transport};
use crate::places::Places;
use crate::question::{Question, Repair, draw};
use crate::repair::find_json;
use crate::schema;
use crate::settings::{Answers, LanguageSettings, SchemaSupport, Use};
use crate::trace::{Ending, Event, Trace};
use crate::wall::{SystemWall, Wall};
use crate::wire::{Completion, body_of, limits_of, message_of, read_completion, refuses_form};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Asks a model. Shared by all uses; every limit of the settings holds for all of them together.
pub struct Client {
    settings: LanguageSettings,
    transport: Box<dyn Transport>,
    wall: Box<dyn Wall>,
    cache: Option<Cache>,
    budget: Budget,
    places: Places,
    trace: Trace,
    health: Mutex<Health>,
    name: Arc<str>,
}

/// What is known of the server.
struct Health {
    /// How it is told the form of answers.
    support: SchemaSupport,
    /// Questions in a row without a word from it.
    silent: u32,
    /// It is not asked before this moment, seconds of the wall clock.
    away_until_s: f64,
    /// The last failure.
    reason: String,
}

/// What came of a request.
enum Sent {
    Completion(Completion),
    /// A reply of another status than 200.
    Failure(Reply),
}

/// What was done for one question.
#[derive(Default)]
struct Effort {
    requests: u32,
    paused_s: f64,
    tokens: Tokens,
    cached: bool,
    repaired: bool,
    answer: String,
    thought: String,
}

impl Client {
    /// A client of the server of the settings.
    ///
    /// # Errors
    /// The record cannot be opened.
    pub fn open(settings: LanguageSettings, key: Option<&str>) -> std::io::Result<Self> {
        let server = Server::new(&settings, key);
        Self::with_transport(settings, key, Box::new(server), Box::new(SystemWall::new()))
    }

    /// A client whose requests go elsewhere, and whose time passes otherwise.
    ///
    /// # Errors
    /// The record cannot be opened.
    pub fn with_transport(
        settings: LanguageSettings,
        key: Option<&str>,
        transport: Box<dyn Transport>,
        wall: Box<dyn Wall>,
    ) -> std::io::Result<Self> {
        let health =
            Health { support: settings.schema, silent: 0, away_until_s: f64::NEG_INFINITY, reason: String::new() };
        Ok(Self {
            transport,
            wall,
            cache: settings.cache.as_deref().map(Cache::new),
            budget: Budget::new(&settings),
            places: Places::new(settings.max_concurrent),
            trace: Trace::open(settings.record.as_deref(), key)?,
            health: Mutex::new(health),
            name: format!("language:{}", settings.model).into(),
            settings,
        })
    }

    /// The name under which it speaks: `language:` and the model.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// The settings.
    pub fn settings(&self) -> &LanguageSettings {
        &self.settings
    }

    /// What was spent so far.
    pub fn spent(&self) -> Spent {
        self.budget.spent()
    }

    /// The latest questions with how they ended, oldest first.
    pub fn events(&self) -> Vec<Event> {
        self.trace.events()
    }

    /// How the server is told the form of answers, as it turned out.
    pub fn schema_support(&self) -> SchemaSupport {
        self.health.lock().unwrap_or_else(PoisonError::into_inner).support
    }

    /// Asks, and gives the answer that `check` made of the JSON that came.
    ///
    /// # Errors
    /// [`ModelError`]; every failure of server, network and model comes as one.
    pub(crate) fn ask<A: DeserializeOwned, T>(
        &self,
        question: &Question,
        check: impl Fn(A) -> Result<T, String>,
    ) -> Result<T, ModelError> {
        self.ask_from(self.settings.answers, question, check)
    }

    /// As [`ask`](Self::ask), from where is said. From the cache alone it takes no longer than to read a file.
    ///
    /// # Errors
    /// As [`ask`](Self::ask); [`ModelError::NotCached`] from the cache alone.
    pub(crate) fn ask_from<A: DeserializeOwned, T>(
        &self,
        answers: Answers,
        question: &Question,
        check: impl Fn(A) -> Result<T, String>,
    ) -> Result<T, ModelError> {
        let start_s = self.wall.now_s();
        let mut effort = Effort::default();
        let name = question.hash(&self.settings.model, &limits_of(&self.settings), None);
        let result = if self.settings.serves(question.wanted) {
            self.converse(answers, question, &check, start_s, &mut effort)
        } else {
            Err(ModelError::NotAsked)
        };
        // Who only looks whether there is an answer asks again.
        let looked = answers == Answers::Cached && self.settings.answers == Answers::Live;
        if !(looked && result.as_ref().is_err_and(|error| *error == ModelError::NotCached)) {
            self.account(question, name, &effort, result.as_ref().err(), self.wall.now_s() - start_s);
        }
        result
    }

    /// The question and, when its answer is no good, the request to repair it.
    fn converse<A: DeserializeOwned, T>(
        &self,
        answers: Answers,
        question: &Question,
        check: &impl Fn(A) -> Result<T, String>,
        start_s: f64,
        effort: &mut Effort,
    ) -> Result<T, ModelError> {
        let mut repair: Option<Repair> = None;
        loop {
            let completion = self.find_completion(answers, question, repair.as_ref(), start_s, effort)?;
            let read = find_json(&completion.text).and_then(schema::read::<A>);
            let checked = read.and_then(|(answer, thought)| {
                effort.thought = [completion.thought.as_str(), &thought].join("\n").trim().to_owned();
                check(answer)
            });
            effort.answer = completion.text.clone();
            match checked {
                Ok(answer) => return Ok(answer),
                Err(reason) if repair.is_some() => {
                    return Err(ModelError::Unusable { reason: shortened(&self.trace.hide(&reason), 200) });
                }
                Err(reason) => {
                    effort.repaired = true;
                    repair = Some(Repair { answer: completion.text, reason: shortened(&reason, 200) });
                }
            }
        }
    }

    /// What the model says, from the cache or from the server.
    fn find_completion(
        &self,
        answers: Answers,
        question: &Question,
        repair: Option<&Repair>,
        start_s: f64,
        effort: &mut Effort,
    ) -> Result<Completion, ModelError> {
        let name = question.hash(&self.settings.model, &limits_of(&self.settings), repair);
        if let Some(completion) = self.cache.as_ref().and_then(|cache| cache.find(&name)) {
            effort.cached = true;
            return Ok(completion);
        }
        if answers == Answers::Cached {
            return Err(ModelError::NotCached);
        }
        effort.cached = false;
        let result = self.request(question, repair, &name, start_s, effort);
        self.learn(result.as_ref().err());
        let completion = result?;
        if let Some(cache) = &self.cache {
            // The next run asks again; nothing else depends on it.
            let _ = cache.keep(&name, &self.settings.model, &completion);
        }
        Ok(completion)
    }

    /// Sends a request until it is answered, refused, or out of time.
    fn request(
        &self,
        question: &Question,
        repair: Option<&Repair>,
        name: &str,
        start_s: f64,
        effort: &mut Effort,
    ) -> Result<Completion, ModelError> {
        self.check_health()?;
        let total_s = self.settings.total_timeout_s;
        let left_s = |wall: &dyn Wall| total_s - (wall.now_s() - start_s);
        let Some(_place) = self.places.take(left_s(&*self.wall).max(0.0)) else {
            return Err(ModelError::Busy { limit_s: total_s });
        };
        let mut attempt = 0;
        loop {
            let limit_s = left_s(&*self.wall).min(self.settings.timeout_s);
            if limit_s <= 0.0 {
                return Err(ModelError::TimedOut { limit_s: total_s });
            }
            let support = self.schema_support();
            let body = body_of(&self.settings, question, repair, support);
            let (error, asked_pause_s) = match self.send(question, &body, limit_s, effort) {
                Ok(Sent::Completion(completion)) => return Ok(completion),
                Ok(Sent::Failure(reply)) => {
                    let message = self.trace.hide(&message_of(&reply.body));
                    if refuses_form(reply.status, &message) && self.weaken(support) {
                        continue;
                    }
                    (failure_of(reply.status, message), reply.retry_after_s)
                }
                Err(error) => (error, None),
            };
            if attempt == self.settings.retries || !error.may_pass() {
                return Err(error);
            }
            let pause_s = self.pause_s(name, attempt, asked_pause_s)?;
            if pause_s >= left_s(&*self.wall) {
                return Err(error);
            }
            self.wall.pause(pause_s);
            effort.paused_s += pause_s;
            attempt += 1;
        }
    }

    /// One request within the budget.
    fn send(&self, question: &Question, body: &str, limit_s: f64, effort: &mut Effort) -> Result<Sent, ModelError> {
        let reserved = estimate(question, body, self.settings.max_tokens);
        self.budget.reserve(reserved)?;
        effort.requests += 1;
        let sent = self.transport.post(body, limit_s).and_then(|reply| match reply.status {
            200 => self.read(&reply.body, estimate(question, body, 0).input).map(Sent::Completion),
            _ => Ok(Sent::Failure(reply)),
        });
        // What a request without a completion cost is not known; servers count only those that they answer.
        let used = match &sent {
            Ok(Sent::Completion(completion)) => Tokens::counted(completion.input, completion.output),
            _ => Tokens::default(),
        };
        self.budget.book(reserved, used);
        effort.tokens.input += used.input;
        effort.tokens.output += used.output;
        sent
    }

    /// A completion without the key; `input` tokens count when the server did not count.
    fn read(&self, body: &[u8], input: u64) -> Result<Completion, ModelError> {
        let completion = read_completion(body).map_err(|error| error.with_words(|words| self.trace.hide(words)))?;
        Ok(Completion {
            text: self.trace.hide(&completion.text),
            thought: self.trace.hide(&completion.thought),
            input: if completion.input == 0 { input } else { completion.input },
            output: completion.output,
        })
    }

    /// The pause before the next attempt: as long as the server asks, or doubling with half of it drawn.
    fn pause_s(&self, name: &str, attempt: u32, asked_s: Option<u64>) -> Result<f64, ModelError> {
        if let Some(pause_s) = asked_s.map(|seconds| seconds as f64) {
            let limit_s = self.settings.max_pause_s;
            return if pause_s <= limit_s { Ok(pause_s) } else { Err(ModelError::PauseTooLong { pause_s, limit_s }) };
        }
        let whole_s = self.settings.backoff_s * f64::from(1_u32 << attempt.min(16));
        Ok(whole_s * (0.5 + 0.5 * draw(&format!("{}:{name}:{attempt}", self.settings.seed))))
    }

    /// Asks for the form of answers in the next weaker way; false when there is none.
    fn weaken(&self, tried: SchemaSupport) -> bool {
        let mut health = self.health.lock().unwrap_or_else(PoisonError::into_inner);
        let weaker = match tried {
            SchemaSupport::JsonSchema => SchemaSupport::JsonObject,
            SchemaSupport::JsonObject => SchemaSupport::Prompt,
            SchemaSupport::Prompt => return false,
        };
        health.support = health.support.max(weaker);
        true
    }

    fn check_health(&self) -> Result<(), ModelError> {
        let health = self.health.lock().unwrap_or_else(PoisonError::into_inner);
        let in_s = health.away_until_s - self.wall.now_s();
        if in_s > 0.0 {
            return Err(ModelError::Away { in_s, reason: health.reason.clone() });
        }
        Ok(())
    }

    /// Keeps in mind whether the server can be heard.
    fn learn(&self, error: Option<&ModelError>) {
        let mut health = self.health.lock().unwrap_or_else(PoisonError::into_inner);
        match error {
            Some(error) if error.is_silence() => {
                health.silent += 1;
                health.reason = error.to_string();
                if health.silent >= self.settings.away_after {
                    health.away_until_s = self.wall.now_s() + self.settings.away_s;
                }
            }
            Some(ModelError::Away { .. } | ModelError::Spent { .. } | ModelError::Busy { .. }) => {}
            _ => health.silent = 0,
        }
    }

    fn account(&self, question: &Question, name: String, effort: &Effort, error: Option<&ModelError>, wall_s: f64) {
        let ending = match (effort.cached, effort.repaired) {
            (true, _) => Ending::Cached,
            (false, true) => Ending::Repaired,
            (false, false) => Ending::Answered,
        };
        let mut event = Event {
            wanted: question.wanted,
            model: self.settings.model.clone(),
            question: name,
            ending,
            error: None,
            error_kind: None,
            requests: effort.requests,
            paused_s: effort.paused_s,
            wall_s,
            tokens: [effort.tokens.input, effort.tokens.output],
            task: question.task.to_owned(),
            data: question.data.clone(),
            pictures: question.pictures.len(),
            answer: effort.answer.clone(),
            thought: effort.thought.clone(),
        };
        if let Some(error) = error {
            event.fail(error);
        }
        let failed = u64::from(error.is_some());
        let cached = u64::from(effort.cached && effort.requests == 0 && error.is_none());
        self.budget.count(cached, failed, wall_s);
        self.trace.take(event);
    }
}

/// Opens the client of a file of models, with the key from the environment; `None` when the file has no language model.
///
/// # Errors
/// A file that cannot be used, a key that is not set, a record that cannot be opened.
pub fn open_client(file: &Path) -> Result<Option<Arc<Client>>, crate::OpenError> {
    let language = crate::settings::ModelSettings::load(file)?.language;
    language.map(|settings| open_with(settings, file)).transpose()
}

/// As [`open_client`], without the cache: what was answered once says nothing of the server as it is.
///
/// # Errors
/// As [`open_client`].
pub fn open_afresh(file: &Path) -> Result<Option<Arc<Client>>, crate::OpenError> {
    let language = crate::settings::ModelSettings::load(file)?.language;
    let afresh = |settings| LanguageSettings { cache: None, answers: Answers::Live, ..settings };
    language.map(|settings| open_with(afresh(settings), file)).transpose()
}

fn open_with(settings: LanguageSettings, file: &Path) -> Result<Arc<Client>, crate::OpenError> {
    let key = settings.get_key(file)?;
    let record = settings.record.clone().unwrap_or_default();
    let client = Client::open(settings, key.as_deref());
    client.map(Arc::new).map_err(|source| crate::OpenError::Record { file: record, source })
}

fn estimate(question: &Question, body: &str, max_tokens: u32) -> Tokens {
    let pictures: usize = question.pictures.iter().map(|picture| picture.data_url().len()).sum();
    Tokens::estimate(body.len().saturating_sub(pictures), question.pictures.len(), max_tokens)
}

/// What a status other than 200 means.
fn failure_of(status: u16, message: String) -> ModelError {
    match status {
        408 | 425 | 429 | 500 | 502..=504 | 529 => ModelError::Failing { status, message },
        _ => ModelError::Refused { status, message },
    }
}

impl Question {
    /// A question without pictures.
    pub(crate) fn of_words(wanted: Use, task: &'static str, data: Value, schema: Value) -> Self {
        Self { wanted, task, data, pictures: Vec::new(), schema }
    }
}
