//! Rooms as targets and as anchors.

use super::answer::ReferenceFrame;
use super::filter::{self, Context};
use super::query::{AttributeWord, Entity, Noun, Order, RelationTerm, RelationWord};
use super::scene::{polygon_contains, polygon_distance_m};
use crate::knowledge::RoomScores;
use crate::map::Room;
use nalgebra::Point2;

/// A room reaches this far beyond its outline: map boxes of what stands at its walls stick out. Metres.
const WALL_REACH_M: f64 = 0.4;
/// Score of a room that adjoins the room in which the anchor stands.
const ADJOINING: f32 = 0.6;
/// Score of a room without a name of its own when a name is asked for.
const UNNAMED: f32 = 0.1;
/// Most that a room of another name scores.
const MISNAMED: f32 = 0.3;
/// Least that a room scores whose name is doubtful and that may be the one that is asked for.
const DOUBTFUL: f32 = 0.35;
/// Most that it scores: too little to be sure of while there is more to see.
const MOST_DOUBTFUL: f32 = 0.7;
/// Share of the votes of its likeliest name from which a room may be the one that is asked for.
const WORTH_A_TRY: f32 = 0.1;
/// A room is sure of its name when something that marks it is there as surely as this.
const MARKED: f32 = 0.5;

/// One constraint on rooms and how well each room meets it.
pub(super) struct RoomFactor {
    pub(super) label: String,
    pub(super) scores: Vec<f32>,
}

/// How well each room of the map fits an entity whose noun is a room.
pub(super) fn evaluate(context: Context<'_, '_>, entity: &Entity, frame: &mut ReferenceFrame) -> Vec<RoomFactor> {
    let rooms = &context.scene.map.rooms;
    let asked = match &entity.noun {
        Noun::Room(name) => name.as_str(),
        _ => "room",
    };
    let mut factors = vec![RoomFactor { label: format!("is a {asked}"), scores: name_scores(context, asked) }];
    for term in entity.attributes.iter().filter(|term| term.kind == AttributeWord::Size) {
        let larger = |room: &Room| rooms.iter().filter(|other| other.area_m2 < room.area_m2).count();
        let share = |room: &Room| larger(room) as f32 / rooms.len().saturating_sub(1).max(1) as f32;
        let small = matches!(term.word.as_str(), "small" | "narrow" | "short");
        let score = |room: &Room| 0.3 + 0.7 * if small { 1.0 - share(room) } else { share(room) };
        factors.push(RoomFactor { label: term.word.clone(), scores: rooms.iter().map(score).collect() });
    }
    for term in &entity.relations {
        let scores = anchored_scores(context, term, frame);
        let anchors: Vec<String> = term.anchors.iter().map(Entity::phrase).collect();
        let label = format!("{} the {}", term.word.phrase(), anchors.join(" and the "));
        let finished = |score: f32| if term.negated { 1.0 - score } else { score }.max(context.config.relation_floor);
        factors.push(RoomFactor { label, scores: scores.into_iter().map(finished).collect() });
    }
    for selection in &entity.selections {
        let (scores, label) = match selection.order {
            Order::Central | Order::Middle => (centrality(rooms), "central".to_owned()),
            order => {
                let total: Vec<f32> = (0..rooms.len()).map(|i| factors.iter().map(|f| f.scores[i]).product()).collect();
                let (eye, eye_frame) = context.scene.standpoint();
                let view = context.scene.view_to(context.scene.center);
                let key = |room: &Room| match order {
                    Order::Nearest => (room.center - eye).norm(),
                    Order::Farthest => -(room.center - eye).norm(),
                    Order::Leftmost => -(room.center - eye).dot(&view.left),
                    Order::Rightmost => (room.center - eye).dot(&view.left),
                    Order::Smallest | Order::Shortest => room.area_m2,
                    _ => -room.area_m2,
                };
                if matches!(order, Order::Nearest | Order::Farthest | Order::Leftmost | Order::Rightmost) {
                    *frame = eye_frame;
                }
                let keys: Vec<f64> = rooms.iter().map(key).collect();
                let label = super::select::phrase(selection);
                (super::select::rank_scores(&keys, &total, selection.rank, 0.4, 0.01), label)
            }
        };
        factors.push(RoomFactor { label, scores });
    }
    factors
}

