//! Takes in a run in the control loop's order and writes it on a thread of its own.

use super::entry::{End, Entry, EntryFile, Head, Learnt, Noted};
use crate::error::TaskError;
use crate::executor::Account;
use crate::journal::{Event, Witness};
use crate::perception::{Learned, Tape, Taped};
use crate::run::RunSpec;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::map::{Map, ObjectId};
use dsm::store::{StoreError, digest_update};
use dsm::time::{Span, Stamp};
use dsm_robot::model::RobotModel;
use dsm_robot::recorded::{Period, RecordSink};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

/// Entries that may wait for the disk before the run waits, too. A frame takes two megabytes.
const WAITING: usize = 48;
/// What was written reaches the operating system so often, in simulated time.
const FLUSH_EVERY: Span = Span(500_000_000);

/// How a recording ended.
#[derive(Debug)]
pub enum RecordingEnd {
    /// All of the run is in it.
    Whole {
        /// Its size, about.
        bytes: u64,
    },
    /// It became as large as it may; it can be replayed up to here.
    Full {
        /// The last moment in it.
        stamp: Stamp,
    },
    /// It could not be written any further. The run went on.
    Broken {
        /// The last moment in it.
        stamp: Stamp,
        /// Why.
        source: StoreError,
    },
}

/// A recording under way.
pub struct Recorder {
    entries: SyncSender<Entry>,
    writer: JoinHandle<RecordingEnd>,
}

impl Recorder {
    /// Records into a file, of which at most `max_bytes` are used, but for the head of the file and what waits already.
    pub fn start(file: Box<dyn EntryFile>, max_bytes: u64) -> Self {
        let (entries, inbox) = sync_channel(WAITING);
        Self { entries, writer: std::thread::spawn(move || write(file, max_bytes, &inbox)) }
    }

    /// Notes what is needed to run again.
    pub(crate) fn begin(&mut self, spec: &RunSpec, model: &RobotModel, detector: &str) -> Result<(), TaskError> {
        send(&self.entries, Entry::Head(Box::new(Head::new(spec, model, detector)?)));
        Ok(())
    }

    /// Takes in what the drivers are asked and answer.
    pub(crate) fn sink(&self) -> Box<dyn RecordSink> {
        Box::new(Sink(self.entries.clone()))
    }

    /// Takes in what is learned, as the mapping worker has it, and in the loop's order.
    pub(crate) fn watch(&self) -> (Box<dyn Tape>, Box<dyn Witness>) {
        let (tape, lessons) = learning_tape();
        (tape, Box::new(Scribe { entries: self.entries.clone(), lessons }))
    }

    /// Writes how the run ended and closes the file. All else that records must have been dropped.
    pub(crate) fn finish(self, account: &Account, map: &Map) -> Result<RecordingEnd, TaskError> {
        send(&self.entries, Entry::End(Box::new(End::new(account, map))));
        self.close()
    }

    /// Closes the file of what is no run of an episode and has no end of its own. All else that records must have been
    /// dropped.
    pub(crate) fn close(self) -> Result<RecordingEnd, TaskError> {
        drop(self.entries);
        self.writer.join().map_err(|_| TaskError::Internal("the recording's writer panicked".into()))
    }
}

fn send(entries: &SyncSender<Entry>, entry: Entry) {
    // A writer that is gone has told why; the run goes on.
    let _ = entries.send(entry);
}

struct Sink(SyncSender<Entry>);

impl RecordSink for Sink {
    fn frame(&mut self, frame: &RgbdFrame) {
        send(&self.0, Entry::Frame(Box::new(frame.clone())));
    }

    fn period(&mut self, period: Period) {
        send(&self.0, Entry::Period(Box::new(period)));
    }
}

/// What only the mapping worker knows of a frame.
pub(super) struct Lesson {
    frame: FrameId,
    associations: Vec<(u32, ObjectId)>,
    digest: u64,
}

struct LearningTape(Sender<Lesson>);

/// A tape that tells of each frame what the loop does not see.
pub(super) fn learning_tape() -> (Box<dyn Tape>, Lessons) {
    let (sender, receiver) = channel();
    (Box::new(LearningTape(sender)), Lessons { receiver, early: VecDeque::new() })
}

impl Tape for LearningTape {
    fn record(&mut self, taped: &Taped<'_>) -> Result<(), StoreError> {
        let associations = taped.associations.iter().map(|(place, id)| (*place as u32, *id)).collect();
        let lesson = Lesson { frame: taped.frame.id, associations, digest: digest_update(taped.update) };
        // Nobody listens any more: then nobody misses it.
        let _ = self.0.send(lesson);
        Ok(())
    }

    fn finish(self: Box<Self>, _: &Map) -> Result<(), StoreError> {
        Ok(())
    }
}

/// Hands over what the tape told, as its frames come up in the loop.
pub(super) struct Lessons {
    receiver: Receiver<Lesson>,
    early: VecDeque<Lesson>,
}

impl Lessons {
    /// All that a frame taught. The tape told its part before the loop could learn of it.
    pub(super) fn complete(&mut self, learned: &Learned) -> Learnt {
        self.early.extend(self.receiver.try_iter());
        while self.early.front().is_some_and(|lesson| lesson.frame != learned.frame.id) {
            self.early.pop_front();
        }
        let (associations, digest) =
            self.early.pop_front().map_or((Vec::new(), 0), |lesson| (lesson.associations, lesson.digest));
        let (frame, stamp) = (learned.frame.id, learned.frame.stamp);
        Learnt { frame, stamp, detections: learned.detections.clone(), associations, digest }
    }
}

/// Writes down what the loop learns and decides.
struct Scribe {
    entries: SyncSender<Entry>,
    lessons: Lessons,
}

impl Witness for Scribe {
    fn learned(&mut self, learned: &Learned) {
        send(&self.entries, Entry::Learnt(Box::new(self.lessons.complete(learned))));
        send(&self.entries, Entry::Map(learned.map.clone()));
    }

    fn event(&mut self, event: &Event) {
        send(&self.entries, Entry::Noted(Noted::from(event)));
    }
}

impl From<&Event> for Noted {
    fn from(event: &Event) -> Self {
        Self { stamp: Stamp::from_s(event.at_s), what: event.what.clone() }
    }
}

/// Writes until nobody sends any more, or no further.
fn write(mut file: Box<dyn EntryFile>, max_bytes: u64, inbox: &Receiver<Entry>) -> RecordingEnd {
    let (mut stamp, mut flushed) = (Stamp::default(), Stamp::default());
    let mut step = |entry: &Entry| -> Result<bool, StoreError> {
        if file.len_bytes() >= max_bytes {
            file.put(&Entry::Full(stamp))?;
            return Ok(false);
        }
        file.put(entry)?;
        if let Entry::Period(period) = entry {
            stamp = period.now;
            if stamp - flushed >= FLUSH_EVERY {
                flushed = stamp;
                file.flush()?;
            }
        }
        Ok(true)
    };
    let mut end = None;
    for entry in inbox {
        // What cannot be kept is still taken, so that the run never waits for it.
        if end.is_some() {
            continue;
        }
        match step(&entry) {
            Ok(true) => {}
            Ok(false) => end = Some(Ok(())),
            Err(source) => end = Some(Err(source)),
        }
    }
    let bytes = file.len_bytes();
    let closed = file.finish();
    match (end, closed) {
        (Some(Err(source)), _) | (_, Err(source)) => RecordingEnd::Broken { stamp, source },
        (Some(Ok(())), Ok(())) => RecordingEnd::Full { stamp },
        (None, Ok(())) => RecordingEnd::Whole { bytes },
    }
}
