//! The body of a piece of furniture of which something stands open: a door that leans out turns the box of the map.

use dsm::geometry::OrientedBox;
use dsm::map::{CellState, FreeSpace, Map, MapObject, ObjectId};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector2, Vector3};
use std::collections::BTreeMap;

/// Width of the bins in which points are counted, metres.
const BIN_M: f64 = 0.02;
/// Points that peak this much along the walls, as a share of how they peak at best, stand as the walls do.
const LIKE_WALLS: f64 = 0.5;
/// Share of the points that may lie outside of either end: what noise puts there.
const OUTSIDE: f64 = 0.01;
/// Fewer points say nothing about how the furniture stands.
const LEAST_POINTS: usize = 100;

/// A piece of furniture of the map with what was torn off it: its points, and a box over all of its height. A drawer that
/// stands out hides what is below it, so that masks fall in two; furniture does not stand on furniture of its name. `None`
/// when the object left the map.
pub(super) fn find_whole(map: &Map, id: ObjectId) -> Option<(Vec<Point3<f64>>, OrientedBox)> {
    let own = map.find_object(id)?;
    let is_piece = |other: &&MapObject| other.id == id || other.name() == own.name() && are_stacked(own, other);
    let pieces: Vec<&MapObject> = map.stable_objects().chain([own]).filter(is_piece).collect();
    let points = pieces.iter().flat_map(|piece| &piece.points).map(|point| point.position.cast()).collect();
    let bottom_m = pieces.iter().map(|piece| piece.bounds.bottom_m()).fold(f64::INFINITY, f64::min);
    let top_m = pieces.iter().map(|piece| piece.bounds.top_m()).fold(f64::NEG_INFINITY, f64::max);
    // The lower piece is the body; the upper one leans out.
    let body = pieces.iter().min_by(|a, b| a.bounds.bottom_m().total_cmp(&b.bounds.bottom_m()))?.bounds;
    let center = Point3::new(body.center.x, body.center.y, 0.5 * (bottom_m + top_m));
    Some((points, OrientedBox { center, size: Vector3::new(body.size.x, body.size.y, top_m - bottom_m), ..body }))
}

/// Whether one lies right over the other.
fn are_stacked(a: &MapObject, b: &MapObject) -> bool {
    /// Masks lose a border, and the gap behind a drawer shows nothing, metres.
    const GAP_M: f64 = 0.15;
    const COMMON_SHARE: f64 = 0.5;
    let (a, b) = (a.bounds.aabb(), b.bounds.aabb());
    let common = (a.max.inf(&b.max) - a.min.sup(&b.min)).xy().map(|side| side.max(0.0));
    let smaller = (a.size().x * a.size().y).min(b.size().x * b.size().y);
    common.x * common.y > COMMON_SHARE * smaller && (a.min.z - b.max.z).max(b.min.z - a.max.z) < GAP_M
}

/// The upright box around points (world frame) that stands as most of their faces do: seen along a face its points fall
/// together, so that the counts along both axes peak. Furniture stands as the walls do unless its points say otherwise.
/// `bounds` when there are too few points.
pub(super) fn find_carcass(points: &[Point3<f64>], bounds: &OrientedBox, walls: &FreeSpace) -> OrientedBox {
    if points.len() < LEAST_POINTS {
        return *bounds;
    }
    let flat: Vec<Point2<f64>> = points.iter().map(|p| p.xy()).collect();
    let occupied = walls.known_cells().filter(|(_, state)| *state == CellState::Occupied);
    let occupied: Vec<Point2<f64>> = occupied.map(|(cell, _)| walls.center_of(cell)).collect();
    let (own, of_walls) = (find_way(&flat, BIN_M), find_way(&occupied, 2.0 * walls.resolution_m));
    let is_like_walls = peaks(&flat, of_walls, BIN_M) as f64 > LIKE_WALLS * peaks(&flat, own, BIN_M) as f64;
    let degrees = if is_like_walls && !occupied.is_empty() { of_walls } else { own };
    let (x, y) = (axis_of(degrees), axis_of(degrees + 90));
    let Some(((x0, x1), (y0, y1))) = extent(&flat, &x).zip(extent(&flat, &y)) else { return *bounds };
    let middle = x * (0.5 * (x0 + x1)) + y * (0.5 * (y0 + y1));
    OrientedBox {
        center: Point3::new(middle.x, middle.y, bounds.center.z),
        size: Vector3::new(x1 - x0, y1 - y0, bounds.size.z),
        rotation: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), f64::from(degrees).to_radians()),
    }
}

fn axis_of(degrees: i32) -> Vector2<f64> {
    let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
    Vector2::new(cos, sin)
}

/// The direction below 90 degrees along which, and across which, points fall together most.
fn find_way(points: &[Point2<f64>], bin_m: f64) -> i32 {
    // The smallest turn among equals.
    (0..90).map(|degrees| (peaks(points, degrees, bin_m), -degrees)).max().map_or(0, |(_, turn)| -turn)
}

/// How unevenly points lie along a direction and across it.
fn peaks(points: &[Point2<f64>], degrees: i32, bin_m: f64) -> u64 {
    peak(points, &axis_of(degrees), bin_m) + peak(points, &axis_of(degrees + 90), bin_m)
}

/// How unevenly points lie along an axis: the sum of the squares of their counts.
fn peak(points: &[Point2<f64>], axis: &Vector2<f64>, bin_m: f64) -> u64 {
    let mut counts: BTreeMap<i64, u64> = BTreeMap::new();
    for p in points {
        *counts.entry((p.coords.dot(axis) / bin_m).floor() as i64).or_default() += 1;
    }
    counts.values().map(|count| count * count).sum()
}

