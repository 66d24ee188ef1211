//! Commands: what to do with what, and where.

use super::command_words::{ENDINGS, NOUNS_TOO, OPENINGS, VERBS};
use super::part::{Part, find_bare_part, split_container, split_part};
use super::query::RelationWord;
use super::words::{find_relation, tokens_of};
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
    /// Open it, or the part of it that is named.
    Open,
    /// Close it, or the part of it that is named.
    Close,
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
    /// With what; empty only for `explore`, for `place` and `bring` when they speak of what is held ("put it down on the
    /// table"), and for `close` when it speaks of what was opened before ("close it", "close the drawer").
    pub target: String,
    /// Where to, without its preposition.
    pub destination: Option<String>,
    /// Where the place lies to the thing that names it: to drive to the left of the target, to put something to the left
    /// of the destination. `None` for at it, on it or in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<RelationWord>,
    /// What of the target is to be opened or closed; `None` when the words name the whole alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<Part>,
    /// What holds the target, when it is to be taken out of a drawer or from behind a door: the words of the whole, empty
    /// when it is not said ("the mug in the drawer"); `part` says what to open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside: Option<String>,
    /// Whether it goes back to where it was taken from.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub back: bool,
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
    /// What is to be done afterwards begins with no verb that is known.
    #[error("`{found}` is no known command to go on with")]
    UnknownSequel {
        /// The words.
        found: String,
    },
    /// A place command without a place.
    #[error("`{verb}` needs a place, for example \"put the cup on the table\"")]
    NoDestination {
        /// The verb.
        verb: String,
    },
}

/// Splits a command into its verb, its target and its destination.
///
/// # Errors
/// [`Unparsed`] when there is no verb or nothing to act on.
pub fn parse_command(text: &str, knowledge: &Knowledge) -> Result<Command, Unparsed> {
    let command = parse_clause(text, knowledge)?;
    let tokens = tokens_of(text);
    let sequel = tokens.iter().rposition(|word| word == "then").map(|at| &tokens[at..]);
    match sequel.filter(|sequel| sequel.len() > 1) {
        Some(sequel) => Err(Unparsed::UnknownSequel { found: sequel.join(" ") }),
        None => Ok(command),
    }
}

/// As [`parse_command`], whatever is to be done afterwards.
pub(super) fn parse_clause(text: &str, knowledge: &Knowledge) -> Result<Command, Unparsed> {
    let tokens = tokens_of(text);
    let tokens = trim_ending(skip_openings(&tokens));
    let Some(first) = tokens.first() else { return Err(Unparsed::Empty) };
    let Some((length, action)) = find_verb(tokens, |_| true) else {
        let known =
            ["navigate to", "grasp", "put ... on", "bring ... to", "open", "close", "find", "explore"].join(", ");
        return Err(Unparsed::UnknownVerb { found: first.clone(), known });
    };
    let verb = tokens[..length].join(" ");
    let rest = &tokens[length..];
    if action == Action::Explore && !rest.iter().any(|word| knowledge.find_exact(word).is_some()) {
        return Ok(Command {
            action,
            target: String::new(),
            destination: None,
            region: None,
            part: None,
            inside: None,
            back: false,
        });
    }
    // "take the cup to the kitchen" carries it.
    let carried = action == Action::Grasp && split_at_receiver(rest).1.is_some();
    // "move next to the bed" moves the robot.
    let drives = verb == "move" && rest.len() > 1 && region_of(tokens, length).0.len() < rest.len();
    let action = match action {
        _ if carried => Action::Bring,
        _ if drives => Action::Navigate,
        action => action,
    };
    let (target, destination, region) = match action {
        Action::Place => split_at_place(rest, knowledge),
        Action::Bring => {
            let (target, destination) = split_at_receiver(rest);
            (target, destination, None)
        }
        Action::Navigate => {
            let (place, region) = region_of(tokens, length);
            (place, None, region)
        }
        _ => (rest, None, None),
    };
    let back = action == Action::Place
        && destination.is_none()
        && (target.last().is_some_and(|last| last == "back") || verb == "return" || verb == "put back");
    let target = without_particles(target);
    let (target, part) = match action {
        Action::Open | Action::Close => split_part(target),
        _ => (target, None),
    };
    // "close the drawer" is the one that stands open.
    let (target, part) = match (action, part.is_none().then(|| find_bare_part(target)).flatten()) {
        (Action::Close, Some(bare)) => (&target[..0], Some(bare)),
        _ => (target, part),
    };
    let (target, inside, part) = match (action, split_container(target)) {
        (Action::Grasp | Action::Bring, Some((target, whole, part))) => (target, Some(whole.join(" ")), Some(part)),
        _ => (target, None, part),
    };
    let target = if target.iter().all(|word| matches!(word.as_str(), "it" | "that" | "this" | "them" | "one")) {
        String::new()
    } else {
        target.join(" ")
    };
    let destination =
        destination.map(|words| words.join(" ")).filter(|words| !matches!(words.as_str(), "" | "me" | "us" | "here"));
    let command = Command { action, target, destination, region, part, inside, back };
    match (action, command.target.is_empty(), &command.destination) {
        (Action::Place, _, None) if !back => Err(Unparsed::NoDestination { verb }),
        (Action::Place, true, _) | (Action::Bring, true, Some(_)) => Ok(command),
        (Action::Close, true, _) if !rest.is_empty() => Ok(command),
        (_, true, _) if !back => Err(Unparsed::NoTarget { verb }),
        _ => Ok(command),
    }
}

