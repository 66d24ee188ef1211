//! Cameras: captures at their rates, images when they are read.

use super::SimRobotError;
use crate::physics::Physics;
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{Cameras, DriverError};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::RobotModel;
use std::sync::Arc;

/// The world at the moment of a capture.
#[derive(Clone, Copy, Debug)]
pub struct CaptureRequest<'a> {
    /// Number of the frame.
    pub id: FrameId,
    /// Name of the camera.
    pub camera: &'a str,
    /// Its intrinsics.
    pub model: &'a CameraModel,
    /// Poses of the scene's bodies.
    pub world_from_bodies: &'a [Pose],
    /// Poses of the robot's links, in the order of [`Physics::link_names`].
    pub world_from_links: &'a [Pose],
    /// True pose of the camera.
    pub world_from_camera: Pose,
    /// When the image is taken.
    pub stamp: Stamp,
    /// True pose of the robot's base.
    pub world_from_base: Pose,
    /// True positions of the robot's joints.
    pub joints: &'a JointPositions,
}

/// Colour and depth as the sensor gives them, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorImage {
    /// sRGB.
    pub color: Vec<[u8; 3]>,
    /// Depth along z in metres; 0 means no return.
    pub depth_m: Vec<f32>,
}

/// Makes images of the world: rasteriser and sensor model. What it knows beyond colour and depth stays in this crate.
pub trait Imager: Send {
    /// The image of a capture.
    fn take_image(&mut self, request: &CaptureRequest<'_>) -> SensorImage;
}

/// A moment kept until its image is read.
struct Capture {
    id: FrameId,
    stamp: Stamp,
    world_from_bodies: Vec<Pose>,
    world_from_links: Vec<Pose>,
    world_from_base: Pose,
    joints: JointPositions,
    /// Believed pose of the camera.
    world_from_camera: Pose,
}

struct SimCamera {
    name: Arc<str>,
    link: usize,
    model: CameraModel,
    period: Span,
    next: Stamp,
    waiting: Option<Capture>,
}

/// All cameras of the robot.
pub(super) struct SimCameras {
    cameras: Vec<SimCamera>,
    imager: Box<dyn Imager>,
    body_count: usize,
    next_id: u64,
}

impl SimCameras {
    pub(super) fn new(
        model: &RobotModel,
        physics: &dyn Physics,
        imager: Box<dyn Imager>,
    ) -> Result<Self, SimRobotError> {
        let mut cameras = Vec::new();
        for settings in &model.settings.camera {
            let link = physics.find_link(&settings.frame).ok_or_else(|| SimRobotError::NoFrame {
                camera: settings.name.clone(),
                frame: settings.frame.clone(),
            })?;
            cameras.push(SimCamera {
                name: settings.name.as_str().into(),
                link,
                model: CameraModel::from_vertical_fov(settings.width, settings.height, settings.vertical_fov_rad),
                period: Span::from_s(1.0 / settings.rate_hz),
                next: physics.now(),
                waiting: None,
            });
        }
        Ok(Self { cameras, imager, body_count: physics.body_count(), next_id: 0 })
    }

    /// Captures with every camera that is due.
    pub(super) fn tick(&mut self, physics: &dyn Physics, believed_world_from_base: &Pose) {
        let now = physics.now();
        for camera in self.cameras.iter_mut().filter(|camera| now >= camera.next) {
            while camera.next <= now {
                camera.next = camera.next + camera.period;
            }
            let links = physics.link_names().len();
            let base_from_camera = physics.world_from_base().inv_mul(&physics.world_from_link(camera.link));
            camera.waiting = Some(Capture {
                id: FrameId(self.next_id),
                stamp: now,
                world_from_bodies: (0..self.body_count).map(|body| physics.world_from_body(body)).collect(),
                world_from_links: (0..links).map(|link| physics.world_from_link(link)).collect(),
                world_from_base: physics.world_from_base(),
                joints: physics.joint_positions(),
                world_from_camera: believed_world_from_base * base_from_camera,
            });
            self.next_id += 1;
        }
    }
}

impl Cameras for SimCameras {
    fn names(&self) -> Vec<String> {
        self.cameras.iter().map(|camera| camera.name.to_string()).collect()
    }

    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        let Some(found) = self.cameras.iter_mut().find(|c| *c.name == *camera) else {
            return Err(DriverError::NoCamera { name: camera.into(), known: self.names() });
        };
        let Some(capture) = found.waiting.take() else { return Ok(None) };
        let image = self.imager.take_image(&CaptureRequest {
            id: capture.id,
            camera,
            model: &found.model,
            world_from_bodies: &capture.world_from_bodies,
            world_from_links: &capture.world_from_links,
            world_from_camera: capture.world_from_links[found.link],
            stamp: capture.stamp,
            world_from_base: capture.world_from_base,
            joints: &capture.joints,
        });
        Ok(Some(RgbdFrame {
            id: capture.id,
            stamp: capture.stamp,
            camera: found.name.clone(),
            model: found.model,
            world_from_camera: capture.world_from_camera,
            color: image.color,
            depth_m: image.depth_m,
        }))
    }
}
