//! A map while it is built: frames at once, the words of a slow model when they come.

use dsm::build::{Carrier, MapBuilder};
use dsm::frame::RgbdFrame;
use dsm::map::{Map, MapChange, MapUpdate, ObjectId};
use dsm::perceive::{Annotation, Annotator, Detections, Sighting};

/// Whether somebody wants the updates after they were applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Updates {
    /// They are given back.
    Kept,
    /// They are not; that saves a copy of what changed.
    Dropped,
}

/// A map with its builder and, where a backend describes frames, its annotator.
pub struct Mapping {
    /// Builds the map.
    pub builder: MapBuilder,
    /// The map so far.
    pub map: Map,
    annotator: Option<Box<dyn Annotator>>,
    updates: Updates,
}

impl Mapping {
    /// A map that goes on from `map`.
    pub fn new(builder: MapBuilder, annotator: Option<Box<dyn Annotator>>, map: Map, updates: Updates) -> Self {
        Self { builder, map, annotator, updates }
    }

    /// Applies late answers and then the frame; gives both as one update if updates are kept.
    pub fn observe(&mut self, frame: &RgbdFrame, detections: &Detections, carrier: &Carrier) -> Option<MapUpdate> {
        let late = self.annotator.as_mut().map(|annotator| annotator.find_answers(frame.stamp)).unwrap_or_default();
        let mut changes = self.annotate(&late);
        let mut update = self.builder.observe(&self.map, frame, detections, carrier);
        // A frame whose detections came late does not make the map older.
        update.stamp = update.stamp.max(self.map.stamp);
        let kept = (self.updates == Updates::Kept).then(|| {
            changes.extend(update.changes.iter().cloned());
            MapUpdate { stamp: update.stamp, changes }
        });
        self.map.apply(update);
        if let Some(annotator) = &mut self.annotator {
            annotator.ask(frame, &sightings(&self.builder, &self.map, detections));
        }
        kept
    }

    /// Waits for what a model still has to say, within its limits, and applies it; whether that changed the map.
    pub fn finish(&mut self) -> bool {
        let late = self.annotator.as_mut().map(|annotator| annotator.finish()).unwrap_or_default();
        !self.annotate(&late).is_empty()
    }

    /// Applies late answers.
    fn annotate(&mut self, late: &[Annotation]) -> Vec<MapChange> {
        let mut changes = Vec::new();
        for annotation in late {
            let update = self.builder.annotate(&self.map, annotation);
            changes.extend(update.changes.iter().cloned());
            self.map.apply(update);
        }
        changes
    }
}

/// The things of the map that a frame showed, as it showed them.
fn sightings<'a>(builder: &MapBuilder, map: &'a Map, detections: &'a Detections) -> Vec<Sighting<'a>> {
    let sighting = |(place, id): &(usize, ObjectId)| {
        let (object, detection) = (map.find_object(*id)?, detections.items.get(*place)?);
        Some(Sighting { object: *id, mask: &detection.mask, name: object.name() })
    };
    builder.associations().iter().filter_map(sighting).collect()
}

#[cfg(test)]
mod tests {
    //! Contract: a late answer shows with the first frame at or after its moment, once, and what is kept of a frame holds it.
    use super::*;
    use dsm::build::BuildConfig;
    use dsm::camera::CameraModel;
    use dsm::frame::FrameId;
    use dsm::geometry::OrientedBox;
    use dsm::knowledge::Knowledge;
    use dsm::map::{MapObject, Votes};
    use dsm::perceive::Remark;
    use dsm::time::Stamp;
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use std::sync::Arc;

    /// Calls the only object a mug from a moment on.
    struct Slow {
        ready: Stamp,
        open: bool,
    }

    impl Annotator for Slow {
        fn name(&self) -> &str {
            "slow"
        }

        fn ask(&mut self, _: &RgbdFrame, _: &[Sighting<'_>]) {}

        fn find_answers(&mut self, now: Stamp) -> Vec<Annotation> {
            if now >= self.ready { self.finish() } else { Vec::new() }
        }

        fn finish(&mut self) -> Vec<Annotation> {
            let remark = Remark { object: ObjectId(1), name: Some(("mug".into(), 9.0)), attributes: Vec::new() };
            let (frame, stamp, source) = (FrameId(0), Stamp::default(), Arc::from("slow"));
            let answer = Annotation { frame, stamp, source, remarks: vec![remark], relations: Vec::new() };
            let answers = if self.open { vec![answer] } else { Vec::new() };
            self.open = false;
            answers
        }
    }

    fn mapping(ready_s: f64) -> Mapping {
        let mut names = Votes::default();
        names.add("cup", 1.0);
        let center = Point3::new(9.0, 9.0, 0.5);
        let bounds = OrientedBox { center, size: Vector3::repeat(0.1), rotation: UnitQuaternion::identity() };
        let cup = MapChange::Put(Box::new(MapObject::given(ObjectId(1), names, bounds)));
        let mut map = Map::new(0.05);
        map.apply(MapUpdate { stamp: Stamp::default(), changes: vec![cup] });
        let builder = MapBuilder::new(BuildConfig::default(), Arc::new(Knowledge::embedded().unwrap()));
        let slow = Slow { ready: Stamp::from_s(ready_s), open: true };
        Mapping::new(builder, Some(Box::new(slow)), map, Updates::Kept)
    }

    fn observe(mapping: &mut Mapping, number: u64) -> MapUpdate {
        let frame = RgbdFrame {
            id: FrameId(number),
            stamp: Stamp::from_s(number as f64),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(16, 12, 0.9),
            world_from_camera: dsm::Pose::identity(),
            color: vec![[0; 3]; 192],
            depth_m: vec![0.0; 192],
        };
        let nothing = Detections { frame: frame.id, items: Vec::new() };
        mapping.observe(&frame, &nothing, &Carrier::default()).unwrap()
    }

    #[test]
    fn late_answers_show_at_their_moment() {
        let mut mapping = mapping(2.5);
        let mut copy = mapping.map.clone();
        let mut names = Vec::new();
        for number in 1..5 {
            let update = observe(&mut mapping, number);
            copy.apply(update);
            assert_eq!(copy, mapping.map, "what is kept makes the same map");
            names.push(mapping.map.find_object(ObjectId(1)).unwrap().name().to_owned());
        }
        assert_eq!(names, ["cup", "cup", "mug", "mug"]);
        assert!(!mapping.finish(), "an answer shows once");
    }

    #[test]
    fn what_is_still_to_come_counts_at_the_end() {
        let mut mapping = mapping(1e6);
        observe(&mut mapping, 1);
        assert!(mapping.finish());
        assert_eq!(mapping.map.find_object(ObjectId(1)).unwrap().name(), "mug");
    }
}
