//! `models.toml`: which server and model answers, within which limits. Every key is checked when the file is loaded.

use crate::networks::{DetectorSettings, NetworkFile, SegmenterSettings, SightSettings, TextSettings, VisualSettings};
use crate::wall::read_key;
use dsm::config::{ConfigError, read_toml};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelSettings {
    /// Version of the format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// The language or vision-language model. Default: the embedded backend speaks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub language: Option<LanguageSettings>,
    /// Finds things by their names. Default: what would detect without a file of models.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detector: Option<DetectorSettings>,
    /// Cuts out what lies in a box. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segmenter: Option<SegmenterSettings>,
    /// Visual features of things. Default: the embedded encoder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visual: Option<VisualSettings>,
    /// Text features of names. Default: the embedded encoder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub text: Option<TextSettings>,
    /// How frames are taken up by a detector or segmenter that is slow.
    #[serde(default)]
    pub sight: SightSettings,
}

/// A model behind an OpenAI-compatible server, and the limits within which it is asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LanguageSettings {
    /// Where the server's API begins, for example `http://127.0.0.1:8080/v1`. No default.
    pub url: String,
    /// The model, as the server names it. No default.
    pub model: String,
    /// Environment variable that holds the key; the key itself never stands in a file. Default none: no key is sent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key_env: Option<String>,
    /// What the model is asked for. Default: everything.
    #[serde(default = "Use::all")]
    #[schemars(length(min = 1))]
    pub uses: Vec<Use>,
    /// Whether the model sees pictures; without, uses that need them are left to the embedded backend. Default true.
    #[serde(default = "yes")]
    pub vision: bool,
    /// How the server is told the form of an answer. Servers that refuse are asked in the next weaker way. Default
    /// `json_schema`.
    #[serde(default)]
    pub schema: SchemaSupport,
    /// Where answers come from. Default `live`.
    #[serde(default)]
    pub answers: Answers,
    /// One request from the first byte sent to the last one read, seconds. Default 60, range 0.05 to 600.
    #[serde(default = "default_timeout_s")]
    #[schemars(range(min = 0.05, max = 600.0))]
    pub timeout_s: f64,
    /// Making a connection, seconds. Default 5, range 0.05 to 60.
    #[serde(default = "default_connect_timeout_s")]
    #[schemars(range(min = 0.05, max = 60.0))]
    pub connect_timeout_s: f64,
    /// One question with its retries, pauses and repair, seconds. Default 180, range 0.05 to 3600.
    #[serde(default = "default_total_timeout_s")]
    #[schemars(range(min = 0.05, max = 3600.0))]
    pub total_timeout_s: f64,
    /// Times that a request is sent again after a failure that may pass. Default 2, range 0 to 10.
    #[serde(default = "default_retries")]
    #[schemars(range(min = 0, max = 10))]
    pub retries: u32,
    /// Pause before the first retry, seconds; it doubles with each one, and half of it is drawn. Default 0.5, range 0 to 60.
    #[serde(default = "default_backoff_s")]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub backoff_s: f64,
    /// Longest pause that a server may ask for by `Retry-After`, seconds; the question fails at once when it asks for more.
    /// Default 30, range 0 to 600.
    #[serde(default = "default_max_pause_s")]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub max_pause_s: f64,
    /// Questions in a row that end without a word from the server until it counts as away. Default 3, range 1 to 100.
    #[serde(default = "default_away_after")]
    #[schemars(range(min = 1, max = 100))]
    pub away_after: u32,
    /// How long a server that is away is not asked, seconds. Default 30, range 0 to 3600.
    #[serde(default = "default_away_s")]
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub away_s: f64,
    /// Requests under way at a time. Default 4, range 1 to 64.
    #[serde(default = "default_max_concurrent")]
    #[schemars(range(min = 1, max = 64))]
    pub max_concurrent: u32,
    /// Longest answer, tokens. Default 1024, range 16 to 32768.
    #[serde(default = "default_max_tokens")]
    #[schemars(range(min = 16, max = 32768))]
    pub max_tokens: u32,
    /// Longest body of a reply that is read, bytes. Default 1048576, range 1024 to 16777216.
    #[serde(default = "default_max_response_bytes")]
    #[schemars(range(min = 1024, max = 16_777_216))]
    pub max_response_bytes: u64,
    /// Randomness of the model's words. Default 0, range 0 to 2.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub temperature: f64,
    /// Seed of the pauses between retries, also told to the server. Default 0, range 0 to 2147483647.
    #[serde(default)]
    #[schemars(range(min = 0, max = 2_147_483_647))]
    pub seed: u64,
    /// Price of a million tokens that are read by the model, US dollars. Default 0, range 0 to 10000.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub price_input_usd: f64,
    /// Price of a million tokens that are written by the model, US dollars. Default 0, range 0 to 10000.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub price_output_usd: f64,
    /// What may be spent in one run of the program, US dollars; then the embedded backend answers. Default: no limit. Range
    /// 0 to 100000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub budget_usd: Option<f64>,
    /// Tokens read and written in one run of the program. Default: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0))]
    pub budget_tokens: Option<u64>,
    /// Folder of answers by what was asked, relative to the file; asked again, they cost nothing. Default: none is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache: Option<PathBuf>,
    /// File to which prompts and answers are written, one JSON object a line, without keys. Relative to the file. Default:
    /// none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<PathBuf>,
    /// How frames are taken up while a map is built.
    #[serde(default)]
    pub frames: FrameSettings,
}

