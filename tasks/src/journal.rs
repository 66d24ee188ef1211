//! What happened during a run, for the report.

use crate::perception::Learned;
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::map::{CellState, FreeSpace, Map};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use nalgebra::Point2;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::Sender;

/// A moment worth showing.
#[derive(Clone, Debug)]
pub struct Event {
    /// Simulated seconds.
    pub at_s: f64,
    /// What happened, in words.
    pub what: String,
}

/// Motion at one moment, as the robot itself knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// When.
    pub stamp: Stamp,
    /// Distance of the footprint to the nearest occupied cell of the map, metres; `None` beyond [`FARTHEST_M`].
    pub clearance_m: Option<f64>,
    /// Speed of the base, metres per second.
    pub speed_m_per_s: f64,
    /// What the arm's controller last said, while it works.
    pub control: Option<ControlSample>,
}

/// Margins of the arm's controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlSample {
    /// Distance to the goal, metres (or radians of the worst joint).
    pub error: f64,
    /// Least distance of a moved link to another link or an obstacle, metres.
    pub distance_m: Option<f64>,
    /// Rows of the program that hold the motion back.
    pub active_rows: usize,
}

/// What was sent to the robot in one control period.
#[derive(Clone, Debug, PartialEq)]
pub struct SentCommands {
    /// When.
    pub stamp: Stamp,
    /// To the base.
    pub base: Twist,
    /// To the arm.
    pub arm: JointVelocities,
    /// To the head.
    pub head: JointVelocities,
    /// To the gripper: width in metres, greatest force in newtons.
    pub gripper: Option<(f64, f64)>,
}

/// Clearance is looked for this far from the base's centre, metres.
pub const FARTHEST_M: f64 = 1.25;
/// One sample in so much simulated time.
const SAMPLE_EVERY: Span = Span(100_000_000);

/// So many of the last frames are kept, so far apart.
const RECENT: usize = 6;
const RECENT_EVERY: Span = Span(1_500_000_000);

/// Path, poses of the head camera, pictures, events and samples of a run.
#[derive(Default)]
pub struct Journal {
    /// Where the base was, world frame, one point a frame.
    pub path: Vec<Point2<f64>>,
    /// Where the base was when a camera took a frame.
    pub bases: Vec<(Stamp, Pose)>,
    /// Commands, where they are kept; one that repeats the one before is left out.
    pub commands: Option<Vec<SentCommands>>,
    /// Poses of the head camera, one a frame.
    pub views: Vec<Pose>,
    /// Events in order.
    pub events: Vec<Event>,
    /// Motion, ten times a second.
    pub samples: Vec<Sample>,
    /// What the arm's controller said since the last sample.
    pub control: Option<ControlSample>,
    /// Frames kept with events.
    pub pictures: Vec<(String, Arc<RgbdFrame>)>,
    /// The last frames of the head camera, a second and a half apart.
    pub recent: VecDeque<Arc<RgbdFrame>>,
    /// Frames learned from.
    pub frames_learned: usize,
    /// Detections in them.
    pub detections: usize,
    /// Is told the words of each event.
    pub told: Option<Sender<String>>,
    /// Is told what is learned and what happens, for recordings.
    pub witness: Option<Box<dyn Witness>>,
}

/// Hears what a run learns and decides, in the order in which the loop does. Nothing that it does changes the run.
pub trait Witness: Send {
    /// What a frame taught.
    fn learned(&mut self, learned: &Learned);

    /// Something that happened.
    fn event(&mut self, event: &Event);
}

/// What a run looks like to the robot at one moment, for those who watch.
pub struct Moment<'a> {
    /// A frame that was just taken.
    pub frame: &'a Arc<RgbdFrame>,
    /// The newest map.
    pub map: &'a Arc<Map>,
    /// What happened so far.
    pub journal: &'a Journal,
}

impl Journal {
    /// Notes a frame that was taken.
    pub fn note_frame(&mut self, frame: &Arc<RgbdFrame>, world_from_base: &Pose) {
        self.bases.push((frame.stamp, *world_from_base));
        if &*frame.camera == "head" {
            if self.recent.back().is_none_or(|last| frame.stamp - last.stamp >= RECENT_EVERY) {
                self.recent.push_back(frame.clone());
                while self.recent.len() > RECENT {
                    self.recent.pop_front();
                }
            }
            self.path.push(Point2::from(world_from_base.translation.vector.xy()));
            self.views.push(frame.world_from_camera);
        }
    }

