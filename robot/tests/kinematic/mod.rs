//! A world without mechanics for tests and measurements: the robot does exactly what it is told, on an empty floor or
//! before a wall, and its drivers watch over themselves as the contract says.

#![allow(dead_code, reason = "each program that includes this module uses a part of it")]

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{
    Base, Cameras, Clock, DRIVER_TIMEOUT, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState,
    Localisation, Robot, StampedPose, Twist,
};
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::{Configuration, Group, RobotModel};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use std::path::Path;
use std::sync::Arc;

/// Frames are taken this often.
const FRAME_PERIOD: Span = Span(200_000_000);
/// Farther than this there is no return, metres.
const FARTHEST_M: f64 = 6.0;

/// The robot that ships with the program.
pub(crate) fn porter() -> Arc<RobotModel> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter");
    Arc::new(RobotModel::load(&folder).expect("porter loads"))
}

pub(crate) struct KinematicBase {
    pub(crate) moves: Twist,
    told: Twist,
    told_at: Stamp,
    now: Stamp,
    stopped: Option<String>,
    /// What the wheels do of what they are told: 1 when nothing is wrong.
    pub(crate) gain: [f64; 2],
    /// What the driver says was sent of what it was told.
    pub(crate) says: f64,
}

pub(crate) struct KinematicJoints {
    pub(crate) state: JointState,
    told: JointVelocities,
    told_at: Stamp,
    now: Stamp,
    stopped: Option<String>,
    pub(crate) gain: f64,
    limits: Vec<(f64, f64, f64)>,
}

pub(crate) struct KinematicGripper {
    pub(crate) told: (f64, f64),
    width_m: f64,
    most: (f64, f64),
    now: Stamp,
    stopped: Option<String>,
}

pub(crate) struct KinematicCameras {
    names: Vec<String>,
    pub(crate) size: (u32, u32),
    fov_rad: f64,
    base_from_cameras: Vec<Pose>,
    world_from_base: Pose,
    now: Stamp,
    taken: Vec<Stamp>,
    next_id: u64,
    pub(crate) wall_x_m: Option<f64>,
}

pub(crate) struct KinematicPlace {
    pub(crate) world_from_base: Pose,
    stamp: Stamp,
}

#[derive(Default)]
pub(crate) struct KinematicStop {
    reason: Option<String>,
}

/// What a faulty driver forgets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Forgets {
    #[default]
    Nothing,
    /// To stop when it hears nothing.
    Watchdog,
    /// To stop and to refuse after an emergency stop.
    Stop,
    /// To stamp what it measures.
    Stamps,
}

/// The world with its robot.
pub(crate) struct Kinematic {
    now: Stamp,
    pub(crate) base: KinematicBase,
    pub(crate) arm: KinematicJoints,
    pub(crate) head: KinematicJoints,
    pub(crate) gripper: KinematicGripper,
    pub(crate) cameras: KinematicCameras,
    pub(crate) place: KinematicPlace,
    stop: KinematicStop,
    pub(crate) forgets: Forgets,
    model: Arc<RobotModel>,
}

fn joints(group: &Group, posture: &Configuration) -> KinematicJoints {
    let velocities = JointVelocities::zeros(&group.joints);
    let positions = JointPositions::from_values(&group.joints, group.values_of(posture)).expect("lengths");
    KinematicJoints {
        state: JointState { stamp: Stamp(0), positions, velocities: velocities.clone() },
        told: velocities,
        told_at: Stamp(0),
        now: Stamp(0),
        stopped: None,
        gain: 1.0,
        limits: group.limits.iter().map(|limit| (limit.lower, limit.upper, limit.velocity)).collect(),
    }
}

fn camera_poses(model: &RobotModel, posture: &Configuration) -> Vec<Pose> {
    let links = model.settings.camera.iter().filter_map(|camera| model.find_camera(&camera.name));
    links.map(|(_, link)| model.kinematics.root_from_link(posture, link)).collect()
}

impl Kinematic {
    pub(crate) fn new(model: &Arc<RobotModel>) -> Self {
        let mut posture = model.kinematics.zero();
        posture.apply(&model.find_posture("carry").expect("carry"));
        let (camera, _) = model.find_camera("head").expect("a head camera");
        Self {
            now: Stamp(0),
            base: KinematicBase {
                moves: Twist::default(),
                told: Twist::default(),
                told_at: Stamp(0),
                now: Stamp(0),
                stopped: None,
                gain: [1.0; 2],
                says: 1.0,
            },
            arm: joints(&model.arm, &posture),
            head: joints(&model.head, &posture),
            gripper: KinematicGripper {
                told: (0.0, 0.0),
                width_m: 0.0,
                most: (model.settings.gripper.max_aperture_m, model.settings.gripper.max_force_n),
                now: Stamp(0),
                stopped: None,
            },
            cameras: KinematicCameras {
                names: model.settings.camera.iter().map(|camera| camera.name.clone()).collect(),
                size: (64, 48),
                fov_rad: camera.vertical_fov_rad,
                base_from_cameras: camera_poses(model, &posture),
                world_from_base: Pose::identity(),
                now: Stamp(0),
                taken: Vec::new(),
                next_id: 0,
                wall_x_m: None,
            },
            place: KinematicPlace { world_from_base: Pose::identity(), stamp: Stamp(0) },
            stop: KinematicStop::default(),
            forgets: Forgets::default(),
            model: model.clone(),
        }
    }

