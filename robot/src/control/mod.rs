//! The QP controller: velocities that follow a tool pose within limits and away from obstacles.

pub mod config;

pub use config::ControllerConfig;
