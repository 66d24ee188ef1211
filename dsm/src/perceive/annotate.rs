//! What a slow model says of things that a frame showed, later.
//!
//! A model takes seconds where a frame takes a tenth. So it is asked beside the map's construction, and its answer is
//! taken in when it comes, for the things and the frame that it was asked about ([`crate::build::MapBuilder::annotate`]).

use super::{AttributeVote, Mask};
use crate::frame::{FrameId, RgbdFrame};
use crate::map::{ObjectId, RelationKind};
use crate::time::Stamp;
use std::sync::Arc;

/// A thing of the map as a frame showed it.
#[derive(Clone, Copy, Debug)]
pub struct Sighting<'a> {
    /// The object that the detection was taken for.
    pub object: ObjectId,
    /// Its visible pixels.
    pub mask: &'a Mask,
    /// Its name so far.
    pub name: &'a str,
}

/// What a model says of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct Remark {
    /// The object.
    pub object: ObjectId,
    /// A vote for its name, lower case, with a weight above 0.
    pub name: Option<(String, f32)>,
    /// Votes for its attributes.
    pub attributes: Vec<AttributeVote>,
}

/// A semantic relation that a model sees between two objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemarkedRelation {
    /// The object that is described.
    pub from: ObjectId,
    /// The anchor.
    pub to: ObjectId,
    /// The relation; only semantic ones count.
    pub kind: RelationKind,
    /// Confidence, 0 to 1.
    pub confidence: f32,
}

/// What a model says of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Annotation {
    /// The frame that it speaks of.
    pub frame: FrameId,
    /// When that frame was taken.
    pub stamp: Stamp,
    /// Who speaks: the map keeps it with the votes.
    pub source: Arc<str>,
    /// What it says of objects.
    pub remarks: Vec<Remark>,
    /// What it says of pairs of objects.
    pub relations: Vec<RemarkedRelation>,
}

/// Asks a slow model about things in frames. Nothing here waits, but for [`Annotator::finish`].
pub trait Annotator: Send {
    /// Name for reports.
    fn name(&self) -> &str;

    /// Takes up a frame with what it showed, or leaves it: an annotator keeps to budgets of its own.
    fn ask(&mut self, frame: &RgbdFrame, seen: &[Sighting<'_>]);

    /// Answers whose time has come, in the order in which they were asked for: never earlier than a declared latency after
    /// their frame, and later when the model is slower.
    fn find_answers(&mut self, now: Stamp) -> Vec<Annotation>;

    /// Waits for what is under way, no longer than the model's own limits, and gives the last answers.
    fn finish(&mut self) -> Vec<Annotation>;
}
