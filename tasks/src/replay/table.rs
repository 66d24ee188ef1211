//! A recording as a table of numbers, for datasets and plots.

use super::entry::{End, Entry, EntrySource, Head};
use crate::error::TaskError;
use dsm_robot::drivers::JointState;
use dsm_robot::joints::JointNames;
use dsm_robot::recorded::{JointTalk, Period};
use std::sync::Arc;

/// What a recorded robot measured and was sent, a row for each control period.
///
/// Columns, in this order: `now_s`; the localised base in the world, `base.x_m`, `base.y_m`, `base.yaw_rad`; the measured
/// `base.forward_m_per_s`, `base.turn_rad_per_s`; `JOINT.position` and `JOINT.velocity` of arm and head, radians or metres
/// and the same per second; `gripper.width_m`, `gripper.force_n`; then what was sent last in the period:
/// `sent.base.forward_m_per_s`, `sent.base.turn_rad_per_s`, `sent.JOINT.velocity`, `sent.gripper.width_m`,
/// `sent.gripper.force_n`. NaN where nobody asked, the driver did not answer, or the command named other joints.
#[derive(Clone, Debug)]
pub struct Table {
    /// What is needed to run again.
    pub head: Head,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The rows, one after the other.
    pub values: Vec<f64>,
    /// How the run ended; `None` when the recording breaks off or is full before.
    pub end: Option<End>,
}

/// Reads a recording's numbers. Its frames are not needed: open it with [`super::Wanted::AllButFrames`].
///
/// # Errors
/// [`TaskError`]: it is damaged, or no recording.
pub fn read_table(source: &mut dyn EntrySource) -> Result<Table, TaskError> {
    let head = super::read_head(source)?;
    let names = |names: &[String]| names.iter().map(|name| Arc::from(name.as_str())).collect::<JointNames>();
    let groups = [names(&head.arm_joints), names(&head.head_joints)];
    let columns = name_columns(&head);
    let (mut values, mut end) = (Vec::new(), None);
    while let Some(entry) = source.next_entry()? {
        match entry {
            Entry::Period(period) => put_row(&mut values, &period, &groups),
            Entry::End(found) => end = Some(*found),
            _ => {}
        }
    }
    Ok(Table { head, columns, values, end })
}

fn name_columns(head: &Head) -> Vec<String> {
    let joints = || head.arm_joints.iter().chain(&head.head_joints);
    let base = ["forward_m_per_s", "turn_rad_per_s"];
    let gripper = ["gripper.width_m", "gripper.force_n"];
    let mut names: Vec<String> = ["now_s", "base.x_m", "base.y_m", "base.yaw_rad"].map(String::from).into();
    names.extend(base.map(|name| format!("base.{name}")));
    names.extend(joints().flat_map(|joint| ["position", "velocity"].map(|what| format!("{joint}.{what}"))));
    names.extend(gripper.map(String::from));
    names.extend(base.map(|name| format!("sent.base.{name}")));
    names.extend(joints().map(|joint| format!("sent.{joint}.velocity")));
    names.extend(gripper.map(|name| format!("sent.{name}")));
    names
}

fn put_row(values: &mut Vec<f64>, period: &Period, groups: &[JointNames; 2]) {
    let nothing = f64::NAN;
    let talks = [&period.arm, &period.head];
    values.push(period.now.as_s());
    let base = period.world_from_base.find(0).and_then(|answer| answer.as_ref().ok());
    values.extend(base.map_or([nothing; 3], |at| {
        let place = at.pose.translation.vector;
        [place.x, place.y, at.pose.rotation.euler_angles().2]
    }));
    let velocity = period.base_velocity.find(0).and_then(|answer| answer.as_ref().ok());
    values.extend(velocity.map_or([nothing; 2], |twist| [twist.forward_m_per_s, twist.turn_rad_per_s]));
    for (talk, joints) in talks.into_iter().zip(groups) {
        put_joints(values, talk, joints);
    }
    let gripper = period.gripper.state.find(0).and_then(|answer| answer.as_ref().ok());
    values.extend(gripper.map_or([nothing; 2], |state| [state.width_m, state.force_n]));
    let sent = period.base.last().and_then(|exchange| exchange.answer.as_ref().ok());
    values.extend(sent.map_or([nothing; 2], |twist| [twist.forward_m_per_s, twist.turn_rad_per_s]));
    for (talk, joints) in talks.into_iter().zip(groups) {
        let sent = talk.commands.last().and_then(|exchange| exchange.answer.as_ref().ok());
        let sent = sent.and_then(|sent| sent.find_velocities(joints)).filter(|sent| sent.names() == joints);
        values.extend((0..joints.len()).map(|joint| sent.as_ref().map_or(nothing, |sent| sent.values()[joint])));
    }
    let sent = period.gripper.commands.last().and_then(|exchange| exchange.answer.as_ref().ok());
    values.extend(sent.map_or([nothing; 2], |&(width_m, force_n)| [width_m, force_n]));
}

fn put_joints(values: &mut Vec<f64>, talk: &JointTalk, joints: &JointNames) {
    let state = talk.state.find(0).and_then(|answer| answer.as_ref().ok()?.find_state(joints));
    let is_own = |state: &JointState| state.positions.names() == joints && state.velocities.names() == joints;
    let state = state.filter(is_own);
    values.extend((0..joints.len()).flat_map(|joint| {
        let read = state.as_ref().map(|state| [state.positions.values()[joint], state.velocities.values()[joint]]);
        read.unwrap_or([f64::NAN; 2])
    }));
}
