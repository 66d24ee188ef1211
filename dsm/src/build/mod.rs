//! Map construction (paper, DSM Construction): from a frame and its detections to the changes of the map.
//!
//! ```text
//! mask ──back-project, clean──▶ observation ──associate──▶ window ──vote──▶ shape, names, attributes
//!                                                             │
//!              free space, rooms ◀── depth      merge, absence, relations
//! ```
//!
//! [`MapBuilder::observe`] is a function of its inputs and of the builder's windows; it changes no map. The caller
//! applies the update before the next frame. The builder learns about the map only from the map it is given: an object
//! that left it is forgotten, an object that it did not make is taken up.

mod absence;
mod align;
mod associate;
mod bounds;
mod carrier;
mod cell_grid;
mod config;
mod division;
mod draft;
mod drift;
mod floor;
mod late;
mod memory;
mod merge;
mod merged_mask;
mod observation;
mod occupancy;
mod outline;
mod placing;
mod relations;
mod rest;
mod rooms;
mod stage;
mod track;
mod tracks;
mod view;
mod window;

pub use carrier::Carrier;
pub use config::{BuildConfig, BuildConfigError};
pub use relations::relate_all;
pub use stage::Stage;

use crate::Pose;
use crate::frame::RgbdFrame;
use crate::knowledge::Knowledge;
use crate::map::{Map, MapChange, MapObject, MapUpdate, ObjectId, ObjectState, Room};
use crate::perceive::{
    ColorShapeEncoder, Describer, Detections, KnowledgeDescriber, KnowledgeTextEncoder, TextEncoder, VisualEncoder,
};
use draft::Draft;
use drift::Drift;
use late::Late;
use nalgebra::{Point2, Point3, Vector3};
use observation::{Encoders, Observation, find_observation};
use occupancy::Occupancy;
use placing::Placing;
use rayon::prelude::*;
use rooms::RoomSegmenter;
use std::sync::Arc;
use track::Track;
use tracks::Tracks;

/// Names that are structure, not objects: they shape only the free space.
const STRUCTURE: [&str; 5] = ["wall", "floor", "ceiling", "room", "ground"];

/// Times that a frame's pose is corrected at most.
const CORRECTIONS: usize = 2;
/// Move of the camera from which it is corrected once more, metres.
const LARGE_MOVE_M: f64 = 0.04;

fn is_structure(knowledge: &Knowledge, name: &str) -> bool {
    STRUCTURE.contains(&knowledge.find(name).map_or(name, |category| &*category.name))
}

/// Builds a map from frames.
pub struct MapBuilder {
    config: BuildConfig,
    knowledge: Arc<Knowledge>,
    encoders: Encoders,
    tracks: Tracks,
    drift: Drift,
    occupancy: Occupancy,
    rooms: RoomSegmenter,
    late: Late,
    next_id: u64,
    associations: Vec<(usize, ObjectId)>,
}

impl MapBuilder {
    /// A builder with the embedded encoders. `config` must be valid ([`BuildConfig::validate`]).
    pub fn new(config: BuildConfig, knowledge: Arc<Knowledge>) -> Self {
        let text = Box::new(KnowledgeTextEncoder::new(knowledge.clone()));
        let describer = Box::new(KnowledgeDescriber::new(knowledge.clone()));
        Self::with_encoders(config, knowledge, Box::new(ColorShapeEncoder::default()), text, describer)
    }

    /// A builder with plugged-in encoders.
    pub fn with_encoders(
        config: BuildConfig,
        knowledge: Arc<Knowledge>,
        visual: Box<dyn VisualEncoder>,
        text: Box<dyn TextEncoder>,
        describer: Box<dyn Describer>,
    ) -> Self {
        let describer_name = describer.name().into();
        Self {
            config,
            knowledge,
            encoders: Encoders { visual, text, describer, detector_name: "detector".into(), describer_name },
            tracks: Tracks::default(),
            drift: Drift::default(),
            occupancy: Occupancy::default(),
            rooms: RoomSegmenter::default(),
            late: Late::default(),
            next_id: 0,
            associations: Vec::new(),
        }
    }

