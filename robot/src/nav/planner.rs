//! Shortest paths of the base.

use super::costmap::Costmap;
use super::grid::{Grid, bearing};
use super::search::search;
use dsm::Pose;
use nalgebra::Point2;

/// A place on the floor with a heading. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose2 {
    /// Position, metres.
    pub position: Point2<f64>,
    /// Heading about +z from +x, radians.
    pub yaw_rad: f64,
}

impl Pose2 {
    /// The pose at `position` that faces `target`.
    pub fn facing(position: Point2<f64>, target: &Point2<f64>) -> Self {
        Self { position, yaw_rad: bearing(&position, target) }
    }

    /// The part of a base pose (`world_from_base`) that lies in the floor plane.
    pub fn from_pose(world_from_base: &Pose) -> Self {
        let forward = world_from_base.rotation * nalgebra::Vector3::x();
        Self {
            position: Point2::new(world_from_base.translation.x, world_from_base.translation.y),
            yaw_rad: forward.y.atan2(forward.x),
        }
    }

    /// The pose of a base standing there: `world_from_base`.
    pub fn to_pose(self) -> Pose {
        Pose::new(nalgebra::Vector3::new(self.position.x, self.position.y, 0.0), nalgebra::Vector3::z() * self.yaw_rad)
    }
}

/// A path of straight legs. World frame, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Corners from the start to the goal; at least one.
    pub points: Vec<Point2<f64>>,
    /// Length in metres.
    pub length_m: f64,
    /// Heading to take at the goal, radians; `None` when any will do.
    pub goal_yaw_rad: Option<f64>,
}

impl Path {
    /// A path through the given points.
    pub fn from_points(points: Vec<Point2<f64>>) -> Self {
        let length_m = points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        Self { points, length_m, goal_yaw_rad: None }
    }

    /// The same path with a heading to take at its end.
    pub fn with_goal_yaw(mut self, yaw_rad: f64) -> Self {
        self.goal_yaw_rad = Some(yaw_rad);
        self
    }
}

/// Why there is no path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlanFailure {
    /// The start lies outside the known grid.
    StartOutside,
    /// The goal lies outside the known grid.
    GoalOutside,
    /// The base cannot stand at the goal: this much clearance (metres) is there.
    GoalBlocked {
        /// Distance from the goal to the nearest obstacle, metres.
        clearance_m: f64,
    },
    /// Both are fine, but no way joins them.
    NoWay,
}

/// The cheapest path from `start` to `goal` over the eight neighbours of each cell, then pulled straight wherever a
/// straight leg costs no more.
///
/// # Errors
/// [`PlanFailure`] says why there is none.
pub fn find_path(costmap: &Costmap, start: &Point2<f64>, goal: &Point2<f64>) -> Result<Path, PlanFailure> {
    let grid = *costmap.grid();
    let start_cell = grid.find_cell(start).ok_or(PlanFailure::StartOutside)?;
    let goal_cell = grid.find_cell(goal).ok_or(PlanFailure::GoalOutside)?;
    if !costmap.is_traversable(goal_cell) {
        return Err(PlanFailure::GoalBlocked { clearance_m: costmap.clearance_m(goal_cell) });
    }
    let (ways, arrived) = search(costmap, start_cell, Some(goal_cell));
    if !arrived {
        return Err(PlanFailure::NoWay);
    }
    let back = std::iter::successors(Some(goal_cell), |cell| ways.find_parent(*cell));
    let mut cells: Vec<u32> = back.map(|cell| cell as u32).collect();
    cells.reverse();
    Ok(pull_straight(costmap, &cells, start, goal))
}

/// Cheapest ways from one start to every cell: for choosing among many goals.
#[derive(Clone, Debug)]
pub struct Field {
    grid: Grid,
    start: Point2<f64>,
    length_m: Vec<f32>,
    parents: Vec<u32>,
}

const NO_PARENT: u32 = u32::MAX;

