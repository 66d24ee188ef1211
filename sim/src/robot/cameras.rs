//! Cameras: captures at their rates, images when they are read.

use super::SimRobotError;
use crate::disturb::Conditions;
use crate::physics::Physics;
use crate::world::stream;
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{Cameras, DriverError};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::RobotModel;
use rand::RngExt;
use std::collections::VecDeque;
use std::sync::Arc;

/// Stream of lost frames among all that a seed draws.
const LOSS_STREAM: u64 = 0x6c6f_7374_0000;

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
    /// Share of the world's light that was there, 0 to 1.
    pub light: f32,
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
    /// When it can be read.
    ready: Stamp,
    light: f32,
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
    /// From exposure to handing out.
    latency: Span,
    next: Stamp,
    /// The newest capture that is ready, then those on their way.
    waiting: VecDeque<Capture>,
}

/// All cameras of the robot.
pub(super) struct SimCameras {
    cameras: Vec<SimCamera>,
    imager: Box<dyn Imager>,
    body_count: usize,
    next_id: u64,
    now: Stamp,
    /// Seed of what is lost.
    seed: u64,
}

impl SimCameras {
    pub(super) fn new(
        model: &RobotModel,
        physics: &dyn Physics,
        imager: Box<dyn Imager>,
        seed: u64,
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
                latency: Span::from_s(settings.latency_s),
                next: physics.now(),
                waiting: VecDeque::new(),
            });
        }
        Ok(Self { cameras, imager, body_count: physics.body_count(), next_id: 0, now: physics.now(), seed })
    }

    /// Captures with every camera that is due.
    pub(super) fn tick(&mut self, physics: &dyn Physics, believed_world_from_base: &Pose, conditions: &Conditions) {
        let now = physics.now();
        self.now = now;
        for camera in self.cameras.iter_mut().filter(|camera| now >= camera.next) {
            while camera.next <= now {
                camera.next = camera.next + camera.period;
            }
            let links = physics.link_names().len();
            let base_from_camera = physics.world_from_base().inv_mul(&physics.world_from_link(camera.link));
            let id = FrameId(self.next_id);
            self.next_id += 1;
            let is_lost =
                conditions.lost > 0.0 && stream(self.seed, LOSS_STREAM, id.0).random::<f64>() < conditions.lost;
            if is_lost {
                continue;
            }
            camera.waiting.push_back(Capture {
                id,
                stamp: now,
                ready: now + conditions.late + camera.latency,
                light: conditions.light,
                world_from_bodies: (0..self.body_count).map(|body| physics.world_from_body(body)).collect(),
                world_from_links: (0..links).map(|link| physics.world_from_link(link)).collect(),
                world_from_base: physics.world_from_base(),
                joints: physics.joint_positions(),
                world_from_camera: believed_world_from_base * base_from_camera,
            });
        }
        for camera in &mut self.cameras {
            while camera.waiting.get(1).is_some_and(|second| second.ready <= now) {
                camera.waiting.pop_front();
            }
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
        let is_ready = |capture: &Capture| capture.ready <= self.now;
        if !found.waiting.front().is_some_and(is_ready) {
            return Ok(None);
        }
        let Some(capture) = found.waiting.pop_front() else { return Ok(None) };
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
            light: capture.light,
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
