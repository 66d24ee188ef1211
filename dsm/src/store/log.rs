//! The append-only map log.

use super::{StoreError, write_atomically};
use crate::map::{CellState, Map, MapChange, MapObject, MapUpdate, ObjectId, RemovalReason};
use crate::time::{Span, Stamp};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// First bytes of every map file.
pub const MAGIC: &[u8; 8] = b"DSM-MAP\n";
/// Version of the record format.
pub const FORMAT_VERSION: u32 = 1;
/// A record longer than this is taken for damage, so that a flipped length cannot ask for all memory.
const MAX_RECORD_BYTES: usize = 1 << 30;
/// A map on disk is never older than this.
const FLUSH_EVERY: Span = Span(1_000_000_000);

/// A map log that is being written while the robot explores.
///
/// Updates are gathered for one simulated second, of which the last state of each object is written.
pub struct MapLog {
    file: File,
    path: PathBuf,
    pending: Vec<MapUpdate>,
    last_flush: Stamp,
}

impl MapLog {
    /// Creates the file with its header; an existing one is replaced.
    pub fn create(path: &Path, resolution_m: f64) -> Result<Self, StoreError> {
        let io = |source| StoreError::Io { path: path.to_owned(), source };
        let mut file = File::create(path).map_err(io)?;
        file.write_all(&header(resolution_m)).map_err(io)?;
        Ok(Self { file, path: path.to_owned(), pending: Vec::new(), last_flush: Stamp::default() })
    }

    /// Appends an update; it reaches the disk within one simulated second of updates.
    pub fn append(&mut self, update: MapUpdate) -> Result<(), StoreError> {
        let stamp = update.stamp;
        self.pending.push(update);
        if stamp - self.last_flush >= FLUSH_EVERY {
            self.last_flush = stamp;
            self.flush()?;
        }
        Ok(())
    }

    /// Writes what is pending.
    pub fn flush(&mut self) -> Result<(), StoreError> {
        let Some(update) = coalesce(std::mem::take(&mut self.pending)) else { return Ok(()) };
        let record = encode(&update);
        self.file.write_all(&record).map_err(|source| StoreError::Io { path: self.path.clone(), source })
    }

    /// Replaces the log by its compact form: one record with the whole map.
    pub fn finish(self, map: &Map) -> Result<(), StoreError> {
        save_map(&self.path, map)
    }
}

/// A map read from a file.
#[derive(Debug)]
pub struct LoadedMap {
    /// The map.
    pub map: Map,
    /// Number of records applied.
    pub records: usize,
    /// Bytes at the end that could not be read; 0 for a whole file.
    pub lost_bytes: u64,
    /// Why they could not be read.
    pub loss: Option<String>,
}

/// Writes a whole map, atomically.
pub fn save_map(path: &Path, map: &Map) -> Result<(), StoreError> {
    let mut bytes = header(map.free_space.resolution_m);
    bytes.extend(encode(&whole(map)));
    write_atomically(path, &bytes)
}

/// Reads a map file. Damage after the first record is reported in the result, not as an error.
pub fn load_map(path: &Path) -> Result<LoadedMap, StoreError> {
    let bytes = std::fs::read(path).map_err(|source| StoreError::Io { path: path.to_owned(), source })?;
    decode(&bytes, path)
}

fn decode(bytes: &[u8], path: &Path) -> Result<LoadedMap, StoreError> {
    let Some(rest) = bytes.strip_prefix(MAGIC.as_slice()) else {
        return Err(StoreError::NotAMap {
            path: path.to_owned(),
            expected: String::from_utf8_lossy(MAGIC).trim_end().to_owned(),
            found: String::from_utf8_lossy(&bytes[..bytes.len().min(8)]).escape_debug().to_string(),
        });
    };
    let damaged = |offset: usize, reason: &str| StoreError::Damaged {
        path: path.to_owned(),
        offset: offset as u64,
        reason: reason.to_owned(),
    };
    if rest.len() < 12 {
        return Err(damaged(bytes.len(), "the header is cut off"));
    }
    let found = read_u32(rest, 0);
    if found != FORMAT_VERSION {
        return Err(StoreError::Version { path: path.to_owned(), found, known: FORMAT_VERSION });
    }
    let resolution_m = f64::from_le_bytes(std::array::from_fn(|i| rest[4 + i]));
    if !(0.001..=1.0).contains(&resolution_m) {
        return Err(damaged(12, "the cell size is outside 0.001 to 1 m"));
    }
    let mut map = Map::new(resolution_m);
    let (mut offset, mut records, mut loss) = (MAGIC.len() + 12, 0, None);
    while offset < bytes.len() {
        match read_record(&bytes[offset..]) {
            Ok((update, length)) => {
                check(&update, path)?;
                map.apply(update);
                offset += length;
                records += 1;
            }
            Err(reason) if records > 0 => {
                loss = Some(reason);
                break;
            }
            Err(reason) => return Err(damaged(offset, &reason)),
        }
    }
    Ok(LoadedMap { map, records, lost_bytes: (bytes.len() - offset) as u64, loss })
}

