//! Search: explore until the words point at one thing, or until all has been seen.

use super::explore::{ExploreOutcome, Explorer, Interest};
use crate::agent::{Agent, Halt};
use dsm::ground::{
    Article, AttributeWord, Entity, Grounder, Grounding, GroundingStatus, Noun, Query, RelationTerm, RelationWord,
};
use dsm::knowledge::Knowledge;
use dsm::map::{AttributeKind, Map, MapObject, ObjectId};
use dsm::time::{Span, Stamp};
use nalgebra::{Point2, Point3};
use std::sync::Arc;

/// Exploration stops early only for a grounding that scores at least this.
const SURE_SCORE: f32 = 0.72;
/// ... and that has pointed at the same thing for this long.
const SURE_FOR: Span = Span(3_000_000_000);
/// ... and that was seen in so many frames: attributes of what was glimpsed are not worth much.
const SURE_OBSERVATIONS: u32 = 12;
/// Words are grounded this often while exploring.
const GROUND_EVERY: Span = Span(1_000_000_000);

/// When time is up before all has been seen, the last of it goes to a second look at what the words name.
pub const LAST_LOOKS: Span = Span(25_000_000_000);
/// So many objects are looked at again before the words are refused.
const MOST_LOOKS: usize = 8;
/// ... and so many carriers before the only one of its name is taken for the closest.
const FEW_LOOKS: usize = 4;
/// Smallest footprint of what carries other things, square metres, and the heights of its top, metres.
const CARRIER_M2: f64 = 0.1;
const CARRIER_TOP_M: (f64, f64) = (0.3, 1.4);

/// How much is looked at before an answer counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thoroughness {
    /// Until the words point at one thing.
    Enough,
    /// All that can be reached.
    Everything,
}

/// Whether words can point at one thing before all has been seen: not when nothing is said about it but its name, nor
/// when it is said by comparison with everything else.
fn can_be_settled_early(query: &Query) -> bool {
    let target = &query.target;
    let compares = target.relations.iter().any(|term| is_comparison(term) || term.word == RelationWord::Between);
    let says_more = !target.attributes.is_empty() || !target.relations.is_empty();
    let any_will_do = target.article == Article::Indefinite;
    target.selections.is_empty() && !compares && (says_more || any_will_do)
}

/// Grounds `text`, exploring as long as the answer is not sure and something is left to see before `end`. Before it says
/// that nothing fits, too much does, or one does hardly, it looks once more from other sides where the words say that the
/// thing is.
pub fn search(
    agent: &mut Agent,
    explorer: &mut Explorer,
    grounder: &Arc<Grounder>,
    knowledge: &Knowledge,
    text: &str,
    thoroughness: Thoroughness,
    end: Stamp,
) -> Result<Grounding, Halt> {
    if thoroughness == Thoroughness::Enough && explorer.is_complete() {
        // On a finished map what is plain needs no further look; a small thing nearer to what is named may be missed.
        let known = answer(agent, grounder, text)?;
        if is_sure(&known) && !(says_closest(&known) && is_small(agent.map(), &known)) {
            return Ok(known);
        }
    }
    // A model would be asked anew with every map; it speaks when an answer counts.
    let plain = grounder.without_backends();
    let mut grounded_at = Stamp(i64::MIN / 2);
    let mut same_since: Option<(Stamp, Option<u64>, Option<u32>)> = None;
    let mut enough = |map: &Arc<Map>| {
        if map.stamp - grounded_at < GROUND_EVERY {
            return false;
        }
        grounded_at = map.stamp;
        let grounding = plain.ground(map, text, None);
        if grounding.status == GroundingStatus::Unparsed {
            return true;
        }
        // A room is only known when the flat is.
        if grounding.status != GroundingStatus::Found || grounding.score < SURE_SCORE || grounding.room_id.is_some() {
            same_since = None;
            return false;
        }
        let early = grounding.query.as_ref().is_some_and(can_be_settled_early);
        let seen = grounding.object_id.and_then(|id| map.find_object(id)).map_or(0, |object| object.observations);
        if thoroughness == Thoroughness::Everything || !early || seen < SURE_OBSERVATIONS {
            return false;
        }
        let target = (grounding.object_id.map(|id| id.0), grounding.room_id.map(|id| id.0));
        match same_since {
            Some((since, object, room)) if (object, room) == target => map.stamp - since >= SURE_FOR,
            _ => {
                same_since = Some((map.stamp, target.0, target.1));
                false
            }
        }
    };
    let named = named_in(knowledge, plain.ground(agent.map(), text, None).query.as_ref());
    let inspect = |map: &Map| named.find_in(map, knowledge);
    let mut explored =
        explorer.run(agent, end + Span(-LAST_LOOKS.0), Interest { enough: &mut enough, inspect: &inspect })?;
    let mut last = answer(agent, grounder, text)?;
    if explored == ExploreOutcome::TimeUp && named.find_doubtful(agent.map(), knowledge, &last).is_empty() {
        explored = explorer.run(agent, end, Interest { enough: &mut enough, inspect: &inspect })?;
        last = answer(agent, grounder, text)?;
    }
    if explored != ExploreOutcome::Enough {
        agent.mark(format!("exploration ends: {explored:?}"));
        for objects in named.find_doubtful(agent.map(), knowledge, &last) {
            explorer.look_again(agent, end, &objects, &mut enough)?;
            last = answer(agent, grounder, text)?;
            if is_sure(&last) {
                break;
            }
        }
    }
    if last.status != GroundingStatus::Absent {
        return Ok(last);
    }
    look_where_it_probably_is(agent, explorer, knowledge, (grounder, text), (&named, end), &mut enough)
}

