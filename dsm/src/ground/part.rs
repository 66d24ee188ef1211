//! The part of a piece of furniture that a command is about: "the top drawer of the dresser".

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What kind of part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartKind {
    /// It slides out.
    Drawer,
    /// It swings on hinges.
    Door,
}

/// Which of several parts, as one sees them who stands before the furniture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartPlace {
    /// The highest.
    Top,
    /// The one between the others.
    Middle,
    /// The lowest.
    Bottom,
    /// The one farthest to the left.
    Left,
    /// The one farthest to the right.
    Right,
    /// Counted from the top, 0 for the first.
    FromTop(u8),
}

/// A part of what the target names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Part {
    /// Its kind, when it is said.
    pub kind: Option<PartKind>,
    /// Which one, when it is said.
    pub place: Option<PartPlace>,
}

const PLACES: &[(&str, PartPlace)] = &[
    ("top", PartPlace::Top),
    ("topmost", PartPlace::Top),
    ("upper", PartPlace::Top),
    ("uppermost", PartPlace::Top),
    ("highest", PartPlace::Top),
    ("middle", PartPlace::Middle),
    ("center", PartPlace::Middle),
    ("central", PartPlace::Middle),
    ("bottom", PartPlace::Bottom),
    ("bottommost", PartPlace::Bottom),
    ("lower", PartPlace::Bottom),
    ("lowest", PartPlace::Bottom),
    ("last", PartPlace::Bottom),
    ("left", PartPlace::Left),
    ("leftmost", PartPlace::Left),
    ("right", PartPlace::Right),
    ("rightmost", PartPlace::Right),
    ("first", PartPlace::FromTop(0)),
    ("second", PartPlace::FromTop(1)),
    ("third", PartPlace::FromTop(2)),
    ("fourth", PartPlace::FromTop(3)),
];

fn kind_of(word: &str) -> Option<PartKind> {
    match word {
        "drawer" | "drawers" => Some(PartKind::Drawer),
        "door" | "doors" => Some(PartKind::Door),
        _ => None,
    }
}

fn place_of(word: &str) -> Option<PartPlace> {
    PLACES.iter().find(|(name, _)| *name == word).map(|(_, place)| *place)
}

fn is_article(word: &str) -> bool {
    matches!(word, "the" | "a" | "an" | "its" | "your" | "my" | "our")
}

/// Splits what is to be opened into the words of the whole and the part of it: "the top drawer of the dresser", "the
/// dresser's top drawer", "the fridge door". Without a whole, or in "chest of drawers", the words stay as they are.
pub(super) fn split_part(tokens: &[String]) -> (&[String], Option<Part>) {
    let word = |at: usize| tokens.get(at).map(String::as_str).unwrap_or_default();
    let named = |at: &usize| kind_of(word(*at)).is_some() && (*at == 0 || word(*at - 1) != "of");
    let Some(at) = (0..tokens.len()).find(named) else { return (tokens, None) };
    let kind = kind_of(word(at));
    // Words that say which one stand right before it.
    let first = (0..at).rev().take_while(|i| place_of(word(*i)).is_some()).last().unwrap_or(at);
    let part = Part { kind, place: (first..at).find_map(|i| place_of(word(i))) };
    let before = &tokens[..first];
    if before.iter().all(|token| is_article(token)) {
        return match word(at + 1) {
            "of" | "in" | "on" | "at" | "from" if tokens.len() > at + 2 => (&tokens[at + 2..], Some(part)),
            _ => (tokens, None),
        };
    }
    if at + 1 == tokens.len() { (before, Some(part)) } else { (tokens, None) }
}

/// "the drawer", "the top drawer": a part whose whole is not said.
pub(super) fn find_bare_part(tokens: &[String]) -> Option<Part> {
    let words: Vec<&str> = tokens.iter().map(String::as_str).filter(|word| !is_article(word)).collect();
    let (last, places) = words.split_last()?;
    let kind = Some(kind_of(last)?);
    let places: Option<Vec<PartPlace>> = places.iter().map(|word| place_of(word)).collect();
    Some(Part { kind, place: places?.first().copied() })
}