/// How frames are taken up while a map is built. Seconds are those of the frames' stamps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FrameSettings {
    /// Time between two frames that are asked about, seconds. Default 2, range 0 to 600.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub every_s: f64,
    /// Frames that are asked about in one run. Default 200, range 0 to 100000.
    #[schemars(range(min = 0, max = 100_000))]
    pub most_frames: u32,
    /// Frames under way at a time; further ones are left out. Default 4, range 1 to 64.
    #[schemars(range(min = 1, max = 64))]
    pub most_pending: u32,
    /// Objects in one question. Default 6, range 1 to 20.
    #[schemars(range(min = 1, max = 20))]
    pub objects_per_call: u32,
    /// Views of one object that are asked about. Default 2, range 1 to 20.
    #[schemars(range(min = 1, max = 20))]
    pub views_per_object: u32,
    /// Least visible pixels of an object that is asked about. Default 400, range 1 to 1000000.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub min_pixels: u32,
    /// Longer side of the picture that is sent, pixels. Default 640, range 64 to 2048.
    #[schemars(range(min = 64, max = 2048))]
    pub picture_px: u32,
    /// An answer shows at the frame's stamp plus this, seconds, however fast the model is. Default 6, range 0 to 600.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub latency_s: f64,
    /// Weight of the model's name for a thing, where a sure detection nearby weighs 1. Default 2, range 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub name_weight: f64,
    /// Weight of the model's word for an attribute, where the embedded describer's likeliest weighs up to 1 a frame.
    /// Default 6, range 0.01 to 100.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub attribute_weight: f64,
}

impl Default for FrameSettings {
    fn default() -> Self {
        Self {
            every_s: 2.0,
            most_frames: 200,
            most_pending: 4,
            objects_per_call: 6,
            views_per_object: 2,
            min_pixels: 400,
            picture_px: 640,
            latency_s: 6.0,
            name_weight: 2.0,
            attribute_weight: 6.0,
        }
    }
}

/// What a model is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Use {
    /// What stands in a picture, as words for a detector.
    Tags,
    /// Name, appearance, physical properties and affordances of marked things.
    Attributes,
    /// Semantic relations between marked things.
    Relations,
    /// From words to a query.
    Parse,
    /// How well stored relations fit the described ones.
    Score,
    /// The last look at the few best candidates.
    Verify,
    /// Which of a benchmark's labels an object is.
    Labels,
}

impl Use {
    /// Every use.
    pub fn all() -> Vec<Self> {
        vec![Self::Tags, Self::Attributes, Self::Relations, Self::Parse, Self::Score, Self::Verify, Self::Labels]
    }

