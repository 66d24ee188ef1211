//! A run seen again: the frames of a recorded drive, and what of the scene they show, for evaluation.
//!
//! ```text
//! drive ──Moment (true poses)──▶ Replay::show ──▶ RgbdFrame, Detections ──▶ a map under any pose noise
//!                                     └─labels (private)──▶ what was seen ──finish──▶ TrueScene, for the evaluator alone
//! ```
//!
//! An image is a function of poses, seed and frame number: it is the one that the drive saw.

mod labels;
mod masks;
mod sightings;
mod surface;
mod wander;

use crate::camera::{CameraRig, LightDraw, NoiseKey, NoiseParameters, SensorModel, TrueImage, robot_visuals};
use crate::detect::{LabelIds, LabelImage, LabelSender, SimDetector, label_channel};
use crate::robot::CaptureRequest;
use crate::scene::{SceneJoint, SceneModel, Semantics, scene_file};
use crate::world::imager::STREAM;
use crate::world::{Perception, WorldError};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::eval::{TrueRoom, TrueScene};
use dsm::frame::{FrameId, RgbdFrame};
use dsm::geometry::OrientedBox;
use dsm::perceive::{Detections, Detector};
use dsm::time::Stamp;
use dsm_robot::joints::JointPositions;
use dsm_robot::model::{Configuration, RobotModel};
use masks::ThingLabels;
use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use sightings::Sightings;
use std::path::Path;
use std::sync::Arc;

pub use labels::label_surfaces;
pub use masks::MaskScore;
pub use wander::PoseWander;

/// What is needed to see one image again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Number of the frame.
    pub id: FrameId,
    /// When it was taken.
    pub stamp: Stamp,
    /// Name of the camera.
    pub camera: String,
    /// Its intrinsics.
    pub model: CameraModel,
    /// True pose of the camera.
    pub world_from_camera: Pose,
    /// True pose of the robot's base.
    pub world_from_base: Pose,
    /// True positions of the robot's joints.
    pub joints: JointPositions,
    /// True poses of the scene's bodies by their place in the scene; only those that differ from the moment before.
    pub moved: Vec<(usize, Pose)>,
}

/// Turns captures into moments.
#[derive(Debug, Default)]
pub(crate) struct Recorder {
    last: Vec<Pose>,
}

impl Recorder {
    /// The moment of a capture.
    pub(crate) fn record(&mut self, request: &CaptureRequest<'_>) -> Moment {
        let bodies = request.world_from_bodies;
        let moved = |(index, pose): (usize, &Pose)| (self.last.get(index) != Some(pose)).then_some((index, *pose));
        let moved = bodies.iter().enumerate().filter_map(moved).collect();
        self.last = bodies.to_vec();
        Moment {
            id: request.id,
            stamp: request.stamp,
            camera: request.camera.to_owned(),
            model: *request.model,
            world_from_camera: request.world_from_camera,
            world_from_base: request.world_from_base,
            joints: request.joints.clone(),
            moved,
        }
    }
}

/// A frame as it was seen, and where the robot really was.
pub struct Shown {
    /// The frame; its pose is the true one.
    pub frame: RgbdFrame,
    /// What the simulated detector says about it.
    pub detections: Detections,
    /// True pose of the base.
    pub world_from_base: Pose,
    /// Boxes around the robot's links, world frame.
    pub robot: Vec<OrientedBox>,
}

/// A scene, a robot and a seed, ready to show the moments of a drive in their order.
pub struct Replay {
    robot: Arc<RobotModel>,
    semantics: Semantics,
    scene: SceneModel,
    bodies: Vec<Pose>,
    /// Joints whose parts no moment has moved yet: those stand where they stood on what carries them.
    standing: Vec<(SceneJoint, Pose)>,
    rig: CameraRig,
    sensor: SensorModel,
    labels: LabelSender,
    detector: SimDetector,
    seed: u64,
    image: TrueImage,
    sightings: Sightings,
    things: ThingLabels,
}

