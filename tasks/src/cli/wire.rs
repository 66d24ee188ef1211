//! Flags of robots that speak ROS 2.

use crate::assemble::find_robot;
use crate::error::TaskError;
use crate::run::Drivers;
use dsm_robot::model::RobotModel;
use dsm_robot::model::ros2::{ClockSource, Ros2Settings};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// Which drivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum DriversChoice {
    /// The simulator's, in this process.
    #[default]
    Simulated,
    /// A robot that speaks ROS 2: hardware, or `dsm serve`. Needs the feature `ros2`.
    Ros2,
}

/// Which clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ClockChoice {
    /// Time stands still until whoever acts asks for more: the same run as without ROS 2, bit for bit.
    LockStep,
    /// The simulation runs by itself; whoever acts follows `/clock`.
    RealTime,
    /// The machine's clock: hardware.
    Wall,
}

impl From<ClockChoice> for ClockSource {
    fn from(choice: ClockChoice) -> Self {
        match choice {
            ClockChoice::LockStep => Self::LockStep,
            ClockChoice::RealTime => Self::Topic,
            ClockChoice::Wall => Self::Wall,
        }
    }
}

/// How a robot is reached over ROS 2. Both sides must be given the same.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct WireArgs {
    /// Take `[ros2]` from this file instead of robot.toml; see robot/ros2/surfaces.
    #[arg(long, value_name = "FILE")]
    ros2: Option<PathBuf>,
    /// DDS domain, 0 to 232 [env: ROS_DOMAIN_ID].
    #[arg(long, value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: Option<u16>,
    /// The clock, instead of that of `[ros2]`.
    #[arg(long, value_enum)]
    clock: Option<ClockChoice>,
}

/// A file of `[ros2]` alone.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Surface {
    ros2: Ros2Settings,
}

impl WireArgs {
    /// The settings for a robot by name or path. Precedence: flag, environment, file.
    pub(super) fn resolve(&self, robot: &str) -> Result<Ros2Settings, TaskError> {
        let mut settings = match &self.ros2 {
            Some(file) => dsm::config::read_toml::<Surface>(file)?.ros2,
            None => RobotModel::load(&find_robot(robot)?)?.settings.ros2,
        };
        let from_environment = || match std::env::var("ROS_DOMAIN_ID") {
            Ok(text) => match text.trim().parse::<u16>() {
                Ok(domain) if domain <= 232 => Ok(Some(domain)),
                _ => {
                    Err(TaskError::Usage(format!("environment variable ROS_DOMAIN_ID is `{text}`; expected 0 to 232")))
                }
            },
            Err(_) => Ok(None),
        };
        if let Some(domain) = self.domain.map_or_else(from_environment, |domain| Ok(Some(domain)))? {
            settings.domain = domain;
        }
        if let Some(clock) = self.clock {
            settings.clock = clock.into();
        }
        Ok(settings)
    }

    /// The drivers of a run.
    pub(super) fn drivers(&self, choice: DriversChoice, robot: &str) -> Result<Drivers, TaskError> {
        match choice {
            DriversChoice::Simulated if self.ros2.is_some() || self.domain.is_some() || self.clock.is_some() => {
                Err(TaskError::Usage("--ros2, --domain and --clock are for --drivers ros2".into()))
            }
            DriversChoice::Simulated => Ok(Drivers::Simulated),
            DriversChoice::Ros2 => Ok(Drivers::Ros2(Box::new(self.resolve(robot)?))),
        }
    }
}
