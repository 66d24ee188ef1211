//! What a room is called by what stands in it.

use super::{Category, Knowledge};
use std::collections::{BTreeMap, BTreeSet};

/// Share of its votes that a name keeps when the room holds nothing that marks it: what a room is rarely without is seldom
/// all missed.
const UNMARKED_SHARE: f32 = 0.2;
/// Votes for a name by each sort of thing that marks it.
const MARKED: f32 = 1.0;
/// Fewer votes name no room.
const LEAST: f32 = 0.5;
/// Share of its best name's votes from which a room may bear its second one, when another room bears the best.
const SECOND_SHARE: f32 = 0.3;

/// How well each name fits a room by what stands in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoomScores<'a> {
    /// Votes by name.
    votes: BTreeMap<&'a str, f32>,
    /// How surely something that marks it is there, by name, 0 to 1.
    marked: BTreeMap<&'a str, f32>,
}

impl<'a> RoomScores<'a> {
    /// The likeliest name; `None` when the things say little.
    pub fn best(&self) -> Option<&'a str> {
        let best = self.votes.iter().fold(None, |best: Option<(&str, f32)>, (room, votes)| match best {
            Some(best) if best.1 >= *votes => Some(best),
            _ => Some((room, *votes)),
        });
        best.filter(|(_, votes)| *votes >= LEAST).map(|(room, _)| room)
    }

    /// The likeliest name that is not one of `taken` and has votes enough to stand for the best.
    fn find_second(&self, taken: &BTreeSet<&str>) -> Option<&'a str> {
        let most = self.votes.values().copied().fold(LEAST, f32::max);
        let others = self
            .votes
            .iter()
            .filter(|(room, votes)| !taken.contains(*room) && **votes >= LEAST && **votes >= SECOND_SHARE * most);
        let best = others.fold(None, |best: Option<(&str, f32)>, (room, votes)| match best {
            Some(best) if best.1 >= *votes => Some(best),
            _ => Some((room, *votes)),
        });
        best.map(|(room, _)| room)
    }

    /// Votes for a name, from 0.
    pub fn votes(&self, room: &str) -> f32 {
        self.votes.get(room).copied().unwrap_or(0.0)
    }

    /// How well a name fits compared with the likeliest one, 0 to 1.
    pub fn share(&self, room: &str) -> f32 {
        let most = self.votes.values().copied().fold(LEAST, f32::max);
        self.votes(room) / most
    }

    /// How surely something that marks the name is there, 0 to 1.
    pub fn mark(&self, room: &str) -> f32 {
        self.marked.get(room).copied().unwrap_or(0.0)
    }
}