/// The words after a command's verb, or all words when there is no verb. A verb that is a noun as well is not one here.
pub(super) fn without_verb(tokens: &[String]) -> &[String] {
    let opened = skip_openings(tokens);
    match find_verb(opened, |verb| !NOUNS_TOO.contains(&verb)) {
        Some((length, _)) if length < opened.len() => &opened[length..],
        _ => tokens,
    }
}

fn starts_with(tokens: &[String], phrase: &str) -> Option<usize> {
    let length = phrase.split(' ').count();
    (tokens.len() >= length && phrase.split(' ').zip(tokens).all(|(word, token)| word == token)).then_some(length)
}

fn find_verb(tokens: &[String], counts: impl Fn(&str) -> bool) -> Option<(usize, Action)> {
    let verbs = VERBS.iter().filter(|(verb, _)| counts(verb));
    let fits = verbs.filter_map(|(verb, action)| starts_with(tokens, verb).map(|length| (length, *action)));
    // The first of the longest.
    fits.fold(None, |best: Option<(usize, Action)>, found| match best {
        Some(best) if best.0 >= found.0 => Some(best),
        _ => Some(found),
    })
}

/// Whether a command begins here, with a verb that is no noun as well, unless what it acts on follows: "close to" is no
/// command, "close it" is one.
pub(super) fn starts_with_verb(tokens: &[String]) -> bool {
    /// What begins the object of a verb.
    const OBJECTS: &[&str] = &["it", "them", "that", "this", "the", "a", "an", "its", "all", "every"];
    let opened = skip_openings(tokens);
    let acts = |length: usize| opened.get(length).is_some_and(|next| OBJECTS.contains(&next.as_str()));
    let verbs = VERBS.iter().filter_map(|(verb, _)| starts_with(opened, verb).map(|length| (verb, length)));
    verbs.into_iter().any(|(verb, length)| !NOUNS_TOO.contains(verb) || acts(length))
}

fn skip_openings(mut tokens: &[String]) -> &[String] {
    while let Some(length) = OPENINGS.iter().filter_map(|opening| starts_with(tokens, opening)).max() {
        // "go and get" opens, "go" alone is the verb.
        tokens = &tokens[length..];
    }
    tokens
}

fn trim_ending(mut tokens: &[String]) -> &[String] {
    let ends_with = |tokens: &[String], phrase: &str| {
        let length = phrase.split(' ').count();
        (tokens.len() > length).then(|| starts_with(&tokens[tokens.len() - length..], phrase)).flatten()
    };
    while let Some(length) = ENDINGS.iter().filter_map(|ending| ends_with(tokens, ending)).max() {
        tokens = &tokens[..tokens.len() - length];
    }
    if matches!(tokens.last().map(String::as_str), Some("please" | "," | ".")) && tokens.len() == 1 {
        return &[];
    }
    tokens
}

/// "the mug up", "it back down": the target without the verb's particle.
fn without_particles(mut target: &[String]) -> &[String] {
    while let Some((last, rest)) = target.split_last()
        && matches!(last.as_str(), "up" | "down" | "back" | "away" | "over" | "again" | "," | ".")
    {
        target = rest;
    }
    while let Some((first, rest)) = target.split_first()
        && matches!(first.as_str(), "down" | "up" | "back" | "over")
    {
        target = rest;
    }
    target
}

