//! What it costs the base to stand in each cell.

use super::grid::Grid;
use dsm::map::{CellState, FreeSpace};
use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Whether the base may enter cells that were never observed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UnknownPolicy {
    /// Never: the default.
    #[default]
    Forbidden,
    /// Yes, at the highest cost of a free cell.
    Costly,
}

/// Parameters of [`Costmap`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CostmapConfig {
    /// Radius of the round footprint, metres. Default 0.27, range 0.05 to 1.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub footprint_radius_m: f64,
    /// Clearance beyond the footprint that is never given up, metres. Default 0.03, range 0 to 0.5. Half a cell is kept
    /// in addition, because an obstacle may begin at its cell's border.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub margin_m: f64,
    /// Width of the band beyond the margin in which the cost falls to that of open floor, metres. Default 0.35, range
    /// 0 to 2.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub inflation_m: f64,
    /// How many times dearer than open floor the edge of the lethal zone is, beyond the floor's own cost 1. Default 6,
    /// range 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub obstacle_weight: f64,
    /// Whether unknown cells may be entered. Default `forbidden`.
    pub unknown: UnknownPolicy,
    /// How far the base may drive through inflated or unknown cells to leave the place it stands in, metres. Default
    /// 0.8, range 0 to 3.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub escape_radius_m: f64,
}

impl Default for CostmapConfig {
    fn default() -> Self {
        Self {
            footprint_radius_m: 0.27,
            margin_m: 0.03,
            inflation_m: 0.35,
            obstacle_weight: 6.0,
            unknown: UnknownPolicy::Forbidden,
            escape_radius_m: 0.8,
        }
    }
}

/// Cost of each cell for the centre of the base. World frame, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Costmap {
    grid: Grid,
    states: Vec<CellState>,
    clearance_m: Vec<f32>,
    weights: Vec<u16>,
    lethal_m: f64,
    escape_radius_m: f64,
    footprint_radius_m: f64,
}

/// Weight of open floor; a weight of 0 marks a cell that the base must not enter.
pub(crate) const OPEN_WEIGHT: u16 = 10;
/// Weight of inflated or unknown cells while the base escapes from where it stands.
const ESCAPE_WEIGHT: u32 = 600;
/// Weight of occupied cells under the footprint while the base escapes.
const ESCAPE_OCCUPIED_WEIGHT: u32 = 6000;
/// Less floor than this for the middle of the base is a pocket, square metres: a nook in a bathroom, no room.
const POCKET_M2: f64 = 1.0;

impl Costmap {
    /// The costmap of a floor grid.
    pub fn from_free_space(free_space: &FreeSpace, config: &CostmapConfig) -> Self {
        let grid = Grid::of(free_space);
        let half_cell = 0.5 * grid.resolution_m;
        let clearance_m: Vec<f32> = squared_distance_to(&grid, |i| free_space.cells[i] == CellState::Occupied)
            .into_iter()
            .map(|squared| (squared.sqrt() * grid.resolution_m - half_cell).max(0.0) as f32)
            .collect();
        let lethal_m = config.footprint_radius_m + config.margin_m;
        let mut weights: Vec<u16> = clearance_m
            .iter()
            .zip(&free_space.cells)
            .map(|(&clearance, state)| weight(f64::from(clearance), *state, lethal_m, config))
            .collect();
        if config.unknown == UnknownPolicy::Forbidden {
            forbid_standing_on_unknown(&grid, &free_space.cells, config.footprint_radius_m, &mut weights);
        }
        Self {
            grid,
            states: free_space.cells.clone(),
            clearance_m,
            weights,
            lethal_m,
            escape_radius_m: config.escape_radius_m,
            footprint_radius_m: config.footprint_radius_m,
        }
    }

    /// Its layout.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// State of the cell with this index.
    pub fn state(&self, index: usize) -> CellState {
        self.states[index]
    }

    /// State at a point; unknown outside the grid.
    pub fn state_at(&self, point: &Point2<f64>) -> CellState {
        self.grid.find_cell(point).map_or(CellState::Unknown, |i| self.states[i])
    }

