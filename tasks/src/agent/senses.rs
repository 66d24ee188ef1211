//! What the agent makes of its senses before anything is learned from them: its pose, frames, light.

use super::{Agent, Halt, Seen};
use crate::journal::Moment;
use crate::pace::is_unfolded;
use crate::pose_watch::PoseEvent;
use dsm::build::Carrier;
use dsm::frame::RgbdFrame;
use nalgebra::Point2;
use std::sync::Arc;

impl Agent {
    /// Tells jumps of localisation from motion.
    pub(super) fn watch_pose(&mut self) -> Result<(), Halt> {
        let now = self.now();
        let located = self.robot.localisation().world_from_base()?.pose;
        let odom = self.robot.localisation().odom_from_base()?.pose;
        match self.watch.note(now, &located, &odom) {
            Some(PoseEvent::Jumped { by_m }) => {
                self.mark(format!("localisation jumps by {by_m:.2} m; goes on by odometry"));
            }
            Some(PoseEvent::Back) => self.mark("localisation is back"),
            Some(PoseEvent::Believed) => self.mark("localisation stands by its jump and is believed"),
            None => {}
        }
        Ok(())
    }

    /// Takes in a frame: what is near at once, what is learned from it later.
    pub(super) fn see(&mut self, mut frame: RgbdFrame) -> Result<(), Halt> {
        frame.world_from_camera = self.watch.believed(frame.stamp, &frame.world_from_camera);
        let frame = Arc::new(frame);
        let configuration = self.configuration()?;
        let world_from_base = self.world_from_base()?;
        let bodies = self.model.link_boxes(&configuration, &world_from_base);
        self.live.observe(&frame, &bodies, &self.config.live);
        if is_unfolded(&self.model, &configuration) {
            self.live.observe_surfaces(&frame, &bodies, &self.config.live);
        }
        let mut carrier = Carrier {
            bodies,
            footprint: Some((
                Point2::from(world_from_base.translation.vector.xy()),
                self.model.settings.base.footprint_radius_m,
            )),
            moved: Vec::new(),
        };
        self.journal.note_frame(&frame, &world_from_base);
        (self.on_frame)(&Moment { frame: &frame, map: &self.map, journal: &self.journal });
        self.frames.insert(frame.camera.to_string(), Seen { frame: frame.clone(), world_from_base });
        if &*frame.camera == "head" {
            self.light.note(&frame);
        }
        if self.light.is_awaited() {
            // What nobody could recognise must not count as looked at.
            return Ok(());
        }
        carrier.moved = std::mem::take(&mut self.moved);
        Ok(self.perception.submit(frame, carrier)?)
    }

    /// Rests while it is dark, as long as patience lasts.
    pub fn await_light(&mut self) -> Result<(), Halt> {
        if !self.light.is_awaited() {
            return Ok(());
        }
        self.mark("waits for light");
        while self.light.is_awaited() {
            self.rest(self.config.mapping_latency)?;
        }
        self.mark("goes on");
        Ok(())
    }
}
