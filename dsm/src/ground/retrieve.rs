//! Stage 1, candidate retrieval: how well each object fits the noun and the attributes, by identity votes, kinds and
//! knowledge.

use super::color;
use super::query::{AttributeTerm, AttributeWord, Noun};
use super::scene::{Item, Scene};
use crate::knowledge::{Category, Knowledge, normalize, singular_of};
use crate::map::{AttributeKind, MapPoint, Votes};
use std::collections::BTreeMap;

/// Score of an attribute about which the map knows nothing: it neither helps nor refuses much.
const UNKNOWN: f32 = 0.5;
/// Score of a stated attribute that the map contradicts. Must lie below `GroundConfig::violated_below`.
const CONTRADICTED: f32 = 0.05;
/// Share of a name's votes from which on it counts fully; below a quarter of this it does not count at all.
const FULL_SHARE: f32 = 0.5;
/// Share of votes for the very word that was said from which on it is the object's own name.
const LITERAL_SHARE: f32 = 0.15;
/// Score of an object that is called by a synonym of what was said, or mostly by the name of something else.
const SYNONYM: f32 = 0.85;

/// How well each object fits the noun, 0 to 1, in order of items.
///
/// Votes for all names count, not only the winner's: an object called "apple" in 60 % and "orange" in 40 % of its views
/// may be meant by both words. The score saturates, so that naming noise does not decide between equal objects.
pub(super) fn noun_scores(scene: &Scene<'_>, noun: &Noun, knowledge: &Knowledge) -> Vec<f32> {
    let asked = match noun {
        Noun::Thing(name) => name,
        Noun::Anything => return scene.categories.iter().map(|category| anything_score(*category)).collect(),
        Noun::Room(_) => return vec![0.0; scene.items.len()],
    };
    let spelled = normalize(asked);
    let asked_category = knowledge.find(asked);
    let asked = knowledge.meaning(asked);
    let mut similarity_of: Vec<Option<(f32, bool)>> = vec![None; scene.names.all.len()];
    let mut scores = Vec::with_capacity(scene.items.len());
    for ((item, category), votes) in scene.items.iter().zip(&scene.categories).zip(scene.names.votes()) {
        let total = votes.iter().map(|(_, weight)| weight).sum::<f32>().max(1e-6);
        let (mut share, mut quality, mut literal) = (0.0, 0.0, 0.0);
        for &(name, weight) in votes {
            let (similarity, same_word) = *similarity_of[name].get_or_insert_with(|| {
                let name = scene.names.all[name];
                let other = normalize(name);
                let same = other == spelled
                    || singular_of(&other).contains(&spelled)
                    || singular_of(&spelled).contains(&other);
                (knowledge.similarity_to(&asked, name), same)
            });
            literal += if same_word { weight / total } else { 0.0 };
            let (counts, grade) = grade(similarity);
            share += counts * weight / total;
            quality += counts * grade * weight / total;
        }
        if share == 0.0 {
            scores.push(0.0);
            continue;
        }
        let certain = ((share / FULL_SHARE - 0.25) / 0.75).clamp(0.0, 1.0);
        let synonym = if literal >= LITERAL_SHARE { 1.0 } else { SYNONYM };
        // Views that call it so against most others misread it, as a rule.
        let is_own = match (category, asked_category) {
            (Some(own), Some(asked)) => own.is_a(&asked.name),
            _ => true,
        };
        let own = if is_own { synonym } else { SYNONYM * size_fit(item, asked_category) };
        scores.push(certain * own * piece_fit(item, asked_category) * quality / share);
    }
    // Where something bears the name itself, look-alikes and wider kinds step back.
    if scores.iter().any(|score| *score >= SYNONYM) {
        scores.iter_mut().filter(|score| **score < SYNONYM).for_each(|score| *score *= 0.7);
    }
    scores
}

/// How well the size of a thing of another name suits what is asked for, 0.5 to 1: a table as wide as a door is no side
/// table. What is seen in part looks smaller than it is, so that only what is too large counts.
fn size_fit(item: &Item<'_>, asked: Option<&Category>) -> f32 {
    /// Boxes of noisy points stick out by as much, as a share of what is plausible.
    const TOLERANCE: f64 = 1.15;
    const LEAST: f64 = 0.5;
    let Some([_, largest]) = asked.and_then(|category| category.size_m) else { return 1.0 };
    let times = item.object.bounds.size.max() / largest;
    (TOLERANCE / times).clamp(LEAST, 1.0) as f32
}

