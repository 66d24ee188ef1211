//! A skill of one's own: patrols some places and counts the things of a kind that it sees on the way.
//!
//! A skill is a function that ticks the agent until it is done. This one is put together from what ships with the program
//! (`Drive`, `look_around`) and reads the map that grows meanwhile. It knows nothing of a simulator: on a robot with
//! drivers it would do the same.
//!
//! `cargo run --release -p dsm-tasks --example custom_skill`

#![allow(clippy::print_stdout, reason = "an example prints what it did")]

use anyhow::{Result, ensure};
use dsm_robot::nav::NavConfig;
use dsm_tasks::agent::{Agent, Gaze, Halt};
use dsm_tasks::episode::{Episode, Start};
use dsm_tasks::run::{RunSpec, Silent};
use dsm_tasks::session::Session;
use dsm_tasks::skills::Outcome;
use dsm_tasks::skills::drive::{Drive, DriveOutcome};
use dsm_tasks::skills::looks::look_around;
use dsm_tasks::summary::{Stage, StepOutcome};
use nalgebra::Point2;
use std::path::Path;

/// Looks around, then at each of the places (world frame, metres), and answers how many things have one of the names.
fn count_on_patrol(
    agent: &mut Agent,
    nav: &NavConfig,
    names: &[&str],
    places: &[Point2<f64>],
) -> Result<Outcome, Halt> {
    const HALF_TURN_RAD: f64 = 2.6;
    look_around(agent, HALF_TURN_RAD)?;
    for place in places {
        agent.gaze = Gaze::AROUND;
        match Drive::to_place(nav, *place).run(agent)? {
            DriveOutcome::Arrived => look_around(agent, HALF_TURN_RAD)?,
            // A place that cannot be reached is no reason to give up the patrol.
            other => agent.note(format!("({:.1}, {:.1}) is left out: {other:?}", place.x, place.y)),
        }
    }
    let found: Vec<String> = (agent.map().stable_objects())
        .filter(|object| names.contains(&object.name()))
        .map(|object| format!("{} at ({:.1}, {:.1})", object.name(), object.bounds.center.x, object.bounds.center.y))
        .collect();
    if found.is_empty() {
        return Ok(Outcome::Failed(Stage::Mapping, format!("no {} was seen", names.join(" or "))));
    }
    Ok(Outcome::Done(format!("{} found: {}", found.len(), found.join(", "))))
}

fn main() -> Result<()> {
    // The kitchen of the apartment; the two mugs stand on the table and on the counter.
    let mut episode = Episode::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment"));
    episode.start = Some(Start { x_m: -1.6, y_m: 2.9, yaw_rad: 3.1 });
    episode.time_limit_s = 90.0;
    let spec = RunSpec::new("count_mugs", episode);
    let mut session = Session::begin(&spec, None, Default::default(), Box::new(Silent))?;
    let nav = session.nav().clone();
    let step = session.run_skill("Count the mugs in the kitchen", "count_on_patrol", |agent| {
        count_on_patrol(agent, &nav, &["mug", "cup"], &[Point2::new(-3.2, 3.1)])
    });
    println!("{} after {:.1} simulated s", step.reason, step.duration_s);
    ensure!(step.outcome == StepOutcome::Done, "the skill failed: {}", step.reason);

    let summary = session.finish()?.summary;
    ensure!(summary.success, "{:?}", summary.failure);
    ensure!(summary.metrics.collisions == 0, "{} collisions", summary.metrics.collisions);
    println!("{:.1} m driven, {} objects in the map", summary.metrics.path_length_m, summary.map.objects);
    Ok(())
}
