//! What an episode of a suite leaves behind so that it is not run again: `done.json`, written last.

use super::output::to_json;
use super::suite_result::SuiteEpisode;
use crate::error::TaskError;
use crate::run::RunSpec;
use dsm::store::write_atomically;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the file.
const DONE_FILE: &str = "done.json";

/// All that decides an episode, as one number: the program, the run's settings, and the files of its scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
    /// Reads the running executable.
    pub(super) fn read() -> Self {
        let bytes = std::env::current_exe().and_then(std::fs::read);
        Self(bytes.ok().map(|bytes| hash(BASIS, &bytes)))
    }
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
    //! Contract: only a whole episode of the same fingerprint is taken over.
    use super::*;
    use crate::summary::Stage;

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
