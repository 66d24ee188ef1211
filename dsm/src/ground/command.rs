//! Commands: what to do with what, and where.

use super::words::tokens_of;
use crate::knowledge::Knowledge;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What the robot is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Drive to it.
    Navigate,
    /// Pick it up.
    Grasp,
    /// Put it somewhere.
    Place,
    /// Fetch it, and carry it to the destination or, without one, to where the command was given.
    Bring,
    /// Say where it is.
    Find,
    /// Look around until the surroundings are known; the target is empty.
    Explore,
}

/// A command in parts; the parts are referring expressions for [`super::Grounder::ground`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Command {
    /// What to do.
    pub action: Action,
    /// With what; empty only for `explore`, and for `place` when it speaks of what is held ("put it down on the table").
    pub target: String,
    /// Where to, without its preposition.
    pub destination: Option<String>,
}

/// Why words are not a command.
#[derive(Clone, Debug, PartialEq, Eq, Error, Serialize, Deserialize)]
pub enum Unparsed {
    /// There are no words.
    #[error("the command is empty")]
    Empty,
    /// The first word is no verb that is known.
    #[error("`{found}` is no known command; known: {known}")]
    UnknownVerb {
        /// The word.
        found: String,
        /// Verbs that are known.
        known: String,
    },
    /// The verb stands alone.
    #[error("`{verb}` needs something to act on")]
    NoTarget {
        /// The verb.
        verb: String,
    },
    /// A place command without a place.
    #[error("`{verb}` needs a place, for example \"put the cup on the table\"")]
    NoDestination {
        /// The verb.
        verb: String,
    },
}

const VERBS: &[(&str, Action)] = &[
    ("navigate to", Action::Navigate),
    ("navigate", Action::Navigate),
    ("go to", Action::Navigate),
    ("go", Action::Navigate),
    ("drive to", Action::Navigate),
    ("drive", Action::Navigate),
    ("move to", Action::Navigate),
    ("move over to", Action::Navigate),
    ("walk to", Action::Navigate),
    ("head to", Action::Navigate),
    ("come to", Action::Navigate),
    ("approach", Action::Navigate),
    ("visit", Action::Navigate),
    ("enter", Action::Navigate),
    ("grasp", Action::Grasp),
    ("grab", Action::Grasp),
    ("pick up", Action::Grasp),
    ("pick", Action::Grasp),
    ("take", Action::Grasp),
    ("lift", Action::Grasp),
    ("lift up", Action::Grasp),
    ("get", Action::Grasp),
    ("hold", Action::Grasp),
    ("fetch", Action::Bring),
    ("fetch me", Action::Bring),
    ("bring", Action::Bring),
    ("bring me", Action::Bring),
    ("get me", Action::Bring),
    ("give me", Action::Bring),
    ("hand me", Action::Bring),
    ("deliver", Action::Bring),
    ("carry", Action::Bring),
    ("put", Action::Place),
    ("put down", Action::Place),
    ("place", Action::Place),
    ("set", Action::Place),
    ("set down", Action::Place),
    ("lay", Action::Place),
    ("drop", Action::Place),
    ("move", Action::Place),
    ("find", Action::Find),
    ("look for", Action::Find),
    ("search for", Action::Find),
    ("search", Action::Find),
    ("locate", Action::Find),
    ("select", Action::Find),
    ("choose", Action::Find),
    ("identify", Action::Find),
    ("where is", Action::Find),
    ("where are", Action::Find),
    ("show me", Action::Find),
    ("point to", Action::Find),
    ("explore", Action::Explore),
    ("look around", Action::Explore),
    ("scan", Action::Explore),
];

/// Words of politeness before the verb.
const OPENINGS: &[&str] = &[
    "please",
    "robot",
    "porter",
    "hey",
    "hi",
    "hello",
    "ok",
    "okay",
    "now",
    "then",
    "could you",
    "can you",
    "would you",
    "will you",
    "i want you to",
    "i would like you to",
    "i need you to",
    "you should",
    "kindly",
    ",",
    ".",
    "and",
    "go and",
    "go ahead and",
    "try to",
    "let us",
    "first",
];

