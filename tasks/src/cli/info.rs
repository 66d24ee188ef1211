//! `dsm config show`, `dsm completions`, `dsm schema`.

use super::output::{print, to_json};
use super::suite_result::Suite;
use super::{Cli, Output, ResultArgs, WorldArgs};
use crate::episode::Episode;
use crate::error::TaskError;
use crate::settings::Settings;
use crate::summary::Summary;
use clap::CommandFactory;
use dsm_robot::model::RobotSettings;
use dsm_sim::scene::Semantics;
use std::path::PathBuf;

/// Commands on the configuration.
#[derive(Debug, clap::Subcommand)]
pub enum ConfigCommand {
    /// Show every value with where it came from.
    Show {
        /// An episode file.
        episode: Option<PathBuf>,
        #[command(flatten)]
        world: WorldArgs,
        #[command(flatten)]
        result: ResultArgs,
    },
}

/// What a schema is wanted of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum SchemaKind {
    /// Episode files.
    Episode,
    /// robot.toml.
    Robot,
    /// semantics.toml.
    Semantics,
    /// summary.json.
    Summary,
    /// suite.json.
    Suite,
}

/// Runs a config command.
pub(super) fn config(command: ConfigCommand) -> anyhow::Result<u8> {
    let ConfigCommand::Show { episode: file, world, result } = command;
    let episode = file.as_deref().map(Episode::load).transpose()?;
    let text = file.as_deref().map(std::fs::read_to_string).transpose()?.unwrap_or_default();
    let settings = Settings::resolve(&world, episode.as_ref(), &|key| holds_key(&text, key))?;
    Output::new(result).give(&settings, || {
        let value = serde_json::to_value(&settings).unwrap_or_default();
        let lines = value.as_object().into_iter().flatten().map(|(key, entry)| {
            format!("{key} = {}  # {}\n", entry["value"], entry["source"].as_str().unwrap_or_default())
        });
        lines.collect()
    })?;
    Ok(0)
}

/// Whether a TOML text sets a top-level key.
pub(super) fn holds_key(text: &str, key: &str) -> bool {
    text.parse::<toml::Table>().is_ok_and(|table| table.contains_key(key))
}

/// Prints shell completions.
pub(super) fn completions(shell: clap_complete::Shell) -> anyhow::Result<u8> {
    let mut bytes = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "dsm", &mut bytes);
    print(&String::from_utf8_lossy(&bytes))?;
    Ok(0)
}

/// Prints a JSON schema.
pub(super) fn schema(kind: SchemaKind) -> anyhow::Result<u8> {
    print(&to_json(&schema_value(kind)).map_err(|e| TaskError::Internal(e.to_string()))?)?;
    Ok(0)
}

/// The JSON schema of a kind of file.
pub fn schema_value(kind: SchemaKind) -> serde_json::Value {
    let schema = match kind {
        SchemaKind::Episode => schemars::schema_for!(Episode),
        SchemaKind::Robot => schemars::schema_for!(RobotSettings),
        SchemaKind::Semantics => schemars::schema_for!(Semantics),
        SchemaKind::Summary => schemars::schema_for!(Summary),
        SchemaKind::Suite => schemars::schema_for!(Suite),
    };
    schema.to_value()
}
