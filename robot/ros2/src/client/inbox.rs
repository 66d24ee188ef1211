//! What the robot said last.

use super::clock::{ADVANCED_TOPIC, RobotClock};
use super::joints::{Joints, OVERTAKING, is_late};
use super::pictures::{Picture, PictureBuffer, colors_of, depths_of};
use crate::error::Ros2Error;
use crate::link::{Delivery, LinkBuilder};
use crate::messages::{
    Clock, Image, JointState as RosJointState, MaskedDetections, Odometry, PoseStamped, PoseWithCovarianceStamped,
    Step, Text,
};
use crate::settings::{ClockSource, Ros2Settings};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::FrameId;
use dsm::perceive::{Detection, Detections, Mask, Run};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DRIVER_TIMEOUT, DriverError, GripperState, StampedPose, Twist};
use dsm_robot::model::RobotModel;
use std::collections::VecDeque;

/// States kept for the stamps of pictures, which come later than these.
const HISTORY: usize = 256;
/// Frames whose detections may still come.
const FRAMES: usize = 64;

/// A message, by what it means here.
#[allow(clippy::large_enum_variant, reason = "few of them wait at a time")]
pub(super) enum Incoming {
    Joints(RosJointState),
    Odometry(Odometry),
    Localisation(PoseWithCovarianceStamped),
    Color(usize, Image),
    Depth(usize, Image),
    CameraPose(usize, PoseStamped),
    Detections(MaskedDetections),
    Clock(Clock),
    Stepped(Step),
    Stopped(Text),
}

/// Listens on all topics of a robot.
pub(super) fn listen(
    link: &mut LinkBuilder<Incoming>,
    model: &RobotModel,
    settings: &Ros2Settings,
) -> Result<(), Ros2Error> {
    let states = Delivery::Reliable { depth: 64 };
    let pictures = match (settings.reliable_pictures, settings.clock) {
        (true, _) | (_, ClockSource::LockStep) => Delivery::Reliable { depth: 16 },
        (false, _) => Delivery::BestEffort { depth: 4 },
    };
    link.listen(&settings.joint_states, states, Incoming::Joints)?;
    link.listen(&settings.odometry, states, Incoming::Odometry)?;
    link.listen(&settings.localisation, states, Incoming::Localisation)?;
    link.listen(&settings.emergency_stop, Delivery::Kept, Incoming::Stopped)?;
    for (index, camera) in model.settings.camera.iter().enumerate() {
        let topics = settings.camera_topics(&camera.name);
        link.listen(&topics.color, pictures, move |image| Incoming::Color(index, image))?;
        link.listen(&topics.depth, pictures, move |image| Incoming::Depth(index, image))?;
        if let Some(topic) = settings.find_pose_topic(&camera.name) {
            link.listen(&topic, states, move |pose| Incoming::CameraPose(index, pose))?;
        }
    }
    if !settings.detections.is_empty() {
        link.listen(&settings.detections, states, Incoming::Detections)?;
    }
    match settings.clock {
        ClockSource::Wall => {}
        ClockSource::Topic => link.listen("/clock", states, Incoming::Clock)?,
        ClockSource::LockStep => link.listen(ADVANCED_TOPIC, states, Incoming::Stepped)?,
    }
    Ok(())
}

/// What the robot said last, and a short history of it.
pub(super) struct Inbox {
    pub(super) joints: Joints,
    poses: VecDeque<StampedPose>,
    odometry: Option<Heard>,
    /// The newest moment that was heard of.
    newest: Stamp,
    /// How far messages overtake each other.
    overtaking: Span,
    cameras: Vec<Camera>,
    /// Frames that were read, so that detections find theirs.
    frames: VecDeque<(String, Stamp, FrameId)>,
    early: VecDeque<MaskedDetections>,
    /// The newest step that was answered.
    pub(super) stepped: Option<Step>,
    /// Why the robot says that it is stopped.
    pub(super) stopped: Option<String>,
}

/// Odometry, and the newest moment when it came.
#[derive(Clone, Copy)]
struct Heard {
    odom_from_base: StampedPose,
    twist: Twist,
    at: Stamp,
}

struct Camera {
    name: String,
    model: CameraModel,
    pictures: PictureBuffer,
}

pub(super) fn silent(part: &str) -> DriverError {
    DriverError::Lost { part: part.to_owned(), reason: "it has said nothing yet".to_owned() }
}

