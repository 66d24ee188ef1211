//! Free spots on a surface of the map: levels where an object's points form a board, and places on them with support
//! below and room around.

use dsm::map::{Map, ObjectId};
use nalgebra::Point3;
use std::collections::{BTreeMap, BTreeSet};

/// Side of the cells in which support is counted, metres.
const CELL_M: f64 = 0.025;
/// Gaps of support are closed within at least so many cells: clouds have a point per voxel of about a cell, so that rows
/// and columns of cells stay empty, and a closing by one cell leaves them open where they cross.
const LEAST_CLOSED: i32 = 2;
/// Height of the bins in which levels are looked for, metres.
const BIN_M: f64 = 0.01;
/// Points this far above or below a level belong to it, metres.
const BAND_M: f64 = 0.02;
/// A level holds at least this share of the cells of the best one.
const LEVEL_SHARE: f64 = 0.35;
/// Support beyond the object's own radius, metres.
const EDGE_M: f64 = 0.04;
/// Room for the fingers beyond the object's own radius, metres.
const ROOM_M: f64 = 0.05;
/// Height of the hand above an object that is put down, metres.
const HAND_M: f64 = 0.12;
/// Things that rise less above the surface are its own noise, metres.
const FLAT_M: f64 = 0.012;
/// More clearance than this is no better, metres.
const ENOUGH_M: f64 = 0.16;

/// What shall stand on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Radius of its outline, metres.
    pub radius_m: f64,
    /// Its height, metres.
    pub height_m: f64,
    /// Half of its sides, metres, when one is clearly longer than the other; the first is turned by a spot's yaw.
    pub half_m: Option<[f64; 2]>,
}

/// A free spot. World frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The middle of the spot, on the surface.
    pub point: Point3<f64>,
    /// Distance to the nearest edge or thing beyond what the load needs, at most a hand's width.
    pub clearance_m: f64,
    /// How the load's first side must lie, world frame, radians; `None` when it may lie in any way.
    pub yaw_rad: Option<f64>,
}

/// Directions in which a long load is tried.
const YAWS: usize = 8;

type Cell = [i32; 2];

/// Free spots on the object `surface` for the load, those with most room first; `held` is not in their way. `spare` is the
/// share of the usual distances to edges and things that is kept, 1 for all of it.
pub fn find_spots(map: &Map, surface: ObjectId, held: Option<ObjectId>, load: &Load, spare: f64) -> Vec<Spot> {
    let Some(object) = map.find_object(surface) else { return Vec::new() };
    let points: Vec<Point3<f64>> = object.points.iter().map(|p| p.position.cast()).collect();
    let around = object.bounds.aabb().grown(0.3);
    let others = map.objects.values().filter(|o| Some(o.id) != held && o.id != surface);
    let mut things: Vec<Point3<f64>> = others.flat_map(|o| o.points.iter().map(|p| p.position.cast())).collect();
    things
        .retain(|p: &Point3<f64>| p.x > around.min.x && p.x < around.max.x && p.y > around.min.y && p.y < around.max.y);
    let levels: Vec<Level> =
        find_levels(&points).into_iter().map(|z_m| Level::of(&points, &things, z_m, load)).collect();
    let find = |outline: &Outline| levels.iter().flat_map(|level| level.find_spots(outline, spare)).collect();
    let mut spots: Vec<Spot> = find(&Outline::Round(load.radius_m));
    if let (true, Some(half_m)) = (spots.is_empty(), load.half_m) {
        // A book has room between things where one as broad as it is long has none.
        let along_rad = object.bounds.rotation.euler_angles().2;
        let turned = |k: usize| {
            let yaw_rad = along_rad + k as f64 * std::f64::consts::PI / YAWS as f64;
            find(&Outline::Box { half_m, yaw_rad })
        };
        spots = (0..YAWS).flat_map(turned).collect();
    }
    spots.sort_by(|a, b| b.clearance_m.total_cmp(&a.clearance_m));
    spots
}

/// The outline of a load.
enum Outline {
    /// Its radius, metres.
    Round(f64),
    /// Half of its sides, and how the first lies.
    Box { half_m: [f64; 2], yaw_rad: f64 },
}

impl Outline {
    /// Distance of a point beyond the outline around the origin, metres; negative inside a round one, 0 inside a box.
    fn distance_m(&self, x: f64, y: f64) -> f64 {
        match self {
            Self::Round(radius_m) => x.hypot(y) - radius_m,
            Self::Box { half_m, yaw_rad } => {
                let (sin, cos) = yaw_rad.sin_cos();
                let (along, across) = ((x * cos + y * sin).abs(), (y * cos - x * sin).abs());
                (along - half_m[0]).max(0.0).hypot((across - half_m[1]).max(0.0))
            }
        }
    }

