//! What the builder keeps about an object beside the map: the window and derived values. Never stored in the map.

use super::config::BuildConfig;
use super::observation::{Observation, robust_aabb};
use super::window::Window;
use crate::frame::FrameId;
use crate::geometry::{Aabb, OrientedBox};
use crate::map::{MapObject, ObjectId, ObjectState, VoteSubject, Votes};
use crate::perceive::normalize;
use crate::time::Stamp;
use nalgebra::Vector3;
use std::collections::{BTreeSet, VecDeque};

/// Frames remembered to tell two things seen together from one thing seen twice.
const SEEN_FRAMES: usize = 64;

/// Builder's memory of one object.
#[derive(Clone, Debug)]
pub(super) struct Track {
    pub(super) window: Window,
    /// Axis-aligned box around its points.
    pub(super) aabb: Aabb,
    /// Heights of its upward faces, metres.
    pub(super) surfaces: Vec<f64>,
    /// What the best view lost of its outline, metres.
    pub(super) lost_m: f64,
    /// Usual depth of things of its name, metres.
    depth_m: Option<f64>,
    /// Frames in a row that saw through it.
    pub(super) absent: u32,
    /// The last frames that showed it, oldest first.
    pub(super) seen: VecDeque<FrameId>,
    /// Box and name when its relations were last computed.
    pub(super) related: Option<(OrientedBox, String)>,
}

impl Track {
    /// A track for an object whose views are not known, for example from a stored map.
    pub(super) fn from_object(config: &BuildConfig, object: &MapObject) -> Self {
        let aabb = robust_aabb(&object.points).unwrap_or_else(|| object.bounds.aabb());
        let mut window = Window::from_points(&object.points, &aabb);
        let surfaces =
            window.find_shape(config, None).map_or_else(|| vec![object.bounds.top_m()], |shape| shape.surfaces);
        Self { window, aabb, surfaces, lost_m: 0.0, depth_m: None, absent: 0, seen: VecDeque::new(), related: None }
    }

    /// The first observation of a new object, whose identity is not given yet.
    pub(super) fn start(config: &BuildConfig, stamp: Stamp, observation: Observation) -> Option<(Self, MapObject)> {
        let mut track = Self {
            window: Window::new(&observation.bounds),
            aabb: observation.bounds,
            surfaces: Vec::new(),
            lost_m: 0.0,
            depth_m: observation.depth_m,
            absent: 0,
            seen: VecDeque::new(),
            related: None,
        };
        let mut object = MapObject {
            id: ObjectId(u64::MAX),
            state: ObjectState::Provisional,
            names: Votes::default(),
            points: Vec::new(),
            bounds: observation.bounds.into(),
            attributes: Default::default(),
            visual_feature: Vec::new(),
            provenance: Default::default(),
            text_feature: Vec::new(),
            room: None,
            observations: 0,
            first_seen: stamp,
            last_seen: stamp,
        };
        track.fuse(config, &mut object, stamp, observation).then_some((track, object))
    }

    /// Fuses an observation into the object; false when no shape is left.
    pub(super) fn fuse(
        &mut self,
        config: &BuildConfig,
        object: &mut MapObject,
        stamp: Stamp,
        observation: Observation,
    ) -> bool {
        self.absent = 0;
        let frame = observation.view.frame;
        self.seen.push_back(frame);
        if self.seen.len() > SEEN_FRAMES {
            self.seen.pop_front();
        }
        self.window.add(config, observation.view, &observation.points, &self.aabb.center());
        let weight = observation.weight.max(1e-3);
        object.names.add(&observation.name, weight);
        object.provenance.add(VoteSubject::Name, &observation.name, &observation.named_by, weight, frame);
        if object.name() == observation.name {
            self.depth_m = observation.depth_m;
        }
        for vote in &observation.attributes {
            object.attributes.add(vote.kind, vote.key, &vote.word, vote.weight * weight);
            let subject = VoteSubject::Attribute(vote.kind, vote.key.to_owned());
            object.provenance.add(subject, &vote.word, &observation.described_by, vote.weight * weight, frame);
        }
        // A running mean whose newest view counts for at least a twentieth: light changes.
        let part = (1.0 / (object.observations as f32 + 1.0)).max(0.05);
        blend(&mut object.visual_feature, &observation.visual_feature, part);
        blend(&mut object.text_feature, &observation.text_feature, part);
        object.observations += 1;
        object.last_seen = stamp;
        if object.observations >= config.stable_observations {
            object.state = ObjectState::Stable;
        }
        self.reshape(config, object)
    }

    /// Takes over all that is known of another object, which is the same thing.
    pub(super) fn absorb(&mut self, config: &BuildConfig, target: &mut MapObject, gone: Self, source: &MapObject) {
        self.window.absorb(config, gone.window, &self.aabb.center());
        target.names.merge(&source.names);
        target.attributes.merge(&source.attributes);
        target.provenance.merge(&source.provenance);
        let part = source.observations as f32 / (source.observations + target.observations).max(1) as f32;
        blend(&mut target.visual_feature, &source.visual_feature, part);
        blend(&mut target.text_feature, &source.text_feature, part);
        target.observations += source.observations;
        self.seen = self.seen.iter().chain(&gone.seen).copied().collect::<BTreeSet<_>>().into_iter().collect();
        target.first_seen = target.first_seen.min(source.first_seen);
        target.last_seen = target.last_seen.max(source.last_seen);
        if source.state == ObjectState::Stable || target.observations >= config.stable_observations {
            target.state = ObjectState::Stable;
        }
        self.reshape(config, target);
    }

    /// Moves all that is known of the object.
    pub(super) fn shift(&mut self, object: &mut MapObject, by: &Vector3<f64>) {
        let by_f32: Vector3<f32> = by.cast();
        self.window.shift(&by_f32);
        self.aabb = Aabb { min: self.aabb.min + by, max: self.aabb.max + by };
        object.points.iter_mut().for_each(|point| point.position += by_f32);
        object.bounds.center += by;
    }

    /// Reads the shape off the window into the object; false when nothing is left.
    pub(super) fn reshape(&mut self, config: &BuildConfig, object: &mut MapObject) -> bool {
        let Some(shape) = self.window.find_shape(config, self.depth_m) else { return false };
        object.points = shape.points;
        object.bounds = shape.bounds;
        self.aabb = shape.aabb;
        self.surfaces = shape.surfaces;
        self.lost_m = shape.lost_m;
        true
    }
}

/// Moves a unit vector towards another by `part` and keeps its length.
pub(super) fn blend(feature: &mut Vec<f32>, new: &[f32], part: f32) {
    if feature.len() == new.len() {
        feature.iter_mut().zip(new).for_each(|(f, n)| *f += (n - *f) * part);
        *feature = normalize(std::mem::take(feature));
    } else {
        *feature = new.to_vec();
    }
}
