//! Perception and mapping beside the control loop.
//!
//! One worker owns detector, builder and map. A frame goes in; its map comes out at the frame's stamp plus a declared
//! latency, whatever the machine's speed, so that a run does not depend on wall time.

use crate::deferred::Waiting;
use crate::error::TaskError;
use crate::late_sight::LateSight;
use crate::mapping::{Mapping, Updates};
use dsm::build::{Carrier, MapBuilder};
use dsm::frame::RgbdFrame;
use dsm::map::{Map, MapUpdate, ObjectId};
use dsm::perceive::{Annotator, Detections, Detector};
use dsm::store::{MapLog, StoreError};
use dsm::time::{Span, Stamp};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;

/// Where nothing waits for the worker, no more frames than this are on their way through it.
const MOST_UNDER_WAY: usize = 3;

struct Job {
    frame: Arc<RgbdFrame>,
    carrier: Carrier,
}

/// All that one frame brought, as the worker has it.
pub struct Taped<'a> {
    /// The frame.
    pub frame: &'a RgbdFrame,
    /// What was detected in it.
    pub detections: &'a Detections,
    /// Who detected it.
    pub detector: &'a str,
    /// Which detections were taken for which objects; see [`MapBuilder::associations`].
    pub associations: &'a [(usize, ObjectId)],
    /// Where the robot itself was.
    pub carrier: &'a Carrier,
    /// What of the map changed.
    pub update: &'a MapUpdate,
    /// The map after it.
    pub map: &'a Map,
}

/// Keeps what the worker does, frame by frame. Nothing that it does changes a map.
pub trait Tape: Send {
    /// Takes in a frame.
    fn record(&mut self, taped: &Taped<'_>) -> Result<(), StoreError>;

    /// Comes to its end with the last map.
    fn finish(self: Box<Self>, map: &Map) -> Result<(), StoreError>;
}

impl Tape for MapLog {
    fn record(&mut self, taped: &Taped<'_>) -> Result<(), StoreError> {
        self.append(taped.update.clone(), taped.map)
    }

    fn finish(self: Box<Self>, map: &Map) -> Result<(), StoreError> {
        MapLog::finish(*self, map)
    }
}

/// Who detects.
pub enum Sight {
    /// A detector that is asked about every frame and keeps up with them.
    Prompt(Box<dyn Detector>),
    /// One that takes its time.
    Late(LateSight),
}

/// What one frame taught.
pub struct Learned {
    /// The frame; with a detector that takes its time, the latest one that it told of.
    pub frame: Arc<RgbdFrame>,
    /// What was detected in it.
    pub detections: Detections,
    /// The map after it.
    pub map: Arc<Map>,
}

/// The worker and what is under way.
pub struct Perception {
    jobs: Option<Sender<Job>>,
    results: Receiver<Result<Learned, StoreError>>,
    under_way: VecDeque<Stamp>,
    latency: Span,
    waiting: Waiting,
    worker: Option<JoinHandle<Result<(), StoreError>>>,
}

impl Perception {
    /// Starts the worker. `tapes` get every frame; results show `latency` after the frame's stamp.
    pub fn start(
        detector: Box<dyn Detector>,
        builder: MapBuilder,
        map: Map,
        tapes: Vec<Box<dyn Tape>>,
        latency: Span,
    ) -> Self {
        Self::start_annotated(Sight::Prompt(detector), builder, None, map, tapes, latency)
    }

    /// As [`Self::start`]; `annotator` describes frames in its own time, and nothing waits for it but the end.
    pub fn start_annotated(
        sight: Sight,
        builder: MapBuilder,
        annotator: Option<Box<dyn Annotator>>,
        map: Map,
        tapes: Vec<Box<dyn Tape>>,
        latency: Span,
    ) -> Self {
        let (jobs, inbox) = channel::<Job>();
        let (outbox, results) = channel();
        let updates = if tapes.is_empty() { Updates::Dropped } else { Updates::Kept };
        let mapping = Mapping::new(builder, annotator, map, updates);
        let worker = std::thread::spawn(move || work(sight, mapping, tapes, &inbox, &outbox));
        Self {
            jobs: Some(jobs),
            results,
            under_way: VecDeque::new(),
            latency,
            waiting: Waiting::default(),
            worker: Some(worker),
        }
    }

    /// Says what happens when a result is late; by default time waits for it. Where nothing waits, frames that come while
    /// several are under way are not learned from.
    pub fn waiting(mut self, waiting: Waiting) -> Self {
        self.waiting = waiting;
        self
    }

    /// Hands a frame to the worker. `carrier` says where the robot itself was.
    pub fn submit(&mut self, frame: Arc<RgbdFrame>, carrier: Carrier) -> Result<(), TaskError> {
        if self.waiting == Waiting::Never && self.under_way.len() >= MOST_UNDER_WAY {
            return Ok(());
        }
        self.under_way.push_back(frame.stamp + self.latency);
        let sent = self.jobs.as_ref().is_some_and(|jobs| jobs.send(Job { frame, carrier }).is_ok());
        if sent { Ok(()) } else { Err(TaskError::Internal("the mapping worker ended".into())) }
    }