    /// Notes a frame whose map is there.
    pub fn note_learned(&mut self, learned: &Learned) {
        self.frames_learned += 1;
        self.detections += learned.detections.items.len();
        if let Some(witness) = &mut self.witness {
            witness.learned(learned);
        }
    }

    /// Notes what was sent, if that is kept.
    pub fn note_commands(&mut self, sent: SentCommands) {
        let Some(commands) = &mut self.commands else { return };
        let same = |last: &SentCommands| *last == SentCommands { stamp: last.stamp, ..sent.clone() };
        if !commands.last().is_some_and(same) {
            commands.push(sent);
        }
    }

    /// Whether a sample is due.
    pub fn is_sample_due(&self, now: Stamp) -> bool {
        self.samples.last().is_none_or(|sample| now - sample.stamp >= SAMPLE_EVERY)
    }

    /// Notes a sample; the base is at `position` in the world and has the given radius.
    pub fn note_sample(
        &mut self,
        now: Stamp,
        free_space: &FreeSpace,
        position: &Point2<f64>,
        radius_m: f64,
        speed_m_per_s: f64,
    ) {
        let clearance_m = find_nearest_occupied_m(free_space, position).map(|distance| (distance - radius_m).max(0.0));
        self.samples.push(Sample { stamp: now, clearance_m, speed_m_per_s, control: self.control.take() });
    }

    /// Notes an event, with a picture if there is one.
    pub fn note(&mut self, at_s: f64, what: impl Into<String>, picture: Option<&Arc<RgbdFrame>>) {
        let what = what.into();
        tracing::info!("{at_s:7.2} s  {what}");
        if let Some(frame) = picture {
            self.pictures.push((format!("{at_s:.1} s: {what}"), frame.clone()));
        }
        if let Some(told) = &self.told {
            // Nobody waits for words any more: then nobody needs them.
            let _ = told.send(what.clone());
        }
        let event = Event { at_s, what };
        if let Some(witness) = &mut self.witness {
            witness.event(&event);
        }
        self.events.push(event);
    }
}

/// Distance from a point to the nearest edge of an occupied cell, metres; `None` beyond [`FARTHEST_M`].
fn find_nearest_occupied_m(free_space: &FreeSpace, point: &Point2<f64>) -> Option<f64> {
    let reach = (FARTHEST_M / free_space.resolution_m).ceil() as i32;
    let [x, y] = free_space.cell_at(point);
    let half = 0.5 * free_space.resolution_m;
    let cells = (y - reach..=y + reach).flat_map(|y| (x - reach..=x + reach).map(move |x| [x, y]));
    let squared = cells.filter(|cell| free_space.state(*cell) == CellState::Occupied).map(|cell| {
        let offset = (free_space.center_of(cell) - point).abs();
        let (dx, dy) = ((offset.x - half).max(0.0), (offset.y - half).max(0.0));
        dx * dx + dy * dy
    });
    squared.min_by(f64::total_cmp).map(f64::sqrt).filter(|distance| *distance <= FARTHEST_M)
}

#[cfg(test)]
mod tests {
    //! Contract: samples come ten times a second, and clearance counts from the footprint to the edge of a cell.
    use super::*;

    #[test]
    fn clearance_is_from_footprint_to_the_edge_of_the_nearest_cell() {
        let mut grid = FreeSpace::new(0.05);
        let point = Point2::new(1.0, 1.0);
        assert_eq!(find_nearest_occupied_m(&grid, &point), None);
        grid.set(grid.cell_at(&Point2::new(1.51, 1.01)), CellState::Occupied);
        grid.set(grid.cell_at(&Point2::new(1.01, 1.91)), CellState::Occupied);
        let mut journal = Journal::default();
        assert!(journal.is_sample_due(Stamp(0)));
        journal.note_sample(Stamp(0), &grid, &point, 0.27, 0.3);
        assert!(!journal.is_sample_due(Stamp(90_000_000)) && journal.is_sample_due(Stamp(100_000_000)));
        let clearance_m = journal.samples[0].clearance_m.expect("a cell is near");
        assert!((clearance_m - 0.23).abs() < 1e-9, "{clearance_m}");
    }
}
