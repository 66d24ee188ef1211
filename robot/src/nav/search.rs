//! Cheapest ways over the cells of a costmap: A* to one goal, or Dijkstra to all cells.
//!
//! Costs are whole numbers (tenths of a cell times the weight of the entered cell) and estimates never fall along a way,
//! so a radix heap does: a queue whose least key only grows, with one bucket for each bit in which a key differs from the
//! last one taken.

use super::costmap::{Costmap, OPEN_WEIGHT};
use super::grid::NEIGHBOURS;

/// How a cell was reached: the neighbour's number plus one, or one of these.
const UNREACHED: u8 = 0;
const START: u8 = 0x7f;
/// Set when the way to the cell is known to be the cheapest.
const CLOSED: u8 = 0x80;

/// A queue of cells for keys that only grow.
struct RadixHeap {
    last: u32,
    buckets: [Vec<(u32, u32)>; 33],
    occupied: u64,
}

impl RadixHeap {
    fn new() -> Self {
        Self { last: 0, buckets: [const { Vec::new() }; 33], occupied: 0 }
    }

    fn bucket(&self, key: u32) -> usize {
        (32 - (key ^ self.last).leading_zeros()) as usize
    }

    /// `key` is at least that of the last cell taken.
    fn push(&mut self, key: u32, cell: u32) {
        let bucket = self.bucket(key);
        self.buckets[bucket].push((key, cell));
        self.occupied |= 1 << bucket;
    }

    /// The cell with the least key; of equal keys the one pushed last.
    fn pop(&mut self) -> Option<(u32, u32)> {
        if self.buckets[0].is_empty() {
            self.occupied &= !1;
            if self.occupied == 0 {
                return None;
            }
            let bucket = self.occupied.trailing_zeros() as usize;
            self.occupied &= !(1 << bucket);
            let mut entries = std::mem::take(&mut self.buckets[bucket]);
            self.last = entries.iter().map(|(key, _)| *key).min()?;
            for (key, cell) in entries.drain(..) {
                self.push(key, cell);
            }
            // Keeps its memory.
            self.buckets[bucket] = entries;
        }
        self.buckets[0].pop()
    }
}

/// The ways that a search found.
pub(super) struct Ways {
    columns: usize,
    from: Vec<u8>,
    /// Cells in the order in which their way became final, the start first.
    pub(super) order: Vec<u32>,
    #[cfg(test)]
    costs: Vec<u32>,
}

impl Ways {
    /// The cell before `cell`; `None` at the start and where no way leads.
    pub(super) fn find_parent(&self, cell: usize) -> Option<usize> {
        let number = self.from[cell] & !CLOSED;
        if number == UNREACHED || number == START {
            return None;
        }
        let (dx, dy, _) = NEIGHBOURS[usize::from(number) - 1];
        Some((cell as i64 - i64::from(dx) - i64::from(dy) * self.columns as i64) as usize)
    }
}

