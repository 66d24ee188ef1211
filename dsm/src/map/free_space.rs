//! Where the robot can be: a 2D grid over the floor.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// Unknown cells kept around every cell that was set.
const MARGIN_CELLS: i32 = 24;

/// What is known of one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[repr(u8)]
pub enum CellState {
    /// Never observed.
    #[default]
    Unknown,
    /// Observed floor with nothing above it up to the robot's height.
    Free,
    /// Something stands there.
    Occupied,
}

/// A rectangular grid aligned with the world axes that grows on demand. Cell (column, row) covers
/// `[origin + cell * resolution, origin + (cell + 1) * resolution)`; columns run along x, rows along y.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeSpace {
    /// Side of a cell in metres.
    pub resolution_m: f64,
    /// Lower corner of cell (0, 0) in whole cells from the world's origin.
    pub origin_cell: [i32; 2],
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// Row-major states.
    pub cells: Vec<CellState>,
}

impl FreeSpace {
    /// An empty grid.
    pub fn new(resolution_m: f64) -> Self {
        Self { resolution_m, origin_cell: [0, 0], columns: 0, rows: 0, cells: Vec::new() }
    }

    /// The cell, in whole cells from the world's origin, that holds the point.
    pub fn cell_at(&self, point: &Point2<f64>) -> [i32; 2] {
        [(point.x / self.resolution_m).floor() as i32, (point.y / self.resolution_m).floor() as i32]
    }

    /// Centre of a cell given in whole cells from the world's origin.
    pub fn center_of(&self, cell: [i32; 2]) -> Point2<f64> {
        Point2::new((f64::from(cell[0]) + 0.5) * self.resolution_m, (f64::from(cell[1]) + 0.5) * self.resolution_m)
    }

    fn find_index(&self, cell: [i32; 2]) -> Option<usize> {
        let column = usize::try_from(cell[0] - self.origin_cell[0]).ok()?;
        let row = usize::try_from(cell[1] - self.origin_cell[1]).ok()?;
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }

    /// State of a cell; unknown outside the grid.
    pub fn state(&self, cell: [i32; 2]) -> CellState {
        self.find_index(cell).map_or(CellState::Unknown, |i| self.cells[i])
    }

    /// State at a point.
    pub fn state_at(&self, point: &Point2<f64>) -> CellState {
        self.state(self.cell_at(point))
    }

    /// Sets a cell and grows the grid when needed (in steps of 64 cells), so that unknown cells surround what is known:
    /// whoever looks for the unknown finds it inside the grid.
    pub fn set(&mut self, cell: [i32; 2], state: CellState) {
        for corner in [cell.map(|c| c - MARGIN_CELLS), cell.map(|c| c + MARGIN_CELLS)] {
            if self.find_index(corner).is_none() {
                self.grow_to(corner);
            }
        }
        if let Some(i) = self.find_index(cell) {
            self.cells[i] = state;
        }
    }

    fn grow_to(&mut self, cell: [i32; 2]) {
        const STEP: i32 = 64;
        let low = cell.map(|c| c.div_euclid(STEP) * STEP);
        let high = low.map(|c| c + STEP);
        let (new_low, new_high) = if self.cells.is_empty() {
            (low, high)
        } else {
            let end = [self.origin_cell[0] + self.columns as i32, self.origin_cell[1] + self.rows as i32];
            (
                [low[0].min(self.origin_cell[0]), low[1].min(self.origin_cell[1])],
                [high[0].max(end[0]), high[1].max(end[1])],
            )
        };
        let columns = (new_high[0] - new_low[0]) as usize;
        let rows = (new_high[1] - new_low[1]) as usize;
        let mut cells = vec![CellState::Unknown; columns * rows];
        let shift = [(self.origin_cell[0] - new_low[0]) as usize, (self.origin_cell[1] - new_low[1]) as usize];
        for row in 0..self.rows {
            let from = row * self.columns;
            let to = (row + shift[1]) * columns + shift[0];
            cells[to..to + self.columns].copy_from_slice(&self.cells[from..from + self.columns]);
        }
        *self = Self { resolution_m: self.resolution_m, origin_cell: new_low, columns, rows, cells };
    }

    /// All known cells with their states, in row-major order.
    pub fn known_cells(&self) -> impl Iterator<Item = ([i32; 2], CellState)> + '_ {
        self.cells.iter().enumerate().filter(|(_, state)| **state != CellState::Unknown).map(|(i, &state)| {
            let cell =
                [self.origin_cell[0] + (i % self.columns) as i32, self.origin_cell[1] + (i / self.columns) as i32];
            (cell, state)
        })
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a cell keeps its state while the grid grows in any direction.
    use super::*;

    #[test]
    fn growing_keeps_states() {
        let mut grid = FreeSpace::new(0.05);
        let cells = [[0, 0], [-1, -1], [200, 3], [-300, 70]];
        for (i, cell) in cells.into_iter().enumerate() {
            grid.set(cell, if i % 2 == 0 { CellState::Free } else { CellState::Occupied });
        }
        assert_eq!(cells.map(|c| grid.state(c) == CellState::Free), [true, false, true, false]);
        assert_eq!(grid.known_cells().count(), 4);
        assert_eq!(grid.cell_at(&grid.center_of([-300, 70])), [-300, 70]);
    }
}