impl Field {
    /// The field around `start`; nothing is reachable when it lies outside the grid.
    pub fn from_start(costmap: &Costmap, start: &Point2<f64>) -> Self {
        let grid = *costmap.grid();
        let mut length_m = vec![f32::INFINITY; grid.len()];
        let mut parents = vec![NO_PARENT; grid.len()];
        if let Some(start_cell) = grid.find_cell(start) {
            length_m[start_cell] = 0.0;
            let (ways, _) = search(costmap, start_cell, None);
            for cell in ways.order.iter().map(|cell| *cell as usize) {
                let Some(parent) = ways.find_parent(cell) else { continue };
                let step = (grid.center_of(cell) - grid.center_of(parent)).norm();
                length_m[cell] = length_m[parent] + step as f32;
                parents[cell] = parent as u32;
            }
        }
        Self { grid, start: *start, length_m, parents }
    }

    /// Where it starts.
    pub fn start(&self) -> &Point2<f64> {
        &self.start
    }

    /// Length in metres of the cheapest way to a cell (before it is pulled straight); `None` when there is none.
    pub fn find_length_m(&self, cell: usize) -> Option<f64> {
        let length = *self.length_m.get(cell)?;
        length.is_finite().then_some(f64::from(length))
    }

    /// The same for a point.
    pub fn find_length_to_m(&self, point: &Point2<f64>) -> Option<f64> {
        self.find_length_m(self.grid.find_cell(point)?)
    }

    /// The path to a point, pulled straight; `None` when there is no way. `costmap` must be the one of the field.
    pub fn find_path(&self, costmap: &Costmap, goal: &Point2<f64>) -> Option<Path> {
        let goal_cell = self.grid.find_cell(goal)?;
        self.find_length_m(goal_cell)?;
        let mut cells = vec![goal_cell as u32];
        let mut cell = goal_cell;
        while self.parents[cell] != NO_PARENT {
            cell = self.parents[cell] as usize;
            cells.push(cell as u32);
        }
        cells.reverse();
        Some(pull_straight(costmap, &cells, &self.start, goal))
    }
}

/// Drops corners as long as the straight leg stays on traversable cells and costs at most what the cells cost.
fn pull_straight(costmap: &Costmap, cells: &[u32], start: &Point2<f64>, goal: &Point2<f64>) -> Path {
    const TOLERANCE: f64 = 1.02;
    let grid = costmap.grid();
    let mut way: Vec<Point2<f64>> = cells.iter().map(|&cell| grid.center_of(cell as usize)).collect();
    if let Some(first) = way.first_mut() {
        *first = *start;
    }
    match way.len() {
        0 | 1 => way.push(*goal),
        n => way[n - 1] = *goal,
    }
    let leg_cost = |i: usize| {
        let cost = costmap.find_segment_cost(&way[i], &way[i + 1]);
        cost.unwrap_or_else(|| 100.0 * (way[i + 1] - way[i]).norm())
    };
    let mut points = vec![way[0]];
    let mut anchor = 0;
    while anchor + 1 < way.len() {
        let mut end = anchor + 1;
        let mut along = leg_cost(anchor);
        while end + 1 < way.len() {
            along += leg_cost(end);
            match costmap.find_segment_cost(&way[anchor], &way[end + 1]) {
                Some(straight) if straight <= along * TOLERANCE => end += 1,
                _ => break,
            }
        }
        points.push(way[end]);
        anchor = end;
    }
    Path::from_points(points)
}

#[cfg(test)]
mod tests {
    //! Contract: a path runs on traversable cells only and is about as short as geometry allows; a base that stands in
    //! an inflated or unknown cell gets out; the field agrees with the single search.
    use super::*;
    use crate::nav::CostmapConfig;
    use crate::nav::sight::tests::room_grid;
    use dsm::map::CellState;

    fn costmap() -> Costmap {
        Costmap::from_free_space(&room_grid(), &CostmapConfig::default())
    }

    fn stays_on_floor(costmap: &Costmap, path: &Path) {
        for leg in path.points.windows(2) {
            assert!(costmap.find_segment_cost(&leg[0], &leg[1]).is_some(), "leg {leg:?} leaves the floor");
        }
    }