/// How well each room fits a name: by its own name or, when no room bears the one that is asked for, by what it holds.
///
/// Names come from what is seen in a room, and a room is seldom without what marks it, nor does a flat often have two of
/// one kind. A room that holds nothing of what marks its own name, that shares its name with one that fits it better, or
/// that holds what marks the other name as well, may be the one that is meant.
fn name_scores(context: Context<'_, '_>, asked: &str) -> Vec<f32> {
    let rooms = &context.scene.map.rooms;
    let own_name = |room: &Room| context.knowledge.words().rooms.find(&room.name).unwrap_or(&room.name).to_owned();
    let names: Vec<String> = rooms.iter().map(own_name).collect();
    if asked == "room" {
        return vec![1.0; rooms.len()];
    }
    let by_content = |room: &Room| {
        let holds = context.scene.items.iter().enumerate().filter(|(i, _)| stands_in(context, *i, room));
        let things = holds.filter_map(|(i, item)| Some((context.scene.categories[i]?, item.object.confidence())));
        context.knowledge.score_room_names(things)
    };
    let contents: Vec<RoomScores<'_>> = rooms.iter().map(by_content).collect();
    let borne = names.iter().any(|name| name == asked);
    let score = |i: usize| {
        let (name, content) = (names[i].as_str(), &contents[i]);
        let share = content.share(asked);
        if name == asked {
            return 1.0;
        }
        if name == "room" {
            return (1.2 * share).clamp(UNNAMED, 0.9);
        }
        let fits_better = |other: usize| {
            names[other] == name
                && other != i
                && contents[other].mark(name) >= content.mark(name)
                && contents[other].votes(name) > content.votes(name)
        };
        let doubtful =
            content.mark(name) < MARKED || content.mark(asked) >= MARKED || (0..rooms.len()).any(fits_better);
        if !borne && doubtful && share >= WORTH_A_TRY {
            return DOUBTFUL + (MOST_DOUBTFUL - DOUBTFUL) * share;
        }
        (0.6 * (share - 0.5)).clamp(0.02, MISNAMED)
    };
    (0..rooms.len()).map(score).collect()
}

fn stands_in(context: Context<'_, '_>, item: usize, room: &Room) -> bool {
    context.scene.room_of(item).is_some_and(|found| found.id == room.id)
}

/// How close to the middle of all rooms a room lies and how many rooms it leads to, relative to the most central one.
///
/// The share of rooms that it adjoins counts as much as the distance of its centre from the area-weighted middle of all
/// rooms, in units of the widest such distance.
fn centrality(rooms: &[Room]) -> Vec<f32> {
    let area: f64 = rooms.iter().map(|room| room.area_m2.max(1e-3)).sum();
    let weighted = rooms.iter().map(|room| room.center.coords * room.area_m2.max(1e-3)).sum::<nalgebra::Vector2<f64>>();
    let middle = Point2::from(weighted / area.max(1e-3));
    let distance = |room: &Room| (room.center - middle).norm();
    let widest = rooms.iter().map(distance).fold(1e-6, f64::max);
    let most = rooms.iter().map(|room| room.neighbours.len()).max().unwrap_or(0).max(1) as f64;
    let raw = |room: &Room| 0.5 * room.neighbours.len() as f64 / most + 0.5 * (1.0 - distance(room) / widest);
    let best = rooms.iter().map(raw).fold(1e-6, f64::max);
    rooms.iter().map(|room| (0.1 + 0.9 * raw(room) / best) as f32).collect()
}

/// How a room lies to a place in it or near it.
fn room_to_place(rooms: &[Room], room: &Room, home: Option<&Room>, place: &Point2<f64>, word: RelationWord) -> f32 {
    let is_home = home.is_some_and(|home| home.id == room.id) || polygon_contains(&room.polygon, place);
    let adjoins = home.is_some_and(|home| home.neighbours.contains(&room.id) || room.neighbours.contains(&home.id))
        || polygon_distance_m(&room.polygon, place) < 2.0 * WALL_REACH_M;
    let holds = if is_home { 1.0 } else { 0.0 };
    match word {
        RelationWord::With | RelationWord::In | RelationWord::On => holds,
        RelationWord::Far => 1.0 - holds,
        RelationWord::Closest => {
            let nearest = rooms.iter().map(|r| (r.center - place).norm()).fold(f64::INFINITY, f64::min);
            f32::max(holds, (nearest / (room.center - place).norm().max(1e-6)) as f32 * 0.5)
        }
        // "the room next to the desk" holds it or adjoins it.
        _ if is_home => 1.0,
        _ if adjoins => ADJOINING,
        _ => 0.0,
    }
}

