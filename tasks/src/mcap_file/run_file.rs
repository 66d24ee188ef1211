//! Recordings of runs: all that [`crate::replay`] needs, exactly, beside the topics that viewers show.
//!
//! | topic | encoding | what |
//! |---|---|---|
//! | `/dsm/head`, `/dsm/end` | `json` | what is needed to run again; accounts of the steps |
//! | `/dsm/map` | `dsm-map` | the final map, as `map.dsm` |
//! | `/dsm/period` | `postcard` | [`dsm_robot::recorded::Period`], one in a control period |
//! | `/dsm/frame` | `postcard` | what of a frame is no image; its images come before it |
//! | `/dsm/learnt`, `/dsm/noted`, `/dsm/full` | `postcard` | [`crate::replay::Learnt`], [`crate::replay::Noted`], a stamp |
//! | `/camera/NAME/color`, `/camera/NAME/depth` | `cdr` | `sensor_msgs/msg/CompressedImage`: PNG; depth in millimetres |
//! | others | `json` | as in files for viewers |
//!
//! The file has its name from the beginning and is only ever appended to, a chunk at a time: what was flushed can be read
//! whatever happens to the process.

use super::image;
use super::{
    Association, Form, Messages, annotations, associations, base_command, failed, gripper_command, joint_command, log,
    pose, scene_update, time, topic,
};
use crate::error::TaskError;
use crate::picture::{color_png, depth_mm_png};
use crate::replay::{End, Entry, EntryFile, Learnt};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::map::{Map, MapObject, ObjectId};
use dsm::store::StoreError;
use dsm::time::Stamp;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::{JointNames, JointVelocities};
use dsm_robot::recorded::Period;
use mcap::WriteOptions;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

pub(super) const HEAD: &str = "/dsm/head";
pub(super) const PERIOD: &str = "/dsm/period";
pub(super) const FRAME: &str = "/dsm/frame";
pub(super) const LEARNT: &str = "/dsm/learnt";
pub(super) const NOTED: &str = "/dsm/noted";
pub(super) const FULL: &str = "/dsm/full";
pub(super) const MAP: &str = "/dsm/map";
pub(super) const END: &str = "/dsm/end";

/// What of a frame is no image.
#[derive(Serialize, Deserialize)]
pub(super) struct FrameHead {
    pub(super) id: FrameId,
    pub(super) stamp: Stamp,
    pub(super) camera: String,
    pub(super) model: CameraModel,
    pub(super) world_from_camera: Pose,
}

/// A recording that is being written.
struct RunFile {
    messages: Messages<BufWriter<File>>,
    written: u64,
    now: Stamp,
    /// Joints of arm and head.
    joints: [JointNames; 2],
    /// Camera of each frame that was not learned from yet.
    cameras: BTreeMap<FrameId, String>,
    map: Map,
    shown: Shown,
}

/// What viewers were last told that the robot was sent.
#[derive(Default)]
struct Shown {
    base: Option<Twist>,
    joints: [Option<JointVelocities>; 2],
    gripper: Option<(f64, f64)>,
}

/// Creates a recording.
///
/// # Errors
/// [`TaskError`]: it is there already, or cannot be written.
pub fn create_run(path: &Path) -> Result<Box<dyn EntryFile>, TaskError> {
    let file = File::create_new(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::AlreadyExists => {
            TaskError::Usage(format!("{}: exists already; a recording replaces nothing", path.display()))
        }
        _ => TaskError::Store(StoreError::Io { path: path.to_owned(), source }),
    })?;
    // A chunk is gathered in memory and written when it is flushed.
    let options = WriteOptions::new().chunk_size(None).disable_seeking(true).library("dsm");
    Ok(Box::new(RunFile {
        messages: Messages::create(path, BufWriter::new(file), options)?,
        written: 0,
        now: Stamp::default(),
        joints: [JointNames::from([]), JointNames::from([])],
        cameras: BTreeMap::new(),
        map: Map::new(1.0),
        shown: Shown::default(),
    }))
}

/// Numbers and structures are written as postcard does, which keeps every bit.
fn exact() -> Form {
    Form { encoding: "postcard", schema: None }
}

impl RunFile {
    fn put_exact<T: Serialize>(&mut self, topic: &str, stamp: Stamp, value: &T) -> Result<(), StoreError> {
        let bytes = postcard::to_stdvec(value).map_err(|error| failed(&self.messages.path, error))?;
        self.put_bytes(topic, &exact, stamp, &bytes)
    }

    fn put_json<T: Serialize>(&mut self, topic: &str, stamp: Stamp, value: &T) -> Result<(), StoreError> {
        let bytes = serde_json::to_vec(value).map_err(|error| failed(&self.messages.path, error))?;
        // Its keys differ from run to run: a schema would have to be written for each.
        self.put_bytes(topic, &|| Form { encoding: "json", schema: None }, stamp, &bytes)
    }

    fn put_bytes(
        &mut self,
        topic: &str,
        form: &dyn Fn() -> Form,
        stamp: Stamp,
        bytes: &[u8],
    ) -> Result<(), StoreError> {
        self.written += bytes.len() as u64;
        self.messages.write_bytes(topic, form, stamp, bytes)
    }

    fn put_frame(&mut self, frame: &RgbdFrame) -> Result<(), StoreError> {
        let camera = super::optical_frame(frame);
        for (what, png) in [("color", color_png(frame)), ("depth", depth_mm_png(frame))] {
            let message = image::encode(frame.stamp, &camera, &png);
            self.put_bytes(&topic(frame, what), &image::form, frame.stamp, &message)?;
        }
        self.messages.view(frame)?;
        self.cameras.insert(frame.id, frame.camera.to_string());
        let head = FrameHead {
            id: frame.id,
            stamp: frame.stamp,
            camera: frame.camera.to_string(),
            model: frame.model,
            world_from_camera: frame.world_from_camera,
        };
        self.put_exact(FRAME, frame.stamp, &head)
    }

