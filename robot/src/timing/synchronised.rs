//! A robot whose frames get the pose of their own moment, however late frames and states are heard of.

use super::buffer::{At, BufferLimits, TimedBuffer};
use super::reorder::{Flow, Reorder};
use crate::drivers::{Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, JointGroup, Localisation, Robot};
use crate::joints::JointPositions;
use crate::model::RobotModel;
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::time::{Span, Stamp};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A frame whose pose cannot be told for so long is dropped.
const PATIENCE: Span = Span(500_000_000);
/// Frames of a camera that may wait for their pose.
const WAITING: usize = 8;

/// What became of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SynchronisedReport {
    /// Frames that were handed on with a pose measured or interpolated.
    pub posed: u64,
    /// Frames that were handed on with an extrapolated pose.
    pub extrapolated: u64,
    /// Frames that were dropped, for nobody knows where they were taken.
    pub unposed: u64,
    /// What came in.
    pub flow: Flow,
}

/// Wraps a robot whose localisation, joints or cameras are heard of late. The pose of each frame is made anew from states
/// interpolated at its stamp: `world_from_base * base_from_camera(joints)`. A frame waits until such states are known.
pub struct Synchronised<R: Robot> {
    robot: R,
    model: Arc<RobotModel>,
    now: Stamp,
    world_from_base: TimedBuffer<Pose>,
    arm: TimedBuffer<JointPositions>,
    head: TimedBuffer<JointPositions>,
    frames: BTreeMap<String, Reorder<RgbdFrame>>,
    report: SynchronisedReport,
}

impl<R: Robot> Synchronised<R> {
    /// Wraps `robot`, of which `model` is the model. Nothing is known before the first wait.
    pub fn new(mut robot: R, model: Arc<RobotModel>) -> Self {
        let limits = BufferLimits::default();
        Self {
            now: robot.clock().now(),
            robot,
            model,
            world_from_base: TimedBuffer::new(limits),
            arm: TimedBuffer::new(limits),
            head: TimedBuffer::new(limits),
            frames: BTreeMap::new(),
            report: SynchronisedReport::default(),
        }
    }

    /// What became of frames so far.
    pub fn report(&self) -> SynchronisedReport {
        let add = |sum: Flow, flow: Flow| Flow {
            given: sum.given + flow.given,
            late: sum.late + flow.late,
            repeated: sum.repeated + flow.repeated,
            crowded_out: sum.crowded_out + flow.crowded_out,
        };
        let flow = self.frames.values().map(Reorder::flow).fold(Flow::default(), add);
        SynchronisedReport { flow, ..self.report }
    }

    /// Notes the newest states by their own stamps.
    fn note_states(&mut self) -> Result<(), DriverError> {
        let base = self.robot.localisation().world_from_base()?;
        self.world_from_base.insert(base.stamp, base.pose);
        let arm = self.robot.arm().state()?;
        self.arm.insert(arm.stamp, arm.positions);
        let head = self.robot.head().state()?;
        self.head.insert(head.stamp, head.positions);
        Ok(())
    }

    /// Where a camera was, as an outcome of the state that is known least.
    fn world_from_camera(&self, camera: &str, stamp: Stamp) -> At<Pose> {
        let Some((_, link)) = self.model.find_camera(camera) else { return At::Empty };
        let (base, arm, head) = (self.world_from_base.at(stamp), self.arm.at(stamp), self.head.at(stamp));
        let mut beyond = None;
        for outcome in [base.clone().map(drop), arm.clone().map(drop), head.clone().map(drop)] {
            match outcome {
                At::Measured(()) | At::Interpolated { .. } => {}
                At::Extrapolated { beyond: by, .. } => beyond = beyond.max(Some(by)),
                At::NotYet { newest } => return At::NotYet { newest },
                At::Forgotten { oldest } => return At::Forgotten { oldest },
                At::InGap { before, after } => return At::InGap { before, after },
                At::Empty => return At::Empty,
            }
        }
        let (Some(base), Some(arm), Some(head)) = (base.find(), arm.find(), head.find()) else { return At::Empty };
        let mut configuration = self.model.kinematics.zero();
        configuration.apply(&arm);
        configuration.apply(&head);
        let value = base * self.model.kinematics.root_from_link(&configuration, link);
        match beyond {
            Some(beyond) => At::Extrapolated { value, beyond },
            None => At::Measured(value),
        }
    }
}

impl<R: Robot> Cameras for Synchronised<R> {
    fn names(&self) -> Vec<String> {
        self.model.settings.camera.iter().map(|camera| camera.name.clone()).collect()
    }

    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        let now = self.now;
        let mut new = Vec::new();
        while let Some(frame) = self.robot.cameras().read(camera)? {
            new.push(frame);
        }
        let waiting = self.frames.entry(camera.to_owned()).or_insert_with(|| Reorder::new(Span(0), WAITING));
        for frame in new {
            waiting.put(frame.stamp, frame);
        }
        while let Some(stamp) = self.frames.get(camera).and_then(|waiting| waiting.find_ready(now)) {
            let pose = self.world_from_camera(camera, stamp);
            let is_patient = now - stamp <= PATIENCE;
            if is_patient && matches!(pose, At::NotYet { .. } | At::Empty) {
                return Ok(None);
            }
            match pose {
                At::Extrapolated { .. } => self.report.extrapolated += 1,
                At::Measured(_) | At::Interpolated { .. } => self.report.posed += 1,
                _ => self.report.unposed += 1,
            }
            let taken = self.frames.get_mut(camera).and_then(|waiting| waiting.take_ready(now));
            if let (Some((_, frame)), Some(world_from_camera)) = (taken, pose.find()) {
                return Ok(Some(RgbdFrame { world_from_camera, ..frame }));
            }
        }
        Ok(None)
    }
}

impl<R: Robot> Clock for Synchronised<R> {
    fn now(&self) -> Stamp {
        self.now
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        self.robot.clock().wait_until(stamp)?;
        self.now = self.robot.clock().now();
        self.note_states()
    }
}

impl<R: Robot> Robot for Synchronised<R> {
    fn base(&mut self) -> &mut dyn Base {
        self.robot.base()
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        self.robot.arm()
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        self.robot.gripper()
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        self.robot.head()
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        self
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        self.robot.localisation()
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        self.robot.emergency_stop()
    }
}
