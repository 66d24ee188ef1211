//! The parts of the robot as the envelope hands them out.

use super::core::{Core, DRIVING_CAMERA, Which};
use super::place_watch::PlaceWatch;
use super::state::{Cause, Event, Part, SafetyState};
use super::{Arm, Head};
use crate::drivers::{
    Base, Cameras, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation, Robot,
    StampedPose, Twist,
};
use crate::joints::{JointNames, JointVelocities};
use dsm::frame::RgbdFrame;

impl<R: Robot> Core<R> {
    fn refuse(&mut self, error: DriverError) -> DriverError {
        self.report.refused += 1;
        error
    }

    /// Lets a command in unless a stop is latched.
    fn admit(&mut self) -> Result<(), DriverError> {
        let pressed = self.switch.find_reason().map(str::to_owned);
        if let Some(reason) = pressed.or_else(|| self.robot.emergency_stop().find_reason()) {
            self.fault(Cause::EmergencyStop { reason });
        }
        match self.state.find_latched().map(Cause::to_string) {
            Some(reason) => Err(self.refuse(DriverError::Stopped { reason })),
            None => Ok(()),
        }
    }

    /// The answer to a measurement that cannot be true.
    fn disbelieve(&mut self, cause: Cause) -> DriverError {
        let reason = cause.to_string();
        self.fault(cause);
        self.brake();
        DriverError::Stopped { reason }
    }

    fn command_joints(&mut self, which: Which, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.admit()?;
        let (guard, _) = self.group(which);
        if velocities.names()[..] != guard.names[..] {
            let names = |names: &JointNames| names.iter().map(|name| name.to_string()).collect();
            let error = DriverError::WrongJoints { expected: names(&guard.names), got: names(velocities.names()) };
            return Err(self.refuse(error));
        }
        if let Some((name, _)) = velocities.iter().find(|(_, value)| !value.is_finite()) {
            let what = format!("the velocity of joint `{name}`");
            return Err(self.refuse(DriverError::NotFinite { what }));
        }
        let now = self.now;
        let (guard, _) = self.group(which);
        guard.commanded = now;
        guard.wanted = velocities.values().iter().any(|velocity| *velocity != 0.0);
        // Motion that begins now needs senses that nobody needed before.
        self.look_for_trouble();
        let mut command = velocities.clone();
        if self.state != SafetyState::Running {
            command.values_mut().copy_from_slice(&self.group(which).0.sent);
            return Ok(command);
        }
        let state = self.joint_state(which)?;
        if matches!(which, Which::Arm) {
            let share = self.arm_share(velocities.values(), state.positions.values());
            command.values_mut().iter_mut().for_each(|velocity| *velocity *= share);
        }
        let mut report = self.report;
        let (guard, part) = self.group(which);
        let allowed = guard.clamp(command.values(), state.positions.values(), now, &mut report);
        command.values_mut().copy_from_slice(&allowed);
        let sent = part.command(&command);
        self.report = report;
        let sent = sent.map_err(|error| self.fail(which.part(), error))?;
        self.group(which).0.sent.copy_from_slice(sent.values());
        Ok(sent)
    }

    fn joint_state(&mut self, which: Which) -> Result<JointState, DriverError> {
        let state = self.group(which).1.state().map_err(|error| self.fail(which.part(), error))?;
        match self.watch_of(which).find_flaw(&state) {
            Some(cause) => Err(self.disbelieve(cause)),
            None => Ok(state),
        }
    }

    /// Takes in a frame; `None` when it is none that was not seen before.
    fn note_frame(&mut self, mut frame: RgbdFrame) -> Result<Option<RgbdFrame>, DriverError> {
        let part = Part::Camera;
        let age_s = (self.clock - frame.stamp).as_s();
        if age_s < -self.settings.time_jump_s {
            return Err(self.disbelieve(Cause::TimeJump { part, by_s: -age_s }));
        }
        if self.frames.get(&frame.camera).is_some_and(|newest| frame.stamp <= *newest) {
            return Ok(None);
        }
        self.frames.insert(frame.camera.clone(), frame.stamp);
        if age_s > self.settings.oldest_frame_s {
            return Ok(Some(frame));
        }
        if &*frame.camera == DRIVING_CAMERA {
            self.frame_at = self.now;
        }
        let Some(place) = self.place.find_at(frame.stamp).copied() else { return Ok(Some(frame)) };
        let (arm, head) = (self.joint_state(Which::Arm)?, self.joint_state(Which::Head)?);
        let mut configuration = self.model.kinematics.zero();
        configuration.apply_group(&self.model.arm, arm.positions.values());
        configuration.apply_group(&self.model.head, head.positions.values());
        let width_m = self.robot.gripper().state().map_err(|error| self.fail(Part::Gripper, error))?.width_m;
        let configuration = self.model.with_gripper_width(configuration, width_m);
        let bodies = self.model.link_boxes(&configuration, &place.odom_from_base);
        let base_from_camera = place.world_from_base.inv_mul(&frame.world_from_camera);
        self.depth.note(&mut frame, place.odom_from_base * base_from_camera, &bodies);
        Ok(Some(frame))
    }