/// Splits a command into its verb, its target and its destination.
///
/// # Errors
/// [`Unparsed`] when there is no verb or nothing to act on.
pub fn parse_command(text: &str, knowledge: &Knowledge) -> Result<Command, Unparsed> {
    let tokens = tokens_of(text);
    let tokens = trim_ending(skip_openings(&tokens));
    let Some(first) = tokens.first() else { return Err(Unparsed::Empty) };
    let Some((length, action)) = find_verb(tokens) else {
        let known = ["navigate to", "grasp", "put ... on", "bring ... to", "find", "explore"].join(", ");
        return Err(Unparsed::UnknownVerb { found: first.clone(), known });
    };
    let verb = tokens[..length].join(" ");
    let rest = &tokens[length..];
    if action == Action::Explore {
        return Ok(Command { action, target: String::new(), destination: None });
    }
    let (target, destination) = match action {
        Action::Place => split_at_place(rest, knowledge),
        Action::Bring => split_at_receiver(rest),
        _ => (rest, None),
    };
    let target = if target.iter().all(|word| matches!(word.as_str(), "it" | "that" | "down" | "them")) {
        String::new()
    } else {
        target.join(" ")
    };
    let destination =
        destination.map(|words| words.join(" ")).filter(|words| !matches!(words.as_str(), "" | "me" | "us"));
    match (action, target.is_empty(), &destination) {
        (Action::Place, _, None) => Err(Unparsed::NoDestination { verb }),
        (Action::Place, true, Some(_)) => Ok(Command { action, target, destination }),
        (_, true, _) => Err(Unparsed::NoTarget { verb }),
        _ => Ok(Command { action, target, destination }),
    }
}

/// The words after a command's verb, or all words when there is no verb.
pub(super) fn without_verb(tokens: &[String]) -> &[String] {
    let opened = skip_openings(tokens);
    match find_verb(opened) {
        Some((length, _)) if length < opened.len() => &opened[length..],
        _ => tokens,
    }
}

fn starts_with(tokens: &[String], phrase: &str) -> Option<usize> {
    let length = phrase.split(' ').count();
    (tokens.len() >= length && phrase.split(' ').zip(tokens).all(|(word, token)| word == token)).then_some(length)
}

fn find_verb(tokens: &[String]) -> Option<(usize, Action)> {
    let fits = VERBS.iter().filter_map(|(verb, action)| starts_with(tokens, verb).map(|length| (length, *action)));
    // The first of the longest.
    fits.fold(None, |best: Option<(usize, Action)>, found| match best {
        Some(best) if best.0 >= found.0 => Some(best),
        _ => Some(found),
    })
}

fn skip_openings(mut tokens: &[String]) -> &[String] {
    while let Some(length) = OPENINGS.iter().filter_map(|opening| starts_with(tokens, opening)).max() {
        // "go and get" opens, "go" alone is the verb.
        tokens = &tokens[length..];
    }
    tokens
}

fn trim_ending(mut tokens: &[String]) -> &[String] {
    while let Some((last, rest)) = tokens.split_last()
        && matches!(last.as_str(), "please" | "," | "." | "now" | "thanks")
    {
        tokens = rest;
    }
    tokens
}

/// "X on Y": the last place word splits, because X may carry its own ("the cup on the desk on the shelf"), but a room at
/// the end belongs to Y ("in the bowl in the kitchen"). "into" and "onto" always split.
fn split_at_place<'a>(tokens: &'a [String], knowledge: &Knowledge) -> (&'a [String], Option<&'a [String]>) {
    let split = |at: usize, length: usize| (&tokens[..at], Some(&tokens[at + length..]));
    if let Some(at) = tokens.iter().position(|word| matches!(word.as_str(), "into" | "onto")) {
        return split(at, 1);
    }
    let is_room = |at: usize| {
        let words: Vec<&str> = tokens[at + 1..].iter().map(String::as_str).filter(|word| *word != "the").collect();
        knowledge.words().rooms.find(&words.join(" ")).is_some()
    };
    let places = ["on top of", "on", "in", "inside", "under", "at", "next to", "beside", "near", "to"];
    let found = |wanted: &[&str]| {
        let fits = |at: usize| wanted.iter().filter_map(|p| starts_with(&tokens[at..], p)).max().map(|n| (at, n));
        (0..tokens.len()).rev().filter_map(fits).find(|(at, _)| !follows_relation(tokens, *at))
    };
    let on_or_in: Vec<(usize, usize)> = (0..tokens.len())
        .filter(|at| !follows_relation(tokens, *at))
        .filter_map(|at| places[..4].iter().filter_map(|p| starts_with(&tokens[at..], p)).max().map(|n| (at, n)))
        .collect();
    match on_or_in.as_slice() {
        [] => found(&places[4..]).map_or((tokens, None), |(at, n)| split(at, n)),
        [(at, n)] => split(*at, *n),
        [.., (before_at, before_n), (last_at, last_n)] => {
            if is_room(*last_at) {
                split(*before_at, *before_n)
            } else {
                split(*last_at, *last_n)
            }
        }
    }
}

