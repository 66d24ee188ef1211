//! What can be wrong with a scene.

use std::fmt;
use std::path::PathBuf;
use thiserror::Error;

/// Where something stands in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// The line, counted from 1; `None` when it is not known.
    pub line: Option<u32>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        self.line.map_or(Ok(()), |line| write!(f, ":{line}"))
    }
}

/// What is wrong with a scene, where, and what was expected.
#[derive(Debug, Error, PartialEq)]
pub enum SceneError {
    /// A file cannot be read.
    #[error("{}: cannot be read: {reason}; expected {expected}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The operating system's words.
        reason: String,
        /// What kind of file was expected.
        expected: String,
    },
    /// The text is not well-formed XML.
    #[error("{place}: not well-formed XML: {reason}")]
    Xml {
        /// Where.
        place: Place,
        /// What the XML parser says.
        reason: String,
    },
    /// An element or attribute that MJCF does not know here.
    #[error("{place}: unknown {kind} `{name}` in <{parent}>;{} valid: {}", meant(nearest.as_deref()), valid.join(", "))]
    UnknownKey {
        /// Where.
        place: Place,
        /// `element` or `attribute`.
        kind: &'static str,
        /// The name as written.
        name: Box<str>,
        /// The element that holds it.
        parent: Box<str>,
        /// The valid name most like it.
        nearest: Option<Box<str>>,
        /// All valid names.
        valid: Vec<String>,
    },
    /// A value that does not fit.
    #[error("{place}: {what} is `{value}`; expected {expected}")]
    BadValue {
        /// Where.
        place: Place,
        /// Which value.
        what: String,
        /// As written.
        value: String,
        /// What fits.
        expected: String,
    },
    /// A name that nothing defines.
    #[error("{place}: there is no {kind} `{name}`;{} known: {}", meant(nearest.as_deref()), shortened(known))]
    UnknownReference {
        /// Where.
        place: Place,
        /// Kind of the thing: `material`, `mesh`, `texture`, `class`, `body`.
        kind: &'static str,
        /// The name.
        name: String,
        /// The known name most like it.
        nearest: Option<String>,
        /// All known names.
        known: Vec<String>,
    },
    /// A name that is defined twice.
    #[error("{place}: {kind} `{name}` exists already at {first}; expected a unique name")]
    Duplicate {
        /// Where the second one stands.
        place: Place,
        /// Kind of the thing.
        kind: &'static str,
        /// The name.
        name: String,
        /// Where the first one stands.
        first: Place,
    },
    /// A mesh, texture or include file that does not exist.
    #[error("{place}: the {kind} file `{}` does not exist", path.display())]
    MissingFile {
        /// Where it is named.
        place: Place,
        /// `mesh`, `texture` or `include`.
        kind: &'static str,
        /// The resolved path.
        path: PathBuf,
    },
    /// A mesh or texture file that cannot be decoded.
    #[error("{place}: the {kind} file `{}` cannot be decoded: {reason}; expected {expected}", path.display())]
    BrokenFile {
        /// Where it is named.
        place: Place,
        /// `mesh` or `texture`.
        kind: &'static str,
        /// The resolved path.
        path: PathBuf,
        /// What the decoder says.
        reason: String,
        /// The formats that can be read.
        expected: &'static str,
    },
    /// A file that includes itself.
    #[error("{place}: `{}` includes itself", path.display())]
    IncludeCycle {
        /// Where the cycle closes.
        place: Place,
        /// The file.
        path: PathBuf,
    },
    /// A free body that weighs nothing.
    #[error("{place}: the free body `{body}` has no mass; expected geoms with a positive `mass` or an <inertial>")]
    NoMass {
        /// Where the body stands.
        place: Place,
        /// Its name.
        body: String,
    },
    /// Something that MJCF knows and this loader does not.
    #[error("{place}: {what} is not supported; {hint}")]
    Unsupported {
        /// Where.
        place: Place,
        /// What.
        what: String,
        /// What to do instead.
        hint: String,
    },
    /// Anything else that the MJCF parser refuses.
    #[error("{}: {reason}", file.display())]
    Mjcf {
        /// The scene file.
        file: PathBuf,
        /// What the parser says.
        reason: String,
    },
}

fn meant(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |name| format!(" did you mean `{name}`?"))
}

/// At most a dozen names: a flat has hundreds of bodies.
fn shortened(known: &[String]) -> String {
    let shown = known.iter().take(12).cloned().collect::<Vec<_>>().join(", ");
    match known.len() {
        0 => "none".to_owned(),
        n if n > 12 => format!("{shown} and {} more", n - 12),
        _ => shown,
    }
}
