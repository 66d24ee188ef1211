//! `dsm models check FILE`: whether the server of a file of models answers.

use super::ResultArgs;
use std::path::PathBuf;

/// Commands on models.
#[derive(Debug, clap::Subcommand)]
pub enum ModelsCommand {
    /// Ask the server of a file of models a few small questions: whether it answers, keeps to a form, and sees.
    Check {
        /// A file of models; docs/models.md describes it.
        file: PathBuf,
        #[command(flatten)]
        result: ResultArgs,
    },
}

/// Runs a command on models; code 1 when a check found something.
#[cfg(feature = "models")]
pub(super) fn run(command: ModelsCommand) -> anyhow::Result<u8> {
    let ModelsCommand::Check { file, result } = command;
    let client = dsm_models::open_afresh(&file).map_err(|error| crate::error::TaskError::Usage(error.to_string()))?;
    let knowledge = crate::assemble::knowledge()?;
    let checked =
        dsm_models::check(&client, &knowledge).map_err(|error| crate::error::TaskError::Internal(error.to_string()))?;
    super::Output::new(result).give(&checked, || describe(&checked))?;
    Ok(u8::from(!checked.passed))
}

/// Says how to get what is missing.
#[cfg(not(feature = "models"))]
pub(super) fn run(command: ModelsCommand) -> anyhow::Result<u8> {
    let ModelsCommand::Check { file, .. } = command;
    crate::language::find_language(&file.to_string_lossy())?;
    Ok(0)
}

#[cfg(feature = "models")]
fn describe(checked: &dsm_models::Checked) -> String {
    let mut text = format!("{} at {}\n", checked.model, checked.url);
    for check in &checked.checks {
        let mark = if check.passed { "ok  " } else { "FAIL" };
        text += &format!("  {mark} {}: {}\n", check.name, check.found);
    }
    let schema = serde_json::to_value(checked.schema).unwrap_or_default();
    let spent = &checked.spent;
    text + &format!(
        "form of answers: {}; {} requests, {} tokens read, {} written, {:.4} US dollars",
        schema.as_str().unwrap_or("?"),
        spent.requests,
        spent.input_tokens,
        spent.output_tokens,
        spent.cost_usd
    )
}
