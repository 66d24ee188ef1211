//! What can go wrong on the way to a robot.

use thiserror::Error;

/// Why there is no robot behind ROS 2.
#[derive(Debug, Error)]
pub enum Ros2Error {
    /// DDS cannot be used: no network, or a name that is none.
    #[error("ROS 2, {what}: {reason}")]
    Setup {
        /// What was made.
        what: String,
        /// Why it could not be.
        reason: String,
    },
    /// Nobody at the other end of topics.
    #[error("nobody answers on {topics:?} within {timeout_s} s (domain {domain})")]
    Silent {
        /// The topics.
        topics: Vec<String>,
        /// How long it was waited for.
        timeout_s: f64,
        /// The DDS domain.
        domain: u16,
    },
}
