//! JSON in what a model wrote: bare, in a fence, or in the middle of prose.

use serde_json::Value;

/// Longest text in which JSON is looked for, bytes.
const MAX_TEXT: usize = 256 * 1024;
/// Places at which a value may begin that are tried.
const MAX_TRIES: usize = 64;

/// The JSON object or list in a text: the whole text, else what stands in a fence, else the first one that is whole.
///
/// # Errors
/// What is wrong, in words for the model.
pub(crate) fn find_json(text: &str) -> Result<Value, String> {
    let text = text.trim().trim_start_matches('\u{feff}');
    if text.is_empty() {
        return Err("there is no answer".to_owned());
    }
    if text.len() > MAX_TEXT {
        return Err(format!("it is longer than {MAX_TEXT} bytes"));
    }
    if let Ok(value) = serde_json::from_str::<Value>(text) {
        return match value {
            // A model that was told to write JSON in a string.
            Value::String(inner) => find_json_once(&inner),
            Value::Object(_) | Value::Array(_) => Ok(value),
            _ => Err("it is no JSON object".to_owned()),
        };
    }
    find_json_once(text)
}

fn find_json_once(text: &str) -> Result<Value, String> {
    let fenced = text.split("```").nth(1).map(|inside| inside.trim_start_matches("json").trim());
    for part in fenced.into_iter().chain([text]) {
        let starts = part.char_indices().filter(|(_, c)| matches!(c, '{' | '[')).map(|(at, _)| at).take(MAX_TRIES);
        for start in starts {
            let mut values = serde_json::Deserializer::from_str(&part[start..]).into_iter::<Value>();
            if let Some(Ok(value)) = values.next()
                && is_answer(&value)
            {
                return Ok(value);
            }
        }
    }
    let opened = text.contains('{');
    Err(if opened { "the JSON is broken or cut off".to_owned() } else { "there is no JSON in it".to_owned() })
}

/// Whether a value in prose may be the answer: lists of plain numbers, as in "[1]", are not.
fn is_answer(value: &Value) -> bool {
    match value {
        Value::Object(object) => !object.is_empty(),
        Value::Array(items) => items.iter().any(Value::is_object),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    //! Contract: JSON is found where models put it; broken and cut JSON is none, however deep or long it is.
    use super::*;
    use serde_json::json;

    #[test]
    fn json_is_found_where_models_put_it() {
        let wanted = json!({"a": [1, {"b": "}"}]});
        for text in [
            r#"{"a": [1, {"b": "}"}]}"#,
            "\u{feff} {\"a\": [1, {\"b\": \"}\"}]}\n",
            "```json\n{\"a\": [1, {\"b\": \"}\"}]}\n```",
            "Here you are:\n```\n{\"a\": [1, {\"b\": \"}\"}]}\n```\nIs it right?",
            "As [1] says, {x} holds. {\"a\": [1, {\"b\": \"}\"}]} I hope this helps {}",
            "\"{\\\"a\\\": [1, {\\\"b\\\": \\\"}\\\"}]}\"",
        ] {
            assert_eq!(find_json(text).as_ref(), Ok(&wanted), "{text}");
        }
    }

    #[test]
    fn what_is_no_json_is_none() {
        let deep = "[".repeat(100_000);
        let long = format!("{{\"a\": \"{}\"}}", "x".repeat(MAX_TEXT));
        let many = "{".repeat(5_000);
        for text in [
            "",
            "  ",
            "I cannot help with that.",
            "{\"a\": [1, 2",
            "{a: 1}",
            "42",
            "null",
            "[1, 2]x",
            &deep,
            &long,
            &many,
        ] {
            assert!(find_json(text).is_err(), "{}", &text[..text.len().min(40)]);
        }
    }
}