/// Searches from `start` to `goal`, or to every cell when there is none, and tells whether it arrived. `order` is empty
/// for a search with a goal.
pub(super) fn search(costmap: &Costmap, start: usize, goal: Option<usize>) -> (Ways, bool) {
    let grid = *costmap.grid();
    let (columns, rows) = (grid.columns as i32, grid.rows as i32);
    let target = goal.map(|goal| grid.position(goal));
    let at_least = |column: i32, row: i32| match target {
        None => 0,
        Some((goal_column, goal_row)) => {
            let (dx, dy) = (column.abs_diff(goal_column), row.abs_diff(goal_row));
            (10 * dx.max(dy) + 4 * dx.min(dy)) * u32::from(OPEN_WEIGHT)
        }
    };
    let locked_in = costmap.is_locked_in(start);
    let offsets: [i32; 8] = std::array::from_fn(|k| NEIGHBOURS[k].0 + NEIGHBOURS[k].1 * columns);
    let mut from = vec![UNREACHED; grid.len()];
    let mut cost_of = vec![0_u32; grid.len()];
    let mut order = Vec::new();
    let mut queue = RadixHeap::new();
    let (column, row) = grid.position(start);
    from[start] = START;
    queue.push(at_least(column, row), start as u32);
    let mut arrived = false;
    while let Some((_, cell)) = queue.pop() {
        let cell = cell as usize;
        // A cheaper way came in between and was taken.
        if from[cell] & CLOSED != 0 {
            continue;
        }
        from[cell] |= CLOSED;
        let cost = cost_of[cell];
        if goal.is_none() {
            order.push(cell as u32);
        }
        if goal == Some(cell) {
            arrived = true;
            break;
        }
        let (column, row) = grid.position(cell);
        let inner = column > 0 && row > 0 && column + 1 < columns && row + 1 < rows;
        for (k, (dx, dy, length)) in NEIGHBOURS.iter().enumerate() {
            let (next_column, next_row) = (column + dx, row + dy);
            let inside = inner || next_column >= 0 && next_row >= 0 && next_column < columns && next_row < rows;
            if !inside {
                continue;
            }
            let next = (cell as i32 + offsets[k]) as usize;
            let known = from[next];
            if known & CLOSED != 0 {
                continue;
            }
            let Some(weight) = costmap.find_step_weight(start, locked_in, cell, next) else { continue };
            let through = cost + length * weight;
            if known == UNREACHED || through < cost_of[next] {
                from[next] = k as u8 + 1;
                cost_of[next] = through;
                queue.push(through + at_least(next_column, next_row), next as u32);
            }
        }
    }
    let ways = Ways {
        columns: grid.columns,
        from,
        order,
        #[cfg(test)]
        costs: cost_of,
    };
    (ways, arrived)
}

#[cfg(test)]
mod tests {
    //! Contract: the way found costs what a plain search without estimate and queue tricks finds, on any grid.
    use super::*;
    use crate::nav::CostmapConfig;
    use dsm::map::{CellState, FreeSpace};
    use proptest::prelude::*;
    use std::cmp::Reverse;
    use std::collections::BinaryHeap;

    fn plain_cost(costmap: &Costmap, start: usize, goal: usize) -> Option<u32> {
        let locked_in = costmap.is_locked_in(start);
        let mut costs = vec![u32::MAX; costmap.grid().len()];
        let mut queue = BinaryHeap::from([Reverse((0, start))]);
        costs[start] = 0;
        while let Some(Reverse((cost, cell))) = queue.pop() {
            if cell == goal {
                return Some(cost);
            }
            for (next, length) in costmap.grid().neighbours(cell) {
                let Some(weight) = costmap.find_step_weight(start, locked_in, cell, next) else { continue };
                if cost + length * weight < costs[next] {
                    costs[next] = cost + length * weight;
                    queue.push(Reverse((costs[next], next)));
                }
            }
        }
        None
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn the_cost_is_the_least(
            blocked in prop::collection::vec(prop::bool::weighted(0.12), 40 * 30), start in 0..1200_usize, goal in 0..1200_usize,
        ) {
            let mut floor = FreeSpace::new(0.25);
            for column in 0..40 {
                for row in 0..30 {
                    let state = if blocked[column * 30 + row] { CellState::Occupied } else { CellState::Free };
                    floor.set([column as i32, row as i32], state);
                }
            }
            let config = CostmapConfig { footprint_radius_m: 0.05, margin_m: 0.0, ..CostmapConfig::default() };
            let costmap = Costmap::from_free_space(&floor, &config);
            let (ways, arrived) = search(&costmap, start, Some(goal));
            let least = plain_cost(&costmap, start, goal);
            prop_assert_eq!(arrived.then(|| ways.costs[goal]), least);
            // The way holds together: walked back, its steps cost as much.
            if arrived {
                let (mut cell, mut walked) = (goal, 0);
                while let Some(parent) = ways.find_parent(cell) {
                    let step = costmap.grid().neighbours(parent).find(|(next, _)| *next == cell);
                    let weight = costmap.find_step_weight(start, costmap.is_locked_in(start), parent, cell);
                    walked += step.expect("neighbours").1 * weight.expect("open");
                    cell = parent;
                }
                prop_assert_eq!((cell, Some(walked)), (start, least));
            }
            let (all, _) = search(&costmap, start, None);
            prop_assert_eq!(all.order.contains(&(goal as u32)).then(|| all.costs[goal]), least);
        }
    }
}
