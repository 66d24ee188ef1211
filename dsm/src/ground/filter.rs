//! Stage 2, the latent relation filter: all constraints scored together over the target and its anchors.
//!
//! A query is a tree, so the best joint choice of target and anchors is found exactly by max-product: an object's score
//! is the product of how well it fits its noun and attributes and, for each relation, the best product of relation and
//! anchor score over all anchors. Nothing is cut off hard; a violated constraint leaves a small factor.

use super::anchors::{best_anchor, best_anchors};
use super::answer::ReferenceFrame;
use super::bounds::{is_structure, structure_scores};
use super::config::GroundConfig;
use super::constraint::{kind_of_attribute, kind_of_order, kind_of_relation};
use super::likeness::{self, Reading};
use super::query::{Entity, Noun, RelationTerm, RelationWord};
use super::referring::{Kind, MENTIONED_FIT, Mention};
use super::relate;
use super::retrieve;
use super::rooms;
use super::scene::{Scene, View};
use super::select;
use crate::knowledge::Knowledge;
use std::collections::BTreeMap;

/// Anchors that are tried per relation, best first. 500 objects with a wildcard anchor would need 250 000 pairs.
const MAX_ANCHORS: usize = 48;
/// Anchors tried on each side of "between".
const MAX_BETWEEN: usize = 12;
/// Candidates that score below this share of the best take no part in comparisons ("closest", "largest").
const COMPARED_SHARE: f32 = 0.6;
/// Distance over which "far from" falls to 1/e short of the farthest candidate, metres.
const FAR_M: f64 = 3.0;

/// One constraint of the query and how well each object meets it.
pub(super) struct Factor {
    /// The constraint in words.
    pub(super) label: String,
    /// Score by item.
    pub(super) scores: Vec<f32>,
    /// The anchor that was chosen, by item.
    pub(super) anchors: Vec<Option<usize>>,
    /// What sort of evidence it is.
    pub(super) kind: Kind,
    /// Whether the map misreads it so often that it cannot refuse: it tells three materials in five and five patterns
    /// in six, but nine colours in ten.
    pub(super) unsure: bool,
}

/// How well each object fits an entity.
pub(super) struct Evaluation {
    /// The constraints; the first is the noun.
    pub(super) factors: Vec<Factor>,
    /// Product of all factors by item.
    pub(super) total: Vec<f32>,
    /// Frame of its view-dependent words.
    pub(super) frame: ReferenceFrame,
    /// Other readings of the same words, by item; they do not count in `total`.
    pub(super) readings: Vec<(Kind, Vec<f32>)>,
}

/// What evaluation needs besides the entity.
#[derive(Clone, Copy)]
pub(super) struct Context<'s, 'a> {
    pub(super) scene: &'s Scene<'a>,
    pub(super) knowledge: &'s Knowledge,
    pub(super) config: &'s GroundConfig,
}

impl Evaluation {
    fn push(&mut self, kind: Kind, label: String, scores: Vec<f32>, anchors: Vec<Option<usize>>) {
        for (total, score) in self.total.iter_mut().zip(&scores) {
            *total *= score;
        }
        let unsure = matches!(kind, Kind::Material | Kind::Pattern);
        self.factors.push(Factor { label, scores, anchors, kind, unsure });
    }

    fn see(&mut self, frame: ReferenceFrame) {
        if frame != ReferenceFrame::None {
            self.frame = frame;
        }
    }
}

/// Scores every object of the scene against the entity.
pub(super) fn evaluate(context: Context<'_, '_>, entity: &Entity) -> Evaluation {
    evaluate_with(context, entity, &[])
}

