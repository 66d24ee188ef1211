//! Few requests at a time: each takes a place and gives it back.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Places for requests.
pub(crate) struct Places {
    free: Mutex<u32>,
    given_back: Condvar,
}

/// A place; it is given back when this is dropped.
pub(crate) struct Place<'a> {
    places: &'a Places,
}

impl Places {
    pub(crate) fn new(count: u32) -> Self {
        Self { free: Mutex::new(count), given_back: Condvar::new() }
    }

    /// A place, as soon as one is free; `None` when none gets free in time.
    pub(crate) fn take(&self, limit_s: f64) -> Option<Place<'_>> {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let limit = Duration::from_secs_f64(limit_s);
        let waited = self.given_back.wait_timeout_while(free, limit, |free| *free == 0);
        let (mut free, timed_out) = waited.unwrap_or_else(PoisonError::into_inner);
        if timed_out.timed_out() && *free == 0 {
            return None;
        }
        *free -= 1;
        Some(Place { places: self })
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        *self.places.free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        self.places.given_back.notify_one();
    }
}