/// Scores of all rooms for a relation to an object or to another room.
fn anchored_scores(context: Context<'_, '_>, term: &RelationTerm, frame: &mut ReferenceFrame) -> Vec<f32> {
    let scene = context.scene;
    let rooms = &scene.map.rooms;
    let mut best = vec![1.0_f32; rooms.len()];
    for anchor in &term.anchors {
        let scores: Vec<f32> = if matches!(anchor.noun, Noun::Room(_)) {
            let anchor_scores = product(&evaluate(context, anchor, frame), rooms.len());
            let score = |room: &Room| {
                let to = |(other, score): (&Room, &f32)| {
                    let adjoins = other.neighbours.contains(&room.id) || room.neighbours.contains(&other.id);
                    if other.id == room.id { 0.0 } else { score * if adjoins { 1.0 } else { 0.1 } }
                };
                rooms.iter().zip(&anchor_scores).map(to).fold(0.0, f32::max)
            };
            rooms.iter().map(score).collect()
        } else {
            let anchors = filter::evaluate(context, anchor);
            if anchors.frame != ReferenceFrame::None {
                *frame = anchors.frame;
            }
            let strong: Vec<(usize, f32)> =
                anchors.total.iter().copied().enumerate().filter(|(_, score)| *score > 0.05).collect();
            let score = |room: &Room| {
                let to = |(item, score): &(usize, f32)| {
                    let place = scene.items[*item].bounds.center().xy();
                    score.sqrt() * room_to_place(rooms, room, scene.room_of(*item), &place, term.word)
                };
                strong.iter().map(to).fold(0.0, f32::max)
            };
            rooms.iter().map(score).collect()
        };
        for (best, score) in best.iter_mut().zip(scores) {
            *best = best.min(score);
        }
    }
    best
}

/// Product of all factors by room.
pub(super) fn product(factors: &[RoomFactor], rooms: usize) -> Vec<f32> {
    (0..rooms).map(|i| factors.iter().map(|factor| factor.scores[i]).product()).collect()
}

/// How well each object stands in (or next to) the room of a relation, by item, and whether the map is sure of it: rooms
/// are named by what they hold, so that a room of a name that none bears may be any.
pub(super) fn relation_to_room(
    context: Context<'_, '_>,
    term: &RelationTerm,
    frame: &mut ReferenceFrame,
) -> (Vec<f32>, bool) {
    let scene = context.scene;
    let rooms = &scene.map.rooms;
    if rooms.is_empty() {
        // Nothing is known about rooms: the words neither help nor refuse.
        return (vec![context.config.unknown_anchor; scene.items.len()], true);
    }
    let factors = evaluate(context, &term.anchors[0], frame);
    let sure = factors[0].scores.iter().any(|score| *score > MISNAMED);
    let mut anchors = product(&factors, rooms.len());
    if !sure {
        // A flat seldom has two rooms of one name: one of them is misnamed.
        let shares_name = |room: &Room| rooms.iter().filter(|other| other.name == room.name).count() > 1;
        for (room, score) in rooms.iter().zip(&mut anchors) {
            *score = context.config.violated_below * if shares_name(room) { 0.9 } else { 0.45 } + 0.05 * *score;
        }
    }
    let score = |item: usize| {
        let home = scene.room_of(item);
        let place = scene.items[item].bounds.center().xy();
        let to = |(room, score): (&Room, &f32)| {
            let word =
                if matches!(term.word, RelationWord::In | RelationWord::On) { RelationWord::In } else { term.word };
            score * room_to_place(rooms, room, home, &place, word)
        };
        rooms.iter().zip(&anchors).map(to).fold(0.0, f32::max)
    };
    ((0..scene.items.len()).map(score).collect(), sure)
}

/// Distance in metres from each object to the likeliest room of an entity, 0 inside it; `None` when no room fits.
pub(super) fn distances_m(context: Context<'_, '_>, entity: &Entity, frame: &mut ReferenceFrame) -> Vec<Option<f64>> {
    let rooms = &context.scene.map.rooms;
    let scores = product(&evaluate(context, entity, frame), rooms.len());
    let best = (rooms.iter().zip(scores)).filter(|(_, score)| *score >= context.config.violated_below);
    let best = best.fold(None, |best: Option<(&Room, f32)>, found| match best {
        Some(best) if best.1 >= found.1 => Some(best),
        _ => Some(found),
    });
    let distance = |(item, (room, _)): (usize, (&Room, f32))| {
        let place = context.scene.items[item].bounds.center().xy();
        if polygon_contains(&room.polygon, &place) { 0.0 } else { polygon_distance_m(&room.polygon, &place) }
    };
    (0..context.scene.items.len()).map(|item| best.map(|best| distance((item, best)))).collect()
}