/// As [`evaluate`]; things that are mentioned otherwise than as anchors are weak candidates whatever the noun.
pub(super) fn evaluate_with(context: Context<'_, '_>, entity: &Entity, mentions: &[Mention]) -> Evaluation {
    let Context { scene, knowledge, config } = context;
    let count = scene.items.len();
    let mut result =
        Evaluation { factors: Vec::new(), total: vec![1.0; count], frame: ReferenceFrame::None, readings: Vec::new() };
    let mut fits_noun = match config.presume_present {
        true => retrieve::literal_noun_scores(scene, &entity.noun, knowledge),
        false => retrieve::noun_scores(scene, &entity.noun, knowledge),
    };
    let anchored = |mention: &&Mention| !is_anchor(entity, &mention.phrase);
    for item in mentions.iter().filter(anchored).flat_map(|mention| &mention.items) {
        fits_noun[*item] = fits_noun[*item].max(MENTIONED_FIT);
    }
    result.push(Kind::Noun, format!("is a {}", noun_phrase(&entity.noun)), fits_noun.clone(), vec![None; count]);
    for term in entity.attributes.iter().filter(|term| config.counts(term.kind)) {
        let mut scores = retrieve::attribute_scores(scene, term, &fits_noun, knowledge);
        if config.presume_present {
            likeness::soften(&mut scores, &result.total);
        } else {
            retrieve::doubt_colors(scene, term, &result.total, knowledge, &mut scores);
        }
        let label = format!("{}{}", if term.negated { "not " } else { "" }, term.word);
        result.push(kind_of_attribute(term.kind, term.negated), label, scores, vec![None; count]);
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
        if let (true, Some(scores)) =
            (config.presume_present, select::scores_facing_the_row(scene, selection, &result.total, COMPARED_SHARE))
        {
            result.readings.push((Kind::RowFace, scores));
        }
        result.push(kind_of_order(scene, selection.order), select::phrase(selection), scores, vec![None; count]);
    }
    result
}

/// Whether an anchor of the entity goes by this name.
fn is_anchor(entity: &Entity, phrase: &str) -> bool {
    let named = |anchor: &Entity| matches!(&anchor.noun, Noun::Thing(name) if name == phrase);
    let mut anchors = entity.relations.iter().flat_map(|relation| &relation.anchors);
    anchors.any(|anchor| named(anchor) || is_anchor(anchor, phrase))
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
    if !context.config.presume_present {
        // A piece of a shelf that was once taken for a bookshelf is none.
        let all: Vec<usize> =
            anchors.total.iter().enumerate().filter(|(_, score)| **score >= 0.02).map(|(i, _)| i).collect();
        let is_double = |i: usize| all.iter().any(|of| context.scene.is_double(i, *of, context.knowledge));
        ranked.retain(|(i, _)| !is_double(*i));
    }
    // The anchor's own doubts count half: they are the same for most candidates.
    if context.config.presume_present {
        let best = ranked.first().map_or(1.0, |first| first.1);
        return ranked.into_iter().map(|(i, score)| (i, (score / best).sqrt())).collect();
    }
    ranked.into_iter().map(|(i, score)| (i, score.sqrt())).collect()
}

/// "in the drawer" is in what has drawers, whose parts the map does not list: wholes of the anchor's name are anchors as well.
fn add_wholes(context: Context<'_, '_>, part: &Entity, anchors: &mut Vec<(usize, f32)>, result: &mut Evaluation) {
    /// A whole counts so much beside a thing that bears the name itself.
    const WHOLE: f32 = 0.9;
    let Noun::Thing(name) = &part.noun else { return };
    let Some(category) = context.knowledge.find(name) else { return };
    for whole in &category.part_of {
        let entity = Entity { noun: Noun::Thing(whole.clone()), ..part.clone() };
        for (item, score) in ranked_anchors(context, &entity, result, MAX_ANCHORS) {
            match anchors.iter_mut().find(|(known, _)| *known == item) {
                Some((_, best)) => *best = best.max(WHOLE * score),
                None => anchors.push((item, WHOLE * score)),
            }
        }
    }
    anchors.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    anchors.truncate(MAX_ANCHORS);
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
        let (scores, sure) = rooms::relation_to_room(context, term, &mut result.frame);
        let scores = finish(context.config, term, scores);
        result.push(Kind::Room, label, scores, vec![None; scene.items.len()]);
        if let Some(factor) = result.factors.last_mut() {
            factor.unsure = !sure;
        }
        return;
    }
    let mut kind = kind_of_relation(scene, term, None);
    let (mut scores, anchors) = if term.word == RelationWord::Between {
        between_scores(context, term, result)
    } else {
        let mut anchors = ranked_anchors(context, &term.anchors[0], result, MAX_ANCHORS);
        if term.word == RelationWord::In {
            add_wholes(context, &term.anchors[0], &mut anchors, result);
        }
        let plain = term.anchors[0].relations.is_empty() && context.config.presume_present;
        if (anchors.is_empty() || plain) && is_structure(context, &term.anchors[0]) {
            let scores = structure_scores(context, term);
            result.push(Kind::Bounds, label, finish(context.config, term, scores), vec![None; scene.items.len()]);
            return;
        }
        if anchors.is_empty() {
            let missing = if term.negated || context.config.presume_present {
                1.0
            } else {
                missing_anchor_score(context, &term.anchors[0])
            };
            result.push(
                kind,
                format!("{label} (no such anchor in the map)"),
                vec![missing; scene.items.len()],
                vec![None; scene.items.len()],
            );
            return;
        }
        if term.word.needs_viewer() {
            let place = scene.items[anchors[0].0].bounds.center().xy();
            result.see(scene.view_to(place).frame);
            kind = kind_of_relation(scene, term, Some(anchors[0].0));
            if context.config.presume_present && !term.negated {
                push_readings(context, term, &anchors, result);
            }
        }
        // Where one stands to see an anchor takes long to find and is the same for all targets.
        let looks = term.word.needs_viewer() && !context.config.presume_present;
        let view = |(anchor, _): &(usize, f32)| (*anchor, scene.view_to(scene.items[*anchor].bounds.center().xy()));
        let views: BTreeMap<usize, View> = if looks { anchors.iter().map(view).collect() } else { BTreeMap::new() };
        let holds = |target: usize, anchor: usize| match (context.config.presume_present, views.get(&anchor)) {
            (true, _) => likeness::raw_score(scene, term.word, target, anchor),
            (false, Some(view)) => {
                relate::side_score(view, term.word, &scene.items[target].bounds, &scene.items[anchor].bounds) as f32
            }
            (false, None) => relate::relation_score(scene, term.word, target, anchor),
        };
        let linked = scene.linked_to(anchors.iter().map(|(anchor, _)| *anchor));
        let most = |target: usize, anchor: usize| match context.config.presume_present || linked[target] {
            true => f32::INFINITY,
            false => relate::most(term.word, &scene.items[target].bounds, &scene.items[anchor].bounds),
        };
        best_anchors(&result.total, |target| best_anchor(&anchors, target, most, holds))
    };
    if context.config.presume_present {
        likeness::relative_to_best(&mut scores, &result.total);
    }
    let scores = finish(context.config, term, scores);
    result.push(kind, label, scores, anchors);
}

