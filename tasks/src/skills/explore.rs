//! Exploration: look around, drive to the best frontier, look around there, until nothing worth seeing is left.

use super::Outcome;
use super::doors::{ClosedDoor, find_closed_doors};
use super::drive::{Drive, DriveOutcome};
use super::grasp::GraspSettings;
use super::looks::{look_around, look_through, look_towards};
use super::pass::open_door;
use crate::agent::{Agent, Gaze, Halt};
use dsm::Pose;
use dsm::map::{CellState, FreeSpace, Map, ObjectId};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::DriverError;
use dsm_robot::nav::{
    Costmap, CoverageGrid, Field, FrontierMemory, NavConfig, Pose2, find_frontiers, find_gap, find_view_poses,
};
use nalgebra::{Point2, Point3, Vector3};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Tables, desks and beds are at least this wide and lower than this, metres: what was looked at there is looked at from
/// a second side as well.
const WIDE_M: f64 = 0.5;
const TABLE_TOP_M: f64 = 1.0;

/// What held a drive up, and closes a gap since then, may go away by itself: so often and so long it is waited for, and not
/// after so long a time, seconds.
const MOST_WAITS: usize = 3;
const WAIT_S: f64 = 20.0;
const HELD_UP_FOR_S: f64 = 150.0;

/// Why exploration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExploreOutcome {
    /// Nothing worth seeing can be reached any more.
    Complete,
    /// The caller has seen enough.
    Enough,
    /// Its time is up.
    TimeUp,
}

/// Exploration with its memory of places tried.
pub struct Explorer {
    nav: NavConfig,
    frontiers: FrontierMemory,
    coverage: CoverageGrid,
    views_noted: usize,
    looked_around: bool,
    inspected: BTreeSet<ObjectId>,
    reprieved: bool,
    /// Beyond gaps that were looked at, world frame, metres.
    gaps: Vec<Point2<f64>>,
    /// How often it was waited for what stands in a gap.
    waits: usize,
    /// How the hand opens doors; `None` when they are left as they are.
    hand: Option<GraspSettings>,
    /// Where doors are that were opened or given up, world frame, metres.
    doors: Vec<Point2<f64>>,
    complete: bool,
}

/// What an explorer is told to care about.
pub struct Interest<'a> {
    /// Whether the caller has seen enough.
    pub enough: &'a mut dyn FnMut(&Arc<Map>) -> bool,
    /// Objects that are worth a look from near before anything else.
    pub inspect: &'a dyn Fn(&Map) -> Vec<ObjectId>,
}

enum Next {
    Inspect(ObjectId, Pose2),
    Frontier(dsm_robot::nav::Frontier),
    Viewpoint(dsm_robot::nav::Viewpoint),
    Gap(dsm_robot::nav::Gap),
    Door(Box<ClosedDoor>),
    Wait,
    Nothing,
}

impl Explorer {
    /// An explorer that has been nowhere.
    pub fn new(nav: NavConfig) -> Self {
        let coverage = CoverageGrid::default();
        Self {
            nav,
            frontiers: FrontierMemory::default(),
            coverage,
            views_noted: 0,
            looked_around: false,
            inspected: BTreeSet::new(),
            reprieved: false,
            gaps: Vec::new(),
            waits: 0,
            hand: None,
            doors: Vec::new(),
            complete: false,
        }
    }

    /// The same, but it opens closed doors with its hand when nothing else is left to see.
    pub fn through_doors(self, hand: GraspSettings) -> Self {
        Self { hand: Some(hand), ..self }
    }

