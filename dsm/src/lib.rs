//! The Diverse Semantic Map (DSM): what the robot knows about its surroundings, how it is built from RGB-D frames, and how words are grounded in it.
//!
//! Data flows in one direction:
//!
//! ```text
//! RgbdFrame ──Detector──▶ Detections ──build──▶ MapUpdate ──Map::apply──▶ Map ──ground──▶ Grounding
//! ```
//!
//! Invariants: every change to the map goes through [`map::Map::apply`]; every result is a function of its inputs,
//! the frame's stamp and a seed. The crate does not know that a robot or a simulator exists.

pub mod build;
pub mod camera;
pub mod config;
pub mod eval;
pub mod eval_grounding;
pub mod frame;
pub mod geometry;
pub mod ground;
pub mod knowledge;
pub mod map;
pub mod perceive;
pub mod raster;
pub mod store;
pub mod time;

/// A rigid transform, metres. Named `target_from_source`: it maps coordinates in `source` to coordinates in `target`.
pub type Pose = nalgebra::Isometry3<f64>;
