//! Looking at furniture from near: frontiers of the floor do not make sure that shelves and tables were looked at.

use super::costmap::Costmap;
use super::grid::wrap_angle;
use super::planner::{Field, Pose2};
use dsm::Pose;
use dsm::map::{CellState, Map, MapObject};
use nalgebra::{Point2, Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Parameters of [`CoverageGrid`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CoverageConfig {
    /// Farthest distance that counts as near, metres. Default 2.2, range 0.5 to 6.
    #[schemars(range(min = 0.5, max = 6.0))]
    pub close_m: f64,
    /// Nearest distance at which the camera sees the top of furniture, metres. Default 0.5, range 0 to `close_m`.
    #[schemars(range(min = 0.0))]
    pub near_m: f64,
    /// Horizontal field of view of the camera, radians. Default 1.2, range 0.2 to 3.
    #[schemars(range(min = 0.2, max = 3.0))]
    pub field_of_view_rad: f64,
    /// Least length of unseen outline that is worth a stop, metres. Default 0.3, range 0.05 to 10.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub min_gain_m: f64,
    /// Distance between the places that are considered, metres. Default 0.35, range 0.1 to 2.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub spacing_m: f64,
    /// What a stop costs beside the way, metres of way. Default 1.5, range 0.1 to 50.
    #[schemars(range(min = 0.1, max = 50.0))]
    pub base_cost_m: f64,
    /// Smallest footprint of an object that can carry others, square metres. Default 0.1, range 0 to 4.
    #[schemars(range(min = 0.0, max = 4.0))]
    pub min_footprint_m2: f64,
}

impl Default for CoverageConfig {
    fn default() -> Self {
        Self {
            close_m: 2.2,
            near_m: 0.5,
            field_of_view_rad: 1.2,
            min_gain_m: 0.3,
            spacing_m: 0.35,
            base_cost_m: 1.5,
            min_footprint_m2: 0.1,
        }
    }
}

/// A place from which furniture is to be looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// Where to stand and where to look.
    pub stand: Pose2,
    /// Length of unseen outline in view, metres.
    pub gain_m: f64,
    /// Way to go, metres.
    pub path_length_m: f64,
    /// Gain per metre of way (with the cost of a stop); higher is better.
    pub score: f64,
    cells: Vec<[i32; 2]>,
}

/// Remembers which cells of the outlines of furniture the camera saw from near.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoverageGrid {
    seen: BTreeSet<[i32; 2]>,
}

impl CoverageGrid {
    /// Notes what a camera at `world_from_camera` (optical frame) sees from near.
    pub fn observe(&mut self, costmap: &Costmap, world_from_camera: &Pose, config: &CoverageConfig) {
        const STEP_RAD: f64 = 0.012;
        let forward = world_from_camera.rotation * Vector3::z();
        let position = Point2::new(world_from_camera.translation.x, world_from_camera.translation.y);
        let yaw = forward.y.atan2(forward.x);
        let steps = (config.field_of_view_rad / STEP_RAD).ceil() as i32;
        for step in 0..=steps {
            let offset = (f64::from(step) / f64::from(steps.max(1)) - 0.5) * config.field_of_view_rad;
            if let Some((cell, distance)) = first_occupied(costmap, &position, yaw + offset, config.close_m)
                && distance >= config.near_m
            {
                self.seen.insert(key(costmap, cell));
            }
        }
    }

    /// Notes that a viewpoint was visited or cannot be reached: what it was for is not asked for again. This makes
    /// coverage end.
    pub fn settle(&mut self, viewpoint: &Viewpoint) {
        self.seen.extend(&viewpoint.cells);
    }

    /// Share of the outline of all furniture that was seen from near, 0 to 1; 1 when there is no furniture.
    pub fn share(&self, map: &Map, costmap: &Costmap, config: &CoverageConfig) -> f64 {
        let outline = find_outline(map, costmap, config);
        let seen = outline.iter().enumerate().filter(|(cell, on)| **on && self.seen.contains(&key(costmap, *cell)));
        let all = outline.iter().filter(|on| **on).count();
        if all == 0 { 1.0 } else { seen.count() as f64 / all as f64 }
    }

