//! Perception and mapping beside the control loop.
//!
//! One worker owns detector, builder and map. A frame goes in; its map comes out at the frame's stamp plus a declared
//! latency, whatever the machine's speed, so that a run does not depend on wall time.

use crate::deferred::Waiting;
use crate::error::TaskError;
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

/// What one frame taught.
pub struct Learned {
    /// The frame.
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
        Self::start_annotated(detector, builder, None, map, tapes, latency)
    }

    /// As [`Self::start`]; `annotator` describes frames in its own time, and nothing waits for it but the end.
    pub fn start_annotated(
        detector: Box<dyn Detector>,
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
        let worker = std::thread::spawn(move || work(detector, mapping, tapes, &inbox, &outbox));
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
    mut detector: Box<dyn Detector>,
    mut mapping: Mapping,
    mut tapes: Vec<Box<dyn Tape>>,
    inbox: &Receiver<Job>,
    outbox: &Sender<Result<Learned, StoreError>>,
) -> Result<(), StoreError> {
    mapping.builder.credit_names_to(detector.name());
    let mut last = None;
    while let Ok(job) = inbox.recv() {
        let Job { frame, carrier } = job;
        let detections = detector.detect(&frame);
        let update = mapping.observe(&frame, &detections, &carrier);
        if let Some(update) = &update {
            let (frame, detections, associations) = (&*frame, &detections, mapping.builder.associations());
            let (detector, map) = (detector.name(), &mapping.map);
            let taped = Taped { frame, detections, detector, associations, carrier: &carrier, update, map };
            if let Err(error) = tapes.iter_mut().try_for_each(|tape| tape.record(&taped)) {
                let _ = outbox.send(Err(error));
                return Ok(());
            }
        }
        last = Some(frame.clone());
        let learned = Learned { frame, detections, map: Arc::new(mapping.map.clone()) };
        if outbox.send(Ok(learned)).is_err() {
            break;
        }
    }
    // What a model still has to say counts for the map that is kept.
    if mapping.finish()
        && let Some(frame) = last
    {
        let detections = Detections { frame: frame.id, items: Vec::new() };
        let _ = outbox.send(Ok(Learned { frame, detections, map: Arc::new(mapping.map.clone()) }));
    }
    tapes.into_iter().try_for_each(|tape| tape.finish(&mapping.map))
}