    fn radius_m(&self) -> f64 {
        match self {
            Self::Round(radius_m) => *radius_m,
            Self::Box { half_m, .. } => half_m[0].hypot(half_m[1]),
        }
    }
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

/// A level of a surface.
struct Level {
    z_m: f64,
    supported: BTreeSet<Cell>,
    blocked: BTreeSet<Cell>,
}

impl Level {
    /// The level at a height of a surface with these `points`, for a load; `things` are the points of all else.
    fn of(points: &[Point3<f64>], things: &[Point3<f64>], z_m: f64, load: &Load) -> Self {
        let level: Vec<Point3<f64>> = points.iter().filter(|p| (p.z - z_m).abs() <= BAND_M).copied().collect();
        let radius = ((spacing_m(&level) / CELL_M).ceil() as i32).max(LEAST_CLOSED);
        let supported = closed(level.iter().map(cell_of).collect(), radius);
        let top_m = z_m + load.height_m + HAND_M;
        // A surface's own points are noisy in height; what lies flat on it is a thing of its own.
        let own = points.iter().filter(|p| p.z > z_m + BAND_M + 0.01 && p.z < top_m);
        let others = things.iter().filter(|p| p.z > z_m + FLAT_M && p.z < top_m);
        let blocked = own.chain(others).map(cell_of).collect();
        Self { z_m, supported, blocked }
    }

    fn find_spots(&self, outline: &Outline, spare: f64) -> Vec<Spot> {
        let cells = ((outline.radius_m() + ENOUGH_M) / CELL_M).ceil() as i32;
        let offsets: Vec<(Cell, f64)> = (-cells..=cells)
            .flat_map(|y| (-cells..=cells).map(move |x| [x, y]))
            .map(|[x, y]| ([x, y], outline.distance_m(CELL_M * f64::from(x), CELL_M * f64::from(y))))
            .filter(|(_, distance_m)| *distance_m <= ENOUGH_M)
            .collect();
        let spot_at = |cell: &Cell| -> Option<Spot> {
            let mut clearance_m = ENOUGH_M;
            for ([x, y], distance_m) in &offsets {
                let other = [cell[0] + x, cell[1] + y];
                if !self.supported.contains(&other) {
                    clearance_m = clearance_m.min(distance_m - spare * EDGE_M);
                }
                if self.blocked.contains(&other) {
                    clearance_m = clearance_m.min(distance_m - spare * ROOM_M);
                }
                if clearance_m < 0.0 {
                    return None;
                }
            }
            let [x, y] = cell.map(|at| (f64::from(at) + 0.5) * CELL_M);
            let yaw_rad = match outline {
                Outline::Round(_) => None,
                Outline::Box { yaw_rad, .. } => Some(*yaw_rad),
            };
            Some(Spot { point: Point3::new(x, y, self.z_m), clearance_m, yaw_rad })
        };
        self.supported.iter().filter_map(spot_at).collect()
    }
}

/// Median distance over the floor from a point to its nearest neighbour, at least a cell, metres: clouds of large things
/// are thin.
fn spacing_m(points: &[Point3<f64>]) -> f64 {
    const SAMPLES: usize = 200;
    let nearest = |p: &Point3<f64>| {
        let others = points.iter().map(|q| (q.xy() - p.xy()).norm_squared()).filter(|squared| *squared > 1e-8);
        others.fold(f64::INFINITY, f64::min).sqrt()
    };
    let mut nearest: Vec<f64> = points.iter().step_by(points.len() / SAMPLES + 1).map(nearest).collect();
    nearest.sort_by(f64::total_cmp);
    nearest.get(nearest.len() / 2).map_or(CELL_M, |spacing| spacing.clamp(CELL_M, 3.0 * CELL_M))
}

/// Cells with the gaps of up to twice `radius` cells between them filled; the outline stays.
fn closed(cells: BTreeSet<Cell>, radius: i32) -> BTreeSet<Cell> {
    let disc: Vec<Cell> = (-radius..=radius)
        .flat_map(|y| (-radius..=radius).map(move |x| [x, y]))
        .filter(|[x, y]| x * x + y * y <= radius * radius)
        .collect();
    let around = |[x, y]: Cell| disc.iter().map(move |[dx, dy]| [x + dx, y + dy]);
    let grown: BTreeSet<Cell> = cells.iter().flat_map(|cell| around(*cell)).collect();
    grown.iter().filter(|cell| around(**cell).all(|other| grown.contains(&other))).copied().collect()
}

#[cfg(test)]
mod tests {
    //! Contract: a spot lies on the board, away from its edges and from what stands on it; a full board has none.
    use super::*;
    use nalgebra::Point2;