    /// Places from which furniture that was never seen from near would be, best first.
    pub fn find_viewpoints(
        &self,
        map: &Map,
        costmap: &Costmap,
        field: &Field,
        config: &CoverageConfig,
    ) -> Vec<Viewpoint> {
        let grid = costmap.grid();
        let mut wanted = find_outline(map, costmap, config);
        for (cell, on) in wanted.iter_mut().enumerate() {
            *on = *on && !self.seen.contains(&key(costmap, cell));
        }
        if !wanted.contains(&true) {
            return Vec::new();
        }
        let stride = (config.spacing_m / grid.resolution_m).round().max(1.0) as i32;
        let mut found: Vec<Viewpoint> = (0..grid.len())
            .filter(|&cell| {
                let (column, row) = grid.position(cell);
                let on_lattice = |value: i32, origin: i32| (value + origin).rem_euclid(stride) == 0;
                on_lattice(column, grid.origin_cell[0]) && on_lattice(row, grid.origin_cell[1])
            })
            .filter(|&cell| costmap.is_traversable(cell))
            .filter_map(|cell| {
                let path_length_m = field.find_length_m(cell)?;
                let position = grid.center_of(cell);
                let (yaw_rad, cells) = find_best_view(costmap, &wanted, &position, config)?;
                let gain_m = cells.len() as f64 * grid.resolution_m;
                let score = gain_m / (path_length_m + config.base_cost_m);
                let cells = cells.into_iter().map(|c| key(costmap, c)).collect();
                let stand = Pose2 { position, yaw_rad };
                (gain_m >= config.min_gain_m).then_some(Viewpoint { stand, gain_m, path_length_m, score, cells })
            })
            .collect();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        found
    }
}

/// The cell in whole cells from the world's origin: stays the same when the grid grows.
fn key(costmap: &Costmap, cell: usize) -> [i32; 2] {
    let (column, row) = costmap.grid().position(cell);
    [column + costmap.grid().origin_cell[0], row + costmap.grid().origin_cell[1]]
}

fn first_occupied(costmap: &Costmap, from: &Point2<f64>, yaw_rad: f64, range_m: f64) -> Option<(usize, f64)> {
    costmap.grid().ray(*from, yaw_rad, range_m).find(|(cell, _)| costmap.state(*cell) == CellState::Occupied)
}

/// Marks the occupied cells that belong to furniture and border free floor.
fn find_outline(map: &Map, costmap: &Costmap, config: &CoverageConfig) -> Vec<bool> {
    const MARGIN_M: f64 = 0.1;
    const LOWEST_TOP_M: f64 = 0.25;
    let grid = costmap.grid();
    let mut outline = vec![false; grid.len()];
    let is_furniture = |o: &&MapObject| {
        let aabb = o.bounds.aabb();
        o.bounds.size.x * o.bounds.size.y >= config.min_footprint_m2 && aabb.max.z > LOWEST_TOP_M
    };
    for object in map.stable_objects().filter(is_furniture) {
        let center = Point2::new(object.bounds.center.x, object.bounds.center.y);
        for cell in grid.cells_within(center, 0.5 * object.bounds.size.norm() + MARGIN_M) {
            let at = grid.center_of(cell);
            let inside = object.bounds.contains(&Point3::new(at.x, at.y, object.bounds.center.z), MARGIN_M);
            let occupied = costmap.state(cell) == CellState::Occupied;
            let borders_floor = || grid.neighbours(cell).any(|(n, _)| costmap.state(n) == CellState::Free);
            outline[cell] |= inside && occupied && borders_floor();
        }
    }
    outline
}

