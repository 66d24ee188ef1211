//! The private channel from the simulated cameras to the simulated detector. Label images never leave this crate.

use crate::camera::ROBOT_LABEL;
use dsm::frame::FrameId;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Label of pixels that show nothing.
pub(crate) const NOTHING: u32 = 0;
/// Frames kept for a detector that lags behind the cameras.
const KEPT_FRAMES: usize = 32;

/// Which label ids the cameras hand out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LabelIds {
    /// Body index + 1.
    #[default]
    Stable,
    /// Another permutation in every frame, to show that nothing depends on the ids.
    PermutedPerFrame,
}

/// Pixels in row-major order with one label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LabelRun {
    pub start: u32,
    pub length: u32,
    pub label: u32,
}

/// What each pixel of a frame shows, run-length encoded; a run never crosses the end of a row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LabelImage {
    pub width: u32,
    pub height: u32,
    /// Runs in row-major order; pixels that show nothing are left out.
    pub runs: Vec<LabelRun>,
    /// Scene body of each label: `body_of_label[label - 1]`; `None` when the labels are body index + 1.
    pub body_of_label: Option<Vec<usize>>,
}

impl LabelImage {
    /// Encodes row-major labels (0 nothing, body index + 1, or [`ROBOT_LABEL`]).
    pub(crate) fn encode(width: u32, labels: &[u32]) -> Self {
        let mut runs: Vec<LabelRun> = Vec::new();
        for (row, line) in labels.chunks_exact(width as usize).enumerate() {
            let mut column = 0;
            while column < line.len() {
                let label = line[column];
                let length = line[column..].iter().take_while(|other| **other == label).count();
                if label != NOTHING {
                    let start = row as u32 * width + column as u32;
                    runs.push(LabelRun { start, length: length as u32, label });
                }
                column += length;
            }
        }
        Self { width, height: labels.len() as u32 / width.max(1), runs, body_of_label: None }
    }

    /// The scene body that a label stands for; `None` for the robot and for what is no body.
    pub(crate) fn find_body(&self, label: u32) -> Option<usize> {
        if label == NOTHING || label == ROBOT_LABEL {
            return None;
        }
        let index = label as usize - 1;
        self.body_of_label.as_ref().map_or(Some(index), |table| table.get(index).copied())
    }

    /// The same image with other ids for the bodies.
    fn permuted(mut self, frame: FrameId) -> Self {
        let known = self.runs.iter().filter(|run| run.label != ROBOT_LABEL).map(|run| run.label);
        let count = known.max().unwrap_or(0) as usize;
        let mut body_of_label: Vec<usize> = (0..count).collect();
        body_of_label.shuffle(&mut ChaCha8Rng::seed_from_u64(frame.0));
        let mut label_of_body = vec![NOTHING; count];
        for (index, body) in body_of_label.iter().enumerate() {
            label_of_body[*body] = index as u32 + 1;
        }
        for run in self.runs.iter_mut().filter(|run| run.label != ROBOT_LABEL) {
            run.label = label_of_body[run.label as usize - 1];
        }
        Self { body_of_label: Some(body_of_label), ..self }
    }
}

/// The cameras' end.
pub(crate) struct LabelSender {
    sender: Sender<(FrameId, LabelImage)>,
    ids: LabelIds,
}

impl LabelSender {
    /// Hands the labels of a frame to the detector; lost when there is none any more.
    pub(crate) fn send(&self, frame: FrameId, image: LabelImage) {
        let image = match self.ids {
            LabelIds::Stable => image,
            LabelIds::PermutedPerFrame => image.permuted(frame),
        };
        // No detector listens: then nobody needs the labels.
        let _ = self.sender.send((frame, image));
    }
}

/// The detector's end.
pub(crate) struct LabelReceiver {
    receiver: Receiver<(FrameId, LabelImage)>,
    waiting: BTreeMap<FrameId, LabelImage>,
}

impl LabelReceiver {
    /// The labels of a frame, if it came from the cameras and is not long gone.
    pub(crate) fn take(&mut self, frame: FrameId) -> Option<LabelImage> {
        self.waiting.extend(self.receiver.try_iter());
        let image = self.waiting.remove(&frame);
        while self.waiting.len() > KEPT_FRAMES {
            self.waiting.pop_first();
        }
        image
    }
}

/// A channel from the cameras to the detector.
pub(crate) fn label_channel(ids: LabelIds) -> (LabelSender, LabelReceiver) {
    let (sender, receiver) = channel();
    (LabelSender { sender, ids }, LabelReceiver { receiver, waiting: BTreeMap::new() })
}

#[cfg(test)]
mod tests {
    //! Contract: labels survive the channel by frame, and a permutation changes ids, never what they stand for.
    use super::*;

    #[test]
    fn encoding_keeps_every_label_within_rows() {
        let image = LabelImage::encode(3, &[1, 1, 2, 2, 0, ROBOT_LABEL]);
        let run = |start, length, label| LabelRun { start, length, label };
        assert_eq!(image.runs, [run(0, 2, 1), run(2, 1, 2), run(3, 1, 2), run(5, 1, ROBOT_LABEL)]);
        assert_eq!((image.find_body(2), image.find_body(ROBOT_LABEL), image.find_body(0)), (Some(1), None, None));
    }

    #[test]
    fn permuted_ids_stand_for_the_same_bodies() {
        let labels: Vec<u32> = (0..40).map(|i| 1 + i % 20).collect();
        let (sender, mut receiver) = label_channel(LabelIds::PermutedPerFrame);
        let plain = LabelImage::encode(40, &labels);
        sender.send(FrameId(3), plain.clone());
        sender.send(FrameId(4), plain.clone());
        let (third, fourth) = (receiver.take(FrameId(3)).expect("sent"), receiver.take(FrameId(4)).expect("sent"));
        for image in [&third, &fourth] {
            let bodies: Vec<_> = image.runs.iter().map(|run| image.find_body(run.label)).collect();
            assert_eq!(bodies, plain.runs.iter().map(|run| plain.find_body(run.label)).collect::<Vec<_>>());
        }
        assert_ne!(third.runs, plain.runs);
        assert_ne!(third.runs, fourth.runs);
        assert!(receiver.take(FrameId(3)).is_none());
    }
}
