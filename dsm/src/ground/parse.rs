//! From tokens to a query: a hand-written recursive descent over English noun phrases.
//!
//! ```text
//! entity   = { article | ordinal | superlative | attribute } noun { modifier }
//! modifier = [ "that is" ] [ "not" ] ( relation entity | place | attribute | "made of" material | "to" verb )
//! ```
//! Words that the grammar does not know are skipped: people say more than is needed.

use super::noun::{self, Head, Names};
use super::query::{
    Article, AttributeTerm, AttributeWord, Entity, Noun, Order, Query, RelationTerm, RelationWord, Selection, Viewpoint,
};
use super::subject::with_subject_first;
use super::words;
use crate::knowledge::Knowledge;

/// Where a modifier after a nested noun belongs: "the cup on the table next to the window".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attachment {
    /// To the nearest noun: the table is next to the window.
    Nearest,
    /// To the target: the cup is next to the window.
    Target,
}

/// Deepest nesting of anchors; deeper ones are cut off.
pub(super) const MAX_DEPTH: usize = 5;
/// Most entities in one query; further words are ignored.
pub(super) const MAX_ENTITIES: usize = 16;

/// Parses a noun phrase with all its modifiers; `None` when it names nothing at all.
pub(super) fn parse_query(
    tokens: &[String],
    knowledge: &Knowledge,
    names: &Names,
    attachment: Attachment,
) -> Option<Query> {
    let lenient = names.lenient;
    let turned = if lenient { with_subject_first(tokens, knowledge, names) } else { None };
    let tokens = turned.as_deref().unwrap_or(tokens);
    let mut parser = Parser {
        tokens,
        at: 0,
        knowledge,
        names,
        attachment,
        lenient,
        viewpoint: None,
        about_target: None,
        entities: 0,
        known_words: 0,
    };
    let mut target = match (parser.parse_target(), &parser.viewpoint) {
        (Some(target), _) => target,
        // "facing the cabinets, right" speaks of the cabinets.
        (None, Some(viewpoint)) => {
            parser.at = 0;
            while parser.at < tokens.len() && tokens[parser.at] != "," {
                parser.at += 1;
            }
            viewpoint.at.clone()
        }
        (None, None) => return None,
    };
    // Further sentences speak of the target.
    while parser.at < tokens.len() {
        let before = parser.at;
        parser.parse_modifiers(&mut target, 0);
        if parser.at == before {
            parser.at += 1;
        }
    }
    let says_something = parser.known_words > 0 || matches!(target.noun, Noun::Thing(_));
    // "facing the toilets, choose the one on the left"
    if let (Noun::Anything, Some(viewpoint)) = (&target.noun, &parser.viewpoint)
        && !viewpoint.entering
    {
        target.noun = viewpoint.at.noun.clone();
    }
    says_something.then_some(Query { target, viewpoint: parser.viewpoint })
}

pub(super) struct Parser<'a> {
    pub(super) tokens: &'a [String],
    pub(super) at: usize,
    pub(super) knowledge: &'a Knowledge,
    pub(super) names: &'a Names,
    /// Whether what people describe is known to be there: sentences about other things are then read too.
    pub(super) lenient: bool,
    pub(super) viewpoint: Option<Viewpoint>,
    /// Relation of the thing just read to the target, when its phrase said so ("a lamp to the right of it").
    pub(super) about_target: Option<RelationWord>,
    pub(super) attachment: Attachment,
    entities: usize,
    pub(super) known_words: usize,
}