    /// The next result whose time has come.
    pub fn find_learned(&mut self, now: Stamp) -> Result<Option<Learned>, TaskError> {
        if self.under_way.front().is_none_or(|&ready| ready > now) {
            return Ok(None);
        }
        let result = match self.waiting {
            Waiting::ForResults => self.results.recv().map_err(|_| TryRecvError::Disconnected),
            Waiting::Never => self.results.try_recv(),
        };
        if matches!(result, Err(TryRecvError::Empty)) {
            return Ok(None);
        }
        self.under_way.pop_front();
        match result {
            Ok(learned) => Ok(Some(learned?)),
            Err(_) => Err(TaskError::Internal("the mapping worker ended".into())),
        }
    }

    /// Waits for all frames under way, ends the tapes with the last map, and gives back the results that had not shown.
    pub fn finish(mut self) -> Result<Vec<Learned>, TaskError> {
        drop(self.jobs.take());
        let rest = self.results.iter().collect::<Result<Vec<_>, _>>()?;
        match self.worker.take().map(JoinHandle::join) {
            Some(Ok(ended)) => ended?,
            Some(Err(_)) => return Err(TaskError::Internal("the mapping worker panicked".into())),
            None => {}
        }
        Ok(rest)
    }
}

fn work(
    mut sight: Sight,
    mapping: Mapping,
    tapes: Vec<Box<dyn Tape>>,
    inbox: &Receiver<Job>,
    outbox: &Sender<Result<Learned, StoreError>>,
) -> Result<(), StoreError> {
    let detector = match &sight {
        Sight::Prompt(detector) => detector.name().to_owned(),
        Sight::Late(late) => late.name().to_owned(),
    };
    let mut worker = Worker { mapping, tapes, detector };
    worker.mapping.builder.credit_names_to(&worker.detector);
    let mut last = None;
    while let Ok(job) = inbox.recv() {
        last = Some(job.frame.clone());
        let learned = worker.learn(&mut sight, job);
        let broken = learned.is_err();
        if outbox.send(learned).is_err() {
            break;
        }
        if broken {
            return Ok(());
        }
    }
    // What a detector or a model still has to say counts for the map that is kept.
    let mut changed = false;
    if let Sight::Late(late) = &mut sight {
        for seen in late.finish() {
            worker.observe(&seen.frame, &seen.detections, &seen.carrier)?;
            changed = true;
        }
    }
    changed |= worker.mapping.finish();
    if changed && let Some(frame) = last {
        let detections = Detections { frame: frame.id, items: Vec::new() };
        let _ = outbox.send(Ok(worker.learned(frame, detections)));
    }
    worker.tapes.into_iter().try_for_each(|tape| tape.finish(&worker.mapping.map))
}

/// The map under construction, and who keeps what it is made of.
struct Worker {
    mapping: Mapping,
    tapes: Vec<Box<dyn Tape>>,
    detector: String,
}

impl Worker {
    /// Learns from a frame, and from earlier ones whose detections have come.
    fn learn(&mut self, sight: &mut Sight, job: Job) -> Result<Learned, StoreError> {
        let Job { frame, carrier } = job;
        let late = match sight {
            Sight::Prompt(detector) => {
                let detections = detector.detect(&frame);
                self.observe(&frame, &detections, &carrier)?;
                return Ok(self.learned(frame, detections));
            }
            Sight::Late(late) => late,
        };
        let mut told = None;
        for seen in late.find_seen(frame.stamp) {
            self.observe(&seen.frame, &seen.detections, &seen.carrier)?;
            told = Some((seen.frame, seen.detections));
        }
        let nothing = Detections { frame: frame.id, items: Vec::new() };
        if !late.take_up(&frame, &carrier) {
            self.observe(&frame, &nothing, &carrier)?;
        }
        let (frame, detections) = told.unwrap_or((frame, nothing));
        Ok(self.learned(frame, detections))
    }

    fn observe(&mut self, frame: &RgbdFrame, detections: &Detections, carrier: &Carrier) -> Result<(), StoreError> {
        let Some(update) = self.mapping.observe(frame, detections, carrier) else { return Ok(()) };
        let (associations, map) = (self.mapping.builder.associations(), &self.mapping.map);
        let taped = Taped { frame, detections, detector: &self.detector, associations, carrier, update: &update, map };
        self.tapes.iter_mut().try_for_each(|tape| tape.record(&taped))
    }

    fn learned(&self, frame: Arc<RgbdFrame>, detections: Detections) -> Learned {
        Learned { frame, detections, map: Arc::new(self.mapping.map.clone()) }
    }
}
