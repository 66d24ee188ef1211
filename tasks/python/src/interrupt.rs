//! Ctrl-C during a long call: the run ends in order, then Python hears of it.

use dsm_tasks::run::Progress;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Shared by a run and whoever may end it early.
#[derive(Clone, Default)]
pub(crate) struct Interrupt {
    /// Set to end the run; the loop then stops the robot.
    pub(crate) flag: Arc<AtomicBool>,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Interrupt {
    /// Ends the run for an exception; the first one counts.
    pub(crate) fn raise(&self, error: PyErr) {
        if let Ok(mut raised) = self.raised.lock() {
            raised.get_or_insert(error);
        }
        self.flag.store(true, Ordering::Relaxed);
    }

    /// Ends the run when a signal has come: handlers run on Python's main thread alone, elsewhere this does nothing.
    pub(crate) fn heed_signals(&self) {
        if let Err(error) = Python::attach(|py| py.check_signals()) {
            self.raise(error);
        }
    }

    /// Hands out the exception that ended the run.
    pub(crate) fn result(&self) -> PyResult<()> {
        match self.raised.lock().ok().and_then(|mut raised| raised.take()) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

/// Heeds signals while a run goes on.
pub(crate) struct Heeding {
    interrupt: Interrupt,
    samples: u32,
}

impl Heeding {
    pub(crate) fn new(interrupt: Interrupt) -> Self {
        Self { interrupt, samples: 0 }
    }
}

impl Progress for Heeding {
    fn at(&mut self, _: f64) {
        /// One look in this many samples, half a simulated second apart: looking takes the interpreter lock.
        const EVERY: u32 = 10;
        self.samples += 1;
        if self.samples.is_multiple_of(EVERY) {
            self.interrupt.heed_signals();
        }
    }
}
