//! Recordings kept as regression tests: a folder with the recording and what its replay has to come to.

use super::entry::Noted;
use super::play::Played;
use super::report::{Differing, FirstDifference};
use crate::error::TaskError;
use dsm::config::{ConfigError, line_of, parse_toml};
use dsm::store::{digest_bytes, encode_map, write_atomically};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Name of the file that tells what is expected.
const TEST_FILE: &str = "replay.toml";
/// Name of the recording beside it.
const RECORDING_FILE: &str = "run.mcap";
/// Version of [`TEST_FILE`].
const VERSION: u32 = 1;

/// `replay.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegressionTest {
    /// Format version; 1.
    pub version: u32,
    /// The recording; relative to this file.
    pub recording: PathBuf,
    /// Digest of the recording's bytes, 16 hexadecimal digits: another file is another test.
    pub recording_digest: String,
    /// Digest of the map's bytes after the replay, 16 hexadecimal digits.
    pub map_digest: String,
    /// Stable objects of the map.
    pub map_objects: usize,
    /// Events, in order.
    #[serde(default, rename = "decision")]
    pub decisions: Vec<Decision>,
}

/// An event that is expected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// When, nanoseconds from the run's start.
    pub at_ns: i64,
    /// What, in words.
    pub what: String,
}

impl From<&Noted> for Decision {
    fn from(noted: &Noted) -> Self {
        Self { at_ns: noted.stamp.0, what: noted.what.clone() }
    }
}

/// Writes a regression test of a recording and of what its replay came to.
///
/// # Errors
/// [`TaskError`]: the folder holds something, or cannot be written.
pub fn write_test(recording: &Path, played: &Played, folder: &Path) -> Result<(), TaskError> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| TaskError::Read { path, source }
    };
    if folder.exists() && std::fs::read_dir(folder).map_err(io(folder))?.next().is_some() {
        return Err(TaskError::OutputExists { path: folder.to_owned() });
    }
    std::fs::create_dir_all(folder).map_err(io(folder))?;
    let copy = folder.join(RECORDING_FILE);
    std::fs::copy(recording, &copy).map_err(io(&copy))?;
    let test = RegressionTest {
        version: VERSION,
        recording: RECORDING_FILE.into(),
        recording_digest: digest_file(&copy)?,
        map_digest: format!("{:016x}", digest_bytes(&encode_map(&played.map))),
        map_objects: played.map.stable_objects().count(),
        decisions: played.events.iter().map(Decision::from).collect(),
    };
    let text = toml::to_string(&test).map_err(|error| TaskError::Internal(error.to_string()))?;
    let text =
        format!("# A recorded run and what it comes to. `dsm replay` of this folder replays it and compares.\n{text}");
    Ok(write_atomically(&folder.join(TEST_FILE), text.as_bytes())?)
}

/// Reads a regression test; gives its recording, too.
///
/// # Errors
/// [`TaskError`]: a wrong file, or another recording than that of the test.
pub fn load_test(folder: &Path) -> Result<(RegressionTest, PathBuf), TaskError> {
    let file = folder.join(TEST_FILE);
    let text = std::fs::read_to_string(&file).map_err(|source| TaskError::Read { path: file.clone(), source })?;
    let test: RegressionTest = parse_toml(&text, &file)?;
    let wrong = |key: &str, message: String| {
        let line = line_of(&text, text.find(key).unwrap_or(0));
        TaskError::Config(ConfigError::Invalid { file: file.clone(), line, message })
    };
    if test.version != VERSION {
        return Err(wrong("version", format!("version {} is not known, expected {VERSION}", test.version)));
    }
    let recording = folder.join(&test.recording);
    let digest = digest_file(&recording)?;
    if digest != test.recording_digest {
        return Err(wrong("recording_digest", format!("{} has the digest {digest}", recording.display())));
    }
    Ok((test, recording))
}

impl RegressionTest {
    /// Where a replay first differs from what is expected here.
    pub fn find_differences(&self, played: &Played) -> Vec<FirstDifference> {
        let mut found = Vec::new();
        let got: Vec<Decision> = played.events.iter().map(Decision::from).collect();
        let place = (0..self.decisions.len().max(got.len())).find(|&at| self.decisions.get(at) != got.get(at));
        if let Some(place) = place {
            let (expected, got) = (self.decisions.get(place), got.get(place));
            let words =
                |decision: Option<&Decision>| decision.map_or("no further event".to_owned(), |d| d.what.clone());
            found.push(FirstDifference {
                of: Differing::Decision,
                part: format!("decision {place} of {TEST_FILE}"),
                stamp_s: expected.or(got).map_or(0.0, |decision| decision.at_ns as f64 * 1e-9),
                expected: words(expected),
                got: words(got),
            });
        }
        let digest = format!("{:016x}", digest_bytes(&encode_map(&played.map)));
        if digest != self.map_digest {
            found.push(FirstDifference {
                of: Differing::Map,
                part: format!("map_digest of {TEST_FILE}"),
                stamp_s: played.report.sim_time_s,
                expected: format!("{}, {} stable objects", self.map_digest, self.map_objects),
                got: format!("{digest}, {} stable objects", played.map.stable_objects().count()),
            });
        }
        found
    }
}

/// Digest of the digests of a file's mebibytes.
fn digest_file(path: &Path) -> Result<String, TaskError> {
    const PIECE: u64 = 1 << 20;
    let io = |source| TaskError::Read { path: path.to_owned(), source };
    let mut file = std::fs::File::open(path).map_err(io)?;
    let (mut piece, mut digests) = (Vec::new(), Vec::new());
    loop {
        piece.clear();
        if file.by_ref().take(PIECE).read_to_end(&mut piece).map_err(io)? == 0 {
            return Ok(format!("{:016x}", digest_bytes(&digests)));
        }
        digests.extend(digest_bytes(&piece).to_le_bytes());
    }
}
