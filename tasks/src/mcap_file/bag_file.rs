//! Recordings of runs as ROS 2 bags: an MCAP file of standard messages, for `ros2 bag`, `rosbags` and viewers.

use super::{Form, Messages, failed, optical_frame};
use crate::error::TaskError;
use crate::picture::{color_png, depth_mm_png};
use crate::replay::{Entry, EntrySource, Wanted};
use dsm::frame::RgbdFrame;
use dsm::store::{StoreError, WholeFile};
use dsm::time::Stamp;
use dsm_robot::joints::JointNames;
use dsm_robot::model::RobotModel;
use dsm_robot::recorded::{JointTalk, Period};
use dsm_ros2::bag::{self, BagMessage};
use mcap::WriteOptions;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

/// A bag that is being written.
struct Bag {
    messages: Messages<BufWriter<WholeFile>>,
    base_frame: String,
    /// Joints of arm and head.
    joints: [JointNames; 2],
}

/// Writes what a recording holds as a bag. The number of its messages.
///
/// # Errors
/// [`TaskError`]: no recording, a damaged one, or a bag that cannot be written.
pub fn write_bag(recording: &Path, path: &Path) -> Result<u32, TaskError> {
    let mut source = super::open_run(recording, Wanted::All)?;
    let head = crate::replay::read_head(&mut *source)?;
    let model = RobotModel::load(&crate::assemble::find_robot(&head.robot)?)?;
    let names = |names: &[String]| names.iter().map(|name| Arc::from(name.as_str())).collect();
    let options = WriteOptions::new().profile("ros2").library("dsm");
    let file = BufWriter::new(WholeFile::create(path)?);
    let mut bag = Bag {
        messages: Messages::create(path, file, options)?,
        base_frame: model.settings.base.link.clone(),
        joints: [names(&head.arm_joints), names(&head.head_joints)],
    };
    bag.put_all(&mut *source)?;
    let written = bag.messages.sequence;
    bag.messages.writer.finish().map_err(|error| failed(path, error))?;
    let file = bag.messages.writer.into_inner();
    let file = file.into_inner().map_err(|error| failed(path, error.into_error()))?;
    file.finish()?;
    Ok(written)
}

impl Bag {
    fn put_all(&mut self, source: &mut dyn EntrySource) -> Result<(), TaskError> {
        while let Some(entry) = source.next_entry()? {
            match entry {
                Entry::Frame(frame) => self.put_frame(&frame)?,
                Entry::Period(period) => self.put_period(&period)?,
                Entry::Noted(noted) => self.put(noted.stamp, bag::log(noted.stamp, &noted.what))?,
                Entry::Head(_) | Entry::Learnt(_) | Entry::Map(_) | Entry::Full(_) | Entry::End(_) => {}
            }
        }
        Ok(())
    }

    fn put(&mut self, stamp: Stamp, message: Result<BagMessage, String>) -> Result<(), StoreError> {
        let path = self.messages.path.clone();
        let BagMessage { topic, kind, definition, bytes } =
            message.map_err(|why| failed(&path, std::io::Error::other(why)))?;
        let form = || Form { encoding: "cdr", schema: Some((kind.clone(), "ros2msg", definition.clone())) };
        self.messages.write_bytes(&topic, &form, stamp, &bytes)
    }

    fn put_frame(&mut self, frame: &RgbdFrame) -> Result<(), StoreError> {
        let (stamp, optical) = (frame.stamp, optical_frame(frame));
        for (what, png) in [("color", color_png(frame)), ("depth", depth_mm_png(frame))] {
            let topic = format!("/camera/{}/{what}/compressed", frame.camera);
            self.put(stamp, bag::image(&topic, stamp, &optical, png))?;
        }
        self.put(stamp, bag::transform(stamp, "map", &optical, &frame.world_from_camera))
    }

    fn put_period(&mut self, period: &Period) -> Result<(), StoreError> {
        let (now, base_frame) = (period.now, self.base_frame.clone());
        if let Some(Ok(sent)) = period.base.last().map(|exchange| &exchange.answer) {
            self.put(now, bag::base_command(now, *sent, &base_frame))?;
        }
        self.put_joints(now, &period.arm, 0)?;
        self.put_joints(now, &period.head, 1)?;
        let velocity = match period.base_velocity.find(0) {
            Some(Ok(velocity)) => *velocity,
            _ => Default::default(),
        };
        let odom = period.odom_from_base.find(0).and_then(|answer| answer.as_ref().ok());
        let world = period.world_from_base.find(0).and_then(|answer| answer.as_ref().ok());
        if let Some(odom) = odom {
            self.put(now, bag::odometry(odom, velocity, &base_frame))?;
        }
        if let Some(world) = world {
            self.put(now, bag::localisation(world))?;
            self.put(now, bag::transform(world.stamp, "map", &base_frame, &world.pose))?;
        }
        Ok(())
    }

    fn put_joints(&mut self, now: Stamp, talk: &JointTalk, group: usize) -> Result<(), StoreError> {
        let state = talk.state.find(0).and_then(|answer| answer.as_ref().ok());
        match state.and_then(|state| state.find_state(&self.joints[group])) {
            Some(state) => self.put(now, bag::joint_states(&state)),
            None => Ok(()),
        }
    }
}
