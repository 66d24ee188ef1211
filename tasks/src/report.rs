//! `report.html`.

use crate::cli::Timing;
use crate::run::Finished;

/// The page of a run.
pub fn page(finished: &Finished, timing: &Timing) -> String {
    format!("{:?} {:?}", finished.summary, timing)
}
