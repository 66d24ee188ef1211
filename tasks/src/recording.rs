//! What a run sees and does, in the order in which the files of viewers get it.
//!
//! Frames and the map come from the mapping worker while the run goes on; path, commands, margins and events when it has
//! ended, by their own stamps: what two threads note is in one order.

use crate::error::TaskError;
use crate::journal::{Journal, Sample, SentCommands};
use crate::perception::{Tape, Taped};
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::map::{Map, MapChange, MapObject, ObjectId};
use dsm::perceive::Detections;
use dsm::store::StoreError;
use dsm::time::Stamp;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::{Receiver, Sender, channel};

/// A detection and what it was taken for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Association<'a> {
    /// Its place in the frame's list.
    pub detection: usize,
    /// The detection's name.
    pub name: &'a str,
    /// The object.
    pub object: ObjectId,
}

/// A file that is being written in a viewer's format.
pub trait RecordingFile: Send {
    /// A frame, what was detected in it, and what that was taken for.
    fn frame(&mut self, frame: &RgbdFrame, found: &Detections, taken: &[Association<'_>]) -> Result<(), StoreError>;

    /// Objects that a frame added or changed, and those that it removed.
    fn map(&mut self, stamp: Stamp, put: &[&MapObject], removed: &[ObjectId]) -> Result<(), StoreError>;

    /// Where the base stood when a frame was taken.
    fn base(&mut self, stamp: Stamp, world_from_base: &Pose) -> Result<(), StoreError>;

    /// The whole way of the base.
    fn path(&mut self, stamp: Stamp, bases: &[(Stamp, Pose)]) -> Result<(), StoreError>;

    /// A new command to the base.
    fn base_command(&mut self, stamp: Stamp, twist: Twist) -> Result<(), StoreError>;

    /// New velocities for the joints of a part (`arm`, `head`), radians or metres per second.
    fn joint_command(&mut self, stamp: Stamp, part: &str, velocities: &JointVelocities) -> Result<(), StoreError>;

    /// A new command to the gripper.
    fn gripper_command(&mut self, stamp: Stamp, width_m: f64, force_n: f64) -> Result<(), StoreError>;

    /// How the motion stood at one moment.
    fn margins(&mut self, sample: &Sample) -> Result<(), StoreError>;

    /// Something that happened, in words.
    fn event(&mut self, stamp: Stamp, what: &str) -> Result<(), StoreError>;

    /// Closes the file.
    fn finish(self: Box<Self>) -> Result<(), StoreError>;
}

/// Records what mapping does.
pub struct RecordingTape {
    file: Box<dyn RecordingFile>,
    ended: Sender<Box<dyn RecordingFile>>,
}

/// What remains to be written of a file when its tape has ended.
pub struct RecordingRest(Receiver<Box<dyn RecordingFile>>);

/// Takes a file into use.
pub fn record_into(file: Box<dyn RecordingFile>) -> (RecordingTape, RecordingRest) {
    let (ended, rest) = channel();
    (RecordingTape { file, ended }, RecordingRest(rest))
}

impl Tape for RecordingTape {
    fn record(&mut self, taped: &Taped<'_>) -> Result<(), StoreError> {
        let Taped { frame, detections, associations, update, map, .. } = taped;
        let name = |place: usize| detections.items.get(place).map_or("", |item| item.name.as_str());
        let taken =
            associations.iter().map(|&(detection, object)| Association { detection, name: name(detection), object });
        self.file.frame(frame, detections, &taken.collect::<Vec<_>>())?;
        let (mut put, mut removed) = (BTreeMap::new(), BTreeSet::new());
        for change in &update.changes {
            match change {
                MapChange::Put(object) if map.objects.contains_key(&object.id) => {
                    put.insert(object.id, &**object);
                }
                MapChange::Remove(id, _) => {
                    removed.insert(*id);
                }
                _ => {}
            }
        }
        if put.is_empty() && removed.is_empty() {
            return Ok(());
        }
        let (put, removed): (Vec<_>, Vec<_>) = (put.into_values().collect(), removed.into_iter().collect());
        self.file.map(frame.stamp, &put, &removed)
    }

    fn finish(self: Box<Self>, _: &Map) -> Result<(), StoreError> {
        // Nobody waits for it when the run failed.
        let _ = self.ended.send(self.file);
        Ok(())
    }
}

impl RecordingRest {
    /// Writes what the robot noted, and closes the file.
    ///
    /// # Errors
    /// [`TaskError`]: it cannot be written, or its tape did not end.
    pub fn write(self, journal: &Journal) -> Result<(), TaskError> {
        let mut file = self.0.recv().map_err(|_| TaskError::Internal("the recording broke off".into()))?;
        for (stamp, base) in &journal.bases {
            file.base(*stamp, base)?;
        }
        if let Some((stamp, _)) = journal.bases.last() {
            file.path(*stamp, &journal.bases)?;
        }
        write_commands(&mut *file, journal.commands.as_deref().unwrap_or_default())?;
        for sample in &journal.samples {
            file.margins(sample)?;
        }
        for event in &journal.events {
            file.event(Stamp::from_s(event.at_s), &event.what)?;
        }
        Ok(file.finish()?)
    }
}

/// What was sent to each part, when it changed.
fn write_commands(file: &mut dyn RecordingFile, commands: &[SentCommands]) -> Result<(), StoreError> {
    for (index, sent) in commands.iter().enumerate() {
        let before = index.checked_sub(1).map(|before| &commands[before]);
        if before.is_none_or(|before| before.base != sent.base) {
            file.base_command(sent.stamp, sent.base)?;
        }
        if before.is_none_or(|before| before.arm != sent.arm) {
            file.joint_command(sent.stamp, "arm", &sent.arm)?;
        }
        if before.is_none_or(|before| before.head != sent.head) {
            file.joint_command(sent.stamp, "head", &sent.head)?;
        }
        if let Some((width_m, force_n)) = sent.gripper
            && before.is_none_or(|before| before.gripper != sent.gripper)
        {
            file.gripper_command(sent.stamp, width_m, force_n)?;
        }
    }
    Ok(())
}

/// How solid an object is drawn: what is not confirmed yet is fainter.
pub fn opacity(object: &MapObject) -> f64 {
    if object.state == dsm::map::ObjectState::Stable { 0.6 } else { 0.2 }
}

/// Mean colour of an object's points, 0 to 1.
pub fn mean_color(object: &MapObject) -> [f64; 3] {
    let count = object.points.len().max(1) as f64;
    let sum = |k: usize| object.points.iter().map(|point| f64::from(point.color[k])).sum::<f64>();
    [0, 1, 2].map(|k| sum(k) / count / 255.0)
}
