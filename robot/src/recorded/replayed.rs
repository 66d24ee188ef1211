//! A robot that answers from a recording.

use super::period::{Exchange, JointTalk, JointValues, Period, SameBits, StopCommand};
use crate::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, StampedPose, Twist,
};
use crate::joints::{JointNames, JointVelocities};
use crate::model::RobotModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::Stamp;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::mpsc::Sender;

/// Gives what was recorded, in order.
pub trait PeriodSource: Send {
    /// The next period; `None` when the recording ends.
    ///
    /// # Errors
    /// Why the rest cannot be read.
    fn next_period(&mut self) -> Result<Option<Period>, String>;

    /// The frame of that number, once; it was read in the period that was given last.
    fn take_frame(&mut self, id: FrameId) -> Option<RgbdFrame>;
}

/// Where a replay first differs from its recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The part that was asked.
    pub part: &'static str,
    /// When.
    pub stamp: Stamp,
    /// What the recording holds.
    pub expected: String,
    /// What was asked now.
    pub got: String,
}

/// Why a replay goes no further.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReplayEnd {
    /// It differs.
    Differs(Difference),
    /// The recording ends here.
    Over(Stamp),
    /// The rest of the recording cannot be read.
    Unreadable {
        /// From when on.
        stamp: Stamp,
        /// Why.
        reason: String,
    },
}

/// Plays a recording. Whoever commands it must do so as then; see the module.
pub struct Replayed {
    parts: Arm,
}

/// The arm's view of the core.
struct Arm(Head);

/// The head's view of the core.
struct Head(Core);

/// How often each question was asked in this period.
#[derive(Default)]
struct Asked {
    base: usize,
    base_velocity: u32,
    arm: usize,
    arm_state: u32,
    head: usize,
    head_state: u32,
    gripper: usize,
    gripper_state: u32,
    world_from_base: u32,
    odom_from_base: u32,
    frames: BTreeMap<String, usize>,
    stop_reason: u32,
    stop: usize,
}

struct Core {
    source: Box<dyn PeriodSource>,
    ends: Sender<ReplayEnd>,
    arm_joints: JointNames,
    head_joints: JointNames,
    camera_names: Vec<String>,
    period: Period,
    asked: Asked,
    stop_reason: Option<String>,
    /// Set when the replay goes no further.
    over: Option<DriverError>,
}

impl Replayed {
    /// A robot with the given model that answers from `source`. The first thing that keeps the replay from going on is
    /// told to `ends`; every question after it fails with [`DriverError::Lost`].
    pub fn new(model: &RobotModel, source: Box<dyn PeriodSource>, ends: Sender<ReplayEnd>) -> Self {
        let mut core = Core {
            source,
            ends,
            arm_joints: model.arm.joints.clone(),
            head_joints: model.head.joints.clone(),
            camera_names: model.settings.camera.iter().map(|camera| camera.name.clone()).collect(),
            period: Period::default(),
            asked: Asked::default(),
            stop_reason: None,
            over: None,
        };
        // What is wrong already shows at the first question.
        let _ = core.turn_over();
        Self { parts: Arm(Head(core)) }
    }

    fn core_mut(&mut self) -> &mut Core {
        &mut self.parts.0.0
    }
}

impl Core {
    fn check(&self) -> Result<(), DriverError> {
        self.over.clone().map_or(Ok(()), Err)
    }

    fn end(&mut self, end: ReplayEnd) -> DriverError {
        let reason = match &end {
            ReplayEnd::Differs(_) => "the replay differs from its recording".to_owned(),
            ReplayEnd::Over(_) => "the recording ends here".to_owned(),
            ReplayEnd::Unreadable { reason, .. } => reason.clone(),
        };
        let error = DriverError::Lost { part: "the recording".into(), reason };
        if self.over.is_none() {
            // Nobody asks why: then nobody needs to know.
            let _ = self.ends.send(end);
            self.over = Some(error.clone());
        }
        error
    }

    fn differ(&mut self, part: &'static str, expected: String, got: String) -> DriverError {
        self.end(ReplayEnd::Differs(Difference { part, stamp: self.period.now, expected, got }))
    }

