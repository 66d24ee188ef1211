//! The protocol: requests and replies of `chat/completions` as OpenAI, vLLM, Ollama and llama.cpp speak it.

use crate::error::{ModelError, shortened};
use crate::question::{Question, Repair};
use crate::settings::{LanguageSettings, SchemaSupport};
use crate::thought::split_thought;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Longest answer and longest thought that are kept, characters.
const MAX_KEPT: usize = 100_000;

/// What a model wrote.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Completion {
    /// Its answer, without thoughts.
    pub(crate) text: String,
    /// Its thoughts, where the server or the model marks them.
    pub(crate) thought: String,
    /// Tokens that it read and wrote, by the server's count.
    pub(crate) input: u64,
    pub(crate) output: u64,
}

/// The limits that are part of a question's name.
pub(crate) fn limits_of(settings: &LanguageSettings) -> Value {
    json!({"max_tokens": settings.max_tokens, "temperature": settings.temperature, "seed": settings.seed})
}

/// The body of a request.
pub(crate) fn body_of(
    settings: &LanguageSettings,
    question: &Question,
    repair: Option<&Repair>,
    support: SchemaSupport,
) -> String {
    let mut messages = question.messages(repair);
    if support != SchemaSupport::JsonSchema
        && let Some(system) = messages.pointer_mut("/0/content")
    {
        let schema = &question.schema;
        let form = format!("{}\nAnswer with one JSON value of this schema and nothing else:\n{schema}", question.task);
        *system = Value::String(form);
    }
    let mut body = json!({
        "model": settings.model,
        "messages": messages,
        "max_tokens": settings.max_tokens,
        "temperature": settings.temperature,
        "seed": settings.seed,
        "stream": false,
    });
    let format = match support {
        SchemaSupport::JsonSchema => Some(json!({
            "type": "json_schema",
            "json_schema": {"name": question.wanted.word(), "strict": true, "schema": question.schema},
        })),
        SchemaSupport::JsonObject => Some(json!({"type": "json_object"})),
        SchemaSupport::Prompt => None,
    };
    if let (Some(format), Some(body)) = (format, body.as_object_mut()) {
        body.insert("response_format".to_owned(), format);
    }
    body.to_string()
}

/// Reads a reply of status 200.
pub(crate) fn read_completion(body: &[u8]) -> Result<Completion, ModelError> {
    let wrong = |reason: &str| ModelError::NoCompletion { reason: shortened(reason, 200) };
    let value: Value = serde_json::from_slice(body).map_err(|error| wrong(&error.to_string()))?;
    if let Some(error) = value.get("error").filter(|error| !error.is_null()) {
        return Err(wrong(&format!("it holds an error: {error}")));
    }
    let message = value.pointer("/choices/0/message").ok_or_else(|| wrong("it has no choices"))?;
    if let Some(refusal) = message.get("refusal").and_then(Value::as_str).filter(|words| !words.is_empty()) {
        return Err(ModelError::Declined { words: shortened(refusal, 200) });
    }
    let written = match message.get("content") {
        Some(Value::String(text)) => text.clone(),
        Some(Value::Array(parts)) => parts.iter().filter_map(|part| part.get("text")?.as_str()).collect(),
        _ => String::new(),
    };
    let (text, marked) = split_thought(&kept(&written));
    let apart = ["reasoning_content", "reasoning", "thinking"];
    let apart = apart.iter().find_map(|key| message.get(*key)?.as_str()).unwrap_or("");
    let thought = [kept(apart), marked].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("\n");
    let count = |key: &str| value.pointer(&format!("/usage/{key}")).and_then(Value::as_u64);
    // A server that does not count is believed to have cost what the words suggest.
    let output = count("completion_tokens").unwrap_or(written.len() as u64 / 3);
    Ok(Completion { text, thought, input: count("prompt_tokens").unwrap_or(0), output })
}

fn kept(text: &str) -> String {
    text.chars().take(MAX_KEPT).collect()
}

/// What a server says of an error, in its own words.
pub(crate) fn message_of(body: &[u8]) -> String {
    let text = String::from_utf8_lossy(&body[..body.len().min(4096)]);
    let value: Option<Value> = serde_json::from_slice(body).ok();
    let said = value.as_ref().and_then(|value| {
        let said = value.pointer("/error/message").or(value.get("error")).or(value.get("message"))?;
        said.as_str().map(str::to_owned)
    });
    shortened(said.as_deref().unwrap_or(&text), 200)
}

/// Whether a refusal speaks of the form of answers, which can be asked for otherwise.
pub(crate) fn refuses_form(status: u16, message: &str) -> bool {
    let message = message.to_lowercase();
    let words = ["response_format", "json_schema", "json schema", "schema", "structured", "grammar", "json_object"];
    matches!(status, 400 | 404 | 415 | 422 | 500 | 501) && words.iter().any(|word| message.contains(word))
}
