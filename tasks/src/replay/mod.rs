//! Runs that are recorded and replayed.
//!
//! ```text
//! run ─ drivers' answers, frames ─ what was learned ─ events ─▶ Recorder ─▶ file
//! file ─▶ Replayed robot, recorded detector ─▶ limits, agent, skills, map ─▶ compared with the file
//! ```
//!
//! A run is a function of what the drivers answer and of what is detected. Both are recorded below the limits and before
//! anything is made of them, in one order: that of the control loop. A replay runs the same limits, mapping, grounding and
//! skills on them, without a world. It reads no truth: expectations are not judged again.

mod detector;
mod entry;
mod play;
mod recorder;
mod regression;
mod report;
mod source;
mod table;

pub use entry::{End, Entry, EntryFile, EntrySource, FORMAT, Head, Learnt, Noted, Wanted};
pub use play::{PlayOptions, Played, Sight, play};
pub(crate) use play::{read_head, recorded_robot};
pub use recorder::{Recorder, RecordingEnd};
pub use regression::{Decision, RegressionTest, load_test, write_test};
pub use report::{Differing, FirstDifference, ReplayReport};
pub use table::{Table, read_table};
