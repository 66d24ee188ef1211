//! What was encoded once is remembered: a home has few names, and a network takes milliseconds for each.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Texts that are remembered.
const MOST: usize = 8192;

/// Features by text.
#[derive(Debug, Default)]
pub(super) struct Remembered(Mutex<BTreeMap<String, Vec<f32>>>);

impl Remembered {
    /// The feature of a text, made when it is asked for the first time. Two threads may make the same one at once.
    pub(super) fn find_or(&self, text: &str, make: impl FnOnce() -> Vec<f32>) -> Vec<f32> {
        if let Some(known) = self.lock().get(text) {
            return known.clone();
        }
        let feature = make();
        let mut known = self.lock();
        if known.len() >= MOST {
            known.clear();
        }
        known.insert(text.to_owned(), feature.clone());
        feature
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Vec<f32>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