    /// Goes on to the next period.
    fn turn_over(&mut self) -> Result<(), DriverError> {
        let stamp = self.period.now;
        match self.source.next_period() {
            Ok(Some(period)) => {
                (self.period, self.asked) = (period, Asked::default());
                Ok(())
            }
            Ok(None) => Err(self.end(ReplayEnd::Over(stamp))),
            Err(reason) => Err(self.end(ReplayEnd::Unreadable { stamp, reason })),
        }
    }

    /// The answer to command `number` of `commands`, which must be the one that was recorded.
    fn answer_command<T: SameBits + Debug + Clone>(
        &mut self,
        part: &'static str,
        pick: impl Fn(&Period) -> &[Exchange<T>],
        number: usize,
        asked: &T,
    ) -> Result<T, DriverError> {
        self.check()?;
        match pick(&self.period).get(number) {
            Some(exchange) if exchange.asked.is_same(asked) => exchange.answer.clone(),
            Some(exchange) => {
                let expected = format!("{:?}", exchange.asked);
                Err(self.differ(part, expected, format!("{asked:?}")))
            }
            None => Err(self.differ(part, "no further command".into(), format!("{asked:?}"))),
        }
    }

    fn answer<T: Clone>(
        &mut self,
        part: &'static str,
        found: impl Fn(&Period) -> Option<Result<T, DriverError>>,
    ) -> Result<T, DriverError> {
        self.check()?;
        match found(&self.period) {
            Some(answer) => answer,
            None => Err(self.differ(part, "not asked".into(), "asked".into())),
        }
    }

    /// Commands that were recorded and not given.
    fn find_missing(&self) -> Option<(&'static str, String)> {
        fn rest<T: Debug>(part: &'static str, all: &[T], given: usize) -> Option<(&'static str, String)> {
            all.get(given).map(|first| (part, format!("{first:?}")))
        }
        let (period, asked) = (&self.period, &self.asked);
        rest("base", &period.base, asked.base)
            .or_else(|| rest("arm", &period.arm.commands, asked.arm))
            .or_else(|| rest("head", &period.head.commands, asked.head))
            .or_else(|| rest("gripper", &period.gripper.commands, asked.gripper))
            .or_else(|| rest("emergency stop", &period.stop, asked.stop))
    }

    fn answer_stop(&mut self, asked: StopCommand) -> Result<(), DriverError> {
        self.check()?;
        let number = self.asked.stop;
        self.asked.stop += 1;
        match self.period.stop.get(number) {
            Some((recorded, answer)) if *recorded == asked => answer.clone(),
            recorded => {
                let expected = recorded.map_or_else(|| "nothing".to_owned(), |(recorded, _)| format!("{recorded:?}"));
                Err(self.differ("emergency stop", expected, format!("{asked:?}")))
            }
        }
    }
}

/// Which of the two joint groups.
#[derive(Clone, Copy)]
enum Which {
    Arm,
    Head,
}

impl Which {
    fn part(self) -> &'static str {
        match self {
            Self::Arm => "arm",
            Self::Head => "head",
        }
    }

    fn talk(self, period: &Period) -> &JointTalk {
        match self {
            Self::Arm => &period.arm,
            Self::Head => &period.head,
        }
    }
}

impl Core {
    fn command_joints(&mut self, which: Which, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        let (own, number) = match which {
            Which::Arm => (&self.arm_joints, &mut self.asked.arm),
            Which::Head => (&self.head_joints, &mut self.asked.head),
        };
        let own = own.clone();
        let asked = JointValues::of_velocities(&own, velocities);
        let this = *number;
        *number += 1;
        let sent = self.answer_command(which.part(), |period| &which.talk(period).commands, this, &asked)?;
        sent.find_velocities(&own).ok_or_else(|| self.odd(which))
    }

    fn read_joints(&mut self, which: Which) -> Result<JointState, DriverError> {
        let (own, number) = match which {
            Which::Arm => (&self.arm_joints, &mut self.asked.arm_state),
            Which::Head => (&self.head_joints, &mut self.asked.head_state),
        };
        let own = own.clone();
        let this = *number;
        *number += 1;
        let reading = self.answer(which.part(), |period| which.talk(period).state.find(this).cloned())?;
        reading.find_state(&own).ok_or_else(|| self.odd(which))
    }

