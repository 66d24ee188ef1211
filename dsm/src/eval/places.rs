//! Where things of a scene are to each other, as one who stands there would say it.
//!
//! What touches or covers is judged by the true surfaces, not by boxes: a lamp on the seat of a chair is on the chair, a
//! box on the lowest board of a shelf is in it and not under it. Each relation is said only when it holds clearly and
//! holds of no rival even loosely, at any bearer of the anchor's name. What is large is not placed by what is small, and
//! nothing is beside what stands in another room.

use super::rooms::contains;
use super::scene::TrueScene;
use crate::geometry::Aabb;
use nalgebra::Vector2;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// A thing within this distance of another is beside it, metres; its rivals are at least [`APART_M`] away.
const BESIDE_M: f64 = 0.45;
/// Rivals of what is beside something are at least this far from it, metres.
const APART_M: f64 = 1.5;
/// The closest is closer than the next by at least this factor, and [`CLOSER_M`].
const CLOSER: f64 = 1.5;
/// Least difference of distances that is said, metres.
const CLOSER_M: f64 = 0.3;
/// Anchors are at least this large, as a share of the length of what they place.
const ANCHOR_SHARE: f64 = 0.7;
/// A surface within this height of a thing's lower end carries it, metres.
const CONTACT_M: f64 = 0.04;
/// A face whose normal is at least this much up (or down) is level.
const LEVEL: f32 = 0.7;
/// What is over or under something is at most this far from it, metres.
const OVER_M: f64 = 1.2;
/// Least share of the footprint of what is under or above something that lies below or over it.
const COVERED: f64 = 0.5;
/// What stands this close to a wall stands against it, metres.
const WALL_M: f64 = 0.3;

/// The truth with its boxes, and for each thing those that its name can be said of as well.
pub(super) struct Places<'a> {
    pub(super) truth: &'a TrueScene,
    pub(super) boxes: &'a [Aabb],
    pub(super) rivals: &'a [Vec<usize>],
}

/// What a thing has to do with a surface of another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Contact {
    None,
    /// It rests on it, with nothing around.
    On,
    /// It rests in it: covered, or with walls on all sides.
    In,
}

