//! Where a thing probably is that nobody has seen yet: by the rooms in which it is usual and by what it is kept in or on.

use super::{Category, Knowledge};

/// Share of the chance that a place keeps in a room where the thing is not usual, and where nobody knows the room.
const OTHER_ROOM: f32 = 0.25;
const UNKNOWN_ROOM: f32 = 0.5;
/// Chances of what it is kept in or on, of its own kind of place (fruit in the kitchen: what is usual there), and of others.
const KEPT: f32 = 1.0;
const USUAL: f32 = 0.6;
const OTHER: f32 = 0.35;

/// How probable a place is for a thing, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Whereabouts {
    /// From 0 to 1; only comparisons mean something.
    pub chance: f32,
    /// Why, in words that follow "the mug is probably there: ".
    pub reason: String,
}

impl Knowledge {
    /// How probably a thing of a category is in or on a piece of furniture that stands in a room, if that is known.
    ///
    /// ```
    /// use dsm::knowledge::Knowledge;
    ///
    /// let knowledge = Knowledge::embedded().unwrap();
    /// let [mug, counter, bed] = ["mug", "counter", "bed"].map(|name| knowledge.find(name).unwrap());
    /// let at = |furniture, room| knowledge.find_chance(mug, furniture, Some(room)).chance;
    /// assert!(at(counter, "kitchen") > at(bed, "bedroom"));
    /// ```
    pub fn find_chance(&self, thing: &Category, furniture: &Category, room: Option<&str>) -> Whereabouts {
        let is_kept = |place: &&String| {
            let named = self.find(place).is_some_and(|category| category.part_of.contains(&furniture.name));
            furniture.is_a(place) || furniture.name == **place || named
        };
        let kept = thing.stored_in.iter().find(is_kept);
        let is_usual = |room: &str| thing.rooms.iter().any(|usual| usual == room);
        let shares_room = furniture.rooms.iter().any(|room| is_usual(room));
        let by_furniture = match (kept, shares_room) {
            (Some(_), _) => KEPT,
            (None, true) => USUAL,
            (None, false) => OTHER,
        };
        let by_room = match room {
            Some(room) if is_usual(room) => 1.0,
            Some(_) => OTHER_ROOM,
            None => UNKNOWN_ROOM,
        };
        let reason = match (room.filter(|room| is_usual(room)), kept) {
            (Some(room), Some(place)) => format!("a {} is usual in a {room} and kept in a {place}", thing.name),
            (Some(room), None) => format!("a {} is usual in a {room}", thing.name),
            (None, Some(place)) => format!("a {} is kept in a {place}", thing.name),
            (None, None) => "nothing better is left".to_owned(),
        };
        Whereabouts { chance: by_furniture * by_room, reason }
    }

    /// Whether furniture of a category has drawers as a rule.
    pub fn has_drawers(&self, furniture: &Category) -> bool {
        self.find("drawer").is_some_and(|drawer| drawer.part_of.contains(&furniture.name))
    }
}

#[cfg(test)]
mod tests {
    //! Contract: what a thing is kept in, in a room where it is usual, comes before either alone, and these before the rest.
    use super::*;

    #[test]
    fn likely_places_come_first() {
        let knowledge = Knowledge::embedded().unwrap();
        let find = |name: &str| knowledge.find(name).unwrap();
        let chance = |thing: &str, place: &str, room| knowledge.find_chance(find(thing), find(place), room).chance;
        assert!(chance("book", "bookshelf", Some("office")) > chance("book", "bookshelf", Some("bathroom")));
        assert!(chance("book", "bookshelf", Some("office")) > chance("book", "fridge", Some("kitchen")));
        assert!(chance("apple", "fridge", Some("kitchen")) > chance("apple", "bed", Some("bedroom")));
        assert!(chance("apple", "fridge", Some("kitchen")) > chance("apple", "fridge", None));
        let why = knowledge.find_chance(find("apple"), find("fridge"), Some("kitchen")).reason;
        assert!(why.contains("kitchen") && why.contains("fridge"), "{why}");
        assert!(knowledge.has_drawers(find("dresser")) && !knowledge.has_drawers(find("bed")));
    }
}
