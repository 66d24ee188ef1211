//! Perception interfaces: what looks at a frame and says what it sees.
//!
//! A detector gives masks and names; encoders and a describer turn a masked view into features and attributes.
//! The embedded ones work from pixels, points and a knowledge table; learned ones plug in behind the same traits.

mod annotate;
mod color;
mod describer;
mod segment;
mod text;
mod texture;
mod tone;
mod visual;

pub use annotate::{Annotation, Annotator, Remark, RemarkedRelation, Sighting};
pub use color::{ColorName, ColorTable};
pub use describer::KnowledgeDescriber;
pub use segment::{PixelSegmenter, UNNAMED};
pub use text::KnowledgeTextEncoder;
pub use visual::ColorShapeEncoder;

use crate::frame::{FrameId, RgbdFrame};
use crate::map::AttributeKind;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A run of pixels in row-major order that lies in a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// Row-major index of the first pixel.
    pub start: u32,
    /// Number of pixels; a run never crosses the end of a row.
    pub length: u32,
}

/// The pixels of one detection, run-length encoded, sorted by start.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mask {
    /// Width of the image in pixels.
    pub image_width: u32,
    /// Sorted runs that do not overlap.
    pub runs: Vec<Run>,
}

impl Mask {
    /// Builds a mask from row-major pixel indices in rising order.
    pub fn from_sorted_pixels(image_width: u32, pixels: impl IntoIterator<Item = u32>) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        for pixel in pixels {
            match runs.last_mut() {
                Some(run) if run.start + run.length == pixel && !pixel.is_multiple_of(image_width) => run.length += 1,
                _ => runs.push(Run { start: pixel, length: 1 }),
            }
        }
        Self { image_width, runs }
    }

    /// Row-major indices of all pixels, rising.
    pub fn pixels(&self) -> impl Iterator<Item = usize> + '_ {
        self.runs.iter().flat_map(|run| run.start as usize..(run.start + run.length) as usize)
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.runs.iter().map(|run| run.length as usize).sum()
    }

    /// Bounding rectangle (first column, first row, last column, last row), inclusive; `None` when empty.
    pub fn find_bounds(&self) -> Option<(u32, u32, u32, u32)> {
        let width = self.image_width;
        self.runs.iter().fold(None, |bounds, run| {
            let row = run.start / width;
            let (first, last) = (run.start % width, run.start % width + run.length - 1);
            Some(bounds.map_or((first, row, last, row), |(c0, r0, c1, r1): (u32, u32, u32, u32)| {
                (c0.min(first), r0.min(row), c1.max(last), r1.max(row))
            }))
        })
    }
}

/// One thing that a detector saw. It carries no instance identity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// Its visible pixels.
    pub mask: Mask,
    /// Its name in open vocabulary, lower case.
    pub name: String,
    /// Confidence, 0 to 1.
    pub score: f32,
}

/// All detections of one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detections {
    /// The frame they were seen in.
    pub frame: FrameId,
    /// The detections, in no meaningful order.
    pub items: Vec<Detection>,
}

/// Finds things in a frame: open-vocabulary detection and segmentation.
pub trait Detector: Send {
    /// Masks, names and scores of what is visible.
    fn detect(&mut self, frame: &RgbdFrame) -> Detections;

    /// Its name: the map keeps who gave a vote.
    fn name(&self) -> &str {
        "detector"
    }
}

/// One detected thing as an encoder or a describer sees it.
#[derive(Clone, Copy, Debug)]
pub struct ObjectView<'a> {
    /// The frame it was seen in.
    pub frame: &'a RgbdFrame,
    /// Row-major indices of sampled pixels well inside its mask, rising.
    pub pixels: &'a [u32],
    /// Name given by the detector.
    pub name: &'a str,
    /// Extent of its visible points along the world axes, metres.
    pub extent_m: Vector3<f64>,
}

/// Turns a view into a visual feature f_v of unit length; similar things give a high cosine.
pub trait VisualEncoder: Send + Sync {
    /// The feature; every call gives the same number of values.
    fn encode(&self, view: &ObjectView) -> Vec<f32>;
}

/// Turns words into a text feature f_s of unit length; similar meanings give a high cosine.
pub trait TextEncoder: Send + Sync {
    /// The feature; every call gives the same number of values.
    fn encode(&self, text: &str) -> Vec<f32>;
}

/// One vote for an attribute's value.
#[derive(Clone, Debug, PartialEq)]
pub struct AttributeVote {
    /// Appearance, physical or affordance.
    pub kind: AttributeKind,
    /// Which attribute, for example `color`.
    pub key: &'static str,
    /// The value, lower case.
    pub word: String,
    /// Weight, above 0.
    pub weight: f32,
}

/// Says what a view shows: appearance, physical properties and affordances (a_a, a_p, a_o).
pub trait Describer: Send + Sync {
    /// Votes for attributes, in a fixed order.
    fn describe(&self, view: &ObjectView) -> Vec<AttributeVote>;

    /// Its name: the map keeps who gave a vote.
    fn name(&self) -> &str {
        "describer"
    }
}

/// Cosine of two unit vectors; 0 when their lengths differ or one is empty.
pub fn cosine(a: &[f32], b: &[f32]) -> f32 {
    if a.len() == b.len() { a.iter().zip(b).map(|(x, y)| x * y).sum() } else { 0.0 }
}

pub(crate) fn normalize(mut vector: Vec<f32>) -> Vec<f32> {
    let norm = vector.iter().map(|x| x * x).sum::<f32>().sqrt();
    if norm > 0.0 {
        vector.iter_mut().for_each(|x| *x /= norm);
    }
    vector
}
