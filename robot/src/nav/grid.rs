//! Index arithmetic of a grid over the floor, and rays through it.

use dsm::map::FreeSpace;
use nalgebra::Point2;

/// The layout of a dense grid aligned with the world axes, laid over the same cells as a [`FreeSpace`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Side of a cell in metres.
    pub resolution_m: f64,
    /// Lower corner of cell (0, 0) in whole cells from the world's origin.
    pub origin_cell: [i32; 2],
    /// Number of columns, along x.
    pub columns: usize,
    /// Number of rows, along y.
    pub rows: usize,
}

/// Offsets and lengths (in tenths of a cell) of the eight neighbours: straight ones first.
pub(crate) const NEIGHBOURS: [(i32, i32, u32); 8] =
    [(1, 0, 10), (-1, 0, 10), (0, 1, 10), (0, -1, 10), (1, 1, 14), (1, -1, 14), (-1, 1, 14), (-1, -1, 14)];

impl Grid {
    /// The layout of `free_space`.
    pub fn of(free_space: &FreeSpace) -> Self {
        Self {
            resolution_m: free_space.resolution_m,
            origin_cell: free_space.origin_cell,
            columns: free_space.columns,
            rows: free_space.rows,
        }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Whether it has no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Column and row of an index.
    pub(crate) fn position(&self, index: usize) -> (i32, i32) {
        ((index % self.columns) as i32, (index / self.columns) as i32)
    }

    /// Index of a column and row.
    pub(crate) fn find_index(&self, column: i32, row: i32) -> Option<usize> {
        let inside = column >= 0 && row >= 0 && (column as usize) < self.columns && (row as usize) < self.rows;
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// The index of the cell that holds the point in the world frame; `None` outside the grid.
    pub fn find_cell(&self, point: &Point2<f64>) -> Option<usize> {
        let column = (point.x / self.resolution_m).floor() as i32 - self.origin_cell[0];
        let row = (point.y / self.resolution_m).floor() as i32 - self.origin_cell[1];
        self.find_index(column, row)
    }

    /// Centre of a cell in the world frame.
    pub fn center_of(&self, index: usize) -> Point2<f64> {
        let (column, row) = self.position(index);
        Point2::new(
            (f64::from(column + self.origin_cell[0]) + 0.5) * self.resolution_m,
            (f64::from(row + self.origin_cell[1]) + 0.5) * self.resolution_m,
        )
    }

    /// The neighbours of a cell that lie inside, with their distance in tenths of a cell.
    pub(crate) fn neighbours(&self, index: usize) -> impl Iterator<Item = (usize, u32)> + use<> {
        let grid = *self;
        let (column, row) = grid.position(index);
        NEIGHBOURS
            .into_iter()
            .filter_map(move |(dx, dy, length)| Some((grid.find_index(column + dx, row + dy)?, length)))
    }

    /// The four straight neighbours that lie inside.
    pub(crate) fn straight_neighbours(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        self.neighbours(index).filter(|(_, length)| *length == 10).map(|(i, _)| i)
    }

    /// Indices of the cells whose centre lies within `radius_m` of a point, in row-major order.
    pub(crate) fn cells_within(&self, point: Point2<f64>, radius_m: f64) -> impl Iterator<Item = usize> + use<> {
        let grid = *self;
        let low = |value: f64, origin: i32| ((value - radius_m) / grid.resolution_m).floor() as i32 - origin;
        let high = |value: f64, origin: i32| ((value + radius_m) / grid.resolution_m).floor() as i32 - origin;
        let columns =
            low(point.x, grid.origin_cell[0]).max(0)..=high(point.x, grid.origin_cell[0]).min(grid.columns as i32 - 1);
        let rows =
            low(point.y, grid.origin_cell[1]).max(0)..=high(point.y, grid.origin_cell[1]).min(grid.rows as i32 - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| (column, row)))
            .filter_map(move |(column, row)| grid.find_index(column, row))
            .filter(move |&i| (grid.center_of(i) - point).norm() <= radius_m)
    }

    /// The cells that a ray crosses, in order and without the cell it starts in, with the distance at which it enters
    /// each, up to `range_m` or the border of the grid (traversal of Amanatides and Woo).
    pub(crate) fn ray(&self, from: Point2<f64>, yaw_rad: f64, range_m: f64) -> Ray {
        let (sin, cos) = yaw_rad.sin_cos();
        let at = Point2::new(from.x / self.resolution_m, from.y / self.resolution_m);
        let axis = |position: f64, direction: f64| {
            let floor = position.floor();
            if direction > 0.0 {
                (1, (floor + 1.0 - position) / direction, 1.0 / direction)
            } else if direction < 0.0 {
                (-1, (floor - position) / direction, -1.0 / direction)
            } else {
                (0, f64::INFINITY, f64::INFINITY)
            }
        };
        let (step_x, next_x, every_x) = axis(at.x, cos);
        let (step_y, next_y, every_y) = axis(at.y, sin);
        Ray {
            grid: *self,
            column: at.x.floor() as i32 - self.origin_cell[0],
            row: at.y.floor() as i32 - self.origin_cell[1],
            step: [step_x, step_y],
            next: [next_x, next_y],
            every: [every_x, every_y],
            range_cells: range_m / self.resolution_m,
        }
    }
}

/// Iterator over the cells of a ray: (index, distance in metres at which the cell is entered).
pub(crate) struct Ray {
    grid: Grid,
    column: i32,
    row: i32,
    step: [i32; 2],
    next: [f64; 2],
    every: [f64; 2],
    range_cells: f64,
}

impl Iterator for Ray {
    type Item = (usize, f64);

