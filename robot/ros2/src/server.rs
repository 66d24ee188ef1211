//! A robot behind the driver traits, shown to the ROS 2 graph as one that speaks ROS 2.
//!
//! ```text
//! topics ──▶ commands ──▶ robot ──wait_until──▶ states, pictures, detections ──▶ topics
//! ```

use crate::client::clock::{ADVANCE_TOPIC, ADVANCED_TOPIC};
use crate::error::Ros2Error;
use crate::link::{Delivery, Link, LinkBuilder, Speaker};
use crate::messages::{
    CameraInfo, Clock, Float64MultiArray, GripperCommand, Header, Image, JointState, JointTrajectory, MaskedDetection,
    MaskedDetections, Odometry, PixelRun, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, Step, TFMessage,
    Text, TransformStamped, Twist as RosTwist, TwistStamped, TwistWithCovariance, Vector3,
};
use crate::settings::{ClockSource, JointInterface, Ros2Settings};
use dsm::frame::RgbdFrame;
use dsm::perceive::Detector;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DriverError, JointGroup, Robot, Twist};
use dsm_robot::joints::{JointNames, JointVelocities};
use dsm_robot::model::RobotModel;
use std::sync::Arc;
use std::time::Duration;

/// Frame of the map on the wire.
const MAP_FRAME: &str = "map";
/// Frame of the odometry on the wire.
const ODOM_FRAME: &str = "odom";
/// How long to wait for a message before looking whether it is over.
const LOOK: Duration = Duration::from_millis(20);
/// States kept for sending again.
const STATES: Delivery = Delivery::Reliable { depth: 64 };

/// A message to the robot.
enum Command {
    Base(TwistStamped),
    Arm(Float64MultiArray),
    Head(Float64MultiArray),
    ArmTrajectory(JointTrajectory),
    HeadTrajectory(JointTrajectory),
    Gripper(GripperCommand),
    Stop(Text),
    Advance(Step),
}

/// A robot that is served.
pub struct Server {
    link: Link<Command>,
    settings: Ros2Settings,
    model: Arc<RobotModel>,
    joints: Speaker<JointState>,
    odometry: Speaker<Odometry>,
    localisation: Speaker<PoseWithCovarianceStamped>,
    transforms: Speaker<TFMessage>,
    clock: Speaker<Clock>,
    advanced: Option<Speaker<Step>>,
    cameras: Vec<CameraSpeakers>,
    detections: Option<Speaker<MaskedDetections>>,
    stop: Speaker<Text>,
    said_stop: Option<String>,
}

struct CameraSpeakers {
    name: String,
    color: Speaker<Image>,
    depth: Speaker<Image>,
    info: Speaker<CameraInfo>,
    pose: Option<Speaker<PoseStamped>>,
}

/// Why a robot is served no longer.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The robot.
    #[error(transparent)]
    Driver(#[from] DriverError),
    /// The graph.
    #[error("ROS 2: {0}")]
    Graph(String),
}

impl Server {
    /// Joins the graph as the robot of a model, under the names of `settings`.
    ///
    /// # Errors
    /// [`Ros2Error`].
    pub fn start(model: Arc<RobotModel>, settings: Ros2Settings) -> Result<Self, Ros2Error> {
        let mut link = LinkBuilder::new("dsm_robot", settings.domain)?;
        let commands = Delivery::Reliable { depth: 64 };
        link.listen(&settings.base_command, commands, Command::Base)?;
        match settings.arm_interface {
            JointInterface::Velocities => link.listen(&settings.arm_command, commands, Command::Arm)?,
            JointInterface::Trajectory => link.listen(&settings.arm_command, commands, Command::ArmTrajectory)?,
        }
        match settings.head_interface {
            JointInterface::Velocities => link.listen(&settings.head_command, commands, Command::Head)?,
            JointInterface::Trajectory => link.listen(&settings.head_command, commands, Command::HeadTrajectory)?,
        }
        link.listen(&settings.gripper_command, commands, Command::Gripper)?;
        link.listen(&settings.emergency_stop, Delivery::Kept, Command::Stop)?;
        let advanced = match settings.clock {
            ClockSource::LockStep => {
                link.listen(ADVANCE_TOPIC, commands, Command::Advance)?;
                Some(link.speak(ADVANCED_TOPIC, STATES)?)
            }
            ClockSource::Wall | ClockSource::Topic => None,
        };
        let pictures = match (settings.reliable_pictures, settings.clock) {
            (true, _) | (_, ClockSource::LockStep) => Delivery::Reliable { depth: 16 },
            (false, _) => Delivery::BestEffort { depth: 4 },
        };
        let mut cameras = Vec::new();
        for camera in &model.settings.camera {
            let topic = |pattern: &str| Ros2Settings::of_camera(pattern, &camera.name);
            let has_pose = !settings.camera_pose.is_empty();
            cameras.push(CameraSpeakers {
                name: camera.name.clone(),
                color: link.speak(&topic(&settings.color), pictures)?,
                depth: link.speak(&topic(&settings.depth), pictures)?,
                info: link.speak(&format!("{}/camera_info", topic(&settings.color)), STATES)?,
                pose: if has_pose { Some(link.speak(&topic(&settings.camera_pose), STATES)?) } else { None },
            });
        }
        let sees = !settings.detections.is_empty();
        let detections = if sees { Some(link.speak(&settings.detections, STATES)?) } else { None };
        Ok(Self {
            joints: link.speak(&settings.joint_states, STATES)?,
            odometry: link.speak(&settings.odometry, STATES)?,
            localisation: link.speak(&settings.localisation, STATES)?,
            transforms: link.speak("/tf", STATES)?,
            clock: link.speak("/clock", STATES)?,
            stop: link.speak(&settings.emergency_stop, Delivery::Kept)?,
            advanced,
            cameras,
            detections,
            link: link.start()?,
            settings,
            model,
            said_stop: None,
        })
    }

