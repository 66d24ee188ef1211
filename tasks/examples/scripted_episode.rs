//! An episode written in Rust instead of TOML: it is run, the next step is chosen by what the robot found, and the end is
//! judged by ground truth.
//!
//! `cargo run --release -p dsm-tasks --example scripted_episode`

#![allow(clippy::print_stdout, reason = "an example prints what it did")]

use anyhow::{Context, Result, ensure};
use dsm_tasks::episode::{Episode, Expectation, Start, Step};
use dsm_tasks::run::{RunSpec, Silent};
use dsm_tasks::session::Session;
use dsm_tasks::summary::StepOutcome;
use std::path::Path;

fn main() -> Result<()> {
    let mut episode = Episode::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment"));
    episode.seed = 3;
    episode.time_limit_s = 120.0;
    episode.start = Some(Start { x_m: -1.6, y_m: 2.9, yaw_rad: 3.1 });
    // What must be true in the end. The name is that of the body in the scene: only the judge knows it.
    episode.expectations = vec![Expectation::robot_near_object("fridge")];

    let spec = RunSpec::new("to_the_fridge", episode);
    let mut session = Session::begin(&spec, None, Default::default(), Box::new(Silent))?;
    let first = session.run(&[Step::command("Navigate to the stove")]);
    let reached = first.iter().all(|step| step.outcome == StepOutcome::Done);
    println!("the stove: {}", first.last().map_or("", |step| &step.reason));
    ensure!(reached, "the stove was not reached");
    let known = session.agent().map().stable_objects().count();
    println!("{known} objects are known by now");

    session.run(&[Step::command("Navigate to the fridge")]);
    let finished = session.finish()?;
    let summary = &finished.summary;
    for step in &summary.steps {
        println!("{:5.1} s  {} -> {:?}: {}", step.start_s, step.command, step.outcome, step.reason);
    }
    let judged = summary.expectations.first().context("the expectation was judged")?;
    println!("{}: {} (required: {})", judged.kind, judged.measured, judged.required);
    ensure!(summary.success, "{:?}", summary.failure);
    ensure!(summary.steps.len() == 2 && summary.steps[1].index == 1, "both steps are accounted for");
    ensure!(summary.metrics.limit_violations == 0, "a limit was broken");
    Ok(())
}
