//! What the envelope knows, and what it learns while time passes.

use super::depth::DepthGuard;
use super::guard::{BaseGuard, GroupGuard};
use super::joint_watch::{JointWatch, Moment};
use super::people::People;
use super::place_watch::PlaceWatch;
use super::settings::SafetySettings;
use super::state::{Cause, Event, Part, SafetyState};
use super::{LimitReport, PERIOD, StopSwitch};
use crate::drivers::{Clock, DriverError, JointGroup, Robot};
use crate::model::RobotModel;
use dsm::geometry::OrientedBox;
use dsm::time::{Span, Stamp};
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The camera that the base drives by.
pub(super) const DRIVING_CAMERA: &str = "head";

/// A base that is measured to be faster than this does not stand yet, metres or radians per second.
const ROLLS: f64 = 0.05;

/// Which of the two joint groups.
#[derive(Clone, Copy)]
pub(super) enum Which {
    Arm,
    Head,
}

impl Which {
    pub(super) fn part(self) -> Part {
        match self {
            Self::Arm => Part::Arm,
            Self::Head => Part::Head,
        }
    }
}

pub(super) struct Core<R: Robot> {
    pub(super) robot: R,
    /// With what the hand holds.
    pub(super) model: Arc<RobotModel>,
    empty_handed: Arc<RobotModel>,
    pub(super) settings: SafetySettings,
    /// The present; only `wait_until` moves it, and never back.
    pub(super) now: Stamp,
    /// The present as the robot's clock has it.
    pub(super) clock: Stamp,
    pub(super) base: BaseGuard,
    pub(super) arm: GroupGuard,
    pub(super) head: GroupGuard,
    pub(super) arm_watch: JointWatch,
    pub(super) head_watch: JointWatch,
    pub(super) place: PlaceWatch,
    pub(super) camera_names: Vec<String>,
    /// Stamp of the newest frame of each camera.
    pub(super) frames: BTreeMap<Arc<str>, Stamp>,
    /// When the driving camera gave its newest frame.
    pub(super) frame_at: Stamp,
    pub(super) depth: DepthGuard,
    pub(super) people: People,
    pub(super) switch: StopSwitch,
    pub(super) state: SafetyState,
    /// Whether the base was measured to roll when it was looked at last.
    pub(super) rolls: bool,
    held_since: Stamp,
    pub(super) report: LimitReport,
}

impl<R: Robot> Core<R> {
    pub(super) fn new(mut robot: R, model: &Arc<RobotModel>) -> Self {
        let now = robot.clock().now();
        let settings = model.settings.safety.clone();
        let mut core = Self {
            camera_names: robot.cameras().names(),
            robot,
            now,
            clock: now,
            base: BaseGuard::new(model.settings.base.clone()),
            arm: GroupGuard::new(&model.arm),
            head: GroupGuard::new(&model.head),
            arm_watch: JointWatch::new(Part::Arm, &model.arm, now),
            head_watch: JointWatch::new(Part::Head, &model.head, now),
            place: PlaceWatch::new(now),
            frames: BTreeMap::new(),
            frame_at: now,
            depth: DepthGuard::new(&settings.depth, model.settings.base.height_m),
            people: People::default(),
            switch: StopSwitch::default(),
            state: SafetyState::Running,
            rolls: false,
            held_since: now,
            report: LimitReport::default(),
            settings,
            model: model.clone(),
            empty_handed: model.clone(),
        };
        core.look();
        core
    }

    pub(super) fn group(&mut self, which: Which) -> (&mut GroupGuard, &mut dyn JointGroup) {
        match which {
            Which::Arm => (&mut self.arm, self.robot.arm()),
            Which::Head => (&mut self.head, self.robot.head()),
        }
    }

    pub(super) fn watch_of(&mut self, which: Which) -> &mut JointWatch {
        match which {
            Which::Arm => &mut self.arm_watch,
            Which::Head => &mut self.head_watch,
        }
    }