fn header(resolution_m: f64) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(FORMAT_VERSION.to_le_bytes());
    bytes.extend(resolution_m.to_le_bytes());
    bytes
}

fn read_u32(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}

fn encode(update: &MapUpdate) -> Vec<u8> {
    // Serializing plain data into memory cannot fail; an empty payload would be caught by its reader.
    let payload = postcard::to_stdvec(update).unwrap_or_default();
    let mut bytes = (payload.len() as u32).to_le_bytes().to_vec();
    bytes.extend(crc32fast::hash(&payload).to_le_bytes());
    bytes.extend(payload);
    bytes
}

fn read_record(bytes: &[u8]) -> Result<(MapUpdate, usize), String> {
    if bytes.len() < 8 {
        return Err("a record is cut off".into());
    }
    let (length, crc) = (read_u32(bytes, 0) as usize, read_u32(bytes, 4));
    if length > MAX_RECORD_BYTES {
        return Err(format!("a record claims {length} bytes"));
    }
    let payload = bytes.get(8..8 + length).ok_or("a record is cut off")?;
    if crc32fast::hash(payload) != crc {
        return Err("a checksum is wrong".into());
    }
    let update = postcard::from_bytes(payload).map_err(|e| format!("a record does not parse: {e}"))?;
    Ok((update, 8 + length))
}

fn check(update: &MapUpdate, path: &Path) -> Result<(), StoreError> {
    let invalid =
        |id: ObjectId, reason: &str| StoreError::Invalid { path: path.to_owned(), object: id.0, reason: reason.into() };
    for change in &update.changes {
        if let MapChange::Put(object) = change {
            let b = &object.bounds;
            if !b.center.coords.iter().chain(b.size.iter()).chain(b.rotation.coords.iter()).all(|v| v.is_finite()) {
                return Err(invalid(object.id, "its box is not finite"));
            }
            if b.size.iter().any(|&s| s < 0.0) {
                return Err(invalid(object.id, "its box has a negative size"));
            }
            if (b.rotation.norm() - 1.0).abs() > 1e-3 {
                return Err(invalid(object.id, "the rotation of its box has no unit length"));
            }
            if !object.points.iter().all(|p| p.position.iter().all(|v| v.is_finite())) {
                return Err(invalid(object.id, "a point is not finite"));
            }
        }
        if let MapChange::Cells(cells) = change
            && cells.iter().any(|(cell, _)| cell.iter().any(|c| c.abs() > 100_000))
        {
            return Err(invalid(ObjectId(0), "a free-space cell lies more than 100000 cells away"));
        }
    }
    Ok(())
}

fn whole(map: &Map) -> MapUpdate {
    let mut changes: Vec<MapChange> = map.objects.values().map(|o| MapChange::Put(Box::new((**o).clone()))).collect();
    changes.push(MapChange::Relate { about: map.objects.keys().copied().collect(), relations: map.relations.clone() });
    changes.push(MapChange::Rooms(map.rooms.clone()));
    changes.push(MapChange::Cells(map.free_space.known_cells().collect()));
    MapUpdate { stamp: map.stamp, changes }
}

enum Last {
    Put(Box<MapObject>),
    Removed(RemovalReason),
}

/// One update with the same effect as all of them.
fn coalesce(updates: Vec<MapUpdate>) -> Option<MapUpdate> {
    let stamp = updates.last()?.stamp;
    let mut objects: BTreeMap<ObjectId, Last> = BTreeMap::new();
    let mut cells: BTreeMap<[i32; 2], CellState> = BTreeMap::new();
    let (mut relates, mut rooms) = (Vec::new(), None);
    for change in updates.into_iter().flat_map(|u| u.changes) {
        match change {
            MapChange::Put(object) => {
                objects.insert(object.id, Last::Put(object));
            }
            MapChange::Remove(id, reason) => {
                objects.insert(id, Last::Removed(reason));
            }
            MapChange::Relate { .. } => relates.push(change),
            MapChange::Rooms(new) => rooms = Some(new),
            MapChange::Cells(new) => cells.extend(new),
        }
    }
    let mut changes: Vec<MapChange> = objects
        .into_iter()
        .map(|(id, last)| match last {
            Last::Put(object) => MapChange::Put(object),
            Last::Removed(reason) => MapChange::Remove(id, reason),
        })
        .collect();
    changes.extend(relates);
    changes.extend(rooms.map(MapChange::Rooms));
    if !cells.is_empty() {
        changes.push(MapChange::Cells(cells.into_iter().collect()));
    }
    Some(MapUpdate { stamp, changes })
}