    /// Whether nothing was left to see at some time.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Explores until the caller has seen enough, nothing is left, or `end` comes.
    pub fn run(&mut self, agent: &mut Agent, end: Stamp, interest: Interest<'_>) -> Result<ExploreOutcome, Halt> {
        let Interest { enough, inspect } = interest;
        if !self.looked_around {
            // Into the room, then at the floor around the base, which a level view does not show.
            look_around(agent, 2.6)?;
            self.looked_around = true;
            if agent.map().free_space.known_cells().next().is_none() {
                let reason = "no picture of a look around taught anything: do camera, depth and detector answer?";
                return Err(DriverError::Lost { part: "camera".into(), reason: reason.into() }.into());
            }
        }
        loop {
            if enough(agent.map()) {
                return Ok(ExploreOutcome::Enough);
            }
            if agent.now() >= end {
                return Ok(ExploreOutcome::TimeUp);
            }
            let next = self.choose(agent, inspect)?;
            match next {
                Next::Inspect(id, stand) => {
                    agent.note(format!("a look at object {}", id.0));
                    self.inspected.insert(id);
                    agent.gaze = Gaze::AROUND;
                    let drive = Drive::to_place(&self.nav, stand.position).until(end).stop_when(enough);
                    if drive.run(agent)? == DriveOutcome::Enough {
                        return Ok(ExploreOutcome::Enough);
                    }
                    let Some(bounds) = agent.map().find_object(id).map(|o| o.bounds) else { continue };
                    look_towards(agent, &bounds.center.xy())?;
                    // On what is wide, things hide each other, and a detector misses what it missed from the same side.
                    let is_wide = bounds.size.x.min(bounds.size.y) >= WIDE_M && bounds.top_m() < TABLE_TOP_M;
                    if is_wide && self.look_again(agent, end, &[id], enough)? {
                        return Ok(ExploreOutcome::Enough);
                    }
                }
                Next::Frontier(frontier) => {
                    let center = frontier.center;
                    agent.note(format!("frontier at ({:.1}, {:.1})", center.x, center.y));
                    self.frontiers.record(&frontier, &self.nav.frontier);
                    // What is seen on the way needs no visit.
                    let mut resolved = false;
                    let mut stop = |map: &Arc<Map>| {
                        resolved = is_resolved(&map.free_space, &center);
                        resolved || enough(map)
                    };
                    agent.gaze = Gaze::AROUND;
                    let drive = Drive::to_place(&self.nav, frontier.stand.position).until(end).stop_when(&mut stop);
                    match drive.run(agent)? {
                        DriveOutcome::Arrived => look_towards(agent, &center)?,
                        DriveOutcome::Enough if !resolved => return Ok(ExploreOutcome::Enough),
                        DriveOutcome::Enough => {}
                        other => {
                            agent.note(format!("gives it up: {other:?}"));
                            self.frontiers.give_up(&frontier, &self.nav.frontier);
                        }
                    }
                }
                Next::Viewpoint(view) => {
                    let at = view.stand.position;
                    agent.note(format!("viewpoint at ({:.1}, {:.1})", at.x, at.y));
                    self.coverage.settle(&view);
                    agent.gaze = Gaze::AROUND;
                    let drive = Drive::to_place(&self.nav, at).until(end).stop_when(enough);
                    if drive.run(agent)? == DriveOutcome::Enough {
                        return Ok(ExploreOutcome::Enough);
                    }
                    let (sin, cos) = view.stand.yaw_rad.sin_cos();
                    look_towards(agent, &Point2::new(at.x + cos, at.y + sin))?;
                }
                Next::Gap(gap) => {
                    let at = gap.stand.position;
                    agent.note(format!("a gap at ({:.1}, {:.1}) cuts off open floor", at.x, at.y));
                    self.gaps.push(gap.beyond);
                    for place in gap.afar.iter().chain([&gap.stand]) {
                        agent.gaze = Gaze::AROUND;
                        let drive = Drive::to_place(&self.nav, place.position).until(end).stop_when(enough);
                        if drive.run(agent)? == DriveOutcome::Enough {
                            return Ok(ExploreOutcome::Enough);
                        }
                        look_through(agent, &gap.beyond)?;
                    }
                    // What cuts it off may lie beside the base, as behind the post of a door.
                    look_around(agent, 2.6)?;
                }
                Next::Door(door) => self.pass(agent, &door)?,
                Next::Wait => {
                    agent.note("waits for what stands in the way to go");
                    agent.rest(Span::from_s(WAIT_S))?;
                    self.waits += 1;
                    self.gaps.clear();
                }
                // A way that was blocked by what went away, or by a pose that wandered, may be open now.
                Next::Nothing if !self.reprieved && self.frontiers.reprieve(&self.nav.frontier) => {
                    agent.note("tries once more what was given up");
                    self.reprieved = true;
                }
                Next::Nothing => {
                    self.complete = true;
                    return Ok(ExploreOutcome::Complete);
                }
            }
        }
    }

    /// Opens a closed door; what lies behind it is to be seen then.
    fn pass(&mut self, agent: &mut Agent, door: &ClosedDoor) -> Result<(), Halt> {
        let Some(hand) = self.hand.clone() else { return Ok(()) };
        let (x, y) = (door.middle.x, door.middle.y);
        agent.note(format!("nothing else is left to see: a closed door at ({x:.1}, {y:.1})"));
        self.doors.push(door.middle);
        match open_door(agent, &self.nav, &hand, door)? {
            Outcome::Done(how) => {
                agent.note(format!("the door is {how}"));
                // Frontiers that it closed were given up.
                self.frontiers = FrontierMemory::default();
                self.gaps.clear();
                self.reprieved = false;
                if let Some(place) = self.find_place_before(agent, door)? {
                    agent.gaze = Gaze::AHEAD;
                    Drive::to_pose(&self.nav, place).run(agent)?;
                }
                look_through(agent, &door.middle)?;
                look_around(agent, 1.2)?;
            }
            Outcome::Failed(stage, reason) => agent.note(format!("the door stays closed ({stage:?}): {reason}")),
        }
        Ok(())
    }