/// Sides as others would read them: by the anchor's likeliest face, and as mere nearness.
fn push_readings(context: Context<'_, '_>, term: &RelationTerm, anchors: &[(usize, f32)], result: &mut Evaluation) {
    let scene = context.scene;
    let side = matches!(term.word, RelationWord::LeftOf | RelationWord::RightOf);
    let face = if side { Kind::SideFace } else { Kind::DepthFace };
    for (kind, reading) in [(face, Reading::Face), (Kind::SideNear, Reading::Near)] {
        let holds = |target, anchor| likeness::read_score(scene, term.word, target, anchor, reading);
        let (mut scores, _) =
            best_anchors(&result.total, |target| best_anchor(anchors, target, |_, _| f32::INFINITY, holds));
        likeness::relative_to_best(&mut scores, &result.total);
        result.readings.push((kind, finish(context.config, term, scores)));
    }
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
    let scene = context.scene;
    // Best first, so that the search for a target ends where no further pair can win.
    let mut pairs: Vec<(usize, usize, f32)> = first
        .iter()
        .flat_map(|a| second.iter().map(move |b| (a.0, b.0, a.1 * b.1)))
        .filter(|(a, b, _)| a != b)
        .collect();
    pairs.sort_by(|a, b| b.2.total_cmp(&a.2));
    let spans: Vec<Option<relate::Span>> = match context.config.presume_present {
        true => Vec::new(),
        false => pairs.iter().map(|(a, b, _)| relate::Span::new(scene, *a, *b)).collect(),
    };
    best_anchors(&result.total, |target| {
        let bounds = &scene.items[target].bounds;
        let (center, size_m) = (bounds.center(), bounds.size());
        let mut best = (0.0, None);
        for (i, (a, b, weight)) in pairs.iter().enumerate() {
            if *weight <= best.0 {
                break;
            }
            if *a == target || *b == target {
                continue;
            }
            let lies = match spans.get(i) {
                Some(span) => span.as_ref().map_or(0.0, |span| span.holds(&center, &size_m)),
                None => likeness::between_score(scene, target, *a, *b),
            };
            if weight * lies > best.0 {
                best = (weight * lies, Some(*a));
            }
        }
        best
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
        let kind = kind_of_relation(context.scene, term, None);
        result.push(kind, format!("{label} (no such anchor in the map)"), vec![missing; count], vec![None; count]);
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
    let kind = kind_of_relation(context.scene, term, None);
    result.push(kind, label, scores, found.iter().map(|f| f.and_then(|(_, anchor)| anchor)).collect());
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
