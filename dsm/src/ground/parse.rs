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
use super::{viewpoint, words};
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
const MAX_DEPTH: usize = 5;
/// Most entities in one query; further words are ignored.
const MAX_ENTITIES: usize = 16;

/// Parses a noun phrase with all its modifiers; `None` when it names nothing at all.
pub(super) fn parse_query(
    tokens: &[String],
    knowledge: &Knowledge,
    names: &Names,
    attachment: Attachment,
) -> Option<Query> {
    let lenient = names.lenient;
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
    attachment: Attachment,
    entities: usize,
    known_words: usize,
}

impl Parser<'_> {
    pub(super) fn rest(&self) -> &[String] {
        &self.tokens[self.at.min(self.tokens.len())..]
    }

    pub(super) fn peek(&self) -> Option<&str> {
        self.rest().first().map(String::as_str)
    }

    fn next_is(&self, words: &[&str]) -> bool {
        words.len() <= self.rest().len() && words.iter().zip(self.rest()).all(|(word, token)| word == token)
    }

    fn skip_if(&mut self, words: &[&str]) -> bool {
        let fits = self.next_is(words);
        if fits {
            self.at += words.len();
        }
        fits
    }

    /// The first noun phrase; an opening without one ("facing the window, ...") is skipped up to its comma.
    fn parse_target(&mut self) -> Option<Entity> {
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
    fn skip_opening(&mut self) {
        while matches!(
            self.peek(),
            Some(
                "there" | "it" | "this" | "these" | "those" | "is" | "are" | "," | "." | "and" | "that" | "you" | "for"
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
                _ => break,
            }
            self.at += 1;
        }
        if self.peek().is_some_and(|word| matches!(word, "something" | "anything")) {
            article = Article::Indefinite;
        }
        article
    }

    /// Number of content words from here on.
    pub(super) fn content_run(&self) -> usize {
        let rest = self.rest();
        let mut length = 0;
        while length < rest.len() && length < 8 {
            let token = rest[length].as_str();
            if words::is_function_word(token) {
                break;
            }
            let tail = &rest[length..];
            // "nearest chair" and "left lamp" describe, "nearest to the chair" and "left of the lamp" relate.
            let describes = words::find_superlative(token).is_some()
                && tail
                    .get(1)
                    .is_some_and(|next| !words::is_function_word(next) && words::find_relation(&tail[1..]).is_none())
                && length == 0;
            if !describes && (words::find_relation(tail).is_some() || words::find_place(tail).is_some()) {
                break;
            }
            length += 1;
        }
        length
    }

    /// Reads the words before the noun.
    pub(super) fn read_premodifiers(&mut self, before: &[String], entity: &mut Entity) {
        let mut rank = None;
        let mut order = None;
        for word in before {
            if let Some(ordinal) = words::find_ordinal(word) {
                rank = Some(ordinal);
            } else if let Some(superlative) = words::find_superlative(word) {
                order = Some(superlative);
            } else if let Some(term) = noun::find_attribute(word, self.knowledge) {
                self.known_words += 1;
                entity.attributes.push(term);
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
    fn read_of_phrase(&mut self, head: &Head, entity: &mut Entity, depth: usize) {
        if !self.next_is(&["of"]) {
            return;
        }
        let start = self.at;
        self.at += 1;
        if head.part_or_group || self.lenient && head.noun == Noun::Anything {
            if let Some(mut whole) = self.parse_entity(depth + 1) {
                whole.selections.append(&mut entity.selections);
                whole.attributes.append(&mut entity.attributes);
                whole.article = entity.article;
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

    /// Reads all modifiers that belong to the entity.
    fn parse_modifiers(&mut self, entity: &mut Entity, depth: usize) {
        let mut after_copula = false;
        let mut negated = false;
        loop {
            if depth == 0 && self.next_is(&["."]) && self.skip_foreign_sentence(entity) {
                continue;
            }
            if self.lenient
                && entity.noun == Noun::Anything
                && depth == 0
                && self.peek().is_some_and(|word| matches!(word, "is" | "are" | "was"))
                && self.adopt_predicate(entity)
            {
                continue;
            }
            if self.lenient
                && (self.peek().is_some_and(|word| matches!(word, "when" | "if" | "while" | "once" | "assuming"))
                    || self.next_is(&["as", "you"]))
            {
                if depth > 0 {
                    return;
                }
                let start = self.at;
                self.read_viewpoint();
                if self.at > start {
                    continue;
                }
            }
            if let Some(word) = self.read_its_side() {
                match depth {
                    0 => self.read_thing_beside_it(entity, word),
                    _ => self.note_about_target(word),
                }
                continue;
            }
            if self.lenient
                && depth == 0
                && let Some(rank) = self.read_ordinal()
            {
                entity.selections.insert(0, Selection { order: Order::Leftmost, rank });
                continue;
            }
            let Some(word) = self.peek() else { return };
            match word {
                "," | "." | "and" | "but" if depth > 0 => return,
                "that" | "which" | "who" | "it" | "is" | "are" | "was" | "there" | "be"
                    if depth > 0 && self.belongs_to_target() =>
                {
                    return;
                }
                "not" => {
                    negated = true;
                    self.at += 1;
                    continue;
                }
                "without" | "no" => {
                    self.at += 1;
                    self.push_relation(entity, RelationWord::With, true, depth);
                    continue;
                }
                "is" | "are" | "was" | "looks" | "be" => after_copula = true,
                _ => {}
            }
            if self.read_counted_from(entity) || self.read_made_of(entity, negated) || self.read_purpose(entity) {
                negated = false;
                continue;
            }
            if let Some((length, order)) = words::find_place(self.rest()) {
                let sided = self.lenient && matches!(order, Order::Leftmost | Order::Rightmost);
                if sided && depth > 0 {
                    // "the cabinet near the floor on the right": people place the target, not what it is near.
                    return;
                }
                self.at += length;
                self.known_words += 1;
                match entity.selections.last_mut().filter(|counted| sided && counted.rank > 1) {
                    Some(counted) => counted.order = order,
                    None => entity.selections.push(Selection { order, rank: 1 }),
                }
                continue;
            }
            if let Some((length, relation)) = words::find_relation(self.rest()) {
                let nested_with = matches!(relation, RelationWord::With);
                if depth > 0 && self.attachment == Attachment::Target && !nested_with {
                    return;
                }
                self.at += length;
                self.known_words += 1;
                self.push_relation(entity, relation, negated, depth);
                negated = false;
                continue;
            }
            if self.read_predicate(entity, after_copula || depth == 0, negated) {
                negated = false;
                continue;
            }
            if depth > 0 && !words::is_function_word(self.peek().unwrap_or(".")) {
                return;
            }
            self.at += 1;
        }
    }

    /// A further sentence about something else ("there is a dresser to the right of the curtain") says nothing of the
    /// target that can be read as its own: it is skipped up to the next sentence.
    fn skip_foreign_sentence(&mut self, entity: &mut Entity) -> bool {
        let target = &entity.noun;
        let start = self.at;
        self.at += 1;
        let introduces = self.skip_if(&["there", "is"]) || self.skip_if(&["there", "are"]);
        let subject = self.at;
        let article = self.peek().is_some_and(|word| matches!(word, "the" | "a" | "an" | "this" | "that"));
        self.parse_article();
        let run = self.content_run();
        let foreign = article && run > 0 && {
            let head = noun::find_head(&self.tokens[self.at..self.at + run], self.knowledge, self.names);
            match (&head.noun, target) {
                (Noun::Thing(said), Noun::Thing(meant)) if head.known => self.knowledge.similarity(said, meant) < 0.5,
                _ => false,
            }
        };
        if !foreign && !introduces {
            self.at = start;
            return false;
        }
        if self.lenient {
            self.at = subject;
            self.read_foreign_subject(entity);
        }
        while self.peek().is_some_and(|word| word != ".") {
            self.at += 1;
        }
        true
    }

    /// In a nested noun phrase, "that is ..." belongs to the noun before it when attachment is nearest.
    fn belongs_to_target(&self) -> bool {
        self.attachment == Attachment::Target || matches!(self.peek(), Some("it" | "is" | "are" | "was" | "there"))
    }

    fn push_relation(&mut self, entity: &mut Entity, word: RelationWord, negated: bool, depth: usize) {
        if self.lenient && self.skip_pronoun() {
            match (depth, &self.viewpoint) {
                // "facing the bed, ... to the left of it"
                (0, Some(viewpoint)) if !viewpoint.entering && viewpoint.at.noun != entity.noun => {
                    let mut anchor = viewpoint.at.clone();
                    anchor.relations.clear();
                    entity.relations.push(RelationTerm { word, negated, anchors: vec![anchor] });
                }
                (0, _) => self.read_thing_beside_it(entity, word),
                _ => self.note_about_target(word),
            }
            return;
        }
        if self.peek().is_some_and(|token| matches!(token, "it" | "them" | "me" | "you" | "which")) {
            self.at += 1;
            return;
        }
        self.about_target = None;
        let Some(mut first) = self.parse_entity(depth + 1) else { return };
        if self.lenient && first.noun == Noun::Anything && first.relations.is_empty() {
            // "in the middle of the other two", "next to the tall one"
            first.noun = entity.noun.clone();
        }
        // "with a lamp to its right": the target stands to the left of the lamp.
        if depth == 0
            && let Some(said) = self.about_target.take()
        {
            let word = viewpoint::inverse(said).unwrap_or(word);
            entity.relations.push(RelationTerm { word, negated, anchors: vec![first] });
            return;
        }

        let mut anchors = vec![first];
        if word == RelationWord::Between && self.skip_if(&["and"]) {
            anchors.extend(self.parse_entity(depth + 1));
        }
        // "next to the lamp and the chair": one relation to each.
        while word != RelationWord::Between
            && self.next_is(&["and"])
            && self.tokens.get(self.at + 1).is_some_and(|next| matches!(next.as_str(), "the" | "a" | "an"))
        {
            let start = self.at;
            self.at += 1;
            match self.parse_entity(depth + 1) {
                Some(more) => entity.relations.push(RelationTerm { word, negated, anchors: vec![more] }),
                None => {
                    self.at = start;
                    break;
                }
            }
        }
        entity.relations.push(RelationTerm { word, negated, anchors });
    }

    /// "from the left" decides how an ordinal counts.
    fn read_counted_from(&mut self, entity: &mut Entity) -> bool {
        let Some((length, order)) = words::find_counted_from(self.rest()) else { return false };
        self.at += length;
        match entity.selections.first_mut() {
            Some(selection) => selection.order = order,
            None => entity.selections.push(Selection { order, rank: 1 }),
        }
        true
    }

    fn read_made_of(&mut self, entity: &mut Entity, negated: bool) -> bool {
        let start = self.at;
        if !(self.skip_if(&["made", "of"]) || self.skip_if(&["made", "out", "of"]) || self.skip_if(&["made", "from"])) {
            return false;
        }
        match self.peek().and_then(|word| self.knowledge.words().materials.find(word)) {
            Some(material) => {
                let word = material.to_owned();
                entity.attributes.push(AttributeTerm { kind: AttributeWord::Material, word, negated });
                self.at += 1;
            }
            None => self.at = start + 1,
        }
        true
    }

    /// "to sit on", "for sitting", "you can drink from", "used to cut".
    fn read_purpose(&mut self, entity: &mut Entity) -> bool {
        let opens = ["to", "for", "can", "could"];
        let start = self.at;
        while self.peek().is_some_and(|word| matches!(word, "used" | "that" | "which" | "i" | "you" | "we" | "one")) {
            self.at += 1;
        }
        let opened = self.peek().is_some_and(|word| opens.contains(&word));
        let verb = self.tokens.get(self.at + 1);
        let Some(purpose) = verb.filter(|_| opened).and_then(|verb| self.knowledge.words().purposes.find(verb)) else {
            self.at = start;
            return false;
        };
        let word = purpose.to_owned();
        entity.attributes.push(AttributeTerm { kind: AttributeWord::Purpose, word, negated: false });
        self.known_words += 1;
        self.at += 2;
        if self.peek().is_some_and(|word| matches!(word, "on" | "in" | "from" | "with" | "at" | "out" | "down")) {
            // "to sit on in the bedroom": the first preposition belongs to the verb unless its anchor follows.
            let anchor_follows =
                self.tokens.get(self.at + 1).is_some_and(|next| matches!(next.as_str(), "the" | "a" | "an" | "my"));
            if !anchor_follows {
                self.at += 1;
            }
        }
        true
    }

    /// "facing the cabinets, right": a side that nothing follows.
    fn stands_alone(&self) -> bool {
        self.lenient
            && self.rest().get(1).is_none_or(|next| matches!(next.as_str(), "," | "." | "one" | "and" | "side"))
    }

    /// "that is red", ", red ,", "is the largest".
    fn read_predicate(&mut self, entity: &mut Entity, allowed: bool, negated: bool) -> bool {
        let Some(word) = self.peek().filter(|_| allowed) else { return false };
        if let Some(order) = words::find_superlative(word)
            .filter(|_| !matches!(word, "left" | "right" | "top" | "bottom") || self.stands_alone())
        {
            self.at += 1;
            entity.selections.push(Selection { order, rank: 1 });
            return true;
        }
        match noun::find_attribute(word, self.knowledge) {
            Some(term) => {
                self.at += 1;
                self.known_words += 1;
                entity.attributes.push(AttributeTerm { negated, ..term });
                true
            }
            None => false,
        }
    }
}
