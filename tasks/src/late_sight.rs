//! A detector that takes its time, beside the map's construction.
//!
//! ```text
//! frame ──due?──▶ held ──▶ detector, on a thread of its own ──▶ detections ──at stamp + latency──▶ the map, by the held frame
//!           └─no─▶ free space at once
//! ```
//!
//! What a detector sees is applied to the frame that it was seen in, with the pose of that frame and where the robot was
//! then; frames keep their order. Frames that are not taken up tell of free space at once.

use dsm::build::Carrier;
use dsm::frame::RgbdFrame;
use dsm::perceive::{Detections, Detector};
use dsm::time::{Span, Stamp};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

/// When what a frame showed is taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// At the declared moment, or when the detector is ready, if that is later. Nothing waits.
    WhenReady,
    /// At the declared moment: who asks for results waits for the detector. The same on every machine.
    Declared,
}

/// How frames are taken up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Time between two frames that are taken up.
    pub every: Span,
    /// Frames that are taken up in one run.
    pub most_frames: u32,
    /// Frames that are held at a time.
    pub most_pending: usize,
    /// From a frame's stamp to its declared moment.
    pub latency: Span,
    /// What counts when the moment has come.
    pub moment: Moment,
}

/// A frame with what it showed.
pub struct Seen {
    /// The frame.
    pub frame: Arc<RgbdFrame>,
    /// Where the robot itself was.
    pub carrier: Carrier,
    /// What was detected in it.
    pub detections: Detections,
}

/// The detector on its thread, and the frames that wait for it.
pub struct LateSight {
    name: String,
    pace: Pace,
    jobs: Option<Sender<Arc<RgbdFrame>>>,
    results: Receiver<Detections>,
    held: VecDeque<Held>,
    frames: u32,
    next: Option<Stamp>,
}

struct Held {
    frame: Arc<RgbdFrame>,
    carrier: Carrier,
    ready: Stamp,
    found: Option<Detections>,
}

impl LateSight {
    /// Starts the thread. It ends with its last frame when this is dropped; nobody waits for it.
    pub fn start(mut detector: Box<dyn Detector>, pace: Pace) -> Self {
        let name = detector.name().to_owned();
        let (jobs, inbox) = channel::<Arc<RgbdFrame>>();
        let (outbox, results) = channel();
        std::thread::spawn(move || {
            for frame in inbox {
                if outbox.send(detector.detect(&frame)).is_err() {
                    return;
                }
            }
        });
        Self { name, pace, jobs: Some(jobs), results, held: VecDeque::new(), frames: 0, next: None }
    }

    /// Name of the detector.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Takes up a frame if it is due and there is room; says whether it did.
    pub fn take_up(&mut self, frame: &Arc<RgbdFrame>, carrier: &Carrier) -> bool {
        self.collect();
        let due = self.next.is_none_or(|next| frame.stamp >= next);
        if !due || self.frames >= self.pace.most_frames || self.held.len() >= self.pace.most_pending {
            return false;
        }
        if self.jobs.as_ref().is_none_or(|jobs| jobs.send(frame.clone()).is_err()) {
            return false;
        }
        self.frames += 1;
        self.next = Some(frame.stamp + self.pace.every);
        let ready = frame.stamp + self.pace.latency;
        self.held.push_back(Held { frame: frame.clone(), carrier: carrier.clone(), ready, found: None });
        true
    }

    /// Frames whose moment has come, in their order.
    pub fn find_seen(&mut self, now: Stamp) -> Vec<Seen> {
        self.collect();
        let mut seen = Vec::new();
        while self.held.front().is_some_and(|held| held.ready <= now) {
            if self.pace.moment == Moment::Declared {
                self.wait_for_first();
            }
            match self.take_first() {
                Some(first) => seen.push(first),
                None => break,
            }
        }
        seen
    }

    /// Waits for all frames that are held.
    pub fn finish(&mut self) -> Vec<Seen> {
        drop(self.jobs.take());
        let mut seen = Vec::new();
        while !self.held.is_empty() {
            self.wait_for_first();
            seen.extend(self.take_first());
        }
        seen
    }

    fn take_first(&mut self) -> Option<Seen> {
        self.held.front().filter(|held| held.found.is_some())?;
        let Held { frame, carrier, found, .. } = self.held.pop_front()?;
        Some(Seen { frame, carrier, detections: found? })
    }

    /// A detector that broke off has seen nothing.
    fn wait_for_first(&mut self) {
        while let Some(frame) = self.held.front().filter(|held| held.found.is_none()).map(|held| held.frame.id) {
            let found = self.results.recv().unwrap_or(Detections { frame, items: Vec::new() });
            self.put(found);
        }
    }