impl Places<'_> {
    /// Phrases that tell thing `i` from its rivals by where it is, at most one of each kind, with their kinds. `{}` stands
    /// for its name.
    pub(super) fn describe(&self, i: usize, rng: &mut ChaCha8Rng) -> Vec<(&'static str, String)> {
        let mut anchors: Vec<usize> = (0..self.boxes.len())
            .filter(|a| *a != i && !self.rivals[i].contains(a) && self.truth.objects[*a].is_seen())
            .filter(|a| self.same_room(i, *a))
            .collect();
        anchors.shuffle(rng);
        let mut phrases: Vec<(&'static str, String)> = Vec::new();
        for &a in &anchors {
            let found = self.describe_by(i, a);
            let new = found.into_iter().find(|(kind, _)| phrases.iter().all(|(said, _)| said != kind));
            phrases.extend(new);
        }
        phrases.extend(self.describe_between(i, &anchors));
        phrases
    }

    /// What can be said of thing `i` by anchor `a`.
    fn describe_by(&self, i: usize, a: usize) -> Vec<(&'static str, String)> {
        let rivals = &self.rivals[i];
        let name = &self.truth.objects[a].category;
        // Every bearer of the anchor's name counts: "on a table" must hold of no rival at any table.
        let bearers: Vec<usize> = [vec![a], self.rivals[a].clone()].concat();
        let none = |loosely: &dyn Fn(usize, usize) -> bool| {
            rivals.iter().all(|j| bearers.iter().all(|b| b == j || !loosely(*j, *b)))
        };
        let mut found = Vec::new();
        // "The table with the lamp on it": here the anchor is the smaller one.
        if self.contact(a, i) == Contact::On && none(&|j, b| self.nearly_on(b, j)) {
            found.push(("with", format!("the {{}} with the {name} on it")));
        }
        let length = |k: usize| self.boxes[k].size().norm();
        if length(a) < ANCHOR_SHARE * length(i) {
            return found;
        }
        let contact = self.contact(i, a);
        if contact != Contact::None && none(&|j, b| self.nearly_on(j, b)) {
            let (kind, word) = if contact == Contact::On { ("on", "on") } else { ("in", "in") };
            found.push((kind, format!("the {{}} {word} the {name}")));
        }
        if self.is_under(i, a) && self.cover_share(i, a) > COVERED && none(&|j, b| self.nearly_over(b, j)) {
            found.push(("under", format!("the {{}} under the {name}")));
        }
        let above = self.is_under(a, i) && self.cover_share(i, a) > COVERED && contact == Contact::None;
        if above && none(&|j, b| self.nearly_over(j, b)) {
            found.push(("above", format!("the {{}} above the {name}")));
        }
        let gap = |j: usize, b: usize| self.gap_m(j, b);
        let level =
            contact == Contact::None && !self.nearly_on(i, a) && !self.nearly_on(a, i) && self.at_one_height(i, a);
        if level && gap(i, a) < BESIDE_M && none(&|j, b| gap(j, b) <= APART_M) {
            found.push(("next_to", format!("the {{}} next to the {name}")));
        }
        let only = bearers.len() == 1;
        if only && gap(i, a) < 3.0 && none(&|j, b| gap(j, b) < CLOSER * gap(i, a) + CLOSER_M) {
            found.push(("closest", format!("the {{}} closest to the {name}")));
        }
        if only && none(&|j, b| CLOSER * gap(j, b) + CLOSER_M > gap(i, a)) {
            found.push(("farthest", format!("the {{}} farthest from the {name}")));
        }
        if only && let Some(side) = self.side_of(i, a).filter(|side| none(&|j, b| self.nearly_at_side(j, b, *side))) {
            let word = if side > 0.0 { "left" } else { "right" };
            found.push(("side", format!("the {{}} to the {word} of the {name}")));
        }
        found
    }

    /// "Between the lamp and the sofa": both are the only ones of their names, and no rival is near the line.
    fn describe_between(&self, i: usize, anchors: &[usize]) -> Option<(&'static str, String)> {
        let only: Vec<usize> = anchors.iter().copied().filter(|a| self.rivals[*a].is_empty()).collect();
        let pairs = only.iter().flat_map(|a| only.iter().map(move |b| (*a, *b))).filter(|(a, b)| a < b);
        let holds = |(a, b): &(usize, usize)| {
            let clear = |j: &usize| self.off_line(*j, *a, *b).is_none_or(|(_, aside_m, _)| aside_m > 1.0);
            let fits = self.off_line(i, *a, *b).is_some_and(|(along, aside_m, length_m)| {
                (0.25..0.75).contains(&along)
                    && aside_m < 0.15 * length_m
                    && length_m < 1.0 + 2.0 * self.boxes[i].size().norm()
            });
            let apart = [*a, *b].iter().all(|k| self.contact(i, *k) == Contact::None && self.at_one_height(i, *k));
            fits && apart && self.rivals[i].iter().all(clear)
        };
        let (a, b) = pairs.into_iter().find(holds)?;
        let name = |k: usize| &self.truth.objects[k].category;
        Some(("between", format!("the {{}} between the {} and the {}", name(a), name(b))))
    }

    /// Where a thing is by the line between the middles of two others: place along it (0 to 1), distance from it and
    /// its length in metres; `None` beyond the ends.
    fn off_line(&self, i: usize, a: usize, b: usize) -> Option<(f64, f64, f64)> {
        let middle = |k: usize| self.boxes[k].center().xy();
        let line = middle(b) - middle(a);
        let length_m = line.norm().max(1e-6);
        let offset = middle(i) - middle(a);
        let along = offset.dot(&line) / (length_m * length_m);
        (0.0..1.0).contains(&along).then(|| (along, offset.perp(&line).abs() / length_m, length_m))
    }

    fn room_of(&self, i: usize) -> Option<usize> {
        let place = self.boxes[i].center().xy();
        self.truth.rooms.iter().position(|room| contains(&room.polygon, &place))
    }

    fn same_room(&self, a: usize, b: usize) -> bool {
        self.truth.rooms.is_empty() || self.room_of(a).is_some_and(|room| self.room_of(b) == Some(room))
    }

    fn gap_m(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (&self.boxes[a], &self.boxes[b]);
        let side = |k: usize| (a.min[k] - b.max[k]).max(b.min[k] - a.max[k]).max(0.0);
        side(0).hypot(side(1)).hypot(side(2))
    }

    fn at_one_height(&self, a: usize, b: usize) -> bool {
        let (a, b) = (&self.boxes[a], &self.boxes[b]);
        a.min.z < b.max.z && b.min.z < a.max.z
    }

    /// What the surfaces of `b` are to thing `i`.
    fn contact(&self, i: usize, b: usize) -> Contact {
        let own = &self.boxes[i];
        let within = |x: f64, y: f64| x > own.min.x && x < own.max.x && y > own.min.y && y < own.max.y;
        let (middle, height) = (own.center(), own.size().z);
        let support = &self.boxes[b];
        let over = (0..2).all(|k| middle[k] > support.min[k] && middle[k] < support.max[k]);
        // A counter does not rest on its plate.
        let footprint_m2 = |k: usize| self.truth.objects[k].bounds.size.xy().product();
        let larger = footprint_m2(b) > COVERED * footprint_m2(i);
        if !over || !larger || own.min.z < support.min.z - 0.005 {
            return Contact::None;
        }
        // Walls reach up beside it; flat things lie on what only looks like a rim.
        let wall = own.min.z + (0.5 * height).max(0.02)..own.max.z + 0.3;
        let (mut carries, mut covers, mut sides) = (false, false, [false; 4]);
        for point in &self.truth.objects[b].points {
            let at = point.position.cast::<f64>();
            let level = point.normal.z;
            if within(at.x, at.y) {
                carries |= level > LEVEL && (at.z - own.min.z).abs() < CONTACT_M;
                covers |= level < -LEVEL && at.z > own.max.z - CONTACT_M && at.z < own.max.z + OVER_M;
            } else if level.abs() < LEVEL && wall.contains(&at.z) {
                let offset = at - middle;
                let side = if offset.x.abs() > offset.y.abs() {
                    usize::from(offset.x > 0.0)
                } else {
                    2 + usize::from(offset.y > 0.0)
                };
                sides[side] = true;
            }
        }
        match carries {
            false => Contact::None,
            true if covers || sides.iter().all(|side| *side) => Contact::In,
            true => Contact::On,
        }
    }

    /// Whether `a` may be taken to be on or in `b`.
    fn nearly_on(&self, a: usize, b: usize) -> bool {
        let (own, support) = (&self.boxes[a], &self.boxes[b]);
        let near = (0..2).all(|k| own.max[k] > support.min[k] - 0.1 && own.min[k] < support.max[k] + 0.1);
        near && own.min.z > support.min.z - 0.05 && own.min.z < support.max.z + 0.2
    }

    /// Whether thing `i` is under `b`: covered by it, not far below, and resting on something else.
    fn is_under(&self, i: usize, b: usize) -> bool {
        let own = &self.boxes[i];
        let middle = own.center();
        let near = |x: f64, y: f64| (x - middle.x).abs() < 0.1 && (y - middle.y).abs() < 0.1;
        let (mut covers, mut lower) = (false, false);
        for point in &self.truth.objects[b].points {
            let at = point.position.cast::<f64>();
            if near(at.x, at.y) {
                covers |= point.normal.z < -LEVEL && at.z > own.max.z - 0.02 && at.z < own.max.z + OVER_M;
                lower |= at.z < middle.z;
            }
        }
        covers && !lower
    }

    /// Share of the footprint of `a` that lies within that of `b`.
    fn cover_share(&self, a: usize, b: usize) -> f64 {
        let (own, other) = (&self.boxes[a], &self.boxes[b]);
        let common = |k: usize| (own.max[k].min(other.max[k]) - own.min[k].max(other.min[k])).max(0.0);
        common(0) * common(1) / (own.size().x * own.size().y).max(1e-9)
    }

    /// Whether `a` may be taken to be over `b`.
    fn nearly_over(&self, a: usize, b: usize) -> bool {
        let (upper, lower) = (&self.boxes[a], &self.boxes[b]);
        let near = (0..2).all(|k| upper.max[k] > lower.min[k] - 0.2 && lower.max[k] > upper.min[k] - 0.2);
        near && upper.max.z > lower.max.z
    }

    /// Left (1) or right (-1) of an anchor that stands against one wall, for one who faces it from its room; `None`
    /// where one could argue.
    fn side_of(&self, i: usize, a: usize) -> Option<f64> {
        let left = self.left_of(a)?;
        let offset = self.boxes[i].center().xy() - self.boxes[a].center().xy();
        let (across, along) = (offset.dot(&left), offset.perp(&left).abs());
        let reach = 0.5 * self.boxes[a].size().xy().abs().dot(&left.abs());
        let beside = across.abs() > reach && across.abs() > 1.5 * along && self.gap_m(i, a) < 1.2;
        beside.then(|| across.signum())
    }

    /// Whether one may take `j` to be on that side of anchor `a`.
    fn nearly_at_side(&self, j: usize, a: usize, side: f64) -> bool {
        let Some(left) = self.left_of(a) else { return true };
        let offset = self.boxes[j].center().xy() - self.boxes[a].center().xy();
        side * offset.dot(&left) > -0.1 && self.same_room(j, a) && self.gap_m(j, a) < 3.0
    }

    /// The left of one who looks at a thing that stands against exactly one wall of its room.
    fn left_of(&self, a: usize) -> Option<Vector2<f64>> {
        let polygon = &self.truth.rooms[self.room_of(a)?].polygon;
        let own = &self.boxes[a];
        let (middle, half) = (own.center().xy(), own.size().xy() * 0.5);
        let mut walls: Vec<Vector2<f64>> = Vec::new();
        for (k, start) in polygon.iter().enumerate() {
            let along = polygon[(k + 1) % polygon.len()] - start;
            let length = along.norm();
            let Some(along) = along.try_normalize(1e-6) else { continue };
            let offset = middle - start;
            let normal = Vector2::new(-along.y, along.x);
            let depth = offset.dot(&normal);
            let reach = half.dot(&normal.abs());
            if (0.0..length).contains(&offset.dot(&along)) && depth.abs() - reach < WALL_M {
                // Towards the wall.
                walls.push(if depth > 0.0 { -normal } else { normal });
            }
        }
        match walls.as_slice() {
            [forward] => Some(Vector2::new(-forward.y, forward.x)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: what is on, in and under something is told by its surfaces.
    use super::*;
    use crate::eval::{SurfacePoint, TrueAttributes, TrueThing};
    use crate::geometry::OrientedBox;
    use nalgebra::{Point3, Vector3};

    /// A thing of level boards 1 m x 1 m: their lower and upper faces, metres; with a box of these heights.
    fn boards(category: &str, faces: &[(f64, f32)], size: f64, [low, high]: [f64; 2]) -> TrueThing {
        let half = 0.5 * size;
        let bounds = Aabb { min: Point3::new(-half, -half, low), max: Point3::new(half, half, high) };
        let at = |i: i32| half * f64::from(i) / 10.0;
        let cells = (-10..=10).flat_map(|i| (-10..=10).map(move |j| (at(i), at(j))));
        let point = |x: f64, y: f64, (z, up): (f64, f32)| SurfacePoint {
            position: Point3::new(x, y, z).cast(),
            normal: Vector3::z() * up,
            area_m2: 0.01,
            seen: true,
        };
        let points = cells.flat_map(|(x, y)| faces.iter().map(move |face| point(x, y, *face))).collect();
        TrueThing {
            category: category.to_owned(),
            attributes: TrueAttributes::default(),
            bounds: OrientedBox::from(bounds),
            points,
            frames_seen: 9,
        }
    }

    #[test]
    fn surfaces_tell_on_from_in_from_under() {
        let cube = |low: f64| boards("cube", &[(low, -1.0), (low + 0.2, 1.0)], 0.2, [low, low + 0.2]);
        let truth = TrueScene {
            name: "test".to_owned(),
            rooms: Vec::new(),
            objects: vec![
                boards("shelf", &[(0.08, -1.0), (0.1, 1.0), (0.98, -1.0), (1.0, 1.0)], 1.0, [0.0, 1.0]),
                boards("table", &[(0.7, -1.0), (0.75, 1.0)], 1.0, [0.0, 0.75]),
                cube(0.1),
                cube(0.0),
                cube(0.75),
            ],
        };
        let boxes: Vec<Aabb> = truth.objects.iter().map(|thing| thing.bounds.aabb()).collect();
        let rivals = vec![Vec::new(); boxes.len()];
        let places = Places { truth: &truth, boxes: &boxes, rivals: &rivals };
        assert_eq!(places.contact(2, 0), Contact::In, "on the lowest board");
        assert!(!places.is_under(2, 0), "the lowest board carries it");
        assert_eq!((places.contact(3, 1), places.is_under(3, 1)), (Contact::None, true), "below the table");
        assert_eq!((places.contact(4, 1), places.is_under(4, 1)), (Contact::On, false), "on the table");
    }
}
