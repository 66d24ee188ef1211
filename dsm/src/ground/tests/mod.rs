//! Contract: ordinary referring expressions find the one thing that is meant, say so when there is none or more than one,
//! and any text at all gets a typed answer.

mod cases;
mod commands;
mod drawers;
mod hostile;
pub(super) mod house;
mod robustness;
