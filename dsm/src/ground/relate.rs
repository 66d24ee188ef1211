//! How well a relation holds between two objects, 0 to 1: the map's stored edge or the boxes, whichever says more.
//!
//! Boxes are along the world axes. All distances are metres; thresholds follow the definitions in
//! [`crate::map::RelationKind`] but fall off softly, because map boxes are noisy.

use super::query::RelationWord;
use super::scene::{Scene, View};
use crate::geometry::Aabb;
use crate::map::RelationKind;
use nalgebra::{Point2, Point3, Vector2, Vector3};

/// 1 up to `full`, 0 from `none` on, linear between.
fn falling(value: f64, full: f64, none: f64) -> f64 {
    ((none - value) / (none - full)).clamp(0.0, 1.0)
}

/// Score of near, far and beside where they clearly do not hold, before fading: low enough to refuse, and still in order.
const CLEARLY_NOT: f64 = 0.12;

/// Prefers the closer of two that are both near, too weakly to hide that both are.
fn fading(distance_m: f64) -> f64 {
    1.0 / (1.0 + 0.08 * distance_m)
}

/// Overlap of the footprints over the smaller footprint, 0 to 1.
fn footprint_overlap(a: &Aabb, b: &Aabb) -> f64 {
    let side = |i: usize| (a.max[i].min(b.max[i]) - a.min[i].max(b.min[i])).max(0.0);
    let area = |c: &Aabb| ((c.max.x - c.min.x) * (c.max.y - c.min.y)).max(1e-6);
    (side(0) * side(1) / area(a).min(area(b))).min(1.0)
}

/// Gap between the footprints, 0 when they overlap.
pub(super) fn horizontal_gap_m(a: &Aabb, b: &Aabb) -> f64 {
    let gap = |i: usize| (a.min[i] - b.max[i]).max(b.min[i] - a.max[i]).max(0.0);
    gap(0).hypot(gap(1))
}

/// Least distance between two boxes.
pub(super) fn box_distance_m(a: &Aabb, b: &Aabb) -> f64 {
    let gap = (a.min.z - b.max.z).max(b.min.z - a.max.z).max(0.0);
    horizontal_gap_m(a, b).hypot(gap)
}

/// Share of `a`'s height that lies within `b`'s.
pub(super) fn height_share(a: &Aabb, b: &Aabb) -> f64 {
    let common = a.max.z.min(b.max.z) - a.min.z.max(b.min.z);
    (common / (a.max.z - a.min.z).max(1e-6)).clamp(0.0, 1.0)
}

/// Whether `a` rests on the top face of `b`, or on a board within it when `b` is high and open (a shelf).
fn rests_on(a: &Aabb, b: &Aabb) -> f64 {
    let over = falling(-footprint_overlap(a, b), -0.3, -0.05);
    if over <= 0.0 {
        return 0.0;
    }
    let smaller = falling(footprint_area(a) / footprint_area(b), 1.5, 4.0);
    let top = falling((a.min.z - b.max.z).abs(), 0.06, 0.2);
    over * smaller * top
}

fn footprint_area(a: &Aabb) -> f64 {
    ((a.max.x - a.min.x) * (a.max.y - a.min.y)).max(1e-6)
}

/// Whether `a` lies within `b`: footprint and height.
fn lies_in(a: &Aabb, b: &Aabb) -> f64 {
    let side = |i: usize| {
        let common = a.max[i].min(b.max[i]) - a.min[i].max(b.min[i]);
        (common / (a.max[i] - a.min[i]).max(1e-6)).clamp(0.0, 1.0)
    };
    let footprint = falling(-side(0) * side(1), -0.7, -0.3);
    let larger = if footprint_area(a) < footprint_area(b) { 1.0 } else { 0.3 };
    // Fruit looks over the rim of its bowl, so the lower end counts.
    let starts_inside = falling(b.min.z - a.min.z, 0.02, 0.1) * falling(a.min.z - b.max.z, -0.02, 0.03);
    footprint * larger * starts_inside
}

/// Whether `a` is beside `b`: a small gap, at a common height, and neither on the other.
fn beside(a: &Aabb, b: &Aabb, full_m: f64, none_m: f64) -> f64 {
    let reach = 0.25 * a.size().xy().max().max(b.size().xy().max());
    let gap = falling(box_distance_m(a, b), full_m + 0.3 * reach, none_m + reach);
    if gap <= 0.0 {
        return 0.0;
    }
    let stacked = rests_on(a, b).max(rests_on(b, a));
    let level = 0.4 + 0.6 * f64::from(u8::from(height_share(a, b).max(height_share(b, a)) > 0.1));
    gap * level * (1.0 - 0.7 * stacked)
}

