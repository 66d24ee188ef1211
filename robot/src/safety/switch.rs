//! An emergency stop that can be pressed from anywhere: a signal handler, a key, a topic.

use std::sync::{Arc, OnceLock};

/// A stop that stays pressed. All copies are the same switch; the envelope looks at it in every control period.
#[derive(Clone, Debug, Default)]
pub struct StopSwitch(Arc<OnceLock<String>>);

impl StopSwitch {
    /// Presses it; the first reason stays.
    pub fn press(&self, reason: impl Into<String>) {
        // Who presses what is pressed already changes nothing.
        let _ = self.0.set(reason.into());
    }

    /// Why it was pressed.
    pub fn find_reason(&self) -> Option<&str> {
        self.0.get().map(String::as_str)
    }
}
