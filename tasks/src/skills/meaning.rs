//! Whether what stands somewhere is still what the words mean: the map sums up what it saw, and a thing may have been put in
//! the place of another one that looks much like it.
//!
//! ```text
//! newest frames ──pixels of the thing──▶ attributes as they are now ──▶ the map with these alone ──ground──▶ score now
//! ```

use crate::agent::{Agent, Halt};
use dsm::frame::RgbdFrame;
use dsm::ground::{AttributeWord, Grounder, Grounding, find_color_share};
use dsm::knowledge::Knowledge;
use dsm::map::{Attributes, Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId};
use dsm::perceive::{AttributeVote, Describer, KnowledgeDescriber, ObjectView};
use dsm::time::Span;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Frames that are looked at, and the time between them.
const FRAMES: usize = 3;
const PERIOD: Span = Span(250_000_000);
/// Fewer pixels say nothing.
const LEAST_PIXELS: usize = 60;
/// Pixels no farther outside of the thing's box than this, and above its foot, show it, metres: its faces lie in the box's.
const BORDER_M: f64 = 0.006;
const FOOT_M: f64 = 0.02;
/// So many points are kept.
const MOST_POINTS: usize = 400;
/// What the words meant keeps at least this share of its score; less where no other one of its name is known that it could
/// have been put in the place of.
pub(crate) const KEPT_SHARE: f32 = 0.6;
const KEPT_SHARE_ALONE: f32 = 0.45;
/// A thing that looked like the colour that is said keeps this share of it: a white pot with brown soil in it shows some
/// brown where a brown one stood.
const KEPT_COLOR_SHARE: f32 = 0.6;
/// From such a share of its pixels a thing is of the colour that is said.
const COLORED_SHARE: f32 = 0.5;
/// What is taken in its place fits the words at least so well; the best of several that do not, this well.
pub(crate) const FITS: f32 = 0.5;
pub(crate) const FITS_POORLY: f32 = 0.35;

/// What words mean, to be held against what is seen now.
#[derive(Clone)]
pub struct Meaning {
    grounder: Arc<Grounder>,
    describer: Arc<KnowledgeDescriber>,
    knowledge: Arc<Knowledge>,
    text: String,
}

/// How well a thing fits the words as it looks now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Score of the grounding.
    pub(crate) score: f32,
    /// Share of its pixels that look like the colour that is said; `None` when none is, or too little is seen.
    color_share: Option<f32>,
}

impl Fit {
    /// What ranks several: the score, less where little of the thing has the colour that is said.
    pub(crate) fn rank(self) -> f32 {
        self.score * self.color_share.map_or(1.0, |share| (share / COLORED_SHARE).min(1.0))
    }
}

impl Meaning {
    /// The meaning of a text.
    pub fn new(grounder: &Arc<Grounder>, knowledge: &Arc<Knowledge>, text: &str) -> Self {
        let describer = Arc::new(KnowledgeDescriber::new(knowledge.clone()));
        Self { grounder: grounder.clone(), describer, knowledge: knowledge.clone(), text: text.to_owned() }
    }

    /// Why the object that the wrist camera looks at is no longer what the words mean; `None` while nothing speaks against
    /// it, or the words say nothing of its looks.
    pub(super) fn find_contradiction(&self, agent: &mut Agent, id: ObjectId) -> Result<Option<String>, Halt> {
        let map = agent.map().clone();
        let before = self.grounder.ground(&map, &self.text, None);
        if !speaks_of_looks(&before) {
            return Ok(None);
        }
        let Some(now) = self.find_fit(agent, "wrist", id)? else { return Ok(None) };
        let known = map.find_object(id).map_or(&[][..], |object| &object.points);
        let before = Fit { score: score_of(&before, id), color_share: self.find_color_share(&before, known) };
        let colors = match (now.color_share, before.color_share) {
            (Some(now), Some(before)) => {
                format!(" ({:.0} % of it has that colour now, {:.0} % had it)", 100.0 * now, 100.0 * before)
            }
            _ => String::new(),
        };
        let scores = format!("by {:.2} as it looks now, by {:.2} as the map has it", now.score, before.score);
        let seen = format!("fits `{}` {scores}{colors}", self.text);
        agent.log(format!("object {} {seen}", id.0));
        let is_alone = find_rivals(&map, id).is_empty();
        Ok(contradicts(now, before, is_alone).then(|| format!("what stands there is not what was meant: it {seen}")))
    }