    /// Its word in files and traces.
    pub fn word(self) -> &'static str {
        match self {
            Self::Tags => "tags",
            Self::Attributes => "attributes",
            Self::Relations => "relations",
            Self::Parse => "parse",
            Self::Score => "score",
            Self::Verify => "verify",
            Self::Labels => "labels",
        }
    }
}

/// How a server is told the form of an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SchemaSupport {
    /// `response_format` with a JSON schema, to which the server holds the model.
    #[default]
    JsonSchema,
    /// `response_format` that asks for any JSON; the schema stands in the prompt.
    JsonObject,
    /// The schema stands in the prompt alone.
    Prompt,
}

/// Where answers come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Answers {
    /// From the cache if it has them, else from the server.
    #[default]
    Live,
    /// From the cache alone: no network is used, and what it lacks is left to the embedded backend.
    Cached,
}

/// Why a file of models cannot be used.
#[derive(Debug, Error)]
pub enum SettingsError {
    /// The file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A key is asked for and not set.
    #[error("{}: key_env: the environment variable `{variable}` is not set", file.display())]
    NoKey {
        /// The file.
        file: PathBuf,
        /// The variable.
        variable: String,
    },
    /// A value that no range tells.
    #[error("{}: {key} is `{value}`; expected {expected}", file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it should be.
        expected: &'static str,
    },
}

impl ModelSettings {
    /// Reads and checks a file; paths in it are taken from its folder.
    ///
    /// # Errors
    /// A file that cannot be read, an unknown key, a value outside its range.
    pub fn load(file: &Path) -> Result<Self, SettingsError> {
        let mut settings: Self = read_toml(file)?;
        let folder = file.parent().unwrap_or(Path::new("."));
        if let Some(language) = &mut settings.language {
            language.check(file)?;
            for path in [&mut language.cache, &mut language.record].into_iter().flatten() {
                *path = folder.join(&*path);
            }
        }
        for (key, network) in settings.files_mut() {
            network.check(file, key)?;
            network.file = folder.join(&network.file);
        }
        settings.check_parts(file)?;
        Ok(settings)
    }

    /// Every file of a network, with the key under which it stands.
    pub fn files(&self) -> Vec<(&'static str, NetworkFile)> {
        let mut copy = self.clone();
        copy.files_mut().into_iter().map(|(key, file)| (key, file.clone())).collect()
    }

    /// Whether a network is asked for.
    pub fn has_networks(&self) -> bool {
        self.detector.is_some() || self.segmenter.is_some() || self.visual.is_some() || self.text.is_some()
    }

    fn files_mut(&mut self) -> Vec<(&'static str, &mut NetworkFile)> {
        let mut files = Vec::new();
        if let Some(detector) = &mut self.detector {
            files.push(("detector.network", &mut detector.network));
            files.push(("detector.text", &mut detector.text));
            files.push(("detector.tokenizer", &mut detector.tokenizer));
        }
        if let Some(segmenter) = &mut self.segmenter {
            files.push(("segmenter.encoder", &mut segmenter.encoder));
            files.push(("segmenter.decoder", &mut segmenter.decoder));
        }
        if let Some(visual) = &mut self.visual {
            files.push(("visual.network", &mut visual.network));
        }
        if let Some(text) = &mut self.text {
            files.push(("text.network", &mut text.network));
            files.push(("text.tokenizer", &mut text.tokenizer));
        }
        files
    }

    /// What no range tells: parts that need each other.
    fn check_parts(&self, file: &Path) -> Result<(), SettingsError> {
        let wrong = |key: &'static str, value: &str, expected: &'static str| {
            Err(SettingsError::Value { file: file.to_owned(), key, value: value.to_owned(), expected })
        };
        if self.language.is_none() && !self.has_networks() {
            return wrong("language", "missing", "[language], [detector], [segmenter], [visual] or [text]");
        }
        if self.detector.is_some() && self.segmenter.is_none() {
            return wrong(
                "segmenter",
                "missing",
                "[segmenter] beside [detector]: a detector gives boxes, a map needs masks",
            );
        }
        let words = self.detector.iter().flat_map(|detector| &detector.vocabulary);
        match words.clone().find(|word| word.trim().is_empty() || word.len() > 80) {
            Some(word) => wrong("detector.vocabulary", word, "names of one to 80 bytes"),
            None => Ok(()),
        }
    }
}

