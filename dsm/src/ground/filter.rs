//! Stage 2, the latent relation filter: all constraints scored together over the target and its anchors.
//!
//! A query is a tree, so the best joint choice of target and anchors is found exactly by max-product: an object's score
//! is the product of how well it fits its noun and attributes and, for each relation, the best product of relation and
//! anchor score over all anchors. Nothing is cut off hard; a violated constraint leaves a small factor.

use super::answer::ReferenceFrame;
use super::config::GroundConfig;
use super::likeness;
use super::query::{Entity, Noun, RelationTerm, RelationWord};
use super::relate;
use super::retrieve;
use super::rooms;
use super::scene::Scene;
use super::select;
use crate::knowledge::Knowledge;

/// Anchors that are tried per relation, best first. 500 objects with a wildcard anchor would need 250 000 pairs.
const MAX_ANCHORS: usize = 48;
/// Anchors tried on each side of "between".
const MAX_BETWEEN: usize = 16;
/// Candidates that score below this share of the best take no part in comparisons ("closest", "largest").
const COMPARED_SHARE: f32 = 0.6;
/// Distance over which "far from" falls to 1/e short of the farthest candidate, metres.
const FAR_M: f64 = 3.0;
/// Categories that bound the map without being objects of it.
const BOUNDS: [&str; 3] = ["wall", "floor", "ceiling"];

/// One constraint of the query and how well each object meets it.
pub(super) struct Factor {
    /// The constraint in words.
    pub(super) label: String,
    /// Score by item.
    pub(super) scores: Vec<f32>,
    /// The anchor that was chosen, by item.
    pub(super) anchors: Vec<Option<usize>>,
}

/// How well each object fits an entity.
pub(super) struct Evaluation {
    /// The constraints; the first is the noun.
    pub(super) factors: Vec<Factor>,
    /// Product of all factors by item.
    pub(super) total: Vec<f32>,
    /// Frame of its view-dependent words.
    pub(super) frame: ReferenceFrame,
}

/// What evaluation needs besides the entity.
#[derive(Clone, Copy)]
pub(super) struct Context<'s, 'a> {
    pub(super) scene: &'s Scene<'a>,
    pub(super) knowledge: &'s Knowledge,
    pub(super) config: &'s GroundConfig,
}

impl Evaluation {
    fn push(&mut self, label: String, scores: Vec<f32>, anchors: Vec<Option<usize>>) {
        for (total, score) in self.total.iter_mut().zip(&scores) {
            *total *= score;
        }
        self.factors.push(Factor { label, scores, anchors });
    }

    fn see(&mut self, frame: ReferenceFrame) {
        if frame != ReferenceFrame::None {
            self.frame = frame;
        }
    }
}

/// Scores every object of the scene against the entity.
pub(super) fn evaluate(context: Context<'_, '_>, entity: &Entity) -> Evaluation {
    let Context { scene, knowledge, config } = context;
    let count = scene.items.len();
    let mut result = Evaluation { factors: Vec::new(), total: vec![1.0; count], frame: ReferenceFrame::None };
    let fits_noun = match config.presume_present {
        true => retrieve::literal_noun_scores(scene, &entity.noun, knowledge),
        false => retrieve::noun_scores(scene, &entity.noun, knowledge),
    };
    result.push(format!("is a {}", noun_phrase(&entity.noun)), fits_noun.clone(), vec![None; count]);
    for term in &entity.attributes {
        let mut scores = retrieve::attribute_scores(scene, term, &fits_noun, knowledge);
        if config.presume_present {
            likeness::soften(&mut scores, &result.total);
        } else {
            retrieve::doubt_colors(scene, term, knowledge, &mut scores);
        }
        let label = format!("{}{}", if term.negated { "not " } else { "" }, term.word);
        result.push(label, scores, vec![None; count]);
    }
    if !config.relation_filter {
        return result;
    }
    // Where relations compare anyway, "near" and "closest" mean the same.
    let compares = |term: &&RelationTerm| match term.word {
        RelationWord::Farthest => true,
        RelationWord::Closest => !config.presume_present,
        RelationWord::Far => config.presume_present,
        _ => false,
    };
    for term in entity.relations.iter().filter(|term| !compares(term)) {
        push_relation(context, term, &mut result);
    }
    for term in entity.relations.iter().filter(compares) {
        push_comparison(context, term, &mut result);
    }
    for selection in &entity.selections {
        let (scores, frame) = select::selection_scores(scene, selection, &result.total, COMPARED_SHARE);
        result.see(frame);
        result.push(select::phrase(selection), scores, vec![None; count]);
    }
    result
}

fn noun_phrase(noun: &Noun) -> &str {
    match noun {
        Noun::Thing(name) | Noun::Room(name) => name,
        Noun::Anything => "thing",
    }
}

fn relation_label(term: &RelationTerm) -> String {
    let anchors: Vec<String> = term.anchors.iter().map(Entity::phrase).collect();
    format!("{}{} the {}", if term.negated { "not " } else { "" }, term.word.phrase(), anchors.join(" and the "))
}