/// Looks on one carrier after the other, the likeliest and nearest first, for a thing of which nothing is said but what it is.
fn look_where_it_probably_is(
    agent: &mut Agent,
    explorer: &mut Explorer,
    knowledge: &Knowledge,
    (grounder, text): (&Arc<Grounder>, &str),
    (named, end): (&Named, Stamp),
    enough: &mut dyn FnMut(&Arc<Map>) -> bool,
) -> Result<Grounding, Halt> {
    let mut last = answer(agent, grounder, text)?;
    if last.query.as_ref().is_none_or(|query| !query.target.relations.is_empty()) {
        return Ok(last);
    }
    let here = agent.world_from_base()?.translation.vector.xy().into();
    for likely in find_likely(agent.map(), knowledge, named, &here) {
        if last.status != GroundingStatus::Absent || agent.now() >= end {
            break;
        }
        agent.note(format!("looks at object {} ({}) first: {}", likely.id.0, likely.name, likely.reason));
        explorer.look_again(agent, end, &[likely.id], enough)?;
        last = answer(agent, grounder, text)?;
    }
    Ok(last)
}

/// Whether the words compare things of one name and the map holds only one of them.
fn compares_but_one(answer: &Grounding) -> bool {
    let compares =
        |query: &Query| !query.target.selections.is_empty() || query.target.relations.iter().any(is_comparison);
    answer.candidates.len() == 1 && answer.query.as_ref().is_some_and(compares)
}

/// Whether the words ask for the closest of several.
fn says_closest(answer: &Grounding) -> bool {
    let is_closest = |relation: &RelationTerm| relation.word == RelationWord::Closest;
    answer.query.as_ref().is_some_and(|query| query.target.relations.iter().any(is_closest))
}

/// Whether the answer is a thing that exploring can miss; furniture is not.
fn is_small(map: &Map, answer: &Grounding) -> bool {
    const SMALL_M: f64 = 0.3;
    let object = answer.object_id.and_then(|id| map.find_object(id));
    object.is_some_and(|object| object.bounds.size.max() < SMALL_M)
}

fn is_comparison(relation: &RelationTerm) -> bool {
    matches!(relation.word, RelationWord::Closest | RelationWord::Farthest)
}

/// Whether an answer needs no further look.
fn is_sure(answer: &Grounding) -> bool {
    answer.status == GroundingStatus::Found && answer.score >= SURE_SCORE
}

/// What the words mean in the map as it is.
fn answer(agent: &mut Agent, grounder: &Arc<Grounder>, text: &str) -> Result<Grounding, Halt> {
    let viewer = agent.world_from_base()?;
    let (map, grounder, text) = (agent.map().clone(), grounder.clone(), text.to_owned());
    agent.plan(move || {
        // Left and right mean the same from wherever the robot happens to be; only "a mug" is the one nearest to it.
        let plain = grounder.ground(&map, &text, None);
        let definite = plain.query.as_ref().is_none_or(|query| query.target.article != Article::Indefinite);
        match plain.status {
            GroundingStatus::Found if definite => plain,
            _ => grounder.ground(&map, &text, Some(&viewer)),
        }
    })
}

