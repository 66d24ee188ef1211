//! A detector that gives what was detected then.

use super::entry::{Entry, EntrySource};
use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::{Detections, Detector};
use std::collections::BTreeMap;

/// Reads a recording once more, as far as its frames are asked for.
pub(super) struct RecordedDetector {
    name: String,
    source: Box<dyn EntrySource>,
    /// Detections that were passed on the way to those asked for.
    passed: BTreeMap<FrameId, Detections>,
}

impl RecordedDetector {
    pub(super) fn new(name: String, source: Box<dyn EntrySource>) -> Self {
        Self { name, source, passed: BTreeMap::new() }
    }
}

impl Detector for RecordedDetector {
    /// Nothing for a frame whose detections are not in the recording: it broke off before they were known.
    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        while !self.passed.contains_key(&frame.id) {
            match self.source.next_entry() {
                Ok(Some(Entry::Learnt(learnt))) => drop(self.passed.insert(learnt.frame, learnt.detections)),
                Ok(Some(_)) => {}
                Ok(None) | Err(_) => break,
            }
        }
        // Frames are learned from in the order of their reading: what lies before is not asked for any more.
        self.passed.remove(&frame.id).unwrap_or(Detections { frame: frame.id, items: Vec::new() })
    }

    fn name(&self) -> &str {
        &self.name
    }
}
