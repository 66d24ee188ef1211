//! Larger maps out of smaller ones, for measurements of what size costs.

use super::{Map, MapChange, MapUpdate, ObjectId, Relation, Room, RoomId};
use nalgebra::{Vector2, Vector3};

/// Between the identities of one copy and the next.
const IDS_APART: u64 = 1_000_000;

/// The update that puts copies of all that a map holds beside it, on a square grid, until it has `objects` stable objects:
/// objects, relations, rooms and free space. Nothing when it has as many already or none.
pub fn copy_beside(map: &Map, objects: usize) -> MapUpdate {
    let mut update = MapUpdate { stamp: map.stamp, changes: Vec::new() };
    let originals: Vec<_> = map.stable_objects().collect();
    if originals.is_empty() || map.free_space.cells.is_empty() {
        return update;
    }
    let copies = objects.div_ceil(originals.len()).saturating_sub(1);
    let across = ((copies + 1) as f64).sqrt().ceil() as usize;
    let (columns, rows) = (map.free_space.columns as i32, map.free_space.rows as i32);
    let known: Vec<_> = map.free_space.known_cells().collect();
    let (mut relations, mut rooms, mut cells) = (Vec::new(), map.rooms.clone(), Vec::new());
    for copy in 1..=copies {
        let place = [(copy % across) as i32 * columns, (copy / across) as i32 * rows];
        let shift = Vector2::from(place.map(f64::from)) * map.free_space.resolution_m;
        let id = |id: ObjectId| ObjectId(id.0 + IDS_APART * copy as u64);
        for original in originals.iter().take(objects - originals.len() * copy) {
            let mut object = (*original).clone();
            object.id = id(object.id);
            object.bounds.center += Vector3::new(shift.x, shift.y, 0.0);
            let by = Vector3::new(shift.x, shift.y, 0.0).cast::<f32>();
            object.points.iter_mut().for_each(|point| point.position += by);
            update.changes.push(MapChange::Put(Box::new(object)));
        }
        let copied = |r: &Relation| Relation { from: id(r.from), to: id(r.to), ..r.clone() };
        relations.extend(map.relations.iter().map(copied));
        rooms.extend(map.rooms.iter().map(|room| Room {
            id: RoomId(room.id.0 + 10_000 * copy as u32),
            polygon: room.polygon.iter().map(|corner| corner + shift).collect(),
            center: room.center + shift,
            ..room.clone()
        }));
        cells.extend(known.iter().map(|([x, y], state)| ([x + place[0], y + place[1]], *state)));
    }
    let about = relations.iter().map(|relation: &Relation| relation.from).collect();
    update.changes.extend([MapChange::Relate { about, relations }, MapChange::Rooms(rooms), MapChange::Cells(cells)]);
    update
}
