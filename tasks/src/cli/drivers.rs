//! `dsm drivers check`.

use super::replay::{OPEN, not_built_in};
use super::run::{start_recording, tell_of_recording};
use super::wire::{DriversChoice, WireArgs};
use super::{Output, ResultArgs, WorldArgs};
use crate::assemble::bare_robot;
use crate::episode::{Episode, Start};
use crate::error::TaskError;
use crate::replay::{Wanted, recorded_robot};
use crate::run::{Drivers, RunSpec};
use crate::settings::Settings;
use dsm_robot::conformance::{Report, SPACE_M, Scope, check};
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_robot::nav::{Costmap, CostmapConfig};
use dsm_robot::recorded::{Difference, Recording, ReplayEnd};
use dsm_robot::safety::Envelope;
use dsm_sim::scene::SceneModel;
use dsm_sim::world::floor_of;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The largest recording of a check, megabytes.
const LARGEST_MB: u64 = 8192;

/// Commands on drivers.
#[derive(Debug, clap::Subcommand)]
pub enum DriversCommand {
    /// Try every behaviour that drivers owe, one by one, and report each.
    Check(CheckArgs),
}

/// Arguments of `dsm drivers check`.
#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    /// The scene in which the simulated robot is tried, where it has most space.
    #[arg(long, default_value = "scenes/apartment")]
    scene: PathBuf,
    /// What is tried: the drivers alone, or within the safety envelope.
    #[arg(long, value_enum, default_value_t = Around::Nothing)]
    within: Around,
    /// What the robot may do for it.
    #[arg(long, value_enum, default_value_t = Freedom::Move)]
    freedom: Freedom,
    /// Record the whole check into this MCAP file, which must not exist. Needs the feature `mcap`.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Try what was recorded with --record once more, without the robot: the same behaviours must be found in the same
    /// answers. --within and --freedom must be those of then.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["record", "scene", "drivers"])]
    recording: Option<PathBuf>,
    /// Which drivers are tried. Over ROS 2 the scene is where the robot stands, and --scene says nothing.
    #[arg(long, value_enum, default_value_t)]
    drivers: DriversChoice,
    #[command(flatten)]
    wire: WireArgs,
    #[command(flatten)]
    world: WorldArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// What is around the drivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Around {
    /// The drivers alone: what they forget shows.
    Nothing,
    /// The safety envelope, as in every run.
    Envelope,
}

/// What the robot may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Freedom {
    /// Move: it needs a metre of free floor all around, and an empty hand.
    Move,
    /// Nothing: only what it measures is checked.
    Stand,
}

/// Runs a command on drivers.
pub(super) fn run(command: DriversCommand) -> anyhow::Result<u8> {
    let DriversCommand::Check(args) = command;
    let report = match &args.recording {
        Some(recording) => check_recording(recording, &args)?,
        None => check_world(&args)?,
    };
    Output::new(args.result).give(&report, || describe(&report))?;
    Ok(u8::from(!report.passed))
}

fn check_robot<R: Robot>(mut robot: R, model: &Arc<RobotModel>, args: &CheckArgs) -> Report {
    let scope = match args.freedom {
        Freedom::Move => Scope::Moving,
        Freedom::Stand => Scope::ReadingOnly,
    };
    match args.within {
        Around::Nothing => check(&mut robot, model, scope),
        Around::Envelope => check(&mut Envelope::new(robot, model), model, scope),
    }
}

/// Checks a simulated robot.
fn check_world(args: &CheckArgs) -> anyhow::Result<Report> {
    let settings = Settings::resolve(&args.world, None, &|_| false)?;
    let mut spec = RunSpec {
        robot: settings.robot.value,
        physics: settings.physics.value,
        perception: settings.perception.value,
        seed: settings.seed.value,
        ..RunSpec::new("drivers", Episode::new(args.scene.clone()))
    };
    let model = RobotModel::load(&crate::assemble::find_robot(&spec.robot)?).map_err(TaskError::from)?;
    spec.drivers = args.wire.drivers(args.drivers, &spec.robot)?;
    if spec.drivers == Drivers::Simulated {
        spec.episode.start = Some(find_space(&args.scene, &model)?);
    }
    let (robot, model) = bare_robot(&spec)?;
    let Some(file) = &args.record else { return Ok(check_robot(robot, &model, args)) };
    let mut recorder = start_recording(file, LARGEST_MB)?;
    recorder.begin(&spec, &model, "none")?;
    let report = check_robot(Recording::new(robot, &model, recorder.sink()), &model, args);
    tell_of_recording(Some(recorder.close()?))?;
    Ok(report)
}

/// Checks a recorded robot.
fn check_recording(file: &Path, args: &CheckArgs) -> anyhow::Result<Report> {
    let open = OPEN.ok_or_else(|| not_built_in("--recording"))?;
    let (robot, model, ends) = recorded_robot(open(file, Wanted::All)?)?;
    let report = check_robot(robot, &model, args);
    let why = match ends.try_recv() {
        // Nothing that was asked is missing in it.
        Err(_) => return Ok(report),
        Ok(ReplayEnd::Over(stamp)) => format!("it ends at {:.2} s, within the check", stamp.as_s()),
        Ok(ReplayEnd::Unreadable { stamp, reason }) => format!("from {:.2} s on: {reason}", stamp.as_s()),
        Ok(ReplayEnd::Differs(Difference { part, stamp, expected, got })) => {
            format!("at {:.2} s it holds another check ({part}): {expected}, not {got}", stamp.as_s())
        }
    };
    let hint = "expected a recording of `dsm drivers check --record` with the same --within and --freedom";
    Err(TaskError::Usage(format!("{}: {why}; {hint}", file.display())).into())
}

/// Where the scene is emptiest.
fn find_space(scene: &Path, model: &RobotModel) -> Result<Start, TaskError> {
    let base = &model.settings.base;
    let loaded = SceneModel::load(scene).map_err(dsm_sim::world::WorldError::from)?;
    let config = CostmapConfig { footprint_radius_m: base.footprint_radius_m, ..CostmapConfig::default() };
    let costmap = Costmap::from_free_space(&floor_of(&loaded, base.height_m)?, &config);
    let free = (0..costmap.grid().len()).filter(|cell| costmap.is_traversable(*cell));
    let widest = free.max_by(|a, b| costmap.clearance_m(*a).total_cmp(&costmap.clearance_m(*b)));
    let space_m = base.footprint_radius_m + 0.5 * SPACE_M;
    match widest.filter(|cell| costmap.clearance_m(*cell) >= space_m) {
        Some(cell) => {
            let at = costmap.grid().center_of(cell);
            Ok(Start { x_m: at.x, y_m: at.y, yaw_rad: 0.0 })
        }
        None => Err(TaskError::Usage(format!("{}: nowhere are {space_m:.2} m free all around", scene.display()))),
    }
}

fn describe(report: &Report) -> String {
    let passed = report.findings.iter().filter(|finding| finding.passed).count();
    let mut text = format!("{}: {passed} of {} behaviours\n", report.robot, report.findings.len());
    for finding in &report.findings {
        let mark = if finding.passed { "ok  " } else { "FAIL" };
        let (behaviour, measured, required) = (finding.behaviour, &finding.measured, &finding.required);
        text.push_str(&format!("  {mark} {behaviour}\n         {measured}\n         required: {required}\n"));
    }
    text
}
