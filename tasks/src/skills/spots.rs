//! Free spots on a surface of the map: levels where an object's points form a board, and places on them with support
//! below and room around.

use dsm::map::{Map, ObjectId};
use nalgebra::{Point2, Point3};
use std::collections::{BTreeMap, BTreeSet};

/// Side of the cells in which support is counted, metres.
const CELL_M: f64 = 0.025;
/// Height of the bins in which levels are looked for, metres.
const BIN_M: f64 = 0.01;
/// Points this far above or below a level belong to it, metres.
const BAND_M: f64 = 0.02;
/// A level holds at least this share of the cells of the best one.
const LEVEL_SHARE: f64 = 0.35;
/// Support beyond the object's own radius, metres: more than the one cell by which support is widened.
const EDGE_M: f64 = 0.04;
/// Room for the fingers beyond the object's own radius, metres.
const ROOM_M: f64 = 0.05;
/// Height of the hand above an object that is put down, metres.
const HAND_M: f64 = 0.12;
/// More clearance than this is no better, metres.
const ENOUGH_M: f64 = 0.16;

/// What shall stand on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Radius of its outline, metres.
    pub radius_m: f64,
    /// Its height, metres.
    pub height_m: f64,
}

/// A free spot. World frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The middle of the spot, on the surface.
    pub point: Point3<f64>,
    /// Distance to the nearest edge or thing beyond what the load needs, at most a hand's width.
    pub clearance_m: f64,
}

type Cell = [i32; 2];

/// Free spots on the object `surface` for the load, those with most room first; `held` is not in their way.
pub fn find_spots(map: &Map, surface: ObjectId, held: Option<ObjectId>, load: &Load) -> Vec<Spot> {
    let Some(object) = map.find_object(surface) else { return Vec::new() };
    let points: Vec<Point3<f64>> = object.points.iter().map(|p| p.position.cast()).collect();
    let around = object.bounds.aabb().grown(0.3);
    let others = map.objects.values().filter(|o| Some(o.id) != held && o.id != surface);
    let mut obstacles: Vec<Point3<f64>> = others.flat_map(|o| o.points.iter().map(|p| p.position.cast())).collect();
    obstacles
        .retain(|p: &Point3<f64>| p.x > around.min.x && p.x < around.max.x && p.y > around.min.y && p.y < around.max.y);
    obstacles.extend(&points);
    let mut spots: Vec<Spot> =
        find_levels(&points).into_iter().flat_map(|z_m| find_on_level(&points, &obstacles, z_m, load)).collect();
    spots.sort_by(|a, b| b.clearance_m.total_cmp(&a.clearance_m));
    spots
}

fn cell_of(point: &Point3<f64>) -> Cell {
    [(point.x / CELL_M).floor() as i32, (point.y / CELL_M).floor() as i32]
}

/// Heights at which the points cover a board, highest first, metres.
fn find_levels(points: &[Point3<f64>]) -> Vec<f64> {
    let mut bins: BTreeMap<i32, BTreeSet<Cell>> = BTreeMap::new();
    for point in points {
        bins.entry((point.z / BIN_M).floor() as i32).or_default().insert(cell_of(point));
    }
    let covered = |bin: i32| -> usize {
        let near: BTreeSet<Cell> = (bin - 1..=bin + 1).filter_map(|b| bins.get(&b)).flatten().copied().collect();
        near.len()
    };
    let counts: BTreeMap<i32, usize> = bins.keys().map(|&bin| (bin, covered(bin))).collect();
    let most = counts.values().copied().max().unwrap_or(0);
    let is_peak = |bin: i32, count: usize| {
        // Of equal neighbours the higher one wins.
        counts.range(bin - 4..=bin + 4).all(|(&other, &n)| n < count || (n == count && other <= bin))
    };
    let peaks = counts.iter().rev().filter(|&(&bin, &n)| n as f64 >= LEVEL_SHARE * most as f64 && is_peak(bin, n));
    peaks
        .filter_map(|(&bin, _)| {
            let middle_m = (f64::from(bin) + 0.5) * BIN_M;
            let mut heights: Vec<f64> = points.iter().map(|p| p.z).filter(|z| (z - middle_m).abs() <= BAND_M).collect();
            heights.sort_by(f64::total_cmp);
            heights.get(heights.len() / 2).copied()
        })
        .collect()
}

