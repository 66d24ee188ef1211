//! What can go wrong outside a task. Expected outcomes of tasks are not errors.

use dsm::config::ConfigError;
use dsm::store::StoreError;
use dsm_robot::drivers::DriverError;
use dsm_robot::model::ModelError;
use dsm_sim::world::WorldError;
use std::path::PathBuf;
use thiserror::Error;

/// An error of the task system.
#[derive(Debug, Error)]
pub enum TaskError {
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A configuration file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Scene and robot do not make a world.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The robot's description is wrong.
    #[error(transparent)]
    Robot(#[from] ModelError),
    /// A map file or an output cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// An output folder is in the way.
    #[error("{}: the folder is not empty; choose another --out or add --force", path.display())]
    OutputExists {
        /// The folder.
        path: PathBuf,
    },
    /// A name that the scene does not have.
    #[error("{}:{line}: {what} `{name}` is not in the scene;{} known: {}", path.display(), meant(nearest), shortened(known))]
    UnknownName {
        /// The file that names it.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What kind of thing.
        what: &'static str,
        /// The name.
        name: String,
        /// The name that was probably meant.
        nearest: Option<String>,
        /// Valid names.
        known: Vec<String>,
    },
    /// A flag or value that cannot be used.
    #[error("{0}")]
    Usage(String),
    /// A part of the program that was not built in.
    #[error("{feature} is not built in; {hint}")]
    NotBuiltIn {
        /// What is missing.
        feature: String,
        /// How to get it.
        hint: String,
    },
    /// There is no robot behind ROS 2.
    #[cfg(feature = "ros2")]
    #[error(transparent)]
    Ros2(#[from] dsm_ros2::error::Ros2Error),
    /// A driver failed.
    #[error(transparent)]
    Driver(#[from] DriverError),
    /// The program contradicts itself.
    #[error("internal error: {0}")]
    Internal(String),
}

fn meant(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |name| format!(" did you mean `{name}`?"))
}

/// At most a dozen names: a flat has hundreds of bodies.
fn shortened(known: &[String]) -> String {
    let shown = known.iter().take(12).cloned().collect::<Vec<_>>().join(", ");
    match known.len() {
        0 => "none".to_owned(),
        n if n > 12 => format!("{shown} and {} more", n - 12),
        _ => shown,
    }
}

impl TaskError {
    /// What is missing without ROS 2.
    #[cfg(not(feature = "ros2"))]
    pub(crate) fn no_ros2(feature: &str) -> Self {
        Self::NotBuiltIn { feature: feature.into(), hint: "build with `--features ros2`".into() }
    }

    /// The process exit code: 2 for bad input, 3 for a safety stop or an internal error.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Driver(_) | Self::Internal(_) => 3,
            _ => 2,
        }
    }
}
