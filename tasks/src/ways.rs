//! Ways of the base: the one that was driven, and the shortest one that would have done.

use dsm::geometry::Aabb;
use dsm_robot::nav::{Costmap, Field, find_path};
use nalgebra::Point2;

/// Positions nearer to the last one that is kept than this are not kept, metres.
const SPACING_M: f64 = 0.02;

/// The way that the base drove.
#[derive(Clone, Debug, Default)]
pub struct Track {
    length_m: f64,
    last: Option<Point2<f64>>,
    /// Stamp, position, and the length driven until then.
    kept: Vec<(f64, Point2<f64>, f64)>,
}

impl Track {
    /// Notes where the base is.
    pub fn note(&mut self, stamp_s: f64, position: Point2<f64>) {
        self.length_m += self.last.map_or(0.0, |last| (position - last).norm());
        self.last = Some(position);
        if self.kept.last().is_none_or(|(_, kept, _)| (position - kept).norm() >= SPACING_M) {
            self.kept.push((stamp_s, position, self.length_m));
        }
    }

    /// Length of all of it, metres.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Where the base was at a moment, and what it had driven until then, metres; `None` before the first note.
    pub fn at(&self, stamp_s: f64) -> Option<(Point2<f64>, f64)> {
        let after = self.kept.partition_point(|(stamp, ..)| *stamp <= stamp_s);
        self.kept[..after].last().or(self.kept.first()).map(|(_, position, length_m)| (*position, *length_m))
    }
}

/// Where a way may end.
#[derive(Clone, Debug)]
pub enum Goal {
    /// Within `within_m` of the outline of a box on the floor, in its room when that is known.
    Near {
        /// The box.
        bounds: Aabb,
        /// Greatest distance, metres.
        within_m: f64,
        /// Outline of the room.
        room: Option<Vec<Point2<f64>>>,
    },
    /// Inside an outline.
    Inside(Vec<Point2<f64>>),
}

impl Goal {
    /// Whether a base at this place is there.
    pub fn holds(&self, place: &Point2<f64>) -> bool {
        match self {
            Self::Near { bounds, within_m, room } => {
                distance_m(bounds, place) <= *within_m && room.as_ref().is_none_or(|room| contains(room, place))
            }
            Self::Inside(outline) => contains(outline, place),
        }
    }
}

/// Length of the shortest way from a place to the goal for a base that fits the costmap, metres; `None` without one.
pub fn find_shortest_m(costmap: &Costmap, from: &Point2<f64>, goal: &Goal) -> Option<f64> {
    if goal.holds(from) {
        return Some(0.0);
    }
    let field = Field::from_start(costmap, from);
    let grid = costmap.grid();
    let places = (0..grid.len()).filter(|cell| costmap.is_traversable(*cell) && goal.holds(&grid.center_of(*cell)));
    let nearest = places.filter_map(|cell| Some((field.find_length_m(cell)?, cell)));
    let (along_grid_m, cell) = nearest.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
    // The planner's way cuts the corners of the grid.
    let planned_m = find_path(costmap, from, &grid.center_of(cell)).map_or(along_grid_m, |path| path.length_m);
    Some(planned_m.min(along_grid_m))
}

/// Distance over the floor from a place to a box, metres.
pub fn distance_m(bounds: &Aabb, place: &Point2<f64>) -> f64 {
    let nearest = Point2::new(place.x.clamp(bounds.min.x, bounds.max.x), place.y.clamp(bounds.min.y, bounds.max.y));
    (place - nearest).norm()
}

/// Whether a polygon holds a point (crossing number).
pub fn contains(polygon: &[Point2<f64>], p: &Point2<f64>) -> bool {
    let n = polygon.len();
    (0..n).fold(false, |inside, i| {
        let (a, b) = (polygon[i], polygon[(i + 1) % n]);
        let crosses = (a.y > p.y) != (b.y > p.y) && p.x < (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x;
        inside != crosses
    })
}

#[cfg(test)]
mod tests {
    //! Contract: a way is as long as what was driven between two moments; the shortest way ends at the nearest place that
    //! counts, and never on the other side of a wall.
    use super::*;
    use dsm::map::{CellState, FreeSpace};
    use dsm_robot::nav::CostmapConfig;
    use nalgebra::Point3;

    #[test]
    fn what_was_driven_after_a_moment_is_told_from_what_was_driven_before() {
        let mut track = Track::default();
        for i in 0..=100 {
            track.note(0.1 * f64::from(i), Point2::new(0.05 * f64::from(i.min(40)), 0.0));
        }
        assert!((track.length_m() - 2.0).abs() < 1e-9);
        let (at, until_m) = track.at(2.0).unwrap();
        assert!((at.x - 1.0).abs() < 0.03 && (track.length_m() - until_m - 1.0).abs() < 0.03, "{at} {until_m}");
        assert!((track.at(99.0).unwrap().1 - 2.0).abs() < 0.03);
        assert!(Track::default().at(1.0).is_none());
    }

    #[test]
    fn a_thing_behind_the_wall_is_reached_through_the_door() {
        // Two rooms of 4 m by 4 m beside each other; the door is at the far end of the wall between them.
        let mut floor = FreeSpace::new(0.05);
        for (x, y) in (0..160).flat_map(|x| (0..80).map(move |y| (x, y))) {
            let rim = x == 0 || y == 0 || x == 159 || y == 79;
            let wall = (79..=80).contains(&x) && y < 60;
            floor.set([x, y], if rim || wall { CellState::Occupied } else { CellState::Free });
        }
        let costmap =
            Costmap::from_free_space(&floor, &CostmapConfig { footprint_radius_m: 0.25, ..Default::default() });
        let bounds = Aabb { min: Point3::new(4.2, 0.5, 0.0), max: Point3::new(4.4, 0.7, 0.5) };
        let room = [(4.0, 0.0), (8.0, 0.0), (8.0, 4.0), (4.0, 4.0)].map(|(x, y)| Point2::new(x, y)).to_vec();
        let from = Point2::new(3.5, 0.6);
        let anywhere = Goal::Near { bounds, within_m: 1.0, room: None };
        assert_eq!(find_shortest_m(&costmap, &from, &anywhere), Some(0.0), "it is 0.7 m away through the wall");
        let beside_it = Goal::Near { bounds, within_m: 1.0, room: Some(room.clone()) };
        let length_m = find_shortest_m(&costmap, &from, &beside_it).unwrap();
        assert!((4.5..6.5).contains(&length_m), "{length_m}");
        let into_it = find_shortest_m(&costmap, &from, &Goal::Inside(room)).unwrap();
        assert!(into_it < length_m && into_it > 2.4, "{into_it}");
    }
}
