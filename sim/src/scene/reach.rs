//! Which rooms a robot gets into: the floor flooded from the start areas, for an upright cylinder.

use super::check::RobotSize;
use super::model::SceneModel;
use super::semantics::Semantics;
use crate::world::{Column, FLOOR_TOP_M, Solids, scene_bounds};
use nalgebra::Point2;

/// Side of a cell, metres.
const CELL_M: f64 = 0.05;
/// A room is reached when this share of its free floor is.
const REACHED_SHARE: f64 = 0.5;
/// Cells at most along one side: 200 m.
const MOST_CELLS: usize = 4000;

/// The floor as cells: where the robot's middle can be.
struct Floor {
    low: [f64; 2],
    cells: [usize; 2],
    free: Vec<bool>,
}

/// Rooms of the semantics that cannot be reached from the start areas (from any free place when there are none).
pub(super) fn find_unreachable_rooms(
    scene: &SceneModel,
    semantics: &Semantics,
    solids: &Solids,
    robot: RobotSize,
) -> Vec<String> {
    if semantics.rooms.is_empty() {
        return Vec::new();
    }
    let floor = Floor::new(scene, semantics, solids, robot);
    let mut starts: Vec<usize> = Vec::new();
    for area in &semantics.start.areas {
        let within = |center: Point2<f64>| {
            let half = |half: f64| half.max(CELL_M);
            (center.x - area.x_m).abs() <= half(area.half_x_m) && (center.y - area.y_m).abs() <= half(area.half_y_m)
        };
        starts.extend((0..floor.free.len()).filter(|cell| floor.free[*cell] && within(floor.center(*cell))));
    }
    if semantics.start.areas.is_empty() {
        let inside = |cell: &usize| floor.free[*cell] && semantics.find_room(floor.center(*cell)).is_some();
        starts.extend((0..floor.free.len()).find(inside));
    }
    let reached = floor.flood(starts);
    let unreachable = semantics.rooms.iter().filter(|room| {
        let inside = (0..floor.free.len()).filter(|cell| floor.free[*cell] && room.contains(floor.center(*cell)));
        let (all, got) = inside.fold((0, 0), |(all, got), cell| (all + 1, got + usize::from(reached[cell])));
        all == 0 || (got as f64) < REACHED_SHARE * f64::from(all)
    });
    unreachable.map(|room| room.name.clone()).collect()
}

impl Floor {
    fn new(scene: &SceneModel, semantics: &Semantics, solids: &Solids, robot: RobotSize) -> Self {
        let bounds = scene_bounds(scene, solids);
        let (mut low, mut high) = ([bounds.min.x, bounds.min.y], [bounds.max.x, bounds.max.y]);
        for [x, y] in semantics.rooms.iter().flat_map(|room| &room.polygon) {
            low = [low[0].min(*x), low[1].min(*y)];
            high = [high[0].max(*x), high[1].max(*y)];
        }
        let cells = [0, 1].map(|i| (((high[i] - low[i]) / CELL_M).ceil() as usize).clamp(1, MOST_CELLS));
        let mut floor = Self { low, cells, free: vec![true; cells[0] * cells[1]] };
        for solid in solids.iter().filter(|solid| !solid.is_plane) {
            let pose = &scene.bodies[solid.body].world_from_body;
            let around = solid.bounds(pose);
            if around.max.z <= FLOOR_TOP_M || around.min.z >= robot.height_m {
                continue;
            }
            let around = around.grown(robot.radius_m + CELL_M);
            for cell in floor.cells_between([around.min.x, around.min.y], [around.max.x, around.max.y]) {
                let center = floor.center(cell);
                let column = Column {
                    x_m: center.x,
                    y_m: center.y,
                    radius_m: robot.radius_m,
                    bottom_m: FLOOR_TOP_M,
                    top_m: robot.height_m,
                };
                if floor.free[cell] && solid.find_distance_to_column_m(pose, &column, 0.0).is_some() {
                    floor.free[cell] = false;
                }
            }
        }
        floor
    }

    fn center(&self, cell: usize) -> Point2<f64> {
        let at = |index: usize, axis: usize| self.low[axis] + CELL_M * (index as f64 + 0.5);
        Point2::new(at(cell % self.cells[0], 0), at(cell / self.cells[0], 1))
    }

    fn cells_between(&self, low: [f64; 2], high: [f64; 2]) -> Vec<usize> {
        let index = |value: f64, axis: usize| {
            let steps = ((value - self.low[axis]) / CELL_M).floor().max(0.0);
            (steps as usize).min(self.cells[axis] - 1)
        };
        let columns = index(low[0], 0)..=index(high[0], 0);
        (index(low[1], 1)..=index(high[1], 1))
            .flat_map(|row| columns.clone().map(move |column| row * self.cells[0] + column))
            .collect()
    }

    fn flood(&self, mut open: Vec<usize>) -> Vec<bool> {
        let mut reached = vec![false; self.free.len()];
        while let Some(cell) = open.pop() {
            if !self.free[cell] || std::mem::replace(&mut reached[cell], true) {
                continue;
            }
            let (column, row) = (cell % self.cells[0], cell / self.cells[0]);
            if column > 0 {
                open.push(cell - 1);
            }
            if column + 1 < self.cells[0] {
                open.push(cell + 1);
            }
            if row > 0 {
                open.push(cell - self.cells[0]);
            }
            if row + 1 < self.cells[1] {
                open.push(cell + self.cells[0]);
            }
        }
        reached
    }
}
