//! Joints as they were heard of last, put together from messages that may each tell of some.

use crate::messages::JointState as Message;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DriverError, GripperState, JointState};
use dsm_robot::joints::{JointNames, JointPositions, JointVelocities};
use dsm_robot::model::RobotModel;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Fingers slower than this stand still, metres per second.
const STILL_M_PER_S: f64 = 0.002;
/// States kept for the stamps of pictures, which come later than these.
const HISTORY: usize = 256;
/// Messages may overtake each other by less than this; a stamp that lies farther back is that of a clock that was set.
pub(super) const OVERTAKING: Span = Span(500_000_000);

#[derive(Clone, Copy, Debug)]
struct Measured {
    stamp: Stamp,
    position: f64,
    velocity: f64,
    effort: Option<f64>,
}

/// Positions of joints by name.
type Positions = Vec<(Arc<str>, f64)>;

/// All joints that were heard of.
#[derive(Debug, Default)]
pub(super) struct Joints {
    newest: BTreeMap<Arc<str>, Measured>,
    /// Positions after each message.
    history: VecDeque<(Stamp, Positions)>,
}

/// Whether something that was measured at `stamp` was overtaken by what is known.
pub(super) fn is_late(stamp: Stamp, known: Stamp, overtaking: Span) -> bool {
    stamp < known && known - stamp < overtaking
}

impl Joints {
    pub(super) fn is_empty(&self) -> bool {
        self.newest.is_empty()
    }

    /// Takes in a message that was stamped with this moment of the run; messages overtake each other by less than
    /// `overtaking`.
    pub(super) fn accept(&mut self, stamp: Stamp, said: &Message, overtaking: Span) {
        for (index, name) in said.name.iter().enumerate() {
            let Some(position) = said.position.get(index).copied() else { continue };
            // Who measures no velocity says none.
            let velocity = said.velocity.get(index).copied().unwrap_or(0.0);
            let measured = Measured { stamp, position, velocity, effort: said.effort.get(index).copied() };
            match self.newest.get_mut(name.as_str()) {
                Some(known) if is_late(stamp, known.stamp, overtaking) => {}
                Some(known) => *known = measured,
                None => drop(self.newest.insert(name.as_str().into(), measured)),
            }
        }
        let positions = self.newest.iter().map(|(name, measured)| (name.clone(), measured.position));
        self.history.push_back((stamp, positions.collect()));
        while self.history.len() > HISTORY {
            self.history.pop_front();
        }
    }

    fn find_all(&self, names: &[Arc<str>]) -> Result<Vec<Measured>, DriverError> {
        if self.is_empty() {
            return Err(super::inbox::silent("joints"));
        }
        let all: Option<Vec<Measured>> = names.iter().map(|name| self.newest.get(name).copied()).collect();
        all.ok_or_else(|| DriverError::WrongJoints {
            expected: names.iter().map(|name| name.to_string()).collect(),
            got: self.newest.keys().map(|name| name.to_string()).collect(),
        })
    }

    /// The state of joints; each must have been named. Its stamp is that of the joint that was heard of the longest ago.
    pub(super) fn state_of(&self, names: &JointNames) -> Result<JointState, DriverError> {
        let all = self.find_all(names)?;
        let values = |value: fn(&Measured) -> f64| all.iter().map(value).collect::<Vec<f64>>();
        let state = || {
            Some(JointState {
                stamp: all.iter().map(|measured| measured.stamp).min()?,
                positions: JointPositions::from_values(names, values(|measured| measured.position))?,
                velocities: JointVelocities::from_values(names, values(|measured| measured.velocity))?,
            })
        };
        state().ok_or_else(|| super::inbox::silent("joints"))
    }

    /// The gripper, by its fingers.
    pub(super) fn gripper_state(&self, model: &RobotModel) -> Result<GripperState, DriverError> {
        let names: Vec<Arc<str>> = model.settings.gripper.joints.iter().map(|name| name.as_str().into()).collect();
        let fingers = self.find_all(&names)?;
        let stamp = fingers.iter().map(|finger| finger.stamp).min().unwrap_or_default();
        let width_m = fingers.iter().map(|finger| finger.position).sum::<f64>().max(0.0);
        // A driver that does not measure efforts leaves them out.
        let force_n = fingers.iter().map(|finger| finger.effort.map_or(0.0, f64::abs)).sum::<f64>();
        let moving = fingers.iter().any(|finger| finger.velocity.abs() > STILL_M_PER_S);
        Ok(GripperState { stamp, width_m, force_n: force_n / fingers.len() as f64, moving })
    }

    /// Where all joints of the model were at a moment: the state nearest to it.
    pub(super) fn find_at(&self, stamp: Stamp, model: &RobotModel) -> Option<JointPositions> {
        let (_, known) = self.history.iter().min_by_key(|(other, _)| (other.0 - stamp.0).abs())?;
        let mut positions = model.kinematics.zero().positions().clone();
        let names = positions.names().clone();
        for (name, value) in names.iter().zip(positions.values_mut()) {
            if let Ok(index) = known.binary_search_by(|(other, _)| other.cmp(name)) {
                *value = known[index].1;
            }
        }
        Some(positions)
    }
}

#[cfg(test)]
mod tests {
    //! Contract: joints are put together by name from whatever messages they come in; what is late changes nothing, and a
    //! part that falls silent keeps its stamp.
    use super::*;

    fn message(names: &[&str], position: f64) -> Message {
        Message {
            name: names.iter().map(|name| (*name).to_owned()).collect(),
            position: vec![position; names.len()],
            ..Message::default()
        }
    }

    #[test]
    fn joints_come_together_by_name() {
        let mut joints = Joints::default();
        let names: JointNames = vec!["b".into(), "a".into()].into();
        assert!(matches!(joints.state_of(&names), Err(DriverError::Lost { .. })));
        joints.accept(Stamp(10), &message(&["a", "other"], 1.0), OVERTAKING);
        assert!(matches!(joints.state_of(&names), Err(DriverError::WrongJoints { .. })));
        joints.accept(Stamp(20), &message(&["b"], 2.0), OVERTAKING);
        let state = joints.state_of(&names).unwrap();
        assert_eq!((state.stamp, state.positions.values()), (Stamp(10), [2.0, 1.0].as_slice()));
        joints.accept(Stamp(15), &message(&["b"], 9.0), OVERTAKING);
        joints.accept(Stamp(30), &message(&["a"], 3.0), OVERTAKING);
        let state = joints.state_of(&names).unwrap();
        assert_eq!((state.stamp, state.positions.values()), (Stamp(20), [2.0, 3.0].as_slice()), "15 is late");
        joints.accept(Stamp(20 - OVERTAKING.0), &message(&["b"], 5.0), OVERTAKING);
        let state = joints.state_of(&names).unwrap();
        assert_eq!(state.positions.values()[0], 5.0, "a clock that was set back counts");
    }
}