/// "the mug out of the top drawer of the desk": the thing, the whole and the part that holds it; no words of the whole where
/// none is said ("the mug in the drawer").
pub(super) fn split_container(tokens: &[String]) -> Option<(&[String], &[String], Part)> {
    let word = |at: usize| tokens.get(at).map(String::as_str).unwrap_or_default();
    (1..tokens.len()).find_map(|at| {
        let length = match (word(at), word(at + 1)) {
            ("out", "of") | ("from", "inside" | "within") => 2,
            ("from" | "in" | "inside" | "within", _) => 1,
            _ => return None,
        };
        let rest = tokens.get(at + length..)?;
        // "The cup farthest from the door" is not behind it; a door whose whole is not said holds nothing.
        let is_distance = at > 0 && matches!(word(at - 1), "farthest" | "furthest" | "far" | "away");
        let bare = find_bare_part(rest).filter(|part| part.kind == Some(PartKind::Drawer) && !is_distance);
        match (split_part(rest), bare) {
            ((whole, Some(part)), _) => Some((&tokens[..at], whole, part)),
            ((_, None), Some(part)) => Some((&tokens[..at], &rest[..0], part)),
            ((_, None), None) => None,
        }
    })
}

#[cfg(test)]
mod tests {
    //! Contract: a part is told from its whole, however the two are put together; furniture whose name holds the word for a
    //! part is no part.
    use super::*;
    use crate::ground::words::tokens_of;

    fn split(text: &str) -> (String, Option<Part>) {
        let tokens = tokens_of(text);
        let (whole, part) = split_part(&tokens);
        (whole.join(" "), part)
    }

    #[test]
    fn things_are_taken_out_of_parts() {
        let split = |text: &str| {
            let tokens = tokens_of(text);
            split_container(&tokens).map(|(thing, whole, part)| (thing.join(" "), whole.join(" "), part.place))
        };
        let found = |thing: &str, whole: &str, place| Some((thing.to_owned(), whole.to_owned(), place));
        let top = Some(PartPlace::Top);
        assert_eq!(split("the mug out of the top drawer of the desk"), found("the mug", "the desk", top));
        assert_eq!(split("the red apple from the nightstand's drawer"), found("the red apple", "the nightstand", None));
        assert_eq!(
            split("the ball in the drawer of the dresser in the bedroom"),
            found("the ball", "the dresser in the bedroom", None)
        );
        assert_eq!(split("the mug in the drawer"), found("the mug", "", None));
        assert_eq!(split("the mug out of the top drawer"), found("the mug", "", top));
        assert_eq!(split("the cup farthest from the door"), None);
        assert_eq!(split("the cup farthest from the drawer"), None);
        assert_eq!(split("the mug in the kitchen"), None);
        assert_eq!(split("the mug next to the chest of drawers"), None);
    }

    #[test]
    fn parts_and_wholes() {
        use PartKind::{Door, Drawer};
        use PartPlace::{Bottom, FromTop, Left, Middle, Top};
        for (text, whole, kind, place) in [
            ("the top drawer of the dresser", "the dresser", Drawer, Some(Top)),
            ("the second drawer of the brown chest of drawers", "the brown chest of drawers", Drawer, Some(FromTop(1))),
            (
                "the bottom drawer in the nightstand next to the bed",
                "the nightstand next to the bed",
                Drawer,
                Some(Bottom),
            ),
            ("the drawer of the desk", "the desk", Drawer, None),
            ("the dresser's middle drawer", "the dresser", Drawer, Some(Middle)),
            ("the left door of the white wardrobe", "the white wardrobe", Door, Some(Left)),
            ("the fridge door", "the fridge", Door, None),
        ] {
            assert_eq!(split(text), (whole.to_owned(), Some(Part { kind: Some(kind), place })), "{text}");
        }
        for text in [
            "the chest of drawers",
            "the chest of drawers in the bedroom",
            "the wardrobe",
            "the drawer",
            "the top drawer",
        ] {
            assert_eq!(split(text), (text.to_owned(), None), "{text}");
        }
    }
}
