//! What the agent makes of its senses before anything is learned from them: its pose, frames, light.

use super::{Agent, Halt, Seen};
use crate::journal::Moment;
use crate::pace::is_unfolded;
use crate::pose_watch::PoseEvent;
use dsm::build::Carrier;
use dsm::frame::RgbdFrame;
use dsm::map::MapObject;
use dsm::time::Span;
use nalgebra::{Point2, Point3};
use std::sync::Arc;

/// Names under which detectors find people.
const PEOPLE: [&str; 10] = ["person", "people", "human", "man", "woman", "child", "boy", "girl", "baby", "pedestrian"];
/// Who was seen last so long ago has gone on.
const PEOPLE_STAY: Span = Span(3_000_000_000);

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

    /// Notes when the envelope begins to brake, and when it lets the robot go on.
    pub(super) fn watch_safety(&mut self) {
        let Some(safety) = self.robot.safety() else { return };
        let cause = safety.state().find_cause().cloned();
        if cause.is_some() == self.braking.is_some() {
            return;
        }
        match &cause {
            Some(cause) => self.mark(format!("brakes: {cause}")),
            None => self.mark("may go on"),
        }
        self.braking = cause;
    }

    /// Whether the envelope holds the robot until a sense is back.
    pub fn is_held(&self) -> bool {
        self.braking.is_some()
    }

    /// Rests while the envelope holds the robot; it does not do so for ever.
    pub fn await_release(&mut self) -> Result<(), Halt> {
        while self.is_held() {
            self.rest(self.config.period)?;
        }
        Ok(())
    }

    /// Tells the envelope where people were seen a moment ago.
    pub(super) fn tell_of_people(&mut self) -> Result<(), Halt> {
        let now = self.now();
        let is_here =
            |object: &&Arc<MapObject>| PEOPLE.contains(&object.name()) && now - object.last_seen <= PEOPLE_STAY;
        let people: Vec<Point3<f64>> = self.map.objects.values().filter(is_here).map(|p| p.bounds.center).collect();
        if people.is_empty() && !self.people {
            return Ok(());
        }
        self.people = !people.is_empty();
        let base_from_world = self.world_from_base()?.inverse();
        let people: Vec<Point3<f64>> = people.iter().map(|person| base_from_world * person).collect();
        if let Some(safety) = self.robot.safety() {
            safety.note_people(now, &people);
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
            swept: Vec::new(),
            missed: Vec::new(),
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
        carrier.swept = std::mem::take(&mut self.swept);
        carrier.missed = std::mem::take(&mut self.missed);
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
