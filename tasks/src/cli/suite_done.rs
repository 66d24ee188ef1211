//! What an episode of a suite leaves behind so that it is not run again: `done.json`, written last.

use super::output::to_json;
use super::suite_result::SuiteEpisode;
use crate::error::TaskError;
use crate::run::RunSpec;
use dsm::store::write_atomically;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the file.
const DONE_FILE: &str = "done.json";

/// All that decides an episode, as one number: the program, the run's settings, and the files of its scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub(super) struct Fingerprint(String);

#[derive(Serialize, Deserialize)]
struct Done {
    fingerprint: Fingerprint,
    line: SuiteEpisode,
}

impl Fingerprint {
    /// `None` when the program or a file of the scene cannot be read: then nothing is taken over.
    pub(super) fn of(spec: &RunSpec, program: Program) -> Option<Self> {
        let scene = dsm_sim::scene::scene_file(&spec.scene);
        // Where the episode file lies decides nothing.
        let settings = format!(
            "{} {:?} {} {} {} {} {} {} {}",
            program.0?,
            spec.episode,
            spec.name,
            spec.robot,
            spec.physics,
            spec.perception,
            spec.language.name(),
            spec.seed,
            spec.time_limit_s
        );
        let mut hash = hash(BASIS, settings.as_bytes());
        hash = self::hash(hash, &std::fs::read(&scene).ok()?);
        // A scene may do without semantics.
        hash = self::hash(hash, &std::fs::read(scene.with_file_name("semantics.toml")).unwrap_or_default());
        Some(Self(format!("{hash:016x}")))
    }
}

/// The program that runs, as one number; nothing when it cannot be read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Program(Option<u64>);

impl Program {
    /// Reads the file that holds this code: the running executable, or the library that Python has loaded.
    pub(super) fn read() -> Self {
        let file = find_own_library().map_or_else(std::env::current_exe, Ok);
        Self(file.and_then(std::fs::read).ok().map(|bytes| hash(BASIS, &bytes)))
    }
}

/// The file from which Linux has loaded this function; `None` elsewhere.
fn find_own_library() -> Option<PathBuf> {
    let here = find_own_library as fn() -> Option<PathBuf> as usize;
    // A line is `FROM-TO FLAGS OFFSET DEVICE INODE    PATH`.
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    maps.lines().find_map(|line| {
        let (range, rest) = line.split_once(' ')?;
        let (from, to) = range.split_once('-')?;
        let (from, to) = (usize::from_str_radix(from, 16).ok()?, usize::from_str_radix(to, 16).ok()?);
        let path = rest.find('/').map(|at| PathBuf::from(&rest[at..]));
        path.filter(|_| (from..to).contains(&here))
    })
}

/// Where FNV-1a begins.
const BASIS: u64 = 0xcbf2_9ce4_8422_2325;

/// FNV-1a over the bytes and their number.
fn hash(begin: u64, bytes: &[u8]) -> u64 {
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.len().to_le_bytes().iter().fold(bytes.iter().fold(begin, step), step)
}

/// The line of an episode that is done and whole: its summary is there, too.
pub(super) fn find_done(folder: &Path, fingerprint: &Fingerprint) -> Option<SuiteEpisode> {
    let text = std::fs::read_to_string(folder.join(DONE_FILE)).ok()?;
    let done: Done = serde_json::from_str(&text).ok()?;
    (done.fingerprint == *fingerprint && folder.join("summary.json").is_file()).then_some(done.line)
}

/// Notes that an episode is done.
pub(super) fn write_done(folder: &Path, fingerprint: &Fingerprint, line: &SuiteEpisode) -> Result<(), TaskError> {
    let done = Done { fingerprint: fingerprint.clone(), line: line.clone() };
    Ok(write_atomically(&folder.join(DONE_FILE), to_json(&done)?.as_bytes())?)
}

#[cfg(test)]
mod tests {
    //! Contract: only a whole episode of the same fingerprint is taken over; the program is the file that holds this code.
    use super::*;
    use crate::summary::Stage;

    #[test]
    fn the_code_is_found_in_the_program_that_runs_it() {
        assert_eq!(find_own_library(), std::env::current_exe().ok());
    }

    #[test]
    fn only_a_whole_episode_of_the_same_fingerprint_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let (one, other) = (Fingerprint("1".into()), Fingerprint("2".into()));
        let line = SuiteEpisode::without_metrics("a", 3, Stage::Hold, "lost".into());
        write_done(folder.path(), &one, &line).unwrap();
        assert_eq!(find_done(folder.path(), &one), None, "no summary");
        std::fs::write(folder.path().join("summary.json"), "{}").unwrap();
        assert_eq!(find_done(folder.path(), &one), Some(line));
        assert_eq!(find_done(folder.path(), &other), None);
        std::fs::write(folder.path().join(DONE_FILE), "{").unwrap();
        assert_eq!(find_done(folder.path(), &one), None, "a broken file is no file");
    }
}
