//! The edge: wall time, pauses and the environment. Nothing else in this crate touches them.

use std::time::{Duration, Instant};

/// Wall time as the client sees it. Tests put a clock of their own here, on which pauses take no time.
pub trait Wall: Send + Sync {
    /// Seconds since some fixed moment.
    fn now_s(&self) -> f64;

    /// Lets this many seconds pass.
    fn pause(&self, seconds: f64);
}

/// The machine's clock.
#[derive(Clone, Copy, Debug)]
pub struct SystemWall {
    start: Instant,
}

impl SystemWall {
    /// A clock that starts now.
    #[expect(clippy::disallowed_methods, reason = "a model's server lives in wall time")]
    pub fn new() -> Self {
        Self { start: Instant::now() }
    }
}

impl Default for SystemWall {
    fn default() -> Self {
        Self::new()
    }
}

impl Wall for SystemWall {
    fn now_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "a server that asks for a pause gets one; no control tick waits here"
    )]
    fn pause(&self, seconds: f64) {
        if seconds > 0.0 {
            std::thread::sleep(Duration::from_secs_f64(seconds));
        }
    }
}

/// A key from the environment, without the line end that files leave behind; `None` when it is not set or empty.
pub(crate) fn read_key(variable: &str) -> Option<String> {
    let key = std::env::var(variable).ok()?.trim().to_owned();
    (!key.is_empty()).then_some(key)
}
