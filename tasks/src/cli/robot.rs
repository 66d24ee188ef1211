//! `dsm robot check`.

use super::{Output, ResultArgs};
use crate::assemble::find_robot;
use crate::error::TaskError;
use dsm_robot::model::RobotModel;
use serde::Serialize;

/// Commands on robots.
#[derive(Debug, clap::Subcommand)]
pub enum RobotCommand {
    /// Load a robot and say what it is.
    Check {
        /// A name that ships with the program, or the path of a robot.toml.
        robot: String,
        #[command(flatten)]
        result: ResultArgs,
    },
}

#[derive(Serialize)]
struct RobotReport {
    name: String,
    links: usize,
    groups: Vec<GroupReport>,
    cameras: Vec<String>,
    postures: Vec<String>,
    tool: String,
}

#[derive(Serialize)]
struct GroupReport {
    name: String,
    joints: Vec<String>,
}

/// Checks a robot.
pub(super) fn run(command: RobotCommand) -> anyhow::Result<u8> {
    let RobotCommand::Check { robot, result } = command;
    let model = RobotModel::load(&find_robot(&robot)?).map_err(TaskError::from)?;
    let report = RobotReport {
        name: model.settings.name.clone(),
        links: model.kinematics.links.len(),
        groups: model
            .groups
            .iter()
            .map(|g| GroupReport { name: g.name.clone(), joints: g.joints.iter().map(|j| j.to_string()).collect() })
            .collect(),
        cameras: model.settings.camera.iter().map(|c| c.name.clone()).collect(),
        postures: model.settings.postures.keys().cloned().collect(),
        tool: model.settings.tool.frame.clone(),
    };
    Output::new(result).give(&report, || {
        let mut text = format!("{}: {} links, tool {}\n", report.name, report.links, report.tool);
        for group in &report.groups {
            text.push_str(&format!("  {}: {}\n", group.name, group.joints.join(", ")));
        }
        text.push_str(&format!("  cameras: {}\n", report.cameras.join(", ")));
        text.push_str(&format!("  postures: {}\n", report.postures.join(", ")));
        text
    })?;
    Ok(0)
}