    pub(super) fn moves(&self) -> bool {
        self.arm.moves() || self.head.moves() || self.base.moves()
    }

    pub(super) fn note_people(&mut self, stamp: Stamp, people_in_base: &[Point3<f64>]) {
        if let Some(place) = self.place.find_at(stamp) {
            self.people.note(self.now, people_in_base, &place.odom_from_base);
        }
    }

    pub(super) fn note_held(&mut self, held_in_tool: Option<OrientedBox>) {
        self.model = match held_in_tool {
            Some(held) => Arc::new(self.empty_handed.holding(&held)),
            None => self.empty_handed.clone(),
        };
    }

    /// Takes in a cause to brake.
    pub(super) fn fault(&mut self, cause: Cause) {
        let (ran, was_latched) = (self.state == SafetyState::Running, self.state.find_latched().is_some());
        self.state = std::mem::take(&mut self.state).next(Event::Fault(cause));
        if self.state.find_latched().is_some() {
            self.report.stops += u64::from(!was_latched);
        } else if ran {
            self.report.holds += 1;
            self.held_since = self.now;
        }
    }

    /// Takes in the error of a part, and begins to brake all others.
    pub(super) fn fail(&mut self, part: Part, error: DriverError) -> DriverError {
        let cause = match &error {
            DriverError::Stopped { reason } => Cause::EmergencyStop { reason: reason.clone() },
            other => Cause::PartFailed { part, reason: other.to_string() },
        };
        self.fault(cause);
        self.brake();
        error
    }

    /// Looks at the stops and at everything that is measured.
    pub(super) fn look(&mut self) {
        let pressed = self.switch.find_reason().map(str::to_owned);
        if let Some(reason) = pressed.or_else(|| self.robot.emergency_stop().find_reason()) {
            self.fault(Cause::EmergencyStop { reason });
        }
        for which in [Which::Arm, Which::Head] {
            if let Some(cause) = self.look_at_joints(which) {
                self.fault(cause);
            }
        }
        if let Some(cause) = self.look_at_base().or_else(|| self.look_at_gripper()).or_else(|| self.look_at_place()) {
            self.fault(cause);
        }
        self.look_for_trouble();
    }

    fn look_at_joints(&mut self, which: Which) -> Option<Cause> {
        let at = Moment { now: self.now, clock: self.clock };
        let state = match self.group(which).1.state() {
            Ok(state) => state,
            Err(error) => return Some(Cause::PartFailed { part: which.part(), reason: error.to_string() }),
        };
        let (watch, told) = match which {
            Which::Arm => (&mut self.arm_watch, &self.arm.sent),
            Which::Head => (&mut self.head_watch, &self.head.sent),
        };
        watch.note(at, &state, told, &self.settings)
    }

    fn look_at_base(&mut self) -> Option<Cause> {
        let part = Part::Base;
        let velocity = self.robot.base().velocity();
        // Where nothing is measured, what was sent has to do.
        self.rolls = velocity.as_ref().is_ok_and(|v| v.forward_m_per_s.abs().max(v.turn_rad_per_s.abs()) > ROLLS);
        match velocity {
            Ok(twist) if twist.forward_m_per_s.is_finite() && twist.turn_rad_per_s.is_finite() => None,
            Ok(_) => Some(Cause::NotFinite { part }),
            Err(error) => Some(Cause::PartFailed { part, reason: error.to_string() }),
        }
    }

    fn look_at_gripper(&mut self) -> Option<Cause> {
        let part = Part::Gripper;
        match self.robot.gripper().state() {
            Ok(state) if state.width_m.is_finite() && state.force_n.is_finite() => None,
            Ok(_) => Some(Cause::NotFinite { part }),
            Err(error) => Some(Cause::PartFailed { part, reason: error.to_string() }),
        }
    }

