//! Which thing a text of several clauses is about, when the first thing it names only sets the scene.

use super::noun::{self, Names};
use super::query::Noun;
use super::viewpoint::is_opener;
use super::words;
use crate::knowledge::Knowledge;

/// Words after which the thing that is meant is named.
const MARKERS: [&[&str]; 9] = [
    &["you", "want", "the"],
    &["you", "need", "the"],
    &["choose", "the"],
    &["select", "the"],
    &["pick", "the"],
    &["object", "is", "the"],
    &["it", "is", "the"],
    &["its", "the"],
    &["you", "find", "this"],
];
/// Below this likeness two names mean different things.
const DIFFERENT: f32 = 0.5;

/// The clause about the thing that is meant first, then the others; `None` when the text begins with it.
///
/// "There is a shelf between two doors. It is the door on the left": the door. "There are plants next to this cabinet":
/// the cabinet.
pub(super) fn with_subject_first(tokens: &[String], knowledge: &Knowledge, names: &Names) -> Option<Vec<String>> {
    // "Facing the window, choose the chair": a viewpoint, which the grammar reads.
    if tokens.first().is_none_or(|word| is_opener(word)) {
        return None;
    }
    let opened = tokens.iter().take_while(|word| is_opening(word)).count();
    let first = name_at(tokens, opened, knowledge, names);
    let differs = |other: &str| first.as_ref().is_none_or(|(first, _)| knowledge.similarity(first, other) < DIFFERENT);
    let starts = |at: usize, words: &[&str]| {
        words.len() <= tokens.len() - at && words.iter().zip(&tokens[at..]).all(|(word, token)| word == token)
    };
    let told = (opened + 1..tokens.len()).find_map(|at| {
        let marker = MARKERS.iter().find(|words| starts(at, words))?;
        // "It is the ..." says what is meant where a sentence begins.
        if marker[0].starts_with("it") && !matches!(tokens[at - 1].as_str(), "." | ",") {
            return None;
        }
        let noun = at + marker.len();
        let (name, _) = name_at(tokens, noun, knowledge, names)?;
        differs(&name).then_some((at, noun))
    });
    if opened == 0
        && let Some(turned) = from_place(tokens, knowledge, names)
    {
        return Some(turned);
    }
    if let Some((at, noun)) = told {
        let told = ["the".to_owned()].into_iter().chain(tokens[noun..].iter().cloned());
        let rest = tokens[..at].iter().cloned();
        return Some(told.chain([".".to_owned()]).chain(rest).collect());
    }
    // "there are plants next to this cabinet": the plants stand next to it.
    if !(starts(0, &["there", "is"]) || starts(0, &["there", "are"])) {
        return None;
    }
    let this = (opened + 1..tokens.len()).find(|at| tokens[*at] == "this")?;
    let related = (1..=4).any(|back| {
        let from = this.checked_sub(back).filter(|from| *from > opened);
        from.and_then(|from| words::find_relation(&tokens[from..])).is_some_and(|(length, _)| length == back)
    });
    let (name, length) = name_at(tokens, this + 1, knowledge, names)?;
    if !related || !differs(&name) {
        return None;
    }
    let end = this + 1 + length;
    let mut turned: Vec<String> = tokens[this..end].to_vec();
    turned.push(".".to_owned());
    turned.extend(tokens[..this].iter().cloned());
    turned.push("it".to_owned());
    turned.extend(tokens[end..].iter().cloned());
    Some(turned)
}

/// "In front of the desk is a chair with wheels": "a chair with wheels. It is in front of the desk".
fn from_place(tokens: &[String], knowledge: &Knowledge, names: &Names) -> Option<Vec<String>> {
    let hangs = tokens.first().is_some_and(|word| matches!(word.as_str(), "hanging" | "standing" | "sitting"));
    words::find_relation(&tokens[usize::from(hangs)..])?;
    let end = tokens.iter().position(|word| word == ".").unwrap_or(tokens.len());
    let verb = tokens[..end].windows(2).position(|pair| {
        matches!(pair[0].as_str(), "is" | "are" | "sits" | "stands" | "hangs")
            && matches!(pair[1].as_str(), "a" | "an" | "the" | "two" | "some")
    })?;
    name_at(tokens, verb + 2, knowledge, names)?;
    let mut turned = tokens[verb + 1..end].to_vec();
    turned.extend([".", "it", "is"].map(str::to_owned));
    turned.extend(tokens[..verb].iter().cloned());
    turned.extend(tokens[end..].iter().cloned());
    Some(turned)
}

fn is_opening(word: &str) -> bool {
    matches!(word, "there" | "is" | "are" | "a" | "an" | "the" | "this" | "it" | "some" | "no" | "two" | "three")
}

/// The thing that is named from a place on, and how many words that takes.
fn name_at(tokens: &[String], at: usize, knowledge: &Knowledge, names: &Names) -> Option<(String, usize)> {
    let rest = tokens.get(at..)?;
    let ends = |place: usize| words::is_function_word(&rest[place]) || words::find_relation(&rest[place..]).is_some();
    let run = (0..rest.len().min(6)).position(ends).unwrap_or(rest.len().min(6));
    if run == 0 {
        return None;
    }
    let head = noun::find_head(&rest[..run], knowledge, names);
    match head.noun {
        Noun::Thing(name) if head.known && !words::is_anything(&name) => Some((name, run)),
        _ => None,
    }
}
