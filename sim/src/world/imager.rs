//! The cameras of a world: images for the robot, labels for the detector, what is in view for the truth.

use super::truth::{WATCHED_CAMERA, find_in_view};
use crate::camera::{CameraRig, NoiseKey, SensorModel, TrueImage};
use crate::detect::{LabelImage, LabelSender};
use crate::replay::{Moment, Recorder};
use crate::robot::{CaptureRequest, Imager, SensorImage};
use std::sync::mpsc::Sender;

/// Stream of the cameras among all that a seed draws.
pub(crate) const STREAM: u64 = 0x6361_6d65_7261_0000;

/// Draws true images and passes them through the sensor model.
pub(super) struct WorldImager {
    rig: CameraRig,
    sensor: SensorModel,
    labels: LabelSender,
    views: Sender<Vec<usize>>,
    /// Where the poses of each image go, when somebody wants to see it again.
    recorder: Option<(Recorder, Sender<Moment>)>,
    seed: u64,
    /// Used again for every image.
    image: TrueImage,
}

impl WorldImager {
    pub(super) fn new(
        rig: CameraRig,
        sensor: SensorModel,
        labels: LabelSender,
        views: Sender<Vec<usize>>,
        recorder: Option<Sender<Moment>>,
        seed: u64,
    ) -> Self {
        let recorder = recorder.map(|sender| (Recorder::default(), sender));
        Self { rig, sensor, labels, views, recorder, seed, image: TrueImage::default() }
    }
}

impl Imager for WorldImager {
    fn take_image(&mut self, request: &CaptureRequest<'_>) -> SensorImage {
        if let Some((recorder, sender)) = &mut self.recorder {
            // Nobody records any more: then nobody misses it.
            let _ = sender.send(recorder.record(request));
        }
        let (bodies, links) = (request.world_from_bodies, request.world_from_links);
        self.rig.set_light(request.light);
        self.rig.render_into(bodies, links, request.model, &request.world_from_camera, &mut self.image);
        let labels = LabelImage::encode(request.model.width, &self.image.labels);
        if request.camera == WATCHED_CAMERA {
            // Nobody judges any more: then nobody needs to know.
            let _ = self.views.send(find_in_view(&labels, bodies.len()));
        }
        self.labels.send(request.id, labels);
        // Frame numbers are unique over all cameras: one stream is enough.
        let key = NoiseKey { seed: self.seed, stream: STREAM, frame: request.id.0 };
        let sensed = self.sensor.sense(&self.image, request.model, key);
        SensorImage { color: sensed.color, depth_m: sensed.depth_m }
    }
}
