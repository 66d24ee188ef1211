//! What a case of misbehaviour is.

use super::Act;

/// A good answer to the question about two mugs (ids 2 and 3), without thoughts.
pub(crate) const FITS: &str = r#"{"scores": [{"id": 2, "score": 0.0}, {"id": 3, "score": 1.0}]}"#;

/// What the model is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Used {
    /// Scoring relations.
    Score,
    /// Reading words.
    Parse,
    /// Verifying candidates.
    Verify,
    /// Choosing labels.
    Labels,
    /// Describing a frame's things.
    Attributes,
    /// Relating a frame's things, which are described well before.
    Relations,
    /// Listing what stands in a picture.
    Tags,
}

/// One way of misbehaving, and what has to come of it.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    /// What the server does.
    pub(crate) name: String,
    /// How.
    pub(crate) script: Vec<Act>,
    /// Words of the errors that may come of it; none when an answer comes.
    pub(crate) errors: Vec<String>,
    /// What it is used for.
    pub(crate) used: Used,
    /// Whether the server lets the client wait for longer than it may.
    pub(crate) hangs: bool,
    /// Exact number of requests, where it matters.
    pub(crate) requests: Option<usize>,
}

/// A case in which the embedded backend has to answer.
pub(crate) fn fails(name: impl Into<String>, script: Vec<Act>, errors: &[&str]) -> Case {
    let errors = errors.iter().map(|&word| word.to_owned()).collect();
    Case { name: name.into(), script, errors, used: Used::Score, hangs: false, requests: None }
}

/// A case in which the model's answer counts.
pub(crate) fn works(name: impl Into<String>, script: Vec<Act>) -> Case {
    fails(name, script, &[])
}

impl Case {
    /// The client has to give up by its own clock.
    pub(crate) fn hanging(self) -> Self {
        Self { hangs: true, ..self }
    }

    /// The client has to ask once.
    pub(crate) fn once(self) -> Self {
        Self { requests: Some(1), ..self }
    }

    /// The client has to ask twice.
    pub(crate) fn twice(self) -> Self {
        Self { requests: Some(2), ..self }
    }

    /// The same for another use.
    pub(crate) fn used_for(self, used: Used) -> Self {
        Self { used, ..self }
    }
}