    /// The true time.
    pub(crate) fn now(&self) -> Stamp {
        self.now
    }

    /// The greatest share of its speed limit at which anything moves.
    pub(crate) fn is_still(&self) -> bool {
        let still = |joints: &KinematicJoints| joints.state.velocities.values().iter().all(|v| *v == 0.0);
        self.base.moves == Twist::default() && still(&self.arm) && still(&self.head)
    }

    /// Lets time pass for the world, whoever waits.
    pub(crate) fn pass(&mut self, span: Span) {
        let dt_s = span.as_s();
        self.now = self.now + span;
        let stopped = self.stop.reason.is_some() && self.forgets != Forgets::Stop;
        let now = self.now;
        let silent = |told_at: Stamp| now - told_at > DRIVER_TIMEOUT && self.forgets != Forgets::Watchdog;
        let base = &mut self.base;
        let told = if stopped || silent(base.told_at) { Twist::default() } else { base.told };
        base.moves = Twist {
            forward_m_per_s: base.gain[0] * told.forward_m_per_s,
            turn_rad_per_s: base.gain[1] * told.turn_rad_per_s,
        };
        base.now = now;
        let (v, w) = (base.moves.forward_m_per_s, base.moves.turn_rad_per_s);
        let yaw = w * dt_s;
        let chord_m = if yaw.abs() < 1e-9 { v * dt_s } else { 2.0 * (v / w) * (0.5 * yaw).sin() };
        let step = Vector3::new(chord_m * (0.5 * yaw).cos(), chord_m * (0.5 * yaw).sin(), 0.0);
        self.place.world_from_base *=
            Pose::from_parts(Translation3::from(step), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw));
        let stamps = self.forgets != Forgets::Stamps;
        if stamps {
            self.place.stamp = now;
        }
        for joints in [&mut self.arm, &mut self.head] {
            let still = stopped || silent(joints.told_at);
            for (k, limits) in joints.limits.iter().enumerate() {
                let told = if still { 0.0 } else { joints.gain * joints.told.values()[k] };
                let position = joints.state.positions.values()[k];
                // What is beyond a limit stays where it is.
                let next = (position + told * dt_s).clamp(limits.0.min(position), limits.1.max(position));
                joints.state.positions.values_mut()[k] = next;
                joints.state.velocities.values_mut()[k] = if next == position { 0.0 } else { told };
            }
            joints.now = now;
            if stamps {
                joints.state.stamp = now;
            }
        }
        let gripper = &mut self.gripper;
        let step_m = 0.1 * dt_s;
        gripper.width_m += (gripper.told.0 - gripper.width_m).clamp(-step_m, step_m);
        gripper.now = now;
        let mut posture = self.model.kinematics.zero();
        posture.apply(&self.head.state.positions);
        posture.apply(&self.arm.state.positions);
        let cameras = &mut self.cameras;
        cameras.base_from_cameras = camera_poses(&self.model, &posture);
        (cameras.now, cameras.world_from_base) = (now, self.place.world_from_base);
    }
}

fn refuse_when(stopped: &Option<String>) -> Result<(), DriverError> {
    stopped.clone().map_or(Ok(()), |reason| Err(DriverError::Stopped { reason }))
}

fn finite(value: f64, what: &str) -> Result<f64, DriverError> {
    if value.is_finite() { Ok(value) } else { Err(DriverError::NotFinite { what: what.into() }) }
}

impl Base for KinematicBase {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        refuse_when(&self.stopped)?;
        finite(twist.forward_m_per_s + twist.turn_rad_per_s, "the base's velocity")?;
        self.told = Twist {
            forward_m_per_s: twist.forward_m_per_s.clamp(-0.7, 0.7),
            turn_rad_per_s: twist.turn_rad_per_s.clamp(-1.5, 1.5),
        };
        self.told_at = self.now;
        Ok(Twist {
            forward_m_per_s: self.says * self.told.forward_m_per_s,
            turn_rad_per_s: self.says * self.told.turn_rad_per_s,
        })
    }
    fn velocity(&mut self) -> Result<Twist, DriverError> {
        Ok(self.moves)
    }
}

