//! How alike colour words are.

use crate::knowledge::Words;

/// CIELAB (D65) of an sRGB colour.
pub(super) fn lab_of(srgb: [f64; 3]) -> [f64; 3] {
    let linear = srgb.map(|c| {
        let c = c / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    });
    let dot = |row: [f64; 3]| row[0] * linear[0] + row[1] * linear[1] + row[2] * linear[2];
    let xyz = [
        dot([0.4124, 0.3576, 0.1805]) / 0.950_47,
        dot([0.2126, 0.7152, 0.0722]),
        dot([0.0193, 0.1192, 0.9505]) / 1.088_83,
    ];
    let f = xyz.map(|t| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 });
    [116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])]
}

/// Distance in CIELAB at which two colours count as alike by 1/e: chosen, not fitted, so that neighbours such as white
/// and beige stay somewhat alike and opposites do not (the test below holds both). Range 10 to 60.
const ALIKE_DISTANCE: f64 = 28.0;

fn alike(a: [f64; 3], b: [f64; 3], distance: f64, lightness_weight: f64) -> f32 {
    let squared = lightness_weight * (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2);
    (-squared / (distance * distance)).exp() as f32
}

/// Weight of lightness between words: light and exposure make white things gray and gray things black. Chosen so that
/// white and gray stay alike by more than a constraint needs to hold, and white and black do not.
const WORD_LIGHTNESS_WEIGHT: f64 = 0.46;

/// How alike two canonical colour words are, 0 to 1, over a distance in CIELAB; 0 for a word without prototype unless both
/// are the same.
fn compare(words: &Words, a: &str, b: &str, distance: f64, lightness_weight: f64) -> f32 {
    if a == b {
        return 1.0;
    }
    let find = |name: &str| words.prototypes.iter().find(|p| p.name == name).map(|p| lab_of(p.srgb.map(f64::from)));
    match (find(a), find(b)) {
        (Some(a), Some(b)) => alike(a, b, distance, lightness_weight),
        _ => 0.0,
    }
}

/// How alike two canonical colour words are, 0 to 1.
pub(super) fn word_similarity(words: &Words, a: &str, b: &str) -> f32 {
    compare(words, a, b, ALIKE_DISTANCE, WORD_LIGHTNESS_WEIGHT)
}

/// Distance in CIELAB within which light alone may turn one colour into another, and how little lightness counts there:
/// dim light makes white gray, but not blue purple.
const SAME_BUT_FOR_LIGHT: (f64, f64) = (16.0, 0.2);

/// Whether a thing of colour `asked` may be seen as `voted` because of the light alone, 0 to 1.
pub(super) fn may_be_seen_as(words: &Words, asked: &str, voted: &str) -> f32 {
    let (distance, weight) = SAME_BUT_FOR_LIGHT;
    compare(words, asked, voted, distance, weight)
}

/// The colours of canonical words, ready to be compared with many measured ones.
pub(super) struct Prototypes<'k>(Vec<(&'k str, [f64; 3])>);

impl<'k> Prototypes<'k> {
    /// Those of the word lists.
    pub(super) fn of(words: &'k Words) -> Self {
        let lab = |srgb: [u8; 3]| lab_of(srgb.map(f64::from));
        Self(words.prototypes.iter().map(|p| (p.name.as_str(), lab(p.srgb))).collect())
    }

    /// How well a measured sRGB colour fits a canonical colour word, relative to the best-fitting word, 0 to 1.
    /// Lightness counts half: exposure changes it.
    pub(super) fn fit(&self, asked: &str, srgb: [f64; 3]) -> f32 {
        let lab = lab_of(srgb);
        let (mut best, mut own) = (0.0_f32, 0.0);
        for (name, prototype) in &self.0 {
            let score = alike(lab, *prototype, ALIKE_DISTANCE, 0.5);
            best = best.max(score);
            own = if *name == asked { score } else { own };
        }
        if best > 0.0 { own / best } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: neighbouring colours are somewhat alike, opposite ones are not.
    use super::*;
    use crate::knowledge::Knowledge;

    #[test]
    fn neighbours_are_alike_opposites_are_not() {
        let knowledge = Knowledge::embedded().unwrap();
        let words = knowledge.words();
        assert!(word_similarity(words, "red", "blue") < 0.02);
        assert!(word_similarity(words, "white", "black") < 0.02);
        assert!(word_similarity(words, "white", "beige") > 0.25);
        assert!(word_similarity(words, "white", "gray") > 0.3);
        assert!(may_be_seen_as(words, "white", "gray") > 0.2);
        assert!(may_be_seen_as(words, "purple", "blue") < 0.15);
        let prototypes = Prototypes::of(words);
        assert!(prototypes.fit("red", [170.0, 30.0, 35.0]) > 0.95);
        assert!(prototypes.fit("green", [170.0, 30.0, 35.0]) < 0.05);
    }
}