/// Whether the word at `at` is the inside of a longer relation phrase: "on the left of", "in front of", "next to".
fn follows_relation(tokens: &[String], at: usize) -> bool {
    let before = at.checked_sub(1).map(|i| tokens[i].as_str());
    let after = tokens.get(at + 1).map(String::as_str);
    let last = tokens.len() == at + 1;
    last || (tokens[at] == "in" && matches!(after, Some("front" | "between" | "back")))
        || matches!(before, Some("is" | "are" | "not"))
        || (tokens[at] == "to" && matches!(before, Some("next" | "close" | "closest" | "nearest" | "adjacent")))
}

/// "X to Y": the last "to" that is not part of "next to".
fn split_at_receiver(tokens: &[String]) -> (&[String], Option<&[String]>) {
    let tokens = tokens.strip_prefix(&["me".to_owned()]).unwrap_or(tokens);
    let is_receiver = |at: &usize| {
        let before = at.checked_sub(1).map(|i| tokens[i].as_str());
        tokens[*at] == "to"
            && !matches!(before, None | Some("next" | "close" | "closest" | "nearest" | "adjacent"))
            && tokens.get(at + 1).is_some_and(|next| !matches!(next.as_str(), "left" | "right" | "sit" | "drink"))
            && !(starts_with(&tokens[*at..], "to the left").is_some()
                || starts_with(&tokens[*at..], "to the right").is_some())
    };
    match (0..tokens.len()).rev().find(is_receiver) {
        Some(at) => (&tokens[..at], Some(&tokens[at + 1..])),
        None => (tokens, None),
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a command's verb, target and destination are found in ordinary wordings; anything else is a typed refusal.
    use super::*;

    fn parse(text: &str) -> Result<Command, Unparsed> {
        parse_command(text, &Knowledge::embedded().unwrap())
    }

    #[test]
    fn ordinary_commands() {
        let cases = [
            (
                "Grasp the apple on the white shelf with white cabinet",
                Action::Grasp,
                "the apple on the white shelf with white cabinet",
                None,
            ),
            ("please pick up the red mug.", Action::Grasp, "the red mug", None),
            ("Navigate to the blue book", Action::Navigate, "the blue book", None),
            ("Could you go to the kitchen?", Action::Navigate, "the kitchen", None),
            ("put the apple on the table", Action::Place, "the apple", Some("the table")),
            (
                "Put the cup on the desk on the white shelf",
                Action::Place,
                "the cup on the desk",
                Some("the white shelf"),
            ),
            ("place the apple in the bowl in the kitchen", Action::Place, "the apple", Some("the bowl in the kitchen")),
            ("put it down on the table", Action::Place, "", Some("the table")),
            ("put the mug on the table next to the lamp", Action::Place, "the mug", Some("the table next to the lamp")),
            (
                "bring the mug next to the sink to the bedroom",
                Action::Bring,
                "the mug next to the sink",
                Some("the bedroom"),
            ),
            ("bring me the banana", Action::Bring, "the banana", None),
            ("fetch the ball to the left of the sofa", Action::Bring, "the ball to the left of the sofa", None),
            ("where is my phone", Action::Find, "my phone", None),
            ("go and get the apple", Action::Grasp, "the apple", None),
        ];
        for (text, action, target, destination) in cases {
            let command = parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(command.action, action, "{text}");
            assert_eq!(command.target, target, "{text}");
            assert_eq!(command.destination.as_deref(), destination, "{text}");
        }
        assert_eq!(parse("explore").unwrap().action, Action::Explore);
    }

    #[test]
    fn refusals_are_typed() {
        assert_eq!(parse(""), Err(Unparsed::Empty));
        assert_eq!(parse("\u{0}\u{7f}"), Err(Unparsed::Empty));
        assert!(matches!(parse("dance wildly"), Err(Unparsed::UnknownVerb { .. })));
        assert!(matches!(parse("grasp"), Err(Unparsed::NoTarget { .. })));
        assert!(matches!(parse("put the cup"), Err(Unparsed::NoDestination { .. })));
    }
}