    /// Share of points that look like the colours that are said, the least of them.
    fn find_color_share(&self, answer: &Grounding, points: &[MapPoint]) -> Option<f32> {
        let terms = answer.query.iter().flat_map(|query| &query.target.attributes);
        let colors = terms.filter(|term| term.kind == AttributeWord::Color && !term.negated);
        let share = |word: &str| find_color_share(&self.knowledge, word, points.iter().map(|point| point.color));
        colors.filter_map(|term| share(&term.word)).reduce(f32::min)
    }

    /// How well an object fits the words by what the newest frames of a camera show of it; `None` when they show too little.
    pub(crate) fn find_fit(&self, agent: &mut Agent, camera: &str, id: ObjectId) -> Result<Option<Fit>, Halt> {
        let mut look = Look::default();
        let is_watched = agent.watched.iter().any(|watched| watched == camera);
        if !is_watched {
            agent.watched.push(camera.to_owned());
        }
        for _ in 0..FRAMES {
            agent.rest(PERIOD)?;
            let seen = agent.find_frame(camera).zip(agent.map().find_object(id));
            if let Some((seen, object)) = seen {
                look.add(&*self.describer, &seen.frame, object);
            }
        }
        agent.watched.retain(|watched| is_watched || watched != camera);
        if look.votes.is_empty() {
            agent.log(format!("too little of object {} is seen to tell how it looks", id.0));
            return Ok(None);
        }
        let map = agent.map().clone();
        let Some(object) = map.find_object(id) else { return Ok(None) };
        let now = look.of(object);
        let mut changed = Map::clone(&map);
        changed.apply(MapUpdate { stamp: map.stamp, changes: vec![MapChange::Put(Box::new(now))] });
        let grounder = self.grounder.clone();
        let text = self.text.clone();
        let answer = agent.plan(move || grounder.ground(&changed, &text, None))?;
        Ok(Some(Fit { score: score_of(&answer, id), color_share: self.find_color_share(&answer, &look.points) }))
    }
}

/// Whether what stands there lost too much of what the words meant.
fn contradicts(now: Fit, before: Fit, is_alone: bool) -> bool {
    let kept = if is_alone { KEPT_SHARE_ALONE } else { KEPT_SHARE };
    let faded = match (now.color_share, before.color_share) {
        (Some(now), Some(before)) => !is_alone && before >= COLORED_SHARE && now < KEPT_COLOR_SHARE * before,
        _ => false,
    };
    faded || now.score < kept * before.score
}

/// Others of the object's name, in order of identity.
pub(crate) fn find_rivals(map: &Map, id: ObjectId) -> Vec<ObjectId> {
    let Some(name) = map.find_object(id).map(MapObject::name) else { return Vec::new() };
    map.stable_objects().filter(|other| other.id != id && other.name() == name).map(|other| other.id).collect()
}

/// Whether the words say how the thing looks.
fn speaks_of_looks(answer: &Grounding) -> bool {
    let looks = [AttributeWord::Color, AttributeWord::Pattern, AttributeWord::Material];
    let query = answer.query.as_ref();
    query.is_some_and(|query| query.target.attributes.iter().any(|term| looks.contains(&term.kind)))
}

fn score_of(answer: &Grounding, id: ObjectId) -> f32 {
    answer.candidates.iter().find(|candidate| candidate.object_id == Some(id)).map_or(0.0, |candidate| candidate.score)
}

/// How a thing looks now.
#[derive(Clone, Debug, Default)]
struct Look {
    votes: Vec<AttributeVote>,
    /// Those of its points that are seen, in their colours of now.
    points: Vec<MapPoint>,
}