    /// Distance from a cell's centre to the border of the nearest occupied cell, metres; very large when there is none.
    pub fn clearance_m(&self, index: usize) -> f64 {
        f64::from(self.clearance_m[index])
    }

    /// The same at a point; 0 outside the grid.
    pub fn clearance_at_m(&self, point: &Point2<f64>) -> f64 {
        self.grid.find_cell(point).map_or(0.0, |i| self.clearance_m(i))
    }

    /// The clearance below which the base must not be, metres.
    pub fn lethal_m(&self) -> f64 {
        self.lethal_m
    }

    /// Radius of the footprint, metres.
    pub fn footprint_radius_m(&self) -> f64 {
        self.footprint_radius_m
    }

    /// Whether the base may stand with its centre in this cell.
    pub fn is_traversable(&self, index: usize) -> bool {
        self.weights[index] > 0
    }

    /// Whether the base may stand with its centre at the point.
    pub fn is_traversable_at(&self, point: &Point2<f64>) -> bool {
        self.grid.find_cell(point).is_some_and(|i| self.is_traversable(i))
    }

    /// Cost of a metre in this cell as a multiple of open floor; `None` where the base must not be.
    pub fn find_cost(&self, index: usize) -> Option<f64> {
        self.is_traversable(index).then(|| f64::from(self.weights[index]) / f64::from(OPEN_WEIGHT))
    }

    /// Cost in open-floor metres of driving straight from one point to another; `None` when a cell on the way is not
    /// traversable.
    pub fn find_segment_cost(&self, from: &Point2<f64>, to: &Point2<f64>) -> Option<f64> {
        let length = (to - from).norm();
        let steps = (length / (0.5 * self.grid.resolution_m)).ceil().max(1.0) as usize;
        let mut sum = 0.0;
        for step in 0..=steps {
            let point = from + (to - from) * (step as f64 / steps as f64);
            sum += self.find_cost(self.grid.find_cell(&point)?)?;
        }
        Some(sum / (steps + 1) as f64 * length)
    }

    /// The traversable cell centre nearest to a point within `radius_m`.
    pub fn find_nearest_traversable(&self, point: &Point2<f64>, radius_m: f64) -> Option<Point2<f64>> {
        self.grid
            .cells_within(*point, radius_m)
            .filter(|&i| self.is_traversable(i))
            .map(|i| self.grid.center_of(i))
            .min_by(|a, b| (a - point).norm_squared().total_cmp(&(b - point).norm_squared()))
    }

    /// Whether the floor that a base at `start` can drive on is a pocket. It came in by a way as wide as itself, which the
    /// map has narrowed since by less than the margin: noise at two corners does that.
    pub(crate) fn is_locked_in(&self, start: usize) -> bool {
        if self.weights[start] == 0 {
            return false;
        }
        let most = (POCKET_M2 / self.grid.resolution_m.powi(2)) as usize;
        let (mut seen, mut next) = (BTreeSet::from([start]), vec![start]);
        while let Some(cell) = next.pop() {
            let around = self.grid.neighbours(cell).filter(|(near, _)| self.weights[*near] > 0);
            next.extend(around.filter_map(|(near, _)| seen.insert(near).then_some(near)));
            if seen.len() > most {
                return false;
            }
        }
        true
    }

