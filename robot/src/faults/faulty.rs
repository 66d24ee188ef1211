//! A robot that breaks by schedule.

use super::senses::{FrameTrouble, Frames, Kept, Repeats};
use super::{Fault, FaultKind, FaultPart};
use crate::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, StampedPose, Twist,
};
use crate::joints::{JointNames, JointPositions, JointVelocities};
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::time::{Span, Stamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Stream of faults among all that a seed draws.
const STREAM: u64 = 0x66_6175_6c74;
const DEAD: &str = "the world is dead";
/// What a jump of measured joints adds, radians or metres.
const JOINT_JUMP: f64 = 1.0;

/// A robot with faults.
pub struct Faulty<R: Robot> {
    parts: Arm<R>,
}

/// The arm's view of the core; see [`crate::safety::Envelope`].
struct Arm<R: Robot>(Head<R>);

/// The head's view of the core.
struct Head<R: Robot>(Core<R>);

struct Core<R: Robot> {
    robot: R,
    faults: Vec<Fault>,
    seed: u64,
    arm: Kept<JointState>,
    head: Kept<JointState>,
    place: Kept<StampedPose>,
    odom: Kept<StampedPose>,
    frames: Frames,
    camera_names: Vec<String>,
    /// The present as the robot has it.
    now: Stamp,
    pressed: Option<String>,
}

impl<R: Robot> Faulty<R> {
    /// Breaks `robot` as scheduled; `seed` draws what the schedule leaves open.
    pub fn new(mut robot: R, faults: Vec<Fault>, seed: u64) -> Self {
        let camera_names = robot.cameras().names();
        let now = robot.clock().now();
        let core = Core {
            robot,
            faults,
            seed,
            arm: Kept::default(),
            head: Kept::default(),
            place: Kept::default(),
            odom: Kept::default(),
            frames: Frames::default(),
            camera_names,
            now,
            pressed: None,
        };
        Self { parts: Arm(Head(core)) }
    }

    /// The robot inside.
    pub fn inner(&self) -> &R {
        &self.parts.0.0.robot
    }

    /// The robot inside.
    pub fn inner_mut(&mut self) -> &mut R {
        &mut self.core_mut().robot
    }

    /// Schedules one more fault.
    pub fn add(&mut self, fault: Fault) {
        self.core_mut().faults.push(fault);
    }

    /// Mends everything that is broken.
    pub fn clear(&mut self) {
        self.core_mut().faults.clear();
    }

    fn core_mut(&mut self) -> &mut Core<R> {
        &mut self.parts.0.0
    }
}

impl<R: Robot> Core<R> {
    /// The fault of a kind, and for a part when the kind is about one, that lasts now.
    fn find(&self, kind: FaultKind, part: Option<FaultPart>) -> Option<&Fault> {
        let now_s = self.now.as_s();
        self.faults.iter().find(|f| f.kind == kind && f.part == part && f.is_active(now_s))
    }

    fn repeats(&self, kind: FaultKind, part: Option<FaultPart>) -> Repeats {
        if self.find(kind, part).is_some() { Repeats::Yes } else { Repeats::No }
    }

    /// What the clock is off by.
    fn offset(&self) -> Span {
        Span::from_s(self.find(FaultKind::ClockJump, None).map_or(0.0, |fault| fault.by_s))
    }

    /// Nothing comes from a part that is lost.
    fn reach(&self, part: FaultPart) -> Result<(), DriverError> {
        let reason = if self.find(FaultKind::WorldKilled, None).is_some() {
            DEAD
        } else if self.find(FaultKind::PartLost, Some(part)).is_some() {
            "the connection is lost"
        } else {
            return Ok(());
        };
        Err(DriverError::Lost { part: format!("{part:?}").to_lowercase(), reason: reason.into() })
    }

    /// A number that the seed draws for a fault.
    fn draw(&self, fault: &Fault, below: usize) -> usize {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(STREAM ^ (fault.at_s * 1e3) as u64);
        rng.random_range(0..below.max(1))
    }

    fn joints(&mut self, part: FaultPart) -> Result<JointState, DriverError> {
        self.reach(part)?;
        let group: &mut dyn JointGroup = if part == FaultPart::Arm { self.robot.arm() } else { self.robot.head() };
        let mut state = group.state()?;
        let count = state.positions.values().len();
        if let Some(fault) = self.find(FaultKind::JointsNan, Some(part)) {
            let joint = self.draw(fault, count);
            state.positions.values_mut()[joint] = f64::NAN;
        }
        if let Some(fault) = self.find(FaultKind::JointsSwapped, Some(part)) {
            let first = self.draw(fault, count - 1);
            state = swapped(&state, first);
        }
        if let Some(fault) = self.find(FaultKind::JointsJump, Some(part)) {
            let joint = self.draw(fault, count);
            state.positions.values_mut()[joint] += JOINT_JUMP;
        }
        state.stamp = state.stamp + self.offset();
        let stuck = self.repeats(FaultKind::SensorStuck, Some(part));
        let frozen = self.repeats(FaultKind::SensorFrozen, Some(part));
        let kept = if part == FaultPart::Arm { &mut self.arm } else { &mut self.head };
        let stamp = state.stamp;
        let mut state = kept.pass(state, if stuck == Repeats::Yes { stuck } else { frozen });
        if stuck == Repeats::Yes {
            state.stamp = stamp;
        }
        Ok(state)
    }

    fn pose(
        &mut self,
        read: impl FnOnce(&mut R) -> Result<StampedPose, DriverError>,
    ) -> Result<StampedPose, DriverError> {
        self.reach(FaultPart::Localisation)?;
        let mut place = read(&mut self.robot)?;
        place.stamp = place.stamp + self.offset();
        Ok(place)
    }

    /// A pose as a localiser that is frozen or stuck gives it.
    fn kept(&mut self, place: StampedPose, which: fn(&mut Self) -> &mut Kept<StampedPose>) -> StampedPose {
        let part = Some(FaultPart::Localisation);
        let stuck = self.repeats(FaultKind::SensorStuck, part);
        let frozen = self.repeats(FaultKind::SensorFrozen, part);
        let kept = which(self).pass(place, if stuck == Repeats::Yes { stuck } else { frozen });
        if stuck == Repeats::Yes { StampedPose { stamp: place.stamp, ..kept } } else { kept }
    }
}

/// The state with two joints in each other's place.
fn swapped(state: &JointState, first: usize) -> JointState {
    let mut names: Vec<Arc<str>> = state.positions.names().to_vec();
    names.swap(first, first + 1);
    let names: JointNames = names.into();
    let mut positions = JointPositions::zeros(&names);
    let mut velocities = JointVelocities::zeros(&names);
    positions.values_mut().copy_from_slice(state.positions.values());
    velocities.values_mut().copy_from_slice(state.velocities.values());
    positions.values_mut().swap(first, first + 1);
    velocities.values_mut().swap(first, first + 1);
    JointState { stamp: state.stamp, positions, velocities }
}

impl<R: Robot> Base for Core<R> {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.reach(FaultPart::Base)?;
        self.robot.base().command(twist)
    }
    fn velocity(&mut self) -> Result<Twist, DriverError> {
        self.reach(FaultPart::Base)?;
        self.robot.base().velocity()
    }
}