    fn collect(&mut self) {
        loop {
            match self.results.try_recv() {
                Ok(found) => self.put(found),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    for held in self.held.iter_mut().filter(|held| held.found.is_none()) {
                        held.found = Some(Detections { frame: held.frame.id, items: Vec::new() });
                    }
                    return;
                }
            }
        }
    }

    fn put(&mut self, found: Detections) {
        if let Some(held) = self.held.iter_mut().find(|held| held.frame.id == found.frame) {
            held.found = Some(found);
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: what was seen comes with the frame it was seen in and with where the robot was, in order, never before its
    //! declared moment, and then at once or later as was asked; a detector that breaks off holds up nothing.
    use super::*;
    use dsm::camera::CameraModel;
    use dsm::frame::FrameId;
    use dsm::perceive::{Detection, Mask};
    use std::sync::mpsc::channel;

    /// Sees one thing named by the frame, after it was allowed to.
    struct Gated(Receiver<()>);

    impl Detector for Gated {
        fn detect(&mut self, frame: &RgbdFrame) -> Detections {
            self.0.recv().expect("a test that ends early");
            let mask = Mask::from_sorted_pixels(16, 0..4);
            Detections { frame: frame.id, items: vec![Detection { mask, name: frame.id.0.to_string(), score: 1.0 }] }
        }
    }

    fn frame(number: u64) -> Arc<RgbdFrame> {
        Arc::new(RgbdFrame {
            id: FrameId(number),
            stamp: Stamp::from_s(number as f64),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(16, 12, 0.9),
            world_from_camera: dsm::Pose::identity(),
            color: vec![[0; 3]; 192],
            depth_m: vec![0.0; 192],
        })
    }

    fn carrier(number: u64) -> Carrier {
        Carrier { footprint: Some((nalgebra::Point2::new(number as f64, 0.0), 0.3)), ..Carrier::default() }
    }

    fn pace(moment: Moment) -> Pace {
        let (every, latency) = (Span::from_s(2.0), Span::from_s(3.0));
        Pace { every, most_frames: 3, most_pending: 2, latency, moment }
    }

    fn told(seen: &[Seen]) -> Vec<(u64, String, f64)> {
        let tell = |one: &Seen| {
            let place = one.carrier.footprint.map_or(f64::NAN, |(center, _)| center.x);
            assert_eq!(one.detections.frame, one.frame.id);
            (one.frame.id.0, one.detections.items.first().map_or(String::new(), |item| item.name.clone()), place)
        };
        seen.iter().map(tell).collect()
    }

    #[test]
    fn frames_are_taken_up_as_the_pace_says() {
        let (allow, gate) = channel();
        let mut sight = LateSight::start(Box::new(Gated(gate)), pace(Moment::Declared));
        let mut taken = Vec::new();
        let mut seen = Vec::new();
        for number in 0..12 {
            allow.send(()).unwrap();
            let now = frame(number);
            seen.extend(told(&sight.find_seen(now.stamp)));
            if sight.take_up(&now, &carrier(number)) {
                taken.push(number);
            }
            let complete: Vec<u64> = taken.iter().copied().filter(|frame| frame + 3 <= number).collect();
            assert_eq!(seen.iter().map(|(frame, ..)| *frame).collect::<Vec<_>>(), complete, "at {number}");
        }
        assert_eq!(taken, [0, 2, 4], "every second one, two at a time, three in all");
        assert_eq!(seen[1], (2, "2".to_owned(), 2.0));
        assert!(sight.finish().is_empty());
    }

    #[test]
    fn nothing_waits_for_a_detector_that_is_late() {
        let (allow, gate) = channel();
        let mut sight = LateSight::start(Box::new(Gated(gate)), pace(Moment::WhenReady));
        assert!(sight.take_up(&frame(0), &carrier(0)));
        assert!(sight.find_seen(Stamp::from_s(60.0)).is_empty(), "it is not ready");
        allow.send(()).unwrap();
        allow.send(()).unwrap();
        assert!(sight.take_up(&frame(61), &carrier(61)));
        let last = sight.finish();
        assert_eq!(told(&last), [(0, "0".to_owned(), 0.0), (61, "61".to_owned(), 61.0)]);
    }

    #[test]
    fn a_detector_that_broke_off_has_seen_nothing() {
        let (allow, gate) = channel::<()>();
        drop(allow);
        let mut sight = LateSight::start(Box::new(Gated(gate)), pace(Moment::Declared));
        assert!(sight.take_up(&frame(0), &carrier(0)));
        let seen = sight.find_seen(Stamp::from_s(3.0));
        assert_eq!(told(&seen), [(0, String::new(), 0.0)]);
    }
}