    /// The changes that follow from a frame. `carrier` says where what carries the camera is, which is left out of the
    /// map. Detections of another frame are ignored; free space is still updated.
    pub fn observe(&mut self, map: &Map, frame: &RgbdFrame, detections: &Detections, carrier: &Carrier) -> MapUpdate {
        self.observe_in_stages(map, frame, detections, carrier, &mut |_| {})
    }

    /// Says who gives the names of the frames to come; the map keeps it with the votes.
    pub fn credit_names_to(&mut self, detector: &str) {
        if *self.encoders.detector_name != *detector {
            self.encoders.detector_name = detector.into();
        }
    }

    /// Which detections of the last frame were taken for which objects, as the detection's place in its list and the
    /// object. Detections that are left out showed structure, too little, or two things at once.
    /// An object may have been merged into another one by the same update.
    pub fn associations(&self) -> &[(usize, ObjectId)] {
        &self.associations
    }

    /// As [`Self::observe`]; `ended` is called after each stage, for whoever holds a clock.
    pub fn observe_in_stages(
        &mut self,
        map: &Map,
        frame: &RgbdFrame,
        detections: &Detections,
        carrier: &Carrier,
        ended: &mut dyn FnMut(Stage),
    ) -> MapUpdate {
        self.associations.clear();
        // A frame whose images do not fit its camera says nothing.
        let pixels = frame.model.pixel_count();
        if frame.color.len() != pixels || frame.depth_m.len() != pixels {
            return MapUpdate { stamp: frame.stamp, changes: Vec::new() };
        }
        self.follow(map);
        let mut draft = Draft::new(map);
        // What the carrier says that it moved.
        for (id, by) in &carrier.moved {
            let Some(object) = draft.edit(*id) else { continue };
            self.tracks.change(*id, |track| track.shift(object, by));
        }
        // What it found to be gone.
        for id in &carrier.missed {
            self.tracks.remove(*id);
            draft.remove(*id, crate::map::RemovalReason::Absent);
        }
        // Single view parsing.
        let mut observations = self.parse(frame, detections, carrier);
        ended(Stage::CleanPoints);
        // Multi view mapping: associate one to one, take out this frame's pose error, fuse, start new objects.
        let floor = if self.config.align { self.find_floor(frame, detections, carrier) } else { Vec::new() };
        let (assigned, world_from_camera) = self.locate(&mut draft, frame, &mut observations, floor);
        ended(Stage::Associate);
        let touched = self.fuse(&mut draft, frame, observations, assigned);
        self.follow_drift(&draft, &touched, &world_from_camera.translation.vector.into());
        ended(Stage::Window);
        // Clean-up: duplicates, lower sides, what is gone, what was never confirmed.
        merge::merge_duplicates(&self.config, &mut draft, &mut self.tracks, &touched);
        rest::settle(&mut draft, &self.tracks, &touched);
        absence::remove_absent(&self.config, &mut draft, &mut self.tracks, frame, &world_from_camera);
        ended(Stage::CleanUp);
        // Surroundings: free space, rooms, relations.
        let cells = self.occupancy.observe(&self.config, frame, &world_from_camera, carrier, &map.free_space);
        ended(Stage::Occupancy);
        let rooms = self.divide_rooms(map, &mut draft, frame, cells.as_ref());
        ended(Stage::Rooms);
        let relations = relations::relate(&self.config, &self.knowledge, &draft, &mut self.tracks, &self.late);
        ended(Stage::Relations);
        let mut changes = draft.into_changes();
        changes.extend(relations);
        changes.extend(cells);
        changes.extend(rooms.map(MapChange::Rooms));
        self.late.follow(&changes);
        MapUpdate { stamp: frame.stamp, changes }
    }

