//! Gets the files of networks: `dsm models fetch`.

use crate::http::download;
use crate::networks::NetworkFile;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What was done for a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fetched {
    /// The file.
    pub file: PathBuf,
    /// Whether it was got now; false when it was there.
    pub is_new: bool,
    /// Its SHA-256.
    pub sha256: String,
    /// Whether the file of models holds it to that.
    pub is_checked: bool,
    /// Its licence, as the file of models says.
    pub licence: String,
}

/// Why a file cannot be had.
#[derive(Debug, Error)]
pub enum FetchError {
    /// It is not there.
    #[error("{}: it is not there; `dsm models fetch` gets it, or: {from}", file.display())]
    Missing {
        /// The file.
        file: PathBuf,
        /// Its source.
        from: String,
    },
    /// There is nothing to get it from.
    #[error("{}: it is not there, and its source is no address: {from}", file.display())]
    NoAddress {
        /// The file.
        file: PathBuf,
        /// Its source.
        from: String,
    },
    /// The address does not give it.
    #[error("{}: {from} does not give it: {reason}", file.display())]
    Download {
        /// The file.
        file: PathBuf,
        /// Its address.
        from: String,
        /// Why.
        reason: String,
    },
    /// What is there, or what came, is another file.
    #[error("{}: SHA-256 is {found}, expected {expected}{}", file.display(), if *came { "; it was not kept" } else { "" })]
    Checksum {
        /// The file.
        file: PathBuf,
        /// What the file of models says.
        expected: String,
        /// What it is.
        found: String,
        /// Whether it came just now.
        came: bool,
    },
    /// It cannot be read or written.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Holds a file that is there to its checksum.
///
/// # Errors
/// [`FetchError::Missing`], [`FetchError::Checksum`], [`FetchError::Io`].
pub fn find_file(wanted: &NetworkFile) -> Result<Fetched, FetchError> {
    if !wanted.file.exists() {
        return Err(FetchError::Missing { file: wanted.file.clone(), from: wanted.source.clone() });
    }
    check(wanted, &wanted.file, false).map(|sum| told(wanted, false, sum))
}

/// Gets a file unless it is there, and holds it to its checksum. What is half there appears under another name.
///
/// # Errors
/// [`FetchError`].
pub fn fetch(wanted: &NetworkFile) -> Result<Fetched, FetchError> {
    let file = &wanted.file;
    let io_error = |source| FetchError::Io { file: file.clone(), source };
    if file.exists() {
        return find_file(wanted);
    }
    let Some(address) = wanted.find_address() else {
        return Err(FetchError::NoAddress { file: file.clone(), from: wanted.source.clone() });
    };
    let folder = file.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(io_error)?;
    let mut part = file.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let mut out = File::create(&part).map_err(io_error)?;
    let came = download(address, &mut out)
        .and_then(|()| out.flush().and_then(|()| out.sync_all()).map_err(|error| error.to_string()))
        .map_err(|reason| FetchError::Download { file: file.clone(), from: address.to_owned(), reason })
        .and_then(|()| check(wanted, &part, true));
    let sum = came.inspect_err(|_| {
        // What cannot be used is not kept; the error is the one to tell.
        let _ = std::fs::remove_file(&part);
    })?;
    std::fs::rename(&part, file).map_err(io_error)?;
    Ok(told(wanted, true, sum))
}

fn told(wanted: &NetworkFile, is_new: bool, sha256: String) -> Fetched {
    let NetworkFile { file, licence, .. } = wanted.clone();
    Fetched { file, is_new, sha256, is_checked: wanted.sha256.is_some(), licence }
}

fn check(wanted: &NetworkFile, file: &Path, came: bool) -> Result<String, FetchError> {
    let found = digest_of(file).map_err(|source| FetchError::Io { file: wanted.file.clone(), source })?;
    match &wanted.sha256 {
        Some(expected) if *expected != found => {
            Err(FetchError::Checksum { file: wanted.file.clone(), expected: expected.clone(), found, came })
        }
        _ => Ok(found),
    }
}

/// SHA-256 of a file, in hexadecimal digits.
fn digest_of(file: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    let (mut file, mut part) = (File::open(file)?, vec![0; 1 << 16]);
    loop {
        match file.read(&mut part)? {
            0 => break,
            count => hash.update(&part[..count]),
        }
    }
    Ok(hash.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    }))
}
