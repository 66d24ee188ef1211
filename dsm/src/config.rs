//! TOML files with errors that say where, what was expected and what was probably meant.
//!
//! The JSON schema of the target type (derived by `schemars`) is the single source: its property names give the
//! valid keys, its `minimum`/`maximum`/`exclusiveMinimum`/`exclusiveMaximum` the ranges, its `enum`/`const` the words.
//! Declare ranges with `#[schemars(range(min = 0.0, max = 1.0))]` and the loader holds them.
//!
//! ```
//! #[derive(serde::Deserialize, schemars::JsonSchema, Debug)]
//! #[serde(deny_unknown_fields)]
//! struct Wheel {
//!     #[schemars(range(min = 0.01, max = 1.0))]
//!     radius_m: f64,
//! }
//! let error = dsm::config::parse_toml::<Wheel>("radiu_m = 0.1", "wheel.toml".as_ref()).unwrap_err();
//! assert_eq!(error.to_string(), "wheel.toml:1: unknown key `radiu_m`; did you mean `radius_m`? valid keys: radius_m");
//! ```

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::ops::Range;
use std::path::{Path, PathBuf};
use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What is wrong with a configuration file. Lines count from 1.
#[derive(Debug, Error, PartialEq)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The operating system's words.
        reason: String,
    },
    /// The text is no TOML, or a value has the wrong type, or a required key is missing.
    #[error("{}:{line}: {message}", file.display())]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// What is wrong and what was expected.
        message: String,
    },
    /// A key that nobody reads.
    #[error("{}:{line}: unknown key `{key}`;{} valid keys: {}", file.display(), suggestion(nearest), valid.join(", "))]
    UnknownKey {
        /// The file.
        file: PathBuf,
        /// The line of the key.
        line: usize,
        /// The key as written, with the path to it (`base.spede`).
        key: String,
        /// The valid key most like it, when one is close.
        nearest: Option<String>,
        /// All valid keys at this place.
        valid: Vec<String>,
    },
    /// A value outside its range, or none of the allowed words.
    #[error("{}:{line}: `{key}` is {value}; expected {expected}", file.display())]
    OutOfRange {
        /// The file.
        file: PathBuf,
        /// The line of the value.
        line: usize,
        /// The key with the path to it.
        key: String,
        /// The value as written.
        value: String,
        /// The range or the allowed words.
        expected: String,
    },
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |near| format!(" did you mean `{near}`?"))
}

/// Reads a TOML file into `T`. See [`parse_toml`].
pub fn read_toml<T: DeserializeOwned + JsonSchema>(file: &Path) -> Result<T, ConfigError> {
    let text = std::fs::read_to_string(file)
        .map_err(|error| ConfigError::Unreadable { file: file.to_owned(), reason: error.to_string() })?;
    parse_toml(&text, file)
}

/// Parses TOML text into `T`; `file` only names the source in errors.
///
/// Checks, in this order: the syntax, the keys, the ranges and words of the schema, then serde's own rules.
pub fn parse_toml<T: DeserializeOwned + JsonSchema>(text: &str, file: &Path) -> Result<T, ConfigError> {
    let at = Source { file, text };
    let table = DeTable::parse(text).map_err(|error| at.invalid(&error))?;
    let schema = schemars::schema_for!(T);
    let walk = Walk { at: &at, root: schema.as_value() };
    walk.check_table(table.get_ref(), schema.as_value(), "")?;
    toml::from_str(text).map_err(|error| at.invalid(&error))
}

/// The candidate most like `word`, when it is close enough to be what was meant. Ties go to the first.
pub fn find_nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut best: Option<(f64, &str)> = None;
    for candidate in candidates {
        let likeness = strsim::jaro_winkler(&word.to_lowercase(), &candidate.to_lowercase());
        // 0.75 keeps `spede`/`speed` and drops words that only share a first letter.
        if likeness >= 0.75 && best.is_none_or(|(top, _)| likeness > top) {
            best = Some((likeness, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// The line, counted from 1, that holds the byte at `offset`.
pub fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|byte| **byte == b'\n').count()
}

struct Source<'a> {
    file: &'a Path,
    text: &'a str,
}

impl Source<'_> {
    fn line(&self, span: &Range<usize>) -> usize {
        line_of(self.text, span.start)
    }

    fn invalid(&self, error: &toml::de::Error) -> ConfigError {
        let line = error.span().map_or(1, |span| self.line(&span));
        ConfigError::Invalid { file: self.file.to_owned(), line, message: error.message().trim().replace('\n', "; ") }
    }

    fn out_of_range(&self, span: &Range<usize>, key: &str, expected: String) -> ConfigError {
        ConfigError::OutOfRange {
            file: self.file.to_owned(),
            line: self.line(span),
            key: key.to_owned(),
            value: self.text[span.clone()].to_owned(),
            expected,
        }
    }
}

