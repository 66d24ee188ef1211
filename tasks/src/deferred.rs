//! Slow work beside the control tick, with a result at a declared moment.

use dsm::time::Stamp;
use std::thread::JoinHandle;

/// What happens when a result's declared moment has come and the result has not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Waiting {
    /// Time stands still until it is there: a world that waits for us, so that nothing depends on the machine's speed.
    #[default]
    ForResults,
    /// Nothing waits, the result is late: a world that goes on without us.
    Never,
}

/// A computation on another thread whose result shows at a declared simulated moment: never earlier, and later
/// only where nothing waits.
pub struct Deferred<T> {
    ready: Stamp,
    waiting: Waiting,
    thread: Option<JoinHandle<T>>,
}

impl<T: Send + 'static> Deferred<T> {
    /// Starts `work`; its result shows at `ready`.
    pub fn start(ready: Stamp, waiting: Waiting, work: impl FnOnce() -> T + Send + 'static) -> Self {
        Self { ready, waiting, thread: Some(std::thread::spawn(work)) }
    }

    /// The result, once, when its moment has come. `None` before, afterwards, and when the work panicked.
    pub fn find(&mut self, now: Stamp) -> Option<T> {
        let is_late = || self.waiting == Waiting::Never && self.thread.as_ref().is_some_and(|work| !work.is_finished());
        if now < self.ready || is_late() {
            return None;
        }
        self.thread.take()?.join().ok()
    }

    /// Whether the result is still to come.
    pub fn is_pending(&self) -> bool {
        self.thread.is_some()
    }
}
