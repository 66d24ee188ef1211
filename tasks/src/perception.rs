//! Perception and mapping beside the control loop.
//!
//! One worker owns detector, builder and map. A frame goes in; its map comes out at the frame's stamp plus a declared
//! latency, whatever the machine's speed, so that a run does not depend on wall time.

use crate::error::TaskError;
use dsm::build::{Carrier, MapBuilder};
use dsm::frame::RgbdFrame;
use dsm::map::Map;
use dsm::perceive::{Detections, Detector};
use dsm::store::{MapLog, StoreError};
use dsm::time::{Span, Stamp};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

struct Job {
    frame: Arc<RgbdFrame>,
    carrier: Carrier,
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
    worker: Option<JoinHandle<Result<(), StoreError>>>,
}

impl Perception {
    /// Starts the worker. `log` gets every update; results show `latency` after the frame's stamp.
    pub fn start(
        detector: Box<dyn Detector>,
        builder: MapBuilder,
        map: Map,
        log: Option<MapLog>,
        latency: Span,
    ) -> Self {
        let (jobs, inbox) = channel::<Job>();
        let (outbox, results) = channel();
        let worker = std::thread::spawn(move || work(detector, builder, map, log, &inbox, &outbox));
        Self { jobs: Some(jobs), results, under_way: VecDeque::new(), latency, worker: Some(worker) }
    }

    /// Hands a frame to the worker. `carrier` says where the robot itself was.
    pub fn submit(&mut self, frame: Arc<RgbdFrame>, carrier: Carrier) -> Result<(), TaskError> {
        self.under_way.push_back(frame.stamp + self.latency);
        let sent = self.jobs.as_ref().is_some_and(|jobs| jobs.send(Job { frame, carrier }).is_ok());
        if sent { Ok(()) } else { Err(TaskError::Internal("the mapping worker ended".into())) }
    }

    /// The next result whose time has come.
    pub fn find_learned(&mut self, now: Stamp) -> Result<Option<Learned>, TaskError> {
        if self.under_way.front().is_none_or(|&ready| ready > now) {
            return Ok(None);
        }
        self.under_way.pop_front();
        match self.results.recv() {
            Ok(learned) => Ok(Some(learned?)),
            Err(_) => Err(TaskError::Internal("the mapping worker ended".into())),
        }
    }

    /// Waits for all frames under way, closes the log with the compact map, and gives back the last result.
    pub fn finish(mut self) -> Result<Option<Learned>, TaskError> {
        drop(self.jobs.take());
        let mut last = None;
        while let Ok(learned) = self.results.recv() {
            last = Some(learned?);
        }
        match self.worker.take().map(JoinHandle::join) {
            Some(Ok(ended)) => ended?,
            Some(Err(_)) => return Err(TaskError::Internal("the mapping worker panicked".into())),
            None => {}
        }
        Ok(last)
    }
}

fn work(
    mut detector: Box<dyn Detector>,
    mut builder: MapBuilder,
    mut map: Map,
    mut log: Option<MapLog>,
    inbox: &Receiver<Job>,
    outbox: &Sender<Result<Learned, StoreError>>,
) -> Result<(), StoreError> {
    while let Ok(Job { frame, carrier }) = inbox.recv() {
        let detections = detector.detect(&frame);
        let update = builder.observe(&map, &frame, &detections, &carrier);
        if let Some(log) = &mut log
            && let Err(error) = log.append(update.clone())
        {
            let _ = outbox.send(Err(error));
            return Ok(());
        }
        map.apply(update);
        if outbox.send(Ok(Learned { frame, detections, map: Arc::new(map.clone()) })).is_err() {
            break;
        }
    }
    log.map_or(Ok(()), |log| log.finish(&map))
}
