//! What happened during a run, for the report.

use crate::perception::Learned;
use dsm::Pose;
use dsm::frame::RgbdFrame;
use nalgebra::Point2;
use std::sync::Arc;

/// A moment worth showing.
#[derive(Clone, Debug)]
pub struct Event {
    /// Simulated seconds.
    pub at_s: f64,
    /// What happened, in words.
    pub what: String,
}

/// Path, poses of the head camera, pictures and events of a run.
#[derive(Default)]
pub struct Journal {
    /// Where the base was, world frame, one point a frame.
    pub path: Vec<Point2<f64>>,
    /// Poses of the head camera, one a frame.
    pub views: Vec<Pose>,
    /// Events in order.
    pub events: Vec<Event>,
    /// Frames kept with events.
    pub pictures: Vec<(String, Arc<RgbdFrame>)>,
    /// Frames learned from.
    pub frames_learned: usize,
    /// Detections in them.
    pub detections: usize,
}

impl Journal {
    /// Notes a frame that was taken.
    pub fn note_frame(&mut self, frame: &RgbdFrame, world_from_base: &Pose) {
        if &*frame.camera == "head" {
            self.path.push(Point2::from(world_from_base.translation.vector.xy()));
            self.views.push(frame.world_from_camera);
        }
    }

    /// Notes a frame whose map is there.
    pub fn note_learned(&mut self, learned: &Learned) {
        self.frames_learned += 1;
        self.detections += learned.detections.items.len();
    }

    /// Notes an event, with a picture if there is one.
    pub fn note(&mut self, at_s: f64, what: impl Into<String>, picture: Option<&Arc<RgbdFrame>>) {
        let what = what.into();
        tracing::info!("{at_s:7.2} s  {what}");
        if let Some(frame) = picture {
            self.pictures.push((format!("{at_s:.1} s: {what}"), frame.clone()));
        }
        self.events.push(Event { at_s, what });
    }
}