    /// Serves the robot in lock step: time passes as far as it is asked to. Goes on until `is_over`.
    ///
    /// # Errors
    /// [`ServeError`]: the robot is lost, or nothing can be published.
    pub fn serve_steps(
        &mut self,
        robot: &mut dyn Robot,
        detector: &mut dyn Detector,
        is_over: &mut dyn FnMut(Stamp) -> bool,
    ) -> Result<(), ServeError> {
        let mut asked: Option<Step> = None;
        while !is_over(robot.clock().now()) {
            match self.link.wait(LOOK) {
                Some(Command::Advance(step)) => asked = Some(step),
                Some(command) => self.carry_out(robot, command)?,
                None => {}
            }
            if asked.as_ref().is_some_and(|step| step.number == 0) {
                self.begin_steps();
            }
            if let Some(step) = asked.take_if(|step| is_all_here(&self.link, step)) {
                if step.number > 0 {
                    robot.clock().wait_until(step.until.into())?;
                }
                self.tell(robot, detector)?;
                self.answer(robot.clock().now(), step.number)?;
            }
        }
        Ok(())
    }

    /// Serves the robot while its own clock runs: `period` by `period`. Goes on until `is_over`, which is asked in every
    /// period and may wait for real time.
    ///
    /// # Errors
    /// [`ServeError`]: the robot is lost, or nothing can be published.
    pub fn serve_freely(
        &mut self,
        robot: &mut dyn Robot,
        detector: &mut dyn Detector,
        period: Span,
        is_over: &mut dyn FnMut(Stamp) -> bool,
    ) -> Result<(), ServeError> {
        while !is_over(robot.clock().now()) {
            while let Some(command) = self.link.find() {
                self.carry_out(robot, command)?;
            }
            let next = robot.clock().now() + period;
            robot.clock().wait_until(next)?;
            self.tell(robot, detector)?;
        }
        Ok(())
    }

    /// Passes a command on. What the robot refuses, it refuses: the graph hears it by `emergency_stop` and in the log.
    fn carry_out(&mut self, robot: &mut dyn Robot, command: Command) -> Result<(), ServeError> {
        let done = match command {
            Command::Base(said) => {
                let RosTwist { linear, angular } = said.twist;
                robot.base().command(Twist { forward_m_per_s: linear.x, turn_rad_per_s: angular.z }).map(drop)
            }
            Command::Arm(said) => {
                let names = &self.model.arm.joints;
                command_group(robot.arm(), names, JointVelocities::from_values(names, said.data))
            }
            Command::Head(said) => {
                let names = &self.model.head.joints;
                command_group(robot.head(), names, JointVelocities::from_values(names, said.data))
            }
            Command::ArmTrajectory(said) => {
                let names = &self.model.arm.joints;
                command_group(robot.arm(), names, velocities_of(names, &said))
            }
            Command::HeadTrajectory(said) => {
                let names = &self.model.head.joints;
                command_group(robot.head(), names, velocities_of(names, &said))
            }
            Command::Gripper(said) => robot.gripper().command(said.position, said.max_effort).map(drop),
            Command::Stop(why) if why.data.is_empty() => robot.emergency_stop().reset(),
            Command::Stop(why) => robot.emergency_stop().trigger(&why.data),
            Command::Advance(_) => Ok(()),
        };
        match done {
            Err(error @ DriverError::Lost { .. }) => return Err(error.into()),
            Err(error) => tracing::warn!("a command is refused: {error}"),
            Ok(()) => {}
        }
        Ok(())
    }

