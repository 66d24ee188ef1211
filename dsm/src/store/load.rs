//! Reading a map file: whatever is whole in it.

use super::record::{Contents, Kind, Lost, Record, read_u32, scan};
use super::{FORMAT_VERSION, MAGIC, StoreError};
use crate::map::{Map, MapChange, MapUpdate, ObjectId, Provenance};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// Length of magic, version and cell size.
const HEADER_BYTES: usize = 20;
/// Farthest cell of the free space from the world's origin, in cells: 5 km at 5 cm.
const FARTHEST_CELL: i32 = 100_000;
/// Largest free space in cells (one byte each): half a kilometre square at 5 cm.
const MAX_CELLS: i64 = 100_000_000;

/// A map read from a file.
#[derive(Debug)]
pub struct LoadedMap {
    /// The map.
    pub map: Map,
    /// Minor version of the file.
    pub minor_version: u16,
    /// Number of updates applied.
    pub records: usize,
    /// Whether it holds a finished map and not the log of a run that goes on or broke off.
    pub finished: bool,
    /// Updates of a finished map that are missing.
    pub missing_records: u64,
    /// Records that a later version wrote and this one does not know.
    pub unknown_records: usize,
    /// Bytes that could not be read; 0 for a whole file.
    pub lost_bytes: u64,
    /// Where they are.
    pub lost: Vec<Lost>,
    /// What is lost and why, in words; `None` for a whole file.
    pub loss: Option<String>,
}

/// Reads a map file. What cannot be read is reported in the result as long as anything can; the file is not changed, and
/// may be written to meanwhile.
///
/// # Errors
/// [`StoreError`]: no map file, another major version, nothing that can be read, or values that make no sense.
pub fn load_map(path: &Path) -> Result<LoadedMap, StoreError> {
    let bytes = std::fs::read(path).map_err(|source| StoreError::Io { path: path.to_owned(), source })?;
    decode(&bytes, path)
}

