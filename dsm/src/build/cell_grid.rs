//! A grid of cells that grows on demand; cells are addressed as in [`crate::map::FreeSpace`].

/// Values of cells, `T::default()` where nothing was set.
#[derive(Clone, Debug, Default)]
pub(super) struct CellGrid<T> {
    origin: [i32; 2],
    columns: usize,
    rows: usize,
    cells: Vec<T>,
}

impl<T> CellGrid<T> {
    /// Cells that fit into the memory it holds.
    pub(super) fn capacity(&self) -> usize {
        self.cells.capacity()
    }
}

impl<T: Copy + Default> CellGrid<T> {
    /// A grid over the cells from `low` (inclusive) to `high` (exclusive).
    pub(super) fn covering(low: [i32; 2], high: [i32; 2]) -> Self {
        let side = |i: usize| usize::try_from(high[i] - low[i]).unwrap_or(0);
        Self { origin: low, columns: side(0), rows: side(1), cells: vec![T::default(); side(0) * side(1)] }
    }

    /// Lets a grid without values stand for the cells from `low` (inclusive) to `high` (exclusive), in the memory it has.
    pub(super) fn move_to(&mut self, low: [i32; 2], high: [i32; 2]) {
        let side = |i: usize| usize::try_from(high[i] - low[i]).unwrap_or(0);
        (self.origin, self.columns, self.rows) = (low, side(0), side(1));
        self.cells.resize(self.columns * self.rows, T::default());
    }

    /// Lowest cell and the one after the highest.
    pub(super) fn range(&self) -> ([i32; 2], [i32; 2]) {
        (self.origin, [self.origin[0] + self.columns as i32, self.origin[1] + self.rows as i32])
    }

    /// How many columns and rows.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.columns, self.rows)
    }

    /// Index into [`Self::values`]; `None` outside.
    pub(super) fn find_index(&self, cell: [i32; 2]) -> Option<usize> {
        let column = usize::try_from(cell[0] - self.origin[0]).ok()?;
        let row = usize::try_from(cell[1] - self.origin[1]).ok()?;
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }

    /// The cell of an index.
    pub(super) fn cell_of(&self, index: usize) -> [i32; 2] {
        [self.origin[0] + (index % self.columns) as i32, self.origin[1] + (index / self.columns) as i32]
    }

    pub(super) fn get(&self, cell: [i32; 2]) -> T {
        self.find_index(cell).map_or_else(T::default, |i| self.cells[i])
    }

    /// Row-major values.
    pub(super) fn values(&self) -> &[T] {
        &self.cells
    }

    pub(super) fn values_mut(&mut self) -> &mut [T] {
        &mut self.cells
    }

    /// Indices of the four neighbours inside the grid.
    pub(super) fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + use<T> {
        let (columns, rows) = (self.columns, self.rows);
        let (column, row) = (index % columns, index / columns);
        let left = (column > 0).then(|| index - 1);
        let right = (column + 1 < columns).then_some(index + 1);
        let down = (row > 0).then(|| index - columns);
        let up = (row + 1 < rows).then_some(index + columns);
        [left, right, down, up].into_iter().flatten()
    }

    /// The value for changing; the grid grows to hold the cell.
    pub(super) fn at_mut(&mut self, cell: [i32; 2]) -> &mut T {
        let index = match self.find_index(cell) {
            Some(index) => index,
            None => {
                self.grow_to(cell);
                (cell[1] - self.origin[1]) as usize * self.columns + (cell[0] - self.origin[0]) as usize
            }
        };
        &mut self.cells[index]
    }

    fn grow_to(&mut self, cell: [i32; 2]) {
        const STEP: i32 = 64;
        let low = cell.map(|c| c.div_euclid(STEP) * STEP);
        let high = low.map(|c| c + STEP);
        let (old_low, old_high) = if self.cells.is_empty() { (low, high) } else { self.range() };
        let mut grown = Self::covering(
            [low[0].min(old_low[0]), low[1].min(old_low[1])],
            [high[0].max(old_high[0]), high[1].max(old_high[1])],
        );
        for row in 0..self.rows {
            let from = row * self.columns;
            let shift = [(self.origin[0] - grown.origin[0]) as usize, (self.origin[1] - grown.origin[1]) as usize];
            let to = (row + shift[1]) * grown.columns + shift[0];
            grown.cells[to..to + self.columns].copy_from_slice(&self.cells[from..from + self.columns]);
        }
        *self = grown;
    }
}
