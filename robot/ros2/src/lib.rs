//! A robot over ROS 2, without a ROS installation.
//!
//! One side is [`client::connect`]: a robot in the ROS 2 graph, behind the driver traits. The other is `server`: any robot
//! behind the driver traits, shown to the graph as one that speaks ROS 2. Between them stand the messages ([`messages`])
//! and a place in the graph ([`link`]); names and ways are in [`settings`].
//!
//! Nothing here knows whether a robot is simulated. What is lost on the way is lost as on a real robot, unless the clock is
//! `lock-step`: then time stands still until all messages of a step have come.

pub mod client;
pub mod error;
pub mod link;
pub mod messages;
pub mod server;
pub mod settings;
