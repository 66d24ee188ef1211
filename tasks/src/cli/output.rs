//! Results on stdout and in files.

use super::{OutArgs, ResultArgs};
use crate::error::TaskError;
use dsm::store::{WholeFile, write_atomically};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Gives results as the flags ask for.
pub struct Output {
    args: ResultArgs,
}

impl Output {
    /// For one command.
    pub fn new(args: ResultArgs) -> Self {
        Self { args }
    }

    /// Gives `result`: as JSON when asked for, else `text`.
    pub fn give<T: Serialize>(&self, result: &T, text: impl FnOnce() -> String) -> Result<(), TaskError> {
        let json = to_json(result)?;
        if let Some(path) = &self.args.report {
            write_atomically(path, json.as_bytes())?;
        }
        print(&if self.args.json { json } else { text() })
    }
}

/// Pretty JSON with a newline at the end.
pub(super) fn to_json<T: Serialize>(value: &T) -> Result<String, TaskError> {
    let mut text = serde_json::to_string_pretty(value).map_err(|e| TaskError::Internal(e.to_string()))?;
    text.push('\n');
    Ok(text)
}

/// Writes to stdout; a closed pipe is no error.
pub(super) fn print(text: &str) -> Result<(), TaskError> {
    let end = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
    match write!(std::io::stdout().lock(), "{text}{end}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(TaskError::Read { path: "stdout".into(), source: error })
        }
        _ => Ok(()),
    }
}

/// Checks that a file can be written where it is wanted, so that no work is lost in the end.
pub(super) fn check_file(path: &Path) -> Result<(), TaskError> {
    WholeFile::create(path).map(drop).map_err(TaskError::from)
}

/// Prepares an output folder, by default the given one: it must be empty or new unless forced.
///
/// # Errors
/// [`TaskError::OutputExists`] when it is in the way; a folder that cannot be read or made.
pub fn prepare_folder(args: &OutArgs, default: &Path) -> Result<PathBuf, TaskError> {
    let folder = args.out.clone().unwrap_or_else(|| default.to_owned());
    let read = |source| TaskError::Read { path: folder.clone(), source };
    if folder.exists() && !folder.is_dir() {
        return Err(TaskError::Usage(format!("{}: is a file; --out needs a folder", folder.display())));
    }
    let occupied = folder.is_dir() && std::fs::read_dir(&folder).map_err(read)?.next().is_some();
    if occupied && !args.force {
        return Err(TaskError::OutputExists { path: folder });
    }
    if occupied {
        // Only what a run writes is removed, so that --force on a wrong folder loses nothing else.
        for name in ["summary.json", "timing.json", "map.dsm", "report.html", "suite.json", "done.json"] {
            match std::fs::remove_file(folder.join(name)) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(read(error)),
                _ => {}
            }
        }
    }
    std::fs::create_dir_all(&folder).map_err(read)?;
    Ok(folder)
}

/// Prepares the folder of a scene: it must be empty or new unless forced.
pub(super) fn prepare_scene_folder(folder: &Path, force: bool) -> Result<(), TaskError> {
    let read = |source| TaskError::Read { path: folder.to_owned(), source };
    if folder.exists() && !folder.is_dir() {
        return Err(TaskError::Usage(format!("{}: is a file; --out needs a folder", folder.display())));
    }
    let occupied = folder.is_dir() && std::fs::read_dir(folder).map_err(read)?.next().is_some();
    if occupied && !force {
        return Err(TaskError::OutputExists { path: folder.to_owned() });
    }
    if occupied {
        // Only what a scene consists of is removed, so that --force on a wrong folder loses nothing else.
        for name in ["scene.xml", "semantics.toml"] {
            match std::fs::remove_file(folder.join(name)) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(read(error)),
                _ => {}
            }
        }
    }
    std::fs::create_dir_all(folder).map_err(read)
}

/// Prepares the folder of a suite: as [`prepare_folder`], but what a suite began may be continued.
pub(super) fn prepare_suite_folder(args: &OutArgs, default: &Path) -> Result<PathBuf, TaskError> {
    /// Says that a folder is a suite's.
    const MARK: &str = ".dsm-suite";
    let folder = args.out.clone().unwrap_or_else(|| default.to_owned());
    let known = folder.join(MARK).is_file();
    let folder = prepare_folder(&OutArgs { out: Some(folder), force: args.force || known }, default)?;
    write_atomically(&folder.join(MARK), b"")?;
    Ok(folder)
}