impl Knowledge {
    /// How well each name fits a room that holds these things (category and confidence, 0 to 1).
    ///
    /// Each thing votes for the rooms in which it is usual, one vote together. A name wins a vote for each sort of thing
    /// that marks it, and keeps a fifth of its votes when none of them is there (no bathroom without toilet, bathtub or
    /// shower). Some rooms have nothing that they are rarely without: they keep all votes.
    pub fn score_room_names<'a>(&'a self, things: impl Iterator<Item = (&'a Category, f32)>) -> RoomScores<'a> {
        let words = self.words();
        let mut scores = RoomScores::default();
        let mut seen: BTreeMap<&str, f32> = BTreeMap::new();
        for (category, confidence) in things {
            // A thing found in many kinds of room says little about any of them.
            for room in &category.rooms {
                *scores.votes.entry(room).or_insert(0.0) += confidence / category.rooms.len() as f32;
            }
            let best = seen.entry(&category.name).or_insert(0.0);
            *best = best.max(confidence);
        }
        for (room, votes) in &mut scores.votes {
            let Some(marks) = words.room_marks.get(*room) else { continue };
            let found: Vec<f32> = marks.iter().filter_map(|mark| seen.get(mark.as_str()).copied()).collect();
            let mark = found.iter().copied().fold(0.0, f32::max);
            let kept = if words.unmarked_rooms.contains(*room) { 1.0 } else { UNMARKED_SHARE };
            *votes = *votes * (kept + (1.0 - kept) * mark) + MARKED * found.iter().sum::<f32>();
            scores.marked.insert(room, mark);
        }
        scores
    }

    /// Names for rooms of one home, by room; `None` where the things say little.
    ///
    /// A home seldom has two kitchens or two living rooms. Of rooms that claim one such name, the one keeps it whose second
    /// name is farthest behind; the others take their second one, if that has votes enough.
    pub fn name_rooms<'a>(&self, rooms: &[RoomScores<'a>]) -> Vec<Option<&'a str>> {
        let mut names: Vec<Option<&str>> = rooms.iter().map(RoomScores::best).collect();
        let mut refused: Vec<BTreeSet<&str>> = vec![BTreeSet::new(); rooms.len()];
        // Each round settles a claim or takes a name from a room for good.
        let mut settled: BTreeSet<usize> = BTreeSet::new();
        loop {
            let is_unique = |name: &str| name != "room" && !self.words().repeated_rooms.contains(name);
            let claims = |name: &str| (0..rooms.len()).filter(|i| names[*i] == Some(name)).collect::<Vec<_>>();
            let contested = (0..rooms.len()).filter(|i| !settled.contains(i)).find_map(|i| {
                let name = names[i].filter(|name| is_unique(name))?;
                let rivals = claims(name);
                (rivals.len() > 1).then_some((name, rivals))
            });
            let Some((name, rivals)) = contested else { return names };
            let second = |i: usize| {
                let mut taken = refused[i].clone();
                taken.insert(name);
                rooms[i].find_second(&taken)
            };
            let margin = |i: usize| rooms[i].votes(name) - second(i).map_or(0.0, |second| rooms[i].votes(second));
            let keeper = rivals.iter().copied().reduce(|a, b| if margin(b) > margin(a) { b } else { a });
            let moves: Vec<(usize, Option<&str>)> =
                rivals.iter().filter(|i| Some(**i) != keeper).map(|i| (*i, second(*i))).collect();
            settled.extend(keeper);
            for (room, second) in moves {
                match second {
                    Some(second) => {
                        refused[room].insert(name);
                        names[room] = Some(second);
                        settled.remove(&room);
                    }
                    None => {
                        settled.insert(room);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: marks are known categories and usual in their room; what a room holds names it although clutter and
    //! furniture of other rooms stand in it.
    use super::*;

    fn name(things: &[&str]) -> Option<String> {
        let knowledge = Knowledge::embedded().unwrap();
        let things: Vec<&Category> = things.iter().map(|thing| knowledge.find(thing).unwrap()).collect();
        knowledge.score_room_names(things.into_iter().map(|category| (category, 0.9))).best().map(str::to_owned)
    }

    #[test]
    fn marks_are_usual_in_their_rooms() {
        let knowledge = Knowledge::embedded().unwrap();
        for (room, marks) in &knowledge.words().room_marks {
            assert_eq!(knowledge.words().rooms.find(room), Some(room.as_str()));
            for mark in marks {
                let category = knowledge.find(mark).unwrap_or_else(|| panic!("{mark}"));
                assert_eq!(&category.name, mark);
                assert!(category.rooms.contains(room), "a {mark} is not usual in a {room}: {:?}", category.rooms);
            }
        }
    }

    #[test]
    fn marks_decide_between_rooms_that_share_things() {
        let wet = ["sink", "laundry basket", "soap dispenser", "toilet paper", "mirror", "washing machine"];
        assert_eq!(name(&wet).as_deref(), Some("laundry room"));
        assert_eq!(name(&[&wet[..], &["toilet"]].concat()).as_deref(), Some("bathroom"));
        let toys = ["toy block", "toy car", "teddy bear", "rug", "bookshelf", "picture", "shelf"];
        assert_eq!(name(&toys).as_deref(), Some("playroom"));
        assert_eq!(name(&[&toys[..], &["sofa", "tv", "armchair"]].concat()).as_deref(), Some("living room"));
        assert_eq!(name(&["dining table", "chair", "cereal box", "bottle", "cabinet"]).as_deref(), Some("dining room"));
        let kitchen = ["dining table", "chair", "cereal box", "fridge", "countertop", "sink"];
        assert_eq!(name(&kitchen).as_deref(), Some("kitchen"));
        assert_eq!(name(&[]), None);
    }

    #[test]
    fn a_home_has_one_living_room() {
        let knowledge = Knowledge::embedded().unwrap();
        let scores = |things: &[&str]| {
            let things: Vec<&Category> = things.iter().map(|thing| knowledge.find(thing).unwrap()).collect();
            knowledge.score_room_names(things.into_iter().map(|category| (category, 0.9)))
        };
        let lounge = scores(&["sofa", "armchair", "tv", "tv stand", "coffee table", "rug", "bookshelf"]);
        // An armchair beside a desk, and a bookshelf, make an office look like a living room.
        let office = scores(&["desk", "armchair", "bookshelf", "picture", "side table", "rug", "floor lamp", "plant"]);
        assert_eq!(office.best(), Some("living room"));
        let bedrooms = [scores(&["bed", "wardrobe"]), scores(&["bed", "nightstand"])];
        let all = [office.clone(), lounge, bedrooms[0].clone(), bedrooms[1].clone()];
        let names = ["office", "living room", "bedroom", "bedroom"].map(Some);
        assert_eq!(knowledge.name_rooms(&all), names);
        // Nothing else fits a second room of sofas.
        let second = scores(&["sofa", "armchair", "tv"]);
        assert_eq!(knowledge.name_rooms(&[second.clone(), second]), [Some("living room"); 2]);
    }

    #[test]
    fn what_is_not_there_names_rooms_as_well() {
        // No sofa and no bed: a room with a rug, a mirror and a bench is the hall, coat rack or not.
        let hall = ["rug", "cabinet", "side table", "shelf", "mirror", "bench", "flower pot", "plant", "jar", "ball"];
        assert_eq!(name(&hall).as_deref(), Some("hallway"));
        // Things for washing stand here, but two washing machines and no toilet.
        let wet = ["washing machine", "sink", "soap dispenser", "shampoo", "shampoo", "toilet paper", "laundry basket"];
        assert_eq!(name(&wet).as_deref(), Some("laundry room"));
        let scores = Knowledge::embedded().unwrap();
        let things: Vec<&Category> = wet.iter().map(|thing| scores.find(thing).unwrap()).collect();
        let scores = scores.score_room_names(things.into_iter().map(|category| (category, 0.9)));
        assert!(scores.share("laundry room") == 1.0 && scores.mark("laundry room") > 0.8);
        assert!((0.2..1.0).contains(&scores.share("bathroom")) && scores.mark("bathroom") == 0.0);
        assert_eq!(scores.share("garage"), 0.0);
    }
}