    /// The weight for entering `to` from `from` on a search that began in `start`. A base that stands in an inflated or
    /// unknown cell may drive through such cells close to where it stands, dearly, until it reaches floor that it may
    /// drive on; it never drives back into them. Cells under the footprint of the start cannot really be occupied, but
    /// are entered last. A base that is `locked_in` gives up the margin to get out.
    pub(crate) fn find_step_weight(&self, start: usize, locked_in: bool, from: usize, to: usize) -> Option<u32> {
        if self.weights[to] > 0 {
            return Some(u32::from(self.weights[to]));
        }
        // The margin alone: what lies over floor that was never seen stays forbidden.
        let narrow = self.footprint_radius_m..self.lethal_m;
        if locked_in && self.states[to] == CellState::Free && narrow.contains(&self.clearance_m(to)) {
            let distance = (self.grid.center_of(to) - self.grid.center_of(start)).norm();
            return (distance <= 2.0 * self.escape_radius_m).then_some(ESCAPE_WEIGHT);
        }
        if self.weights[from] > 0 || self.weights[start] > 0 {
            return None;
        }
        let distance = (self.grid.center_of(to) - self.grid.center_of(start)).norm();
        match self.states[to] {
            CellState::Occupied => (distance <= self.footprint_radius_m).then_some(ESCAPE_OCCUPIED_WEIGHT),
            CellState::Unknown => (distance <= self.escape_radius_m).then_some(2 * ESCAPE_WEIGHT),
            CellState::Free => {
                let lack = ((self.lethal_m - self.clearance_m(to)) / self.lethal_m).max(0.0);
                (distance <= self.escape_radius_m).then(|| ESCAPE_WEIGHT + (lack * f64::from(ESCAPE_WEIGHT)) as u32)
            }
        }
    }
}

fn weight(clearance_m: f64, state: CellState, lethal_m: f64, config: &CostmapConfig) -> u16 {
    let highest = f64::from(OPEN_WEIGHT) * (1.0 + config.obstacle_weight);
    match state {
        CellState::Occupied => 0,
        _ if clearance_m < lethal_m => 0,
        CellState::Unknown if config.unknown == UnknownPolicy::Forbidden => 0,
        CellState::Unknown => highest as u16,
        CellState::Free => {
            let into_band = 1.0 - (clearance_m - lethal_m) / config.inflation_m.max(1e-9);
            let near = into_band.max(0.0);
            (f64::from(OPEN_WEIGHT) * (1.0 + config.obstacle_weight * near * near)) as u16
        }
    }
}

/// The footprint must not stand over floor that was never seen: the near edge of a table may be there. Single unknown
/// cells are gaps between measured points and do not count.
fn forbid_standing_on_unknown(grid: &Grid, cells: &[CellState], footprint_radius_m: f64, weights: &mut [u16]) {
    /// Unknown cells among a cell and its eight neighbours that make it a place never seen.
    const SOLID: usize = 7;
    let is_unknown = |cell: usize| cells[cell] == CellState::Unknown;
    let never_seen =
        |cell: usize| is_unknown(cell) && 1 + grid.neighbours(cell).filter(|(n, _)| is_unknown(*n)).count() >= SOLID;
    let reach = (footprint_radius_m / grid.resolution_m).powi(2);
    for (weight, squared) in weights.iter_mut().zip(squared_distance_to(grid, never_seen)) {
        if squared < reach {
            *weight = 0;
        }
    }
}

/// Exact squared Euclidean distance in cells from each cell's centre to the nearest marked cell's centre
/// (Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions").
fn squared_distance_to(grid: &Grid, is_marked: impl Fn(usize) -> bool) -> Vec<f64> {
    const FAR: f64 = 1e8;
    let mut squared: Vec<f64> = (0..grid.len()).map(|cell| if is_marked(cell) { 0.0 } else { FAR }).collect();
    let mut line = vec![0.0; grid.columns.max(grid.rows)];
    let mut result = line.clone();
    for column in 0..grid.columns {
        for row in 0..grid.rows {
            line[row] = squared[row * grid.columns + column];
        }
        transform_line(&line[..grid.rows], &mut result[..grid.rows]);
        for row in 0..grid.rows {
            squared[row * grid.columns + column] = result[row];
        }
    }
    for row in squared.chunks_exact_mut(grid.columns.max(1)) {
        transform_line(row, &mut result[..grid.columns]);
        row.copy_from_slice(&result[..grid.columns]);
    }
    squared
}

