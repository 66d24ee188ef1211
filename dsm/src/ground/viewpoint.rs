//! Words about where the viewer stands, and sentences that relate another thing to the target.

use super::noun;
use super::parse::Parser;
use super::query::{Entity, Noun, RelationTerm, RelationWord, Viewpoint};
use super::words;

/// Words that open a clause about the viewer.
const OPENERS: [&str; 23] = [
    "facing", "looking", "look", "if", "when", "while", "as", "standing", "stand", "from", "sitting", "entering",
    "walking", "upon", "with", "face", "assuming", "imagine", "coming", "once", "after", "viewing", "staring",
];
/// Words after which the faced thing is named.
const FACED: [&str; 8] = ["facing", "face", "at", "towards", "toward", "viewing", "view", "see"];
/// Words that tell that the viewer comes in.
const ENTERING: [&str; 11] =
    ["enter", "entering", "entered", "come", "coming", "walk", "walking", "entrance", "door", "doorway", "into"];

/// Whether a word opens a clause about the viewer.
pub(super) fn is_opener(word: &str) -> bool {
    OPENERS.contains(&word)
}

impl Parser<'_> {
    /// "facing the window, ...", "when you enter through the door, ...": skips the clause and notes the viewpoint.
    pub(super) fn read_viewpoint(&mut self) {
        if !self.lenient || !self.peek().is_some_and(|word| OPENERS.contains(&word)) {
            return;
        }
        let start = self.at;
        let length = clause_length(self.rest());
        let clause = self.rest()[..length].to_vec();
        let looks = |place: usize| clause[place] != "at" || place > 0 && clause[place - 1].starts_with("look");
        let faced = (0..clause.len()).rev().find(|&place| FACED.contains(&clause[place].as_str()) && looks(place));
        let enters = clause.iter().position(|word| ENTERING.contains(&word.as_str()));
        let front = clause.windows(2).rposition(|pair| pair[0] == "front" && pair[1] == "of").map(|place| place + 1);
        let back = clause.iter().position(|word| word == "back").and_then(|place| {
            clause[place..].iter().position(|word| matches!(word.as_str(), "to" | "against")).map(|next| place + next)
        });
        let turned = back.filter(|_| faced.is_none());
        if let Some(place) = turned.or(faced).or(front) {
            self.at = start + place + 1;
            if let Some(at) = self.parse_entity(1) {
                self.viewpoint.get_or_insert(Viewpoint { at, entering: turned.is_some() });
            }
        } else if enters.is_some() {
            let at = Entity::named(Noun::Thing("door".to_owned()));
            self.viewpoint.get_or_insert(Viewpoint { at, entering: true });
            self.at = start + length;
        } else if start + length < self.tokens.len() && self.tokens[start + length] == "," {
            self.at = start + length;
        } else {
            return;
        }
        if start + length < self.tokens.len() {
            // A mark between sentences stays: what follows is a sentence of its own.
            self.at = start + length + usize::from(self.tokens[start + length] == ",");
        }
    }

    /// A sentence about another thing: "there is a lamp to the right of it", "a chair stands in front of the desk".
    /// What it relates to the target is kept, the other way round.
    pub(super) fn read_foreign_subject(&mut self, target: &mut Entity) {
        self.about_target = None;
        let Some(other) = self.parse_entity(1) else { return };
        if let Some(word) = self.about_target.take() {
            if let Some(word) = inverse(word) {
                target.relations.push(RelationTerm { word, negated: false, anchors: vec![other] });
            }
            return;
        }
        let same = |a: &Noun, b: &Noun| match (a, b) {
            (Noun::Thing(a), Noun::Thing(b)) => a == b || self.knowledge.similarity(a, b) > 0.95,
            _ => false,
        };
        let related = other.relations.iter().find(|term| !term.negated && same(&term.anchors[0].noun, &target.noun));
        if let Some(word) = related.and_then(|term| inverse(term.word)) {
            let mut other = other.clone();
            other.relations.clear();
            target.relations.push(RelationTerm { word, negated: false, anchors: vec![other] });
        }
    }

    /// "to its left there is a desk", "on the right of it is a door": the thing that follows, the other way round.
    pub(super) fn read_thing_beside_it(&mut self, target: &mut Entity, word: RelationWord) {
        let start = self.at;
        while self
            .peek()
            .is_some_and(|word| matches!(word, "," | "there" | "is" | "are" | "we" | "you" | "can" | "see"))
        {
            self.at += 1;
        }
        let article = self.peek().is_some_and(|word| matches!(word, "the" | "a" | "an" | "another"));
        match article.then(|| self.parse_entity(1)).flatten().zip(inverse(word)) {
            Some((other, word)) if start != self.at => {
                target.relations.push(RelationTerm { word, negated: false, anchors: vec![other] });
            }
            _ => self.at = start,
        }
    }

    /// "it", "them", "its": the target, or in a query with a viewpoint what is faced.
    pub(super) fn skip_pronoun(&mut self) -> bool {
        let pronoun = self.peek().is_some_and(|word| matches!(word, "it" | "them" | "its"));
        self.at += usize::from(pronoun);
        pronoun
    }

    /// "the object is a lamp": takes the noun from what it is said to be.
    pub(super) fn adopt_predicate(&mut self, entity: &mut Entity) -> bool {
        let start = self.at;
        self.at += 1;
        self.parse_article();
        let run = self.content_run();
        if run > 0 {
            let words = &self.tokens[self.at..self.at + run];
            let head = noun::find_head(words, self.knowledge, self.names);
            if head.known && matches!(head.noun, Noun::Thing(_)) {
                self.read_premodifiers(&words[..head.start], entity);
                self.at += run;
                entity.noun = head.noun;
                return true;
            }
        }
        self.at = start;
        false
    }

    /// "to its left" and the like: the relation of what was named before to the target.
    pub(super) fn read_its_side(&mut self) -> Option<RelationWord> {
        const SIDES: [(&[&str], RelationWord); 5] = [
            (&["its", "left"], RelationWord::LeftOf),
            (&["its", "right"], RelationWord::RightOf),
            (&["its", "side"], RelationWord::NextTo),
            (&["its", "sides"], RelationWord::NextTo),
            (&["its", "top"], RelationWord::On),
        ];
        if !self.lenient || !self.peek().is_some_and(|word| matches!(word, "to" | "on" | "at" | "by")) {
            return None;
        }
        let after = &self.rest()[1..];
        let found = SIDES.iter().find(|(words, _)| {
            words.len() <= after.len() && words.iter().zip(after).all(|(word, token)| word == token)
        })?;
        self.at += 1 + found.0.len();
        while self.peek().is_some_and(|word| matches!(word, "side" | "hand")) {
            self.at += 1;
        }
        Some(found.1)
    }

    /// Notes that a nested thing stands so to the target.
    pub(super) fn note_about_target(&mut self, word: RelationWord) {
        self.about_target = Some(word);
    }

    /// Skips numbers and the like before an ordinal's direction; `None` when no ordinal stands here.
    pub(super) fn read_ordinal(&mut self) -> Option<u32> {
        let rank = self.peek().and_then(words::find_ordinal)?;
        let next = &self.rest()[1..];
        let counted = words::find_counted_from(next).is_some()
            || next.first().is_some_and(|word| word == "one") && words::find_counted_from(&next[1..]).is_some();
        if !counted {
            return None;
        }
        self.at += 1 + usize::from(next.first().is_some_and(|word| word == "one"));
        Some(rank)
    }
}

