//! What a run uses, and where each value came from: flag > environment > episode > robot.toml > default.

use crate::cli::{PerceptionChoice, PhysicsChoice, WorldArgs};
use crate::engine::find_engine;
use crate::episode::Episode;
use crate::error::TaskError;
use crate::language::EMBEDDED;
use clap::ValueEnum;
use serde::Serialize;
use std::str::FromStr;

/// Where a value came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// A flag on the command line.
    Flag,
    /// An environment variable.
    Environment,
    /// The episode file.
    Episode,
    /// `robot.toml`.
    Robot,
    /// Built in.
    Default,
}

/// A value with its source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sourced<T> {
    /// The value.
    pub value: T,
    /// Where it came from.
    pub source: Source,
}

/// The settings of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Seed of every draw.
    pub seed: Sourced<u64>,
    /// Robot by name or path.
    pub robot: Sourced<String>,
    /// Physics engine.
    pub physics: Sourced<String>,
    /// Perception preset.
    pub perception: Sourced<String>,
    /// Backend of language.
    pub backend: Sourced<String>,
    /// Worker threads.
    pub threads: Sourced<u16>,
    /// Simulated time limit, seconds.
    pub time_limit_s: Sourced<f64>,
}

impl Settings {
    /// Resolves the settings. `explicit` tells which keys the episode file really holds.
    pub fn resolve(
        args: &WorldArgs,
        episode: Option<&Episode>,
        explicit: &dyn Fn(&str) -> bool,
    ) -> Result<Self, TaskError> {
        let from_episode = |key: &str| if explicit(key) { Source::Episode } else { Source::Default };
        let physics_word =
            |c: PhysicsChoice| c.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default();
        let perception_word =
            |c: PerceptionChoice| c.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default();
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get().min(256) as u16);
        let settings = Self {
            seed: pick(
                args.seed,
                "DSM_SEED",
                Sourced { value: episode.map_or(0, |e| e.seed), source: from_episode("seed") },
            )?,
            robot: pick(
                args.robot.clone(),
                "DSM_ROBOT",
                Sourced { value: episode.map_or("porter".into(), |e| e.robot.clone()), source: from_episode("robot") },
            )?,
            physics: pick(args.physics.map(physics_word), "DSM_PHYSICS", default("rapier".to_owned()))?,
            perception: pick(args.perception.map(perception_word), "DSM_PERCEPTION", default("noisy".to_owned()))?,
            backend: pick(args.backend.clone(), "DSM_BACKEND", default(EMBEDDED.to_owned()))?,
            threads: pick(args.threads, "DSM_THREADS", default(cores))?,
            time_limit_s: pick(
                args.time_limit_s,
                "DSM_TIME_LIMIT_S",
                Sourced { value: episode.map_or(240.0, |e| e.time_limit_s), source: from_episode("time_limit_s") },
            )?,
        };
        settings.check()?;
        Ok(settings)
    }

    fn check(&self) -> Result<(), TaskError> {
        let limit = self.time_limit_s.value;
        if !(1.0..=36_000.0).contains(&limit) {
            return Err(TaskError::Usage(format!("time_limit_s is {limit}; expected 1 to 36000 seconds")));
        }
        if !(1..=256).contains(&self.threads.value) {
            return Err(TaskError::Usage(format!("threads is {}; expected 1 to 256", self.threads.value)));
        }
        if PerceptionChoice::from_str(&self.perception.value, false).is_err() {
            return Err(TaskError::Usage(format!(
                "perception is `{}`; expected noisy, oracle or pixels",
                self.perception.value
            )));
        }
        find_engine(&self.physics.value).map(|_| ())
    }
}

fn default<T>(value: T) -> Sourced<T> {
    Sourced { value, source: Source::Default }
}

fn pick<T: FromStr>(flag: Option<T>, variable: &str, below: Sourced<T>) -> Result<Sourced<T>, TaskError> {
    if let Some(value) = flag {
        return Ok(Sourced { value, source: Source::Flag });
    }
    match std::env::var(variable) {
        Ok(text) => match text.trim().parse() {
            Ok(value) => Ok(Sourced { value, source: Source::Environment }),
            Err(_) => {
                Err(TaskError::Usage(format!("environment variable {variable} is `{text}`, which cannot be read")))
            }
        },
        Err(_) => Ok(below),
    }
}
