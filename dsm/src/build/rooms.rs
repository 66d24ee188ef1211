//! Rooms from free space: open floor divided where it narrows to a doorway.

use super::cell_grid::CellGrid;
use super::config::BuildConfig;
use super::division::{Regions, clearance_m, grow_seeds, open_floor};
use super::occupancy::Occupancy;
use super::outline::outline;
use crate::geometry::Aabb;
use crate::knowledge::{Category, Knowledge};
use crate::map::{CellState, FreeSpace, MapObject, Room, RoomId};
use crate::time::{Span, Stamp};
use nalgebra::{Point2, Point3};
use std::collections::{BTreeMap, BTreeSet};

/// Rooms within this distance of the camera, along the axes, are divided anew, metres: no frame changes floor farther away.
const REACH_M: f64 = 8.0;

/// Cells from the first corner (inclusive) to the second (exclusive).
type Cells = ([i32; 2], [i32; 2]);

/// Divides free space and remembers the division, so that rooms keep their identity. What a division costs follows the
/// rooms around the camera, not all that were ever seen.
#[derive(Clone, Debug, Default)]
pub(super) struct RoomSegmenter {
    /// Room identity plus one of each cell; 0 outside rooms.
    labels: CellGrid<u32>,
    /// Where the cells of each label lie.
    spans: BTreeMap<u32, Cells>,
    next: u32,
    last: Option<Stamp>,
}

/// What a division looks at.
pub(super) struct Part {
    cells: Cells,
    /// Over these cells, whatever the height.
    pub(super) bounds: Aabb,
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
    /// Room identity plus one of each cell; 0 outside rooms.
    pub(super) fn labels(&self) -> &CellGrid<u32> {
        &self.labels
    }

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

    /// The part of the floor that the next division looks at: around the camera, with all of each room that reaches there;
    /// everything at the first division.
    pub(super) fn find_part(&self, eye: &Point2<f64>, free: &FreeSpace, changed: &[([i32; 2], CellState)]) -> Part {
        let mut whole =
            (free.origin_cell, [free.origin_cell[0] + free.columns as i32, free.origin_cell[1] + free.rows as i32]);
        if free.cells.is_empty() {
            whole = changed.first().map_or(whole, |(cell, _)| (*cell, *cell));
        }
        // Cells beyond the grid's border are as unknown as those along it.
        whole = changed.iter().fold(whole, |all, (cell, _)| union(all, (cell.map(|c| c - 1), cell.map(|c| c + 2))));
        let reach = (REACH_M / free.resolution_m) as i32;
        let view = (free.cell_at(eye).map(|c| c - reach), free.cell_at(eye).map(|c| c + reach + 1));
        let met = self.spans.values().filter(|span| meet(**span, view));
        let around = met.fold(view, |part, span| union(part, (span.0.map(|c| c - 1), span.1.map(|c| c + 1))));
        let cells = if self.last.is_some() { intersection(around, whole) } else { whole };
        let corner = |cell: [i32; 2], z: f64| {
            Point3::new(f64::from(cell[0]) * free.resolution_m, f64::from(cell[1]) * free.resolution_m, z)
        };
        Part { cells, bounds: Aabb { min: corner(cells.0, f64::MIN), max: corner(cells.1, f64::MAX) } }
    }

