//! `dsm drivers check`.

use super::wire::{DriversChoice, WireArgs};
use super::{Output, ResultArgs, WorldArgs};
use crate::assemble::bare_robot;
use crate::episode::{Episode, Start};
use crate::error::TaskError;
use crate::run::{Drivers, RunSpec};
use crate::settings::Settings;
use dsm_robot::conformance::{Report, SPACE_M, Scope, check};
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_robot::nav::{Costmap, CostmapConfig};
use dsm_robot::safety::Envelope;
use dsm_sim::scene::SceneModel;
use dsm_sim::world::floor_of;
use std::path::{Path, PathBuf};

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
    let (mut robot, model) = bare_robot(&spec)?;
    let scope = match args.freedom {
        Freedom::Move => Scope::Moving,
        Freedom::Stand => Scope::ReadingOnly,
    };
    let report = match args.within {
        Around::Nothing => check(robot.as_mut(), &model, scope),
        Around::Envelope => check(&mut Envelope::new(robot, &model) as &mut dyn Robot, &model, scope),
    };
    Output::new(args.result).give(&report, || describe(&report))?;
    Ok(u8::from(!report.passed))
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
