//! `dsm act`: a robot that does what others order over ROS 2.

use super::wire::{DriversChoice, WireArgs};
use super::{OutArgs, ResultArgs, WorldArgs};
use std::path::PathBuf;

/// Arguments of `dsm act`.
#[derive(Debug, clap::Args)]
pub struct ActArgs {
    /// The scene of a simulated robot. Over ROS 2 the robot stands where it stands.
    #[arg(default_value = "scenes/apartment")]
    scene: PathBuf,
    /// Behind which drivers the robot stands.
    #[arg(long, value_enum, default_value_t)]
    drivers: DriversChoice,
    #[command(flatten)]
    wire: WireArgs,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    result: ResultArgs,
}

#[cfg(not(feature = "ros2"))]
pub(super) fn run(_: ActArgs) -> anyhow::Result<u8> {
    Err(crate::error::TaskError::no_ros2("`dsm act`").into())
}

#[cfg(feature = "ros2")]
pub(super) use acting::run;

#[cfg(feature = "ros2")]
mod acting {
    use super::super::Output;
    use super::super::output::{prepare_folder, to_json};
    use super::super::run::{BarProgress, catch_interrupt, default_folder, describe, progress_bar, set_threads};
    use super::ActArgs;
    use crate::deploy::act;
    use crate::episode::Episode;
    use crate::error::TaskError;
    use crate::language::find_language;
    use crate::run::{Drivers, RunSpec};
    use crate::settings::Settings;
    use dsm::store::write_atomically;

    /// Acts until Ctrl-C or the time limit; writes `map.dsm` and `summary.json`.
    pub(in super::super) fn run(args: ActArgs) -> anyhow::Result<u8> {
        let settings = Settings::resolve(&args.world, None, &|_| false)?;
        set_threads(settings.threads.value)?;
        let robot = settings.robot.value.clone();
        let wire = args.wire.resolve(&robot)?;
        let drivers = match args.drivers {
            super::DriversChoice::Simulated => Drivers::Simulated,
            super::DriversChoice::Ros2 => Drivers::Ros2(Box::new(wire.clone())),
        };
        let spec = RunSpec {
            robot,
            physics: settings.physics.value.clone(),
            perception: settings.perception.value.clone(),
            language: find_language(&settings.backend.value)?,
            seed: settings.seed.value,
            time_limit_s: settings.time_limit_s.value,
            drivers,
            ..RunSpec::new("act", Episode::new(args.scene.clone()))
        };
        let folder = prepare_folder(&args.out, &default_folder(&spec))?;
        let interrupted = catch_interrupt()?;
        let bar = progress_bar(spec.time_limit_s);
        let progress = Box::new(BarProgress { bar: bar.clone() });
        let finished = act(&spec, wire.domain, &folder.join("map.dsm"), interrupted, progress)?;
        bar.finish_and_clear();
        let summary = finished.summary;
        write_atomically(&folder.join("summary.json"), to_json(&summary)?.as_bytes()).map_err(TaskError::from)?;
        Output::new(args.result).give(&summary, || describe(&summary, &folder))?;
        Ok(0)
    }
}
