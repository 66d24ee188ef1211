//! Clauses that leave something out or say where something is taken from.

use super::parse::Parser;
use super::query::{AttributeTerm, Entity, Noun, RelationTerm, RelationWord};
use super::words;

/// Words after which stands what is not meant.
const EXCEPT: [&[&str]; 8] = [
    &["other", "than"],
    &["apart", "from"],
    &["except", "for"],
    &["except"],
    &["rather", "than"],
    &["instead", "of"],
    &["but", "not"],
    &["as", "opposed", "to"],
];
/// Words after which stands where something is taken from.
const SOURCES: [&[&str]; 6] =
    [&["out", "of"], &["off", "of"], &["off"], &["away", "from"], &["from", "off"], &["from"]];

impl Parser<'_> {
    /// "other than the red one", "but not the one on the table": what is said there must not hold of the target.
    pub(super) fn read_exclusion(&mut self, entity: &mut Entity, depth: usize) -> bool {
        let start = self.at;
        if depth > 0 || !EXCEPT.iter().any(|words| self.skip_if(words)) {
            return false;
        }
        // Things of another kind that are left out say nothing of the target.
        match self.parse_entity(1) {
            Some(other) if self.speaks_of_its_kind(&other, entity) => exclude(entity, other),
            Some(_) => {}
            None => self.at = start + 1,
        }
        true
    }

    fn speaks_of_its_kind(&self, other: &Entity, entity: &Entity) -> bool {
        match (&other.noun, &entity.noun) {
            (Noun::Anything, _) | (_, Noun::Anything) => true,
            (Noun::Thing(a), Noun::Thing(b)) => a == b || self.knowledge.similarity(a, b) > 0.6,
            (a, b) => a == b,
        }
    }

    /// "the mug from the table", "the milk out of the fridge": it is there now. In descriptions of known scenes, "from"
    /// tells of distances and sides instead.
    pub(super) fn read_source(&mut self, entity: &mut Entity, depth: usize) -> bool {
        if self.lenient
            || words::find_counted_from(self.rest()).is_some()
            || words::find_relation(self.rest()).is_some()
        {
            return false;
        }
        let start = self.at;
        if !SOURCES.iter().any(|words| self.skip_if(words)) {
            return false;
        }
        let article =
            self.peek().is_some_and(|word| matches!(word, "the" | "a" | "an" | "my" | "this" | "that" | "your"));
        let Some(anchor) = article.then(|| self.parse_entity(depth + 1)).flatten() else {
            self.at = start;
            return false;
        };
        let holds = |name: &str| {
            let category = self.knowledge.find(name);
            category.is_some_and(|category| category.is_a("container") || category.is_a("appliance"))
        };
        let word = match &anchor.noun {
            Noun::Room(_) => RelationWord::In,
            Noun::Thing(name) if holds(name) => RelationWord::In,
            _ => RelationWord::On,
        };
        entity.relations.push(RelationTerm { word, negated: false, anchors: vec![anchor] });
        true
    }
}

/// Not all that is said of the excluded thing needs to fail: with more than one word, its place counts before its looks.
fn exclude(entity: &mut Entity, other: Entity) {
    if let Some(term) = other.relations.into_iter().next() {
        entity.relations.push(RelationTerm { negated: !term.negated, ..term });
    } else if let Some(term) = other.attributes.into_iter().next() {
        entity.attributes.push(AttributeTerm { negated: !term.negated, ..term });
    }
}
