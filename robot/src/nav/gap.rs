//! Where floor that lies open in the map is cut off from the robot by what a nearer look may clear away.

use super::costmap::Costmap;
use super::frontier::find_clusters;
use super::grid::bearing;
use super::planner::{Field, Pose2};
use dsm::map::CellState;
use nalgebra::{Point2, Vector2};

/// Smallest area of open floor that is worth a look, square metres.
const LEAST_M2: f64 = 1.0;
/// Farthest from the reachable floor at which it begins, metres: a gap closed by one thing, with the base's width on both
/// sides.
const FARTHEST_M: f64 = 1.2;

/// A look from farther off is taken this far behind the nearest place, about, metres.
const BACK_M: f64 = 0.8;
const OFF_M: f64 = 0.4;

/// A place where open floor is cut off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Where to stand, facing it.
    pub stand: Pose2,
    /// Where to stand for a look from farther off, if floor is free there: a head does not see what is low and near.
    pub afar: Option<Pose2>,
    /// The nearest of the floor beyond, world frame, metres.
    pub beyond: Point2<f64>,
}

/// The gap with the least between the floor that `field` reaches and open floor that it does not; `None` when nothing of
/// note is cut off, or walls lie between. Places near those in `tried` (within 0.5 m) are left out.
pub fn find_gap(costmap: &Costmap, field: &Field, tried: &[Point2<f64>]) -> Option<Gap> {
    let grid = *costmap.grid();
    let cut_off: Vec<bool> =
        (0..grid.len()).map(|cell| costmap.is_traversable(cell) && field.find_length_m(cell).is_none()).collect();
    let mut best: Option<(f64, Gap)> = None;
    for cluster in find_clusters(&grid, &cut_off) {
        if (cluster.len() as f64) * grid.resolution_m.powi(2) < LEAST_M2 {
            continue;
        }
        for cell in cluster {
            let beyond = grid.center_of(cell);
            if tried.iter().any(|place| (place - beyond).norm() < 0.5) {
                continue;
            }
            let reached = grid.cells_within(beyond, FARTHEST_M).filter(|near| field.find_length_m(*near).is_some());
            let reached = reached.filter(|near| costmap.is_traversable(*near)).map(|near| grid.center_of(near));
            let nearest = reached.min_by(|a, b| (a - beyond).norm_squared().total_cmp(&(b - beyond).norm_squared()));
            let Some(position) = nearest else { continue };
            let (distance_m, yaw_rad) = ((beyond - position).norm(), bearing(&position, &beyond));
            // A base is held up by what it passes by; a wall stands on every line through it.
            let is_open = |(cell, _)| costmap.state(cell) != CellState::Occupied;
            let nearer = best.is_none_or(|(least_m, _)| distance_m < least_m);
            if nearer && grid.ray(position, yaw_rad, distance_m).all(is_open) {
                best = Some((distance_m, Gap { stand: Pose2 { position, yaw_rad }, afar: None, beyond }));
            }
        }
    }
    best.map(|(_, gap)| Gap { afar: find_afar(costmap, field, &gap), ..gap })
}

/// The reachable place that lies most nearly [`BACK_M`] behind the stand of a gap, and sees it.
fn find_afar(costmap: &Costmap, field: &Field, gap: &Gap) -> Option<Pose2> {
    let grid = *costmap.grid();
    let (sin, cos) = gap.stand.yaw_rad.sin_cos();
    let wanted = gap.stand.position - BACK_M * Vector2::new(cos, sin);
    let places = grid.cells_within(wanted, OFF_M);
    let reached = places.filter(|cell| costmap.is_traversable(*cell) && field.find_length_m(*cell).is_some());
    let facing = reached.map(|cell| grid.center_of(cell)).map(|position| Pose2::facing(position, &gap.beyond));
    let sees = |place: &Pose2| {
        let to_stand = gap.stand.position - place.position;
        let mut ray = grid.ray(place.position, to_stand.y.atan2(to_stand.x), to_stand.norm());
        ray.all(|(cell, _)| costmap.state(cell) != CellState::Occupied)
    };
    let off = |place: &Pose2| (place.position - wanted).norm_squared();
    facing.filter(sees).min_by(|a, b| off(a).total_cmp(&off(b)))
}

#[cfg(test)]
mod tests {
    //! Contract: a passage that a few cells close is found, from the side that can be reached; walls are no gaps.
    use super::*;
    use crate::nav::{CostmapConfig, room_grid};

    #[test]
    fn a_doorway_with_noise_in_it_is_a_gap_and_a_wall_is_none() {
        // Two rooms of 4 m, a doorway of 0.8 m at x = 4, y = 1.6 to 2.4.
        let mut floor = room_grid();
        let start = Point2::new(1.0, 1.0);
        let gap_of = |floor: &dsm::map::FreeSpace, tried: &[Point2<f64>]| {
            let costmap = Costmap::from_free_space(floor, &CostmapConfig::default());
            find_gap(&costmap, &Field::from_start(&costmap, &start), tried)
        };
        assert_eq!(gap_of(&floor, &[]), None, "all can be reached");
        floor.set([82, 40], CellState::Occupied);
        let gap = gap_of(&floor, &[]).expect("the doorway is closed by one cell");
        assert!(gap.stand.position.x < 4.1 && (gap.stand.position.y - 2.0).abs() < 0.5, "{gap:?}");
        let afar = gap.afar.expect("there is floor behind it");
        let back_m = (afar.position - gap.stand.position).norm();
        assert!(afar.position.x < gap.stand.position.x && (0.6..1.0).contains(&back_m), "{gap:?}");
        assert!(gap.beyond.x > 4.1 && gap.stand.yaw_rad.abs() < 0.8, "{gap:?}");
        assert_eq!(gap_of(&floor, &[gap.beyond]).filter(|again| (again.beyond - gap.beyond).norm() < 0.5), None);
        for row in 30..50 {
            (79..=81).for_each(|column| floor.set([column, row], CellState::Occupied));
        }
        assert_eq!(gap_of(&floor, &[]), None, "a wall");
    }
}