    fn odd(&mut self, which: Which) -> DriverError {
        let reason = format!("values of the {} that do not fit its joints", which.part());
        self.end(ReplayEnd::Unreadable { stamp: self.period.now, reason })
    }
}

impl JointGroup for Arm {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.0.command_joints(Which::Arm, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.0.read_joints(Which::Arm)
    }
}

impl JointGroup for Head {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.command_joints(Which::Head, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.read_joints(Which::Head)
    }
}

/// Counts a question and gives its number.
fn next(counter: &mut u32) -> u32 {
    *counter += 1;
    *counter - 1
}

impl Base for Core {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.asked.base += 1;
        self.answer_command("base", |period| &period.base, self.asked.base - 1, &twist)
    }

    fn velocity(&mut self) -> Result<Twist, DriverError> {
        let number = next(&mut self.asked.base_velocity);
        self.answer("base velocity", |period| period.base_velocity.find(number).cloned())
    }
}

impl Gripper for Core {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.asked.gripper += 1;
        let number = self.asked.gripper - 1;
        self.answer_command("gripper", |period| &period.gripper.commands, number, &(width_m, max_force_n))
    }

    fn state(&mut self) -> Result<GripperState, DriverError> {
        let number = next(&mut self.asked.gripper_state);
        self.answer("gripper", |period| period.gripper.state.find(number).cloned())
    }
}

impl Cameras for Core {
    fn names(&self) -> Vec<String> {
        self.camera_names.clone()
    }

    /// Each camera by itself gives its frames as then; one that is read once more has no new frame.
    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        self.check()?;
        let number = self.asked.frames.entry(camera.to_owned()).or_insert(0);
        *number += 1;
        let this = *number - 1;
        let mut reads = self.period.frames.iter().filter(|read| read.camera == camera).map(|read| &read.answer);
        let Some(found) = reads.nth(this).cloned() else {
            if this > 0 {
                return Ok(None);
            }
            return Err(self.differ("cameras", format!("`{camera}` is not read"), format!("`{camera}` is read")));
        };
        let Some(id) = found? else { return Ok(None) };
        match self.source.take_frame(id) {
            Some(frame) => Ok(Some(frame)),
            None => {
                let reason = format!("frame {} is missing", id.0);
                Err(self.end(ReplayEnd::Unreadable { stamp: self.period.now, reason }))
            }
        }
    }
}

impl Localisation for Core {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        let number = next(&mut self.asked.world_from_base);
        self.answer("localisation", |period| period.world_from_base.find(number).cloned())
    }

    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        let number = next(&mut self.asked.odom_from_base);
        self.answer("odometry", |period| period.odom_from_base.find(number).cloned())
    }
}

impl Clock for Core {
    fn now(&self) -> Stamp {
        self.period.now
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        self.check()?;
        if let Some((part, expected)) = self.find_missing() {
            return Err(self.differ(part, expected, "no further command".into()));
        }
        match self.period.waited.clone() {
            None => Err(self.end(ReplayEnd::Over(self.period.now))),
            Some(waited) if waited.until == stamp => {
                self.turn_over()?;
                waited.answer
            }
            Some(waited) => {
                let (expected, got) = (waited.until.as_s(), stamp.as_s());
                Err(self.differ("clock", format!("waits until {expected} s"), format!("waits until {got} s")))
            }
        }
    }
}

impl EmergencyStop for Core {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        let answer = self.answer_stop(StopCommand::Trigger(reason.to_owned()));
        if answer.is_ok() {
            self.stop_reason.get_or_insert_with(|| reason.to_owned());
        }
        answer
    }

    fn find_reason(&self) -> Option<String> {
        self.stop_reason.clone()
    }

    fn reset(&mut self) -> Result<(), DriverError> {
        let answer = self.answer_stop(StopCommand::Reset);
        if answer.is_ok() {
            self.stop_reason = None;
        }
        answer
    }
}

impl Robot for Replayed {
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
        let core = self.core_mut();
        let number = next(&mut core.asked.stop_reason);
        if let Some(Ok(reason)) = core.period.stop_reason.find(number) {
            core.stop_reason.clone_from(reason);
        }
        core
    }
}
