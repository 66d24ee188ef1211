//! What speaks for each candidate, as numbers.

use super::super::color;
use super::super::filter::{Context, Evaluation};
use super::super::likeness;
use super::super::query::{Entity, Noun, Query};
use super::super::scene::{Item, Scene};
use super::kind::{COUNT, Kind};
use super::mentions::Mention;
use super::said::{kinds_said, side_said};
use nalgebra::{Point2, Vector2};

/// Distance over which the nearness of a mentioned thing falls to 1/e, metres.
const MENTION_M: f64 = 1.0;
/// Candidates whose name fits at least this share of the best are peers, that comparing words compare.
const PEER_SHARE: f32 = 0.5;

/// Adds evidence of a kind, by item.
type Adding<'f> = dyn FnMut(Kind, &dyn Fn(usize) -> f32) + 'f;

/// One row of evidence per candidate.
pub(in crate::ground) struct Features {
    /// The candidates.
    pub(in crate::ground) items: Vec<usize>,
    /// Evidence by [`Kind`].
    pub(in crate::ground) rows: Vec<[f32; COUNT]>,
}

/// Weighs all that is said about every candidate of an evaluated query.
pub(in crate::ground) fn features_of(
    context: Context<'_, '_>,
    query: &Query,
    tokens: &[String],
    mentions: &[Mention],
    evaluation: &Evaluation,
) -> Features {
    let scene = context.scene;
    let noun = evaluation.factors.first().map_or(&[][..], |factor| &factor.scores);
    let items: Vec<usize> = (0..noun.len()).filter(|i| noun[*i] > 0.0).collect();
    let best = noun.iter().copied().fold(0.0, f32::max);
    let peers: Vec<usize> = items.iter().copied().filter(|i| noun[*i] >= PEER_SHARE * best).collect();
    let mut rows = vec![[0.0; COUNT]; items.len()];
    let mut add = |kind: Kind, value: &dyn Fn(usize) -> f32| {
        for (row, item) in rows.iter_mut().zip(&items) {
            let value = value(*item);
            row[kind as usize] += if value.is_finite() { value.clamp(-8.0, 8.0) } else { 0.0 };
        }
    };
    for factor in &evaluation.factors {
        add(factor.kind, &|i| factor.scores[i].max(1e-3).ln());
    }
    for (kind, scores) in &evaluation.readings {
        add(*kind, &|i| scores[i].max(1e-3).ln());
    }
    add(Kind::Mentioned, &|i| if noun[i] <= MENTIONED_FIT { 1.0 } else { 0.0 });
    if is_literal(query, tokens) {
        let exact: Vec<usize> = items.iter().copied().filter(|i| noun[*i] >= LITERAL_SHARE * best).collect();
        add(Kind::LiteralName, &|i| if exact.contains(&i) { 0.0 } else { 1.0 });
        for factor in evaluation.factors.iter().skip(1) {
            let highest = exact.iter().map(|i| factor.scores[*i]).fold(0.0, f32::max);
            let is_best = |i: usize| exact.contains(&i) && factor.scores[i] >= highest - 1e-6;
            add(Kind::LiteralBest, &|i| if is_best(i) { 1.0 } else { 0.0 });
        }
    }
    add(Kind::Detection, &|i| scene.items[i].object.names.total().max(1e-3).ln());
    let named: Vec<bool> = noun.iter().map(|fit| *fit > MENTIONED_FIT).collect();
    add_nearness(context, query, mentions, (&items, &named), &mut add);
    let compared = |measure: &dyn Fn(&Item<'_>) -> f64| -> Vec<f64> {
        let values: Vec<f64> = scene.items.iter().map(measure).collect();
        let mean = peers.iter().map(|i| values[*i]).sum::<f64>() / peers.len().max(1) as f64;
        values.into_iter().map(|value| value - mean).collect()
    };
    let size = |item: &Item<'_>| item.object.bounds.size.map(|side| side.max(0.01));
    let volume = compared(&|item| size(item).product().cbrt().ln());
    add(Kind::Volume, &|i| volume[i] as f32);
    let config = context.config;
    let ablated = |kind: &Kind| {
        use Kind::{WordBig, WordDark, WordEven, WordLight, WordLong, WordSmall, WordTall};
        match kind {
            WordBig | WordSmall | WordLong | WordTall | WordEven | WordLight | WordDark => !config.appearance,
            _ => !config.relation_filter,
        }
    };
    for kind in kinds_said(tokens).into_iter().filter(|kind| !ablated(kind)) {
        let measured: Vec<f64> = match kind {
            Kind::WordWall => measure(scene, &|p| -wall_gaps_m(scene, p).into_iter().fold(2.0, f64::min)),
            Kind::WordCorner => measure(scene, &|p| {
                let [a, b, c, d] = wall_gaps_m(scene, p);
                -a.min(b).hypot(c.min(d)).min(4.0)
            }),
            Kind::WordMiddle => {
                let half = 0.5 * scene.extent.size().xy().norm().max(0.1);
                measure(scene, &|p| -(p - scene.center).norm() / half)
            }
            Kind::WordHigh | Kind::WordLow => compared(&|item| item.bounds.center().z),
            Kind::WordBig | Kind::WordSmall => volume.clone(),
            Kind::WordLong => compared(&|item| size(item).xy().max().ln()),
            Kind::WordTall => compared(&|item| size(item).z.ln()),
            Kind::WordEven => compared(&|item| (size(item).xy().min() / size(item).xy().max()).ln()),
            Kind::WordLight | Kind::WordDark => compared(&|item| lab_of(item).map_or(60.0, |lab| lab[0]) / 50.0),
            Kind::WordAlone => alone(scene, &peers),
            Kind::WordEnd => at_ends(scene, mentions, &named),
            Kind::WordFar | Kind::WordEntry => from_doors(scene, &peers),
            _ => continue,
        };
        let sign =
            if matches!(kind, Kind::WordLow | Kind::WordSmall | Kind::WordDark | Kind::WordEntry) { -1.0 } else { 1.0 };
        add(kind, &|i| (sign * measured[i]) as f32);
    }
    let hues = hues_said(context, tokens);
    if !hues.is_empty() && config.appearance {
        let a = compared(&|item| lab_of(item).map_or(0.0, |lab| lab[1]));
        let b = compared(&|item| lab_of(item).map_or(0.0, |lab| lab[2]));
        let along = |i: usize| hues.iter().map(|hue| (hue.x * a[i] + hue.y * b[i]) / 20.0).fold(f64::MIN, f64::max);
        add(Kind::WordHue, &|i| along(i) as f32);
    }
    let read = |kind: Kind| {
        use Kind::{RowCenter, RowTold, SideCenter, SideFront, SideTold};
        matches!(kind, RowTold | RowCenter | SideTold | SideFront | SideCenter)
    };
    let side = side_said(tokens);
    if side != 0.0
        && config.relation_filter
        && peers.len() > 1
        && !evaluation.factors.iter().any(|factor| read(factor.kind))
    {
        let places: Vec<Point2<f64>> = peers.iter().map(|i| scene.items[*i].bounds.center().xy()).collect();
        let middle = Point2::from(places.iter().map(|p| p.coords).sum::<Vector2<f64>>() / places.len() as f64);
        let left = scene.view_to(middle).left;
        let along = measure(scene, &|p| (p - middle).dot(&left));
        let widest = peers.iter().map(|i| along[*i].abs()).fold(0.1, f64::max);
        add(Kind::WordSide, &|i| side * (along[i] / widest) as f32);
    }
    Features { items, rows }
}

