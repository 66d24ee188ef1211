//! Rooms from free space: open floor divided where it narrows to a doorway.

use super::cell_grid::CellGrid;
use super::config::BuildConfig;
use super::occupancy::Occupancy;
use super::outline::outline;
use crate::knowledge::{Category, Knowledge};
use crate::map::{CellState, FreeSpace, MapObject, Room, RoomId};
use crate::time::{Span, Stamp};
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Divides free space and remembers the division, so that rooms keep their identity.
#[derive(Clone, Debug, Default)]
pub(super) struct RoomSegmenter {
    /// Room identity plus one of each cell; 0 outside rooms.
    labels: CellGrid<u32>,
    next: u32,
    last: Option<Stamp>,
}

/// One region while it is described.
struct Region {
    cells: Vec<[i32; 2]>,
    /// Index of the cell with the most clearance.
    center: usize,
    /// Labels of regions that it touches.
    beside: BTreeSet<u32>,
}

impl RoomSegmenter {
    /// Whether it is time for a new division.
    pub(super) fn is_due(&self, config: &BuildConfig, stamp: Stamp) -> bool {
        self.last.is_none_or(|last| stamp - last >= Span::from_s(config.room_interval_s))
    }

    /// The room at a point or, for things at a wall, the closest one within 0.6 m.
    pub(super) fn find_room(&self, known: &FreeSpace, point: &Point2<f64>) -> Option<RoomId> {
        let reach = (0.6 / known.resolution_m) as i32;
        let [x, y] = known.cell_at(point);
        // Ring by ring, so that most things are found within a few cells; of equally close ones the lowest cell wins.
        let mut best: Option<(i32, i32, i32, u32)> = None;
        for ring in 0..=reach {
            if best.is_some_and(|b| b.0 < ring * ring) {
                break;
            }
            for dy in -ring..=ring {
                let step = if dy.abs() == ring { 1 } else { (2 * ring).max(1) as usize };
                for dx in (-ring..=ring).step_by(step) {
                    let (distance, label) = (dx * dx + dy * dy, self.labels.get([x + dx, y + dy]));
                    let found = (distance, dy, dx, label);
                    if label > 0 && distance <= reach * reach && best.is_none_or(|b| found < b) {
                        best = Some(found);
                    }
                }
            }
        }
        best.map(|(_, _, _, label)| RoomId(label - 1))
    }

    /// Divides anew. `free` is the free space with all changes of this frame.
    pub(super) fn divide<'a>(
        &mut self,
        config: &BuildConfig,
        knowledge: &Knowledge,
        stamp: Stamp,
        free: &FreeSpace,
        occupancy: &Occupancy,
        objects: impl Iterator<Item = &'a MapObject>,
    ) -> Vec<Room> {
        self.last = Some(stamp);
        let open = open_floor(config, free, occupancy);
        let clearance = clearance_m(&open, free.resolution_m);
        let mut labels = grow_seeds(config, &open, &clearance);
        join_wide_contacts(config, free.resolution_m, &mut labels);
        drop_small(config, free.resolution_m, &mut labels);
        self.keep_identities(&mut labels);
        self.labels = labels;
        self.describe(knowledge, free, &clearance, objects)
    }

    /// Gives each new region the identity of the old room with which it shares most cells; the largest share first.
    fn keep_identities(&mut self, labels: &mut CellGrid<u32>) {
        let mut shared: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        for (index, &label) in labels.values().iter().enumerate().filter(|(_, label)| **label > 0) {
            *shared.entry((label, self.labels.get(labels.cell_of(index)))).or_default() += 1;
        }
        let regions: BTreeSet<u32> = shared.keys().map(|(label, _)| *label).collect();
        let mut pairs: Vec<_> = shared.into_iter().filter(|((_, old), _)| *old > 0).collect();
        pairs.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut identity: BTreeMap<u32, u32> = BTreeMap::new();
        let mut taken = BTreeSet::new();
        for ((label, old), _) in pairs {
            if !identity.contains_key(&label) && taken.insert(old) {
                identity.insert(label, old);
            }
        }
        for region in regions {
            identity.entry(region).or_insert_with(|| {
                self.next += 1;
                self.next
            });
        }
        labels.values_mut().iter_mut().filter(|label| **label > 0).for_each(|label| *label = identity[label]);
    }

    fn describe<'a>(
        &self,
        knowledge: &Knowledge,
        free: &FreeSpace,
        clearance: &[f64],
        objects: impl Iterator<Item = &'a MapObject>,
    ) -> Vec<Room> {
        let mut things: BTreeMap<u32, Vec<(&Category, f32)>> = BTreeMap::new();
        for object in objects {
            let room = self.find_room(free, &object.bounds.center.xy());
            if let (Some(room), Some(category)) = (room, knowledge.find(object.name())) {
                things.entry(room.0 + 1).or_default().push((category, object.confidence()));
            }
        }
        let mut rooms: BTreeMap<u32, Region> = BTreeMap::new();
        for (index, &label) in self.labels.values().iter().enumerate().filter(|(_, label)| **label > 0) {
            let entry = rooms.entry(label).or_insert_with(|| Region {
                cells: Vec::new(),
                center: index,
                beside: BTreeSet::new(),
            });
            entry.cells.push(self.labels.cell_of(index));
            if clearance[index] > clearance[entry.center] {
                entry.center = index;
            }
            let beside = self.labels.neighbours(index).map(|n| self.labels.values()[n]);
            entry.beside.extend(beside.filter(|other| *other > 0 && *other != label));
        }
        rooms
            .into_iter()
            .map(|(label, Region { cells, center, beside })| Room {
                id: RoomId(label - 1),
                name: things
                    .get(&label)
                    .and_then(|things| knowledge.find_room_name(things.iter().copied()))
                    .unwrap_or("room")
                    .to_owned(),
                center: free.center_of(self.labels.cell_of(center)),
                area_m2: cells.len() as f64 * free.resolution_m * free.resolution_m,
                polygon: outline(&cells, free.resolution_m),
                neighbours: beside.into_iter().map(|other| RoomId(other - 1)).collect(),
            })
            .collect()
    }
}

