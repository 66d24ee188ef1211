//! `dsm models check FILE`, `dsm models fetch FILE`: whether the server and the networks of a file of models can be used.

use super::ResultArgs;
use std::path::PathBuf;

/// Commands on models.
#[derive(Debug, clap::Subcommand)]
pub enum ModelsCommand {
    /// Ask the server of a file of models a few small questions, and run its networks once: whether they answer, keep to a
    /// form, and see.
    Check {
        /// A file of models; docs/models.md describes it.
        file: PathBuf,
        #[command(flatten)]
        result: ResultArgs,
    },
    /// Get the files of the networks of a file of models, and hold them to their checksums.
    Fetch {
        /// A file of models; docs/models.md describes it.
        file: PathBuf,
        #[command(flatten)]
        result: ResultArgs,
    },
}

/// Runs a command on models; code 1 when a check found something.
#[cfg(feature = "models")]
pub(super) use built_in::run;

/// Says how to get what is missing.
#[cfg(not(feature = "models"))]
pub(super) fn run(command: ModelsCommand) -> anyhow::Result<u8> {
    let (ModelsCommand::Check { file, .. } | ModelsCommand::Fetch { file, .. }) = command;
    crate::language::find_language(&file.to_string_lossy())?;
    Ok(0)
}

#[cfg(feature = "models")]
mod built_in {
    use super::ModelsCommand;
    use crate::cli::Output;
    use crate::error::TaskError;
    use dsm_models::{Checked, FetchError, Fetched, ModelSettings, NetworkFile, fetch, find_file};
    use serde::Serialize;
    use serde_json::{Value, json};
    use std::path::Path;

    /// What a check found.
    struct Found {
        /// Whether all that was tried works.
        passed: bool,
        /// The language model.
        language: Option<Checked>,
        /// The files of networks.
        files: Vec<FileFound>,
        /// The networks.
        #[cfg(feature = "onnx")]
        networks: Vec<dsm_models::onnx::Probe>,
    }

    /// A file that is there and right, or why it is not.
    #[derive(Serialize)]
    struct FileFound {
        /// Its key in the file of models.
        key: &'static str,
        /// The file.
        file: String,
        /// What it is.
        #[serde(skip_serializing_if = "Option::is_none")]
        found: Option<Fetched>,
        /// What is wrong.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<String>,
    }

    pub(in crate::cli) fn run(command: ModelsCommand) -> anyhow::Result<u8> {
        match command {
            ModelsCommand::Check { file, result } => {
                let found = check(&file)?;
                Output::new(result).give(&value_of(&found)?, || describe(&found))?;
                Ok(u8::from(!found.passed))
            }
            ModelsCommand::Fetch { file, result } => {
                let settings = load(&file)?;
                if settings.files().is_empty() {
                    return Err(TaskError::Usage(format!("{}: it asks for no network", file.display())).into());
                }
                let files = find_files(&settings, fetch);
                let passed = files.iter().all(|file| file.error.is_none());
                let told = || files.iter().map(describe_file).collect::<String>();
                Output::new(result).give(&json!({"passed": passed, "files": files}), told)?;
                Ok(u8::from(!passed))
            }
        }
    }

    fn load(file: &Path) -> Result<ModelSettings, TaskError> {
        ModelSettings::load(file).map_err(|error| TaskError::Usage(error.to_string()))
    }

    /// Every file of a network, found or got.
    fn find_files(
        settings: &ModelSettings,
        find: impl Fn(&NetworkFile) -> Result<Fetched, FetchError>,
    ) -> Vec<FileFound> {
        let look = |(key, network): (&'static str, NetworkFile)| {
            let file = network.file.display().to_string();
            match find(&network) {
                Ok(found) => FileFound { key, file, found: Some(found), error: None },
                Err(error) => FileFound { key, file, found: None, error: Some(error.to_string()) },
            }
        };
        settings.files().into_iter().map(look).collect()
    }

    /// The language model's part stands at the top, as it did before there were networks.
    fn value_of(found: &Found) -> Result<Value, TaskError> {
        let wrong = |error: serde_json::Error| TaskError::Internal(error.to_string());
        let mut value = found.language.as_ref().map_or(Ok(json!({})), serde_json::to_value).map_err(wrong)?;
        value["passed"] = found.passed.into();
        value["files"] = serde_json::to_value(&found.files).map_err(wrong)?;
        #[cfg(feature = "onnx")]
        {
            value["networks"] = serde_json::to_value(&found.networks).map_err(wrong)?;
        }
        Ok(value)
    }

    fn check(file: &Path) -> anyhow::Result<Found> {
        let settings = load(file)?;
        let knowledge = crate::assemble::knowledge()?;
        let usage = |error: dsm_models::OpenError| TaskError::Usage(error.to_string());
        let internal = |error: dsm::ground::GroundConfigError| TaskError::Internal(error.to_string());
        let client = dsm_models::open_afresh(file).map_err(usage)?;
        let language = client.map(|client| dsm_models::check(&client, &knowledge).map_err(internal)).transpose()?;
        let files = find_files(&settings, find_file);
        let sound = language.as_ref().is_none_or(|language| language.passed) && files.iter().all(|f| f.error.is_none());
        #[cfg(not(feature = "onnx"))]
        if settings.has_networks() {
            // It says how to build what is missing.
            crate::language::find_language(&file.to_string_lossy())?;
        }
        #[cfg(feature = "onnx")]
        let networks = dsm_models::onnx::probe(&settings, &knowledge);
        #[cfg(feature = "onnx")]
        let sound = sound && networks.iter().all(|network| network.passed);
        Ok(Found {
            passed: sound,
            language,
            files,
            #[cfg(feature = "onnx")]
            networks,
        })
    }

    fn describe(found: &Found) -> String {
        let mut text = found.language.as_ref().map(describe_language).unwrap_or_default();
        text.extend(found.files.iter().map(describe_file));
        #[cfg(feature = "onnx")]
        for network in &found.networks {
            let mark = if network.passed { "ok  " } else { "FAIL" };
            text += &format!("  {mark} {}: {}", network.part, network.found);
            if network.passed {
                text += &format!("; {:.2} s to load, {:.3} s to run", network.load_s, network.run_s);
            }
            text.push('\n');
        }
        text.truncate(text.trim_end().len());
        text
    }

    fn describe_file(file: &FileFound) -> String {
        match (&file.found, &file.error) {
            (Some(found), _) if found.is_checked => {
                let how = if found.is_new { "fetched, " } else { "" };
                format!("  ok   {}: {}: {how}checksum right; {}\n", file.key, file.file, found.licence)
            }
            (Some(found), _) => {
                let sum = &found.sha256;
                format!(
                    "  ok   {}: {}: no checksum to hold it to; it is sha256 = \"{sum}\"; {}\n",
                    file.key, file.file, found.licence
                )
            }
            (None, error) => format!("  FAIL {}: {}\n", file.key, error.as_deref().unwrap_or("unknown")),
        }
    }

    fn describe_language(checked: &Checked) -> String {
        let mut text = format!("{} at {}\n", checked.model, checked.url);
        for check in &checked.checks {
            let mark = if check.passed { "ok  " } else { "FAIL" };
            text += &format!("  {mark} {}: {}\n", check.name, check.found);
        }
        let schema = serde_json::to_value(checked.schema).unwrap_or_default();
        let spent = &checked.spent;
        text + &format!(
            "form of answers: {}; {} requests, {} tokens read, {} written, {:.4} US dollars\n",
            schema.as_str().unwrap_or("?"),
            spent.requests,
            spent.input_tokens,
            spent.output_tokens,
            spent.cost_usd
        )
    }
}
