//! `dsm calibrate FILE`: how a camera is mounted, from a recording.

use super::replay::{OPEN, not_built_in};
use super::{Output, ResultArgs};
use crate::calibrate::{CalibrationReport, calibrate_camera};
use crate::replay::Wanted;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `dsm calibrate`.
#[derive(Debug, clap::Args)]
pub struct CalibrateArgs {
    /// A recording of a head that turns while the base stands: an episode with `skill = "wiggle"`, recorded with
    /// `dsm run --record`.
    recording: PathBuf,
    /// The camera, by its name in robot.toml.
    #[arg(long, default_value = "head")]
    camera: String,
    /// Another description of the robot than the recorded one: a name that ships with the program, or the path of a
    /// robot.toml.
    #[arg(long)]
    robot: Option<String>,
    #[command(flatten)]
    result: ResultArgs,
}

/// Estimates.
pub(super) fn run(args: CalibrateArgs) -> anyhow::Result<u8> {
    let open = OPEN.ok_or_else(|| not_built_in("calibrate"))?;
    let source = open(&args.recording, Wanted::All)?;
    let report = calibrate_camera(source, &args.camera, args.robot.as_deref())?;
    Output::new(args.result).give(&report, || describe(&report))?;
    Ok(u8::from(!report.estimated))
}

fn describe(report: &CalibrationReport) -> String {
    let mut text = format!("{}: {}\n", report.camera, report.reason);
    if let (Some(xyz), Some(rpy), Some(sigma)) = (report.offset_xyz_m, report.offset_rpy_rad, report.sigma) {
        let numbers = |values: &[f64]| values.iter().map(|value| format!("{value:.5}")).collect::<Vec<_>>().join(", ");
        let _ = writeln!(text, "  in [[camera]] `{}` of robot.toml:", report.camera);
        let _ = writeln!(text, "  offset_xyz_m = [{}]  # +- {}", numbers(&xyz), numbers(&sigma[..3]));
        let _ = writeln!(text, "  offset_rpy_rad = [{}]  # +- {}", numbers(&rpy), numbers(&sigma[3..]));
    }
    text
}
