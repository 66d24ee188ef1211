//! Relations when the thing that is meant is known to be there: who fits best, not whether anyone fits.
//!
//! People say "near" of what is nearer than its peers and "on the left" of what is further left than they are. So a
//! relation is scored from the boxes alone and relative to the best of the candidates. Distances are the least
//! distances between boxes; left and right are those of a viewer who faces the anchor's front, or, when its front is
//! not known, of one who stands at the middle of the map and faces the anchor. Metres throughout.

use super::query::RelationWord;
use super::relate::{box_distance_m, height_share, horizontal_gap_m, relation_score};
use super::scene::Scene;
use crate::geometry::Aabb;
use nalgebra::{Point2, Vector2};

/// Distance over which "near" falls to 1/e.
const NEAR_M: f64 = 1.0;
/// Share of the centre distance that breaks ties between boxes that touch.
const TIE: f64 = 0.1;
/// How much a direction says less per metre of distance.
const FADING_PER_M: f64 = 0.4;
/// What the best-fitting candidate's rivals keep at least: words may be misread.
const DOUBT: f32 = 0.15;
/// What a candidate with the worst fit of an attribute keeps.
const KEPT: f32 = 0.3;

/// The viewer's left and the direction away from the viewer, at an anchor; unit, in the floor plane.
fn frame_at(scene: &Scene<'_>, anchor: usize) -> (Vector2<f64>, Vector2<f64>) {
    match scene.fronts.get(&scene.items[anchor].object.id) {
        Some(front) if !scene.is_told() => {
            let forward = -Vector2::new(front[0], front[1]);
            (Vector2::new(-forward.y, forward.x), forward)
        }
        _ => {
            let view = scene.view_to(scene.items[anchor].bounds.center().xy());
            (view.left, view.forward)
        }
    }
}

/// A way to read a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reading {
    /// For one who faces the anchor's likeliest face: away from the wall it stands at, else across its long side.
    Face,
    /// Only near.
    Near,
}

/// How well `word` holds of `target` and `anchor` when sides are read so.
pub(super) fn read_score(scene: &Scene<'_>, word: RelationWord, target: usize, anchor: usize, reading: Reading) -> f32 {
    let (a, b) = (&scene.items[target].bounds, &scene.items[anchor].bounds);
    let score = match reading {
        Reading::Near => (-distance_m(a, b) / NEAR_M).exp(),
        Reading::Face => {
            let forward = -face_of(scene, b);
            directed(word, a, b, (Vector2::new(-forward.y, forward.x), forward))
        }
    };
    score as f32
}

/// Things closer than this to a side of the scene stand at its wall, metres.
const AT_WALL_M: f64 = 0.4;
/// From this ratio of its sides on, a thing is taken to face across its long side.
const OBLONG: f64 = 1.3;

/// Where a thing without a known front faces as a rule; unit, along an axis.
pub(super) fn face_of(scene: &Scene<'_>, b: &Aabb) -> Vector2<f64> {
    let extent = scene.extent;
    let walls = [
        (b.min.x - extent.min.x, Vector2::x()),
        (extent.max.x - b.max.x, -Vector2::x()),
        (b.min.y - extent.min.y, Vector2::y()),
        (extent.max.y - b.max.y, -Vector2::y()),
    ];
    let size = b.size();
    let across_x = size.y > OBLONG * size.x;
    let across_y = size.x > OBLONG * size.y;
    let faces = |axis: &Vector2<f64>| match (across_x, across_y) {
        (true, _) => axis.x != 0.0,
        (_, true) => axis.y != 0.0,
        _ => true,
    };
    let nearest = walls.iter().filter(|(gap, axis)| *gap < AT_WALL_M && faces(axis));
    if let Some((_, axis)) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)) {
        return *axis;
    }
    let to_center = scene.center - b.center().xy();
    let along_x = if across_x || across_y { across_x } else { to_center.x.abs() > to_center.y.abs() };
    if along_x {
        Vector2::x() * if to_center.x < 0.0 { -1.0 } else { 1.0 }
    } else {
        Vector2::y() * if to_center.y < 0.0 { -1.0 } else { 1.0 }
    }
}

/// Distance between boxes with ties broken by their centres.
pub(super) fn distance_m(a: &Aabb, b: &Aabb) -> f64 {
    box_distance_m(a, b) + TIE * (a.center() - b.center()).norm()
}

/// How well `word` holds of `target` and `anchor` before it is compared with the other candidates.
pub(super) fn raw_score(scene: &Scene<'_>, word: RelationWord, target: usize, anchor: usize) -> f32 {
    let (a, b) = (&scene.items[target].bounds, &scene.items[anchor].bounds);
    let near = |reach_m: f64| (-distance_m(a, b) / reach_m).exp();
    let over = |upper: &Aabb, lower: &Aabb| {
        let rise = (upper.center().z - lower.center().z) / 0.1;
        (-horizontal_gap_m(upper, lower) / 0.25).exp() / (1.0 + (-rise).exp())
    };
    let strict = || f64::from(relation_score(scene, word, target, anchor));
    let score = match word {
        RelationWord::NextTo | RelationWord::Near | RelationWord::Closest => near(NEAR_M),
        RelationWord::Against => near(0.5 * NEAR_M),
        RelationWord::Far | RelationWord::Farthest => 1.0 - near(4.0 * NEAR_M),
        RelationWord::On | RelationWord::In => strict().max(0.4 * near(0.2)).max(0.02 * near(NEAR_M)),
        RelationWord::Above => strict().max(0.6 * over(a, b) * near(NEAR_M)),
        RelationWord::Under | RelationWord::Below => {
            strict().max(0.6 * over(b, a) * near(NEAR_M)).max(0.02 * near(NEAR_M))
        }
        RelationWord::With => strict().max(0.6 * near(0.5)),
        RelationWord::LeftOf | RelationWord::RightOf | RelationWord::InFrontOf | RelationWord::Behind => {
            directed(word, a, b, frame_at(scene, anchor))
        }
        RelationWord::Between => 0.0,
    };
    score as f32
}

