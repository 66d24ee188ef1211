//! The file that says which classes the labels of a cloud stand for.
//!
//! ```toml
//! version = 1
//!
//! [[class]]
//! label = 20        # the integer in the cloud
//! name = "chair"
//!
//! [[class]]
//! label = 93
//! name = "wall"
//! exclude = true    # background: its points are left out, and no object can be one
//! ```

use crate::config::{ConfigError, parse_toml};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The version of class files that this program reads.
const VERSION: u32 = 1;

/// One class.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelClass {
    /// Its number in the cloud.
    pub label: i64,
    /// Its name, in words.
    pub name: String,
    /// Background: its points are left out of the score, and no object can be one. Default false.
    #[serde(default)]
    pub exclude: bool,
}

/// All classes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelClasses {
    /// Format version; 1.
    pub version: u32,
    /// The classes, in any order.
    #[serde(rename = "class")]
    pub classes: Vec<LabelClass>,
}

impl LabelClasses {
    /// These classes.
    pub fn new(classes: Vec<LabelClass>) -> Self {
        Self { version: VERSION, classes }
    }

    /// Parses a class file; `file` only names the source in errors.
    ///
    /// # Errors
    /// What is no class file, another version, a label or name that is there twice, and a file that leaves no class.
    pub fn parse(text: &str, file: &Path) -> Result<Self, ConfigError> {
        let read: Self = parse_toml(text, file)?;
        let fail = |key: &str, place: usize, message: String| {
            Err(ConfigError::Invalid { file: file.to_owned(), line: line_of_key(text, key, place), message })
        };
        if read.version != VERSION {
            let message = format!("expected version {VERSION} of a class file, got {}", read.version);
            return fail("version", 0, message);
        }
        for (i, class) in read.classes.iter().enumerate() {
            let earlier = &read.classes[..i];
            if class.name.trim().is_empty() {
                return fail("name", i, "a class needs a name".into());
            }
            if let Some(other) = earlier.iter().find(|other| other.label == class.label) {
                return fail("label", i, format!("label {} is `{}` already", class.label, other.name));
            }
            if earlier.iter().any(|other| other.name == class.name && other.exclude != class.exclude) {
                return fail("name", i, format!("`{}` is both counted and excluded", class.name));
            }
        }
        if read.classes.iter().all(|class| class.exclude) {
            return fail("class", 0, "no class is left to score: expected one without `exclude = true`".into());
        }
        Ok(read)
    }

    /// The file's text.
    pub fn to_toml(&self) -> String {
        let class = |class: &LabelClass| {
            let name = toml::Value::from(class.name.as_str());
            let exclude = if class.exclude { "exclude = true\n" } else { "" };
            format!("\n[[class]]\nlabel = {}\nname = {name}\n{exclude}", class.label)
        };
        format!("version = {}\n{}", self.version, self.classes.iter().map(class).collect::<String>())
    }
}

/// The line of the n-th key of this name; 1 when it is written in another way.
fn line_of_key(text: &str, key: &str, place: usize) -> usize {
    let is_key =
        |line: &str| line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('='));
    text.lines().enumerate().filter(|(_, line)| is_key(line)).nth(place).map_or(1, |(index, _)| index + 1)
}

#[cfg(test)]
mod tests {
    //! Contract: a class file is read as it was written; each mistake names its line.
    use super::*;

    #[test]
    fn files_round_trip_and_mistakes_name_their_line() {
        let class = |label, name: &str, exclude| LabelClass { label, name: name.into(), exclude };
        let classes = LabelClasses::new(vec![class(20, "chair", false), class(-1, "a \"wall\"", true)]);
        let text = classes.to_toml();
        assert_eq!(LabelClasses::parse(&text, "c.toml".as_ref()), Ok(classes));
        let of = |text: &str| LabelClasses::parse(text, "c.toml".as_ref()).unwrap_err().to_string();
        assert_eq!(of(&text.replace("label = -1", "label = 20")), "c.toml:8: label 20 is `chair` already");
        assert!(of(&text.replace("version = 1", "version = 2")).starts_with("c.toml:1: expected version 1"));
        assert!(of(&text.replace("name = \"chair\"", "nam = \"chair\"")).contains("did you mean `name`?"));
        assert!(
            of("version = 1\n[[class]]\nlabel = 1\nname = \"wall\"\nexclude = true\n").contains("no class is left")
        );
    }
}