/// A carrier on which a thing may be.
struct Likely {
    id: ObjectId,
    name: String,
    reason: String,
}

/// Carriers on which the thing that is asked for probably is, by chance and by how far they are from `here`.
fn find_likely(map: &Map, knowledge: &Knowledge, named: &Named, here: &Point2<f64>) -> Vec<Likely> {
    /// So many are looked at; what it costs to look at one that is right here, as a way in metres; the least chance.
    const MOST: usize = 4;
    const LOOK_M: f64 = 3.0;
    const LEAST: f32 = 0.3;
    let Some(thing) = named.things.first().and_then(|(name, _)| knowledge.find(name)) else { return Vec::new() };
    let likely = |object: &MapObject| {
        let furniture = knowledge.find(object.name())?;
        let room = object.room.and_then(|id| map.find_room(id)).map(|room| room.name.as_str());
        let place = knowledge.find_chance(thing, furniture, room);
        let way_m = (object.bounds.center.xy() - here).norm() + LOOK_M;
        let likely = Likely { id: object.id, name: object.name().to_owned(), reason: place.reason };
        (place.chance >= LEAST).then_some((f64::from(place.chance) / way_m, likely))
    };
    let mut all: Vec<(f64, Likely)> =
        map.stable_objects().filter(|object| carries(object)).filter_map(likely).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.id.cmp(&b.1.id)));
    all.into_iter().take(MOST).map(|(_, likely)| likely).collect()
}

/// The best candidates of an answer that cannot tell them apart.
fn find_rivals(grounding: &Grounding) -> Vec<ObjectId> {
    /// As good as the best for one who doubts.
    const SHARE: f32 = 0.6;
    let best = grounding.candidates.iter().map(|candidate| candidate.score).fold(0.0, f32::max);
    let rivals = grounding.candidates.iter().filter(|candidate| candidate.score >= SHARE * best);
    rivals.filter_map(|candidate| candidate.object_id).take(MOST_LOOKS).collect()
}

/// The things that a sentence mentions: category, and the colours said of it.
struct Named {
    /// The things, the one that is asked for first if it is known by name.
    things: Vec<(String, Vec<String>)>,
    /// Rooms in which they are said to be.
    rooms: Vec<String>,
}

/// Where a sentence says that something is, it is worth to look from near: a small thing on a white shelf is only found
/// by looking at white shelves.
fn named_in(knowledge: &Knowledge, query: Option<&Query>) -> Named {
    let (mut things, mut rooms) = (Vec::new(), Vec::new());
    let mut open: Vec<&Entity> = query.iter().map(|query| &query.target).collect();
    while let Some(entity) = open.pop() {
        open.extend(entity.relations.iter().flat_map(|relation| &relation.anchors));
        if let Noun::Room(name) = &entity.noun {
            rooms.push(name.clone());
        }
        let Noun::Thing(word) = &entity.noun else { continue };
        let Some(category) = knowledge.find(word) else { continue };
        let colors = entity.attributes.iter().filter(|term| term.kind == AttributeWord::Color && !term.negated);
        things.push((category.name.clone(), colors.map(|term| term.word.clone()).collect()));
    }
    Named { things, rooms }
}

impl Named {
    /// What is worth a second look before an answer counts, in groups of which one after the other is looked at; none when
    /// the answer is plain.
    fn find_doubtful(&self, map: &Map, knowledge: &Knowledge, answer: &Grounding) -> Vec<Vec<ObjectId>> {
        let groups = match answer.status {
            GroundingStatus::Unparsed => Vec::new(),
            // Who says "the closest" knows of another one, which may be closer.
            GroundingStatus::Found if compares_but_one(answer) => vec![self.find_carriers(map, knowledge, None)],
            // So may one that nobody has seen yet, on what stands nearer.
            GroundingStatus::Found if says_closest(answer) => {
                vec![self.find_carriers(map, knowledge, answer.object_id)]
            }
            GroundingStatus::Found if is_sure(answer) => Vec::new(),
            GroundingStatus::Ambiguous => vec![find_rivals(answer)],
            // What is only nearly as the words say is taken when a second look shows nothing better.
            GroundingStatus::Found | GroundingStatus::Absent => {
                let mut places = self.find_places(map, knowledge);
                let anchors = Self { things: self.things.iter().skip(1).cloned().collect(), rooms: Vec::new() };
                let anchors = anchors.find_in(map, knowledge);
                let there = places.extract_if(.., |id| anchors.contains(id)).collect();
                vec![there, places]
            }
        };
        groups.into_iter().filter(|group: &Vec<ObjectId>| !group.is_empty()).collect()
    }

