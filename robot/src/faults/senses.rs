//! What broken senses repeat, hold back or lose.

use dsm::frame::RgbdFrame;
use dsm::time::{Span, Stamp};
use std::collections::{BTreeMap, VecDeque};

/// What was measured last.
pub(super) struct Kept<T>(Option<T>);

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Clone> Kept<T> {
    /// Passes a measurement on; one that repeats gives the last one from before.
    pub(super) fn pass(&mut self, fresh: T, repeats: Repeats) -> T {
        match (&self.0, repeats) {
            (Some(kept), Repeats::Yes) => kept.clone(),
            _ => {
                self.0 = Some(fresh.clone());
                fresh
            }
        }
    }
}

/// Whether a sense repeats itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Repeats {
    Yes,
    No,
}

/// What is wrong with the cameras.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameTrouble {
    /// The same image again and again.
    pub(super) frozen: Repeats,
    /// Each image once more.
    pub(super) twice: Repeats,
    /// How late images arrive.
    pub(super) late: Span,
}

/// The frames of one camera on their way.
#[derive(Default)]
struct OfCamera {
    last: Option<RgbdFrame>,
    /// With when each arrives.
    waiting: VecDeque<(Stamp, RgbdFrame)>,
}

/// The frames of all cameras on their way.
#[derive(Default)]
pub(super) struct Frames(BTreeMap<String, OfCamera>);

impl Frames {
    /// Takes in what the camera gives now, and gives what arrives now.
    pub(super) fn pass(
        &mut self,
        camera: &str,
        now: Stamp,
        fresh: Option<RgbdFrame>,
        trouble: FrameTrouble,
    ) -> Option<RgbdFrame> {
        let of_camera = self.0.entry(camera.to_owned()).or_default();
        if let Some(fresh) = fresh {
            let frame = match (&of_camera.last, trouble.frozen) {
                (Some(last), Repeats::Yes) => last.clone(),
                _ => fresh,
            };
            of_camera.last = Some(frame.clone());
            let ready = now + trouble.late;
            if trouble.twice == Repeats::Yes {
                of_camera.waiting.push_back((ready, frame.clone()));
            }
            of_camera.waiting.push_back((ready, frame));
        }
        let arrives = of_camera.waiting.front().is_some_and(|(ready, _)| *ready <= now);
        if arrives { of_camera.waiting.pop_front().map(|(_, frame)| frame) } else { None }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: frames pass unchanged while nothing is wrong; they repeat, come twice or come late as told, in order.
    use super::*;
    use dsm::camera::CameraModel;
    use dsm::frame::FrameId;

    fn frame(id: u64) -> Option<RgbdFrame> {
        let model = CameraModel::from_vertical_fov(16, 16, 1.0);
        Some(RgbdFrame {
            id: FrameId(id),
            stamp: Stamp(id as i64 * 100),
            camera: "head".into(),
            model,
            world_from_camera: dsm::Pose::identity(),
            color: Vec::new(),
            depth_m: Vec::new(),
        })
    }

    const NONE: FrameTrouble = FrameTrouble { frozen: Repeats::No, twice: Repeats::No, late: Span(0) };

    #[test]
    fn frames_pass_repeat_and_come_late() {
        let mut frames = Frames::default();
        let mut pass = |now: i64, fresh: Option<RgbdFrame>, trouble| {
            frames.pass("head", Stamp(now), fresh, trouble).map(|frame| frame.id.0)
        };
        assert_eq!(pass(100, frame(1), NONE), Some(1));
        assert_eq!(pass(110, None, NONE), None);
        let frozen = FrameTrouble { frozen: Repeats::Yes, ..NONE };
        assert_eq!(pass(200, frame(2), frozen), Some(1));
        let twice = FrameTrouble { twice: Repeats::Yes, ..NONE };
        assert_eq!(
            [pass(300, frame(3), twice), pass(310, None, twice), pass(320, None, twice)],
            [Some(3), Some(3), None]
        );
        let late = FrameTrouble { late: Span(150), ..NONE };
        assert_eq!(pass(400, frame(4), late), None);
        assert_eq!(pass(500, frame(5), late), None);
        assert_eq!([pass(550, None, late), pass(600, None, late), pass(650, None, NONE)], [Some(4), None, Some(5)]);
    }

    #[test]
    fn what_repeats_gives_what_was_last() {
        let mut kept = Kept::default();
        assert_eq!(kept.pass(1, Repeats::Yes), 1, "there is nothing from before");
        assert_eq!(kept.pass(2, Repeats::No), 2);
        assert_eq!(kept.pass(3, Repeats::Yes), 2);
    }
}
