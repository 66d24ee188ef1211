//! A robot of one's own: drivers in Rust behind `dsm_robot::drivers::Robot`, and a detector that knows no names.
//!
//! What plays the hardware here is the simulated robot without its limits; take your own drivers in its place. First the
//! list of behaviours is tried on it, as `dsm drivers check` does, then it looks around and maps what it sees.
//!
//! `cargo run --release -p dsm-tasks --example own_robot`

#![allow(clippy::print_stdout, reason = "an example prints what it did")]

use anyhow::{Result, ensure};
use dsm::perceive::PixelSegmenter;
use dsm_robot::conformance::{Scope, check};
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_tasks::assemble::bare_robot;
use dsm_tasks::deferred::Waiting;
use dsm_tasks::episode::{Episode, Start};
use dsm_tasks::run::{RunSpec, Silent};
use dsm_tasks::session::{Keep, OwnRobot, Session};
use dsm_tasks::skills::Outcome;
use dsm_tasks::skills::looks::look_around;
use dsm_tasks::summary::StepOutcome;
use std::path::Path;
use std::sync::Arc;

/// Opens the drivers: of a robot on a bench, this is where its buses and cameras are opened.
fn open_drivers(spec: &RunSpec) -> Result<(Box<dyn Robot>, Arc<RobotModel>)> {
    Ok(bare_robot(spec)?)
}

fn main() -> Result<()> {
    let mut episode = Episode::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment"));
    episode.start = Some(Start { x_m: -1.6, y_m: 2.9, yaw_rad: 3.1 });
    episode.time_limit_s = 60.0;
    let spec = RunSpec::new("own_robot", episode);

    let (mut robot, model) = open_drivers(&spec)?;
    let report = check(robot.as_mut(), &model, Scope::ReadingOnly);
    println!("{} of {} behaviours", report.findings.iter().filter(|f| f.passed).count(), report.findings.len());
    ensure!(report.passed, "the drivers are not ready: {:?}", report.findings);

    // A world that steps waits for slow work; a robot on the floor does not: there it is `Waiting::Never`.
    let (detector, waiting) = (Box::new(PixelSegmenter), Waiting::ForResults);
    let own = OwnRobot { robot, model, detector, waiting };
    let mut session = Session::begin_on(own, &spec, None, Keep::default(), Default::default(), Box::new(Silent))?;
    let step = session.run_skill("Look around", "look_around", |agent| {
        look_around(agent, 2.6)?;
        Ok(Outcome::Done(format!("{} things are in the map", agent.map().stable_objects().count())))
    });
    println!("{:?}: {}", step.outcome, step.reason);
    ensure!(step.outcome == StepOutcome::Done, "it looks around");
    let finished = session.finish()?;
    ensure!(finished.map.stable_objects().count() > 5, "a kitchen holds more than that");
    Ok(())
}
