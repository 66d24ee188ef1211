//! Tokens, and look-up of the grammar's own words.

use super::lexicon::{COUNTED_FROM, FUNCTION_WORDS, ORDINALS, PLACES, RELATIONS, SUPERLATIVES};
use super::query::{Order, RelationWord};

/// Longest text, in characters, that is read; the rest is ignored.
pub(super) const MAX_CHARS: usize = 2_000;
/// Most tokens that are read.
pub(super) const MAX_TOKENS: usize = 160;

/// Lower-case words, with `,` and `.` for marks within and between sentences. Hyphens split words, apostrophes stay; control characters are spaces.
pub(super) fn tokens_of(text: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut word = String::new();
    let mut push = |word: &mut String, mark: Option<&str>| {
        if !word.is_empty() {
            let trimmed = word.trim_matches('\'');
            // "that's" and "isn't" are two words each.
            match trimmed.strip_suffix("'s") {
                Some(stem) if matches!(stem, "that" | "it" | "what" | "where" | "there" | "which") => {
                    tokens.extend([stem.to_owned(), "is".to_owned()]);
                }
                Some(stem) => tokens.push(stem.to_owned()),
                None => match trimmed.strip_suffix("n't") {
                    Some(stem) => tokens.extend([stem.to_owned(), "not".to_owned()]),
                    None if !trimmed.is_empty() => tokens.push(trimmed.to_owned()),
                    None => {}
                },
            }
            word.clear();
        }
        if let Some(mark) = mark
            && tokens.last().is_some_and(|last| !is_mark(last))
        {
            tokens.push(mark.to_owned());
        }
    };
    for c in text.chars().take(MAX_CHARS) {
        match c {
            '\u{2019}' | '\'' => word.push('\''),
            ',' | ':' | '(' | ')' => push(&mut word, Some(",")),
            '.' | ';' | '!' | '?' => push(&mut word, Some(".")),
            c if c.is_alphanumeric() => word.extend(c.to_lowercase()),
            _ => push(&mut word, None),
        }
    }
    push(&mut word, None);
    join_split_words(&mut tokens);
    while tokens.last().is_some_and(|last| is_mark(last)) {
        tokens.pop();
    }
    tokens.truncate(MAX_TOKENS);
    tokens
}

/// "left - most" is one word, "it 's" are two.
fn join_split_words(tokens: &mut Vec<String>) {
    let mut at = 0;
    while at + 1 < tokens.len() {
        let joined = match (tokens[at].as_str(), tokens[at + 1].as_str()) {
            ("left" | "right" | "top" | "bottom" | "upper" | "outer" | "middle", "most") => {
                format!("{}most", tokens[at])
            }
            ("it" | "that" | "there" | "which", "s") => {
                tokens[at + 1] = "is".to_owned();
                at += 1;
                continue;
            }
            ("closes", "to") => {
                tokens[at] = "closest".to_owned();
                continue;
            }
            // "the furthest left of the four"
            ("furthest" | "farthest", side @ ("left" | "right")) if tokens.get(at + 2).is_some_and(|t| t == "of") => {
                format!("{side}most")
            }
            ("wall", "mounted" | "mount" | "hung") => "mounted".to_owned(),
            _ => {
                at += 1;
                continue;
            }
        };
        tokens[at] = joined;
        tokens.remove(at + 1);
    }
}

fn find_in<T: Copy>(table: &[(&str, T)], tokens: &[String]) -> Option<(usize, T)> {
    let mut best: Option<(usize, T)> = None;
    for (phrase, value) in table {
        let length = phrase.split(' ').count();
        let fits = tokens.len() >= length && phrase.split(' ').zip(tokens).all(|(word, token)| word == token);
        if fits && best.is_none_or(|(longest, _)| length > longest) {
            best = Some((length, *value));
        }
    }
    best
}

fn is_mark(token: &str) -> bool {
    matches!(token, "," | ".")
}