fn find_on_level(points: &[Point3<f64>], obstacles: &[Point3<f64>], z_m: f64, load: &Load) -> Vec<Spot> {
    let mut supported: BTreeSet<Cell> = BTreeSet::new();
    for point in points.iter().filter(|p| (p.z - z_m).abs() <= BAND_M) {
        let [x, y] = cell_of(point);
        // Clouds are thinner than the cells here and there: a point speaks for the cells beside its own.
        supported.extend([[x, y], [x + 1, y], [x - 1, y], [x, y + 1], [x, y - 1]]);
    }
    let top_m = z_m + load.height_m + HAND_M;
    let blocked: BTreeSet<Cell> =
        obstacles.iter().filter(|p| p.z > z_m + BAND_M + 0.01 && p.z < top_m).map(cell_of).collect();
    let reach_m = load.radius_m + ENOUGH_M;
    let cells = (reach_m / CELL_M).ceil() as i32;
    let offsets: Vec<(Cell, f64)> = (-cells..=cells)
        .flat_map(|y| (-cells..=cells).map(move |x| [x, y]))
        .map(|[x, y]| ([x, y], CELL_M * f64::from(x).hypot(f64::from(y))))
        .filter(|(_, distance_m)| *distance_m <= reach_m)
        .collect();
    let spot_at = |cell: &Cell| -> Option<Spot> {
        let mut clearance_m = ENOUGH_M;
        for ([x, y], distance_m) in &offsets {
            let other = [cell[0] + x, cell[1] + y];
            let edge = if supported.contains(&other) { f64::MAX } else { distance_m - load.radius_m - EDGE_M };
            let thing = if blocked.contains(&other) { distance_m - load.radius_m - ROOM_M } else { f64::MAX };
            clearance_m = clearance_m.min(edge).min(thing);
            if clearance_m < 0.0 {
                return None;
            }
        }
        let center = Point2::new((f64::from(cell[0]) + 0.5) * CELL_M, (f64::from(cell[1]) + 0.5) * CELL_M);
        Some(Spot { point: Point3::new(center.x, center.y, z_m), clearance_m })
    };
    supported.iter().filter_map(spot_at).collect()
}

#[cfg(test)]
mod tests {
    //! Contract: a spot lies on the board, away from its edges and from what stands on it; a full board has none.
    use super::*;

    fn board(z_m: f64) -> Vec<Point3<f64>> {
        let step = |i: i32| f64::from(i) * 0.02;
        (0..=40).flat_map(|x| (0..=20).map(move |y| Point3::new(step(x), step(y), z_m))).collect()
    }

    #[test]
    fn spots_keep_away_from_edges_and_things() {
        let points = board(0.7);
        let load = Load { radius_m: 0.04, height_m: 0.1 };
        let thing: Vec<Point3<f64>> = (0..10).map(|i| Point3::new(0.2, 0.2, 0.73 + 0.01 * f64::from(i))).collect();
        assert_eq!(find_levels(&points).len(), 1);
        let spots = find_on_level(&points, &thing, 0.7, &load);
        assert!(!spots.is_empty());
        for spot in &spots {
            let p = spot.point;
            assert!(p.x > 0.02 && p.x < 0.78 && p.y > 0.02 && p.y < 0.38, "{p}");
            assert!((p.xy() - Point2::new(0.2, 0.2)).norm() > 0.07, "{p}");
        }
        let full: Vec<Point3<f64>> = board(0.75);
        assert!(find_on_level(&points, &full, 0.7, &load).is_empty());
    }

    #[test]
    fn levels_are_boards_not_sides() {
        let mut points = board(0.3);
        points.extend(board(0.7));
        points.extend(
            (0..70).flat_map(|z| (0..40).map(move |x| Point3::new(f64::from(x) * 0.02, 0.0, f64::from(z) * 0.01))),
        );
        let levels = find_levels(&points);
        assert_eq!(levels.len(), 2, "{levels:?}");
        assert!((levels[0] - 0.7).abs() < 0.02 && (levels[1] - 0.3).abs() < 0.02, "{levels:?}");
    }
}
