//! The form of an answer: a JSON schema made from a Rust type, with lists of choices put in.
//!
//! The model's thoughts come first in every answer and stand apart from what counts, so that it can think before it
//! decides.

use schemars::{JsonSchema, SchemaGenerator, generate::SchemaSettings};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// An answer with the thoughts that led to it.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Envelope<T> {
    /// Short reasoning, step by step. It is not read as part of the answer.
    pub(crate) thought: String,
    /// The answer.
    pub(crate) answer: T,
}

/// The schema of an answer of type `T`. Every property named in `choices` may hold only those values.
pub(crate) fn schema_of<T: JsonSchema>(choices: &[(&str, Vec<Value>)]) -> Value {
    let generator: SchemaGenerator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<Envelope<T>>().to_value();
    trim(&mut schema, choices);
    schema
}

/// Takes out what servers of strict schemas refuse, and puts the choices in.
fn trim(schema: &mut Value, choices: &[(&str, Vec<Value>)]) {
    match schema {
        Value::Object(object) => {
            for key in ["$schema", "title", "format", "default", "minimum", "maximum"] {
                // A property may bear such a name; then it holds a schema.
                if object.get(key).is_some_and(|value| !value.is_object()) {
                    object.remove(key);
                }
            }
            flatten_words(object);
            if let Some(properties) = object.get_mut("properties").and_then(Value::as_object_mut) {
                for (name, values) in choices {
                    if let Some(property) = properties.get_mut(*name) {
                        choose(property, values);
                    }
                }
            }
            object.values_mut().for_each(|value| trim(value, choices));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| trim(item, choices)),
        _ => {}
    }
}

/// Words that stand as alternatives of their own, each with its meaning, as one list: strict servers know no `oneOf`.
fn flatten_words(object: &mut serde_json::Map<String, Value>) {
    let Some(alternatives) = object.get("oneOf").and_then(Value::as_array) else { return };
    let word = |value: &Value| value.get("const").filter(|word| word.is_string()).cloned();
    let words: Option<Vec<Value>> = alternatives.iter().map(word).collect();
    if let Some(words) = words {
        object.remove("oneOf");
        object.insert("type".to_owned(), Value::String("string".to_owned()));
        object.insert("enum".to_owned(), Value::Array(words));
    }
}

/// Puts choices into a property, or into the items of a list.
fn choose(property: &mut Value, values: &[Value]) {
    let Some(object) = property.as_object_mut() else { return };
    match object.get_mut("items").and_then(Value::as_object_mut) {
        Some(items) => items.insert("enum".to_owned(), Value::Array(values.to_vec())),
        None => object.insert("enum".to_owned(), Value::Array(values.to_vec())),
    };
}

/// Reads an answer, with or without its thoughts.
pub(crate) fn read<T: DeserializeOwned>(value: Value) -> Result<(T, String), String> {
    let enveloped = value.as_object().is_some_and(|object| object.contains_key("answer"));
    if !enveloped {
        // Servers without schemas: models like to leave the thoughts out.
        return serde_json::from_value(value).map(|answer| (answer, String::new())).map_err(|e| e.to_string());
    }
    let mut value = value;
    if let Some(object) = value.as_object_mut()
        && !object.get("thought").is_some_and(Value::is_string)
    {
        object.insert("thought".to_owned(), Value::String(String::new()));
    }
    let Envelope { thought, answer } = serde_json::from_value(value).map_err(|error| error.to_string())?;
    Ok((answer, thought))
}

#[cfg(test)]
mod tests {
    //! Contract: schemas name every choice, require every property and allow no other; thoughts stand apart.
    use super::*;
    use serde_json::json;

    #[derive(Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct Pick {
        /// The best.
        best: String,
        others: Vec<u32>,
        how: How,
    }

    #[derive(Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    enum How {
        /// Well.
        Well,
        /// Badly.
        Badly,
    }

    #[test]
    fn choices_stand_in_the_schema() {
        let schema = schema_of::<Pick>(&[("best", vec![json!("a"), json!("b")]), ("others", vec![json!(1)])]);
        let text = schema.to_string();
        assert!(!text.contains("$schema") && !text.contains("uint32"), "{text}");
        let pick = schema.pointer("/$defs/Pick").unwrap();
        assert_eq!(pick["properties"]["best"]["enum"], json!(["a", "b"]));
        assert_eq!(pick["properties"]["others"]["items"]["enum"], json!([1]));
        assert_eq!(
            (&pick["additionalProperties"], &pick["required"]),
            (&json!(false), &json!(["best", "others", "how"]))
        );
        assert_eq!(schema["required"], json!(["thought", "answer"]));
        assert_eq!(schema.pointer("/$defs/How/enum"), Some(&json!(["well", "badly"])));
        assert!(!text.contains("oneOf"), "{text}");
    }

    #[test]
    fn thoughts_stand_apart() {
        let pick = || Pick { best: "a".into(), others: vec![], how: How::Well };
        let plain = json!({"best": "a", "others": [], "how": "well"});
        assert_eq!(read(plain.clone()), Ok((pick(), String::new())));
        assert_eq!(read(json!({"thought": "hm", "answer": plain})), Ok((pick(), "hm".to_owned())));
        assert_eq!(read(json!({"answer": {"best": "a", "others": [], "how": "well"}})), Ok((pick(), String::new())));
        assert!(read::<Pick>(json!({"best": "a", "others": [], "how": "well", "gripper": "open"})).is_err());
        assert!(
            read::<Pick>(json!({"thought": "", "answer": {"best": "a", "others": [], "how": "well"}, "act": 1}))
                .is_err()
        );
    }
}