    /// Objects of the map that may be one of the things.
    fn find_in(&self, map: &Map, knowledge: &Knowledge) -> Vec<ObjectId> {
        let fits = |object: &&MapObject| {
            let votes = object.attributes.find_votes(AttributeKind::Appearance, "color");
            // Light changes how colours look, so that a tenth of the votes is worth a look.
            let has = |color: &String| votes.is_some_and(|votes| votes.share(color) >= 0.1);
            let is = |name: &str| {
                object.name() == name || knowledge.find(object.name()).is_some_and(|category| category.is_a(name))
            };
            self.things.iter().any(|(name, colors)| is(name) && (colors.is_empty() || colors.iter().any(has)))
        };
        map.stable_objects().filter(fits).map(|object| object.id).collect()
    }
    /// Where a thing that was not found may be all the same: what is named, whatever its colour, and what can carry
    /// things in the rooms that are named.
    fn find_places(&self, map: &Map, knowledge: &Knowledge) -> Vec<ObjectId> {
        let named =
            Self { things: self.things.iter().map(|(name, _)| (name.clone(), Vec::new())).collect(), rooms: vec![] };
        let mut places = named.find_in(map, knowledge);
        let is_there = |object: &MapObject| {
            let room = object.room.and_then(|id| map.find_room(id));
            room.is_some_and(|room| self.rooms.contains(&room.name))
        };
        let carriers =
            map.stable_objects().filter(|object| is_there(object) && carries(object)).map(|object| object.id);
        let carriers: Vec<ObjectId> = carriers.filter(|id| !places.contains(id)).collect();
        places.extend(carriers);
        places.truncate(MOST_LOOKS);
        places
    }

    /// What can carry things, the nearest to the named anchors first; only what is nearer than an object, if one is given.
    fn find_carriers(&self, map: &Map, knowledge: &Knowledge, nearer_than: Option<ObjectId>) -> Vec<ObjectId> {
        let anchors = Self { things: self.things.iter().skip(1).cloned().collect(), rooms: Vec::new() };
        let anchors = anchors.find_in(map, knowledge);
        let centers: Vec<_> = anchors.iter().filter_map(|id| Some(map.find_object(*id)?.bounds.center)).collect();
        let distance_m = |object: &MapObject| {
            let bounds = object.bounds.aabb();
            let gap_m = |center: &Point3<f64>| {
                let nearest =
                    Point2::new(center.x.clamp(bounds.min.x, bounds.max.x), center.y.clamp(bounds.min.y, bounds.max.y));
                (center.xy() - nearest).norm()
            };
            centers.iter().map(gap_m).fold(f64::INFINITY, f64::min)
        };
        let most_m = nearer_than.and_then(|id| map.find_object(id)).map_or(f64::INFINITY, distance_m);
        let carriers = map.stable_objects().filter(|object| carries(object) && !anchors.contains(&object.id));
        let mut near: Vec<(f64, ObjectId)> = carriers.map(|object| (distance_m(object), object.id)).collect();
        near.retain(|(distance_m, _)| *distance_m < most_m);
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.into_iter().take(FEW_LOOKS).map(|(_, id)| id).collect()
    }
}

/// Whether a thing can carry others.
fn carries(object: &MapObject) -> bool {
    let (size, top_m) = (object.bounds.size, object.bounds.top_m());
    size.x * size.y >= CARRIER_M2 && (CARRIER_TOP_M.0..CARRIER_TOP_M.1).contains(&top_m)
}

#[cfg(test)]
mod tests {
    //! Contract: what only nearly fits is looked at again.
    use super::super::target::tests::{map_of, object};
    use super::*;
    use dsm::ground::{GroundConfig, ReferenceFrame};
    use dsm::map::{MapChange, MapUpdate};

    #[test]
    fn an_orange_on_a_shelf_is_not_at_once_the_one_on_the_cabinet() {
        let answer = |status, score| Grounding {
            status,
            object_id: Some(ObjectId(331)),
            room_id: None,
            score,
            candidates: Vec::new(),
            decided_by: String::new(),
            frame: ReferenceFrame::None,
            backend: String::new(),
            spoken: Vec::new(),
            query: None,
        };
        // A shelf is half a cabinet to the words; the orange on the cabinet had not been seen yet.
        assert!(!is_sure(&answer(GroundingStatus::Found, 0.55)));
        assert!(is_sure(&answer(GroundingStatus::Found, 0.94)));
        assert!(!is_sure(&answer(GroundingStatus::Ambiguous, 0.94)));
    }