/// The anchors of an entity with their scores relative to the best, best first.
fn ranked_anchors(
    context: Context<'_, '_>,
    entity: &Entity,
    result: &mut Evaluation,
    most: usize,
) -> Vec<(usize, f32)> {
    let anchors = evaluate(context, entity);
    result.see(anchors.frame);
    // Where names are certain, things of other names are no anchors beside one that bears the name itself.
    let least_noun = if context.config.presume_present { 0.55 } else { 0.0 };
    let named = |i: &usize| anchors.factors.first().is_none_or(|noun| noun.scores[*i] >= least_noun);
    let mut ranked: Vec<(usize, f32)> =
        anchors.total.iter().copied().enumerate().filter(|(i, score)| *score >= 0.02 && named(i)).collect();
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    ranked.truncate(most);
    // The anchor's own doubts count half: they are the same for most candidates.
    if context.config.presume_present {
        let best = ranked.first().map_or(1.0, |first| first.1);
        return ranked.into_iter().map(|(i, score)| (i, (score / best).sqrt())).collect();
    }
    ranked.into_iter().map(|(i, score)| (i, score.sqrt())).collect()
}

fn missing_anchor_score(context: Context<'_, '_>, entity: &Entity) -> f32 {
    let known = match &entity.noun {
        Noun::Thing(name) => context.knowledge.find(name).is_some() || context.knowledge.find_kind(name).is_some(),
        Noun::Room(_) | Noun::Anything => true,
    };
    if known { context.config.missing_anchor } else { context.config.unknown_anchor }
}

fn push_relation(context: Context<'_, '_>, term: &RelationTerm, result: &mut Evaluation) {
    let scene = context.scene;
    let label = relation_label(term);
    if let [Entity { noun: Noun::Room(_), .. }] = term.anchors.as_slice() {
        let scores = rooms::relation_to_room(context, term, &mut result.frame);
        let scores = finish(context.config, term, scores);
        result.push(label, scores, vec![None; scene.items.len()]);
        return;
    }
    let (mut scores, anchors) = if term.word == RelationWord::Between {
        between_scores(context, term, result)
    } else {
        let anchors = ranked_anchors(context, &term.anchors[0], result, MAX_ANCHORS);
        if anchors.is_empty() && is_structure(context, &term.anchors[0]) {
            let scores = structure_scores(context, term);
            result.push(label, finish(context.config, term, scores), vec![None; scene.items.len()]);
            return;
        }
        if anchors.is_empty() {
            let missing = if term.negated || context.config.presume_present {
                1.0
            } else {
                missing_anchor_score(context, &term.anchors[0])
            };
            result.push(
                format!("{label} (no such anchor in the map)"),
                vec![missing; scene.items.len()],
                vec![None; scene.items.len()],
            );
            return;
        }
        if term.word.needs_viewer() {
            let place = scene.items[anchors[0].0].bounds.center().xy();
            result.see(scene.view_to(place).frame);
        }
        best_anchors(&result.total, |target| {
            let score = |(anchor, weight): &(usize, f32)| {
                let holds = match context.config.presume_present {
                    true => likeness::raw_score(scene, term.word, target, *anchor),
                    false => relate::relation_score(scene, term.word, target, *anchor),
                };
                (*anchor, weight * holds)
            };
            anchors.iter().filter(|(anchor, _)| *anchor != target).map(score).collect()
        })
    };
    if context.config.presume_present {
        likeness::relative_to_best(&mut scores, &result.total);
    }
    let scores = finish(context.config, term, scores);
    result.push(label, scores, anchors);
}

/// Walls, floors and ceilings bound the map but are no objects of it.
fn is_structure(context: Context<'_, '_>, entity: &Entity) -> bool {
    let bounds = |name: &str| context.knowledge.find(name).is_some_and(|c| BOUNDS.contains(&c.name.as_str()));
    matches!(&entity.noun, Noun::Thing(name) if bounds(name))
}

/// "on the floor" asks for a low lower end (world z = 0 is the floor); walls and ceilings are not judged.
fn structure_scores(context: Context<'_, '_>, term: &RelationTerm) -> Vec<f32> {
    let is_floor = |name: &str| context.knowledge.find(name).is_some_and(|category| category.name == "floor");
    let floor = matches!(&term.anchors[0].noun, Noun::Thing(name) if is_floor(name));
    let judged = floor && matches!(term.word, RelationWord::On | RelationWord::Near | RelationWord::Against);
    let score = |item: &super::scene::Item<'_>| {
        let gap_m = (item.bounds.min.z - 0.12).max(0.0);
        match (judged, term.negated) {
            (true, _) => (1.0 - gap_m / 0.2).clamp(0.0, 1.0) as f32,
            (false, negated) => {
                if negated {
                    0.3
                } else {
                    0.7
                }
            }
        }
    };
    context.scene.items.iter().map(score).collect()
}

