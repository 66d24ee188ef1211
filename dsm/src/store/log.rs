//! Writing a map: the append-only log of a run, and its compact form.

use super::record::{Contents, Kind, encode, encode_update};
use super::{FORMAT_VERSION, MAGIC, MINOR_VERSION, StoreError, write_atomically};
use crate::map::{CellState, Map, MapChange, MapObject, MapUpdate, ObjectId, RemovalReason};
use crate::time::{Span, Stamp};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Updates are gathered so long. A map shows up to 0.2 s after its frame and frames come up to 0.2 s apart: a file is never
/// more than one second behind the world.
const FLUSH_EVERY: Span = Span(500_000_000);
/// A log is not replaced by its compact form before it has grown by so much.
const COMPACT_FROM_BYTES: usize = 32 << 20;
/// Nor before it is so many times as long as its compact form was: what is written again stays below what is written once.
const COMPACT_FROM_RATIO: usize = 4;

/// A map log that is being written while the robot explores.
///
/// Updates are gathered for half a simulated second, of which the last state of each object is written. When the log has
/// become long it is replaced, at once, by the map with all that is known and goes on from there.
pub struct MapLog {
    file: File,
    path: PathBuf,
    pending: Vec<MapUpdate>,
    last_flush: Stamp,
    grown_bytes: usize,
    compact_bytes: usize,
    compact_from_bytes: usize,
}

impl MapLog {
    /// Creates the file with its header; an existing one is replaced.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn create(path: &Path, resolution_m: f64) -> Result<Self, StoreError> {
        Self::create_compacting(path, resolution_m, COMPACT_FROM_BYTES)
    }

    /// As [`Self::create`], but compacted from so many bytes on.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn create_compacting(path: &Path, resolution_m: f64, compact_from_bytes: usize) -> Result<Self, StoreError> {
        let mut bytes = header(resolution_m);
        bytes.extend(encode(Kind::LogBegins, &()));
        Ok(Self {
            file: replace(path, &bytes)?,
            path: path.to_owned(),
            pending: Vec::new(),
            last_flush: Stamp::default(),
            grown_bytes: 0,
            compact_bytes: 0,
            compact_from_bytes,
        })
    }

    /// Appends an update that `map` holds already; it reaches the disk within half a simulated second of updates.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn append(&mut self, update: MapUpdate, map: &Map) -> Result<(), StoreError> {
        let stamp = update.stamp;
        self.pending.push(update);
        if stamp - self.last_flush >= FLUSH_EVERY {
            self.last_flush = stamp;
            self.flush()?;
            if self.grown_bytes >= self.compact_from_bytes.max(COMPACT_FROM_RATIO * self.compact_bytes) {
                self.compact(map)?;
            }
        }
        Ok(())
    }

    /// Writes what is pending.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn flush(&mut self) -> Result<(), StoreError> {
        let Some(update) = coalesce(std::mem::take(&mut self.pending)) else { return Ok(()) };
        let record = encode_update(&update);
        self.grown_bytes += record.len();
        self.file.write_all(&record).map_err(|source| StoreError::Io { path: self.path.clone(), source })
    }

    fn compact(&mut self, map: &Map) -> Result<(), StoreError> {
        let mut bytes = encode_map(map);
        bytes.extend(encode(Kind::LogBegins, &()));
        self.file = replace(&self.path, &bytes)?;
        (self.grown_bytes, self.compact_bytes) = (0, bytes.len());
        Ok(())
    }

    /// Replaces the log by its compact form.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn finish(self, map: &Map) -> Result<(), StoreError> {
        save_map(&self.path, map)
    }
}

/// Writes a whole file and opens it for appending: at no moment is there a file that does not open.
fn replace(path: &Path, bytes: &[u8]) -> Result<File, StoreError> {
    write_atomically(path, bytes)?;
    let open = OpenOptions::new().append(true).open(path);
    open.map_err(|source| StoreError::Io { path: path.to_owned(), source })
}

/// Writes a whole map, atomically.
///
/// # Errors
/// [`StoreError::Io`].
pub fn save_map(path: &Path, map: &Map) -> Result<(), StoreError> {
    write_atomically(path, &encode_map(map))
}

fn header(resolution_m: f64) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend((FORMAT_VERSION | u32::from(MINOR_VERSION) << 16).to_le_bytes());
    bytes.extend(resolution_m.to_le_bytes());
    bytes
}

/// The compact form of a map, as it stands in a finished file. Each object is a record of its own, so that damage costs no
/// more than it hits.
pub fn encode_map(map: &Map) -> Vec<u8> {
    let mut changes: Vec<MapChange> = map.objects.values().map(|o| MapChange::Put(Box::new((**o).clone()))).collect();
    if !map.relations.is_empty() {
        let about = map.objects.keys().copied().collect();
        changes.push(MapChange::Relate { about, relations: map.relations.clone() });
    }
    if !map.rooms.is_empty() {
        changes.push(MapChange::Rooms(map.rooms.clone()));
    }
    if !map.free_space.cells.is_empty() {
        changes.push(MapChange::Cells(map.free_space.known_cells().collect()));
    }
    // The last record carries the stamp even when the map is empty.
    if changes.is_empty() && map.stamp != Stamp::default() {
        changes.push(MapChange::Rooms(Vec::new()));
    }
    let mut bytes = header(map.free_space.resolution_m);
    bytes.extend(encode(Kind::Contents, &Contents { updates: changes.len() as u64 }));
    for change in changes {
        bytes.extend(encode_update(&MapUpdate { stamp: map.stamp, changes: vec![change] }));
    }
    bytes
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
#[path = "log_tests.rs"]
mod tests;