/// How well `word` holds between item `target` and item `anchor`; for `between` see [`Span`].
pub(super) fn relation_score(scene: &Scene<'_>, word: RelationWord, target: usize, anchor: usize) -> f32 {
    let (a, b) = (&scene.items[target].bounds, &scene.items[anchor].bounds);
    let distance_m = || box_distance_m(a, b);
    let stored = |kind| f64::from(scene.stored(target, anchor, kind));
    let stored_back = |kind| f64::from(scene.stored(anchor, target, kind));
    // "on the shelf" is also said of what stands on a board inside it, "in the shelf" of what stands on it.
    let on = || {
        let inside = stored(RelationKind::Inside).max(lies_in(a, b)) * if is_open_storage(b, a) { 0.9 } else { 0.35 };
        stored(RelationKind::On).max(stored_back(RelationKind::Under)).max(rests_on(a, b)).max(inside)
    };
    let inside = || {
        stored(RelationKind::Inside).max(lies_in(a, b)).max(0.5 * stored(RelationKind::On)).max(0.4 * rests_on(a, b))
    };
    let under = || {
        let covered = falling(-footprint_overlap(a, b), -0.3, -0.05);
        let lower = falling(a.center().z - b.center().z, -0.05, 0.1) * falling(a.max.z - b.max.z, -0.02, 0.05);
        stored(RelationKind::Under).max(stored(RelationKind::Below)).max(covered * lower)
    };
    let above = |upper: &Aabb, lower: &Aabb| {
        let covered = falling(-footprint_overlap(upper, lower), -0.2, -0.02);
        covered * falling(lower.max.z - upper.min.z, 0.03, 0.15)
    };
    let score = match word {
        RelationWord::On => on(),
        RelationWord::In => inside(),
        RelationWord::Under => under(),
        RelationWord::Above => stored(RelationKind::Above).max(above(a, b) * (1.0 - 0.4 * rests_on(a, b))),
        RelationWord::Below => stored(RelationKind::Below).max(above(b, a)).max(under()),
        RelationWord::NextTo => {
            (0.9 * stored(RelationKind::NextTo)).max(beside(a, b, 0.2, 1.0)).max(CLEARLY_NOT) * fading(distance_m())
        }
        RelationWord::Near | RelationWord::Closest => {
            let distance_m = distance_m();
            (0.8 * stored(RelationKind::Near)).max(falling(distance_m, 0.3, 2.5)) * fading(distance_m)
        }
        RelationWord::Far | RelationWord::Farthest => {
            (1.0 - falling(box_distance_m(a, b), 1.0, 4.0)).max(CLEARLY_NOT)
                * (1.0 - 0.2 * fading(box_distance_m(a, b)))
        }
        RelationWord::Against => stored(RelationKind::Against).max(beside(a, b, 0.08, 0.4)),
        RelationWord::With => {
            let back = RelationWord::On;
            let carried = f64::from(relation_score(scene, back, anchor, target)).max(lies_in(b, a));
            let part = stored_back(RelationKind::PartOf).max(stored(RelationKind::UsedWith) * 0.5);
            carried.max(part).max(0.9 * beside(a, b, 0.25, 1.0)).max(0.8 * on()).max(0.9 * above(b, a))
        }
        RelationWord::LeftOf | RelationWord::RightOf | RelationWord::InFrontOf | RelationWord::Behind => {
            side_score(&scene.view_to(b.center().xy()), word, a, b)
        }
        RelationWord::Between => 0.0,
    };
    score as f32
}