    fn place(
        &mut self,
        read: impl FnOnce(&mut R) -> Result<StampedPose, DriverError>,
    ) -> Result<StampedPose, DriverError> {
        let place = read(&mut self.robot).map_err(|error| self.fail(Part::Localisation, error))?;
        match PlaceWatch::find_flaw(&place.pose) {
            Some(cause) => Err(self.disbelieve(cause)),
            None => Ok(place),
        }
    }
}

impl<R: Robot> Base for Core<R> {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.admit()?;
        if !(twist.forward_m_per_s.is_finite() && twist.turn_rad_per_s.is_finite()) {
            return Err(self.refuse(DriverError::NotFinite { what: "the base's velocity".to_owned() }));
        }
        let now = self.now;
        (self.base.commanded, self.base.wanted) = (now, twist != Twist::default());
        self.look_for_trouble();
        if self.state != SafetyState::Running {
            return Ok(self.base.sent);
        }
        let capped = self.capped(twist);
        let allowed = self.base.clamp(capped, now, &mut self.report);
        self.base.sent = self.robot.base().command(allowed).map_err(|error| self.fail(Part::Base, error))?;
        Ok(self.base.sent)
    }

    fn velocity(&mut self) -> Result<Twist, DriverError> {
        self.robot.base().velocity().map_err(|error| self.fail(Part::Base, error))
    }
}

impl<R: Robot> JointGroup for Arm<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.0.command_joints(Which::Arm, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.0.joint_state(Which::Arm)
    }
}

impl<R: Robot> JointGroup for Head<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.command_joints(Which::Head, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.joint_state(Which::Head)
    }
}

impl<R: Robot> Gripper for Core<R> {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.admit()?;
        for (what, value) in [("the gripper's width", width_m), ("the gripper's force", max_force_n)] {
            if !value.is_finite() {
                return Err(self.refuse(DriverError::NotFinite { what: what.to_owned() }));
            }
        }
        let limits = &self.model.settings.gripper;
        let allowed = (width_m.clamp(0.0, limits.max_aperture_m), max_force_n.clamp(0.0, limits.max_force_n));
        self.report.gripper += u64::from(allowed != (width_m, max_force_n));
        self.robot.gripper().command(allowed.0, allowed.1).map_err(|error| self.fail(Part::Gripper, error))
    }

    fn state(&mut self) -> Result<GripperState, DriverError> {
        let state = self.robot.gripper().state().map_err(|error| self.fail(Part::Gripper, error))?;
        if !(state.width_m.is_finite() && state.force_n.is_finite()) {
            return Err(self.disbelieve(Cause::NotFinite { part: Part::Gripper }));
        }
        Ok(state)
    }
}

impl<R: Robot> Cameras for Core<R> {
    fn names(&self) -> Vec<String> {
        self.camera_names.clone()
    }

    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        match self.robot.cameras().read(camera) {
            Ok(Some(frame)) => self.note_frame(frame),
            Ok(None) => Ok(None),
            // A misspelt name is no fault of the robot.
            Err(error @ DriverError::NoCamera { .. }) => Err(error),
            Err(error) => Err(self.fail(Part::Camera, error)),
        }
    }
}

impl<R: Robot> Localisation for Core<R> {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.place(|robot| robot.localisation().world_from_base())
    }

    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.place(|robot| robot.localisation().odom_from_base())
    }
}

impl<R: Robot> EmergencyStop for Core<R> {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        self.fault(Cause::EmergencyStop { reason: reason.to_owned() });
        // The robot's own stop may be faster than ours; ours does not wait for it.
        let own = self.robot.emergency_stop().trigger(reason);
        self.brake();
        own
    }

    fn find_reason(&self) -> Option<String> {
        self.state.find_latched().map(Cause::to_string)
    }

    /// Counts at standstill alone.
    fn reset(&mut self) -> Result<(), DriverError> {
        if let (SafetyState::Braking { cause, .. }, Some(_)) = (&self.state, self.state.find_latched()) {
            return Err(DriverError::Stopped { reason: cause.to_string() });
        }
        self.robot.emergency_stop().reset()?;
        if self.state.find_latched().is_some() {
            self.state = std::mem::take(&mut self.state).next(Event::Reset);
            // What was measured wrongly is not compared with what comes now.
            self.arm_watch.restart(self.now);
            self.head_watch.restart(self.now);
            self.place = PlaceWatch::new(self.now);
        }
        Ok(())
    }
}
