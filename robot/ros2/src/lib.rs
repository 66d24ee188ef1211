//! A robot over ROS 2, without a ROS installation.
//!
//! One side is [`client::connect`]: a robot in the ROS 2 graph, behind the driver traits. The other is `server`: any robot
//! behind the driver traits, shown to the graph as one that speaks ROS 2. Between them stand the messages ([`messages`])
//! and a place in the graph ([`link`]); names and ways are in
//! [`settings`], the table `[ros2]` of `robot.toml`.
//!
//! Nothing here knows whether a robot is simulated. What is lost on the way is lost as on a real robot, unless the clock is
//! `lock-step`: then time stands still until all messages of a step have come.

pub mod account;
pub mod bag;
pub mod client;
pub mod customer;
pub mod error;
pub mod link;
pub mod map_out;
pub mod messages;
pub mod orders;
pub mod server;
pub use dsm_robot::model::ros2 as settings;
mod wall;
