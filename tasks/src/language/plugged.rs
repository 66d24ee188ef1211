//! The models of a file: a language model behind a server, and networks that see and encode.

#[cfg(feature = "onnx")]
mod networks;

use super::{Language, LanguageCost, Looks};
use crate::assemble::knowledge;
use crate::error::TaskError;
use crate::language::embedded;
use dsm::build::{BuildConfig, MapBuilder};
use dsm::eval::Labeller;
use dsm::ground::Grounder;
use dsm::knowledge::Knowledge;
use dsm::perceive::Annotator;
use dsm_models::{Client, LanguageAnnotator, LanguageLabeller, ModelSettings, OpenError, Use, open_client, plug_in};
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// What a file of models asks for.
pub(super) struct Plugged {
    file: String,
    #[cfg(feature = "onnx")]
    settings: ModelSettings,
    client: Option<Arc<Client>>,
    knowledge: Arc<Knowledge>,
}

impl fmt::Debug for Plugged {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Plugged").field("file", &self.file).finish_non_exhaustive()
    }
}

impl Plugged {
    pub(super) fn open(file: &str) -> Result<Self, TaskError> {
        let usage = |error: OpenError| TaskError::Usage(error.to_string());
        let settings = ModelSettings::load(Path::new(file)).map_err(|error| usage(error.into()))?;
        let client = open_client(Path::new(file)).map_err(usage)?;
        #[cfg(not(feature = "onnx"))]
        if settings.has_networks() {
            return Err(TaskError::NotBuiltIn {
                feature: format!("networks of `{file}`"),
                hint: "build it with `cargo build --release --features onnx`".into(),
            });
        }
        Ok(Self {
            file: file.to_owned(),
            #[cfg(feature = "onnx")]
            settings,
            client,
            knowledge: knowledge()?,
        })
    }
}

impl Language for Plugged {
    fn name(&self) -> &str {
        &self.file
    }

    fn plug_into(&self, grounder: Grounder) -> Grounder {
        match &self.client {
            Some(client) => plug_in(grounder, client, &self.knowledge),
            None => grounder,
        }
    }

    fn annotator(&self) -> Option<Box<dyn Annotator>> {
        let client = self.client.as_ref().filter(|client| client.settings().serves(Use::Attributes))?;
        Some(Box::new(LanguageAnnotator::new(client.clone(), self.knowledge.clone())))
    }

    fn labeller(&self) -> Result<Box<dyn Labeller>, TaskError> {
        if let Some(client) = self.client.as_ref().filter(|client| client.settings().serves(Use::Labels)) {
            return Ok(Box::new(LanguageLabeller::new(client.clone(), self.knowledge.clone())));
        }
        #[cfg(feature = "onnx")]
        if let Some(labeller) = networks::labeller(&self.settings)? {
            return Ok(labeller);
        }
        embedded().labeller()
    }

    #[cfg(feature = "onnx")]
    fn looks(&self) -> Result<Option<Looks>, TaskError> {
        networks::looks(&self.settings, self.client.clone(), &self.knowledge)
    }

    #[cfg(not(feature = "onnx"))]
    fn looks(&self) -> Result<Option<Looks>, TaskError> {
        Ok(None)
    }

    #[cfg(feature = "onnx")]
    fn builder(&self, config: BuildConfig) -> Result<MapBuilder, TaskError> {
        networks::builder(&self.settings, config, self.knowledge.clone())
    }

    #[cfg(not(feature = "onnx"))]
    fn builder(&self, config: BuildConfig) -> Result<MapBuilder, TaskError> {
        embedded().builder(config)
    }

    fn cost(&self) -> Option<LanguageCost> {
        let client = self.client.as_ref()?;
        let spent = client.spent();
        Some(LanguageCost {
            model: client.settings().model.clone(),
            questions: spent.questions,
            cached: spent.cached,
            failed: spent.failed,
            tokens: [spent.input_tokens, spent.output_tokens],
            seconds: spent.wall_s,
            cost_usd: spent.cost_usd,
        })
    }
}