/// Lower envelope of the parabolas rooted at each sample.
fn transform_line(samples: &[f64], result: &mut [f64]) {
    let n = samples.len();
    if n == 0 {
        return;
    }
    let mut roots = Vec::with_capacity(n);
    let mut borders = Vec::with_capacity(n + 1);
    roots.push(0_usize);
    borders.push(f64::NEG_INFINITY);
    let meet = |q: usize, r: usize| {
        let (qf, rf) = (q as f64, r as f64);
        ((samples[q] + qf * qf) - (samples[r] + rf * rf)) / (2.0 * (qf - rf))
    };
    for q in 1..n {
        let mut border = meet(q, roots[roots.len() - 1]);
        while roots.len() > 1 && border <= borders[borders.len() - 1] {
            roots.pop();
            borders.pop();
            border = meet(q, roots[roots.len() - 1]);
        }
        if border <= borders[borders.len() - 1] {
            roots[0] = q;
        } else {
            roots.push(q);
            borders.push(border);
        }
    }
    let mut k = 0;
    for (q, out) in result.iter_mut().enumerate() {
        while k + 1 < roots.len() && borders[k + 1] < q as f64 {
            k += 1;
        }
        let offset = q as f64 - roots[k] as f64;
        *out = offset * offset + samples[roots[k]];
    }
}

#[cfg(test)]
mod tests {
    //! Contract: clearance equals the brute-force distance; no traversable cell is nearer to an obstacle than the
    //! footprint and its margin; cost falls with clearance; unknown is closed unless asked.
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn random_grid(seed: u64) -> FreeSpace {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut free_space = FreeSpace::new(0.05);
        for column in 0..90 {
            for row in 0..50 {
                let state = match rng.random_range(0..200) {
                    0 => CellState::Occupied,
                    1..4 => CellState::Unknown,
                    _ => CellState::Free,
                };
                free_space.set([column - 30, row - 20], state);
            }
        }
        free_space
    }

    #[test]
    fn clearance_is_exact() {
        for seed in 0..3 {
            let free_space = random_grid(seed);
            let costmap = Costmap::from_free_space(&free_space, &CostmapConfig::default());
            let grid = *costmap.grid();
            let occupied: Vec<_> = (0..grid.len()).filter(|&i| costmap.state(i) == CellState::Occupied).collect();
            for index in (0..grid.len()).step_by(7) {
                let center = grid.center_of(index);
                let nearest =
                    occupied.iter().map(|&o| (grid.center_of(o) - center).norm()).fold(f64::INFINITY, f64::min);
                let expected = (nearest - 0.025).max(0.0);
                assert!((costmap.clearance_m(index) - expected).abs() < 1e-5, "cell {index}");
                if costmap.is_traversable(index) {
                    assert!(expected >= 0.28 - 1e-6);
                    assert_eq!(costmap.state(index), CellState::Free);
                }
            }
        }
    }

    #[test]
    fn cost_falls_with_clearance_and_unknown_opens_only_when_asked() {
        let free_space = random_grid(5);
        let costmap = Costmap::from_free_space(&free_space, &CostmapConfig::default());
        let mut known: Vec<_> =
            (0..costmap.grid().len()).filter_map(|i| Some((costmap.clearance_m(i), costmap.find_cost(i)?))).collect();
        known.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert!(known.len() > 50);
        assert!(known.windows(2).all(|w| w[0].1 >= w[1].1));
        assert!(known[0].1 > 5.0 && known[known.len() - 1].1 < 2.0);
        let open = CostmapConfig { unknown: UnknownPolicy::Costly, ..CostmapConfig::default() };
        let open = Costmap::from_free_space(&free_space, &open);
        let entered = |map: &Costmap| {
            (0..map.grid().len()).filter(|&i| map.state(i) == CellState::Unknown && map.is_traversable(i)).count()
        };
        assert_eq!(entered(&costmap), 0);
        assert!(entered(&open) > 0);
    }

    #[test]
    fn an_empty_grid_has_no_floor() {
        let costmap = Costmap::from_free_space(&FreeSpace::new(0.05), &CostmapConfig::default());
        assert!(!costmap.is_traversable_at(&Point2::origin()));
        assert_eq!(costmap.state_at(&Point2::origin()), CellState::Unknown);
    }
}