#[cfg(test)]
mod tests {
    //! Contract: a map comes back as it was written; a log cut anywhere opens up to its last whole record; a damaged
    //! file is an error or a reported loss, never a panic.
    use super::*;
    use crate::geometry::OrientedBox;
    use crate::map::{Attributes, MapPoint, ObjectState, Relation, RelationKind, Votes};
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use proptest::prelude::*;

    fn object(id: u64, x: f64) -> MapObject {
        let mut names = Votes::default();
        names.add("apple", 3.0);
        MapObject {
            id: ObjectId(id),
            state: ObjectState::Stable,
            names,
            points: vec![MapPoint { position: Point3::new(x as f32, 0.0, 1.0), color: [200, 10, 10] }; 20],
            bounds: OrientedBox {
                center: Point3::new(x, 0.0, 1.0),
                size: Vector3::new(0.1, 0.2, 0.3),
                rotation: UnitQuaternion::from_euler_angles(0.0, 0.0, 0.3),
            },
            attributes: Attributes::default(),
            visual_feature: vec![1.0, 0.0],
            text_feature: vec![0.0, 1.0],
            room: None,
            observations: 4,
            first_seen: Stamp(1),
            last_seen: Stamp(2),
        }
    }

    fn update(second: i64, changes: Vec<MapChange>) -> MapUpdate {
        MapUpdate { stamp: Stamp(second * 1_000_000_000), changes }
    }

    fn put(id: u64, x: f64) -> MapChange {
        MapChange::Put(Box::new(object(id, x)))
    }

    fn history() -> Vec<MapUpdate> {
        let on = Relation { from: ObjectId(1), to: ObjectId(2), kind: RelationKind::On, confidence: 0.9 };
        vec![
            update(1, vec![put(1, 0.0), put(2, 1.0), MapChange::Cells(vec![([3, -4], CellState::Free)])]),
            update(2, vec![MapChange::Relate { about: vec![ObjectId(1)], relations: vec![on] }, put(3, 2.0)]),
            update(3, vec![MapChange::Remove(ObjectId(3), RemovalReason::Unconfirmed), put(1, 0.5)]),
        ]
    }

    fn applied(updates: &[MapUpdate]) -> Map {
        let mut map = Map::new(0.05);
        updates.iter().cloned().for_each(|u| {
            map.apply(u);
        });
        map
    }

    fn log_bytes(folder: &Path) -> Vec<u8> {
        let path = folder.join("log.dsm");
        let mut log = MapLog::create(&path, 0.05).unwrap();
        history().into_iter().for_each(|u| log.append(u).unwrap());
        log.flush().unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn log_and_whole_map_come_back_equal() {
        let folder = tempfile::tempdir().unwrap();
        let map = applied(&history());
        let logged = decode(&log_bytes(folder.path()), Path::new("log")).unwrap();
        assert_eq!(logged.map, map);
        assert_eq!((logged.records, logged.lost_bytes), (3, 0));
        let path = folder.path().join("map.dsm");
        save_map(&path, &map).unwrap();
        assert_eq!(load_map(&path).unwrap().map, map);
    }

    #[test]
    fn coalesced_updates_have_the_same_effect() {
        let mut map = Map::new(0.05);
        map.apply(coalesce(history()).unwrap());
        assert_eq!(map, applied(&history()));
    }

    #[test]
    fn a_log_cut_anywhere_keeps_its_whole_records() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = log_bytes(folder.path());
        let mut seen = 0;
        for end in 0..bytes.len() {
            match decode(&bytes[..end], Path::new("cut")) {
                Ok(loaded) => {
                    assert!(loaded.records >= seen);
                    seen = loaded.records;
                }
                Err(_) => assert_eq!(seen, 0, "a record was lost at byte {end}"),
            }
        }
        assert_eq!(seen, 2);
    }

    proptest! {
        #[test]
        fn flipped_bytes_never_panic(position in 0_usize..4000, value: u8) {
            let folder = tempfile::tempdir().unwrap();
            let mut bytes = log_bytes(folder.path());
            let position = position % bytes.len();
            bytes[position] = value;
            if let Ok(loaded) = decode(&bytes, Path::new("flipped")) {
                prop_assert!(loaded.records <= 3);
            }
        }
    }
}
