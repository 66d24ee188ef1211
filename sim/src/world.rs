//! A scene, a robot and a seed put together, and the truth about it.

mod placement;
mod solids;
mod truth;

pub(crate) use solids::{Column, Solids};
pub(crate) use truth::{FLOOR_TOP_M, TruthSampler};