    fn look_at_place(&mut self) -> Option<Cause> {
        let at = Moment { now: self.now, clock: self.clock };
        let localisation = self.robot.localisation();
        match (localisation.world_from_base(), localisation.odom_from_base()) {
            (Ok(world), Ok(odom)) => self.place.note(at, &world, &odom, self.base.sent, &self.settings),
            (Err(error), _) | (_, Err(error)) => {
                Some(Cause::PartFailed { part: Part::Localisation, reason: error.to_string() })
            }
        }
    }

    /// Holds while a sense that the motion needs is lost, goes on when it is back, and latches what does not come back.
    pub(super) fn look_for_trouble(&mut self) {
        match self.find_trouble() {
            Some(cause) => self.fault(cause),
            None => self.state = std::mem::take(&mut self.state).next(Event::Cleared),
        }
        if self.is_held() && self.now - self.held_since > Span::from_s(self.settings.longest_hold_s) {
            self.state = std::mem::take(&mut self.state).next(Event::Overdue);
            self.report.stops += 1;
        }
    }

    fn is_held(&self) -> bool {
        self.state != SafetyState::Running && self.state.find_latched().is_none()
    }

    /// What is lost of the senses that the present or wanted motion needs.
    fn find_trouble(&self) -> Option<Cause> {
        let timeout = Span::from_s(self.settings.command_timeout_s);
        let wants = |wanted: bool, commanded: Stamp| wanted && self.now - commanded <= timeout;
        // What was held waits for all of them, whatever is wanted meanwhile.
        let held = self.is_held();
        let drives = held || self.base.moves() || wants(self.base.wanted, self.base.commanded);
        let reaches = held || [&self.arm, &self.head].iter().any(|g| g.moves() || wants(g.wanted, g.commanded));
        if drives {
            if self.now - self.frame_at > Span::from_s(self.settings.sensor_timeout_s) {
                return Some(Cause::Silent { part: Part::Camera });
            }
            if let Some(cause) = self.place.find_trouble(self.now, &self.settings) {
                return Some(cause);
            }
        }
        if !drives && !reaches {
            return None;
        }
        let watches = [&self.arm_watch, &self.head_watch];
        watches.iter().find_map(|watch| watch.find_silence(self.now, &self.settings))
    }

    /// Follows the robot's clock after a wait.
    fn follow_clock(&mut self, waited: Span) {
        let bound_s = self.settings.time_jump_s;
        let clock = self.robot.clock().now();
        let passed = clock - self.clock;
        let off_s = (passed.0 - waited.0) as f64 * 1e-9;
        // Who stands may be late: a task that thinks does not let time pass.
        let jumps = off_s < -bound_s || (off_s > bound_s && self.moves());
        let stands = waited.0 > 0 && passed.0 <= 0;
        if jumps || stands {
            // Time goes on as it was waited for, whatever the clock says: braking must not wait for it.
            self.fault(Cause::TimeJump { part: Part::Clock, by_s: off_s });
            self.now = self.now + waited;
        } else {
            self.now = self.now + Span(passed.0.max(0));
        }
        self.clock = clock;
    }
}

impl<R: Robot> Clock for Core<R> {
    fn now(&self) -> Stamp {
        self.now
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        // A clock that was set meanwhile must not be waited for.
        self.follow_clock(Span(0));
        while self.now < stamp {
            let watched = self.moves() || self.state != SafetyState::Running;
            let waited = if watched { Span((stamp - self.now).0.min(PERIOD.0)) } else { stamp - self.now };
            let until = self.clock + waited;
            if let Err(error) = self.robot.clock().wait_until(until) {
                // Nothing can be let to happen any more: the robot's own stop and its watchdogs are what is left.
                let error = self.fail(Part::Clock, error);
                let _ = self.robot.emergency_stop().trigger(&format!("the clock failed: {error}"));
                return Err(error);
            }
            self.follow_clock(waited);
            self.look();
            self.brake();
        }
        Ok(())
    }
}
