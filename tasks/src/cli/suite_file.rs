//! `suite.json`, read again.

use super::suite_result::{SUITE_SCHEMA, Suite, SuiteEpisode};
use crate::error::TaskError;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Name of the file in the folder of its suite.
pub(super) const SUITE_FILE: &str = "suite.json";

/// What is read of the file; its sums follow from its episodes.
#[derive(Deserialize)]
struct SuiteFile {
    schema: u32,
    episodes: Vec<SuiteEpisode>,
}

/// A suite and the folder in which its episodes lie.
pub(super) struct SuiteFolder {
    /// The folder.
    pub folder: PathBuf,
    /// What it came to, sorted by name and seed.
    pub suite: Suite,
}

impl SuiteFolder {
    /// Reads the suite of a folder, or of its `suite.json`.
    ///
    /// Fails when the file cannot be read, is of another layout, or holds an episode and seed twice.
    pub(super) fn load(path: &Path) -> Result<Self, TaskError> {
        let file = if path.is_dir() { path.join(SUITE_FILE) } else { path.to_owned() };
        let text = std::fs::read_to_string(&file).map_err(|source| TaskError::Read { path: file.clone(), source })?;
        let wrong = |line: usize, what: String| TaskError::Usage(format!("{}:{line}: {what}", file.display()));
        let read: SuiteFile = serde_json::from_str(&text).map_err(|error| wrong(error.line(), error.to_string()))?;
        if read.schema != SUITE_SCHEMA {
            return Err(wrong(1, format!("schema {} is not known; expected {SUITE_SCHEMA}", read.schema)));
        }
        let mut episodes = read.episodes;
        episodes.sort_by(|a, b| (&a.id, a.seed).cmp(&(&b.id, b.seed)));
        if let Some([twice, _]) = episodes.array_windows().find(|[a, b]| (&a.id, a.seed) == (&b.id, b.seed)) {
            return Err(wrong(1, format!("episode `{}` with seed {} stands there twice", twice.id, twice.seed)));
        }
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        Ok(Self { folder: folder.unwrap_or(Path::new(".")).to_owned(), suite: Suite::new(episodes) })
    }
}

#[cfg(test)]
mod tests {
    //! Contract: what was written is read again; another layout, a broken file and an episode that stands there twice are
    //! told with file and line.
    use super::*;
    use crate::cli::output::to_json;
    use crate::summary::Stage;

    #[test]
    fn a_suite_is_read_as_it_was_written_and_nothing_else_is() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(SUITE_FILE);
        let line = |seed| SuiteEpisode::without_metrics("a", seed, Stage::Crash, "boom".into());
        std::fs::write(&file, to_json(&Suite::new(vec![line(2), line(1)])).unwrap()).unwrap();
        for path in [folder.path(), &file] {
            let read = SuiteFolder::load(path).unwrap();
            assert_eq!((read.suite.episodes, read.folder.as_path()), (vec![line(1), line(2)], folder.path()));
        }
        let told = |text: &str| {
            std::fs::write(&file, text).unwrap();
            SuiteFolder::load(&file).err().unwrap().to_string()
        };
        let twice = to_json(&Suite::new(vec![line(1), line(1)])).unwrap();
        assert!(told(&twice).contains("suite.json:1: episode `a` with seed 1 stands there twice"));
        assert!(told("{\"schema\": 7, \"episodes\": []}").contains("schema 7 is not known; expected 1"));
        assert!(told("{\n\"schema\": 1,\n\"episodes\": [{}]}").contains("suite.json:3: missing field `id`"));
    }
}
