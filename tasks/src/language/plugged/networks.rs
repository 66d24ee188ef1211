//! Networks of a file of models: who detects, and who encodes.

use crate::error::TaskError;
use crate::language::Looks;
use crate::late_sight::{Moment, Pace};
use dsm::build::{BuildConfig, MapBuilder};
use dsm::eval::{EncodedLabeller, Labeller};
use dsm::knowledge::Knowledge;
use dsm::perceive::{ColorShapeEncoder, KnowledgeDescriber, KnowledgeTextEncoder, TextEncoder};
use dsm::time::Span;
use dsm_models::onnx::{NetworkError, open_detector, open_text, open_visual};
use dsm_models::{Client, ModelSettings, Pace as Waits, TextKind};
use std::sync::Arc;

fn usage(error: NetworkError) -> TaskError {
    TaskError::Usage(error.to_string())
}

/// The detector, and how frames are taken up by it.
pub(super) fn looks(
    settings: &ModelSettings,
    client: Option<Arc<Client>>,
    knowledge: &Arc<Knowledge>,
) -> Result<Option<Looks>, TaskError> {
    let Some(detector) = open_detector(settings, client, knowledge).map_err(usage)? else { return Ok(None) };
    let sight = &settings.sight;
    let pace = Pace {
        every: Span::from_s(sight.every_s),
        most_frames: sight.most_frames,
        most_pending: sight.most_pending as usize,
        latency: Span::from_s(sight.latency_s),
        moment: match sight.pace {
            Waits::Late => Moment::WhenReady,
            Waits::Lockstep => Moment::Declared,
        },
    };
    Ok(Some(Looks { detector: Box::new(detector), pace }))
}

/// A builder with the encoders of the file; the embedded ones where it has none.
pub(super) fn builder(
    settings: &ModelSettings,
    config: BuildConfig,
    knowledge: Arc<Knowledge>,
) -> Result<MapBuilder, TaskError> {
    let visual = open_visual(settings).map_err(usage)?.unwrap_or_else(|| Box::new(ColorShapeEncoder::default()));
    let text: Box<dyn TextEncoder> = match open_text(settings).map_err(usage)? {
        Some(text) => text,
        None => Box::new(KnowledgeTextEncoder::new(knowledge.clone())),
    };
    let describer = Box::new(KnowledgeDescriber::new(knowledge.clone()));
    Ok(MapBuilder::with_encoders(config, knowledge, visual, text, describer))
}

/// Labels by the text encoder of the file; `None` when it has none.
pub(super) fn labeller(settings: &ModelSettings) -> Result<Option<Box<dyn Labeller>>, TaskError> {
    let Some(encoder) = open_text(settings).map_err(usage)? else { return Ok(None) };
    let name = match settings.text.as_ref().map(|text| text.kind) {
        Some(TextKind::Siglip) => "siglip",
        _ => "minilm",
    };
    Ok(Some(Box::new(EncodedLabeller::new(name, encoder))))
}