/// Between which places along an axis nearly all points lie.
fn extent(points: &[Point2<f64>], axis: &Vector2<f64>) -> Option<(f64, f64)> {
    let mut along: Vec<f64> = points.iter().map(|p| p.coords.dot(axis)).collect();
    along.sort_by(f64::total_cmp);
    let out = (OUTSIDE * along.len() as f64) as usize;
    Some((*along.get(out)?, *along.get(along.len().checked_sub(1 + out)?)?))
}

#[cfg(test)]
mod tests {
    //! Contract: the box stands as the furniture does, although an open door leans out of it.
    use super::*;
    use dsm::map::{MapChange, MapUpdate, Votes};
    use dsm::time::Stamp;

    #[test]
    fn an_open_door_does_not_turn_the_box() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.3);
        let mut points = Vec::new();
        let mut board = |from: [f64; 2], to: [f64; 2]| {
            for (i, k) in (0..40).flat_map(|i| (0..30).map(move |k| (f64::from(i) / 40.0, f64::from(k) / 30.0))) {
                let at = [from[0] + i * (to[0] - from[0]), from[1] + i * (to[1] - from[1])];
                points.push(turn * Point3::new(at[0], at[1], 0.9 * k));
            }
        };
        // A front of 1 m, a side of 0.5 m, and a door of 0.5 m that stands out by 45 degrees.
        board([0.0, 0.0], [1.0, 0.0]);
        board([0.0, 0.0], [0.0, 0.5]);
        board([0.0, 0.0], [0.35, -0.35]);
        let bounds = OrientedBox {
            center: Point3::new(0.0, 0.0, 0.45),
            size: Vector3::new(1.0, 1.0, 0.9),
            rotation: UnitQuaternion::identity(),
        };
        let walls = FreeSpace::new(0.05);
        let found = find_carcass(&points, &bounds, &walls);
        let yaw_rad = |found: &OrientedBox| found.rotation.euler_angles().2.rem_euclid(std::f64::consts::FRAC_PI_2);
        assert!((yaw_rad(&found) - 0.3).abs() < 0.02, "{found:?}");
        let mut sizes = [found.size.x, found.size.y];
        sizes.sort_by(f64::total_cmp);
        // Less a hundredth of the points at either end.
        assert!((sizes[0] - 0.85).abs() < 0.06 && (sizes[1] - 1.0).abs() < 0.06, "{sizes:?}");
        assert_eq!(find_carcass(&points[..50], &bounds, &walls), bounds);
    }

    #[test]
    fn what_was_torn_off_belongs_to_the_furniture() {
        let mut map = Map::new(0.05);
        let mut put = |id: u64, name: &str, center: [f64; 3], size: [f64; 3]| {
            let mut votes = Votes::default();
            votes.add(name, 9.0);
            let rotation = UnitQuaternion::identity();
            let bounds = OrientedBox { center: center.into(), size: size.into(), rotation };
            let changes = vec![MapChange::Put(Box::new(MapObject::given(ObjectId(id), votes, bounds)))];
            map.apply(MapUpdate { stamp: Stamp::default(), changes });
        };
        put(1, "dresser", [0.0, 0.0, 0.27], [1.0, 0.48, 0.54]);
        put(2, "dresser", [0.0, -0.2, 0.75], [1.0, 0.6, 0.26]);
        put(3, "dresser", [1.3, 0.0, 0.4], [1.0, 0.48, 0.8]);
        put(4, "vase", [0.0, 0.0, 1.0], [0.1, 0.1, 0.2]);
        let whole = |id: u64| find_whole(&map, ObjectId(id)).map(|(_, bounds)| bounds).expect("it is in the map");
        for id in [1, 2] {
            let bounds = whole(id);
            assert!((bounds.top_m() - 0.88).abs() < 1e-9 && bounds.bottom_m().abs() < 1e-9, "{bounds:?}");
            assert!(bounds.center.y.abs() < 1e-9 && (bounds.size.y - 0.48).abs() < 1e-9, "{bounds:?}");
        }
        assert!((whole(3).top_m() - 0.8).abs() < 1e-9 && (whole(4).top_m() - 1.1).abs() < 1e-9);
        assert!(find_whole(&map, ObjectId(9)).is_none());
    }

    #[test]
    fn furniture_of_which_little_but_the_door_is_seen_stands_as_the_walls_do() {
        let mut walls = FreeSpace::new(0.05);
        (0..80).for_each(|i| walls.set([i, 0], CellState::Occupied));
        let mut points = Vec::new();
        let mut board = |to: [f64; 2], columns: i32| {
            for (i, k) in (0..columns).flat_map(|i| (0..30).map(move |k| (f64::from(i) / f64::from(columns), k))) {
                points.push(Point3::new(1.0 + i * to[0], 1.0 + i * to[1], 0.03 * f64::from(k)));
            }
        };
        board([0.4, 0.0], 30);
        board([0.3, -0.3], 34);
        let bounds = OrientedBox {
            center: Point3::new(1.2, 0.9, 0.45),
            size: Vector3::new(1.0, 1.0, 0.9),
            rotation: UnitQuaternion::identity(),
        };
        let yaw = find_carcass(&points, &bounds, &walls).rotation.euler_angles().2;
        assert!(yaw.abs() < 1e-9, "{yaw}");
        let alone = find_carcass(&points, &bounds, &FreeSpace::new(0.05)).rotation.euler_angles().2;
        assert!((alone - 45_f64.to_radians()).abs() < 0.03, "{alone}");
    }
}
