//! An open-vocabulary detector for maps: boxes by names, a mask for each box.

use super::network::NetworkError;
use super::prompts::Prompts;
use super::raster::Rgb;
use super::sam2::Sam2;
use super::yolo_world::YoloWorld;
use dsm::frame::RgbdFrame;
use dsm::perceive::{Detection, Detections, Detector, Mask, PixelSegmenter};

/// Fewest pixels of a mask.
const LEAST_PX: usize = 16;

/// Where boxes come from.
pub(super) enum Boxes {
    /// From names.
    Named {
        /// The detector.
        finder: Box<YoloWorld>,
        /// What is looked for.
        prompts: Prompts,
    },
    /// From pixels and depth, without names.
    Embedded(PixelSegmenter),
}

/// YOLO-World and SAM 2, or SAM 2 over the embedded segmenter. A frame that the networks fail on shows nothing.
pub struct NetworkDetector {
    boxes: Boxes,
    segmenter: Sam2,
    least_iou: f32,
    name: String,
    failure: Option<NetworkError>,
}

impl NetworkDetector {
    pub(super) fn new(boxes: Boxes, segmenter: Sam2, least_iou: f32) -> Self {
        let name = match boxes {
            Boxes::Named { .. } => "yolo_world+sam2",
            Boxes::Embedded(_) => "pixels+sam2",
        };
        Self { boxes, segmenter, least_iou, name: name.to_owned(), failure: None }
    }

    /// Why the last frame shows nothing; `None` when the networks ran.
    pub fn failure(&self) -> Option<&NetworkError> {
        self.failure.as_ref()
    }

    fn find(&mut self, frame: &RgbdFrame, picture: &Rgb) -> Result<Vec<Detection>, NetworkError> {
        let boxes = match &mut self.boxes {
            Boxes::Named { finder, prompts } => {
                let names = prompts.names(frame);
                let found = finder.find(picture, &names)?;
                found.into_iter().map(|one| (one.corners, names[one.name].clone(), one.score)).collect()
            }
            Boxes::Embedded(segmenter) => boxes_of(&segmenter.detect(frame).items),
        };
        if boxes.is_empty() {
            return Ok(Vec::new());
        }
        let embedded = self.segmenter.embed(picture)?;
        let mut items = Vec::with_capacity(boxes.len());
        for (corners, name, score) in boxes {
            let (mask, expected) = self.segmenter.cut_out(&embedded, corners)?;
            if expected >= self.least_iou && mask.area() >= LEAST_PX {
                items.push(Detection { mask, name, score });
            }
        }
        Ok(items)
    }
}

impl Detector for NetworkDetector {
    fn name(&self) -> &str {
        &self.name
    }

    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        let (width, height) = (frame.model.width, frame.model.height);
        let items = if frame.color.len() == frame.model.pixel_count() && !frame.color.is_empty() {
            let picture = Rgb { width, height, color: frame.color.clone() };
            let found = self.find(frame, &picture);
            let (items, failure) = found.map_or_else(|error| (Vec::new(), Some(error)), |items| (items, None));
            self.failure = failure;
            items
        } else {
            Vec::new()
        };
        Detections { frame: frame.id, items }
    }
}

/// The boxes of masks, with name and score.
fn boxes_of(items: &[Detection]) -> Vec<([f32; 4], String, f32)> {
    let corners = |mask: &Mask| {
        let (c0, r0, c1, r1) = mask.find_bounds()?;
        Some([c0 as f32, r0 as f32, (c1 + 1) as f32, (r1 + 1) as f32])
    };
    items.iter().filter_map(|item| Some((corners(&item.mask)?, item.name.clone(), item.score))).collect()
}
