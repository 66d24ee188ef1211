//! A suite that is carried out elsewhere: what is to be run, as a list, and the report from what was run.
//!
//! ```text
//! dsm suite ... --plan ──list──▶ others run `dsm suite FILE --seeds S..S+1` each and lay its folder into --out
//! dsm suite ... --gather LINES ──▶ suite.json, index.html, JUnit
//! ```

use super::suite::own_folder;
use super::suite_done::{Fingerprint, Program, find_done};
use super::suite_result::SuiteEpisode;
use crate::error::TaskError;
use crate::failure_page::{FAILURE_FILE, crash_page};
use crate::run::RunSpec;
use dsm::store::write_atomically;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What is to be run.
#[derive(Debug, Serialize)]
pub(super) struct Plan {
    /// Version of this layout.
    schema: u32,
    /// The folder of the suite.
    folder: PathBuf,
    /// The runs, in the order in which the suite would begin them.
    episodes: Vec<PlannedEpisode>,
}

/// One run, with all that decides it.
#[derive(Debug, Serialize)]
struct PlannedEpisode {
    id: String,
    seed: u64,
    /// The episode file.
    file: PathBuf,
    /// The scene's MJCF file.
    scene: PathBuf,
    robot: String,
    physics: String,
    perception: String,
    backend: String,
    time_limit_s: f64,
    /// What `done.json` of the run must hold to be taken over; null when a file cannot be read.
    fingerprint: Option<Fingerprint>,
    /// Whether it is done below `folder`.
    is_done: bool,
}

/// What is to be run; with `force` nothing is done yet.
pub(super) fn plan(specs: &[RunSpec], folder: &Path, force: bool) -> Plan {
    let program = Program::read();
    let episode = |spec: &RunSpec| {
        let fingerprint = Fingerprint::of(spec, program);
        let done = fingerprint.as_ref().and_then(|print| find_done(&own_folder(spec, folder), print));
        PlannedEpisode {
            id: spec.name.clone(),
            seed: spec.seed,
            file: spec.file.clone(),
            scene: dsm_sim::scene::scene_file(&spec.scene),
            robot: spec.robot.clone(),
            physics: spec.physics.clone(),
            perception: spec.perception.clone(),
            backend: spec.language.name().to_owned(),
            time_limit_s: spec.time_limit_s,
            is_done: done.is_some() && !force,
            fingerprint,
        }
    };
    Plan { schema: 1, folder: folder.to_owned(), episodes: specs.iter().map(episode).collect() }
}

/// The lines of the episodes that are done, or that the file tells of; the others are left out and told of.
///
/// # Errors
/// [`TaskError`]: the file cannot be read, or tells of an episode that is none of the suite's.
pub(super) fn gather(specs: &[RunSpec], folder: &Path, file: &Path) -> Result<Vec<SuiteEpisode>, TaskError> {
    let text = std::fs::read_to_string(file).map_err(|source| TaskError::Read { path: file.to_owned(), source })?;
    let mut told: Vec<SuiteEpisode> = serde_json::from_str(&text)
        .map_err(|error| TaskError::Usage(format!("{}: expected lines as in suite.json: {error}", file.display())))?;
    let program = Program::read();
    let mut lines = Vec::new();
    for spec in specs {
        let own = own_folder(spec, folder);
        let done = Fingerprint::of(spec, program).and_then(|print| find_done(&own, &print));
        let place = told.iter().position(|line| line.id == spec.name && line.seed == spec.seed);
        let told = place.map(|place| told.swap_remove(place));
        if done.is_none()
            && let Some(line) = &told
            && !own.join(FAILURE_FILE).is_file()
        {
            let page = crash_page(spec, line.reason.as_deref().unwrap_or_default());
            std::fs::create_dir_all(&own).map_err(|source| TaskError::Read { path: own.clone(), source })?;
            write_atomically(&own.join(FAILURE_FILE), page.as_bytes())?;
        }
        lines.extend(done.or(told));
    }
    if let Some(line) = told.first() {
        let reason = format!("{}: {} with seed {} is no episode of this suite", file.display(), line.id, line.seed);
        return Err(TaskError::Usage(reason));
    }
    if lines.len() < specs.len() {
        tracing::warn!("{} of {} episodes were not run", specs.len() - lines.len(), specs.len());
    }
    Ok(lines)
}
