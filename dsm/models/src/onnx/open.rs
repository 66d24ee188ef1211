//! From a file of models to what it asks for.

use super::detector::{Boxes, NetworkDetector};
use super::dinov2::Dinov2;
use super::minilm::MiniLm;
use super::network::NetworkError;
use super::prompts::Prompts;
use super::sam2::Sam2;
use super::siglip::{SiglipImage, SiglipText};
use super::yolo_world::YoloWorld;
use crate::client::Client;
use crate::networks::{TextKind, VisualKind};
use crate::settings::ModelSettings;
use dsm::knowledge::Knowledge;
use dsm::perceive::{PixelSegmenter, TextEncoder, VisualEncoder};
use std::sync::Arc;

/// The detector of a file; `None` when it asks for neither detector nor segmenter. `client` tells tags, if it is asked for
/// them.
///
/// # Errors
/// [`NetworkError`].
pub fn open_detector(
    settings: &ModelSettings,
    client: Option<Arc<Client>>,
    knowledge: &Arc<Knowledge>,
) -> Result<Option<NetworkDetector>, NetworkError> {
    let Some(segmenter) = &settings.segmenter else { return Ok(None) };
    let boxes = match &settings.detector {
        Some(detector) => Boxes::Named {
            finder: Box::new(YoloWorld::open(detector)?),
            prompts: Prompts::new(detector, client, knowledge),
        },
        None => Boxes::Embedded(PixelSegmenter),
    };
    Ok(Some(NetworkDetector::new(boxes, Sam2::open(segmenter)?, segmenter.least_iou)))
}

/// The visual encoder of a file; `None` when it asks for none.
///
/// # Errors
/// [`NetworkError`].
pub fn open_visual(settings: &ModelSettings) -> Result<Option<Box<dyn VisualEncoder>>, NetworkError> {
    let Some(visual) = &settings.visual else { return Ok(None) };
    Ok(Some(match visual.kind {
        VisualKind::Dinov2 => Box::new(Dinov2::open(&visual.network)?),
        VisualKind::Siglip => Box::new(SiglipImage::open(&visual.network)?),
    }))
}

/// The text encoder of a file; `None` when it asks for none.
///
/// # Errors
/// [`NetworkError`].
pub fn open_text(settings: &ModelSettings) -> Result<Option<Box<dyn TextEncoder>>, NetworkError> {
    let Some(text) = &settings.text else { return Ok(None) };
    Ok(Some(match text.kind {
        TextKind::Minilm => Box::new(MiniLm::open(&text.network, &text.tokenizer)?),
        TextKind::Siglip => Box::new(SiglipText::open(&text.network, &text.tokenizer)?),
    }))
}
