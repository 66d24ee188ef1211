//! Answers on disk, named by what was asked: asked again, they cost nothing.

use crate::wire::Completion;
use dsm::store::write_atomically;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Version of the files.
const VERSION: u32 = 1;
/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 16 << 20;

/// Answers in a folder.
#[derive(Clone, Debug)]
pub(crate) struct Cache {
    folder: PathBuf,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    version: u32,
    model: String,
    completion: Completion,
}

impl Cache {
    pub(crate) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    fn path(&self, question: &str) -> PathBuf {
        self.folder.join(&question[..2]).join(format!("{question}.json"))
    }

    /// The answer to a question; a file that cannot be read is none.
    pub(crate) fn find(&self, question: &str) -> Option<Completion> {
        let path = self.path(question);
        if std::fs::metadata(&path).ok()?.len() > MAX_BYTES {
            return None;
        }
        let entry: Entry = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
        (entry.version == VERSION).then_some(entry.completion)
    }

    /// Keeps an answer. That a disk is full must not stop a robot: the answer is then asked for again.
    pub(crate) fn keep(&self, question: &str, model: &str, completion: &Completion) -> Result<(), String> {
        let path = self.path(question);
        let entry = Entry { version: VERSION, model: model.to_owned(), completion: completion.clone() };
        let text = serde_json::to_string_pretty(&entry).map_err(|error| error.to_string())?;
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|error| error.to_string())?;
        }
        write_atomically(&path, text.as_bytes()).map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    //! Contract: an answer is found by its question, and a damaged file is no answer.
    use super::*;

    #[test]
    fn answers_are_found_again() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        let question = "ab12";
        assert!(cache.find(question).is_none());
        let completion = Completion { text: "{}".into(), thought: "hm".into(), input: 3, output: 4 };
        cache.keep(question, "m", &completion).unwrap();
        assert_eq!(cache.find(question), Some(completion));
        assert!(cache.find("ab13").is_none());
        for damage in ["", "{", "{\"version\": 2, \"model\": \"m\", \"completion\": {\"text\": \"\"}}", "\u{0}"] {
            std::fs::write(folder.path().join("ab/ab12.json"), damage).unwrap();
            assert!(cache.find(question).is_none(), "{damage}");
        }
    }
}
