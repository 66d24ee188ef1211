//! A recording as the replayed robot needs it: period by period, its frames, and on the side what was learned and decided.

use super::entry::{End, Entry, EntrySource, Learnt, Noted};
use crate::error::TaskError;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::Stamp;
use dsm_robot::recorded::{Period, PeriodSource};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;

/// What the replay has to come to.
pub(super) enum Expected {
    /// What a frame taught, without its detections.
    Learnt(Learnt),
    /// An event.
    Noted(Noted),
    /// A period was replayed: its moment, and how many commands it holds.
    Period(Stamp, usize),
    /// How the run ended.
    End(Box<End>),
    /// The recording is no longer than this because of its bound.
    Full(Stamp),
    /// The file breaks off, and why.
    Break(String),
    /// The file is damaged.
    Damaged(TaskError),
}

/// Gives the periods of a recording.
pub(super) struct Periods {
    source: Box<dyn EntrySource>,
    frames: BTreeMap<FrameId, RgbdFrame>,
    expected: Sender<Expected>,
    /// Set where Ctrl-C ended the run.
    interrupted: Arc<AtomicBool>,
    is_over: bool,
}

impl Periods {
    pub(super) fn new(source: Box<dyn EntrySource>, expected: Sender<Expected>, interrupted: Arc<AtomicBool>) -> Self {
        Self { source, frames: BTreeMap::new(), expected, interrupted, is_over: false }
    }

    fn expect(&self, expected: Expected) {
        // Nobody compares any more: then nobody needs it.
        let _ = self.expected.send(expected);
    }

    /// Reads on to the next period.
    fn find_period(&mut self) -> Result<Option<Period>, TaskError> {
        while let Some(entry) = self.source.next_entry()? {
            match entry {
                Entry::Period(period) => return Ok(Some(*period)),
                Entry::Frame(frame) => drop(self.frames.insert(frame.id, *frame)),
                Entry::Learnt(mut learnt) => {
                    learnt.detections.items.clear();
                    self.expect(Expected::Learnt(*learnt));
                }
                Entry::Noted(noted) => self.expect(Expected::Noted(noted)),
                Entry::Full(stamp) => self.expect(Expected::Full(stamp)),
                Entry::End(end) => {
                    self.interrupted.store(end.interrupted, Ordering::Relaxed);
                    self.expect(Expected::End(end));
                }
                Entry::Head(_) | Entry::Map(_) => {}
            }
        }
        if let Some(why) = self.source.find_break() {
            self.expect(Expected::Break(why));
        }
        Ok(None)
    }

    /// As [`Self::find_period`]; damage is told on the side, too.
    fn read(&mut self) -> Result<Option<Period>, String> {
        if self.is_over {
            return Ok(None);
        }
        let found = self.find_period();
        self.is_over = !matches!(found, Ok(Some(_)));
        found.map_err(|error| {
            let reason = error.to_string();
            self.expect(Expected::Damaged(error));
            reason
        })
    }
}

/// Commands of a period to all parts.
fn count_commands(period: &Period) -> usize {
    let joints = period.arm.commands.len() + period.head.commands.len();
    period.base.len() + joints + period.gripper.commands.len() + period.stop.len()
}

impl PeriodSource for Periods {
    fn next_period(&mut self) -> Result<Option<Period>, String> {
        // Frames of the period that is over were not asked for.
        self.frames.clear();
        let found = self.read()?;
        if let Some(period) = &found {
            self.expect(Expected::Period(period.now, count_commands(period)));
            if period.waited.is_none() {
                // The last one: what follows is how the run ended.
                while self.read()?.is_some() {}
            }
        }
        Ok(found)
    }

    fn take_frame(&mut self, id: FrameId) -> Option<RgbdFrame> {
        self.frames.remove(&id)
    }
}