impl Look {
    /// Adds what a frame shows of an object, if it shows enough of it.
    fn add(&mut self, describer: &dyn Describer, frame: &RgbdFrame, object: &MapObject) {
        let bounds = &object.bounds;
        let foot_m = bounds.center.z - 0.5 * bounds.size.z;
        let mut pixels: Vec<u32> = Vec::new();
        let mut points = Vec::new();
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for pixel in 0..frame.depth_m.len() {
            let Some(p) = frame.find_point_in_camera(pixel) else { continue };
            let at: Point3<f64> = frame.world_from_camera * p;
            // Its foot is mixed with what it stands on.
            if bounds.contains(&at, BORDER_M) && at.z > foot_m + FOOT_M {
                pixels.push(pixel as u32);
                points.push(MapPoint { position: at.cast(), color: frame.color[pixel] });
                (low, high) = (low.inf(&at.coords), high.sup(&at.coords));
            }
        }
        tracing::debug!("{} pixels show object {}", pixels.len(), object.id.0);
        if pixels.len() < LEAST_PIXELS {
            return;
        }
        let view = ObjectView { frame, pixels: &pixels, name: object.name(), extent_m: high - low };
        self.votes.extend(describer.describe(&view));
        let step = points.len().div_ceil(MOST_POINTS).max(1);
        self.points = points.into_iter().step_by(step).collect();
    }

    /// The object as it looks now: what the map remembers of the same attributes does not count.
    fn of(&self, object: &MapObject) -> MapObject {
        let mut attributes = Attributes::default();
        for vote in &self.votes {
            attributes.add(vote.kind, vote.key, &vote.word, vote.weight);
        }
        let renewed: BTreeSet<String> = attributes.iter().map(|(_, key, _)| key.to_owned()).collect();
        for (kind, key, old) in object.attributes.iter().filter(|(_, key, _)| !renewed.contains(*key)) {
            old.iter().for_each(|(word, weight)| attributes.add(kind, key, word, weight));
        }
        MapObject { attributes, points: self.points.clone(), ..object.clone() }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a red mug that looks blue now is no red mug, whatever the map remembers; attributes that nobody looked at stay.
    use super::super::target::tests::{map_of, object};
    use super::*;
    use dsm::ground::GroundConfig;
    use dsm::map::AttributeKind;

    fn mug(id: u64, x_m: f64, color: &str) -> MapObject {
        let mut mug = object(id, [x_m, 0.0, 0.8], [0.08, 0.08, 0.1], &[]);
        mug.names.add("mug", 9.0);
        mug.attributes.add(AttributeKind::Appearance, "color", color, 20.0);
        mug.attributes.add(AttributeKind::Physical, "material", "metal", 5.0);
        mug
    }

    fn looking(color: &str) -> Look {
        let kind = AttributeKind::Appearance;
        let vote = AttributeVote { kind, key: "color", word: color.into(), weight: 1.0 };
        Look { votes: vec![vote], points: Vec::new() }
    }

    #[test]
    fn a_white_pot_with_brown_soil_is_not_the_brown_pot() {
        let fit = |share| Fit { score: 1.0, color_share: Some(share) };
        assert!(contradicts(fit(0.4), fit(0.95), false) && fit(0.2).rank() < FITS);
        assert!(!contradicts(fit(0.7), fit(0.95), false) && fit(0.7).rank() == 1.0);
        assert!(!contradicts(fit(0.4), fit(0.95), true), "nothing could have been put in its place");
        assert!(!contradicts(fit(0.2), fit(0.4), false), "it never had much of that colour");
    }

    #[test]
    fn what_was_put_in_its_place_is_not_what_was_meant() {
        let grounder = Grounder::new(GroundConfig::default(), Arc::new(Knowledge::embedded().unwrap())).unwrap();
        let score = |first: MapObject| {
            let answer = grounder.ground(&map_of(vec![first, mug(2, 1.0, "blue")]), "the red mug", None);
            assert!(speaks_of_looks(&answer));
            score_of(&answer, ObjectId(1))
        };
        let red = mug(1, 0.0, "red");
        let before = score(red.clone());
        assert!(score(looking("blue").of(&red)) < KEPT_SHARE * before);
        assert!(score(looking("red").of(&red)) > 0.8 * before);
        let now = looking("blue").of(&red);
        assert_eq!(now.attributes.find(AttributeKind::Physical, "material"), Some("metal"));
        assert!(!speaks_of_looks(&grounder.ground(&map_of(vec![red]), "the mug", None)));
        assert_eq!(find_rivals(&map_of(vec![mug(1, 0.0, "red"), mug(2, 1.0, "blue")]), ObjectId(1)), [ObjectId(2)]);
    }
}
