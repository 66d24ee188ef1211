//! Navigation: where the base can stand, where it should go to see more, how it gets there.
//!
//! ```text
//! FreeSpace ──▶ Costmap ──▶ Field ──▶ frontiers, viewpoints, standing poses ──▶ Path ──▶ Follower ──▶ Twist
//! ```
//!
//! Everything but [`Follower`] and the memories ([`FrontierMemory`], [`CoverageGrid`], [`LiveObstacles`]) is a function of its inputs.

mod config;
mod costmap;
mod coverage;
mod follower;
mod frontier;
mod gap;
mod goal;
mod grid;
mod live;
mod planner;
mod search;
mod sight;

pub use config::{NavConfig, RangeError};
pub use costmap::{Costmap, CostmapConfig, UnknownPolicy};
pub use coverage::{CoverageConfig, CoverageGrid, Viewpoint};
pub use follower::{BlockReason, FollowOutput, FollowStatus, Follower, FollowerConfig};
pub use frontier::{Frontier, FrontierConfig, FrontierMemory, find_frontiers};
pub use gap::{Gap, find_gap};
pub use goal::{GoalConfig, StandPose, StandRange, find_reach_poses, find_room_pose, find_view_poses};
pub use grid::Grid;
pub use live::{LiveConfig, LiveObstacles, SpeedLimits};
pub use planner::{Field, Path, PlanFailure, Pose2, find_path};
pub use sight::{Sight, Visibility};

pub(crate) use config::check as check_range;
pub use grid::wrap_angle;
#[cfg(test)]
pub(crate) use sight::tests::room_grid;