/// What is left of a name that a glimpse gave to something far smaller than anything of that name: the end of a bathtub is
/// no bed. What is seen well may be small.
fn piece_fit(item: &Item<'_>, asked: Option<&Category>) -> f32 {
    const GLIMPSES: u32 = 8;
    const SMALL_SHARE: f64 = 0.8;
    const LEFT: f32 = 0.7;
    let Some([smallest, _]) = asked.and_then(|category| category.size_m) else { return 1.0 };
    let is_small = item.object.bounds.size.max() < SMALL_SHARE * smallest;
    if is_small && item.object.observations < GLIMPSES { LEFT } else { 1.0 }
}

/// As [`noun_scores`], where names are certain: the very word first, then its plural or joined spelling, then a name
/// with the same head or a synonym, then kinds and look-alikes; relative to the best there is.
pub(super) fn literal_noun_scores(scene: &Scene<'_>, noun: &Noun, knowledge: &Knowledge) -> Vec<f32> {
    let Noun::Thing(asked) = noun else { return noun_scores(scene, noun, knowledge) };
    let spelled = normalize(asked);
    let joined = |name: &str| name.replace(' ', "");
    let meaning = knowledge.meaning(asked);
    let mut known: Vec<Option<f32>> = vec![None; scene.names.all.len()];
    let last = |name: &str| name.rsplit(' ').next().unwrap_or("").to_owned();
    let fit = |name: &str| {
        let other = normalize(name);
        let same = |a: &str, b: &str| joined(a) == joined(b);
        if other == spelled {
            1.0
        } else if same(&other, &spelled)
            || singular_of(&other).iter().any(|s| same(s, &spelled))
            || singular_of(&spelled).iter().any(|s| same(s, &other))
        {
            PLURAL
        } else {
            let alike = knowledge.similarity_to(&meaning, name);
            let headed = if last(&other) == last(&spelled) { SAME_HEAD } else { 0.0 };
            match alike {
                s if s >= 0.99 => SAME_MEANING,
                s if s >= 0.85 => 0.15_f32,
                s if s >= 0.6 => 0.15,
                s if s >= 0.5 => 0.05,
                _ => 0.0,
            }
            .max(headed)
        }
    };
    let score = |name: &usize| *known[*name].get_or_insert_with(|| fit(scene.names.all[*name]));
    let mut scores: Vec<f32> = scene.names.winners.iter().map(score).collect();
    let best = scores.iter().copied().fold(0.0, f32::max);
    if best > 0.0 {
        scores.iter_mut().for_each(|score| *score /= best);
    }
    scores
}

/// What a pattern without a name counts when a certain one is asked for.
const UNNAMED_PATTERN: f32 = 0.7;
/// What a material counts that another one outvotes.
const OUTVOTED: f32 = 0.5;
/// Fit of a name that differs from what was said in number or spacing only.
const PLURAL: f32 = 0.5;
/// Fit of a synonym where names are certain.
const SAME_MEANING: f32 = 0.3;
/// Fit of a name with the same last word.
const SAME_HEAD: f32 = 0.25;

/// How much a vote for a name of this similarity counts, and how good a match it is.
fn grade(similarity: f32) -> (f32, f32) {
    match similarity {
        s if s >= 0.99 => (1.0, 1.0),
        s if s >= 0.85 => (1.0, 0.8),
        s if s >= 0.75 => (1.0, 0.7),
        s if s >= 0.6 => (0.8, 0.5),
        _ => (0.0, 0.0),
    }
}

/// Walls and floors are not what "something" means.
fn anything_score(category: Option<&Category>) -> f32 {
    let structure = category.is_some_and(|category| category.is_a("structure"));
    if structure { 0.3 } else { 1.0 }
}

/// How well each object fits one attribute, 0 to 1. `fits_noun` are the noun scores: sizes compare like with like.
pub(super) fn attribute_scores(
    scene: &Scene<'_>,
    term: &AttributeTerm,
    fits_noun: &[f32],
    knowledge: &Knowledge,
) -> Vec<f32> {
    let scores = match term.kind {
        AttributeWord::Size => size_scores(scene, &term.word, fits_noun),
        AttributeWord::Color => color_scores(scene, &term.word, fits_noun, knowledge),
        _ => {
            let one = |(item, fits): (&Item<'_>, &f32)| {
                if *fits > 0.0 { attribute_score(item, term, knowledge) } else { 0.0 }
            };
            scene.items.iter().zip(fits_noun).map(one).collect()
        }
    };
    match term.negated {
        true if term.kind == AttributeWord::Color => {
            // "Not white" is true of what is gray, however near it lies.
            let one = |(item, score): (&Item<'_>, f32)| {
                let share = color_share(item, &term.word, knowledge).map_or(score, |share| share / FULL_SHARE);
                (1.0 - share).max(CONTRADICTED)
            };
            scene.items.iter().zip(scores).map(one).collect()
        }
        true => scores.into_iter().map(|score: f32| (1.0 - score).max(CONTRADICTED)).collect(),
        false => scores,
    }
}

