//! Map files and exports.
//!
//! A map file (`map.dsm`) is an append-only log. It starts with [`MAGIC`] and the format version; each record is
//! `length: u32, crc32: u32, payload`, little-endian, with a [`crate::map::MapUpdate`] in postcard as payload. Reading
//! a map applies all updates in order. A file cut off in the middle of a record opens up to that record; a record whose
//! checksum is wrong ends the reading, and the loss is reported. A finished map holds one update with everything.

mod atomic;
mod export;
mod log;
mod show;

pub use atomic::write_atomically;
pub use export::{ExportFormat, export_map};
pub use log::{FORMAT_VERSION, LoadedMap, MAGIC, MapLog, load_map, save_map};
pub use show::{ShownAttributes, ShownMap, ShownObject, ShownRelation, ShownRoom, show_map};

use std::path::PathBuf;
use thiserror::Error;

/// Why a file could not be read or written.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is not a map file.
    #[error("{}: not a map file: expected the first bytes `{expected}`, found `{found}`", path.display())]
    NotAMap {
        /// The file.
        path: PathBuf,
        /// The magic bytes.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// It was written in a format that this version does not read.
    #[error("{}: map format version {found} is not known; this program reads version {known}", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The version in the file.
        found: u32,
        /// The version that is read.
        known: u32,
    },
    /// Nothing in it can be read.
    #[error("{}: no readable record at byte {offset}: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where the damage begins.
        offset: u64,
        /// What is wrong.
        reason: String,
    },
    /// A value in the map makes no sense.
    #[error("{}: object {object}: {reason}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The object.
        object: u64,
        /// What is wrong.
        reason: String,
    },
}