/// A walk over the parsed TOML along the schema.
struct Walk<'a> {
    at: &'a Source<'a>,
    root: &'a Value,
}

impl<'a> Walk<'a> {
    /// Follows `$ref` to the definition.
    fn resolve(&self, mut schema: &'a Value) -> &'a Value {
        while let Some(target) = schema.get("$ref").and_then(Value::as_str).and_then(|r| r.strip_prefix('#')) {
            match self.root.pointer(target) {
                Some(found) => schema = found,
                None => break,
            }
        }
        schema
    }

    /// The schemas of which one must fit, `null` (an absent `Option`) left out.
    fn alternatives(&self, schema: &'a Value) -> Vec<&'a Value> {
        let listed = schema.get("anyOf").or_else(|| schema.get("oneOf")).and_then(Value::as_array);
        listed.map_or_else(Vec::new, |all| {
            let not_null = |s: &&Value| s.get("type").and_then(Value::as_str) != Some("null");
            all.iter().map(|s| self.resolve(s)).filter(not_null).collect()
        })
    }

    fn check(&self, value: &Spanned<DeValue<'_>>, schema: &'a Value, key: &str) -> Result<(), ConfigError> {
        let schema = self.resolve(schema);
        self.check_bounds(value, schema, key)?;
        match value.get_ref() {
            DeValue::Table(table) => self.check_table(table, schema, key),
            DeValue::Array(items) => {
                self.check_length(value, items.len(), schema, key)?;
                if let Some(item_schema) = schema.get("items") {
                    for (index, item) in items.iter().enumerate() {
                        self.check(item, item_schema, &format!("{key}[{index}]"))?;
                    }
                }
                Ok(())
            }
            _ => match self.alternatives(schema).as_slice() {
                [] => Ok(()),
                [only] => self.check(value, only, key),
                many => self.check_word(value, many, key),
            },
        }
    }

    fn check_table(&self, table: &DeTable<'_>, schema: &'a Value, path: &str) -> Result<(), ConfigError> {
        let schema = self.resolve(schema);
        let alternatives = self.alternatives(schema);
        // Properties may stand beside `oneOf` (a flattened enum); then each side knows some of the keys.
        let mut layers = vec![schema];
        match alternatives.as_slice() {
            [] => {}
            [only] => layers.push(only),
            many => match self.find_variant(table, many, path)? {
                Some(variant) => layers.push(variant),
                // Untagged: only serde can tell which one was meant.
                None => return Ok(()),
            },
        }
        let property = |name: &str| layers.iter().find_map(|layer| layer.get("properties")?.get(name));
        let free = layers.iter().find_map(|layer| layer.get("additionalProperties").filter(|extra| extra.is_object()));
        let names: Vec<String> = layers
            .iter()
            .filter_map(|layer| layer.get("properties").and_then(Value::as_object))
            .flat_map(|properties| properties.keys().cloned())
            .collect();
        for (name, value) in table {
            let key = if path.is_empty() { name.get_ref().to_string() } else { format!("{path}.{}", name.get_ref()) };
            match property(name.get_ref()).or(free) {
                Some(inner) => self.check(value, inner, &key)?,
                None if names.is_empty() => {}
                None => {
                    return Err(ConfigError::UnknownKey {
                        file: self.at.file.to_owned(),
                        line: self.at.line(&name.span()),
                        key,
                        nearest: find_nearest(name.get_ref(), names.iter().map(String::as_str)).map(str::to_owned),
                        valid: names,
                    });
                }
            }
        }
        Ok(())
    }

    /// The variant of a tagged enum that the table's tag names; `None` when the variants carry no common tag.
    fn find_variant(
        &self,
        table: &DeTable<'_>,
        variants: &[&'a Value],
        path: &str,
    ) -> Result<Option<&'a Value>, ConfigError> {
        let constants = |variant: &&'a Value| -> Vec<(&'a str, &'a str)> {
            let properties = variant.get("properties").and_then(Value::as_object);
            properties.map_or_else(Vec::new, |all| {
                all.iter().filter_map(|(name, s)| Some((name.as_str(), s.get("const")?.as_str()?))).collect()
            })
        };
        let Some((tag, _)) = variants.first().and_then(|first| constants(first).first().copied()) else {
            return Ok(None);
        };
        let word_of = |variant: &&'a Value| constants(variant).iter().find(|(name, _)| *name == tag).map(|(_, w)| *w);
        let Some((_, written)) = table.iter().find(|(name, _)| name.get_ref() == tag) else {
            return Ok(None);
        };
        let Some(word) = written.get_ref().as_str() else {
            return Ok(None);
        };
        if let Some(variant) = variants.iter().find(|variant| word_of(variant) == Some(word)) {
            return Ok(Some(variant));
        }
        let words: Vec<&str> = variants.iter().filter_map(word_of).collect();
        let key = if path.is_empty() { tag.to_owned() } else { format!("{path}.{tag}") };
        Err(self.at.out_of_range(&written.span(), &key, words_expected(word, &words)))
    }

    fn check_word(&self, value: &Spanned<DeValue<'_>>, variants: &[&'a Value], key: &str) -> Result<(), ConfigError> {
        // Words with a doc line stand alone as `const`, the others together as `enum`.
        let listed = |v: &&'a Value| match (v.get("const"), v.get("enum").and_then(Value::as_array)) {
            (Some(word), _) => vec![word],
            (None, Some(all)) => all.iter().collect(),
            (None, None) => vec![&Value::Null],
        };
        let words: Option<Vec<&str>> = variants.iter().flat_map(listed).map(Value::as_str).collect();
        match (value.get_ref().as_str(), words) {
            (Some(word), Some(words)) if !words.contains(&word) => {
                Err(self.at.out_of_range(&value.span(), key, words_expected(word, &words)))
            }
            _ => Ok(()),
        }
    }

    fn check_bounds(&self, value: &Spanned<DeValue<'_>>, schema: &Value, key: &str) -> Result<(), ConfigError> {
        if let (Some(listed), Some(word)) = (schema.get("enum").and_then(Value::as_array), value.get_ref().as_str()) {
            let words: Vec<&str> = listed.iter().filter_map(Value::as_str).collect();
            if !words.is_empty() && !words.contains(&word) {
                return Err(self.at.out_of_range(&value.span(), key, words_expected(word, &words)));
            }
        }
        let Some(number) = as_number(value.get_ref()) else { return Ok(()) };
        let bound = |name: &str| schema.get(name).and_then(Value::as_f64);
        let (min, max) = (bound("minimum"), bound("maximum"));
        let (above, below) = (bound("exclusiveMinimum"), bound("exclusiveMaximum"));
        let numeric = schema.get("type").is_some_and(|kind| mentions(kind, "number") || mentions(kind, "integer"));
        let fits = min.is_none_or(|b| number >= b)
            && max.is_none_or(|b| number <= b)
            && above.is_none_or(|b| number > b)
            && below.is_none_or(|b| number < b);
        // No quantity of ours may be nan or infinite, declared range or not.
        if fits && (number.is_finite() || !numeric) {
            return Ok(());
        }
        let mut expected = Vec::new();
        for (sign, limit) in [(">=", min), (">", above), ("<=", max), ("<", below)] {
            if let Some(limit) = limit {
                expected.push(format!("{sign} {limit}"));
            }
        }
        if expected.is_empty() {
            expected.push("a finite number".to_owned());
        }
        Err(self.at.out_of_range(&value.span(), key, expected.join(" and ")))
    }

    fn check_length(
        &self,
        value: &Spanned<DeValue<'_>>,
        length: usize,
        schema: &Value,
        key: &str,
    ) -> Result<(), ConfigError> {
        let bound = |name: &str| schema.get(name).and_then(Value::as_u64).map(|b| b as usize);
        let (min, max) = (bound("minItems"), bound("maxItems"));
        if min.is_none_or(|b| length >= b) && max.is_none_or(|b| length <= b) {
            return Ok(());
        }
        let expected = match (min, max) {
            (Some(min), Some(max)) if min == max => format!("{min} values"),
            (Some(min), Some(max)) => format!("{min} to {max} values"),
            (Some(min), None) => format!("at least {min} values"),
            (_, max) => format!("at most {} values", max.unwrap_or(usize::MAX)),
        };
        Err(self.at.out_of_range(&value.span(), key, expected))
    }
}

fn mentions(kind: &Value, word: &str) -> bool {
    kind.as_str() == Some(word) || kind.as_array().is_some_and(|all| all.iter().any(|k| k.as_str() == Some(word)))
}

fn words_expected(word: &str, words: &[&str]) -> String {
    let near =
        find_nearest(word, words.iter().copied()).map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
    format!("one of {}{near}", words.join(", "))
}

fn as_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(integer) => {
            i64::from_str_radix(&integer.as_str().replace('_', ""), integer.radix()).ok().map(|v| v as f64)
        }
        DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