/// The share of votes for this very colour; `None` without votes.
fn color_share(item: &Item<'_>, asked: &str, knowledge: &Knowledge) -> Option<f32> {
    let votes = item.object.attributes.find_votes(AttributeKind::Appearance, "color")?;
    (votes.total() > 0.0).then(|| canonical_share(votes, asked, |word| knowledge.words().colors.find(word)))
}

fn attribute_score(item: &Item<'_>, term: &AttributeTerm, knowledge: &Knowledge) -> f32 {
    let votes = |kind, key| item.object.attributes.find_votes(kind, key).filter(|votes| votes.total() > 0.0);
    let category = || knowledge.find(item.object.name());
    match term.kind {
        AttributeWord::Material => match votes(AttributeKind::Physical, "material") {
            Some(votes) => {
                let canonical = |word: &str| knowledge.words().materials.find(word);
                let share = canonical_share(votes, &term.word, canonical);
                let asked = term.word.as_str();
                let wins = votes.find_winner().is_some_and(|(word, _)| word == asked || canonical(word) == Some(asked));
                // What looks more like another material is one only for want of a better one.
                saturated(if wins { share } else { OUTVOTED * share }, 0.4)
            }
            None => category().map_or(UNKNOWN, |category| prior(&category.materials, &term.word)),
        },
        AttributeWord::Pattern => match votes(AttributeKind::Appearance, "pattern") {
            Some(votes) => {
                let share = |word: &str| canonical_share(votes, word, |w| knowledge.words().patterns.find(w));
                // A pattern that nobody could name may be any of them, and each of them is one.
                let some = match term.word.as_str() {
                    "plain" => 0.0,
                    "patterned" => 1.0 - share("plain") - share("patterned"),
                    _ => UNNAMED_PATTERN * share("patterned"),
                };
                saturated(share(&term.word) + some, 0.4)
            }
            None => UNKNOWN,
        },
        AttributeWord::Weight => match votes(AttributeKind::Physical, "weight") {
            Some(votes) => {
                saturated(canonical_share(votes, &term.word, |w| knowledge.words().weights.find(w)), 0.4).max(0.25)
            }
            None => category().and_then(|category| category.mass_kg).map_or(UNKNOWN, |mass_kg| {
                let heavy = ((mass_kg / 2.0).log10() as f32 * 0.5 + 0.5).clamp(0.25, 1.0);
                if term.word == "heavy" { heavy } else { 1.25 - heavy }
            }),
        },
        AttributeWord::Purpose => purpose_score(votes(AttributeKind::Affordance, "use"), category(), &term.word),
        AttributeWord::Shape => shape_score(item, &term.word),
        AttributeWord::Color | AttributeWord::Size => UNKNOWN,
    }
}

/// The share of a canonical word among votes, whatever synonyms were voted.
fn canonical_share<'v, 'k>(votes: &'v Votes, word: &str, mut canonical: impl FnMut(&'v str) -> Option<&'k str>) -> f32 {
    let counted: f32 =
        votes.iter().filter(|(voted, _)| *voted == word || canonical(voted) == Some(word)).map(|(_, w)| w).sum();
    counted / votes.total().max(1e-6)
}

fn saturated(share: f32, full: f32) -> f32 {
    (share / full).clamp(CONTRADICTED, 1.0)
}

fn prior(likely: &[String], word: &str) -> f32 {
    match likely.iter().position(|material| material == word) {
        Some(0) => 0.8,
        Some(_) => 0.5,
        None => 0.1,
    }
}

/// Several uses may be true at once, so presence counts, not the share.
fn purpose_score(votes: Option<&Votes>, category: Option<&Category>, word: &str) -> f32 {
    if votes.is_some_and(|votes| votes.share(word) > 0.05) {
        return 1.0;
    }
    match category.and_then(|category| category.uses.iter().position(|use_| use_ == word)) {
        Some(0) => 0.95,
        Some(_) => 0.7,
        None => 0.02,
    }
}

/// Remembers what is said of each word.
fn remembered<'w, T: Copy>(say: impl Fn(&'w str) -> T) -> impl FnMut(&'w str) -> T {
    let mut said: BTreeMap<&str, T> = BTreeMap::new();
    move |word| *said.entry(word).or_insert_with(|| say(word))
}

