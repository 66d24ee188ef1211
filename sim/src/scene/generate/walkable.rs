//! Where a robot can go in a room: a grid of its floor, flooded from the doorways.

use super::draft::Rect;

/// Side of a cell, metres.
const CELL_M: f64 = 0.05;

/// The cells of a room that a disc can stand on and reach from its first gate.
pub(super) struct Walkable {
    origin: [f64; 2],
    cells: [usize; 2],
    reached: Vec<bool>,
    /// How many cells are free, reached or not.
    free: usize,
}

impl Walkable {
    /// The cells that a disc of `radius_m` can stand on between walls and obstacles, reachable or not.
    pub(super) fn all_free(room: &Rect, obstacles: &[Rect], radius_m: f64) -> Self {
        let cells = room.size().map(|s| (s / CELL_M).floor() as usize);
        let mut free = Self { origin: room.min, cells, reached: vec![false; cells[0] * cells[1]], free: 0 };
        let inner = room.grown(-radius_m);
        for cell in 0..free.reached.len() {
            let at = free.center(cell);
            let inside = (0..2).all(|i| inner.min[i] <= at[i] && at[i] <= inner.max[i]);
            free.reached[cell] = inside && obstacles.iter().all(|rect| rect.distance_m(at) >= radius_m);
            free.free += usize::from(free.reached[cell]);
        }
        free
    }

    /// Floods those cells from the first gate, or from the first of them when there is no gate.
    pub(super) fn flood(room: &Rect, obstacles: &[Rect], radius_m: f64, gates: &[[f64; 2]]) -> Self {
        let free = Self::all_free(room, obstacles, radius_m);
        let [columns, rows] = free.cells;
        let first = match gates.first() {
            Some(gate) => free.cell(*gate),
            None => free.reached.iter().position(|f| *f),
        };
        let mut walkable = Self { reached: vec![false; free.reached.len()], ..free };
        let mut open: Vec<usize> = first.into_iter().collect();
        while let Some(cell) = open.pop() {
            if !free.reached[cell] || std::mem::replace(&mut walkable.reached[cell], true) {
                continue;
            }
            let (x, y) = (cell % columns, cell / columns);
            let beside = [(x > 0, cell.wrapping_sub(1)), (x + 1 < columns, cell + 1)];
            let across = [(y > 0, cell.wrapping_sub(columns)), (y + 1 < rows, cell + columns)];
            open.extend(beside.into_iter().chain(across).filter(|(inside, _)| *inside).map(|(_, next)| next));
        }
        walkable
    }

    fn center(&self, cell: usize) -> [f64; 2] {
        let (x, y) = (cell % self.cells[0], cell / self.cells[0]);
        [self.origin[0] + CELL_M * (x as f64 + 0.5), self.origin[1] + CELL_M * (y as f64 + 0.5)]
    }

    fn cell(&self, at: [f64; 2]) -> Option<usize> {
        let index = |i: usize| {
            let steps = ((at[i] - self.origin[i]) / CELL_M).floor();
            (steps >= 0.0 && steps < self.cells[i] as f64).then_some(steps as usize)
        };
        Some(index(1)? * self.cells[0] + index(0)?)
    }

    /// Whether the disc gets there.
    pub(super) fn reaches(&self, at: [f64; 2]) -> bool {
        self.cell(at).is_some_and(|cell| self.reached[cell])
    }

    /// Share of the free cells that are reached.
    pub(super) fn reached_share(&self) -> f64 {
        self.reached.iter().filter(|reached| **reached).count() as f64 / self.free.max(1) as f64
    }

    /// The reached place farthest from walls and obstacles, and that distance.
    pub(super) fn find_widest(&self, room: &Rect, obstacles: &[Rect]) -> Option<([f64; 2], f64)> {
        let mut best: Option<([f64; 2], f64)> = None;
        for cell in (0..self.reached.len()).filter(|cell| self.reached[*cell]) {
            let at = self.center(cell);
            let to_walls = (0..2).map(|i| (at[i] - room.min[i]).min(room.max[i] - at[i])).fold(f64::INFINITY, f64::min);
            let clear = obstacles.iter().map(|rect| rect.distance_m(at)).fold(to_walls, f64::min);
            if best.is_none_or(|(_, known)| clear > known + 1e-9) {
                best = Some((at, clear));
            }
        }
        best
    }
}
