//! The robot side: driver traits, kinematic model, QP control, navigation, grasp planning and the safety envelope.
//!
//! ```text
//! Map snapshot ──plan──▶ path, grasp ──follow / QP──▶ commands ──Envelope──▶ drivers
//! ```
//!
//! Invariants: a command returns what was actually sent; limits wrap drivers and implement the same traits, so that
//! simulation and hardware are limited by the same code; only [`drivers::Clock::wait_until`] lets time pass.
//! The crate does not know which world is behind a driver.

pub mod calibrate;
pub mod conformance;
pub mod control;
pub mod drivers;
pub mod faults;
pub mod grasp;
pub mod joints;
pub mod model;
pub mod nav;
pub mod recorded;
pub mod safety;
pub mod timing;