/// Left, right, in front and behind of `b`, in a frame of the viewer's left and forward: by the angle to the direction,
/// and less the farther away.
fn directed(word: RelationWord, a: &Aabb, b: &Aabb, (left, forward): (Vector2<f64>, Vector2<f64>)) -> f64 {
    let wanted = match word {
        RelationWord::LeftOf => left,
        RelationWord::RightOf => -left,
        RelationWord::InFrontOf => -forward,
        _ => forward,
    };
    let offset = a.center().xy() - b.center().xy();
    let cosine = offset.dot(&wanted) / offset.norm().max(1e-6);
    let level = 0.7 + 0.3 * f64::from(u8::from(height_share(a, b).max(height_share(b, a)) > 0.1));
    // In front and behind reach farther than beside, but less to the sides.
    let (power, fading) = match word {
        RelationWord::LeftOf | RelationWord::RightOf => (2, FADING_PER_M),
        _ => (3, 0.5 * FADING_PER_M),
    };
    (0.5 + 0.5 * cosine).powi(power) * (-fading * box_distance_m(a, b)).exp() * level
}

/// Share of the target's footprint that lies in the hull of both anchors' footprints.
pub(super) fn between_score(scene: &Scene<'_>, target: usize, first: usize, second: usize) -> f32 {
    /// Points per side of the grid over the footprint.
    const GRID: u32 = 7;
    let bounds = |i: usize| &scene.items[i].bounds;
    let corners = |b: &Aabb| {
        [(b.min.x, b.min.y), (b.max.x, b.min.y), (b.max.x, b.max.y), (b.min.x, b.max.y)].map(|(x, y)| Point2::new(x, y))
    };
    let hull = convex_hull([corners(bounds(first)), corners(bounds(second))].concat());
    let own = bounds(target);
    let at = |i: u32, low: f64, high: f64| low + (f64::from(i) + 0.5) / f64::from(GRID) * (high - low);
    let cells =
        (0..GRID * GRID).map(|i| Point2::new(at(i % GRID, own.min.x, own.max.x), at(i / GRID, own.min.y, own.max.y)));
    let share = cells.filter(|p| is_inside(&hull, p)).count() as f64 / f64::from(GRID * GRID);
    let (a, b, p) = (bounds(first).center().xy(), bounds(second).center().xy(), own.center().xy());
    let detour = (p - a).norm() + (p - b).norm() - (b - a).norm();
    (0.8 * share + 0.2 * (-detour).exp()) as f32
}

/// Corners of the convex hull, counter-clockwise (monotone chain).
fn convex_hull(mut points: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = Point2<f64>>| {
        let mut hull: Vec<Point2<f64>> = Vec::new();
        for p in points {
            while hull.len() > 1 && turn(&hull[hull.len() - 2], &hull[hull.len() - 1], &p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    hull
}

fn turn(a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

fn is_inside(hull: &[Point2<f64>], p: &Point2<f64>) -> bool {
    hull.len() > 2 && (0..hull.len()).all(|i| turn(&hull[i], &hull[(i + 1) % hull.len()], p) >= 0.0)
}

/// Scores relative to the best of the candidates that still count; when none fits at all, all stay nearly equal.
pub(super) fn relative_to_best(scores: &mut [f32], total: &[f32]) {
    let counts = |total: f32| total > 0.0;
    let best = scores.iter().zip(total).filter(|(_, t)| counts(**t)).map(|(s, _)| *s).fold(0.0, f32::max);
    for score in scores.iter_mut() {
        *score = (*score + DOUBT * best.max(0.05)) / (best + DOUBT * best.max(0.05));
    }
}

/// As [`relative_to_best`] for attributes, which people and boxes tell less surely than places.
pub(super) fn soften(scores: &mut [f32], total: &[f32]) {
    let best = scores.iter().zip(total).filter(|(_, t)| **t > 0.0).map(|(s, _)| *s).fold(0.0, f32::max).max(0.05);
    scores.iter_mut().for_each(|score| *score = KEPT + (1.0 - KEPT) * (*score / best).min(1.0));
}

#[cfg(test)]
mod tests {
    //! Contract: a hull holds what lies between its parts, and the best candidate of a relation scores 1.
    use super::*;

    #[test]
    fn hull_and_best() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.5, 0.5)].map(|(x, y)| Point2::new(x, y));
        let hull = convex_hull(square.to_vec());
        assert_eq!(hull.len(), 4);
        assert!(is_inside(&hull, &Point2::new(0.2, 0.7)) && !is_inside(&hull, &Point2::new(1.2, 0.7)));
        let mut scores = [0.2, 0.4, 0.9];
        relative_to_best(&mut scores, &[1.0, 1.0, 0.0]);
        assert!((scores[1] - 1.0).abs() < 1e-6 && scores[0] < 0.6);
    }
}
