//! `dsm explore SCENE`: explore and keep the map.

use super::output::prepare_folder;
use super::run::{BarProgress, catch_interrupt, default_folder, exit_code, progress_bar, run_and_write, set_threads};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
use crate::episode::Episode;
use crate::language::find_language;
use crate::run::RunSpec;
use crate::settings::Settings;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Arguments of `dsm explore`.
#[derive(Debug, clap::Args)]
pub struct ExploreArgs {
    /// A scene: its folder or its MJCF file.
    scene: PathBuf,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// Explores a scene until nothing is left to see.
pub(super) fn run(args: ExploreArgs) -> anyhow::Result<u8> {
    let settings = Settings::resolve(&args.world, None, &|_| false)?;
    set_threads(settings.threads.value)?;
    let folder_name =
        if args.scene.is_dir() { args.scene.file_name() } else { args.scene.parent().and_then(|p| p.file_name()) };
    let scene_name = folder_name.map_or("scene".into(), |n| n.to_string_lossy().into_owned());
    let spec = RunSpec {
        robot: settings.robot.value,
        physics: settings.physics.value,
        perception: settings.perception.value,
        language: find_language(&settings.backend.value)?,
        seed: settings.seed.value,
        ..RunSpec::new(
            format!("explore-{scene_name}"),
            Episode::exploration(args.scene.clone(), settings.time_limit_s.value),
        )
    };
    crate::assemble::check(&spec)?;
    let folder = prepare_folder(&args.out, &default_folder(&spec))?;
    let interrupted = catch_interrupt()?;
    let bar = progress_bar(spec.time_limit_s);
    let progress = Box::new(BarProgress { bar: bar.clone() });
    let summary = run_and_write(&spec, &folder, interrupted.clone(), progress)?;
    bar.finish_and_clear();
    Output::new(args.result).give(&summary, || {
        let m = &summary.map;
        let reason = summary.steps.first().map_or("", |s| &s.reason);
        format!(
            "{reason}\n{} objects, {} relations, {} rooms after {:.0} simulated s; map written to {}",
            m.objects,
            m.relations,
            m.rooms,
            summary.metrics.sim_time_s,
            folder.join("map.dsm").display()
        )
    })?;
    Ok(exit_code(&summary, interrupted.load(Ordering::Relaxed)))
}
