//! Slow work beside the control tick, with a result at a declared moment.

use dsm::time::Stamp;
use std::thread::JoinHandle;

/// A computation on another thread whose result shows at a declared simulated moment: never earlier, so that a run does
/// not depend on the machine's speed.
pub struct Deferred<T> {
    ready: Stamp,
    thread: Option<JoinHandle<T>>,
}

impl<T: Send + 'static> Deferred<T> {
    /// Starts `work`; its result shows at `ready`.
    pub fn start(ready: Stamp, work: impl FnOnce() -> T + Send + 'static) -> Self {
        Self { ready, thread: Some(std::thread::spawn(work)) }
    }

    /// The result, once, when its moment has come. `None` before, afterwards, and when the work panicked.
    pub fn find(&mut self, now: Stamp) -> Option<T> {
        if now < self.ready {
            return None;
        }
        self.thread.take()?.join().ok()
    }

    /// Whether the result is still to come.
    pub fn is_pending(&self) -> bool {
        self.thread.is_some()
    }
}