    fn put_period(&mut self, period: &Period) -> Result<(), StoreError> {
        self.now = period.now;
        self.put_exact(PERIOD, self.now, period)?;
        if period.frames.iter().any(|read| matches!(read.answer, Ok(Some(_))))
            && let Some(Ok(base)) = period.world_from_base.find(0)
        {
            let message = json!({"timestamp": time(self.now), "frame_id": "world", "pose": pose(&base.pose)});
            self.messages.write("/base", "foxglove.PoseInFrame", self.now, &message)?;
        }
        self.show_commands(period)
    }

    /// What was sent, when it changed.
    fn show_commands(&mut self, period: &Period) -> Result<(), StoreError> {
        let now = self.now;
        if let Some(Ok(sent)) = period.base.last().map(|exchange| &exchange.answer)
            && self.shown.base.replace(*sent) != Some(*sent)
        {
            self.messages.write("/command/base", "dsm.BaseCommand", now, &base_command(now, *sent))?;
        }
        for (place, (part, talk)) in [("arm", &period.arm), ("head", &period.head)].into_iter().enumerate() {
            let sent = talk.commands.last().and_then(|exchange| exchange.answer.as_ref().ok());
            if let Some(sent) = sent.and_then(|sent| sent.find_velocities(&self.joints[place]))
                && self.shown.joints[place].as_ref() != Some(&sent)
            {
                let topic = format!("/command/{part}");
                self.messages.write(&topic, "foxglove.JointStates", now, &joint_command(now, &sent))?;
                self.shown.joints[place] = Some(sent);
            }
        }
        if let Some(Ok(sent)) = period.gripper.commands.last().map(|exchange| &exchange.answer)
            && self.shown.gripper.replace(*sent) != Some(*sent)
        {
            let message = gripper_command(now, sent.0, sent.1);
            self.messages.write("/command/gripper", "dsm.GripperCommand", now, &message)?;
        }
        Ok(())
    }

    fn put_learnt(&mut self, learnt: &Learnt) -> Result<(), StoreError> {
        self.put_exact(LEARNT, self.now, learnt)?;
        let camera = self.cameras.remove(&learnt.frame).unwrap_or_default();
        // Frames that nothing was learned from are forgotten, too.
        self.cameras.retain(|id, _| *id > learnt.frame);
        let found = annotations(learnt.stamp, &learnt.detections);
        let topic = format!("/camera/{camera}/detections");
        self.messages.write(&topic, "foxglove.ImageAnnotations", self.now, &found)?;
        let name = |place: u32| learnt.detections.items.get(place as usize).map_or("", |item| item.name.as_str());
        let taken = |&(place, object): &(u32, _)| Association { detection: place as usize, name: name(place), object };
        let taken: Vec<Association<'_>> = learnt.associations.iter().map(taken).collect();
        let message = associations(learnt.stamp, &format!("{camera}_camera"), &taken);
        self.messages.write(&format!("/camera/{camera}/associations"), "dsm.Associations", self.now, &message)
    }

    /// Objects that changed since the map that was shown last.
    fn show_map(&mut self, map: &Map) -> Result<(), StoreError> {
        let is_new = |object: &&Arc<MapObject>| {
            self.map.objects.get(&object.id).is_none_or(|before| !Arc::ptr_eq(before, object))
        };
        let put: Vec<&MapObject> = map.objects.values().filter(is_new).map(|object| &**object).collect();
        let gone = |id: &&ObjectId| !map.objects.contains_key(id);
        let removed: Vec<ObjectId> = self.map.objects.keys().filter(gone).copied().collect();
        if !put.is_empty() || !removed.is_empty() {
            let message = scene_update(self.now, &put, &removed);
            self.messages.write("/map", "foxglove.SceneUpdate", self.now, &message)?;
        }
        self.map.objects.clone_from(&map.objects);
        Ok(())
    }

    fn put_end(&mut self, end: &End) -> Result<(), StoreError> {
        self.put_bytes(MAP, &|| Form { encoding: "dsm-map", schema: None }, self.now, &end.map)?;
        self.put_json(END, self.now, end)
    }
}

impl EntryFile for RunFile {
    fn put(&mut self, entry: &Entry) -> Result<(), StoreError> {
        match entry {
            Entry::Head(head) => {
                let names = |names: &[String]| names.iter().map(|name| Arc::from(name.as_str())).collect();
                self.joints = [names(&head.arm_joints), names(&head.head_joints)];
                self.put_json(HEAD, self.now, head)
            }
            Entry::Frame(frame) => self.put_frame(frame),
            Entry::Period(period) => self.put_period(period),
            Entry::Learnt(learnt) => self.put_learnt(learnt),
            Entry::Map(map) => self.show_map(map),
            Entry::Noted(noted) => {
                self.put_exact(NOTED, self.now, noted)?;
                self.messages.write("/log", "foxglove.Log", noted.stamp, &log(noted.stamp, &noted.what))
            }
            Entry::Full(stamp) => self.put_exact(FULL, *stamp, stamp),
            Entry::End(end) => self.put_end(end),
        }
    }

    fn len_bytes(&self) -> u64 {
        self.written
    }

    fn flush(&mut self) -> Result<(), StoreError> {
        let Messages { path, writer, .. } = &mut self.messages;
        writer.flush().map_err(|error| failed(path, error))
    }

    fn finish(mut self: Box<Self>) -> Result<(), StoreError> {
        let Messages { path, writer, .. } = &mut self.messages;
        writer.finish().map(drop).map_err(|error| failed(path, error))
    }
}
