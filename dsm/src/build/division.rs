//! Dividing open floor into regions where it narrows to a doorway.

use super::cell_grid::CellGrid;
use super::config::BuildConfig;
use super::occupancy::Occupancy;
use crate::map::CellState;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Cells of floor, seen or beneath low furniture; small gaps in what was seen are closed.
pub(super) fn open_floor(config: &BuildConfig, states: &CellGrid<CellState>, occupancy: &Occupancy) -> CellGrid<bool> {
    let (low, high) = states.range();
    let mut open: CellGrid<bool> = CellGrid::covering(low, high);
    let mut closed: CellGrid<bool> = CellGrid::covering(low, high);
    for (index, &state) in states.values().iter().enumerate().filter(|(_, state)| **state != CellState::Unknown) {
        let wall = state == CellState::Occupied && occupancy.is_wall(config, states.cell_of(index));
        open.values_mut()[index] = !wall;
        closed.values_mut()[index] = wall;
    }
    for _ in 0..3 {
        let gaps: Vec<usize> = (0..open.values().len())
            .filter(|&i| !open.values()[i] && !closed.values()[i])
            .filter(|&i| open.neighbours(i).filter(|n| open.values()[*n]).count() >= 3)
            .collect();
        gaps.into_iter().for_each(|i| open.values_mut()[i] = true);
    }
    open
}

/// Distance of each open cell to what is not open, metres (3-4 chamfer, within 6 % of the Euclidean distance).
pub(super) fn clearance_m(open: &CellGrid<bool>, cell_m: f64) -> Vec<f64> {
    let (low, high) = open.range();
    let (columns, rows) = ((high[0] - low[0]) as isize, (high[1] - low[1]) as isize);
    let mut steps: Vec<i32> = open.values().iter().map(|o| if *o { i32::MAX / 2 } else { 0 }).collect();
    let mut pass = |forward: bool| {
        for i in 0..columns * rows {
            let index = if forward { i } else { columns * rows - 1 - i };
            let (column, row) = (index % columns, index / columns);
            let sign = if forward { -1 } else { 1 };
            let mut least = steps[index as usize];
            for (dc, dr, cost) in [(sign, 0, 3), (0, sign, 3), (sign, sign, 4), (-sign, sign, 4)] {
                let (c, r) = (column + dc, row + dr);
                let beside =
                    if c < 0 || r < 0 || c >= columns || r >= rows { 0 } else { steps[(r * columns + c) as usize] };
                least = least.min(beside + cost);
            }
            steps[index as usize] = if open.values()[index as usize] { least } else { 0 };
        }
    };
    pass(true);
    pass(false);
    steps.into_iter().map(|s| f64::from(s) / 3.0 * cell_m).collect()
}

/// Regions wider than a doorway, grown over the rest of the open floor step by step; they meet in the doorways.
pub(super) fn grow_seeds(config: &BuildConfig, open: &CellGrid<bool>, clearance: &[f64]) -> CellGrid<u32> {
    let (low, high) = open.range();
    let mut labels: CellGrid<u32> = CellGrid::covering(low, high);
    let mut next = 0;
    let mut front = VecDeque::new();
    let flood = |labels: &mut CellGrid<u32>, seed: usize, label: u32, wide: f64, front: &mut VecDeque<usize>| {
        let mut stack = vec![seed];
        labels.values_mut()[seed] = label;
        while let Some(index) = stack.pop() {
            front.push_back(index);
            for n in open.neighbours(index) {
                if labels.values()[n] == 0 && open.values()[n] && clearance[n] > wide {
                    labels.values_mut()[n] = label;
                    stack.push(n);
                }
            }
        }
    };
    for (wide, grow) in [(0.5 * config.doorway_m + 0.02, true), (0.0, false)] {
        for (seed, &free_m) in clearance.iter().enumerate() {
            if labels.values()[seed] == 0 && open.values()[seed] && free_m > wide {
                next += 1;
                flood(&mut labels, seed, next, wide, &mut front);
            }
        }
        while grow && let Some(index) = front.pop_front() {
            let label = labels.values()[index];
            for n in open.neighbours(index) {
                if labels.values()[n] == 0 && open.values()[n] {
                    labels.values_mut()[n] = label;
                    front.push_back(n);
                }
            }
        }
    }
    labels
}

