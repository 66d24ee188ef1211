//! What a robot was asked and what it answered, kept and played again.
//!
//! ```text
//! limits ──▶ Recording<R> ──▶ R            each Period and frame goes to a RecordSink
//! limits ──▶ Replayed ◀── PeriodSource     each command is compared with the recorded one
//! ```
//!
//! [`Recording`] stands directly around a driver, below the limits, so that these are played again, too. Only waiting lets
//! time pass: what is asked between two waits makes up one [`Period`]. Within it the n-th question to a part gets the n-th
//! recorded answer, whatever other parts were asked meanwhile; a question too many gets the last answer again, for reading
//! never lets time pass. A command that differs, or a part that was never asked then, is a [`Difference`], and with the
//! first one the replay is over: answers that follow belong to other commands.

mod period;
mod recording;
mod replayed;

pub use period::{
    Answers, Exchange, FrameRead, GripperTalk, JointReading, JointTalk, JointValues, Period, StopCommand, Waited,
};
pub use recording::{RecordSink, Recording};
pub use replayed::{Difference, PeriodSource, ReplayEnd, Replayed};

#[cfg(test)]
mod tests;