    #[test]
    fn the_only_ball_is_not_at_once_the_closest_one() {
        let named = |id, name: &str, center, size| {
            let mut object = object(id, center, size, &[]);
            object.names.add(name, 9.0);
            object
        };
        let ball = |id, x_m| named(id, "ball", [x_m, 2.0, 0.5], [0.08; 3]);
        let map = map_of(vec![
            named(1, "laundry basket", [4.0, 0.0, 0.3], [0.4, 0.4, 0.6]),
            named(2, "bookshelf", [2.0, 0.0, 0.7], [0.9, 0.3, 1.3]),
            named(3, "coffee table", [-3.0, 2.0, 0.2], [0.8, 0.5, 0.4]),
            ball(4, 1.6),
        ]);
        let knowledge = Arc::new(Knowledge::embedded().unwrap());
        let grounder = Grounder::new(GroundConfig { verify: false, ..Default::default() }, knowledge.clone()).unwrap();
        let text = "the ball closest to the laundry basket";
        let answer = grounder.ground(&map, text, None);
        assert!(is_sure(&answer) && compares_but_one(&answer));
        let looks = named_in(&knowledge, answer.query.as_ref()).find_carriers(&map, &knowledge, None);
        assert_eq!(looks, [2, 3].map(ObjectId), "the bookshelf is the nearest place where another one may lie");
        let mut two = (*map).clone();
        let changes = vec![MapChange::Put(Box::new(ball(5, 3.0)))];
        two.apply(MapUpdate { stamp: Stamp::default(), changes });
        let answer = grounder.ground(&two, text, None);
        assert!(!compares_but_one(&answer) && says_closest(&answer));
        // A third one may lie on the bookshelf; on the coffee table it would not be the closest.
        let looks = named_in(&knowledge, answer.query.as_ref()).find_carriers(&two, &knowledge, answer.object_id);
        assert_eq!(looks, [ObjectId(2)]);
    }

    #[test]
    fn the_nightstand_is_looked_at_before_other_cups() {
        let named = |id, name: &str, x_m, size_m| {
            let mut object = object(id, [x_m, 0.0, 0.5 * size_m], [size_m; 3], &[]);
            object.names.add(name, 9.0);
            object
        };
        let map =
            map_of(vec![named(1, "cup", 1.0, 0.08), named(2, "sofa", 3.0, 0.9), named(3, "nightstand", 5.0, 0.45)]);
        let knowledge = Arc::new(Knowledge::embedded().unwrap());
        let grounder = Grounder::new(GroundConfig { verify: false, ..Default::default() }, knowledge.clone()).unwrap();
        let answer = grounder.ground(&map, "the cup on the nightstand", None);
        assert!(!is_sure(&answer), "{answer:?}");
        let looks = named_in(&knowledge, answer.query.as_ref()).find_doubtful(&map, &knowledge, &answer);
        assert_eq!(looks, [vec![ObjectId(3)], vec![ObjectId(1)]]);
        let answer = grounder.ground(&map, "the sofa", None);
        assert!(named_in(&knowledge, answer.query.as_ref()).find_doubtful(&map, &knowledge, &answer).is_empty());
    }

    #[test]
    fn a_mug_is_looked_for_on_the_counter_before_the_bed() {
        let furniture = |id, name: &str, x_m| {
            let mut object = object(id, [x_m, 0.0, 0.4], [0.8, 0.6, 0.8], &[]);
            object.names.add(name, 9.0);
            object
        };
        let map = map_of(vec![furniture(1, "bed", 1.0), furniture(2, "counter", 3.0), furniture(3, "counter", 9.0)]);
        let knowledge = Knowledge::embedded().unwrap();
        let named = Named { things: vec![("mug".into(), Vec::new())], rooms: Vec::new() };
        let likely = find_likely(&map, &knowledge, &named, &Point2::origin());
        let ids: Vec<u64> = likely.iter().map(|likely| likely.id.0).collect();
        assert!(ids.first() == Some(&2) && !ids.contains(&1), "{ids:?}");
        let unknown = Named { things: Vec::new(), rooms: Vec::new() };
        assert!(find_likely(&map, &knowledge, &unknown, &Point2::origin()).is_empty());
    }
}
