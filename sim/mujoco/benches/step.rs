//! Steps of the apartment per second: MuJoCo through the engine, MuJoCo's own step on the same model from the same state,
//! and rapier, in turns, each from a fresh world, so that nothing sleeps yet.
//!
//! `cargo bench -p dsm-sim-mujoco`. The best turn counts: others can only take time away.
#![allow(missing_docs, clippy::print_stdout, clippy::disallowed_methods, reason = "a program that measures time")]

use dsm_robot::model::RobotModel;
use dsm_sim::physics::{Engine, Physics, Rapier, RobotBody, RobotStart};
use dsm_sim::scene::{SceneModel, scene_file};
use dsm_sim_mujoco::{MujocoConfig, MujocoPhysics};
use std::path::Path;
use std::time::Instant;

/// Steps between two looks at the clock: short, for whatever else runs takes turns of milliseconds.
const STEPS: u32 = 10;
/// Turns of a round: 1.5 s, less than rapier waits before it lets bodies sleep.
const TURNS: usize = 30;
const ROUNDS: usize = 8;

fn rate(mut step: impl FnMut()) -> f64 {
    let start = Instant::now();
    (0..STEPS).for_each(|_| step());
    f64::from(STEPS) / start.elapsed().as_secs_f64()
}

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scene = SceneModel::load(&scene_file(&root.join("scenes/apartment"))).expect("the scene loads");
    let robot = RobotModel::load(&root.join("robot/models/porter")).expect("porter loads");
    let robot = RobotBody::of(&robot).expect("porter has a body");
    // Beside the apartment: only the scene's own contacts count.
    let start = RobotStart { x_m: -50.0, y_m: 0.0, yaw_rad: 0.0, joints: Vec::new() };
    let awake = MujocoConfig { sleep_below_m_per_s: 0.0, ..MujocoConfig::default() };
    let mut best = [0.0_f64; 3];
    for _ in 0..ROUNDS {
        let mut engine = MujocoPhysics::new(&scene, &robot, &start, awake).expect("a valid world");
        engine.step();
        let mut bare = engine.copy_of_data();
        let mut rapier = Rapier::default().build(&scene, &robot, &start).expect("a valid world");
        rapier.step();
        for _ in 0..TURNS {
            let rates = [rate(|| engine.step()), rate(|| bare.step()), rate(|| rapier.step())];
            for (best, rate) in best.iter_mut().zip(rates) {
                *best = best.max(rate);
            }
        }
    }
    for (name, rate) in ["mujoco, through the engine", "mujoco, its own step", "rapier"].iter().zip(best) {
        println!("{name:28} {rate:8.0} steps/s");
    }
    println!("through the engine: {:.1} % of its own step", 100.0 * best[0] / best[1]);
}
