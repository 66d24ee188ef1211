//! Tokens and the closed word classes of the grammar.

use super::query::{Order, RelationWord};

/// Longest text, in characters, that is read; the rest is ignored.
pub(super) const MAX_CHARS: usize = 2_000;
/// Most tokens that are read.
pub(super) const MAX_TOKENS: usize = 160;

/// Lower-case words, with `,` for any sentence mark. Hyphens split words, apostrophes stay; control characters are spaces.
pub(super) fn tokens_of(text: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut word = String::new();
    let mut push = |word: &mut String, mark: bool| {
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
        if mark && tokens.last().is_some_and(|last| last != ",") {
            tokens.push(",".to_owned());
        }
    };
    for c in text.chars().take(MAX_CHARS) {
        match c {
            '\u{2019}' | '\'' => word.push('\''),
            ',' | '.' | ';' | ':' | '!' | '?' | '(' | ')' => push(&mut word, true),
            c if c.is_alphanumeric() => word.extend(c.to_lowercase()),
            _ => push(&mut word, false),
        }
    }
    push(&mut word, false);
    while tokens.last().is_some_and(|last| last == ",") {
        tokens.pop();
    }
    tokens.truncate(MAX_TOKENS);
    tokens
}

/// Relation phrases. The longest that fits wins.
const RELATIONS: &[(&str, RelationWord)] = &[
    ("on", RelationWord::On),
    ("on top of", RelationWord::On),
    ("upon", RelationWord::On),
    ("atop", RelationWord::On),
    ("onto", RelationWord::On),
    ("hanging on", RelationWord::On),
    ("supported by", RelationWord::On),
    ("in", RelationWord::In),
    ("inside", RelationWord::In),
    ("inside of", RelationWord::In),
    ("within", RelationWord::In),
    ("into", RelationWord::In),
    ("under", RelationWord::Under),
    ("underneath", RelationWord::Under),
    ("beneath", RelationWord::Under),
    ("supporting", RelationWord::Under),
    ("above", RelationWord::Above),
    ("over", RelationWord::Above),
    ("below", RelationWord::Below),
    ("next to", RelationWord::NextTo),
    ("beside", RelationWord::NextTo),
    ("besides", RelationWord::NextTo),
    ("adjacent to", RelationWord::NextTo),
    ("alongside", RelationWord::NextTo),
    ("at the side of", RelationWord::NextTo),
    ("on the side of", RelationWord::NextTo),
    ("to the side of", RelationWord::NextTo),
    ("near", RelationWord::Near),
    ("near to", RelationWord::Near),
    ("nearby", RelationWord::Near),
    ("by", RelationWord::Near),
    ("close to", RelationWord::Near),
    ("at", RelationWord::Near),
    ("around", RelationWord::Near),
    ("far from", RelationWord::Far),
    ("far away from", RelationWord::Far),
    ("away from", RelationWord::Far),
    ("against", RelationWord::Against),
    ("touching", RelationWord::Against),
    ("leaning on", RelationWord::Against),
    ("with", RelationWord::With),
    ("that has", RelationWord::With),
    ("which has", RelationWord::With),
    ("having", RelationWord::With),
    ("holding", RelationWord::With),
    ("containing", RelationWord::With),
    ("that contains", RelationWord::With),
    ("left of", RelationWord::LeftOf),
    ("to the left of", RelationWord::LeftOf),
    ("on the left of", RelationWord::LeftOf),
    ("to the left side of", RelationWord::LeftOf),
    ("on the left side of", RelationWord::LeftOf),
    ("on the left hand side of", RelationWord::LeftOf),
    ("right of", RelationWord::RightOf),
    ("to the right of", RelationWord::RightOf),
    ("on the right of", RelationWord::RightOf),
    ("to the right side of", RelationWord::RightOf),
    ("on the right side of", RelationWord::RightOf),
    ("on the right hand side of", RelationWord::RightOf),
    ("in front of", RelationWord::InFrontOf),
    ("infront of", RelationWord::InFrontOf),
    ("before", RelationWord::InFrontOf),
    ("behind", RelationWord::Behind),
    ("in back of", RelationWord::Behind),
    ("at the back of", RelationWord::Behind),
    ("between", RelationWord::Between),
    ("in between", RelationWord::Between),
    ("in the middle of", RelationWord::Between),
    ("closest to", RelationWord::Closest),
    ("nearest to", RelationWord::Closest),
    ("nearest", RelationWord::Closest),
    ("closest", RelationWord::Closest),
    ("farthest from", RelationWord::Farthest),
    ("furthest from", RelationWord::Farthest),
    ("farthest away from", RelationWord::Farthest),
    ("furthest away from", RelationWord::Farthest),
];