impl<R: Robot> JointGroup for Arm<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.0.reach(FaultPart::Arm)?;
        self.0.0.robot.arm().command(velocities)
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.0.joints(FaultPart::Arm)
    }
}

impl<R: Robot> JointGroup for Head<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.reach(FaultPart::Head)?;
        self.0.robot.head().command(velocities)
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.joints(FaultPart::Head)
    }
}

impl<R: Robot> Gripper for Core<R> {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.reach(FaultPart::Gripper)?;
        self.robot.gripper().command(width_m, max_force_n)
    }
    fn state(&mut self) -> Result<GripperState, DriverError> {
        self.reach(FaultPart::Gripper)?;
        let offset = self.offset();
        let state = self.robot.gripper().state()?;
        Ok(GripperState { stamp: state.stamp + offset, ..state })
    }
}

impl<R: Robot> Cameras for Core<R> {
    fn names(&self) -> Vec<String> {
        self.camera_names.clone()
    }
    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        self.reach(FaultPart::Camera)?;
        let (now, offset) = (self.now, self.offset());
        let mut fresh = self.robot.cameras().read(camera)?;
        if let (Some(frame), Some(fault)) = (&fresh, self.find(FaultKind::FramesLost, None)) {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
            rng.set_stream(STREAM ^ frame.id.0);
            if rng.random::<f64>() < fault.share {
                fresh = None;
            }
        }
        let trouble = FrameTrouble {
            frozen: self.repeats(FaultKind::SensorFrozen, Some(FaultPart::Camera)),
            twice: self.repeats(FaultKind::FramesDuplicated, None),
            late: self.find(FaultKind::FramesLate, None).map_or(Span(0), |fault| Span::from_s(fault.by_s)),
        };
        let frame = self.frames.pass(camera, now, fresh, trouble);
        Ok(frame.map(|frame| RgbdFrame { stamp: frame.stamp + offset, ..frame }))
    }
}

impl<R: Robot> Localisation for Core<R> {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        let mut place = self.pose(|robot| robot.localisation().world_from_base())?;
        if let Some(fault) = self.find(FaultKind::LocalisationJump, None) {
            place.pose = Pose::translation(fault.by_m, 0.0, 0.0) * place.pose;
        }
        Ok(self.kept(place, |core| &mut core.place))
    }
    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        let place = self.pose(|robot| robot.localisation().odom_from_base())?;
        Ok(self.kept(place, |core| &mut core.odom))
    }
}

impl<R: Robot> Clock for Core<R> {
    fn now(&self) -> Stamp {
        self.now + self.offset()
    }
    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        if self.find(FaultKind::WorldKilled, None).is_some() {
            return Err(DriverError::Lost { part: "clock".into(), reason: DEAD.into() });
        }
        let until = Stamp(stamp.0 - self.offset().0);
        self.robot.clock().wait_until(until)?;
        self.now = self.robot.clock().now();
        if self.pressed.is_none() && self.find(FaultKind::Estop, None).is_some() {
            let reason = "the stop button is pressed";
            self.pressed = Some(reason.into());
            self.robot.emergency_stop().trigger(reason)?;
        }
        Ok(())
    }
}

impl<R: Robot> EmergencyStop for Core<R> {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        if self.find(FaultKind::WorldKilled, None).is_some() {
            return Err(DriverError::Lost { part: "emergency stop".into(), reason: DEAD.into() });
        }
        self.pressed.get_or_insert_with(|| reason.to_owned());
        self.robot.emergency_stop().trigger(reason)
    }
    fn find_reason(&self) -> Option<String> {
        self.pressed.clone()
    }
    /// The button pops out; while its fault lasts somebody presses it again.
    fn reset(&mut self) -> Result<(), DriverError> {
        self.pressed = None;
        self.robot.emergency_stop().reset()
    }
}

impl<R: Robot> Robot for Faulty<R> {
    fn base(&mut self) -> &mut dyn Base {
        self.core_mut()
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        &mut self.parts
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        self.core_mut()
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        &mut self.parts.0
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        self.core_mut()
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        self.core_mut()
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self.core_mut()
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        self.core_mut()
    }
}
