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
    while tokens.last().is_some_and(|last| is_mark(last)) {
        tokens.pop();
    }
    tokens.truncate(MAX_TOKENS);
    tokens
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
    find_in(PLACES, tokens).filter(|(length, _)| tokens.get(*length).is_none_or(|next| next != "of"))
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
