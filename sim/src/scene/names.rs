//! What bodies are by their names, where nobody wrote it down.

use super::joints::JointMotion;
use dsm::knowledge::{Knowledge, normalize};

/// Words at the end of a name that say which part of a thing a body is in the file, not what the thing is.
const PART_WORDS: [&str; 14] = [
    "main",
    "base",
    "body",
    "link",
    "object",
    "root",
    "geom",
    "col",
    "collision",
    "vis",
    "visual",
    "mesh",
    "model",
    "center",
];

/// What a body is, lower case, as a detector would call it: `akita_black_bowl_1_main` is a `bowl`, for the longest end of
/// the name that the knowledge has a category for tells the kind. A name that it does not know is taken as it stands. One
/// that says nothing (`object`, `body_3`) is taken from the names of the file, best first.
///
/// `None` for floors, walls, doors and the like, which are no objects.
pub(super) fn find_category(knowledge: Option<&Knowledge>, body: &str, file_names: &[&str]) -> Option<String> {
    let known = |words: &[String]| (0..words.len()).find_map(|first| knowledge?.find_exact(&words[first..].join(" ")));
    let own = telling_words(body);
    let names: Vec<Vec<String>> =
        if own.is_empty() { file_names.iter().map(|name| telling_words(name)).collect() } else { vec![own] };
    match names.iter().find_map(|words| known(words)) {
        Some(category) if category.is_a("structure") => None,
        Some(category) => Some(category.name.clone()),
        None => {
            let words = names.into_iter().find(|words| !words.is_empty());
            Some(words.map_or_else(|| normalize(body), |words| words.join(" ")))
        }
    }
}

/// What a part on a joint is called when nobody wrote it down: the last word of its body's name that is one, `drawer` for
/// `dresser_1_drawer_2`; else by how it moves.
pub(crate) fn name_of_part(body: &str, motion: JointMotion) -> String {
    let by_motion = if motion == JointMotion::Slide { "drawer" } else { "door" };
    telling_words(body).pop().filter(|word| !word.is_empty()).unwrap_or_else(|| by_motion.to_owned())
}

/// The words of a name without what counts or names parts at its end.
fn telling_words(name: &str) -> Vec<String> {
    let name = normalize(name);
    let mut words: Vec<&str> = name.split(' ').filter(|word| !word.is_empty()).collect();
    while words.last().is_some_and(|word| PART_WORDS.contains(word) || is_number(word)) {
        words.pop();
    }
    if let Some(last) = words.last_mut() {
        *last = last.trim_end_matches(|c: char| c.is_ascii_digit());
    }
    words.into_iter().map(str::to_owned).collect()
}

/// A count such as `1`, `3` or `b`: several of a kind are told apart by numbers or single letters.
fn is_number(word: &str) -> bool {
    word.chars().all(|c| c.is_ascii_digit()) || word.len() == 1
}

#[cfg(test)]
mod tests {
    //! Contract: the head of a name tells the kind, unknown names stay, parts of buildings are no objects.
    use super::*;

    #[test]
    fn parts_are_called_by_the_last_word_or_by_their_motion() {
        let name = |body: &str, motion| name_of_part(body, motion);
        assert_eq!(name("dresser_1_drawer_2", JointMotion::Slide), "drawer");
        assert_eq!(name("microwave_lid_link", JointMotion::Hinge), "lid");
        assert_eq!(name("body_3", JointMotion::Slide), "drawer");
        assert_eq!(name("link_7", JointMotion::Hinge), "door");
    }

    #[test]
    fn names_tell_kinds() {
        let knowledge = Knowledge::embedded().expect("it ships with the program");
        let category = |body: &str| find_category(Some(&knowledge), body, &["textured", "wooden_cabinet"]);
        let cases = [
            ("akita_black_bowl_1", "bowl"),
            ("akita_black_bowl_1_main", "bowl"),
            ("apple_1", "apple"),
            ("white_yellow_mug", "mug"),
            ("living_room_table_col", "table"),
            ("Red-Basket_2", "basket"),
            ("quux_3", "quux"),
            ("object", "cabinet"),
            ("body_7", "cabinet"),
        ];
        for (body, meant) in cases {
            assert_eq!(category(body).as_deref(), Some(meant), "{body}");
        }
        for structure in ["floor", "wall_left_2_wall", "wall2", "door_1"] {
            assert_eq!(category(structure), None, "{structure}");
        }
        assert_eq!(find_category(None, "apple_red_2", &["f"]).as_deref(), Some("apple red"));
    }
}
