//! Real time, in which hardware and others live. The only place that reads it.

use dsm::time::Stamp;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The machine's clock, since the epoch.
#[allow(clippy::disallowed_methods, reason = "hardware lives by the machine's clock")]
pub(crate) fn machine_now() -> Stamp {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
}

/// Now, to measure how long others take.
#[allow(clippy::disallowed_methods, reason = "how long to wait for others is a matter of real time")]
pub(crate) fn instant() -> Instant {
    Instant::now()
}