/// As [`load_map`], from memory; `path` is for error messages.
pub fn decode(bytes: &[u8], path: &Path) -> Result<LoadedMap, StoreError> {
    let (resolution_m, minor) = read_header(bytes, path)?;
    let (records, mut lost) = scan(bytes, HEADER_BYTES, minor);
    let parsed: Vec<(&Record<'_>, Result<Parsed, String>)> =
        records.par_iter().filter_map(|record| Some((record, parse(record)?))).collect();
    // Stands before the state of its object.
    let mut provenance: BTreeMap<ObjectId, Provenance> = BTreeMap::new();
    let mut map = Map::new(resolution_m);
    let mut extent = Extent::default();
    let mut applied = Vec::new();
    for (record, update) in parsed {
        match update {
            Ok(Parsed::Provenance(id, new)) => {
                provenance.insert(id, new);
            }
            Ok(Parsed::Update(mut update)) => {
                check(&update, &mut extent, path)?;
                for change in &mut update.changes {
                    if let MapChange::Put(object) = change {
                        let known = || map.find_object(object.id).map(|object| object.provenance.clone());
                        object.provenance = provenance.remove(&object.id).or_else(known).unwrap_or_default();
                    }
                }
                map.apply(update);
                applied.push(record.offset);
            }
            Err(error) => lost.push(Lost {
                from: record.offset as u64,
                to: (record.payload.as_ptr() as usize - bytes.as_ptr() as usize + record.payload.len()) as u64,
                reason: format!("a record does not parse: {error}"),
            }),
        }
    }
    lost.sort_by_key(|lost| lost.from);
    let begins = records.iter().rev().find(|record| record.kind == Kind::LogBegins);
    let promised = records.iter().rev().find(|record| record.kind == Kind::Contents).and_then(|record| {
        let contents: Contents = postcard::from_bytes(record.payload).ok()?;
        // A compacted log goes on after its map.
        let end = begins.map_or(usize::MAX, |begins| begins.offset);
        let found = applied.iter().filter(|&&offset| (record.offset..end).contains(&offset)).count();
        Some((contents.updates, found as u64))
    });
    // A log may have been cut off in its first update.
    if applied.is_empty()
        && begins.is_none()
        && let Some(first) = lost.first()
    {
        let reason = first.reason.clone();
        return Err(StoreError::Damaged { path: path.to_owned(), offset: first.from, reason });
    }
    let missing_records = promised.map_or(0, |(promised, found)| promised.saturating_sub(found));
    Ok(LoadedMap {
        loss: describe(&lost, bytes.len() as u64, missing_records),
        map,
        minor_version: minor,
        records: applied.len(),
        finished: begins.is_none(),
        missing_records,
        unknown_records: records.iter().filter(|record| record.kind == Kind::Unknown).count(),
        lost_bytes: lost.iter().map(|lost| lost.to - lost.from).sum(),
        lost,
    })
}

/// A record that says something of the map.
enum Parsed {
    Update(MapUpdate),
    Provenance(ObjectId, Provenance),
}

fn parse(record: &Record<'_>) -> Option<Result<Parsed, String>> {
    let parsed = match record.kind {
        Kind::Update => postcard::from_bytes(record.payload).map(Parsed::Update),
        Kind::Provenance => postcard::from_bytes(record.payload).map(|(id, of)| Parsed::Provenance(id, of)),
        Kind::Contents | Kind::LogBegins | Kind::Unknown => return None,
    };
    Some(match parsed {
        Ok(Parsed::Provenance(_, of)) if !of.is_sound() => Err("rows of votes are not in order".into()),
        other => other.map_err(|error| error.to_string()),
    })
}

fn describe(lost: &[Lost], length: u64, missing: u64) -> Option<String> {
    let place = |lost: &Lost| match lost.to == length {
        true => format!("{} bytes at the end are lost: {}", lost.to - lost.from, lost.reason),
        false => format!("bytes {} to {} are lost: {}", lost.from, lost.to, lost.reason),
    };
    let mut parts: Vec<String> = lost.iter().take(3).map(place).collect();
    if lost.len() > 3 {
        parts.push(format!("and {} more places", lost.len() - 3));
    }
    if missing > 0 {
        parts.push(format!("{missing} records of the finished map are missing"));
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// Cell size and minor version.
fn read_header(bytes: &[u8], path: &Path) -> Result<(f64, u16), StoreError> {
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
    let version = read_u32(rest, 0);
    let (major, minor) = (version & 0xffff, (version >> 16) as u16);
    if major != FORMAT_VERSION {
        return Err(StoreError::Version { path: path.to_owned(), found: major, known: FORMAT_VERSION });
    }
    let resolution_m = f64::from_le_bytes(std::array::from_fn(|i| rest[4 + i]));
    if !(0.001..=1.0).contains(&resolution_m) {
        return Err(damaged(12, "the cell size is outside 0.001 to 1 m"));
    }
    Ok((resolution_m, minor))
}

/// The cells that were set so far.
#[derive(Default)]
struct Extent(Option<[[i32; 2]; 2]>);

impl Extent {
    fn add(&mut self, cell: [i32; 2]) {
        let [low, high] = self.0.get_or_insert([cell, cell]);
        for k in 0..2 {
            low[k] = low[k].min(cell[k]);
            high[k] = high[k].max(cell[k]);
        }
    }

    fn count(&self) -> i64 {
        self.0.map_or(0, |[low, high]| (0..2).map(|k| i64::from(high[k]) - i64::from(low[k]) + 1).product())
    }
}

fn check(update: &MapUpdate, extent: &mut Extent, path: &Path) -> Result<(), StoreError> {
    let invalid =
        |id: ObjectId, reason: &str| StoreError::Invalid { path: path.to_owned(), object: id.0, reason: reason.into() };
    for change in &update.changes {
        match change {
            MapChange::Put(object) => {
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
            MapChange::Cells(cells) => {
                for (cell, _) in cells {
                    if cell.iter().any(|c| !(-FARTHEST_CELL..=FARTHEST_CELL).contains(c)) {
                        return Err(invalid(ObjectId(0), "a free-space cell lies more than 100000 cells away"));
                    }
                    extent.add(*cell);
                }
                if extent.count() > MAX_CELLS {
                    return Err(invalid(ObjectId(0), "its free space spans more than 100000000 cells"));
                }
            }
            MapChange::Remove(..) | MapChange::Relate { .. } | MapChange::Rooms(_) => {}
        }
    }
    Ok(())
}
