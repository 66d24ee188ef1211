//! Records of a map file: how they are framed, found again after damage, and told apart.

use crate::map::{MapChange, MapUpdate};

use serde::{Deserialize, Serialize};

/// First bytes of every record since minor version 1; reading goes on at the next one after damage.
pub(super) const MARKER: [u8; 4] = [0xD5, b'R', b'E', b'C'];
/// Marker, kind, length and checksum.
const HEAD_BYTES: usize = 13;
/// A record longer than this is taken for damage, so that a flipped length cannot ask for all memory.
const MAX_RECORD_BYTES: usize = 1 << 30;
/// Bytes that are checked again while looking for whole records after damage, in lengths of the file: a hostile file can
/// hold many markers in front of the same long record.
const SEARCH_LENGTHS: usize = 4;

/// What a record says. Kinds that a reader does not know are skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A [`MapUpdate`].
    Update,
    /// [`Contents`]: so many updates with a whole map follow.
    Contents,
    /// A log begins here that no end is known of.
    LogBegins,
    /// Identity and [`crate::map::Provenance`] of an object whose state follows.
    Provenance,
    /// Something of a later minor version.
    Unknown,
}

impl Kind {
    fn of(byte: u8) -> Self {
        match byte {
            0 => Self::Update,
            1 => Self::Contents,
            2 => Self::LogBegins,
            3 => Self::Provenance,
            _ => Self::Unknown,
        }
    }

    fn byte(self) -> u8 {
        match self {
            Self::Update => 0,
            Self::Contents => 1,
            Self::LogBegins => 2,
            Self::Provenance => 3,
            Self::Unknown => u8::MAX,
        }
    }
}

/// Stands before a whole map, so that a file cut between two records is known to be cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Contents {
    /// Updates that make up the map.
    pub(super) updates: u64,
}

/// A record in a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record<'a> {
    pub(super) kind: Kind,
    pub(super) offset: usize,
    pub(super) payload: &'a [u8],
}

/// Bytes of a file that hold no whole record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lost {
    /// The first lost byte.
    pub from: u64,
    /// The byte after the last lost one.
    pub to: u64,
    /// What is wrong there.
    pub reason: String,
}

/// An update as records: where its objects' votes come from, and itself.
pub(super) fn encode_update(update: &MapUpdate) -> Vec<u8> {
    let mut bytes = Vec::new();
    for change in &update.changes {
        if let MapChange::Put(object) = change
            && !object.provenance.is_empty()
        {
            bytes.extend(encode(Kind::Provenance, &(object.id, &object.provenance)));
        }
    }
    bytes.extend(encode(Kind::Update, update));
    bytes
}

/// A number that tells bytes apart, the same on every machine: FNV-1a with 64 bits.
pub fn digest_bytes(bytes: &[u8]) -> u64 {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    bytes.iter().fold(OFFSET, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(PRIME))
}

/// A number that tells updates apart: [`digest_bytes`] of their records.
pub fn digest_update(update: &MapUpdate) -> u64 {
    digest_bytes(&encode_update(update))
}

/// A record of any kind.
pub(super) fn encode<T: Serialize>(kind: Kind, value: &T) -> Vec<u8> {
    // Serializing plain data into memory cannot fail; an empty payload would be caught by its reader.
    let payload = postcard::to_stdvec(value).unwrap_or_default();
    let mut bytes = Vec::with_capacity(HEAD_BYTES + payload.len());
    bytes.extend(MARKER);
    bytes.push(kind.byte());
    bytes.extend((payload.len() as u32).to_le_bytes());
    bytes.extend(checksum(kind.byte(), &payload).to_le_bytes());
    bytes.extend(payload);
    bytes
}

/// The checksum covers what stands in the head, too.
fn checksum(kind: u8, payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&[kind]);
    hasher.update(&(payload.len() as u32).to_le_bytes());
    hasher.update(payload);
    hasher.finalize()
}

pub(super) fn read_u32(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}

/// All whole records from `start`, and what lies between them.
pub(super) fn scan(bytes: &[u8], start: usize, minor: u16) -> (Vec<Record<'_>>, Vec<Lost>) {
    let read = if minor == 0 { read_old } else { read_record };
    let (mut records, mut lost): (Vec<Record<'_>>, Vec<Lost>) = (Vec::new(), Vec::new());
    let mut offset = start;
    let mut budget = bytes.len().saturating_mul(SEARCH_LENGTHS);
    while offset < bytes.len() {
        match read(bytes, offset) {
            Ok((record, length)) => {
                records.push(record);
                offset += length;
            }
            Err(reason) => {
                // Records of minor version 0 cannot be found again.
                let next = if minor == 0 { None } else { find_next(bytes, offset + 1, &mut budget) };
                let to = next.unwrap_or(bytes.len());
                lost.push(Lost { from: offset as u64, to: to as u64, reason });
                offset = to;
            }
        }
    }
    (records, lost)
}

/// The next offset with a whole record.
fn find_next(bytes: &[u8], from: usize, budget: &mut usize) -> Option<usize> {
    let mut at = from;
    while let Some(found) = bytes.get(at..)?.windows(MARKER.len()).position(|four| four == MARKER) {
        at += found;
        let claimed = if bytes.len() - at < HEAD_BYTES { 0 } else { read_u32(bytes, at + 5) as usize };
        if claimed <= bytes.len() - at {
            *budget = budget.checked_sub(claimed)?;
        }
        if read_record(bytes, at).is_ok() {
            return Some(at);
        }
        at += 1;
    }
    None
}

fn read_record(bytes: &[u8], offset: usize) -> Result<(Record<'_>, usize), String> {
    let rest = &bytes[offset..];
    if !rest.starts_with(&MARKER[..rest.len().min(MARKER.len())]) {
        return Err("no record begins here".into());
    }
    if rest.len() < HEAD_BYTES {
        return Err("a record is cut off".into());
    }
    let payload = payload(rest, HEAD_BYTES, read_u32(rest, 5) as usize)?;
    if checksum(rest[4], payload) != read_u32(rest, 9) {
        return Err("a checksum is wrong".into());
    }
    Ok((Record { kind: Kind::of(rest[4]), offset, payload }, HEAD_BYTES + payload.len()))
}

/// A record of minor version 0: length, checksum, update.
fn read_old(bytes: &[u8], offset: usize) -> Result<(Record<'_>, usize), String> {
    const HEAD: usize = 8;
    let rest = &bytes[offset..];
    if rest.len() < HEAD {
        return Err("a record is cut off".into());
    }
    let payload = payload(rest, HEAD, read_u32(rest, 0) as usize)?;
    if crc32fast::hash(payload) != read_u32(rest, 4) {
        return Err("a checksum is wrong".into());
    }
    Ok((Record { kind: Kind::Update, offset, payload }, HEAD + payload.len()))
}

fn payload(rest: &[u8], head: usize, length: usize) -> Result<&[u8], String> {
    if length > MAX_RECORD_BYTES {
        return Err(format!("a record claims {length} bytes"));
    }
    rest.get(head..head + length).ok_or_else(|| "a record is cut off".into())
}