/// The heading at a place with the most wanted cells in view, and these cells.
fn find_best_view(
    costmap: &Costmap,
    wanted: &[bool],
    position: &Point2<f64>,
    config: &CoverageConfig,
) -> Option<(f64, Vec<usize>)> {
    const RAYS: u32 = 240;
    let mut hits: Vec<(f64, usize)> = Vec::new();
    for ray in 0..RAYS {
        let yaw = f64::from(ray) / f64::from(RAYS) * std::f64::consts::TAU;
        match first_occupied(costmap, position, yaw, config.close_m) {
            Some((cell, distance)) if wanted[cell] && distance >= config.near_m => hits.push((yaw, cell)),
            _ => {}
        }
    }
    let in_view = |yaw: f64| {
        let half = 0.45 * config.field_of_view_rad;
        let cells: BTreeSet<usize> =
            hits.iter().filter(|(at, _)| wrap_angle(at - yaw).abs() <= half).map(|(_, cell)| *cell).collect();
        cells
    };
    let mut best: Option<(f64, BTreeSet<usize>)> = None;
    // Views that begin at a hit suffice: any other one can be turned until it does.
    for (yaw, _) in hits.iter().step_by(3) {
        let yaw = yaw + 0.45 * config.field_of_view_rad;
        let cells = in_view(yaw);
        if best.as_ref().is_none_or(|(_, most)| cells.len() > most.len()) {
            best = Some((yaw, cells));
        }
    }
    let (_, cells) = best?;
    // Turn so that what is in view lies in the middle of it.
    let toward: nalgebra::Vector2<f64> =
        cells.iter().map(|&cell| (costmap.grid().center_of(cell) - position).normalize()).sum();
    Some((toward.y.atan2(toward.x), cells.into_iter().collect()))
}

#[cfg(test)]
mod tests {
    //! Contract: visiting the viewpoints shows nearly all furniture from near, in few stops, and ends.
    use super::*;
    use crate::nav::CostmapConfig;
    use crate::nav::sight::tests::{boxed, map_of, room_grid};
    use nalgebra::{Rotation3, UnitQuaternion};

    fn camera_at(stand: &Pose2) -> Pose {
        let optical_in_base = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
            0.0, 0.0, 1.0, //
            -1.0, 0.0, 0.0, //
            0.0, -1.0, 0.0,
        ));
        let mut pose = stand.to_pose();
        pose.translation.z = 1.25;
        pose.rotation *= UnitQuaternion::from_rotation_matrix(&optical_in_base);
        pose
    }

    #[test]
    fn all_furniture_is_seen_from_near() {
        let map = map_of(
            room_grid(),
            vec![
                boxed(1, [2.0, 3.0, 0.35], [1.0, 0.6, 0.7], &[5]),
                boxed(2, [7.7, 2.0, 0.9], [0.4, 1.0, 1.8], &[0]),
                boxed(3, [5.5, 0.3, 0.4], [1.2, 0.4, 0.8], &[5]),
                boxed(4, [1.0, 1.0, 0.1], [0.2, 0.2, 0.2], &[5]),
            ],
        );
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let config = CoverageConfig::default();
        let mut coverage = CoverageGrid::default();
        let mut position = Point2::new(1.0, 2.0);
        let mut stops = 0;
        assert_eq!(coverage.share(&map, &costmap, &config), 0.0);
        loop {
            let field = Field::from_start(&costmap, &position);
            let Some(best) = coverage.find_viewpoints(&map, &costmap, &field, &config).into_iter().next() else {
                break;
            };
            let before = coverage.share(&map, &costmap, &config);
            coverage.observe(&costmap, &camera_at(&best.stand), &config);
            assert!(coverage.share(&map, &costmap, &config) > before, "a stop must show something new");
            coverage.settle(&best);
            position = best.stand.position;
            stops += 1;
            assert!(stops < 20);
        }
        let share = coverage.share(&map, &costmap, &config);
        // The sides and backs next to a wall stay out of sight.
        assert!(share > 0.75, "{share} after {stops} stops");
        assert!(stops <= 9, "{stops} stops");
    }

    #[test]
    fn nothing_is_seen_through_walls_or_from_afar() {
        let map = map_of(room_grid(), vec![boxed(2, [7.7, 2.0, 0.9], [0.4, 1.0, 1.8], &[0])]);
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let config = CoverageConfig::default();
        let mut coverage = CoverageGrid::default();
        for x in [3.0, 4.5, 5.0] {
            let stand = Pose2 { position: Point2::new(x, 2.0), yaw_rad: 0.0 };
            coverage.observe(&costmap, &camera_at(&stand), &config);
        }
        assert_eq!(coverage.share(&map, &costmap, &config), 0.0);
        let stand = Pose2 { position: Point2::new(6.0, 2.0), yaw_rad: 0.0 };
        coverage.observe(&costmap, &camera_at(&stand), &config);
        // The whole front and nothing else.
        let share = coverage.share(&map, &costmap, &config);
        assert!(share > 0.3 && share < 0.7, "{share}");
    }
}
