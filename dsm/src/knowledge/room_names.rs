//! What a room is called by what stands in it.

use super::{Category, Knowledge};
use std::collections::BTreeMap;

/// Share of its votes that a name keeps when the room holds nothing that marks it.
const UNMARKED_SHARE: f32 = 0.35;
/// Votes for a name by what marks it.
const MARKED: f32 = 1.0;
/// Fewer votes name no room.
const LEAST: f32 = 0.5;

impl Knowledge {
    /// The likeliest name of a room that holds these things (category and confidence, 0 to 1); `None` when they say
    /// little.
    ///
    /// Each thing votes for the rooms in which it is usual, one vote together. A name keeps a third of its votes when
    /// nothing that marks it is there (no bathroom without toilet, bathtub or shower), and wins one when something is.
    pub fn find_room_name<'a>(&'a self, things: impl Iterator<Item = (&'a Category, f32)>) -> Option<&'a str> {
        let mut votes: BTreeMap<&str, f32> = BTreeMap::new();
        let mut marked: BTreeMap<&str, f32> = BTreeMap::new();
        for (category, confidence) in things {
            // A thing found in many kinds of room says little about any of them.
            for room in &category.rooms {
                *votes.entry(room).or_insert(0.0) += confidence / category.rooms.len() as f32;
            }
            for (room, marks) in &self.words().room_marks {
                if marks.contains(&category.name) {
                    let mark = marked.entry(room).or_insert(0.0);
                    *mark = mark.max(confidence);
                }
            }
        }
        let score = |(room, votes): (&'a str, f32)| {
            let mark = marked.get(room).copied().unwrap_or(0.0);
            (room, votes * (UNMARKED_SHARE + (1.0 - UNMARKED_SHARE) * mark) + MARKED * mark)
        };
        let best = votes.into_iter().map(score).fold(None, |best: Option<(&str, f32)>, next| match best {
            Some(best) if best.1 >= next.1 => Some(best),
            _ => Some(next),
        });
        best.filter(|(_, score)| *score >= LEAST).map(|(room, _)| room)
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
        knowledge.find_room_name(things.into_iter().map(|category| (category, 0.9))).map(str::to_owned)
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
}