/// Words with which the sentence proper begins after a clause about the viewer that no mark ends.
const RESUMES: [[&str; 2]; 9] = [
    ["it", "is"],
    ["its", "the"],
    ["its", "a"],
    ["you", "want"],
    ["you", "will"],
    ["you", "need"],
    ["choose", "the"],
    ["select", "the"],
    ["pick", "the"],
];

/// Length of the clause at the start: up to a mark, or to where the sentence proper begins.
fn clause_length(tokens: &[String]) -> usize {
    let mark = tokens.iter().position(|token| matches!(token.as_str(), "," | ".")).unwrap_or(tokens.len());
    let resumes = tokens[..mark].windows(2).skip(2).position(|pair| RESUMES.iter().any(|words| words[..] == *pair));
    resumes.map_or(mark, |place| place + 2)
}

/// How the target stands to a thing that stands so to the target; `None` when nothing follows.
pub(super) fn inverse(word: RelationWord) -> Option<RelationWord> {
    Some(match word {
        RelationWord::LeftOf => RelationWord::RightOf,
        RelationWord::RightOf => RelationWord::LeftOf,
        RelationWord::InFrontOf | RelationWord::Behind | RelationWord::Against => RelationWord::NextTo,
        RelationWord::On | RelationWord::In => RelationWord::With,
        RelationWord::Above => RelationWord::Below,
        RelationWord::Under | RelationWord::Below => RelationWord::Above,
        RelationWord::With => RelationWord::On,
        RelationWord::NextTo | RelationWord::Near | RelationWord::Closest => RelationWord::NextTo,
        RelationWord::Far | RelationWord::Farthest => RelationWord::Far,
        RelationWord::Between => return None,
    })
}