/// The longest relation phrase at the start of `tokens`, with its length in tokens.
pub(super) fn find_relation(tokens: &[String]) -> Option<(usize, RelationWord)> {
    find_in(RELATIONS, tokens)
}

/// The longest place without an anchor at the start, unless an anchor follows.
pub(super) fn find_place(tokens: &[String]) -> Option<(usize, Order)> {
    let listed = find_in(PLACES, tokens).filter(|(length, _)| tokens.get(*length).is_none_or(|next| next != "of"));
    let built = find_built_place(tokens);
    match (listed, built) {
        (Some(listed), Some(built)) if built.0 > listed.0 => Some(built),
        (None, built) => built,
        (listed, _) => listed,
    }
}

/// "in the far corner of the room", "on the top left side", "by a corner": preposition, article, describing words,
/// "corner" or a side, and perhaps "of the room".
fn find_built_place(tokens: &[String]) -> Option<(usize, Order)> {
    let word = |at: usize| tokens.get(at).map_or("", String::as_str);
    let preposition = matches!(word(0), "in" | "on" | "at" | "to" | "near" | "by" | "into" | "towards");
    if !preposition || !matches!(word(1), "the" | "a" | "your" | "my" | "its") {
        return None;
    }
    let mut at = 2;
    while matches!(word(at), "far" | "very" | "back" | "front" | "top" | "bottom" | "upper" | "lower" | "immediate") {
        at += 1;
    }
    let side = match word(at) {
        "left" => Some(Order::Leftmost),
        "right" => Some(Order::Rightmost),
        _ => None,
    };
    at += usize::from(side.is_some());
    let corner = matches!(word(at), "corner" | "corners");
    at += usize::from(corner);
    if side.is_some() && !corner {
        at += usize::from(word(at) == "hand");
        at += usize::from(word(at) == "side");
    }
    let order = side.or(corner.then_some(Order::Corner))?;
    if word(at) == "of" {
        let room = word(at + 1) == "the" && matches!(word(at + 2), "room" | "space" | "image" | "picture");
        return room.then_some((at + 3, order));
    }
    Some((at, order))
}

/// "from the left" and the like at the start.
pub(super) fn find_counted_from(tokens: &[String]) -> Option<(usize, Order)> {
    find_in(COUNTED_FROM, tokens)
}

/// A superlative.
pub(super) fn find_superlative(token: &str) -> Option<Order> {
    SUPERLATIVES.iter().find(|(word, _)| *word == token).map(|(_, order)| *order)
}

/// An ordinal number.
pub(super) fn find_ordinal(token: &str) -> Option<u32> {
    ORDINALS.iter().find(|(word, _)| *word == token).map(|(_, rank)| *rank)
}

/// Whether the word belongs to the grammar rather than to a name.
pub(super) fn is_function_word(token: &str) -> bool {
    FUNCTION_WORDS.contains(&token)
}

/// Words that stand for any thing.
pub(super) fn is_anything(token: &str) -> bool {
    matches!(
        token,
        "something"
            | "anything"
            | "thing"
            | "things"
            | "object"
            | "objects"
            | "item"
            | "items"
            | "one"
            | "ones"
            | "stuff"
    )
}

/// Words that name a part or a group, so that "top of the shelf" speaks of the shelf.
pub(super) fn is_part_or_group(token: &str) -> bool {
    matches!(
        token,
        "top"
            | "side"
            | "edge"
            | "corner"
            | "middle"
            | "front"
            | "back"
            | "foot"
            | "head"
            | "end"
            | "row"
            | "pair"
            | "set"
            | "group"
            | "stack"
            | "pile"
            | "bunch"
            | "left"
            | "right"
            | "center"
            | "centre"
            | "bottom"
            | "surface"
            | "piece"
            | "kind"
            | "type"
            | "couple"
            | "rest"
            | "hand"
            | "series"
    )
}
