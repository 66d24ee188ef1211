//! Navigation: costmap, frontiers, planner, follower.
