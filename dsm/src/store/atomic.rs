//! Files appear whole or not at all.

use super::StoreError;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file that takes its name when it is whole. Until then it grows beside it as `NAME.*.part`; that is deleted when it is
/// given up, and stays where the process is killed.
pub struct WholeFile {
    path: PathBuf,
    part: NamedTempFile,
}

impl WholeFile {
    /// Begins a file.
    ///
    /// # Errors
    /// [`StoreError::Io`]: its folder cannot be written, or its name is that of a folder.
    pub fn create(path: &Path) -> Result<Self, StoreError> {
        let io = |source| StoreError::Io { path: path.to_owned(), source };
        let (Some(name), false) = (path.file_name(), path.is_dir()) else {
            return Err(io(std::io::ErrorKind::IsADirectory.into()));
        };
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
        let mut prefix = name.to_owned();
        prefix.push(".");
        let part = tempfile::Builder::new().prefix(&prefix).suffix(".part").tempfile_in(folder).map_err(io)?;
        Ok(Self { path: path.to_owned(), part })
    }

    /// Gives the file its name; whatever had that name is replaced.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn finish(self) -> Result<(), StoreError> {
        let Self { path, part } = self;
        let io = |source| StoreError::Io { path: path.clone(), source };
        part.as_file().sync_data().map_err(io)?;
        // Temporary files are private; a result is readable by everyone, like any other new file.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            part.as_file().set_permissions(std::fs::Permissions::from_mode(0o644)).map_err(io)?;
        }
        part.persist(&path).map_err(|error| io(error.error))?;
        Ok(())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.part.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.part.flush()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.part.seek(to)
    }
}

/// Writes `bytes` to a temporary file in the same folder and renames it to `path`.
///
/// # Errors
/// [`StoreError::Io`].
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let mut file = WholeFile::create(path)?;
    file.write_all(bytes).map_err(|source| StoreError::Io { path: path.to_owned(), source })?;
    file.finish()
}

#[cfg(test)]
mod tests {
    //! Contract: a file that is given up leaves what was there before, and nothing beside it.
    use super::*;

    #[test]
    fn a_file_has_its_name_when_it_is_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("map.dsm");
        let names = || std::fs::read_dir(folder.path()).expect("a folder").count();
        write_atomically(&path, b"old").expect("written");
        let mut given_up = WholeFile::create(&path).expect("begun");
        given_up.write_all(b"new").expect("written");
        assert_eq!((std::fs::read(&path).expect("old"), names()), (b"old".to_vec(), 2));
        drop(given_up);
        assert_eq!(names(), 1);
        write_atomically(&path, b"new").expect("written");
        assert_eq!((std::fs::read(&path).expect("new"), names()), (b"new".to_vec(), 1));
        assert!(WholeFile::create(folder.path()).is_err());
    }
}