/// Cells of floor, seen or beneath low furniture; small gaps in what was seen are closed.
fn open_floor(config: &BuildConfig, free: &FreeSpace, occupancy: &Occupancy) -> CellGrid<bool> {
    let low = free.origin_cell;
    let high = [low[0] + free.columns as i32, low[1] + free.rows as i32];
    let mut open: CellGrid<bool> = CellGrid::covering(low, high);
    let mut closed: CellGrid<bool> = CellGrid::covering(low, high);
    for (cell, state) in free.known_cells() {
        let wall = state == CellState::Occupied && occupancy.is_wall(config, cell);
        if let Some(index) = open.find_index(cell) {
            open.values_mut()[index] = !wall;
            closed.values_mut()[index] = wall;
        }
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
fn clearance_m(open: &CellGrid<bool>, cell_m: f64) -> Vec<f64> {
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
fn grow_seeds(config: &BuildConfig, open: &CellGrid<bool>, clearance: &[f64]) -> CellGrid<u32> {
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

/// Joins regions that meet along more than a doorway: furniture narrows a room, a wall divides it.
fn join_wide_contacts(config: &BuildConfig, cell_m: f64, labels: &mut CellGrid<u32>) {
    let limit = ((config.doorway_m + 0.2) / cell_m) as usize;
    loop {
        let mut contacts: BTreeMap<(u32, u32), BTreeSet<[i32; 2]>> = BTreeMap::new();
        for (index, &label) in labels.values().iter().enumerate().filter(|(_, label)| **label > 0) {
            for other in labels.neighbours(index).map(|n| labels.values()[n]).filter(|other| *other > label) {
                contacts.entry((label, other)).or_default().insert(labels.cell_of(index));
            }
        }
        let Some((&(keep, go), _)) = contacts.iter().find(|(_, cells)| largest_run(cells) > limit) else { return };
        labels.values_mut().iter_mut().filter(|label| **label == go).for_each(|label| *label = keep);
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

/// Adds regions below the smallest area to the neighbour with the longest contact, or drops them.
fn drop_small(config: &BuildConfig, cell_m: f64, labels: &mut CellGrid<u32>) {
    let least = (config.min_room_m2 / (cell_m * cell_m)) as usize;
    loop {
        let mut areas: BTreeMap<u32, usize> = BTreeMap::new();
        labels.values().iter().filter(|label| **label > 0).for_each(|label| *areas.entry(*label).or_default() += 1);
        let Some((&small, _)) = areas.iter().find(|(_, area)| **area < least) else { return };
        let mut contacts: BTreeMap<u32, usize> = BTreeMap::new();
        for (index, _) in labels.values().iter().enumerate().filter(|(_, label)| **label == small) {
            for other in labels.neighbours(index).map(|n| labels.values()[n]).filter(|o| *o > 0 && *o != small) {
                *contacts.entry(other).or_default() += 1;
            }
        }
        let heir = contacts.iter().fold((0, 0), |best, (&label, &n)| if n > best.1 { (label, n) } else { best }).0;
        labels.values_mut().iter_mut().filter(|label| **label == small).for_each(|label| *label = heir);
    }
}