    /// Where to stand for a look straight into an opened doorway: the leaf that moved was seen, and taken for something that
    /// stands there, in every place through which it went.
    fn find_place_before(&self, agent: &mut Agent, door: &ClosedDoor) -> Result<Option<Pose2>, Halt> {
        const OFF_M: [f64; 5] = [1.3, 1.15, 1.5, 1.0, 1.7];
        const ASIDE_M: [f64; 5] = [0.0, 0.15, -0.15, 0.3, -0.3];
        let (map, nav) = (agent.map().clone(), self.nav.clone());
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let (middle, normal) = (door.middle, door.normal);
        agent.plan(move || {
            let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
            let field = Field::from_start(&costmap, &start);
            let across = Vector3::z().cross(&normal).xy();
            let places =
                ASIDE_M.iter().flat_map(|aside_m| OFF_M.map(|off_m| middle + normal.xy() * off_m + across * *aside_m));
            let mut reached = places.filter(|at| costmap.is_traversable_at(at) && field.find_length_to_m(at).is_some());
            reached.next().map(|place| Pose2::facing(place, &middle))
        })
    }

    /// Looks at objects from near once more, each from a side from which it was not seen from near: a detector that misses
    /// a thing misses it again from the same side. Whether the caller has seen enough then.
    pub fn look_again(
        &mut self,
        agent: &mut Agent,
        end: Stamp,
        objects: &[ObjectId],
        enough: &mut dyn FnMut(&Arc<Map>) -> bool,
    ) -> Result<bool, Halt> {
        let mut left = objects.to_vec();
        while !left.is_empty() && agent.now() < end {
            let (map, nav, views) = (agent.map().clone(), self.nav.clone(), agent.journal.views.clone());
            let start = Pose2::from_pose(&agent.world_from_base()?).position;
            let asked = left.clone();
            let next = agent.plan(move || {
                let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
                let field = Field::from_start(&costmap, &start);
                let sides = asked.iter().filter_map(|id| {
                    let bounds = map.find_object(*id)?.bounds;
                    let seen = seen_from(&views, &bounds.center);
                    let places = find_view_poses(&map, &costmap, &field, &bounds, &nav.goal);
                    let is_new = |place: &Point2<f64>| seen.iter().all(|side| are_apart(&bounds.center, place, side));
                    let place = places.into_iter().find(|place| is_new(&place.pose.position))?;
                    Some((place.path_length_m, *id, place.pose))
                });
                sides.min_by(|a, b| a.0.total_cmp(&b.0))
            })?;
            let Some((_, id, stand)) = next else { break };
            left.retain(|other| *other != id);
            agent.note(format!("a look at object {} from another side", id.0));
            agent.gaze = Gaze::AROUND;
            let drive = Drive::to_place(&self.nav, stand.position).until(end).stop_when(enough);
            if drive.run(agent)? == DriveOutcome::Enough {
                return Ok(true);
            }
            if let Some(bounds) = agent.map().find_object(id).map(|o| o.bounds) {
                look_towards(agent, &bounds.center.xy())?;
            }
            if enough(agent.map()) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn choose(&mut self, agent: &mut Agent, inspect: &dyn Fn(&Map) -> Vec<ObjectId>) -> Result<Next, Halt> {
        let map = agent.map().clone();
        let views = &agent.journal.views;
        let new_views = views[self.views_noted..].to_vec();
        self.views_noted = views.len();
        let wanted = inspect(&map);
        for id in &wanted {
            if map.find_object(*id).is_some_and(|o| new_views.iter().any(|view| is_near(view, &o.bounds.center))) {
                self.inspected.insert(*id);
            }
        }
        let wanted: Vec<ObjectId> = wanted.into_iter().filter(|id| !self.inspected.contains(id)).collect();
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let (nav, memory, gaps) = (self.nav.clone(), self.frontiers.clone(), self.gaps.clone());
        // A hand that holds something opens nothing.
        let tried_doors = self.hand.as_ref().filter(|_| agent.held().is_none()).map(|_| self.doors.clone());
        let was_held_up = agent.held_up.is_some_and(|at| (agent.now() - at).as_s() < HELD_UP_FOR_S);
        let is_patient = was_held_up && self.waits < MOST_WAITS;
        let mut coverage = std::mem::take(&mut self.coverage);
        let (next, coverage) = agent.plan(move || {
            let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
            for world_from_camera in &new_views {
                coverage.observe(&costmap, world_from_camera, &nav.coverage);
            }
            let field = Field::from_start(&costmap, &start);
            let looks = wanted.iter().filter_map(|id| {
                let bounds = map.find_object(*id)?.bounds;
                let place = find_view_poses(&map, &costmap, &field, &bounds, &nav.goal).into_iter().next()?;
                Some((place.path_length_m, *id, place.pose))
            });
            if let Some((_, id, pose)) = looks.min_by(|a, b| a.0.total_cmp(&b.0)) {
                return (Next::Inspect(id, pose), coverage);
            }
            let frontier = find_frontiers(&costmap, &field, &memory, &nav.frontier).into_iter().next();
            let next = frontier.map(Next::Frontier).unwrap_or_else(|| {
                let views = coverage.find_viewpoints(&map, &costmap, &field, &nav.coverage);
                let view = views.into_iter().next().map(Next::Viewpoint);
                let gap = || find_gap(&costmap, &field, &gaps).map(Next::Gap);
                let door = || {
                    let doors = find_closed_doors(&map, &costmap, &field, tried_doors.as_deref()?);
                    doors.into_iter().next().map(|door| Next::Door(Box::new(door)))
                };
                // Somebody, or a box that is carried on, stands in a gap that was looked at.
                let wait = || find_gap(&costmap, &field, &[]).filter(|_| is_patient).map(|_| Next::Wait);
                view.or_else(gap).or_else(door).or_else(wait).unwrap_or(Next::Nothing)
            });
            (next, coverage)
        })?;
        self.coverage = coverage;
        Ok(next)
    }
}

/// Where cameras stood that looked at a place from near.
fn seen_from(views: &[Pose], place: &Point3<f64>) -> Vec<Point2<f64>> {
    let near = views.iter().filter(|view| is_near(view, place));
    near.map(|view| Point2::from(view.translation.vector.xy())).collect()
}

/// Whether two places lie on different sides of a thing.
fn are_apart(thing: &Point3<f64>, a: &Point2<f64>, b: &Point2<f64>) -> bool {
    /// What is missed is missed within a sector of half a radian; a little more leads out of it.
    const SIDE_RAD: f64 = 0.6;
    (a - thing.xy()).angle(&(b - thing.xy())) >= SIDE_RAD
}

/// Whether a camera looks at a place from near.
fn is_near(world_from_camera: &Pose, place: &Point3<f64>) -> bool {
    const NEAR_M: f64 = 1.8;
    const HALF_ANGLE_RAD: f64 = 0.4;
    let p = world_from_camera.inverse_transform_point(place);
    p.coords.norm() < NEAR_M && p.coords.angle(&Vector3::z()) < HALF_ANGLE_RAD
}

/// Whether nothing unknown is left around a frontier.
fn is_resolved(free_space: &FreeSpace, center: &Point2<f64>) -> bool {
    const AROUND_CELLS: i32 = 4;
    let [x, y] = free_space.cell_at(center);
    let cells =
        (-AROUND_CELLS..=AROUND_CELLS).flat_map(|dy| (-AROUND_CELLS..=AROUND_CELLS).map(move |dx| [x + dx, y + dy]));
    cells.filter(|cell| free_space.state(*cell) == CellState::Unknown).count() <= 2
}

#[cfg(test)]
mod tests {
    //! Contract: only a place from which a thing was not yet seen from near counts as another side of it.
    use super::*;
    use nalgebra::{Isometry3, UnitQuaternion};

    #[test]
    fn another_side_is_one_from_which_nothing_was_seen() {
        let thing = Point3::new(2.0, 1.0, 0.8);
        let look_from = |x: f64, y: f64| {
            let eye = Point3::new(x, y, 1.2);
            let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &(thing - eye)).expect("not opposite");
            Isometry3::from_parts(eye.coords.into(), rotation)
        };
        // One from near, one from afar, one that looks elsewhere.
        let mut elsewhere = look_from(2.0, 2.0);
        elsewhere.rotation = UnitQuaternion::identity();
        let seen = seen_from(&[look_from(1.0, 1.0), look_from(2.0, 5.0), elsewhere], &thing);
        assert_eq!(seen, [Point2::new(1.0, 1.0)]);
        let is_new = |x, y| seen.iter().all(|side| are_apart(&thing, &Point2::new(x, y), side));
        assert!(is_new(2.0, 2.0) && is_new(3.0, 1.0) && !is_new(1.2, 1.1) && !is_new(0.5, 0.9));
    }
}
