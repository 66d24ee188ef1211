//! What the scenario tests share: finding episodes and running them without a display, and reading the documentation.

pub mod commands;
pub mod markdown;
pub mod reference;

use anyhow::{Context, Result};
use dsm_tasks::cli::{WorldArgs, prepare};
use dsm_tasks::run::{Finished, RunSpec, Silent, run_episode};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The repository's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// An episode of the apartment, ready to run with a seed.
pub fn apartment(episode: &str, seed: u64) -> Result<RunSpec> {
    episode_of("apartment", episode, seed)
}

/// An episode of one of the scenes, ready to run with a seed.
pub fn episode_of(scene: &str, episode: &str, seed: u64) -> Result<RunSpec> {
    let file = root().join("scenes").join(scene).join("episodes").join(format!("{episode}.toml"));
    let world = WorldArgs { seed: Some(seed), ..WorldArgs::default() };
    let (spec, _) = prepare(&file, &world).with_context(|| file.display().to_string())?;
    Ok(spec)
}

/// Runs an episode; its map is written to `map_file`.
pub fn run(spec: &RunSpec, map_file: &Path) -> Result<Finished> {
    Ok(run_episode(spec, Some(map_file), Arc::new(AtomicBool::new(false)), Box::new(Silent))?)
}
