//! Runs a recording again.

use super::detector::RecordedDetector;
use super::entry::{Entry, EntrySource, FORMAT, Head, Learnt, Noted, Wanted, robot_digest};
use super::recorder::{Lessons, learning_tape};
use super::report::{Outcome, ReplayReport, compare};
use super::source::Periods;
use crate::agent::Halt;
use crate::assemble::{enveloped, find_robot};
use crate::crew::{Crew, Gear, settle};
use crate::deferred::Waiting;
use crate::error::TaskError;
use crate::journal::{Event, Witness};
use crate::language::embedded;
use crate::perception::Learned;
use dsm::map::Map;
use dsm::perceive::{Detector, PixelSegmenter};
use dsm_robot::model::RobotModel;
use dsm_robot::recorded::{ReplayEnd, Replayed};
use dsm_robot::safety::StopSwitch;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Who detects in a replay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Sight {
    /// What was detected then.
    #[default]
    Recorded,
    /// Things are found in the recorded pixels once more, by the embedded segmenter without names.
    Pixels,
}

/// How to replay.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlayOptions {
    /// Who detects.
    pub sight: Sight,
}

/// What a replay came to.
pub struct Played {
    /// The comparison.
    pub report: ReplayReport,
    /// The map at its end.
    pub map: Arc<Map>,
    /// Its events.
    pub events: Vec<Noted>,
}

/// Replays the recording that `open` opens, as often as it is called.
///
/// # Errors
/// [`TaskError`]: no recording, a damaged one, or one of a robot that cannot be had.
pub fn play(
    open: &dyn Fn(Wanted) -> Result<Box<dyn EntrySource>, TaskError>,
    options: PlayOptions,
) -> Result<Played, TaskError> {
    let mut source = open(Wanted::All)?;
    let head = read_head(&mut *source)?;
    let model = Arc::new(RobotModel::load(&find_robot(&head.robot)?)?);
    let notices = notices(&head, &model)?;
    let detector: Box<dyn Detector> = match options.sight {
        Sight::Recorded => Box::new(RecordedDetector::new(head.detector.clone(), open(Wanted::AllButFrames)?)),
        Sight::Pixels => Box::new(PixelSegmenter),
    };
    let detector_name = format!("{:?}: {}", options.sight, detector.name()).to_lowercase();
    // The robot answers from the recording, below the same limits.
    let interrupted = Arc::new(AtomicBool::new(false));
    let ((expect, expected), (ended, ends)) = (channel(), channel());
    let periods = Periods::new(source, expect, interrupted.clone());
    let replayed = Replayed::new(&model, Box::new(periods), ended);
    let (tape, lessons) = learning_tape();
    let gear = Gear {
        robot: enveloped(replayed, &model, StopSwitch::default()),
        model,
        detector,
        language: embedded(),
        waiting: Waiting::ForResults,
        tapes: vec![tape],
        time_limit_s: head.time_limit_s,
        interrupted,
        on_tick: Box::new(|_| {}),
        on_frame: Box::new(|_| {}),
    };
    let Crew { mut agent, mut executor, .. } = Crew::new(gear)?;
    let (heard, hears) = channel();
    agent.journal.witness = Some(Box::new(Listener { lessons, heard }));
    // From here on as any run.
    let account = executor.run(&mut agent, &head.episode.steps);
    if account.halt.is_none() {
        settle(&mut agent);
    }
    let (map, mut journal) = agent.finish()?;
    journal.witness = None;
    if let Some(Halt::Failed(error)) = account.halt {
        return Err(error);
    }
    let (mut learnt, mut events) = (Vec::new(), Vec::new());
    for heard in hears {
        match heard {
            Heard::Learnt(one) => learnt.push(one),
            Heard::Noted(one) => events.push(one),
        }
    }
    let report = compare(Outcome {
        head: &head,
        detector: detector_name,
        expected: expected.iter().collect(),
        end: ends.iter().next(),
        learnt: &learnt,
        noted: &events,
        account: &account,
        map: &map,
        notices,
    })?;
    Ok(Played { report, map, events })
}

/// The robot of a recording without anything around it, its model, and where it is told why it answers no further.
pub(crate) fn recorded_robot(
    mut source: Box<dyn EntrySource>,
) -> Result<(Replayed, Arc<RobotModel>, Receiver<ReplayEnd>), TaskError> {
    let head = read_head(&mut *source)?;
    let model = Arc::new(RobotModel::load(&find_robot(&head.robot)?)?);
    for notice in notices(&head, &model)? {
        tracing::warn!("{notice}");
    }
    let (ended, ends) = channel();
    // What was learned and decided is compared with nothing here.
    let (expect, _) = channel();
    let periods = Periods::new(source, expect, Arc::default());
    Ok((Replayed::new(&model, Box::new(periods), ended), model, ends))
}

/// The first entry.
pub(crate) fn read_head(source: &mut dyn EntrySource) -> Result<Head, TaskError> {
    let first = source.next_entry()?;
    match first {
        Some(Entry::Head(head)) if head.format == FORMAT => Ok(*head),
        Some(Entry::Head(head)) => {
            Err(TaskError::Usage(format!("version {} of a recording is not known, expected {FORMAT}", head.format)))
        }
        _ => {
            let why = source.find_break().unwrap_or_else(|| "`dsm run --record` writes one".into());
            Err(TaskError::Usage(format!("no recording of a run: it does not begin with a head; {why}")))
        }
    }
}

fn notices(head: &Head, model: &RobotModel) -> Result<Vec<String>, TaskError> {
    let mut notices = Vec::new();
    if head.program != env!("CARGO_PKG_VERSION") {
        notices.push(format!("recorded by version {}, replayed by {}", head.program, env!("CARGO_PKG_VERSION")));
    }
    if robot_digest(&head.robot, model)? != head.robot_digest {
        notices.push(format!("the description of robot `{}` has changed since", head.robot));
    }
    Ok(notices)
}

enum Heard {
    Learnt(Learnt),
    Noted(Noted),
}

/// Hears what the replay learns and decides.
struct Listener {
    lessons: Lessons,
    heard: Sender<Heard>,
}

impl Witness for Listener {
    fn learned(&mut self, learned: &Learned) {
        let mut learnt = self.lessons.complete(learned);
        learnt.detections.items.clear();
        // Nobody compares any more: then nobody needs it.
        let _ = self.heard.send(Heard::Learnt(learnt));
    }

    fn event(&mut self, event: &Event) {
        let _ = self.heard.send(Heard::Noted(event.into()));
    }
}
