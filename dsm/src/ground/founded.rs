//! Whether a reading says only what was said: a plugged-in reader cannot send the robot to another thing.

use super::noun::find_attribute;
use super::parse::{MAX_DEPTH, MAX_ENTITIES};
use super::query::{AttributeTerm, AttributeWord, Entity, Noun, Query, RelationWord, Selection};
use crate::knowledge::{Knowledge, normalize, singular_of};

/// Most words of a name.
const MAX_NAME_WORDS: usize = 5;
/// Most attributes, and most orders, of one entity.
const MAX_TERMS: usize = 8;
/// Largest place in an order.
const MAX_RANK: u32 = 50;

/// What was said, for looking words up.
struct Said<'a> {
    words: &'a [String],
    knowledge: &'a Knowledge,
}

/// The first thing that a reading says and the words do not; `None` when all was said.
pub(super) fn find_unfounded(query: &Query, words: &[String], knowledge: &Knowledge) -> Option<String> {
    let said = Said { words, knowledge };
    let viewpoint = query.viewpoint.as_ref().map(|viewpoint| &viewpoint.at);
    let entities = query.target.count() + viewpoint.map_or(0, Entity::count);
    if entities > MAX_ENTITIES {
        return Some(format!("{entities} things"));
    }
    std::iter::once(&query.target).chain(viewpoint).find_map(|entity| said.find_in_entity(entity, 0))
}

impl Said<'_> {
    fn find_in_entity(&self, entity: &Entity, depth: usize) -> Option<String> {
        if depth > MAX_DEPTH {
            return Some(format!("things nested deeper than {MAX_DEPTH}"));
        }
        if entity.attributes.len() > MAX_TERMS || entity.selections.len() > MAX_TERMS {
            return Some(format!("more than {MAX_TERMS} attributes of one thing"));
        }
        let unsaid = |what: &str| Some(format!("`{}`", what.chars().take(40).collect::<String>()));
        match &entity.noun {
            Noun::Thing(name) if !self.names_thing(name) => return unsaid(name),
            Noun::Room(name) if !self.names_room(name) => return unsaid(name),
            _ => {}
        }
        if let Some(term) = entity.attributes.iter().find(|term| !self.states(term)) {
            return unsaid(&term.word);
        }
        if let Some(Selection { rank, .. }) = entity.selections.iter().find(|s| !(1..=MAX_RANK).contains(&s.rank)) {
            return Some(format!("place {rank} in an order"));
        }
        entity.relations.iter().find_map(|relation| {
            let fits = match relation.word {
                RelationWord::Between => (1..=2).contains(&relation.anchors.len()),
                _ => relation.anchors.len() == 1,
            };
            if !fits {
                return Some(format!("{} with {} things", relation.word.phrase(), relation.anchors.len()));
            }
            relation.anchors.iter().find_map(|anchor| self.find_in_entity(anchor, depth + 1))
        })
    }

    /// Phrases that were said, the longest first.
    fn phrases(&self) -> impl Iterator<Item = String> + '_ {
        (1..=MAX_NAME_WORDS.min(self.words.len()))
            .rev()
            .flat_map(move |length| self.words.windows(length))
            .map(|w| w.join(" "))
    }

    /// Whether the name, or another name of the same category or kind, was said.
    fn names_thing(&self, name: &str) -> bool {
        let name = normalize(name);
        if name.is_empty() || name.split(' ').count() > MAX_NAME_WORDS {
            return false;
        }
        let category = self.knowledge.find_exact(&name).map(|category| &category.name);
        let kind = self.knowledge.find_kind(&name);
        self.phrases().any(|phrase| {
            phrase == name
                || singular_of(&phrase).contains(&name)
                || category.is_some() && self.knowledge.find_tolerant(&phrase).map(|c| &c.name) == category
                || kind.is_some() && self.knowledge.find_kind(&phrase) == kind
        })
    }

    fn names_room(&self, name: &str) -> bool {
        let rooms = &self.knowledge.words().rooms;
        rooms.find(name).is_some_and(|room| room == name && self.phrases().any(|p| rooms.find(&p) == Some(room)))
    }

    fn states(&self, term: &AttributeTerm) -> bool {
        let purposes = &self.knowledge.words().purposes;
        self.words.iter().any(|word| match term.kind {
            AttributeWord::Purpose => purposes.find(word) == Some(term.word.as_str()),
            kind => find_attribute(word, self.knowledge).is_some_and(|own| own.kind == kind && own.word == term.word),
        })
    }
}

#[cfg(test)]
mod tests {
    //! Contract: what was said, in these or other words, is founded; what was not is named.
    use super::*;
    use crate::ground::words::tokens_of;

    #[test]
    fn other_words_for_the_same_are_founded() {
        let knowledge = Knowledge::embedded().unwrap();
        let unfounded = |noun: Noun, text: &str| {
            find_unfounded(&Query { target: Entity::named(noun), viewpoint: None }, &tokens_of(text), &knowledge)
        };
        let thing = |name: &str| Noun::Thing(name.to_owned());
        for (noun, text) in [
            (thing("mug"), "the red mug"),
            (thing("mug"), "two mugs"),
            (thing("sofa"), "the couch"),
            (thing("office chair"), "my office chair"),
            (thing("zorblax"), "the zorblax"),
            (Noun::Room("kitchen".into()), "something in the kitchen"),
            (Noun::Anything, "whatever"),
        ] {
            assert_eq!(unfounded(noun.clone(), text), None, "{noun:?} in {text}");
        }
        for (noun, text) in [
            (thing("knife"), "the red mug"),
            (thing("open the gripper"), "open the door"),
            (thing(""), "the mug"),
            (Noun::Room("bathroom".into()), "the kitchen"),
            (Noun::Room("gripper".into()), "the gripper"),
        ] {
            assert!(unfounded(noun.clone(), text).is_some(), "{noun:?} in {text}");
        }
    }
}