/// A relation that names a place beside a thing, rather than the thing itself.
fn lies_beside(word: RelationWord) -> bool {
    use RelationWord::{Behind, InFrontOf, LeftOf, NextTo, RightOf, Under};
    matches!(word, LeftOf | RightOf | InFrontOf | Behind | NextTo | Under)
}

/// "go to the left of the lamp": the lamp, and where the place lies to it. `verb` is the number of tokens of the verb.
fn region_of(tokens: &[String], verb: usize) -> (&[String], Option<RelationWord>) {
    // "go to" takes the "to" of "to the left of".
    let starts = [verb, verb - usize::from(tokens[verb - 1] == "to")];
    for start in starts {
        if let Some((length, word)) = find_relation(&tokens[start..])
            && start + length > verb
            && tokens.len() > start + length
        {
            return (&tokens[start + length..], Some(word).filter(|word| lies_beside(*word)));
        }
    }
    (&tokens[verb..], None)
}

/// A place where a target may end and its destination begin.
struct Place {
    at: usize,
    length: usize,
    /// `None` for "to", else the relation.
    word: Option<RelationWord>,
}

/// "X on Y": the last place word splits, because X may carry its own ("the cup on the desk on the shelf"), but a room at
/// the end belongs to Y ("in the bowl in the kitchen"). "into", "onto" and "back on" always split.
fn split_at_place<'a>(
    tokens: &'a [String],
    knowledge: &Knowledge,
) -> (&'a [String], Option<&'a [String]>, Option<RelationWord>) {
    let places = find_places(tokens);
    let split = |place: &Place| {
        let region = place.word.filter(|word| lies_beside(*word));
        (&tokens[..place.at], Some(&tokens[place.at + place.length..]), region)
    };
    let moves = |place: &&Place| {
        let particle = place.at.checked_sub(1).map(|i| tokens[i].as_str());
        matches!(tokens[place.at].as_str(), "into" | "onto") || matches!(particle, Some("back" | "down"))
    };
    if let Some(place) = places.iter().find(moves) {
        return split(place);
    }
    let is_room = |place: &Place| {
        let words: Vec<&str> =
            tokens[place.at + place.length..].iter().map(String::as_str).filter(|word| *word != "the").collect();
        knowledge.words().rooms.find(&words.join(" ")).is_some()
    };
    let holds = |place: &&Place| matches!(place.word, Some(RelationWord::On | RelationWord::In));
    let on_or_in: Vec<&Place> = places.iter().filter(holds).collect();
    match on_or_in.as_slice() {
        [] => places.last().map_or((tokens, None, None), split),
        [one] => split(one),
        [.., before, last] if is_room(last) => split(before),
        [.., last] => split(last),
    }
}

fn find_places(tokens: &[String]) -> Vec<Place> {
    let mut places = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let relation = find_relation(&tokens[at..]);
        let (length, word) = match relation {
            Some((length, word)) => (length, Some(word)),
            None if tokens[at] == "to" => (1, None),
            None => {
                at += 1;
                continue;
            }
        };
        let named = tokens.len() > at + length;
        let described = at > 0 && matches!(tokens[at - 1].as_str(), "is" | "are" | "not" | "lies" | "stands" | "sits");
        use RelationWord::{Above, Against, Below, Between, Closest, Far, Farthest, With};
        let describes = matches!(word, Some(With | Closest | Farthest | Far | Between | Above | Below | Against));
        if named && !described && !describes {
            places.push(Place { at, length, word });
        }
        at += length;
    }
    places
}

/// "X to Y": the last "to" that is not part of "next to".
fn split_at_receiver(tokens: &[String]) -> (&[String], Option<&[String]>) {
    let tokens = tokens.strip_prefix(&["me".to_owned()]).unwrap_or(tokens);
    // "the mug over to me": a receiver that is here names no place.
    let receives = |place: &&Place| {
        let next = tokens.get(place.at + 1).map(String::as_str);
        place.word.is_none() && !matches!(next, Some("sit" | "drink" | "eat" | "write" | "read" | "cut" | "lie"))
    };
    match find_places(tokens).iter().rev().find(receives) {
        Some(place) => (&tokens[..place.at], Some(&tokens[place.at + 1..])),
        None => (tokens, None),
    }
}
