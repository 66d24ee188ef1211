//! Map files and exports.
//!
//! A map file (`map.dsm`) is an append-only log of records, each with a checksum and a [`crate::map::MapUpdate`]; reading a
//! map applies all updates in order. Whatever is whole in a file is read, and what is not is reported. `docs/map_format.md`
//! tells it byte by byte. A finished map is the compact form: one record for each object, then relations, rooms and free
//! space.

mod atomic;
mod export;
mod gltf;
mod load;
mod log;
mod merge;
mod record;
mod show;
mod spark_dsg;

pub use atomic::{WholeFile, write_atomically};
pub use export::{ExportFormat, export_map};
pub use load::{LoadedMap, decode, load_map};
pub use log::{MapLog, encode_map, save_map};
pub use merge::{Merged, merge_maps};
pub use record::{Lost, digest_bytes, digest_update};
pub use show::{ShownAttributes, ShownMap, ShownObject, ShownRelation, ShownRoom, show_map};
pub use spark_dsg::import_spark_dsg;

use std::path::PathBuf;
use thiserror::Error;

/// First bytes of every map file.
pub const MAGIC: &[u8; 8] = b"DSM-MAP\n";
/// Major version of the format: a file with another one is refused.
pub const FORMAT_VERSION: u32 = 1;
/// Minor version that is written. All minor versions are read; records of a kind that is not known are skipped.
pub const MINOR_VERSION: u16 = 2;

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
    /// It is not what it should be, in another's format.
    #[error("{}: not {expected}: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The format.
        expected: &'static str,
        /// What is wrong.
        reason: String,
    },
}
