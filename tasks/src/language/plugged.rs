//! A language model behind a server, by a file of models.

use super::{Language, LanguageCost};
use crate::assemble::knowledge;
use crate::error::TaskError;
use dsm::eval::Labeller;
use dsm::ground::Grounder;
use dsm::knowledge::Knowledge;
use dsm::perceive::Annotator;
use dsm_models::{Client, LanguageAnnotator, LanguageLabeller, OpenError, Use, open_client, plug_in};
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// The model of a file.
pub(super) struct Plugged {
    file: String,
    client: Arc<Client>,
    knowledge: Arc<Knowledge>,
}

impl fmt::Debug for Plugged {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Plugged").field("file", &self.file).finish_non_exhaustive()
    }
}

impl Plugged {
    pub(super) fn open(file: &str) -> Result<Self, TaskError> {
        let client = open_client(Path::new(file)).map_err(|error: OpenError| TaskError::Usage(error.to_string()))?;
        Ok(Self { file: file.to_owned(), client, knowledge: knowledge()? })
    }
}

impl Language for Plugged {
    fn name(&self) -> &str {
        &self.file
    }

    fn plug_into(&self, grounder: Grounder) -> Grounder {
        plug_in(grounder, &self.client, &self.knowledge)
    }

    fn annotator(&self) -> Option<Box<dyn Annotator>> {
        let serves = self.client.settings().serves(Use::Attributes);
        serves.then(|| {
            let annotator = LanguageAnnotator::new(self.client.clone(), self.knowledge.clone());
            Box::new(annotator) as Box<dyn Annotator>
        })
    }

    fn labeller(&self) -> Result<Box<dyn Labeller>, TaskError> {
        Ok(Box::new(LanguageLabeller::new(self.client.clone(), self.knowledge.clone())))
    }

    fn cost(&self) -> Option<LanguageCost> {
        let spent = self.client.spent();
        Some(LanguageCost {
            model: self.client.settings().model.clone(),
            questions: spent.questions,
            cached: spent.cached,
            failed: spent.failed,
            tokens: [spent.input_tokens, spent.output_tokens],
            seconds: spent.wall_s,
            cost_usd: spent.cost_usd,
        })
    }
}
