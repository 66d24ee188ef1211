//! Rooms of a map against true ones.
//!
//! Over the known free cells of the map. A room of the map and a true one match when the intersection over union of their
//!

use super::TrueRoom;
use crate::knowledge::Knowledge;
use crate::map::{CellState, Map};
use nalgebra::Point2;
use std::collections::BTreeMap;

/// Cells of a true room from which it counts as visited, square metres.
const VISITED_M2: f64 = 2.0;

/// Counts over the rooms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RoomCounts {
    /// Rooms in both.
    pub(super) matched: usize,
    /// Of these, rooms with the right name.
    pub(super) named: usize,
    /// Rooms of the map.
    pub(super) found: usize,
    /// True rooms of which the map knows floor.
    pub(super) visited: usize,
}

/// Whether a polygon holds a point.
pub(super) fn contains(polygon: &[Point2<f64>], point: &Point2<f64>) -> bool {
    let crosses = (0..polygon.len()).filter(|&i| {
        let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        (a.y > point.y) != (b.y > point.y) && point.x < (b.x - a.x) * (point.y - a.y) / (b.y - a.y) + a.x
    });
    crosses.count() % 2 == 1
}

pub(super) fn compare(map: &Map, rooms: &[TrueRoom], knowledge: &Knowledge) -> RoomCounts {
    let mut shared: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let (mut found, mut truth) = (vec![0usize; map.rooms.len()], vec![0usize; rooms.len()]);
    for (cell, _) in map.free_space.known_cells().filter(|(_, state)| *state == CellState::Free) {
        let place = map.free_space.center_of(cell);
        let own = map.rooms.iter().position(|room| contains(&room.polygon, &place));
        let real = rooms.iter().position(|room| contains(&room.polygon, &place));
        own.into_iter().for_each(|room| found[room] += 1);
        real.into_iter().for_each(|room| truth[room] += 1);
        if let (Some(own), Some(real)) = (own, real) {
            *shared.entry((own, real)).or_default() += 1;
        }
    }
    let least = VISITED_M2 / (map.free_space.resolution_m * map.free_space.resolution_m);
    let mut counts = RoomCounts {
        found: map.rooms.len(),
        visited: truth.iter().filter(|cells| **cells as f64 >= least).count(),
        ..RoomCounts::default()
    };
    let canonical = |name: &str| knowledge.words().rooms.find(name).unwrap_or(name).to_owned();
    for ((own, real), cells) in shared {
        if 2 * cells > found[own] + truth[real] - cells && truth[real] as f64 >= least {
            counts.matched += 1;
            counts.named += usize::from(canonical(&map.rooms[own].name) == canonical(&rooms[real].name));
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    //! Contract: a room that covers its true one matches, one that spans two does not.
    use super::*;
    use crate::map::{MapChange, MapUpdate, Room, RoomId};
    use crate::time::Stamp;

    fn square(x: f64, width: f64) -> Vec<Point2<f64>> {
        vec![Point2::new(x, 0.0), Point2::new(x + width, 0.0), Point2::new(x + width, 4.0), Point2::new(x, 4.0)]
    }

    #[test]
    fn a_joined_room_matches_neither() {
        let room = |id, name: &str, x, width| Room {
            id: RoomId(id),
            name: name.into(),
            polygon: square(x, width),
            center: Point2::new(x + 0.5 * width, 2.0),
            area_m2: 4.0 * width,
            neighbours: vec![],
        };
        let cells = (0..160).flat_map(|x| (0..80).map(move |y| ([x, y], CellState::Free))).collect();
        let mut map = Map::new(0.05);
        let changes = vec![
            MapChange::Cells(cells),
            MapChange::Rooms(vec![room(0, "kitchen", 0.0, 4.0), room(1, "room", 4.0, 4.0)]),
        ];
        map.apply(MapUpdate { stamp: Stamp::default(), changes });
        let rooms = vec![
            TrueRoom { name: "kitchen".into(), polygon: square(0.0, 4.0) },
            TrueRoom { name: "bath".into(), polygon: square(4.0, 4.0) },
        ];
        let knowledge = Knowledge::embedded().unwrap();
        let counts = compare(&map, &rooms, &knowledge);
        assert_eq!(counts, RoomCounts { matched: 2, named: 1, found: 2, visited: 2 });
        map.rooms = vec![room(0, "kitchen", 0.0, 8.0)];
        assert_eq!(compare(&map, &rooms, &knowledge).matched, 0);
    }
}
