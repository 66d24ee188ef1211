//! The command line: flags are parsed here and checked before anything runs.

mod act;
mod bench;
mod bench_map;
mod build;
mod calibrate;
mod drivers;
mod eval;
mod eval_drives;
mod eval_episodes;
mod eval_grounding;
mod eval_map;
mod eval_segmentation;
mod explore;
mod ground;
mod info;
mod map;
mod models;
mod output;
mod record;
mod replay;
mod robot;
mod run;
mod scene;
mod scene_survey;
mod serve;
mod serve_http;
mod serve_robot;
mod start;
mod suite;
mod suite_change;
mod suite_compare;
mod suite_compare_page;
mod suite_done;
mod suite_file;
mod suite_page;
mod suite_parts;
mod suite_recovery;
mod suite_result;
mod suite_spread;
mod view;
mod wire;

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

pub use info::{SchemaKind, schema_value};
pub use output::{Output, prepare_folder};
pub use run::{Timing, prepare, run_kept_and_write};
pub use start::start;
pub use wire::{ClockChoice, DriversChoice, WireArgs};

/// Simulation-in-the-loop robot tasks on a Diverse Semantic Map.
#[derive(Debug, Parser)]
#[command(name = "dsm", version, propagate_version = true, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// More log lines on stderr: -v for what happens, -vv for details. DSM_LOG takes a tracing filter.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

/// How the result is given.
#[derive(Clone, Debug, Default, Args)]
pub struct ResultArgs {
    /// Print the result as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
    /// Write the same JSON object to a file.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

/// What all simulated runs share. Precedence: flag, environment, episode, robot.toml, default.
#[derive(Clone, Debug, Default, Args)]
pub struct WorldArgs {
    /// Seed of every draw [env: DSM_SEED].
    #[arg(long)]
    pub seed: Option<u64>,
    /// Robot: a name that ships with the program, or the path of a robot.toml [env: DSM_ROBOT].
    #[arg(long)]
    pub robot: Option<String>,
    /// Physics engine [env: DSM_PHYSICS].
    #[arg(long)]
    pub physics: Option<PhysicsChoice>,
    /// Simulated perception [env: DSM_PERCEPTION].
    #[arg(long)]
    pub perception: Option<PerceptionChoice>,
    /// Who reads words, verifies and describes: `embedded`, or a file of models, which needs the feature `models`
    /// [env: DSM_BACKEND].
    #[arg(long, value_name = "embedded|FILE")]
    pub backend: Option<String>,
    /// Worker threads; never changes a result [env: DSM_THREADS].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub threads: Option<u16>,
    /// Simulated time limit in seconds [env: DSM_TIME_LIMIT_S].
    #[arg(long)]
    pub time_limit_s: Option<f64>,
}

/// Physics engines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PhysicsChoice {
    /// Built in.
    Rapier,
    /// Needs the feature `mujoco`.
    Mujoco,
}

/// Presets of simulated perception.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PerceptionChoice {
    /// Missed, split, merged and misnamed things, depth, colour and pose noise.
    Noisy,
    /// Everything as it is, for comparison.
    Oracle,
    /// The sensors of `noisy`; things are found in pixels alone, by the embedded segmenter without labels or names.
    Pixels,
}

/// Where results go.
#[derive(Clone, Debug, Default, Args)]
pub struct OutArgs {
    /// Output folder. Default: `out/EPISODE-SEED`.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace a folder that is not empty.
    #[arg(long)]
    pub force: bool,
}

/// Commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run one episode: explore, map, ground, navigate, grasp; then judge it.
    Run(run::RunArgs),
    /// Run all episodes found below the given paths.
    Suite(suite::SuiteArgs),
    /// Hold two suites side by side: what got better or worse, by episode and seed, as a table and a page.
    SuiteCompare(suite_compare::SuiteCompareArgs),
    /// Write the page `index.html` of a suite again, from its suite.json and the folders of its episodes.
    SuitePage(suite_page::SuitePageArgs),
    /// Explore a scene and keep its map.
    Explore(explore::ExploreArgs),
    /// Run an episode and keep what its map was made of: an RGB-D sequence with detections.
    Record(record::RecordArgs),
    /// Run a recording of `dsm run --record` again, without its world, and say where it first differs.
    Replay(replay::ReplayArgs),
    /// Estimate how a camera is mounted from a recording of a head that turns.
    Calibrate(calibrate::CalibrateArgs),
    /// Map a recorded sequence, own or others' (TUM, Replica, ScanNet), without a simulator.
    Build(build::BuildArgs),
    /// Show the simulator as a robot that speaks ROS 2, and judge whoever drives it. Needs the feature `ros2`.
    Serve(serve_robot::ServeRobotArgs),
    /// Do what others order over ROS 2 by the action `DoTask`, and show them the map. Needs the feature `ros2`.
    Act(act::ActArgs),
    /// Answer questions about a map over HTTP on this machine or as an MCP server; nothing can be changed.
    ServeMap(serve::ServeArgs),
    /// Ground a sentence in a map.
    Ground(ground::GroundArgs),
    /// Measure against truth.
    #[command(subcommand)]
    Eval(eval::EvalCommand),
    /// Look into, check, export, import or merge maps.
    #[command(subcommand)]
    Map(map::MapCommand),
    /// Generate, import, check or survey scenes.
    #[command(subcommand)]
    Scene(scene::SceneCommand),
    /// Look into language models.
    #[command(subcommand)]
    Models(models::ModelsCommand),
    /// Look into a robot.
    #[command(subcommand)]
    Robot(robot::RobotCommand),
    /// Hold a robot's drivers to their contract.
    #[command(subcommand)]
    Drivers(drivers::DriversCommand),
    /// Show the configuration.
    #[command(subcommand)]
    Config(info::ConfigCommand),
    /// Measure speeds on this machine and print one table.
    Bench(bench::BenchArgs),
    /// Print shell completions.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print a JSON schema.
    Schema {
        /// Of what.
        kind: SchemaKind,
    },
}

/// Runs the command and gives the process exit code.
pub fn run(cli: Cli) -> anyhow::Result<u8> {
    match cli.command {
        Command::Run(args) => run::run(args),
        Command::Suite(args) => suite::run(args),
        Command::SuiteCompare(args) => suite_compare::run(args),
        Command::SuitePage(args) => suite_page::run(args),
        Command::Explore(args) => explore::run(args),
        Command::Record(args) => record::run(args),
        Command::Replay(args) => replay::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Build(args) => build::run(args),
        Command::Serve(args) => serve_robot::run(args),
        Command::Act(args) => act::run(args),
        Command::ServeMap(args) => serve::run(args),
        Command::Ground(args) => ground::run(args),
        Command::Eval(command) => eval::run(command),
        Command::Map(command) => map::run(command),
        Command::Scene(command) => scene::run(command),
        Command::Models(command) => models::run(command),
        Command::Robot(command) => robot::run(command),
        Command::Drivers(command) => drivers::run(command),
        Command::Config(command) => info::config(command),
        Command::Bench(args) => bench::run(args),
        Command::Completions { shell } => info::completions(shell),
        Command::Schema { kind } => info::schema(kind),
    }
}
