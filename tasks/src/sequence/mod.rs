//! RGB-D sequences on disk: recorded by a run, or brought along, and mapped without a simulator.
//!
//! ```text
//! sequence.json      version, what is exact
//! frames.jsonl       one frame a line: number, stamp, camera, intrinsics, pose, images, what carries the camera
//! detections.jsonl   one frame a line: masks, names, scores (no instance ids)
//! color/NUMBER.png   8-bit RGB
//! depth/NUMBER.png   16-bit grey, millimetres along the camera's z, 0 where there is no return
//! depth/NUMBER.f32   the same in metres as little-endian f32, only when recorded with --exact-depth
//! ```

mod foreign;
mod images;
mod read;
mod record;

#[cfg(feature = "mcap")]
pub(crate) use images::{decode_color, decode_depth};
pub use read::{Layout, Options, Sequence};
pub use record::SequenceRecorder;

use dsm::Pose;
use dsm::build::Carrier;
use dsm::camera::CameraModel;
use dsm::frame::FrameId;
use dsm::geometry::OrientedBox;
use dsm::map::ObjectId;
use dsm::perceive::{Detection, Mask, Run};
use dsm::time::Stamp;
use nalgebra::{Point2, Vector3};
use serde::{Deserialize, Serialize};

/// Version of the layout.
pub const VERSION: u32 = 1;

/// `sequence.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Head {
    pub(crate) version: u32,
    /// What the frames come from, in words.
    pub(crate) source: String,
    /// Millimetres in a unit of the depth images.
    pub(crate) depth_unit_mm: f64,
    /// Whether depth was kept as measured beside the images.
    pub(crate) exact_depth: bool,
}

/// A line of `frames.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FrameLine {
    pub(crate) id: FrameId,
    pub(crate) stamp: Stamp,
    pub(crate) camera: String,
    pub(crate) model: CameraModel,
    pub(crate) world_from_camera: Pose,
    pub(crate) color: String,
    pub(crate) depth: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) exact_depth: Option<String>,
    #[serde(default)]
    pub(crate) carrier: CarrierLine,
}

/// What carries the camera.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct CarrierLine {
    pub(crate) bodies: Vec<OrientedBox>,
    pub(crate) footprint: Option<(Point2<f64>, f64)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) moved: Vec<(ObjectId, Vector3<f64>)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) swept: Vec<OrientedBox>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) missed: Vec<ObjectId>,
}

impl From<&Carrier> for CarrierLine {
    fn from(carrier: &Carrier) -> Self {
        let Carrier { bodies, footprint, moved, swept, missed } = carrier.clone();
        Self { bodies, footprint, moved, swept, missed }
    }
}

impl From<CarrierLine> for Carrier {
    fn from(line: CarrierLine) -> Self {
        let CarrierLine { bodies, footprint, moved, swept, missed } = line;
        Self { bodies, footprint, moved, swept, missed }
    }
}

/// A line of `detections.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct DetectionsLine {
    pub(crate) frame: FrameId,
    /// Who detected; files of others need not say.
    #[serde(default = "unnamed_detector")]
    pub(crate) detector: String,
    pub(crate) items: Vec<DetectionLine>,
}

fn unnamed_detector() -> String {
    "recorded".into()
}

/// One detection; its mask as pairs of first pixel (row-major) and length, none across the end of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct DetectionLine {
    pub(crate) name: String,
    pub(crate) score: f32,
    pub(crate) runs: Vec<[u32; 2]>,
}

impl From<&Detection> for DetectionLine {
    fn from(detection: &Detection) -> Self {
        let runs = detection.mask.runs.iter().map(|run| [run.start, run.length]).collect();
        Self { name: detection.name.clone(), score: detection.score, runs }
    }
}

impl DetectionLine {
    /// The detection in an image of `model`; `None` when its runs do not fit.
    pub(crate) fn find_detection(self, model: &CameraModel) -> Option<Detection> {
        let (width, mut end) = (model.width, 0_u64);
        let pixels = model.pixel_count() as u64;
        for [start, length] in &self.runs {
            let (start, length) = (u64::from(*start), u64::from(*length));
            let in_row = length > 0 && start / u64::from(width) == (start + length - 1) / u64::from(width);
            if start < end || !in_row || start + length > pixels {
                return None;
            }
            end = start + length;
        }
        let runs = self.runs.into_iter().map(|[start, length]| Run { start, length }).collect();
        Some(Detection { mask: Mask { image_width: width, runs }, name: self.name, score: self.score })
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a mask comes back as it was; one that does not fit its image is refused.
    use super::*;

    #[test]
    fn masks_come_back_and_must_fit() {
        let model = CameraModel::from_vertical_fov(10, 4, 1.0);
        let mask = Mask::from_sorted_pixels(10, [3, 4, 9, 10, 11, 39]);
        let detection = Detection { mask, name: "mug".into(), score: 0.25 };
        let line = DetectionLine::from(&detection);
        assert_eq!(line.runs, [[3, 2], [9, 1], [10, 2], [39, 1]]);
        assert_eq!(line.clone().find_detection(&model), Some(detection));
        for runs in [vec![[9, 2]], vec![[5, 2], [6, 1]], vec![[39, 2]], vec![[3, 0]], vec![[u32::MAX, u32::MAX]]] {
            assert_eq!(DetectionLine { runs, ..line.clone() }.find_detection(&model), None);
        }
    }
}