/// Names that fit at least this share of the best are the name that was said: "door" is not "doors".
const LITERAL_SHARE: f32 = 0.75;
/// Most words of a text that says one thing.
const LITERAL_WORDS: usize = 14;

/// Whether a name and one relation to a bare name are all that is said.
fn is_literal(query: &Query, tokens: &[String]) -> bool {
    let bare = |entity: &Entity| entity.attributes.is_empty() && entity.selections.is_empty();
    let target = &query.target;
    let [relation] = target.relations.as_slice() else { return false };
    let anchored = relation.anchors.iter().all(|anchor| bare(anchor) && anchor.relations.is_empty());
    tokens.len() <= LITERAL_WORDS && query.viewpoint.is_none() && bare(target) && anchored && !relation.negated
}

/// Fit of the name of a thing that is only mentioned.
pub(in crate::ground) const MENTIONED_FIT: f32 = 0.02;

/// Nearness to things that are mentioned but neither meant nor read as anchors.
fn add_nearness(
    context: Context<'_, '_>,
    query: &Query,
    mentions: &[Mention],
    (items, named): (&[usize], &[bool]),
    add: &mut Adding<'_>,
) {
    let scene = context.scene;
    if !context.config.relation_filter {
        return;
    }
    let mut anchors = Vec::new();
    collect_names(&query.target, &mut anchors);
    let used = |mention: &&Mention| {
        let read = anchors.contains(&mention.phrase);
        !read && !mention.items.iter().any(|item| named[*item])
    };
    for mention in mentions.iter().filter(used) {
        let near = |target: usize| {
            let distance =
                |other: &usize| likeness::distance_m(&scene.items[target].bounds, &scene.items[*other].bounds);
            let others = mention.items.iter().filter(|other| **other != target);
            let nearest = others.map(distance).fold(f64::INFINITY, f64::min);
            (-nearest / MENTION_M).exp() as f32
        };
        let mut scores: Vec<f32> = items.iter().map(|i| near(*i)).collect();
        likeness::relative_to_best(&mut scores, &vec![1.0; items.len()]);
        add(Kind::MentionNear, &|i| items.binary_search(&i).map_or(0.0, |place| scores[place].max(1e-3).ln()));
    }
}