    /// Says how the robot is and what it sees.
    fn tell(&mut self, robot: &mut dyn Robot, detector: &mut dyn Detector) -> Result<(), ServeError> {
        let now = robot.clock().now();
        let joints = self.joint_states(robot)?;
        self.joints.say(joints).map_err(ServeError::Graph)?;
        self.tell_poses(robot)?;
        for index in 0..self.cameras.len() {
            if let Some(frame) = robot.cameras().read(&self.cameras[index].name)? {
                self.show(index, &frame, detector)?;
            }
        }
        let reason = robot.emergency_stop().find_reason();
        if reason != self.said_stop {
            self.stop.say(Text { data: reason.clone().unwrap_or_default() }).map_err(ServeError::Graph)?;
            self.said_stop = reason;
        }
        self.clock.say(Clock { clock: now.into() }).map_err(ServeError::Graph)
    }

    fn joint_states(&self, robot: &mut dyn Robot) -> Result<JointState, DriverError> {
        let (arm, head, gripper) = (robot.arm().state()?, robot.head().state()?, robot.gripper().state()?);
        let mut said = JointState { header: Header::new(arm.stamp, ""), ..JointState::default() };
        for state in [&arm, &head] {
            said.name.extend(state.positions.names().iter().map(|name| name.to_string()));
            said.position.extend(state.positions.values());
            said.velocity.extend(state.velocities.values());
        }
        said.effort = vec![f64::NAN; said.name.len()];
        let fingers = &self.model.settings.gripper.joints;
        // Only whether they move is known here.
        let speed = if gripper.moving { 1.0 } else { 0.0 };
        for finger in fingers {
            said.name.push(finger.clone());
            said.position.push(gripper.width_m / fingers.len() as f64);
            said.velocity.push(speed);
            said.effort.push(gripper.force_n);
        }
        Ok(said)
    }

    fn tell_poses(&mut self, robot: &mut dyn Robot) -> Result<(), ServeError> {
        let base_frame = self.model.settings.base.link.clone();
        let (odom, believed) = (robot.localisation().odom_from_base()?, robot.localisation().world_from_base()?);
        let velocity = robot.base().velocity()?;
        let twist = RosTwist {
            linear: Vector3 { x: velocity.forward_m_per_s, ..Vector3::default() },
            angular: Vector3 { z: velocity.turn_rad_per_s, ..Vector3::default() },
        };
        let said = Odometry {
            header: Header::new(odom.stamp, ODOM_FRAME),
            child_frame_id: base_frame.clone(),
            pose: PoseWithCovariance { pose: (&odom.pose).into(), ..PoseWithCovariance::default() },
            twist: TwistWithCovariance { twist, ..TwistWithCovariance::default() },
        };
        self.odometry.say(said).map_err(ServeError::Graph)?;
        let pose = PoseWithCovariance { pose: (&believed.pose).into(), ..PoseWithCovariance::default() };
        let header = Header::new(believed.stamp, MAP_FRAME);
        self.localisation.say(PoseWithCovarianceStamped { header, pose }).map_err(ServeError::Graph)?;
        let transform = |stamp: Stamp, parent: &str, child: &str, pose: &dsm::Pose| TransformStamped {
            header: Header::new(stamp, parent),
            child_frame_id: child.to_owned(),
            transform: pose.into(),
        };
        let map_from_odom = believed.pose * odom.pose.inverse();
        let transforms = vec![
            transform(believed.stamp, MAP_FRAME, ODOM_FRAME, &map_from_odom),
            transform(odom.stamp, ODOM_FRAME, &base_frame, &odom.pose),
        ];
        self.transforms.say(TFMessage { transforms }).map_err(ServeError::Graph)
    }

    /// Publishes a frame, and what the detector finds in it.
    fn show(&mut self, index: usize, frame: &RgbdFrame, detector: &mut dyn Detector) -> Result<(), ServeError> {
        let speakers = &mut self.cameras[index];
        let header = Header::new(frame.stamp, &speakers.name);
        let (width, height) = (frame.model.width, frame.model.height);
        let image = |encoding: &str, bytes: u32, data: Vec<u8>| Image {
            header: header.clone(),
            height,
            width,
            encoding: encoding.to_owned(),
            is_bigendian: 0,
            step: width * bytes,
            data,
        };
        let color = frame.color.as_flattened().to_vec();
        speakers.color.say(image("rgb8", 3, color)).map_err(ServeError::Graph)?;
        speakers.depth.say(depth_image(frame, &image)).map_err(ServeError::Graph)?;
        speakers.info.say(camera_info(frame, header.clone())).map_err(ServeError::Graph)?;
        if let Some(speaker) = &mut speakers.pose {
            let header = Header::new(frame.stamp, MAP_FRAME);
            let pose = PoseStamped { header, pose: (&frame.world_from_camera).into() };
            speaker.say(pose).map_err(ServeError::Graph)?;
        }
        if let Some(speaker) = &mut self.detections {
            let found = detector.detect(frame);
            let detections = found.items.into_iter().map(|item| {
                let runs = item.mask.runs.iter().map(|run| PixelRun { start: run.start, length: run.length });
                MaskedDetection { name: item.name, score: item.score, runs: runs.collect() }
            });
            let detections = detections.collect();
            let said = MaskedDetections { header, detector: detector.name().to_owned(), width, detections };
            speaker.say(said).map_err(ServeError::Graph)?;
        }
        Ok(())
    }