    fn next(&mut self) -> Option<Self::Item> {
        let axis = usize::from(self.next[1] < self.next[0]);
        let entered = self.next[axis];
        if entered > self.range_cells {
            return None;
        }
        self.next[axis] += self.every[axis];
        if axis == 0 {
            self.column += self.step[0]
        } else {
            self.row += self.step[1]
        }
        Some((self.grid.find_index(self.column, self.row)?, entered * self.grid.resolution_m))
    }
}

/// The angle brought into (-pi, pi].
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let wrapped = angle_rad.rem_euclid(turn);
    if wrapped > 0.5 * turn { wrapped - turn } else { wrapped }
}

/// Direction from one point to another, radians.
pub(crate) fn bearing(from: &Point2<f64>, to: &Point2<f64>) -> f64 {
    (to.y - from.y).atan2(to.x - from.x)
}

#[cfg(test)]
mod tests {
    //! Contract: a cell's centre lies in the cell; a ray visits touching cells in order of distance, up to its range.
    use super::*;

    fn grid() -> Grid {
        Grid { resolution_m: 0.05, origin_cell: [-20, -10], columns: 60, rows: 40 }
    }

    #[test]
    fn centres_lie_in_their_cells() {
        let grid = grid();
        for index in [0, 59, 60, 1234, grid.len() - 1] {
            assert_eq!(grid.find_cell(&grid.center_of(index)), Some(index));
        }
        assert_eq!(grid.find_cell(&Point2::new(-1.01, 0.0)), None);
    }

    #[test]
    fn rays_visit_touching_cells_in_order() {
        let grid = grid();
        let from = Point2::new(0.51, 0.52);
        for step in 0..36 {
            let yaw = f64::from(step) * 0.1745;
            let mut last = (grid.find_cell(&from).unwrap(), 0.0);
            let mut count = 0;
            for (index, distance) in grid.ray(from, yaw, 0.4) {
                assert!(distance >= last.1 && distance <= 0.4);
                assert!(grid.straight_neighbours(last.0).any(|n| n == index), "cells must touch");
                let along = from + nalgebra::Vector2::new(yaw.cos(), yaw.sin()) * (distance + 1e-6);
                assert_eq!(grid.find_cell(&along), Some(index));
                last = (index, distance);
                count += 1;
            }
            assert!(count >= 8, "0.4 m are at least 8 cells, got {count}");
        }
    }

    #[test]
    fn angles_wrap() {
        assert!((wrap_angle(3.5) - (3.5 - std::f64::consts::TAU)).abs() < 1e-12);
        assert!((wrap_angle(-9.0) + 9.0 - std::f64::consts::TAU).abs() < 1e-12);
    }
}
