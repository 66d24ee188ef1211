//! What stands after a head noun: relations, predicates, purposes, materials.

use super::noun;
use super::parse::{Attachment, Parser};
use super::query::{AttributeTerm, AttributeWord, Entity, Noun, Order, RelationTerm, RelationWord, Selection};
use super::{viewpoint, words};

impl Parser<'_> {
    /// Reads all modifiers that belong to the entity.
    pub(super) fn parse_modifiers(&mut self, entity: &mut Entity, depth: usize) {
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
            if self.read_exclusion(entity, depth) || self.read_source(entity, depth) {
                negated = false;
                continue;
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
    pub(super) fn skip_foreign_sentence(&mut self, entity: &mut Entity) -> bool {
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
    pub(super) fn belongs_to_target(&self) -> bool {
        self.attachment == Attachment::Target || matches!(self.peek(), Some("it" | "is" | "are" | "was" | "there"))
    }

    pub(super) fn push_relation(&mut self, entity: &mut Entity, word: RelationWord, negated: bool, depth: usize) {
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
        let start = self.at;
        let mut first = match self.parse_entity(depth + 1) {
            Some(first) => first,
            // "to the right of another": of its own kind.
            None if self.lenient
                && self.tokens[start..self.at.max(start)]
                    .iter()
                    .any(|word| matches!(word.as_str(), "another" | "other")) =>
            {
                Entity::named(entity.noun.clone())
            }
            None => return,
        };
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
    pub(super) fn read_counted_from(&mut self, entity: &mut Entity) -> bool {
        let Some((length, order)) = words::find_counted_from(self.rest()) else { return false };
        self.at += length;
        match entity.selections.first_mut() {
            Some(selection) => selection.order = order,
            None => entity.selections.push(Selection { order, rank: 1 }),
        }
        true
    }

    pub(super) fn read_made_of(&mut self, entity: &mut Entity, negated: bool) -> bool {
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
    pub(super) fn read_purpose(&mut self, entity: &mut Entity) -> bool {
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
    pub(super) fn stands_alone(&self) -> bool {
        self.lenient
            && self.rest().get(1).is_none_or(|next| matches!(next.as_str(), "," | "." | "one" | "and" | "side"))
    }

    /// "that is red", ", red ,", "is the largest".
    pub(super) fn read_predicate(&mut self, entity: &mut Entity, allowed: bool, negated: bool) -> bool {
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
