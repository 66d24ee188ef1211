//! All that a served robot says, by topic.

use crate::account::TAKEN_TOPIC;
use crate::client::clock::ADVANCED_TOPIC;
use crate::error::Ros2Error;
use crate::link::{Delivery, LinkBuilder, Speaker};
use crate::messages::{
    Bool, CameraInfo, Clock, DiagnosticArray, Image, JointState, MaskedDetections, Odometry, PoseStamped,
    PoseWithCovarianceStamped, Step, TFMessage, Text,
};
use crate::settings::{ClockSource, Ros2Settings};
use dsm_robot::model::RobotModel;

/// States kept for sending again.
const STATES: Delivery = Delivery::Reliable { depth: 64 };

/// A message of the robot; cameras by their place in the model.
#[allow(clippy::large_enum_variant, reason = "few of them wait at a time")]
pub(super) enum Saying {
    Joints(JointState),
    Odometry(Box<Odometry>),
    Localisation(Box<PoseWithCovarianceStamped>),
    Transforms(TFMessage),
    Color(usize, Image),
    Depth(usize, Image),
    Info(usize, Box<CameraInfo>),
    CameraPose(usize, PoseStamped),
    Detections(MaskedDetections),
}

impl Saying {
    pub(super) fn is_image(&self) -> bool {
        matches!(self, Self::Color(..) | Self::Depth(..))
    }
}

struct CameraSpeakers {
    color: Speaker<Image>,
    depth: Speaker<Image>,
    info: Speaker<CameraInfo>,
    pose: Option<Speaker<PoseStamped>>,
}

/// The speakers.
pub(super) struct Mouth {
    joints: Speaker<JointState>,
    odometry: Speaker<Odometry>,
    localisation: Speaker<PoseWithCovarianceStamped>,
    transforms: Speaker<TFMessage>,
    cameras: Vec<CameraSpeakers>,
    detections: Option<Speaker<MaskedDetections>>,
    pub(super) fixed: Speaker<TFMessage>,
    pub(super) diagnostics: Speaker<DiagnosticArray>,
    pub(super) clock: Speaker<Clock>,
    pub(super) stop: Speaker<Text>,
    pub(super) advanced: Option<Speaker<Step>>,
    pub(super) taken: Speaker<Bool>,
}

impl Mouth {
    pub(super) fn new<I: Send + 'static>(
        link: &mut LinkBuilder<I>,
        model: &RobotModel,
        settings: &Ros2Settings,
    ) -> Result<Self, Ros2Error> {
        let pictures = match (settings.reliable_pictures, settings.clock) {
            (true, _) | (_, ClockSource::LockStep) => Delivery::Reliable { depth: 16 },
            (false, _) => Delivery::BestEffort { depth: 4 },
        };
        let mut cameras = Vec::new();
        for camera in &model.settings.camera {
            let topics = settings.camera_topics(&camera.name);
            let pose = settings.find_pose_topic(&camera.name);
            cameras.push(CameraSpeakers {
                color: link.speak(&topics.color, pictures)?,
                depth: link.speak(&topics.depth, pictures)?,
                info: link.speak(&topics.info, STATES)?,
                pose: pose.map(|topic| link.speak(&topic, STATES)).transpose()?,
            });
        }
        let sees = !settings.detections.is_empty();
        let detections = if sees { Some(link.speak(&settings.detections, STATES)?) } else { None };
        let steps = settings.clock == ClockSource::LockStep;
        Ok(Self {
            joints: link.speak(&settings.joint_states, STATES)?,
            odometry: link.speak(&settings.odometry, STATES)?,
            localisation: link.speak(&settings.localisation, STATES)?,
            transforms: link.speak("/tf", STATES)?,
            cameras,
            detections,
            fixed: link.speak("/tf_static", Delivery::Kept)?,
            diagnostics: link.speak("/diagnostics", STATES)?,
            clock: link.speak("/clock", STATES)?,
            stop: link.speak(&settings.emergency_stop, Delivery::Kept)?,
            taken: link.speak(TAKEN_TOPIC, Delivery::Reliable { depth: 1 })?,
            advanced: if steps { Some(link.speak(ADVANCED_TOPIC, STATES)?) } else { None },
        })
    }

    pub(super) fn sees(&self) -> bool {
        self.detections.is_some()
    }

    pub(super) fn say(&mut self, saying: Saying) -> Result<(), String> {
        match saying {
            Saying::Joints(message) => self.joints.say(message),
            Saying::Odometry(message) => self.odometry.say(*message),
            Saying::Localisation(message) => self.localisation.say(*message),
            Saying::Transforms(message) => self.transforms.say(message),
            Saying::Color(camera, message) => self.cameras[camera].color.say(message),
            Saying::Depth(camera, message) => self.cameras[camera].depth.say(message),
            Saying::Info(camera, message) => self.cameras[camera].info.say(*message),
            Saying::CameraPose(camera, message) => {
                self.cameras[camera].pose.as_mut().map_or(Ok(()), |speaker| speaker.say(message))
            }
            Saying::Detections(message) => self.detections.as_mut().map_or(Ok(()), |speaker| speaker.say(message)),
        }
    }

    /// Counts anew what belongs to steps.
    pub(super) fn forget_sent(&mut self) {
        self.joints.forget_sent();
        self.odometry.forget_sent();
        self.localisation.forget_sent();
        self.stop.forget_sent();
        self.detections.iter_mut().for_each(Speaker::forget_sent);
        for camera in &mut self.cameras {
            camera.color.forget_sent();
            camera.depth.forget_sent();
            camera.pose.iter_mut().for_each(Speaker::forget_sent);
        }
    }

    /// How many messages belong to the steps so far, by topic.
    pub(super) fn sent(&self) -> (Vec<String>, Vec<u64>) {
        let mut sent = vec![
            (self.joints.topic(), self.joints.sent()),
            (self.odometry.topic(), self.odometry.sent()),
            (self.localisation.topic(), self.localisation.sent()),
            (self.stop.topic(), self.stop.sent()),
        ];
        for camera in &self.cameras {
            sent.push((camera.color.topic(), camera.color.sent()));
            sent.push((camera.depth.topic(), camera.depth.sent()));
            sent.extend(camera.pose.as_ref().map(|speaker| (speaker.topic(), speaker.sent())));
        }
        sent.extend(self.detections.as_ref().map(|speaker| (speaker.topic(), speaker.sent())));
        sent.into_iter().map(|(topic, count)| (topic.to_owned(), count)).unzip()
    }
}