impl Replay {
    /// Loads a scene (its file or folder) and prepares to look at it as the robot of a run with this seed did.
    ///
    /// # Errors
    /// [`WorldError`]: whatever is wrong with the scene, its semantics or the robot's looks.
    pub fn load(scene: &Path, robot: Arc<RobotModel>, perception: Perception, seed: u64) -> Result<Self, WorldError> {
        let model = SceneModel::load(scene)?;
        let semantics = Semantics::load(&scene_file(scene), &model)?;
        let visuals = robot_visuals(&robot.kinematics);
        let wholes = semantics.find_wholes(&model);
        let rig = CameraRig::new(&model, &visuals, &LightDraw::new(seed))?.showing(&model, &wholes);
        let sensor = match perception {
            Perception::Noisy => SensorModel::noisy(NoiseParameters::default())?,
            Perception::Oracle => SensorModel::oracle(),
        };
        let (labels, receiver) = label_channel(LabelIds::default());
        let detector = SimDetector::new(receiver, &model, &semantics, perception, seed);
        let sightings = Sightings::new(&model, &semantics, &rig);
        let things = ThingLabels::new(&model, &semantics);
        let bodies = model.bodies.iter().map(|body| body.world_from_body).collect();
        let standing = model.joints.iter().map(|joint| (joint.clone(), model.standing_part(joint))).collect();
        Ok(Self {
            robot,
            semantics,
            scene: model,
            bodies,
            standing,
            rig,
            sensor,
            labels,
            detector,
            seed,
            image: TrueImage::default(),
            sightings,
            things,
        })
    }

    /// The robot that drove.
    pub fn robot(&self) -> &RobotModel {
        &self.robot
    }

    /// Shows the next moment. Moments must come in the order in which they were recorded.
    pub fn show(&mut self, moment: &Moment) -> Shown {
        for (body, pose) in &moment.moved {
            if let Some(known) = self.bodies.get_mut(*body) {
                *known = *pose;
            }
        }
        self.standing.retain(|(joint, _)| !moment.moved.iter().any(|(body, _)| *body == joint.part));
        for (joint, carrier_from_part) in &self.standing {
            self.bodies[joint.part] = self.bodies[joint.carrier] * carrier_from_part;
        }
        let configuration = self.configuration(&moment.joints);
        let base_from_links = self.robot.kinematics.root_from_links(&configuration);
        let links: Vec<Pose> = base_from_links.as_slice().iter().map(|link| moment.world_from_base * link).collect();
        let camera = &moment.world_from_camera;
        self.rig.render_into(&self.bodies, &links, &moment.model, camera, &mut self.image);
        self.sightings.note(&self.image, &moment.model, camera, &self.bodies);
        self.labels.send(moment.id, LabelImage::encode(moment.model.width, &self.image.labels));
        let key = NoiseKey { seed: self.seed, stream: STREAM, frame: moment.id.0 };
        let sensed = self.sensor.sense(&self.image, &moment.model, key);
        let frame = RgbdFrame {
            id: moment.id,
            stamp: moment.stamp,
            camera: moment.camera.as_str().into(),
            model: moment.model,
            world_from_camera: *camera,
            color: sensed.color,
            depth_m: sensed.depth_m,
        };
        let detections = self.detector.detect(&frame);
        let robot = self.robot.link_boxes(&configuration, &moment.world_from_base);
        Shown { frame, detections, world_from_base: moment.world_from_base, robot }
    }

    /// Counts the masks that a detector found in the frame that was shown last. For the evaluator alone.
    pub fn count_masks(&self, detections: &Detections, score: &mut MaskScore) {
        self.things.count(&self.image, &detections.items, score);
    }

    /// The truth about the scene at the last moment, with what was seen of it. For the evaluator alone.
    pub fn finish(self) -> TrueScene {
        let room = |room: &crate::scene::RoomSemantics| TrueRoom {
            name: room.name.clone(),
            polygon: room.polygon.iter().map(|[x, y]| Point2::new(*x, *y)).collect(),
        };
        TrueScene {
            name: self.scene.name.clone(),
            rooms: self.semantics.rooms.iter().map(room).collect(),
            objects: self.sightings.into_objects(&self.bodies),
        }
    }

    fn configuration(&self, joints: &JointPositions) -> Configuration {
        let mut configuration = self.robot.kinematics.zero();
        configuration.apply(joints);
        configuration
    }
}
