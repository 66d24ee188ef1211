//! Who reads words, verifies candidates, describes frames, detects and encodes: the embedded backend, or models of a file.

#[cfg(feature = "models")]
mod plugged;

use crate::assemble::knowledge;
use crate::error::TaskError;
use crate::late_sight::Pace;
use dsm::build::{BuildConfig, MapBuilder};
use dsm::eval::{EmbeddedLabeller, Labeller};
use dsm::ground::{GroundConfig, Grounder};
use dsm::perceive::{Annotator, Detector};
use serde::Serialize;
use std::fmt::Debug;
use std::sync::Arc;

/// Name of the backend that needs no model.
pub const EMBEDDED: &str = "embedded";

/// A backend of language. One is shared by all that a program does, so that its budget is one.
pub trait Language: Debug + Send + Sync {
    /// As it was asked for: `embedded`, or a file of models.
    fn name(&self) -> &str;

    /// The grounder with what the backend adds to it.
    fn plug_into(&self, grounder: Grounder) -> Grounder;

    /// Describes frames while a map is built; `None` when the backend does not.
    fn annotator(&self) -> Option<Box<dyn Annotator>>;

    /// Chooses labels of benchmarks.
    ///
    /// # Errors
    /// Knowledge that cannot be read.
    fn labeller(&self) -> Result<Box<dyn Labeller>, TaskError>;

    /// Who detects, where the backend does; `None` leaves it to what would detect without it. Opened anew each time.
    ///
    /// # Errors
    /// Networks that cannot be used.
    fn looks(&self) -> Result<Option<Looks>, TaskError>;

    /// A map builder with the encoders of the backend.
    ///
    /// # Errors
    /// Networks, or knowledge, that cannot be used.
    fn builder(&self, config: BuildConfig) -> Result<MapBuilder, TaskError>;

    /// What it has cost so far; `None` when it costs nothing.
    fn cost(&self) -> Option<LanguageCost>;
}

/// A detector that takes its time.
pub struct Looks {
    /// The detector.
    pub detector: Box<dyn Detector>,
    /// How frames are taken up.
    pub pace: Pace,
}

/// What a model has cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LanguageCost {
    /// The model.
    pub model: String,
    /// Questions that were asked.
    pub questions: u64,
    /// Questions that the cache answered.
    pub cached: u64,
    /// Questions that the embedded backend had to answer.
    pub failed: u64,
    /// Tokens read and written by the model.
    pub tokens: [u64; 2],
    /// Wall time of all questions together, seconds.
    pub seconds: f64,
    /// US dollars by the prices of the file.
    pub cost_usd: f64,
}

/// One line on what a model has cost; empty when nothing was asked of one.
pub fn tell_cost(cost: Option<&LanguageCost>) -> String {
    cost.map_or_else(String::new, |cost| {
        let LanguageCost { model, questions, cached, failed, tokens, seconds, cost_usd } = cost;
        let [read, written] = tokens;
        format!(
            "{model}: {questions} questions, {cached} from the cache, {failed} left to the embedded backend; {read} tokens \
             read, {written} written, {seconds:.1} s, {cost_usd:.4} US dollars\n"
        )
    })
}

/// The backend of a name: `embedded`, or the path of a file of models.
///
/// # Errors
/// [`TaskError::NotBuiltIn`] for a file when the program was built without models; a file that cannot be used.
pub fn find_language(name: &str) -> Result<Arc<dyn Language>, TaskError> {
    if name == EMBEDDED {
        return Ok(embedded());
    }
    plugged(name)
}

/// The backend that needs no model.
pub fn embedded() -> Arc<dyn Language> {
    Arc::new(Embedded)
}

#[cfg(feature = "models")]
fn plugged(name: &str) -> Result<Arc<dyn Language>, TaskError> {
    Ok(Arc::new(plugged::Plugged::open(name)?))
}

#[cfg(not(feature = "models"))]
fn plugged(name: &str) -> Result<Arc<dyn Language>, TaskError> {
    Err(TaskError::NotBuiltIn {
        feature: format!("backend `{name}`"),
        hint: "build it with `cargo build --release --features models`; this program has `embedded` only".into(),
    })
}

/// A grounder that asks the backend.
///
/// # Errors
/// A parameter outside its range.
pub fn grounder(language: &dyn Language, config: GroundConfig) -> Result<Grounder, TaskError> {
    let grounder = Grounder::new(config, knowledge()?).map_err(|error| TaskError::Internal(error.to_string()))?;
    Ok(language.plug_into(grounder))
}

/// The backend that needs no model.
#[derive(Debug)]
struct Embedded;

impl Language for Embedded {
    fn name(&self) -> &str {
        EMBEDDED
    }

    fn plug_into(&self, grounder: Grounder) -> Grounder {
        grounder
    }

    fn annotator(&self) -> Option<Box<dyn Annotator>> {
        None
    }

    fn labeller(&self) -> Result<Box<dyn Labeller>, TaskError> {
        Ok(Box::new(EmbeddedLabeller::new(knowledge()?)))
    }

    fn looks(&self) -> Result<Option<Looks>, TaskError> {
        Ok(None)
    }

    fn builder(&self, config: BuildConfig) -> Result<MapBuilder, TaskError> {
        Ok(MapBuilder::new(config, knowledge()?))
    }

    fn cost(&self) -> Option<LanguageCost> {
        None
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the embedded backend is always there; a file of models that cannot be used says why.
    use super::*;

    #[test]
    fn backends_are_found_by_name() {
        let embedded = find_language(EMBEDDED).unwrap();
        assert_eq!((embedded.name(), embedded.cost()), (EMBEDDED, None));
        assert!(embedded.annotator().is_none());
        let error = find_language("no/such/models.toml").unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("no/such/models.toml"), "{error}");
    }
}