/// Places given without an anchor.
const PLACES: &[(&str, Order)] = &[
    ("on the left", Order::Leftmost),
    ("to the left", Order::Leftmost),
    ("on the left side", Order::Leftmost),
    ("on the far left", Order::Leftmost),
    ("to the far left", Order::Leftmost),
    ("on the right", Order::Rightmost),
    ("to the right", Order::Rightmost),
    ("on the right side", Order::Rightmost),
    ("on the far right", Order::Rightmost),
    ("to the far right", Order::Rightmost),
    ("in the middle", Order::Middle),
    ("in the center", Order::Middle),
    ("in the centre", Order::Middle),
    ("at the top", Order::Highest),
    ("on the top", Order::Highest),
    ("at the bottom", Order::Lowest),
    ("on the bottom", Order::Lowest),
    ("closest to me", Order::Nearest),
    ("nearest to me", Order::Nearest),
    ("nearest me", Order::Nearest),
    ("closest to you", Order::Nearest),
    ("nearest to you", Order::Nearest),
    ("farthest from me", Order::Farthest),
    ("furthest from me", Order::Farthest),
    ("farthest from you", Order::Farthest),
    ("farthest away", Order::Farthest),
    ("furthest away", Order::Farthest),
];

/// Directions in which ordinals count.
const COUNTED_FROM: &[(&str, Order)] = &[
    ("from the left", Order::Leftmost),
    ("from left", Order::Leftmost),
    ("from the right", Order::Rightmost),
    ("from right", Order::Rightmost),
    ("from the top", Order::Highest),
    ("from the bottom", Order::Lowest),
    ("from me", Order::Nearest),
];

const SUPERLATIVES: &[(&str, Order)] = &[
    ("nearest", Order::Nearest),
    ("closest", Order::Nearest),
    ("farthest", Order::Farthest),
    ("furthest", Order::Farthest),
    ("largest", Order::Largest),
    ("biggest", Order::Largest),
    ("smallest", Order::Smallest),
    ("littlest", Order::Smallest),
    ("tallest", Order::Tallest),
    ("shortest", Order::Shortest),
    ("highest", Order::Highest),
    ("topmost", Order::Highest),
    ("uppermost", Order::Highest),
    ("lowest", Order::Lowest),
    ("bottommost", Order::Lowest),
    ("longest", Order::Longest),
    ("leftmost", Order::Leftmost),
    ("rightmost", Order::Rightmost),
    ("left", Order::Leftmost),
    ("right", Order::Rightmost),
    ("middle", Order::Middle),
    ("center", Order::Middle),
    ("centre", Order::Middle),
    ("central", Order::Central),
    ("top", Order::Highest),
    ("bottom", Order::Lowest),
];

const ORDINALS: &[(&str, u32)] = &[
    ("first", 1),
    ("1st", 1),
    ("second", 2),
    ("2nd", 2),
    ("third", 3),
    ("3rd", 3),
    ("fourth", 4),
    ("4th", 4),
    ("fifth", 5),
    ("5th", 5),
    ("sixth", 6),
    ("6th", 6),
];

/// Words that end a run of content words.
const FUNCTION_WORDS: &[&str] = &[
    ",",
    "the",
    "a",
    "an",
    "this",
    "that",
    "these",
    "those",
    "some",
    "any",
    "my",
    "your",
    "our",
    "his",
    "her",
    "its",
    "is",
    "are",
    "was",
    "be",
    "been",
    "it",
    "which",
    "who",
    "where",
    "there",
    "and",
    "or",
    "but",
    "not",
    "no",
    "of",
    "to",
    "for",
    "from",
    "without",
    "me",
    "you",
    "i",
    "we",
    "them",
    "they",
    "can",
    "could",
    "one's",
    "as",
    "if",
    "when",
    "has",
    "have",
    "also",
    "so",
    "than",
    "then",
    "please",
    "made",
    "used",
    "located",
    "placed",
    "standing",
    "sitting",
    "lying",
    "stands",
    "sits",
    "lies",
    "resting",
    "rests",
    "mounted",
    "stored",
    "kept",
    "positioned",
    "situated",
    "found",
    "currently",
    "directly",
    "right's",
    "just",
    "very",
    "do",
    "does",
    "looks",
    "like",
    "toward",
    "towards",
    "facing",
    "directly",
    "immediately",
    "all",
    "other",
    "both",
];

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
    )
}