fn keep<T>(history: &mut VecDeque<T>, item: T, bound: usize) {
    history.push_back(item);
    while history.len() > bound {
        history.pop_front();
    }
}

impl Inbox {
    pub(super) fn new(model: &RobotModel, settings: &Ros2Settings) -> Self {
        let tolerance = Span::from_s(settings.sync_tolerance_s);
        let needs_pose = !settings.camera_pose.is_empty();
        let camera = |camera: &dsm_robot::model::settings::CameraSettings| Camera {
            name: camera.name.clone(),
            model: CameraModel::from_vertical_fov(camera.width, camera.height, camera.vertical_fov_rad),
            pictures: PictureBuffer::new(tolerance, needs_pose),
        };
        Self {
            joints: Joints::default(),
            poses: VecDeque::new(),
            odometry: None,
            newest: Stamp(0),
            overtaking: match settings.clock {
                ClockSource::LockStep => Span(0),
                ClockSource::Wall | ClockSource::Topic => OVERTAKING,
            },
            cameras: model.settings.camera.iter().map(camera).collect(),
            frames: VecDeque::new(),
            early: VecDeque::new(),
            stepped: None,
            stopped: None,
        }
    }

    /// The parts that have said nothing yet, of those without which nothing can be done.
    pub(super) fn find_silent(&self, settings: &Ros2Settings) -> Vec<String> {
        let parts = [
            (self.joints.is_empty(), &settings.joint_states),
            (self.poses.is_empty(), &settings.localisation),
            (self.odometry.is_none(), &settings.odometry),
        ];
        parts.into_iter().filter(|(silent, _)| *silent).map(|(_, topic)| topic.clone()).collect()
    }

    /// Takes in a message; gives back detections whose frame was read.
    pub(super) fn accept(&mut self, message: Incoming, clock: &RobotClock) -> Option<Detections> {
        match message {
            Incoming::Joints(state) => {
                let stamp = clock.stamp(state.header.stamp);
                self.newest = self.newest.max(stamp);
                self.joints.accept(stamp, &state, self.overtaking);
            }
            Incoming::Odometry(said) => self.accept_odometry(&said, clock),
            Incoming::Localisation(said) => match said.pose.pose.find_isometry() {
                Some(pose) => {
                    let stamp = clock.stamp(said.header.stamp);
                    if self.poses.back().is_some_and(|last| is_late(stamp, last.stamp, self.overtaking)) {
                        return None;
                    }
                    keep(&mut self.poses, StampedPose { stamp, pose }, HISTORY);
                }
                None => tracing::warn!("localisation: a pose that is none"),
            },
            Incoming::Color(camera, image) => {
                let Camera { model, pictures, name } = &mut self.cameras[camera];
                match colors_of(&image, model) {
                    Ok(colors) => pictures.add_color(clock.stamp(image.header.stamp), colors),
                    Err(error) => tracing::warn!("camera {name}: {error}"),
                }
            }
            Incoming::Depth(camera, image) => {
                let Camera { model, pictures, name } = &mut self.cameras[camera];
                match depths_of(&image, model) {
                    Ok(depths) => pictures.add_depth(clock.stamp(image.header.stamp), depths),
                    Err(error) => tracing::warn!("camera {name}: {error}"),
                }
            }
            Incoming::CameraPose(camera, said) => match said.pose.find_isometry() {
                Some(pose) => self.cameras[camera].pictures.add_pose(clock.stamp(said.header.stamp), pose),
                None => tracing::warn!("camera {}: a pose that is none", self.cameras[camera].name),
            },
            Incoming::Detections(seen) => return self.match_detections(seen, clock),
            Incoming::Stepped(step) => self.stepped = Some(step),
            Incoming::Stopped(why) => self.stopped = (!why.data.is_empty()).then_some(why.data),
            Incoming::Clock(_) => {}
        }
        None
    }

    fn accept_odometry(&mut self, said: &Odometry, clock: &RobotClock) {
        let twist = Twist { forward_m_per_s: said.twist.twist.linear.x, turn_rad_per_s: said.twist.twist.angular.z };
        let Some(pose) = said.pose.pose.find_isometry() else {
            tracing::warn!("odometry: a pose that is none");
            return;
        };
        let stamp = clock.stamp(said.header.stamp);
        self.newest = self.newest.max(stamp);
        let is_new = |heard: &Heard| !is_late(stamp, heard.odom_from_base.stamp, self.overtaking);
        if self.odometry.as_ref().is_none_or(is_new) {
            self.odometry = Some(Heard { odom_from_base: StampedPose { stamp, pose }, twist, at: self.newest });
        }
    }