    fn find_on_level(points: &[Point3<f64>], things: &[Point3<f64>], z_m: f64, load: &Load, spare: f64) -> Vec<Spot> {
        Level::of(points, things, z_m, load).find_spots(&Outline::Round(load.radius_m), spare)
    }

    fn board(z_m: f64) -> Vec<Point3<f64>> {
        let step = |i: i32| f64::from(i) * 0.02;
        (0..=40).flat_map(|x| (0..=20).map(move |y| Point3::new(step(x), step(y), z_m))).collect()
    }

    #[test]
    fn spots_keep_away_from_edges_and_things() {
        let points = board(0.7);
        let load = Load { radius_m: 0.04, height_m: 0.1, half_m: None };
        let thing: Vec<Point3<f64>> = (0..10).map(|i| Point3::new(0.2, 0.2, 0.73 + 0.01 * f64::from(i))).collect();
        assert_eq!(find_levels(&points).len(), 1);
        let spots = find_on_level(&points, &thing, 0.7, &load, 1.0);
        assert!(!spots.is_empty());
        for spot in &spots {
            let p = spot.point;
            assert!(p.x > 0.02 && p.x < 0.78 && p.y > 0.02 && p.y < 0.38, "{p}");
            assert!((p.xy() - Point2::new(0.2, 0.2)).norm() > 0.07, "{p}");
        }
        let full: Vec<Point3<f64>> = board(0.75);
        assert!(find_on_level(&points, &full, 0.7, &load, 1.0).is_empty());
    }

    #[test]
    fn a_thin_cloud_supports_and_a_flat_thing_blocks() {
        let step = |i: i32| f64::from(i) * 0.045;
        let points: Vec<_> = (0..=20).flat_map(|x| (0..=12).map(move |y| Point3::new(step(x), step(y), 0.7))).collect();
        let load = Load { radius_m: 0.045, height_m: 0.1, half_m: None };
        let spots = find_on_level(&points, &[], 0.7, &load, 1.0);
        assert!(spots.len() > 100, "{}", spots.len());
        assert!(spots.iter().all(|s| s.point.x > 0.05 && s.point.x < 0.85), "the edges hold");
        let book: Vec<_> = (0..10)
            .flat_map(|x| (0..8).map(move |y| Point3::new(0.3 + 0.02 * f64::from(x), 0.2 + 0.02 * f64::from(y), 0.722)))
            .collect();
        let beside = find_on_level(&points, &book, 0.7, &load, 1.0);
        assert!(beside.iter().all(|s| !(0.28..0.5).contains(&s.point.x) || !(0.18..0.36).contains(&s.point.y)));
    }

    #[test]
    fn rows_and_columns_without_points_are_no_holes() {
        // A dresser whose points lie on a grid of a little more than a cell, in pairs that differ by noise alone.
        let place = |i: i32| 0.012 + 0.028 * f64::from(i);
        let pair = |x: i32, y: i32| [0.0, 0.006].map(|off_m| Point3::new(place(x) + off_m, place(y) + off_m, 0.79));
        let points: Vec<_> = (0..16).flat_map(|x| (0..38).flat_map(move |y| pair(x, y))).collect();
        let load = Load { radius_m: 0.1, height_m: 0.29, half_m: None };
        assert!(!find_on_level(&points, &[], 0.79, &load, 1.0).is_empty());
    }

    #[test]
    fn a_book_has_room_where_a_round_thing_has_none() {
        // Between a row of things at y = 0.2 m and the edge at y = 0.4 m: 0.2 m for a book of 0.06 m by 0.19 m.
        let row: Vec<_> = (0..=80).map(|x| Point3::new(0.01 * f64::from(x), 0.2, 0.78)).collect();
        let load = Load { radius_m: 0.1, height_m: 0.17, half_m: Some([0.028, 0.095]) };
        let level = Level::of(&board(0.7), &row, 0.7, &load);
        let lying = |yaw_rad: f64| Outline::Box { half_m: [0.028, 0.095], yaw_rad };
        assert!(level.find_spots(&Outline::Round(load.radius_m), 0.55).is_empty());
        assert!(level.find_spots(&lying(0.0), 0.55).is_empty(), "across the strip it stands too near to its borders");
        let along = level.find_spots(&lying(std::f64::consts::FRAC_PI_2), 0.55);
        assert!(along.iter().any(|spot| spot.point.y > 0.25) && along.iter().all(|spot| spot.yaw_rad.is_some()));
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