impl JointGroup for KinematicJoints {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        refuse_when(&self.stopped)?;
        if velocities.names() != self.told.names() {
            let list = |v: &JointVelocities| v.names().iter().map(|n| n.to_string()).collect();
            return Err(DriverError::WrongJoints { expected: list(&self.told), got: list(velocities) });
        }
        for (name, value) in velocities.iter() {
            finite(value, name)?;
        }
        self.told = velocities.clone();
        for (value, limits) in self.told.values_mut().iter_mut().zip(&self.limits) {
            *value = value.clamp(-limits.2, limits.2);
        }
        self.told_at = self.now;
        Ok(self.told.clone())
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        Ok(self.state.clone())
    }
}

impl Gripper for KinematicGripper {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        refuse_when(&self.stopped)?;
        finite(width_m + max_force_n, "the gripper's command")?;
        self.told = (width_m.clamp(0.0, self.most.0), max_force_n.clamp(0.0, self.most.1));
        Ok(self.told)
    }
    fn state(&mut self) -> Result<GripperState, DriverError> {
        let moving = self.width_m != self.told.0;
        Ok(GripperState { stamp: self.now, width_m: self.width_m, force_n: 0.0, moving })
    }
}

impl Cameras for KinematicCameras {
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }
    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        let Some(index) = self.names.iter().position(|name| name == camera) else {
            return Err(DriverError::NoCamera { name: camera.into(), known: self.names() });
        };
        self.taken.resize(self.names.len(), Stamp(-FRAME_PERIOD.0));
        let stamp = Stamp(self.now.0 / FRAME_PERIOD.0 * FRAME_PERIOD.0);
        if stamp <= self.taken[index] {
            return Ok(None);
        }
        self.taken[index] = stamp;
        self.next_id += 1;
        let model = CameraModel::from_vertical_fov(self.size.0, self.size.1, self.fov_rad);
        let world_from_camera = self.world_from_base * self.base_from_cameras[index];
        Ok(Some(RgbdFrame {
            id: FrameId(self.next_id),
            stamp,
            camera: camera.into(),
            model,
            world_from_camera,
            color: vec![[0; 3]; model.pixel_count()],
            depth_m: self.depth(&model, &world_from_camera),
        }))
    }
}

impl KinematicCameras {
    /// The wall and the floor before it.
    fn depth(&self, model: &CameraModel, world_from_camera: &Pose) -> Vec<f32> {
        let Some(wall_x_m) = self.wall_x_m else { return vec![0.0; model.pixel_count()] };
        let eye = world_from_camera.translation.vector;
        let pixels = (0..model.height).flat_map(|row| (0..model.width).map(move |column| (column, row)));
        let depth = |(column, row)| {
            let ray: Point3<f64> = model.back_project(column, row, 1.0);
            let ray = world_from_camera.rotation * ray.coords;
            let to = |way: f64, along: f64| if way * along > 0.0 { way / along } else { f64::INFINITY };
            let depth = to(wall_x_m - eye.x, ray.x).min(to(-eye.z, ray.z));
            if depth < FARTHEST_M { depth as f32 } else { 0.0 }
        };
        pixels.map(depth).collect()
    }
}

impl Localisation for KinematicPlace {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        Ok(StampedPose { stamp: self.stamp, pose: self.world_from_base })
    }
    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.world_from_base()
    }
}

impl EmergencyStop for KinematicStop {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        self.reason.get_or_insert_with(|| reason.to_owned());
        Ok(())
    }
    fn find_reason(&self) -> Option<String> {
        self.reason.clone()
    }
    fn reset(&mut self) -> Result<(), DriverError> {
        self.reason = None;
        Ok(())
    }
}

impl Clock for Kinematic {
    fn now(&self) -> Stamp {
        self.now
    }
    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        // In steps, so that watchdogs act in time.
        while self.now < stamp {
            let step = Span((stamp - self.now).0.min(10_000_000));
            self.pass(step);
        }
        Ok(())
    }
}

impl Robot for Kinematic {
    fn base(&mut self) -> &mut dyn Base {
        self.base.stopped = self.find_stop();
        &mut self.base
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        self.arm.stopped = self.find_stop();
        &mut self.arm
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        self.gripper.stopped = self.find_stop();
        &mut self.gripper
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        self.head.stopped = self.find_stop();
        &mut self.head
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        &mut self.cameras
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        &mut self.place
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        &mut self.stop
    }
}

impl Kinematic {
    fn find_stop(&self) -> Option<String> {
        if self.forgets == Forgets::Stop { None } else { self.stop.reason.clone() }
    }
}
