//! Sequences: several commands in one sentence.

use super::command::{parse_clause, parse_command, starts_with_verb};
use super::words::tokens_of;
use crate::knowledge::Knowledge;

/// What stands between two commands.
const JOINTS: &[&str] = &["and", "then", ",", ".", ";", "afterwards", "finally"];

/// The commands of a text, in order: it is divided where a word that joins is followed by a verb, and both sides are
/// commands. A text that is one command, or none, comes back whole.
///
/// ```
/// use dsm::ground::split_sequence;
/// use dsm::knowledge::Knowledge;
///
/// let knowledge = Knowledge::embedded().unwrap();
/// let parts = split_sequence("Put the apple on the desk, then go to the sofa and table", &knowledge);
/// assert_eq!(parts, ["put the apple on the desk", "go to the sofa and table"]);
/// ```
pub fn split_sequence(text: &str, knowledge: &Knowledge) -> Vec<String> {
    let tokens = tokens_of(text);
    let mut parts = Vec::new();
    let mut rest = &tokens[..];
    while let Some((first, after)) = find_split(rest, knowledge) {
        parts.push(first.join(" "));
        rest = after;
    }
    if parts.is_empty() {
        return vec![text.to_owned()];
    }
    parts.push(rest.join(" "));
    parts
}

/// The first command of the tokens and what follows it.
fn find_split<'a>(tokens: &'a [String], knowledge: &Knowledge) -> Option<(&'a [String], &'a [String])> {
    let joins = |token: &String| JOINTS.contains(&token.as_str());
    let is_command = |tokens: &[String]| parse_command(&tokens.join(" "), knowledge).is_ok();
    // It may be divided further.
    let begins_one = |tokens: &[String]| parse_clause(&tokens.join(" "), knowledge).is_ok();
    (1..tokens.len()).filter(|at| joins(&tokens[*at])).find_map(|at| {
        let (first, after) = tokens.split_at(at);
        let after = &after[after.iter().take_while(|token| joins(token)).count()..];
        (starts_with_verb(after) && is_command(first) && begins_one(after)).then_some((first, after))
    })
}

#[cfg(test)]
mod tests {
    //! Contract: a sentence is divided between commands alone, never inside of what one of them speaks of.
    use super::*;

    #[test]
    fn sentences_are_divided_between_commands() {
        let knowledge = Knowledge::embedded().unwrap();
        let parts = |text: &str| split_sequence(text, &knowledge);
        assert_eq!(parts("Grasp the apple and put it on the table"), ["grasp the apple", "put it on the table"]);
        assert_eq!(
            parts("Put the red mug on the desk, bring the can to the shelf, and then go to the kitchen."),
            ["put the red mug on the desk", "bring the can to the shelf", "go to the kitchen"]
        );
        assert_eq!(parts("Please take the book; afterwards drive to the bed").len(), 2);
        assert_eq!(
            parts("Bring the mug from the drawer, then close it"),
            ["bring the mug from the drawer", "close it"],
            "verbs that are nouns or adjectives as well are verbs before what they act on"
        );
        assert_eq!(parts("Open the top drawer and shut the door of the fridge").len(), 2);
        let sequel = "Go to the kitchen, then whistle";
        assert_eq!(parts(sequel), [sequel]);
        assert!(parse_command(sequel, &knowledge).is_err(), "half a sentence is not done in silence");
        for one in [
            "Take the mug on the table, close to the lamp",
            "Go to the lamp between the sofa and the table",
            "Go and get the mug",
            "Grasp the black and white cup",
            "Grasp the apple",
            "and then",
            "",
        ] {
            assert_eq!(parts(one), [one]);
        }
    }

    #[test]
    fn every_part_is_a_command() {
        let knowledge = Knowledge::embedded().unwrap();
        let text = "Could you grab the cup on the shelf then place it on the desk and then find the blue book";
        let parts = split_sequence(text, &knowledge);
        assert_eq!(parts.len(), 3, "{parts:?}");
        assert!(parts.iter().all(|part| parse_command(part, &knowledge).is_ok()), "{parts:?}");
    }
}