fn collect_names(entity: &Entity, names: &mut Vec<String>) {
    for anchor in entity.relations.iter().flat_map(|relation| &relation.anchors) {
        if let Noun::Thing(name) = &anchor.noun {
            names.push(name.clone());
        }
        collect_names(anchor, names);
    }
}

fn measure(scene: &Scene<'_>, of: &dyn Fn(Point2<f64>) -> f64) -> Vec<f64> {
    scene.items.iter().map(|item| of(item.bounds.center().xy())).collect()
}

/// Distances of a place to the sides of the scene: low x, high x, low y, high y.
fn wall_gaps_m(scene: &Scene<'_>, p: Point2<f64>) -> [f64; 4] {
    let extent = &scene.extent;
    [p.x - extent.min.x, extent.max.x - p.x, p.y - extent.min.y, extent.max.y - p.y].map(|gap| gap.max(0.0))
}

/// Distance to the nearest peer, at most 3 m.
fn alone(scene: &Scene<'_>, peers: &[usize]) -> Vec<f64> {
    let nearest = |i: usize| {
        let others = peers.iter().filter(|peer| **peer != i);
        others.map(|peer| likeness::distance_m(&scene.items[i].bounds, &scene.items[*peer].bounds)).fold(3.0, f64::min)
    };
    (0..scene.items.len()).map(nearest).collect()
}

/// How far along the nearest mentioned long thing a place lies, from 0 in its middle to 1 at its ends.
fn at_ends(scene: &Scene<'_>, mentions: &[Mention], named: &[bool]) -> Vec<f64> {
    let anchors: Vec<usize> =
        mentions.iter().flat_map(|mention| &mention.items).copied().filter(|item| !named[*item]).collect();
    let share = |i: usize| {
        let own = &scene.items[i].bounds;
        let distance = |other: usize| likeness::distance_m(own, &scene.items[other].bounds);
        let beside = anchors.iter().copied().filter(|other| *other != i && distance(*other) < 1.5);
        let nearest = beside.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        nearest.map_or(0.0, |other| {
            let long = &scene.items[other].bounds;
            let axis = usize::from(long.size().y > long.size().x);
            let along = (own.center()[axis] - long.center()[axis]).abs() / (0.5 * long.size()[axis]).max(0.05);
            along.min(1.3)
        })
    };
    (0..scene.items.len()).map(share).collect()
}

/// Distance to the nearest door, from -1 to 1 over the peers; 0 without a door.
fn from_doors(scene: &Scene<'_>, peers: &[usize]) -> Vec<f64> {
    let is_door = |i: &usize| scene.categories[*i].is_some_and(|category| category.name == "door");
    let doors: Vec<usize> = (0..scene.items.len()).filter(is_door).collect();
    let nearest = |i: usize| {
        let to = |door: &usize| likeness::distance_m(&scene.items[i].bounds, &scene.items[*door].bounds);
        doors.iter().filter(|door| **door != i).map(to).fold(f64::INFINITY, f64::min)
    };
    let gaps: Vec<f64> = (0..scene.items.len()).map(nearest).collect();
    let known: Vec<f64> = peers.iter().map(|i| gaps[*i]).filter(|gap| gap.is_finite()).collect();
    if known.len() < 2 {
        return vec![0.0; gaps.len()];
    }
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    let high = known.iter().copied().fold(low + 0.1, f64::max);
    let scaled =
        |gap: f64| if gap.is_finite() { (2.0 * (gap - low) / (high - low) - 1.0).clamp(-1.0, 1.0) } else { 0.0 };
    gaps.into_iter().map(scaled).collect()
}

fn lab_of(item: &Item<'_>) -> Option<[f64; 3]> {
    let points = &item.object.points;
    if points.is_empty() {
        return None;
    }
    let sum = points.iter().fold([0.0; 3], |sum: [f64; 3], p| std::array::from_fn(|i| sum[i] + f64::from(p.color[i])));
    Some(color::lab_of(sum.map(|channel| channel / points.len() as f64)))
}

/// Directions in the plane of hues that the text names; unit.
fn hues_said(context: Context<'_, '_>, tokens: &[String]) -> Vec<Vector2<f64>> {
    let words = context.knowledge.words();
    let hue = |token: &String| {
        let name = words.colors.find(token)?;
        let prototype = words.prototypes.iter().find(|prototype| prototype.name == name)?;
        let [_, a, b] = color::lab_of(prototype.srgb.map(f64::from));
        let hue = Vector2::new(a, b);
        (hue.norm() > 20.0).then(|| hue.normalize())
    };
    tokens.iter().filter_map(hue).collect()
}