/// The most that [`relation_score`] can be by the gaps between two boxes, when no relation is stored between the things.
#[inline]
pub(super) fn most(word: RelationWord, a: &Aabb, b: &Aabb) -> f32 {
    /// Wider than what rounding makes of a distance.
    const ROUNDING: f64 = 1e-9;
    let gap = |i: usize| (a.min[i] - b.max[i]).max(b.min[i] - a.max[i]).max(0.0);
    let gaps = [gap(0), gap(1), gap(2)];
    let covered = gaps[0] <= 0.0 && gaps[1] <= 0.0;
    let least_m = gaps.iter().map(|gap| gap * gap).sum::<f64>().sqrt() * (1.0 - ROUNDING);
    let beside = |full_m: f64, none_m: f64| {
        let reach = 0.25 * (0..2).map(|i| (a.max[i] - a.min[i]).max(b.max[i] - b.min[i])).fold(0.0, f64::max);
        if least_m >= none_m + reach { 0.0 } else { falling(least_m, full_m + 0.3 * reach, none_m + reach) }
    };
    let most = match word {
        RelationWord::On
        | RelationWord::In
        | RelationWord::Under
        | RelationWord::Above
        | RelationWord::Below
        | RelationWord::Between => f64::from(u8::from(covered)),
        RelationWord::NextTo => beside(0.2, 1.0).max(CLEARLY_NOT) * fading(least_m),
        RelationWord::Near | RelationWord::Closest => falling(least_m, 0.3, 2.5) * fading(least_m),
        RelationWord::Far | RelationWord::Farthest => {
            let most_m = gaps.iter().sum::<f64>() * (1.0 + ROUNDING);
            (1.0 - falling(most_m, 1.0, 4.0)).max(CLEARLY_NOT) * (1.0 - 0.2 * fading(most_m))
        }
        RelationWord::Against => beside(0.08, 0.4),
        RelationWord::With if covered => 1.0,
        RelationWord::With => 0.9 * beside(0.25, 1.0),
        RelationWord::LeftOf | RelationWord::RightOf | RelationWord::InFrontOf | RelationWord::Behind => {
            0.5 + 0.5 * falling(least_m, 0.5, 4.0)
        }
    };
    most as f32
}

/// A shelf or an open cupboard: clearly higher than what it holds.
fn is_open_storage(container: &Aabb, content: &Aabb) -> bool {
    container.size().z > 2.0 * content.size().z && container.size().z > 0.4 && content.min.z > container.min.z + 0.08
}

/// Left, right, in front, behind for a viewer who faces the anchor: full within 45 degrees of the direction, none from
/// 80 degrees on, and less the farther away.
pub(super) fn side_score(view: &View, word: RelationWord, a: &Aabb, b: &Aabb) -> f64 {
    let wanted = match word {
        RelationWord::LeftOf => view.left,
        RelationWord::RightOf => -view.left,
        RelationWord::InFrontOf => -view.forward,
        _ => view.forward,
    };
    let offset = a.center().xy() - b.center().xy();
    let distance = offset.norm();
    if distance < 1e-3 {
        return 0.0;
    }
    let direction = falling(-offset.dot(&wanted) / distance, -0.7, -0.17);
    if direction <= 0.0 {
        return 0.0;
    }
    direction * (0.5 + 0.5 * falling(box_distance_m(a, b), 0.5, 4.0))
}

/// The line between two anchors, along which a target may lie.
pub(super) struct Span {
    start: Point2<f64>,
    along: Vector2<f64>,
    length: f64,
    half_width: f64,
    middle_z_m: f64,
}

impl Span {
    /// Between the items; `None` when their centres coincide.
    pub(super) fn new(scene: &Scene<'_>, first: usize, second: usize) -> Option<Self> {
        let bounds = |i: usize| &scene.items[i].bounds;
        let (start, end) = (bounds(first).center().xy(), bounds(second).center().xy());
        let length = (end - start).norm();
        let widest = |i: usize| bounds(i).size().xy().max();
        let half_width = 0.5 * widest(first).max(widest(second));
        let middle_z_m = 0.5 * (bounds(first).center().z + bounds(second).center().z);
        (length >= 0.05).then(|| Self { start, along: (end - start) / length, length, half_width, middle_z_m })
    }

    /// How well a thing of this centre and size lies between: near the line that joins the centres, and not beyond
    /// their ends.
    pub(super) fn holds(&self, center: &Point3<f64>, size: &Vector3<f64>) -> f32 {
        let offset = center.xy() - self.start;
        let inside = falling((offset.dot(&self.along) / self.length - 0.5).abs(), 0.42, 0.55);
        if inside <= 0.0 {
            return 0.0;
        }
        let aside = offset.perp(&self.along).abs();
        let falls = falling(aside, 0.2 * self.length + 0.5 * self.half_width, 0.5 * self.length + self.half_width);
        if falls <= 0.0 {
            return 0.0;
        }
        // People name what stands beside the thing: a bottle is not between things of two rooms.
        let usual_m = 0.5 + 2.0 * size.norm();
        let close = (-(self.length - usual_m).max(0.0) / usual_m).exp();
        let level = falling((center.z - self.middle_z_m).abs(), 0.3 + 0.5 * size.z, 1.5);
        (close * level * inside * falls) as f32
    }
}