    #[test]
    fn passes_a_narrow_door() {
        let costmap = costmap();
        let (start, goal) = (Point2::new(1.0, 1.0), Point2::new(7.0, 3.5));
        let path = find_path(&costmap, &start, &goal).unwrap();
        stays_on_floor(&costmap, &path);
        assert_eq!((path.points[0], path.points[path.points.len() - 1]), (start, goal));
        // Through the middle of the door at (4, 2): never shorter than the straight legs over it.
        let shortest = (Point2::new(4.0, 2.0) - start).norm() + (goal - Point2::new(4.0, 2.0)).norm();
        assert!(path.length_m < 1.12 * shortest, "{} against {shortest}", path.length_m);
        assert!(path.points.len() < 25, "{} corners", path.points.len());
    }

    #[test]
    fn the_field_agrees_with_the_search() {
        let costmap = costmap();
        let start = Point2::new(1.0, 1.0);
        let field = Field::from_start(&costmap, &start);
        for goal in [Point2::new(7.0, 3.5), Point2::new(2.0, 3.0), Point2::new(5.0, 0.6)] {
            let single = find_path(&costmap, &start, &goal).unwrap();
            let from_field = field.find_path(&costmap, &goal).unwrap();
            assert!((single.length_m - from_field.length_m).abs() < 0.15);
            stays_on_floor(&costmap, &from_field);
            assert!(field.find_length_to_m(&goal).unwrap() >= from_field.length_m - 0.1);
        }
    }

    #[test]
    fn says_why_there_is_none() {
        let costmap = costmap();
        let start = Point2::new(1.0, 1.0);
        assert_eq!(find_path(&costmap, &start, &Point2::new(90.0, 0.0)), Err(PlanFailure::GoalOutside));
        assert_eq!(find_path(&costmap, &Point2::new(90.0, 0.0), &start), Err(PlanFailure::StartOutside));
        let blocked = find_path(&costmap, &start, &Point2::new(0.1, 0.1));
        assert!(matches!(blocked, Err(PlanFailure::GoalBlocked { clearance_m }) if clearance_m < 0.2), "{blocked:?}");
        let mut closed = room_grid();
        for row in 30..50 {
            closed.set([80, row], CellState::Occupied);
        }
        let closed = Costmap::from_free_space(&closed, &CostmapConfig::default());
        assert_eq!(find_path(&closed, &start, &Point2::new(7.0, 3.5)), Err(PlanFailure::NoWay));
    }

    #[test]
    fn leaves_a_nook_that_noise_has_narrowed() {
        // The nook begins at x = 7 m; its mouth is 0.6 m wide where 0.65 m are needed, then 0.5 m.
        let nook = |wide: i32| {
            let mut grid = room_grid();
            for row in (0..80).filter(|row| !(40..40 + wide).contains(row)) {
                grid.set([140, row], CellState::Occupied);
            }
            for row in (0..80).filter(|row| !(30..60).contains(row)) {
                (140..160).for_each(|column| grid.set([column, row], CellState::Occupied));
            }
            Costmap::from_free_space(&grid, &CostmapConfig::default())
        };
        let (inside, outside) = (Point2::new(7.45, 2.25), Point2::new(5.0, 2.0));
        assert!(find_path(&nook(12), &inside, &outside).is_ok(), "what came in gets out");
        assert_eq!(find_path(&nook(12), &outside, &inside), Err(PlanFailure::NoWay), "the margin holds for others");
        assert_eq!(find_path(&nook(10), &inside, &outside), Err(PlanFailure::NoWay), "narrower than the base");
    }

    #[test]
    fn escapes_from_where_it_stands() {
        let mut grid = room_grid();
        // The blind zone around the robot was never seen, and one wall is nearer than the margin.
        for column in 2..12 {
            for row in 2..12 {
                grid.set([column, row], CellState::Unknown);
            }
        }
        let costmap = Costmap::from_free_space(&grid, &CostmapConfig::default());
        let start = Point2::new(0.26, 0.31);
        let path = find_path(&costmap, &start, &Point2::new(2.0, 2.0)).unwrap();
        let mut driven_on_floor = false;
        for leg in path.points.windows(2) {
            let on_floor = costmap.is_traversable_at(&leg[1]);
            assert!(on_floor || !driven_on_floor, "never back into cells that are not floor");
            driven_on_floor |= on_floor;
        }
        assert!(path.points.iter().all(|p| costmap.state_at(p) != CellState::Occupied));
    }
}
