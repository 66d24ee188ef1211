//! Messages that come late, twice, not at all or in the wrong order, put in order.

use dsm::time::{Span, Stamp};
use std::collections::BTreeMap;

/// What became of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// It waits for its turn.
    Waits,
    /// A later one was given out already: it is dropped.
    Late {
        /// By how much it is older than the last one that was given out.
        by: Span,
    },
    /// One with this stamp waits or was given out already: it is dropped.
    Repeated,
}

/// What came in so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flow {
    /// Messages that were given out.
    pub given: u64,
    /// Messages that came too late.
    pub late: u64,
    /// Messages that came again.
    pub repeated: u64,
    /// Messages that had to make room.
    pub crowded_out: u64,
}

/// Gives messages out in the order of their stamps, each once. It waits for one that may still come, so long and no longer.
#[derive(Clone, Debug)]
pub struct Reorder<T> {
    patience: Span,
    capacity: usize,
    waiting: BTreeMap<Stamp, T>,
    last: Option<Stamp>,
    flow: Flow,
}

impl<T> Reorder<T> {
    /// A buffer that gives each message out when it is `patience` old, and holds at most `capacity`, but at least one; then
    /// the oldest makes room.
    pub fn new(patience: Span, capacity: usize) -> Self {
        Self { patience, capacity: capacity.max(1), waiting: BTreeMap::new(), last: None, flow: Flow::default() }
    }

    /// What came in so far.
    pub fn flow(&self) -> Flow {
        self.flow
    }

    /// Number of messages that wait.
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Takes in a message.
    pub fn put(&mut self, stamp: Stamp, message: T) -> Taken {
        match self.last {
            Some(last) if stamp < last => {
                self.flow.late += 1;
                return Taken::Late { by: last - stamp };
            }
            Some(last) if stamp == last => {
                self.flow.repeated += 1;
                return Taken::Repeated;
            }
            _ => {}
        }
        if self.waiting.contains_key(&stamp) {
            self.flow.repeated += 1;
            return Taken::Repeated;
        }
        self.waiting.insert(stamp, message);
        if self.waiting.len() > self.capacity {
            self.waiting.pop_first();
            self.flow.crowded_out += 1;
        }
        Taken::Waits
    }

    /// Stamp of the message that comes next, when it has waited long enough at `now`.
    pub fn find_ready(&self, now: Stamp) -> Option<Stamp> {
        self.waiting.keys().next().copied().filter(|stamp| now - *stamp >= self.patience)
    }

    /// The message that comes next, when it has waited long enough at `now`.
    pub fn take_ready(&mut self, now: Stamp) -> Option<(Stamp, T)> {
        self.find_ready(now)?;
        let (stamp, message) = self.waiting.pop_first()?;
        self.last = Some(stamp);
        self.flow.given += 1;
        Some((stamp, message))
    }
}
