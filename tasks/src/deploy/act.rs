//! A robot that does what others order over ROS 2, and shows them its map.
//!
//! ```text
//! /dsm/do_task ──▶ executor ──▶ agent ──▶ drivers
//! /dsm/ground_text ◀──▶ grounder ◀── map ──▶ /dsm/objects, /dsm/markers
//! ```

use crate::episode::Step;
use crate::error::TaskError;
use crate::journal::Moment;
use crate::run::{CELL_M, Finished, Progress, RunSpec};
use crate::session::Session;
use crate::summary::StepOutcome;
use dsm::ground::{Grounder, GroundingStatus};
use dsm::map::Map;
use dsm::time::{Span, Stamp};
use dsm_ros2::map_out::{Grounded, MapOut, meant_markers};
use dsm_ros2::messages::{DoTaskResult, GroundTextResponse, Point, Vector3};
use dsm_ros2::orders::{Desk, Events, Order};
use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The map goes out so often, in the robot's time.
const MAP_EVERY: Span = Span(1_000_000_000);
/// Between two looks at the desk the robot stands for so long.
const LOOK: Span = Span(100_000_000);

/// The newest map, for the thread that answers questions about it.
type Newest = Arc<Mutex<(Stamp, Arc<Map>)>>;

/// Shows the map of a run while it grows.
struct Shown {
    map_out: MapOut,
    newest: Newest,
    published: Option<Stamp>,
    told: usize,
    order: Rc<RefCell<Option<Events>>>,
    wishes: Vec<Arc<AtomicBool>>,
    cancelled: Rc<RefCell<Option<Arc<AtomicBool>>>>,
    stop: Arc<AtomicBool>,
    next: Box<dyn Progress>,
}

impl Progress for Shown {
    fn at(&mut self, sim_time_s: f64) {
        let is_set = |flag: &Arc<AtomicBool>| flag.load(Ordering::Relaxed);
        if self.wishes.iter().any(is_set) || self.cancelled.borrow().as_ref().is_some_and(is_set) {
            self.stop.store(true, Ordering::Relaxed);
        }
        self.next.at(sim_time_s);
    }

    fn sees(&mut self, moment: &Moment<'_>) {
        let stamp = moment.frame.stamp;
        if let Some(order) = &*self.order.borrow() {
            moment.journal.events.iter().skip(self.told).for_each(|event| order.tell(event.what.clone()));
        }
        self.told = moment.journal.events.len();
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = (stamp, moment.map.clone());
        if self.published.is_none_or(|last| stamp - last >= MAP_EVERY) {
            self.published = Some(stamp);
            self.map_out.publish(moment.map, stamp).unwrap_or_else(|error| tracing::warn!("{error}"));
        }
        self.next.sees(moment);
    }
}

/// Shows a run's map in a DDS domain, and grounds texts in it.
fn show(domain: u16, grounder: Grounder) -> Result<(MapOut, Newest), TaskError> {
    let newest: Newest = Arc::new(Mutex::new((Stamp(0), Arc::new(Map::new(CELL_M)))));
    let known = newest.clone();
    let answer = move |text: &str| {
        let (stamp, map) = known.lock().unwrap_or_else(PoisonError::into_inner).clone();
        ground(&grounder, &map, stamp, text)
    };
    Ok((MapOut::start(domain, answer)?, newest))
}

fn ground(grounder: &Grounder, map: &Map, stamp: Stamp, text: &str) -> Grounded {
    let grounding = grounder.ground(map, text, None);
    let found = grounding.status == GroundingStatus::Found;
    let object = grounding.object_id.and_then(|id| map.find_object(id));
    let room = grounding.room_id.and_then(|id| map.find_room(id));
    let (center, size) = match (object, room) {
        (Some(object), _) => {
            let (center, size) = (object.bounds.center, object.bounds.size);
            (Point { x: center.x, y: center.y, z: center.z }, Vector3 { x: size.x, y: size.y, z: size.z })
        }
        (None, Some(room)) => (Point { x: room.center.x, y: room.center.y, z: 0.0 }, Vector3::default()),
        (None, None) => (Point::default(), Vector3::default()),
    };
    let response = GroundTextResponse {
        status: format!("{:?}", grounding.status).to_lowercase(),
        object_id: grounding.object_id.map_or(-1, |id| id.0 as i32),
        room_id: grounding.room_id.map_or(-1, |id| id.0 as i32),
        score: grounding.score,
        center,
        size,
        decided_by: grounding.decided_by,
    };
    (response, meant_markers(map, grounding.object_id.filter(|_| found), text, stamp))
}

/// Carries out what is ordered until `interrupted` is set or the time limit of `spec` is over.
///
/// # Errors
/// [`TaskError`]: there is no robot, or no DDS.
pub fn act(
    spec: &RunSpec,
    domain: u16,
    map_file: &Path,
    interrupted: Arc<AtomicBool>,
    progress: Box<dyn Progress>,
) -> Result<Finished, TaskError> {
    let grounder = crate::language::grounder(&*spec.language, dsm::ground::GroundConfig::default())?;
    let (map_out, newest) = show(domain, grounder)?;
    let desk = Desk::open(domain)?;
    let (order, cancelled, stop) = (Rc::new(RefCell::new(None)), Rc::new(RefCell::new(None)), Arc::default());
    let shown = Shown {
        map_out,
        newest,
        published: None,
        told: 0,
        order: order.clone(),
        wishes: vec![interrupted.clone()],
        cancelled: cancelled.clone(),
        stop: Arc::clone(&stop),
        next: progress,
    };
    let mut session = Session::begin(spec, Some(map_file), stop.clone(), Box::new(shown))?;
    while !interrupted.load(Ordering::Relaxed) {
        let Ok(ordered) = desk.orders.try_recv() else {
            if session.agent().rest(LOOK).is_err() {
                break;
            }
            continue;
        };
        *order.borrow_mut() = Some(ordered.events.clone());
        *cancelled.borrow_mut() = Some(ordered.cancelled.clone());
        carry_out(&mut session, ordered);
        (*order.borrow_mut(), *cancelled.borrow_mut()) = (None, None);
        stop.store(interrupted.load(Ordering::Relaxed), Ordering::Relaxed);
    }
    session.finish()
}

fn carry_out(session: &mut Session, order: Order) {
    session.forgive();
    let steps = session.run(&[Step::command(order.command.clone())]);
    let result = steps.last().map_or_else(DoTaskResult::default, |step| DoTaskResult {
        success: step.outcome == StepOutcome::Done,
        outcome: format!("{:?}", step.outcome).to_lowercase(),
        reason: step.reason.clone(),
    });
    order.finish(result);
}