/// Regions that are put together, and where they meet.
pub(super) struct Regions {
    /// The region that each label became; 0 when it was dropped. By label.
    became: Vec<u32>,
    /// Cells and neighbours of another label, by index.
    contacts: Vec<(usize, usize)>,
    /// Cells of each label at the beginning.
    areas: Vec<usize>,
}

impl Regions {
    /// The regions of a grid whose labels count from 1; 0 is none.
    pub(super) fn new(labels: &CellGrid<u32>) -> Self {
        let count = labels.values().iter().copied().max().unwrap_or(0);
        let mut areas = vec![0; count as usize + 1];
        let mut contacts = Vec::new();
        for (index, &label) in labels.values().iter().enumerate().filter(|(_, label)| **label > 0) {
            areas[label as usize] += 1;
            let others = labels.neighbours(index).filter(|n| labels.values()[*n] > 0 && labels.values()[*n] != label);
            contacts.extend(others.map(|other| (index, other)));
        }
        Self { became: (0..=count).collect(), contacts, areas }
    }

    /// Gives each cell the region that its label became.
    pub(super) fn relabel(&self, labels: &mut CellGrid<u32>) {
        labels.values_mut().iter_mut().for_each(|label| *label = self.became[*label as usize]);
    }

    /// Joins regions that meet along more than a doorway: furniture narrows a room, a wall divides it.
    pub(super) fn join_wide_contacts(&mut self, config: &BuildConfig, cell_m: f64, labels: &CellGrid<u32>) {
        let limit = ((config.doorway_m + 0.2) / cell_m) as usize;
        loop {
            let mut contacts: BTreeMap<(u32, u32), BTreeSet<[i32; 2]>> = BTreeMap::new();
            for (index, label, other) in self.meetings(labels).filter(|(_, label, other)| other > label) {
                contacts.entry((label, other)).or_default().insert(labels.cell_of(index));
            }
            let wide = contacts.iter().find(|(_, cells)| cells.len() > limit / 4 && largest_run(cells) > limit);
            let Some((&(keep, go), _)) = wide else { return };
            self.turn(go, keep);
        }
    }

    /// Adds regions below the smallest area to the neighbour with the longest contact, or drops them.
    pub(super) fn drop_small(&mut self, config: &BuildConfig, cell_m: f64, labels: &CellGrid<u32>) {
        let least = (config.min_room_m2 / (cell_m * cell_m)) as usize;
        loop {
            let mut areas: BTreeMap<u32, usize> = BTreeMap::new();
            for (label, area) in self.areas.iter().enumerate().skip(1) {
                *areas.entry(self.became[label]).or_default() += area;
            }
            let Some((&small, _)) = areas.iter().find(|(region, area)| **region > 0 && **area < least) else { return };
            let mut contacts: BTreeMap<u32, usize> = BTreeMap::new();
            for (_, _, other) in self.meetings(labels).filter(|(_, label, _)| *label == small) {
                *contacts.entry(other).or_default() += 1;
            }
            let heir = contacts.iter().fold((0, 0), |best, (&label, &n)| if n > best.1 { (label, n) } else { best }).0;
            self.turn(small, heir);
        }
    }

    /// Cells where two regions meet: index, its region, the other one.
    fn meetings<'a>(&'a self, labels: &'a CellGrid<u32>) -> impl Iterator<Item = (usize, u32, u32)> + 'a {
        let region = |index: usize| self.became[labels.values()[index] as usize];
        let both = self.contacts.iter().map(move |(index, other)| (*index, region(*index), region(*other)));
        both.filter(|(_, label, other)| *label > 0 && *other > 0 && label != other)
    }

    fn turn(&mut self, from: u32, into: u32) {
        self.became.iter_mut().filter(|region| **region == from).for_each(|region| *region = into);
    }
}

/// Extent in cells of the widest connected part of a contact.
fn largest_run(cells: &BTreeSet<[i32; 2]>) -> usize {
    let mut left = cells.clone();
    let mut widest = 0;
    while let Some(seed) = left.pop_first() {
        let (mut stack, mut low, mut high) = (vec![seed], seed, seed);
        while let Some([x, y]) = stack.pop() {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
            for dy in -2..=2 {
                for dx in -2..=2 {
                    if left.remove(&[x + dx, y + dy]) {
                        stack.push([x + dx, y + dy]);
                    }
                }
            }
        }
        let extent = f64::from(high[0] - low[0] + 1).hypot(f64::from(high[1] - low[1] + 1));
        widest = widest.max(extent as usize);
    }
    widest
}