fn color_scores<'a>(scene: &Scene<'a>, asked: &str, fits_noun: &[f32], knowledge: &Knowledge) -> Vec<f32> {
    let words = knowledge.words();
    let prototypes = color::Prototypes::of(words);
    let mut fit = remembered(|voted| color::word_similarity(words, asked, words.colors.find(voted).unwrap_or(voted)));
    let mut one = |item: &Item<'a>| {
        if let Some(votes) = item.object.attributes.find_votes(AttributeKind::Appearance, "color")
            && votes.total() > 0.0
        {
            let mean: f32 = votes.iter().map(|(voted, weight)| weight * fit(voted)).sum::<f32>() / votes.total();
            return saturated(mean, 0.5);
        }
        let points = &item.object.points;
        if points.is_empty() {
            return UNKNOWN;
        }
        let add = |sum: [f64; 3], p: &MapPoint| std::array::from_fn(|i| sum[i] + f64::from(p.color[i]));
        let sum = points.iter().fold([0.0; 3], add);
        prototypes.fit(asked, sum.map(|c| c / points.len() as f64)).max(CONTRADICTED)
    };
    scene.items.iter().zip(fits_noun).map(|(item, fits)| if *fits > 0.0 { one(item) } else { 0.0 }).collect()
}

/// Lowers the scores of things that cannot have the asked colour, however near it lies: where the thing may be missing, a
/// blue mug is no purple one.
///
/// `fits` tells which things count at all.
pub(super) fn doubt_colors(
    scene: &Scene<'_>,
    term: &AttributeTerm,
    fits: &[f32],
    knowledge: &Knowledge,
    scores: &mut [f32],
) {
    /// Share of the votes from which the colour is believed.
    const BELIEVED_SHARE: f32 = 0.25;
    if term.kind != AttributeWord::Color || term.negated {
        return;
    }
    let words = knowledge.words();
    let mut canonical = remembered(|voted| words.colors.find(voted));
    let mut by_light =
        remembered(|voted| color::may_be_seen_as(words, &term.word, words.colors.find(voted).unwrap_or(voted)));
    for ((item, score), _) in scene.items.iter().zip(scores).zip(fits).filter(|(_, fits)| **fits > 0.0) {
        let votes = item.object.attributes.find_votes(AttributeKind::Appearance, "color");
        let Some(votes) = votes.filter(|votes| votes.total() > 0.0) else { continue };
        let share = canonical_share(votes, &term.word, &mut canonical);
        let seen_as = votes.iter().map(|(voted, weight)| weight * by_light(voted)).sum::<f32>() / votes.total();
        *score = score.min((share / BELIEVED_SHARE).max(seen_as / 0.8).clamp(CONTRADICTED, 1.0));
    }
}

/// From the box alone, so it never refuses.
fn shape_score(item: &Item<'_>, word: &str) -> f32 {
    let size = item.object.bounds.size;
    let (narrow, wide) = (size.x.min(size.y).max(1e-6), size.x.max(size.y).max(1e-6));
    let even = narrow / wide > 0.8;
    let fits = match word {
        "round" | "square" => even,
        "spherical" => even && (size.z / wide - 1.0).abs() < 0.3,
        "cylindrical" => even && size.z > wide,
        "rectangular" => !even,
        "flat" => size.min() < 0.25 * size.max(),
        _ => return UNKNOWN,
    };
    if fits { 0.9 } else { 0.4 }
}

/// Sizes compare with the other objects that fit the noun; a single one is not judged.
fn size_scores(scene: &Scene<'_>, word: &str, fits_noun: &[f32]) -> Vec<f32> {
    let measure = |item: &Item<'_>| {
        let size = item.object.bounds.size;
        let (narrow, wide) = (size.x.min(size.y), size.x.max(size.y));
        match word {
            "tall" => size.z,
            "short" => -size.z,
            "long" | "wide" => wide,
            "narrow" => -narrow,
            "thick" => narrow,
            "small" => -item.object.bounds.volume_m3(),
            _ => item.object.bounds.volume_m3(),
        }
    };
    let best = fits_noun.iter().copied().fold(0.0, f32::max);
    let peers: Vec<f64> = (scene.items.iter().zip(fits_noun))
        .filter(|(_, fits)| **fits > 0.0 && **fits >= 0.5 * best)
        .map(|(item, _)| measure(item))
        .collect();
    let score = |item: &Item<'_>| {
        if peers.len() < 2 {
            return 0.8;
        }
        let own = measure(item);
        let smaller = peers.iter().filter(|peer| **peer < own - 0.03 * own.abs()).count();
        0.3 + 0.7 * smaller as f32 / (peers.len() - 1) as f32
    };
    scene.items.iter().map(score).collect()
}
