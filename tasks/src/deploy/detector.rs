//! A detector that runs beside the robot's cameras, at the other end of the wire.

use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::{Detections, Detector};
use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;
use std::time::Duration;

/// How long a frame waits for its detections, which come a little after it. Mapping alone waits, the control tick never.
const PATIENCE: Duration = Duration::from_millis(300);
/// Detections overtake each other by little: when those of so many later frames are there, this frame's are lost.
const OVERTAKEN: usize = 2;

/// Gives frames the detections that came for them.
pub(super) struct WireDetector {
    name: String,
    detections: Receiver<Detections>,
    early: BTreeMap<FrameId, Detections>,
}

impl WireDetector {
    pub(super) fn new(name: &str, detections: Receiver<Detections>) -> Self {
        Self { name: name.into(), detections, early: BTreeMap::new() }
    }
}

impl Detector for WireDetector {
    /// Detections of no frame when those of this one were lost: nothing is learned of what was not looked at.
    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        let is_awaited = |early: &BTreeMap<FrameId, Detections>| {
            !early.contains_key(&frame.id) && early.range(frame.id..).count() < OVERTAKEN
        };
        while is_awaited(&self.early) {
            match self.detections.recv_timeout(PATIENCE) {
                Ok(found) => drop(self.early.insert(found.frame, found)),
                Err(_) => break,
            }
        }
        let found = self.early.remove(&frame.id);
        // Frames come in order: what is older is not asked for any more.
        self.early = self.early.split_off(&frame.id);
        found.unwrap_or(Detections { frame: FrameId(u64::MAX), items: Vec::new() })
    }

    fn name(&self) -> &str {
        &self.name
    }
}

#[cfg(test)]
mod tests {
    //! Contract: each frame gets its own detections, whatever came before them; a frame whose detections are lost gets
    //! those of no frame.
    use super::*;
    use dsm::Pose;
    use dsm::camera::CameraModel;
    use dsm::time::Stamp;
    use std::sync::mpsc::channel;

    fn frame(id: u64) -> RgbdFrame {
        RgbdFrame {
            id: FrameId(id),
            stamp: Stamp(0),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(2, 2, 1.0),
            world_from_camera: Pose::identity(),
            color: vec![[0; 3]; 4],
            depth_m: vec![0.0; 4],
        }
    }

    #[test]
    fn a_frame_whose_detections_are_lost_holds_up_no_other() {
        let (sender, detections) = channel();
        let mut detector = WireDetector::new("there", detections);
        for id in 2..6 {
            sender.send(Detections { frame: FrameId(id), items: Vec::new() }).unwrap();
        }
        // More would come for ever: the sender lives.
        assert_eq!(detector.detect(&frame(1)).frame, FrameId(u64::MAX));
        assert_eq!(detector.early.len(), OVERTAKEN, "it waited on while others came");
        for id in 2..6 {
            assert_eq!(detector.detect(&frame(id)).frame, FrameId(id));
        }
        drop(sender);
    }

    #[test]
    fn frames_get_their_own_detections() {
        let (sender, detections) = channel();
        let mut detector = WireDetector::new("there", detections);
        for id in [1, 3, 2] {
            sender.send(Detections { frame: FrameId(id), items: Vec::new() }).unwrap();
        }
        assert_eq!(detector.detect(&frame(2)).frame, FrameId(2));
        assert_eq!(detector.detect(&frame(3)).frame, FrameId(3));
        drop(sender);
        assert_eq!(detector.detect(&frame(4)).frame, FrameId(u64::MAX));
    }
}