    /// Divides a part anew. `free` is the free space without the changes of this frame; `known` are the rooms so far,
    /// `objects` those over the part.
    pub(super) fn divide<'a>(
        &mut self,
        config: &BuildConfig,
        knowledge: &Knowledge,
        stamp: Stamp,
        part: &Part,
        (free, changed): (&FreeSpace, &[([i32; 2], CellState)]),
        occupancy: &Occupancy,
        known: &[Room],
        objects: impl Iterator<Item = &'a MapObject>,
    ) -> Vec<Room> {
        self.last = Some(stamp);
        let mut states: CellGrid<CellState> = CellGrid::covering(part.cells.0, part.cells.1);
        for index in 0..states.values().len() {
            states.values_mut()[index] = free.state(states.cell_of(index));
        }
        for (cell, state) in changed {
            if let Some(index) = states.find_index(*cell) {
                states.values_mut()[index] = *state;
            }
        }
        let mut open = open_floor(config, &states, occupancy);
        let clearance = clearance_m(&open, free.resolution_m);
        // Rooms that reach out of the part stay as they are.
        let is_whole = |span: &Cells| contains(part.cells, *span);
        let fixed: BTreeSet<u32> =
            self.spans.iter().filter(|(_, span)| !is_whole(span)).map(|(label, _)| *label).collect();
        let mut kept: CellGrid<u32> = CellGrid::covering(part.cells.0, part.cells.1);
        for index in (0..open.values().len()).filter(|_| !fixed.is_empty()) {
            let label = self.labels.get(open.cell_of(index));
            if open.values()[index] && fixed.contains(&label) {
                open.values_mut()[index] = false;
                kept.values_mut()[index] = label;
            }
        }
        let mut labels = grow_seeds(config, &open, &clearance);
        let mut regions = Regions::new(&labels);
        regions.join_wide_contacts(config, free.resolution_m, &labels);
        regions.drop_small(config, free.resolution_m, &labels);
        regions.relabel(&mut labels);
        self.keep_identities(&mut labels);
        labels.values_mut().iter_mut().zip(kept.values()).filter(|(_, kept)| **kept > 0).for_each(|(l, k)| *l = *k);
        self.spans.retain(|label, _| fixed.contains(label));
        for (index, &label) in labels.values().iter().enumerate() {
            let cell = labels.cell_of(index);
            if label > 0 && !fixed.contains(&label) {
                let here = (cell, cell.map(|c| c + 1));
                self.spans.entry(label).and_modify(|span| *span = union(*span, here)).or_insert(here);
            }
            if self.labels.get(cell) != label {
                *self.labels.at_mut(cell) = label;
            }
        }
        let rooms = self.describe(knowledge, free, &labels, &fixed, &clearance, objects);
        let fixed = known.iter().filter(|room| fixed.contains(&(room.id.0 + 1))).cloned();
        connect(rooms.into_iter().chain(fixed).collect())
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
        labels: &CellGrid<u32>,
        fixed: &BTreeSet<u32>,
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
        let is_new = |label: u32| label > 0 && !fixed.contains(&label);
        for (index, &label) in labels.values().iter().enumerate().filter(|(_, label)| is_new(**label)) {
            let entry = rooms.entry(label).or_insert_with(|| Region {
                cells: Vec::new(),
                center: index,
                beside: BTreeSet::new(),
            });
            entry.cells.push(labels.cell_of(index));
            if clearance[index] > clearance[entry.center] {
                entry.center = index;
            }
            let beside = labels.neighbours(index).map(|n| labels.values()[n]);
            entry.beside.extend(beside.filter(|other| *other > 0 && *other != label));
        }
        let things_in = |label: &u32| things.get(label).into_iter().flatten().copied();
        let scores: Vec<_> = rooms.keys().map(|label| knowledge.score_room_names(things_in(label))).collect();
        let names = knowledge.name_rooms(&scores);
        rooms
            .into_iter()
            .zip(names)
            .map(|((label, Region { cells, center, beside }), name)| Room {
                id: RoomId(label - 1),
                name: name.unwrap_or("room").to_owned(),
                center: free.center_of(labels.cell_of(center)),
                area_m2: cells.len() as f64 * free.resolution_m * free.resolution_m,
                polygon: outline(&cells, free.resolution_m),
                neighbours: beside.into_iter().map(|other| RoomId(other - 1)).collect(),
            })
            .collect()
    }
}

/// Rooms in the order of their identities, each the neighbour of its neighbours.
fn connect(mut rooms: Vec<Room>) -> Vec<Room> {
    rooms.sort_by_key(|room| room.id);
    let ids: BTreeSet<RoomId> = rooms.iter().map(|room| room.id).collect();
    let doors: BTreeSet<(RoomId, RoomId)> =
        rooms.iter().flat_map(|room| room.neighbours.iter().map(|other| (*other, room.id))).collect();
    for room in &mut rooms {
        let id = room.id;
        let back = doors.range((id, RoomId(0))..=(id, RoomId(u32::MAX))).map(|(_, other)| *other);
        let all: BTreeSet<RoomId> = room.neighbours.iter().copied().chain(back).filter(|o| ids.contains(o)).collect();
        room.neighbours = all.into_iter().collect();
    }
    rooms
}

fn union(a: Cells, b: Cells) -> Cells {
    (std::array::from_fn(|i| a.0[i].min(b.0[i])), std::array::from_fn(|i| a.1[i].max(b.1[i])))
}

fn intersection(a: Cells, b: Cells) -> Cells {
    (std::array::from_fn(|i| a.0[i].max(b.0[i])), std::array::from_fn(|i| a.1[i].min(b.1[i])))
}

fn meet(a: Cells, b: Cells) -> bool {
    (0..2).all(|i| a.0[i] < b.1[i] && b.0[i] < a.1[i])
}

fn contains(outer: Cells, inner: Cells) -> bool {
    union(outer, inner) == outer
}