    /// Forgets objects that left the map and takes up those that it does not know.
    fn follow(&mut self, map: &Map) {
        // Both stand in order of identity, and as a rule they hold the same.
        if self.tracks.ids().eq(map.objects.keys().copied()) {
            return;
        }
        let gone: Vec<ObjectId> = self.tracks.ids().filter(|id| !map.objects.contains_key(id)).collect();
        for id in gone {
            self.tracks.remove(id);
        }
        for (id, object) in &map.objects {
            if self.tracks.find(*id).is_none() {
                self.tracks.insert(*id, Track::from_object(&self.config, object));
            }
            self.next_id = self.next_id.max(id.0 + 1);
        }
    }

    fn parse(&self, frame: &RgbdFrame, detections: &Detections, carrier: &Carrier) -> Vec<Observation> {
        if detections.frame != frame.id {
            return Vec::new();
        }
        detections
            .items
            .par_iter()
            .enumerate()
            .filter_map(|(place, detection)| {
                if is_structure(&self.knowledge, &detection.name) {
                    return None;
                }
                let category = self.knowledge.find(&detection.name);
                find_observation(&self.config, &self.encoders, frame, (place, detection), carrier, category)
            })
            .collect()
    }

    /// Floor in view, from outside the masks of things.
    fn find_floor(&self, frame: &RgbdFrame, detections: &Detections, carrier: &Carrier) -> Vec<Point3<f64>> {
        let things = detections.items.iter().filter(|_| detections.frame == frame.id);
        let things = things.filter(|item| !is_structure(&self.knowledge, &item.name));
        floor::find_floor(frame, things.map(|item| &item.mask), carrier)
    }

    fn associate(&self, draft: &Draft, observations: &[Observation]) -> Vec<Option<ObjectId>> {
        let mut passed: Vec<(ObjectId, usize, f64)> = Vec::new();
        for (index, observation) in observations.iter().enumerate() {
            for id in self.tracks.find_near(&observation.bounds.grown(2.0 * self.config.pose_tolerance_m)) {
                let (Some(object), Some(track)) = (draft.find(id), self.tracks.find(id)) else { continue };
                let score = associate::find_score(&self.config, observation, object, &track.aabb);
                passed.extend(score.filter(|s| *s >= self.config.total_threshold).map(|s| (id, index, s)));
            }
        }
        passed.sort_by_key(|(id, index, _)| (*id, *index));
        let mut candidates: Vec<ObjectId> = passed.iter().map(|(id, _, _)| *id).collect();
        candidates.dedup();
        let mut scores = Vec::with_capacity(passed.len());
        for (id, index, score) in passed {
            if let Ok(candidate) = candidates.binary_search(&id) {
                scores.push((index, candidate, score));
            }
        }
        let assigned = associate::assign(observations.len(), candidates.len(), &scores);
        assigned.into_iter().map(|candidate| candidate.map(|c| candidates[c])).collect()
    }

    /// Associates the observations and moves them by the frame's pose error, as far as it can be told; again after a large
    /// move, which brings small things within reach. Objects that turn out to be displaced themselves are moved too. Gives
    /// the objects of the observations and the corrected pose.
    fn locate(
        &mut self,
        draft: &mut Draft,
        frame: &RgbdFrame,
        observations: &mut [Observation],
        floor: Vec<Point3<f64>>,
    ) -> (Vec<Option<ObjectId>>, Pose) {
        if !self.config.align {
            return (self.associate(draft, observations), frame.world_from_camera);
        }
        self.drift.advance(frame.stamp);
        let mut placing = Placing::new(frame.world_from_camera, observations, floor);
        placing.shift(&-self.drift.error());
        let mut assigned = self.associate(draft, placing.observations());
        let mut looks = Vec::new();
        for _ in 0..CORRECTIONS {
            let Some(fit) = placing.fit(draft, &assigned, &self.drift.deviation()) else { break };
            assigned = self.associate(draft, placing.observations());
            looks = fit.looks;
            if fit.moved_m < LARGE_MOVE_M {
                break;
            }
        }
        // The frame stays where it fits the map; the objects move to where the whole drive says.
        self.drift.update(&looks, &placing.eye(), placing.taken());
        for (id, displacement) in self.drift.take_displacements() {
            let Some(object) = draft.edit(id) else { continue };
            let by = Vector3::new(-displacement.x, -displacement.y, 0.0);
            self.tracks.change(id, |track| track.shift(object, &by));
        }
        (assigned, placing.world_from_camera())
    }