    /// Both sides count from here.
    fn begin_steps(&mut self) {
        self.link.forget_taken();
        self.joints.forget_sent();
        self.odometry.forget_sent();
        self.localisation.forget_sent();
        self.detections.iter_mut().for_each(Speaker::forget_sent);
        for camera in &mut self.cameras {
            camera.color.forget_sent();
            camera.depth.forget_sent();
            camera.pose.iter_mut().for_each(Speaker::forget_sent);
        }
    }

    /// Says that a step is done, and how many messages belong to it.
    fn answer(&mut self, now: Stamp, number: u64) -> Result<(), ServeError> {
        let mut sent = vec![
            (self.joints.topic(), self.joints.sent()),
            (self.odometry.topic(), self.odometry.sent()),
            (self.localisation.topic(), self.localisation.sent()),
        ];
        for camera in &self.cameras {
            sent.push((camera.color.topic(), camera.color.sent()));
            sent.push((camera.depth.topic(), camera.depth.sent()));
            sent.extend(camera.pose.as_ref().map(|speaker| (speaker.topic(), speaker.sent())));
        }
        sent.extend(self.detections.as_ref().map(|speaker| (speaker.topic(), speaker.sent())));
        let (topics, counts) = sent.into_iter().map(|(topic, count)| (topic.to_owned(), count)).unzip();
        match &mut self.advanced {
            Some(speaker) => speaker.say(Step { until: now.into(), number, topics, counts }).map_err(ServeError::Graph),
            None => Ok(()),
        }
    }

    /// The names in use.
    pub fn settings(&self) -> &Ros2Settings {
        &self.settings
    }
}

/// Commands a group; velocities of other joints are refused.
fn command_group(
    part: &mut dyn JointGroup,
    names: &JointNames,
    velocities: Option<JointVelocities>,
) -> Result<(), DriverError> {
    let expected = || names.iter().map(|name| name.to_string()).collect();
    let velocities = velocities.ok_or_else(|| DriverError::WrongJoints { expected: expected(), got: Vec::new() })?;
    part.command(&velocities).map(drop)
}

fn is_all_here(link: &Link<Command>, step: &Step) -> bool {
    let has_come = |(topic, count): (&String, &u64)| link.find_taken(topic).is_none_or(|taken| taken >= *count);
    step.topics.iter().zip(&step.counts).all(has_come)
}

/// The velocities of a trajectory's first point, in the order of the group.
fn velocities_of(names: &JointNames, said: &JointTrajectory) -> Option<JointVelocities> {
    let point = said.points.first()?;
    let value = |name: &str| {
        let index = said.joint_names.iter().position(|known| known == name)?;
        point.velocities.get(index).copied()
    };
    JointVelocities::from_values(names, names.iter().map(|name| value(name)).collect::<Option<Vec<f64>>>()?)
}

/// Depth in whole millimetres; in metres when that would lose something.
fn depth_image(frame: &RgbdFrame, image: &dyn Fn(&str, u32, Vec<u8>) -> Image) -> Image {
    let mut data = Vec::with_capacity(2 * frame.depth_m.len());
    for depth_m in &frame.depth_m {
        let millimetres = (depth_m * 1000.0).round().clamp(0.0, f32::from(u16::MAX)) as u16;
        if f32::from(millimetres) / 1000.0 != *depth_m {
            return image("32FC1", 4, frame.depth_m.iter().flat_map(|depth_m| depth_m.to_le_bytes()).collect());
        }
        data.extend(millimetres.to_le_bytes());
    }
    image("16UC1", 2, data)
}

fn camera_info(frame: &RgbdFrame, header: Header) -> CameraInfo {
    let model = &frame.model;
    // ROS counts pixels from the middle of the first.
    let (fx, fy, cx, cy) = (model.fx, model.fy, model.cx - 0.5, model.cy - 0.5);
    CameraInfo {
        header,
        height: model.height,
        width: model.width,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}
