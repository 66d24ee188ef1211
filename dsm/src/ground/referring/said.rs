//! Single words that say something about a candidate although no constraint has read them.

use super::kind::Kind;

/// Words by what they speak for.
const SAID: &[(Kind, &[&str])] = &[
    (Kind::WordWall, &["wall", "walls"]),
    (Kind::WordCorner, &["corner", "corners"]),
    (Kind::WordMiddle, &["middle", "center", "centre", "central"]),
    (Kind::WordHigh, &["top", "upper", "above", "high", "higher", "highest", "ceiling", "overhead", "topmost"]),
    (
        Kind::WordLow,
        &["bottom", "lower", "low", "lowest", "floor", "ground", "under", "underneath", "below", "beneath"],
    ),
    (Kind::WordBig, &["large", "big", "larger", "bigger", "huge", "biggest", "largest", "double", "wide", "wider"]),
    (Kind::WordSmall, &["small", "little", "smaller", "tiny", "mini", "smallest", "narrow", "single", "short"]),
    (Kind::WordLong, &["long", "longer", "longest", "rectangle", "rectangular", "wide"]),
    (Kind::WordTall, &["tall", "taller", "tallest", "high", "standing", "vertical"]),
    (Kind::WordEven, &["round", "circular", "square", "circle", "squared"]),
    (Kind::WordLight, &["white", "light", "beige", "cream", "tan", "bright", "yellow", "silver", "lighter"]),
    (Kind::WordDark, &["black", "dark", "brown", "darker", "navy"]),
    (Kind::WordEnd, &["end", "ends", "head", "edge", "corner"]),
    (Kind::WordAlone, &["alone", "itself", "lone", "separate", "isolated", "individual", "secluded"]),
    (Kind::WordFar, &["far", "farthest", "furthest", "back", "end", "opposite", "rear", "further", "farther"]),
    (Kind::WordEntry, &["entrance", "enter", "entering", "exit", "entry", "doorway", "door", "walk", "front"]),
];

/// The kinds that the text speaks for.
pub(super) fn kinds_said(tokens: &[String]) -> Vec<Kind> {
    let said = |words: &[&str]| tokens.iter().any(|token| words.contains(&token.as_str()));
    SAID.iter().filter(|(_, words)| said(words)).map(|(kind, _)| *kind).collect()
}

/// Whether left (positive) or right (negative) is said more often; 0 for neither.
pub(super) fn side_said(tokens: &[String]) -> f32 {
    let count = |words: [&str; 2]| tokens.iter().filter(|token| words.contains(&token.as_str())).count() as f32;
    let (left, right) = (count(["left", "leftmost"]), count(["right", "rightmost"]));
    if left == right { 0.0 } else { (left - right).signum() }
}
