//! How long stepping and rendering take without Python around them: what `tasks/python/benches/step_and_render.py` is
//! held against. The same scene, seed, commands and pictures.
//!
//! `cargo run --release -p dsm-tasks --features mcap --example step_and_render -- [SECONDS]`

#![allow(clippy::print_stdout, reason = "a measurement prints what it measured")]
#![allow(clippy::disallowed_methods, reason = "a measurement reads the wall clock")]

use anyhow::{Context, Result};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{Robot, Twist};
use dsm_robot::joints::JointVelocities;
use dsm_tasks::assemble::{Assembled, assemble};
use dsm_tasks::episode::Episode;
use dsm_tasks::run::RunSpec;
use std::path::Path;
use std::time::Instant;

const PERIOD: Span = Span(10_000_000);
const STEP: Span = Span(200_000_000);

/// CPU time of this process, seconds: fields 14 and 15 of `/proc/self/stat`, in hundredths.
fn cpu_s() -> Result<f64> {
    let text = std::fs::read_to_string("/proc/self/stat")?;
    let rest = text.rsplit_once(") ").context("no command in /proc/self/stat")?.1;
    let ticks: Vec<f64> = rest.split(' ').skip(11).take(2).map(str::parse).collect::<Result<_, _>>()?;
    Ok(ticks.iter().sum::<f64>() / 100.0)
}

fn main() -> Result<()> {
    let seconds: f64 = std::env::args().nth(1).map_or(Ok(60.0), |text| text.parse())?;
    let mut spec =
        RunSpec::new("step", Episode::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment")));
    spec.seed = 1;
    let Assembled { mut robot, model, truth, mut judge, .. } = assemble(&spec)?;
    let still = [&model.arm, &model.head].map(|group| JointVelocities::zeros(&group.joints));
    let twist = Twist { forward_m_per_s: 0.0, turn_rad_per_s: 0.5 };
    let (begin, begin_cpu_s) = (Instant::now(), cpu_s()?);
    let (mut pictures, mut sum) = (0_u32, 0_u64);
    for _ in 0..(seconds / STEP.as_s()).round() as usize {
        let end = robot.clock().now() + STEP;
        while robot.clock().now() < end {
            let next = Stamp((robot.clock().now() + PERIOD).0.min(end.0));
            robot.base().command(twist)?;
            robot.arm().command(&still[0])?;
            robot.head().command(&still[1])?;
            robot.clock().wait_until(next)?;
        }
        truth.try_iter().for_each(|sample| judge.observe(sample));
        if let Some(frame) = robot.cameras().read("head")? {
            pictures += 1;
            sum += u64::from(frame.color[frame.color.len() / 2][0]) + (frame.depth_m[0] * 1000.0) as u64;
        }
    }
    let (wall_s, cpu_s) = (begin.elapsed().as_secs_f64(), cpu_s()? - begin_cpu_s);
    println!(
        "rust    {seconds:.0} simulated s, {pictures} pictures, checksum {sum}: {wall_s:.3} s wall, {cpu_s:.2} s CPU"
    );
    Ok(())
}
