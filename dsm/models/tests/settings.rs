//! Contract: the files that ship are valid; what is wrong in a file is told with file, line, range or the nearest key; a key
//! comes from the environment alone.

#![allow(clippy::unwrap_used, reason = "a test that cannot write its files fails")]

use dsm_models::{Answers, LanguageSettings, ModelSettings, Use};
use std::path::{Path, PathBuf};

const GOOD: &str = "version = 1\n[language]\nurl = \"http://127.0.0.1:8080/v1\"\nmodel = \"m\"\n";

fn load(text: &str) -> Result<ModelSettings, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("models.toml");
    std::fs::write(&file, text).unwrap();
    ModelSettings::load(&file).map_err(|error| error.to_string())
}

#[test]
fn the_files_that_ship_are_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/models");
    let files: Vec<PathBuf> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    let files: Vec<&PathBuf> = files.iter().filter(|file| file.extension().is_some_and(|e| e == "toml")).collect();
    assert!(files.len() >= 3, "{files:?}");
    for file in files {
        let settings = ModelSettings::load(file).unwrap();
        assert!(
            settings.language.and_then(|language| language.cache).is_none_or(|cache| cache.starts_with(&folder)),
            "paths are taken from the file's folder"
        );
    }
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    assert_eq!(load(GOOD).unwrap().language, Some(LanguageSettings::new("http://127.0.0.1:8080/v1", "m")));
    for (line, fragments) in [
        ("timout_s = 3", ["models.toml:5", "did you mean `timeout_s`?"]),
        ("timeout_s = 0", ["models.toml:5", ">= 0.05"]),
        ("retries = 11", ["models.toml:5", "<= 10"]),
        ("schema = \"jsonschema\"", ["models.toml:5", "json_schema"]),
        ("uses = [\"parse\", \"grasp\"]", ["models.toml:5", "verify"]),
        ("uses = []", ["models.toml:5", "at least 1"]),
        ("budget_usd = -1", ["models.toml:5", ">= 0"]),
        ("max_response_bytes = 100000000000", ["models.toml:5", "<= 16777216"]),
        ("key = \"sk-123\"", ["models.toml:5", "unknown key"]),
        ("key_env = \"sk-123-abc\"", ["models.toml", "not a key"]),
        ("[language.frames]\nlatency_s = -1", ["models.toml:6", ">= 0"]),
    ] {
        let error = load(&format!("{GOOD}{line}\n")).unwrap_err();
        assert!(fragments.iter().all(|fragment| error.contains(fragment)), "{line}: {error}");
        assert!(!error.contains("sk-123-abc"), "{error}");
    }
    for (good, bad) in [
        ("version = 1", "version = 2"),
        ("http://127.0.0.1:8080/v1", "127.0.0.1:8080"),
        ("http://127.0.0.1:8080/v1", "http://user:word@example.org/v1"),
        ("http://127.0.0.1:8080/v1", "http:///v1"),
        ("http://127.0.0.1:8080/v1", "file:///etc/passwd"),
        ("model = \"m\"", "model = \" \""),
    ] {
        assert!(load(&GOOD.replace(good, bad)).is_err(), "{bad}");
    }
}

#[test]
fn a_key_comes_from_the_environment_alone() {
    let mut settings = LanguageSettings::new("http://127.0.0.1:8080/v1", "m");
    let file = Path::new("models.toml");
    assert_eq!(settings.get_key(file).unwrap(), None);
    settings.key_env = Some("DSM_TEST_KEY_THAT_NOBODY_SETS".into());
    let error = settings.get_key(file).unwrap_err().to_string();
    assert!(error.contains("models.toml") && error.contains("DSM_TEST_KEY_THAT_NOBODY_SETS"), "{error}");
    settings.answers = Answers::Cached;
    assert_eq!(settings.get_key(file).unwrap(), None, "what is cached needs no key");
}

#[test]
fn a_model_without_eyes_is_asked_for_words_alone() {
    let mut settings = LanguageSettings::new("http://127.0.0.1:8080/v1", "m");
    assert!(Use::all().into_iter().all(|wanted| settings.serves(wanted)));
    settings.vision = false;
    let served: Vec<Use> = Use::all().into_iter().filter(|wanted| settings.serves(*wanted)).collect();
    assert_eq!(served, [Use::Parse, Use::Score, Use::Labels]);
}