/// For each target that still counts, the best anchor and its score.
fn best_anchors(total: &[f32], scores_of: impl Fn(usize) -> Vec<(usize, f32)>) -> (Vec<f32>, Vec<Option<usize>>) {
    let best = |target: usize| {
        if total[target] < 1e-4 {
            return (0.0, None);
        }
        // The first of the best, so that ties go to the better anchor.
        let fold = |best: (f32, Option<usize>), (anchor, score): (usize, f32)| {
            if score > best.0 { (score, Some(anchor)) } else { best }
        };
        scores_of(target).into_iter().fold((0.0, None), fold)
    };
    (0..total.len()).map(best).unzip()
}

fn between_scores(
    context: Context<'_, '_>,
    term: &RelationTerm,
    result: &mut Evaluation,
) -> (Vec<f32>, Vec<Option<usize>>) {
    let count = context.scene.items.len();
    let first = ranked_anchors(context, &term.anchors[0], result, MAX_BETWEEN);
    // "between the two chairs": both anchors are of one kind.
    let second = match term.anchors.get(1) {
        Some(second) => ranked_anchors(context, second, result, MAX_BETWEEN),
        None => first.clone(),
    };
    if first.is_empty() || second.is_empty() {
        let entity = if first.is_empty() { &term.anchors[0] } else { &term.anchors[term.anchors.len() - 1] };
        let missing = if context.config.presume_present { 1.0 } else { missing_anchor_score(context, entity) };
        return (vec![missing; count], vec![None; count]);
    }
    best_anchors(&result.total, |target| {
        let pairs = first.iter().flat_map(|a| second.iter().map(move |b| (a, b)));
        pairs
            .filter(|(a, b)| a.0 != b.0 && a.0 != target && b.0 != target)
            .map(|(a, b)| {
                let lies = if context.config.presume_present { likeness::between_score } else { relate::between };
                (a.0, a.1 * b.1 * lies(context.scene, target, a.0, b.0))
            })
            .collect()
    })
}

/// Negation, and the floor.
fn finish(config: &GroundConfig, term: &RelationTerm, scores: Vec<f32>) -> Vec<f32> {
    let one = |score: f32| if term.negated { 1.0 - score } else { score };
    scores.into_iter().map(|score| one(score).clamp(config.relation_floor, 1.0)).collect()
}

/// "closest to", "farthest from": the order of the candidates by their distance to the likeliest anchor.
fn push_comparison(context: Context<'_, '_>, term: &RelationTerm, result: &mut Evaluation) {
    let count = context.scene.items.len();
    let label = relation_label(term);
    let found: Vec<Option<(f64, Option<usize>)>> = if matches!(term.anchors[0].noun, Noun::Room(_)) {
        rooms::distances_m(context, &term.anchors[0], &mut result.frame)
            .into_iter()
            .map(|d| d.map(|d| (d, None)))
            .collect()
    } else {
        nearest_anchors(context, &term.anchors[0], result)
    };
    if found.iter().all(Option::is_none) {
        let missing = match context.config.presume_present {
            true => 1.0,
            false => missing_anchor_score(context, &term.anchors[0]),
        };
        result.push(format!("{label} (no such anchor in the map)"), vec![missing; count], vec![None; count]);
        return;
    }
    let sign = if matches!(term.word, RelationWord::Closest) { 1.0 } else { -1.0 };
    let keys: Vec<f64> = found.iter().map(|f| f.map_or(f64::INFINITY, |(distance, _)| sign * distance)).collect();
    let scores = if context.config.presume_present {
        let reach = |key: f64| if key.is_finite() { (-key / FAR_M).exp() as f32 } else { 0.0 };
        let mut scores: Vec<f32> = keys.iter().copied().map(reach).collect();
        likeness::relative_to_best(&mut scores, &result.total);
        scores
    } else {
        select::rank_scores(&keys, &result.total, 1, COMPARED_SHARE, 0.03)
    };
    let scores = finish(context.config, term, scores);
    result.push(label, scores, found.iter().map(|f| f.and_then(|(_, anchor)| anchor)).collect());
}

/// For each item, the distance in metres to the nearest of the likeliest anchors, and which it is.
fn nearest_anchors(
    context: Context<'_, '_>,
    entity: &Entity,
    result: &mut Evaluation,
) -> Vec<Option<(f64, Option<usize>)>> {
    let items = &context.scene.items;
    let anchors = ranked_anchors(context, entity, result, MAX_BETWEEN);
    let best = anchors.first().map_or(0.0, |(_, score)| *score);
    let likely: Vec<usize> =
        anchors.iter().filter(|(_, score)| *score >= 0.9 * best).map(|(anchor, _)| *anchor).collect();
    let nearest = |target: usize| {
        let distance = |&anchor: &usize| relate::box_distance_m(&items[target].bounds, &items[anchor].bounds);
        let others = likely.iter().filter(|anchor| **anchor != target);
        others.map(|anchor| (distance(anchor), Some(*anchor))).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    (0..items.len()).map(nearest).collect()
}