    /// Takes up what has become stable, with the error that the frame still has, and forgets what is gone.
    fn follow_drift(&mut self, draft: &Draft, touched: &[ObjectId], eye: &Point3<f64>) {
        if !self.config.align {
            return;
        }
        for id in touched {
            let stable = draft.find(*id).filter(|object| object.state == ObjectState::Stable);
            if let Some(object) = stable {
                self.drift.start(*id, &object.bounds.center, eye);
            }
        }
        self.drift.retain(|id| draft.find(id).is_some());
    }

    /// Fuses observations into their objects and starts new ones; returns the objects that were touched.
    fn fuse(
        &mut self,
        draft: &mut Draft,
        frame: &RgbdFrame,
        observations: Vec<Observation>,
        assigned: Vec<Option<ObjectId>>,
    ) -> Vec<ObjectId> {
        let mut pairs: Vec<(Observation, Option<ObjectId>)> = observations.into_iter().zip(assigned).collect();
        pairs.retain(|(observation, _)| !merged_mask::shows_two(draft, &self.tracks, observation));
        let mut jobs = Vec::with_capacity(pairs.len());
        for (observation, id) in pairs {
            let known = match id {
                Some(id) => {
                    let Some(object) = draft.find(id).cloned() else { continue };
                    let Some(track) = self.tracks.take(id) else { continue };
                    Some((track, object))
                }
                None => None,
            };
            jobs.push((observation, known));
        }
        // Each object for itself; then in order.
        let config = &self.config;
        let fuse = |(observation, known): (Observation, Option<(Track, MapObject)>)| {
            let detection = observation.detection;
            match known {
                Some((mut track, mut object)) => {
                    track.fuse(config, &mut object, frame.stamp, observation);
                    Some((detection, track, object, true))
                }
                None => Track::start(config, frame.stamp, observation)
                    .map(|(track, object)| (detection, track, object, false)),
            }
        };
        let fused: Vec<Option<(usize, Track, MapObject, bool)>> = jobs.into_par_iter().map(fuse).collect();
        let mut touched = Vec::new();
        for (detection, track, mut object, is_known) in fused.into_iter().flatten() {
            if !is_known {
                object.id = ObjectId(self.next_id);
                self.next_id += 1;
            }
            touched.push(object.id);
            self.associations.push((detection, object.id));
            self.tracks.put_back(object.id, track);
            draft.add(object);
        }
        touched
    }

    /// Puts touched objects into their rooms and, when it is due, divides the free space anew.
    fn divide_rooms(
        &mut self,
        map: &Map,
        draft: &mut Draft,
        frame: &RgbdFrame,
        cells: Option<&MapChange>,
    ) -> Option<Vec<Room>> {
        let mut moved = draft.edited();
        let due = self.rooms.is_due(&self.config, frame.stamp);
        let rooms = due.then(|| {
            let changed = match cells {
                Some(MapChange::Cells(cells)) => cells.as_slice(),
                _ => &[],
            };
            let eye = Point2::from(frame.world_from_camera.translation.vector.xy());
            let part = self.rooms.find_part(&eye, &map.free_space, changed);
            let over = self.tracks.find_over(&part.bounds);
            let objects = over.iter().filter_map(|id| draft.find(*id));
            let free = (&map.free_space, changed);
            let (config, knowledge) = (&self.config, &self.knowledge);
            let rooms =
                self.rooms.divide(config, knowledge, frame.stamp, &part, free, &self.occupancy, &map.rooms, objects);
            moved.extend(over);
            rooms
        });
        for id in moved {
            let Some(object) = draft.find(id) else { continue };
            let room = self.rooms.find_room(&map.free_space, &object.bounds.center.xy());
            if room != object.room
                && let Some(object) = draft.edit(id)
            {
                object.room = room;
            }
        }
        rooms.filter(|rooms| *rooms != map.rooms)
    }
}
