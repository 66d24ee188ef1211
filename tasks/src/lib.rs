//! Skills, the episode loop, judging, reports and the command line.
//!
//! ```text
//! episode.toml ──▶ assemble ──▶ Agent::tick loop ◀── skills ◀── Executor ◀── commands
//!                                   │ truth (judge only)
//!                                   ▼
//!                        summary.json, map.dsm, report.html
//! ```
//!
//! Invariants: one loop ([`agent::Agent::tick`]) sees command, time, frames and map; only the judge reads truth; the
//! crate does not know which physics engine runs.

pub mod agent;
pub mod assemble;
pub mod calibrate;
pub mod cli;
mod crew;
pub mod deferred;
#[cfg(feature = "ros2")]
pub mod deploy;
pub mod engine;
pub mod episode;
pub mod episode_generator;
pub mod error;
pub mod executor;
pub mod failure_page;
pub mod gaze;
pub mod joint_bounds;
pub mod journal;
pub mod judge;
pub mod language;
pub mod late_sight;
mod light;
pub mod map_server;
pub mod mapping;
#[cfg(feature = "mcap")]
pub mod mcap_file;
pub mod pace;
pub mod perception;
pub mod picture;
pub mod plot;
mod pose_watch;
pub mod recording;
pub mod replay;
pub mod report;
#[cfg(feature = "rerun")]
pub mod rerun_file;
pub mod run;
pub mod sequence;
pub mod session;
pub mod settings;
pub mod skills;
pub mod summary;
pub mod survey;
pub mod touch;
mod verdict;
pub mod ways;
