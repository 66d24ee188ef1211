//! `dsm serve`: the simulator as a robot that speaks ROS 2.

use super::wire::WireArgs;
use super::{OutArgs, ResultArgs, WorldArgs};
use std::path::PathBuf;

/// Arguments of `dsm serve`.
#[derive(Debug, clap::Args)]
pub struct ServeRobotArgs {
    /// A scene, where no episode names one.
    #[arg(required_unless_present = "episode", conflicts_with = "episode")]
    scene: Option<PathBuf>,
    /// Serve the robot of this episode in its scene, with its disturbances and faults, and judge its expectations.
    #[arg(long, value_name = "FILE")]
    episode: Option<PathBuf>,
    /// Share of the images that are lost on the way, 0 to 1.
    #[arg(long, default_value_t = 0.0, value_parser = share)]
    loss: f64,
    /// Each message comes later by a time between 0 and this, milliseconds, 0 to 1000; only in real time.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=1000))]
    jitter_ms: u16,
    /// Whoever acts and is silent for so long is away: then the run ends. Real time, seconds, 1 to 3600.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u64).range(1..=3600))]
    patience_s: u64,
    #[command(flatten)]
    wire: WireArgs,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    result: ResultArgs,
}

fn share(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|share| (0.0..=1.0).contains(share)).ok_or_else(|| "expected 0 to 1".into())
}

#[cfg(not(feature = "ros2"))]
pub(super) fn run(_: ServeRobotArgs) -> anyhow::Result<u8> {
    Err(crate::error::TaskError::no_ros2("`dsm serve`").into())
}

#[cfg(feature = "ros2")]
pub(super) use served::run;

#[cfg(feature = "ros2")]
mod served {
    use super::super::Output;
    use super::super::output::{prepare_folder, to_json};
    use super::super::run::{
        BarProgress, catch_interrupt, default_folder, describe, exit_code, prepare, progress_bar, set_threads,
    };
    use super::ServeRobotArgs;
    use crate::deploy::{Served, Service, Weather, serve};
    use crate::episode::Episode;
    use crate::error::TaskError;
    use crate::run::RunSpec;
    use crate::settings::Settings;
    use dsm::store::{save_map, write_atomically};
    use dsm::time::Span;
    use dsm_robot::model::ros2::ClockSource;
    use std::sync::atomic::Ordering;
    use std::time::Duration;

    /// Serves until the task is done, away or interrupted; prints the judge's result and writes `summary.json` and, as the
    /// task told it, `map.dsm`.
    pub(in super::super) fn run(args: ServeRobotArgs) -> anyhow::Result<u8> {
        let (spec, settings) = find_spec(&args)?;
        set_threads(settings.threads.value)?;
        let mut wire = args.wire.resolve(&spec.robot)?;
        if wire.clock == ClockSource::Wall {
            wire.clock = ClockSource::Topic;
        }
        let jitter = Span(i64::from(args.jitter_ms) * 1_000_000);
        if wire.clock == ClockSource::LockStep && jitter.0 > 0 {
            let why = "--jitter-ms: in lock step time stands still until all has come; add --clock real-time";
            return Err(TaskError::Usage(why.into()).into());
        }
        let weather = Weather { loss: args.loss, jitter, seed: spec.seed };
        let service = Service { settings: wire, weather, patience: Duration::from_secs(args.patience_s) };
        let mut served_as = default_folder(&spec).into_os_string();
        served_as.push("-served");
        let folder = prepare_folder(&args.out, served_as.as_ref())?;
        let interrupted = catch_interrupt()?;
        let bar = progress_bar(spec.time_limit_s);
        let progress = Box::new(BarProgress { bar: bar.clone() });
        let Served { summary, map } = serve(&spec, &service, interrupted.clone(), progress)?;
        bar.finish_and_clear();
        save_map(&folder.join("map.dsm"), &map).map_err(TaskError::from)?;
        write_atomically(&folder.join("summary.json"), to_json(&summary)?.as_bytes()).map_err(TaskError::from)?;
        Output::new(args.result).give(&summary, || describe(&summary, &folder))?;
        Ok(exit_code(&summary, interrupted.load(Ordering::Relaxed)))
    }

    /// The episode's run, or an empty episode in a scene.
    fn find_spec(args: &ServeRobotArgs) -> Result<(RunSpec, Settings), TaskError> {
        let Some(scene) = &args.scene else {
            return prepare(args.episode.as_deref().unwrap_or_else(|| "".as_ref()), &args.world);
        };
        let settings = Settings::resolve(&args.world, None, &|_| false)?;
        let spec = RunSpec {
            robot: settings.robot.value.clone(),
            physics: settings.physics.value.clone(),
            perception: settings.perception.value.clone(),
            seed: settings.seed.value,
            time_limit_s: settings.time_limit_s.value,
            ..RunSpec::new("served", Episode::new(scene.clone()))
        };
        Ok((spec, settings))
    }
}