impl LanguageSettings {
    /// A model with the default limits.
    pub fn new(url: impl Into<String>, model: impl Into<String>) -> Self {
        Self {
            url: url.into(),
            model: model.into(),
            key_env: None,
            uses: Use::all(),
            vision: true,
            schema: SchemaSupport::default(),
            answers: Answers::default(),
            timeout_s: default_timeout_s(),
            connect_timeout_s: default_connect_timeout_s(),
            total_timeout_s: default_total_timeout_s(),
            retries: default_retries(),
            backoff_s: default_backoff_s(),
            max_pause_s: default_max_pause_s(),
            away_after: default_away_after(),
            away_s: default_away_s(),
            max_concurrent: default_max_concurrent(),
            max_tokens: default_max_tokens(),
            max_response_bytes: default_max_response_bytes(),
            temperature: 0.0,
            seed: 0,
            price_input_usd: 0.0,
            price_output_usd: 0.0,
            budget_usd: None,
            budget_tokens: None,
            cache: None,
            record: None,
            frames: FrameSettings::default(),
        }
    }

    /// The key, from the environment alone; `None` when none is asked for.
    ///
    /// # Errors
    /// [`SettingsError::NoKey`] when the variable is not set or empty.
    pub fn get_key(&self, file: &Path) -> Result<Option<String>, SettingsError> {
        // Answers from the cache need no key.
        let Some(variable) = self.key_env.as_ref().filter(|_| self.answers == Answers::Live) else { return Ok(None) };
        match read_key(variable) {
            Some(key) => Ok(Some(key)),
            None => Err(SettingsError::NoKey { file: file.to_owned(), variable: variable.clone() }),
        }
    }

    /// Whether the model is asked for this.
    pub fn serves(&self, wanted: Use) -> bool {
        let sees = self.vision || !matches!(wanted, Use::Tags | Use::Attributes | Use::Relations | Use::Verify);
        sees && self.uses.contains(&wanted)
    }

    fn check(&self, file: &Path) -> Result<(), SettingsError> {
        let wrong = |key: &'static str, value: &str, expected: &'static str| {
            Err(SettingsError::Value { file: file.to_owned(), key, value: value.to_owned(), expected })
        };
        let host = self.url.strip_prefix("http://").or_else(|| self.url.strip_prefix("https://"));
        let plain = |c: char| c.is_ascii_graphic();
        if host.is_none_or(|host| host.is_empty() || host.starts_with('/') || host.contains('@')) {
            return wrong("language.url", &self.url, "http:// or https:// with a host and no user name");
        }
        if !self.url.chars().all(plain) {
            return wrong("language.url", &self.url, "printable ASCII without spaces");
        }
        if self.model.trim().is_empty() || self.model.len() > 200 {
            return wrong("language.model", &self.model, "the name of a model, at most 200 bytes");
        }
        let name = |c: char| c.is_ascii_alphanumeric() || c == '_';
        match &self.key_env {
            Some(variable) if variable.is_empty() || !variable.chars().all(name) => {
                wrong("language.key_env", "(hidden)", "the name of an environment variable, not a key")
            }
            _ => Ok(()),
        }
    }
}

fn yes() -> bool {
    true
}

fn default_timeout_s() -> f64 {
    60.0
}

fn default_connect_timeout_s() -> f64 {
    5.0
}

fn default_total_timeout_s() -> f64 {
    180.0
}

fn default_retries() -> u32 {
    2
}

fn default_backoff_s() -> f64 {
    0.5
}

fn default_max_pause_s() -> f64 {
    30.0
}

fn default_away_after() -> u32 {
    3
}

fn default_away_s() -> f64 {
    30.0
}

fn default_max_concurrent() -> u32 {
    4
}

fn default_max_tokens() -> u32 {
    1024
}

fn default_max_response_bytes() -> u64 {
    1 << 20
}