    /// The base's velocity has no stamp: where odometry has ceased while others go on, it is lost.
    pub(super) fn base_velocity(&self) -> Result<Twist, DriverError> {
        let heard = self.odometry.as_ref().ok_or_else(|| silent("odometry"))?;
        if self.newest - heard.at > DRIVER_TIMEOUT {
            let reason = format!("odometry has ceased {:.1} s ago", (self.newest - heard.at).as_s());
            return Err(DriverError::Lost { part: "base".into(), reason });
        }
        Ok(heard.twist)
    }

    /// The gripper; fingers that are silent while others go on are lost.
    pub(super) fn gripper_state(&self, model: &RobotModel) -> Result<GripperState, DriverError> {
        let state = self.joints.gripper_state(model)?;
        if self.newest - state.stamp > DRIVER_TIMEOUT {
            let reason = format!("its fingers are silent for {:.1} s", (self.newest - state.stamp).as_s());
            return Err(DriverError::Lost { part: "gripper".into(), reason });
        }
        Ok(state)
    }

    pub(super) fn odom_from_base(&self) -> Result<StampedPose, DriverError> {
        self.odometry.as_ref().map(|heard| heard.odom_from_base).ok_or_else(|| silent("odometry"))
    }

    pub(super) fn world_from_base(&self) -> Result<StampedPose, DriverError> {
        self.poses.back().copied().ok_or_else(|| silent("localisation"))
    }

    /// The newest whole picture of a camera, and the camera's intrinsics.
    pub(super) fn take_picture(&mut self, camera: &str) -> Option<(Picture, CameraModel)> {
        let camera = self.cameras.iter_mut().find(|known| known.name == camera)?;
        Some((camera.pictures.take()?, camera.model))
    }

    /// Where the base was at a moment: the pose nearest to it.
    pub(super) fn find_pose_at(&self, stamp: Stamp) -> Option<Pose> {
        self.poses.iter().min_by_key(|pose| (pose.stamp.0 - stamp.0).abs()).map(|pose| pose.pose)
    }

    /// Notes a frame that was read: detections that come later, or came before, are those of this frame.
    pub(super) fn note_frame(&mut self, camera: &str, stamp: Stamp, id: FrameId) {
        keep(&mut self.frames, (camera.to_owned(), stamp, id), FRAMES);
    }

    /// The number that the robot itself gave a picture, when its detections came before it was read.
    pub(super) fn find_number(&self, camera: &str, stamp: Stamp, clock: &RobotClock) -> Option<FrameId> {
        let same = |seen: &&MaskedDetections| seen.header.frame_id == camera && clock.stamp(seen.header.stamp) == stamp;
        self.early.iter().find(same).map(|seen| FrameId(seen.frame))
    }

    /// Detections that came before their frame was read, once it is.
    pub(super) fn find_matched(&mut self, clock: &RobotClock) -> Option<Detections> {
        let index = self.early.iter().position(|seen| self.find_frame(seen, clock).is_some())?;
        let seen = self.early.remove(index)?;
        self.find_frame(&seen, clock).map(|frame| detections_of(frame, seen))
    }

    fn find_frame(&self, seen: &MaskedDetections, clock: &RobotClock) -> Option<FrameId> {
        let stamp = clock.stamp(seen.header.stamp);
        let same = |(camera, at, _): &&(String, Stamp, FrameId)| *camera == seen.header.frame_id && *at == stamp;
        self.frames.iter().find(same).map(|(_, _, id)| *id)
    }

    fn match_detections(&mut self, seen: MaskedDetections, clock: &RobotClock) -> Option<Detections> {
        match self.find_frame(&seen, clock) {
            Some(frame) => Some(detections_of(frame, seen)),
            None => {
                keep(&mut self.early, seen, FRAMES);
                None
            }
        }
    }
}

fn detections_of(frame: FrameId, seen: MaskedDetections) -> Detections {
    let width = seen.width;
    let items = seen.detections.into_iter().map(|item| {
        let runs = item.runs.iter().map(|run| Run { start: run.start, length: run.length }).collect();
        Detection { mask: Mask { image_width: width, runs }, name: item.name, score: item.score }
    });
    Detections { frame, items: items.collect() }
}