impl Parser<'_> {
    pub(super) fn rest(&self) -> &[String] {
        &self.tokens[self.at.min(self.tokens.len())..]
    }

    pub(super) fn peek(&self) -> Option<&str> {
        self.rest().first().map(String::as_str)
    }

    pub(super) fn next_is(&self, words: &[&str]) -> bool {
        words.len() <= self.rest().len() && words.iter().zip(self.rest()).all(|(word, token)| word == token)
    }

    pub(super) fn skip_if(&mut self, words: &[&str]) -> bool {
        let fits = self.next_is(words);
        if fits {
            self.at += words.len();
        }
        fits
    }

    /// The first noun phrase; an opening without one ("facing the window, ...") is skipped up to its comma.
    pub(super) fn parse_target(&mut self) -> Option<Entity> {
        loop {
            self.skip_opening();
            self.read_viewpoint();
            self.skip_opening();
            if let Some(entity) = self.parse_entity(0) {
                return Some(entity);
            }
            while self.peek().is_some_and(|word| !matches!(word, "," | ".")) {
                self.at += 1;
            }
            self.peek()?;
            // "facing the window, choose the ...": the verb may stand after the opening.
            let after_mark = &self.rest()[1..];
            self.at += 1 + after_mark.len() - super::command::without_verb(after_mark).len();
        }
    }

    /// "there is a ...", "it is the ...", "this is ..."
    pub(super) fn skip_opening(&mut self) {
        while matches!(
            self.peek(),
            Some(
                "there"
                    | "it"
                    | "this"
                    | "these"
                    | "those"
                    | "is"
                    | "are"
                    | ","
                    | "."
                    | "and"
                    | "that"
                    | "you"
                    | "for"
                    | "will"
                    | "would"
                    | "should"
            )
        ) {
            self.at += 1;
        }
        while self.lenient
            && self.peek().is_some_and(|word| {
                matches!(
                    word,
                    "of" | "we"
                        | "i"
                        | "am"
                        | "want"
                        | "looking"
                        | "pick"
                        | "choose"
                        | "select"
                        | "find"
                        | "click"
                        | "its"
                        | "hit"
                        | "please"
                        | "thisis"
                        | "see"
                        | "need"
                        | "can"
                        | "was"
                ) && self.rest().get(1).is_none_or(|next| next != "at")
            })
        {
            self.at += 1;
            self.skip_opening();
        }
    }

    pub(super) fn parse_entity(&mut self, depth: usize) -> Option<Entity> {
        if depth > MAX_DEPTH || self.entities >= MAX_ENTITIES {
            return None;
        }
        self.entities += 1;
        let mut entity = Entity::named(Noun::Anything);
        entity.article = self.parse_article();
        let run = self.content_run();
        if run == 0 {
            return None;
        }
        let words = &self.tokens[self.at..self.at + run];
        let head = noun::find_head(words, self.knowledge, self.names);
        self.known_words += usize::from(head.known);
        self.read_premodifiers(&words[..head.start], &mut entity);
        self.at += run;
        entity.noun = head.noun.clone();
        self.read_of_phrase(&head, &mut entity, depth);
        self.parse_modifiers(&mut entity, depth);
        Some(entity)
    }

    pub(super) fn parse_article(&mut self) -> Article {
        let mut article = Article::Definite;
        while let Some(word) = self.peek() {
            match word {
                "a" | "an" | "some" | "any" | "another" => article = Article::Indefinite,
                "the" | "this" | "that" | "these" | "those" | "my" | "your" | "our" | "his" | "her" | "its" | "all"
                | "very" | "both" | "other" => article = Article::Definite,
                // "two other chairs", "a mounted lamp": what follows is the thing.
                "two" | "three" | "four" | "five" | "six" | "several" | "many" | "multiple" | "2" | "3" | "4"
                | "mounted" | "standing" | "hanging"
                    if self.rest().get(1).is_some_and(|next| {
                        matches!(next.as_str(), "other" | "of" | "the") || !words::is_function_word(next)
                    }) && words::find_relation(&self.rest()[1..]).is_none()
                        && !self.opens_name() => {}
                _ => break,
            }
            self.at += 1;
        }
        if self.peek().is_some_and(|word| matches!(word, "something" | "anything")) {
            article = Article::Indefinite;
        }
        article
    }

    /// Whether the "can" `ahead` of here is a thing and not a verb: "the can", "a can of soup", but not "the chair can be
    /// moved" nor "can you".
    fn is_noun_can(&self, ahead: usize) -> bool {
        let next = self.tokens.get(self.at + ahead + 1).map(String::as_str);
        let verb = next.is_some_and(|next| {
            matches!(next, "be" | "i" | "you" | "we" | "one" | "see" | "have" | "not" | "also" | "use")
                || self.knowledge.words().purposes.find(next).is_some()
        });
        let before = (self.at + ahead).checked_sub(1).map(|i| self.tokens[i].as_str());
        let opens = ahead > 0 || before.is_none_or(|before| words::is_function_word(before) && before != "that");
        // "trash can"
        let named = before.is_some_and(|before| self.knowledge.find_exact(&format!("{before} can")).is_some());
        (opens || named) && !verb
    }

    /// Number of content words from here on.
    pub(super) fn content_run(&self) -> usize {
        let rest = self.rest();
        let mut length = 0;
        while length < rest.len() && length < 8 {
            let token = rest[length].as_str();
            // "a black, wheeled chair", "the glass and wood table": the description goes on.
            if matches!(token, "," | "and")
                && length > 0
                && noun::is_description(&rest[length - 1], self.knowledge)
                && self.describes_on(length + 1)
            {
                length += 1;
                continue;
            }
            let named = length == 0 && self.opens_name();
            if words::is_function_word(token) && !named && !(token == "can" && self.is_noun_can(length)) {
                break;
            }
            let tail = &rest[length..];
            // "nearest chair" and "left lamp" describe, "nearest to the chair" and "left of the lamp" relate.
            let describes = words::find_superlative(token).is_some()
                && tail
                    .get(1)
                    .is_some_and(|next| !words::is_function_word(next) && words::find_relation(&tail[1..]).is_none())
                && length == 0;
            // "the stall furthest to the left"
            let trails = length > 0
                && words::find_superlative(token).is_some()
                && tail.get(1).is_none_or(|next| words::is_function_word(next));
            if trails || !describes && (words::find_relation(tail).is_some() || words::find_place(tail).is_some()) {
                break;
            }
            length += 1;
        }
        length
    }

    /// Whether the words from `ahead` of here on are descriptions followed by a thing's name.
    fn describes_on(&self, ahead: usize) -> bool {
        let rest = &self.rest()[ahead..];
        let described = rest.iter().take_while(|word| noun::is_description(word, self.knowledge)).count();
        let names = |word: &String| {
            !words::is_function_word(word) && (self.names.contain(word) || self.knowledge.find_exact(word).is_some())
        };
        described > 0 && rest[described..].iter().take(2).any(names)
    }

    /// Reads the words before the noun.
    pub(super) fn read_premodifiers(&mut self, before: &[String], entity: &mut Entity) {
        let mut rank = None;
        let mut order = None;
        let mut negated = false;
        for word in before {
            if word == "non" {
                negated = true;
            } else if let Some(ordinal) = words::find_ordinal(word) {
                rank = Some(ordinal);
            } else if let Some(superlative) = words::find_superlative(word) {
                order = Some(superlative);
            } else if let Some(term) = noun::find_attribute(word, self.knowledge) {
                self.known_words += 1;
                entity.attributes.push(AttributeTerm { negated, ..term });
                negated = false;
            } else if let Some(room) = self.knowledge.words().rooms.find(word)
                && room != "room"
            {
                let room = Entity::named(Noun::Room(room.to_owned()));
                entity.relations.push(RelationTerm { word: RelationWord::In, negated: false, anchors: vec![room] });
            }
        }
        if let Some(order) = order {
            entity.selections.push(Selection { order, rank: rank.unwrap_or(1) });
        } else if let Some(rank) = rank {
            // Counted from the left unless "from the ..." follows and says otherwise.
            entity.selections.push(Selection { order: Order::Leftmost, rank });
        }
    }

    /// "top of the shelf" speaks of the shelf; "cup of coffee" of the cup; "box of wood" of a wooden box.
    pub(super) fn read_of_phrase(&mut self, head: &Head, entity: &mut Entity, depth: usize) {
        if !self.next_is(&["of"]) {
            return;
        }
        let start = self.at;
        if let Some(words) = self.joined_by_of(head) {
            entity.noun = Noun::Thing(self.tokens[start - 1..start + words].join(" "));
            self.known_words += 1;
            self.at += words;
            return;
        }
        // "one of the apples": any of them, unless more is said ("the largest one of the apples").
        let any_of = self.tokens[start - 1] == "one" && entity.selections.is_empty() && entity.attributes.is_empty();
        self.at += 1;
        let group =
            head.noun == Noun::Anything && self.peek().is_some_and(|word| matches!(word, "the" | "these" | "my"));
        if head.part_or_group || group || self.lenient && head.noun == Noun::Anything {
            if let Some(mut whole) = self.parse_entity(depth + 1) {
                whole.selections.append(&mut entity.selections);
                whole.attributes.append(&mut entity.attributes);
                whole.article = if any_of && !self.lenient { Article::Indefinite } else { entity.article };
                *entity = whole;
            }
            return;
        }
        if let Some(material) = self.peek().and_then(|word| self.knowledge.words().materials.find(word)) {
            entity.attributes.push(AttributeTerm {
                kind: AttributeWord::Material,
                word: material.to_owned(),
                negated: false,
            });
            self.at += 1;
            return;
        }
        // What it holds or belongs to does not tell things apart in the map: skipped.
        self.parse_article();
        self.at += self.content_run();
        if self.at <= start + 1 {
            self.at = start + 1;
        }
    }

    /// Whether the next two words are a name, such as "standing lamp".
    fn opens_name(&self) -> bool {
        let name = self.rest().get(..2).map(|words| words.join(" "));
        !self.lenient && name.is_some_and(|name| self.knowledge.find_exact(&name).is_some())
    }

    /// Number of words from "of" on that make one name with the word before: "chest of drawers", "loaf of bread".
    fn joined_by_of(&self, head: &Head) -> Option<usize> {
        let before = self.at.checked_sub(1).filter(|_| matches!(head.noun, Noun::Thing(_)))?;
        let name = |words: usize| self.tokens.get(before..self.at + words).map(|tokens| tokens.join(" "));
        let known =
            |name: &String| self.names.contain(name) || !self.lenient && self.knowledge.find_exact(name).is_some();
        [3, 2].into_iter().find(|words| name(*words).as_ref().is_some_and(known))
    }
}
