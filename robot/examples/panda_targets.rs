//! The controller on a file of Panda targets: success, violations, times of the ticks, and who solved them.
//!
//! ```text
//! cargo run --release -p dsm-robot --example panda_targets -- FILE
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "printing is what an example does")]
#![allow(clippy::disallowed_methods, reason = "it measures wall time; the controller never reads it")]

#[path = "../tests/panda/mod.rs"]
mod panda;

use dsm_robot::control::{ControlStatus, SolvedBy};
use panda::Panda;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

fn main() -> ExitCode {
    let Some(file) = std::env::args().nth(1) else {
        eprintln!("usage: panda_targets FILE   (panda_ik_targets.json of the evaluation data)");
        return ExitCode::from(2);
    };
    let panda = match Panda::load(Path::new(&file)) {
        Ok(panda) => panda,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    let mut controller = panda.controller(Panda::config());
    let mut times_us = Vec::new();
    let mut by = [0_usize; 3];
    let (mut braking, mut reconfiguring) = (0_usize, 0_usize);
    let (mut runs, mut ends) = (Vec::new(), Vec::new());
    for target in &panda.targets {
        controller.reset();
        let mut end = (0.0, 0.0, 0_usize);
        runs.push(panda.run(target, |state, goal, dt_s| {
            let begun = Instant::now();
            let output = controller.tick(state, goal, &[], dt_s);
            times_us.push(begun.elapsed().as_secs_f64() * 1e6);
            match output.solved_by {
                Some(SolvedBy::Unconstrained) => by[0] += 1,
                Some(SolvedBy::ActiveSet) => by[1] += 1,
                Some(SolvedBy::Clarabel) => by[2] += 1,
                None => {}
            }
            braking += usize::from(matches!(output.status, ControlStatus::Braking { .. }));
            reconfiguring += usize::from(output.status == ControlStatus::Reconfiguring);
            let moved = end.2 + usize::from(output.status == ControlStatus::Reconfiguring);
            end = (output.error_m, output.error_rad, moved);
            output
        }));
        ends.push(end);
    }
    let reached = runs.iter().filter(|run| run.reached && run.violations == 0).count();
    let violations: usize = runs.iter().map(|run| run.violations).sum();
    let mut steps: Vec<usize> = runs.iter().filter(|run| run.reached).map(|run| run.steps).collect();
    steps.sort_unstable();
    times_us.sort_by(f64::total_cmp);
    let at = |share: f64| times_us[((times_us.len() - 1) as f64 * share) as usize];
    let percent = |part: usize, of: usize| 100.0 * part as f64 / of as f64;
    let ticks = times_us.len();
    println!("targets         {}", runs.len());
    println!("reached         {reached} ({:.1} %), no limit broken on the way", percent(reached, runs.len()));
    println!("violations      {violations}");
    println!("time to target  median {:.2} s", steps[steps.len() / 2] as f64 * panda.dt_s);
    println!("ticks           {ticks}, {braking} braking, {:.1} % to another posture", percent(reconfiguring, ticks));
    println!("tick            median {:.1} us, p99 {:.1} us, max {:.1} us", at(0.5), at(0.99), at(1.0));
    for (name, count) in ["unconstrained", "active set", "interior point"].iter().zip(by) {
        println!("solved by       {name} {:.2} %", percent(count, ticks));
    }
    for (k, (_, (error_m, error_rad, moved))) in runs.iter().zip(&ends).enumerate().filter(|(_, (run, _))| !run.reached)
    {
        println!("missed          target {k}: {error_m:.4} m, {error_rad:.3} rad off, {moved} ticks to other postures");
    }
    ExitCode::SUCCESS
}
