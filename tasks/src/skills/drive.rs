//! Driving to a pose: plan, follow, plan again while driving.

use crate::agent::{Agent, Halt};
use dsm::Pose;
use dsm::map::{CellState, FreeSpace, Map, MapObject};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use dsm_robot::nav::{
    BlockReason, Costmap, FollowStatus, Follower, LiveObstacles, NavConfig, Path, PlanFailure, Pose2, SpeedLimits,
    find_path, wrap_angle,
};
use nalgebra::{Point2, Point3, Vector2};
use std::sync::Arc;

/// The path is planned anew this often while driving.
const REPLAN_EVERY: Span = Span(1_000_000_000);
/// Fingers that are closer together hold nothing, metres.
const HOLDS_M: f64 = 0.008;
/// A drive takes no longer than this, seconds, and its longest way at this speed, metres per second: whatever holds it up
/// without being noticed, or sends it to and fro between two ways, ends.
const PATIENCE: (f64, f64) = (30.0, 0.08);
/// So many failed plans or blocked moves end the drive.
const MAX_TROUBLE: u32 = 6;

/// How a drive ended.
#[derive(Clone, Debug, PartialEq)]
pub enum DriveOutcome {
    /// At the goal pose.
    Arrived,
    /// The caller has seen enough.
    Enough,
    /// No path, or none any more.
    NoPath(PlanFailure),
    /// It does not get on.
    Blocked(String),
    /// Its time is up.
    TimeUp,
    /// The hand has lost what it held.
    Dropped,
}

/// Whether a new map tells the caller enough.
type Enough<'a> = dyn FnMut(&Arc<Map>) -> bool + 'a;

/// One drive.
pub struct Drive<'a> {
    nav: &'a NavConfig,
    goal: Point2<f64>,
    heading_rad: Option<f64>,
    end: Option<Stamp>,
    enough: Option<&'a mut Enough<'a>>,
    /// What stopped this drive.
    in_the_way: Vec<Point2<f64>>,
}

type Planned = (Costmap, Result<Path, PlanFailure>);

impl<'a> Drive<'a> {
    /// To a pose.
    pub fn to_pose(nav: &'a NavConfig, goal: Pose2) -> Self {
        Self {
            nav,
            goal: goal.position,
            heading_rad: Some(goal.yaw_rad),
            end: None,
            enough: None,
            in_the_way: Vec::new(),
        }
    }

    /// To a place, with any heading.
    pub fn to_place(nav: &'a NavConfig, goal: Point2<f64>) -> Self {
        Self { nav, goal, heading_rad: None, end: None, enough: None, in_the_way: Vec::new() }
    }

    /// Gives up at `end`.
    pub fn until(mut self, end: Stamp) -> Self {
        self.end = Some(end);
        self
    }

    /// Ends as soon as a new map satisfies `enough`.
    pub fn stop_when(mut self, enough: &'a mut dyn FnMut(&Arc<Map>) -> bool) -> Self {
        self.enough = Some(enough);
        self
    }

    /// Drives.
    pub fn run(mut self, agent: &mut Agent) -> Result<DriveOutcome, Halt> {
        agent.await_light()?;
        let still = JointVelocities::zeros(&agent.model().arm.joints);
        agent.take_touch();
        let mut trouble = 0;
        let work = self.planning(agent)?;
        let (mut costmap, path) = agent.plan(work)?;
        let mut follower = match path {
            Ok(path) => Follower::new(self.nav.follower.clone(), path),
            Err(failure) => return Ok(DriveOutcome::NoPath(failure)),
        };
        let mut planning = None;
        let mut planned_at = agent.now();
        let (begun, mut longest_m) = (agent.now(), follower.path().length_m);
        let mut seen_map = agent.map().clone();
        loop {
            let now = agent.now();
            if self.end.is_some_and(|end| now >= end) {
                return Ok(DriveOutcome::TimeUp);
            }
            if (now - begun).as_s() > PATIENCE.0 + longest_m / PATIENCE.1 {
                agent.log(format!("gives up a drive of {longest_m:.1} m"));
                return Ok(DriveOutcome::Blocked("it takes too long".into()));
            }
            if agent.held().is_some() && agent.grip_state()?.width_m < HOLDS_M {
                agent.rest(Span::from_s(0.5))?;
                return Ok(DriveOutcome::Dropped);
            }
            let world_from_base = agent.world_from_base()?;
            let velocity = agent.base_velocity()?;
            let limits = find_speed_limits(agent, &world_from_base, costmap.footprint_radius_m(), self.nav);
            let output = follower.tick(&world_from_base, velocity, &costmap, &limits, agent.period().as_s());
            let sent = agent.slowed(output.twist)?;
            follower.note_sent(sent);
            agent.tick(sent, &still)?;
            if agent.is_held() {
                // A base that is held does not get on, and nothing is in its way.
                agent.await_release()?;
                agent.take_touch();
                follower = Follower::new(self.nav.follower.clone(), follower.path().clone());
                planned_at = Stamp(now.0 - REPLAN_EVERY.0);
                continue;
            }
            let status = match output.status {
                FollowStatus::Following { .. } | FollowStatus::OffPath { .. } if agent.take_touch() => {
                    FollowStatus::Blocked { reason: BlockReason::Stalled }
                }
                status => status,
            };
            match status {
                FollowStatus::Following { .. } => {}
                FollowStatus::Arrived => return Ok(DriveOutcome::Arrived),
                FollowStatus::Blocked { reason } => {
                    trouble += 1;
                    if trouble >= MAX_TROUBLE {
                        agent.held_up = Some(now);
                        return Ok(DriveOutcome::Blocked(format!("{reason:?}")));
                    }
                    match reason {
                        BlockReason::Stalled => {
                            if come_free(agent, sent)? == HeldUp::Arm {
                                return Ok(DriveOutcome::Blocked("the arm touches something".into()));
                            }
                            // What the follower commanded before does not hold any more.
                            follower = Follower::new(self.nav.follower.clone(), follower.path().clone());
                        }
                        BlockReason::Obstacle { at } => self.in_the_way.push(at),
                    }
                    agent.rest(Span::from_s(0.5))?;
                    planned_at = Stamp(now.0 - REPLAN_EVERY.0);
                }
                FollowStatus::OffPath { .. } => planned_at = Stamp(now.0 - REPLAN_EVERY.0),
            }
            if let Some(enough) = self.enough.as_mut()
                && !Arc::ptr_eq(&seen_map, agent.map())
            {
                seen_map = agent.map().clone();
                if enough(&seen_map) {
                    return Ok(DriveOutcome::Enough);
                }
            }
            if planning.is_none() && agent.now() - planned_at >= REPLAN_EVERY {
                let work = self.planning(agent)?;
                planned_at = agent.now();
                planning = Some(agent.plan_beside(work));
            }
            let now = agent.now();
            if let Some((new_costmap, result)) = planning.as_mut().and_then(|p| p.find(now)) {
                planning = None;
                costmap = new_costmap;
                match result {
                    Ok(path) => {
                        longest_m = longest_m.max(path.length_m);
                        follower.set_path(path);
                    }
                    Err(failure) => {
                        trouble += 1;
                        if trouble >= MAX_TROUBLE {
                            return Ok(DriveOutcome::NoPath(failure));
                        }
                    }
                }
            }
        }
    }

    fn planning(&self, agent: &mut Agent) -> Result<impl FnOnce() -> Planned + Send + 'static, Halt> {
        let map = agent.map().clone();
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let (config, goal, heading_rad) = (self.nav.costmap.clone(), self.goal, self.heading_rad);
        let touched: Vec<Point2<f64>> = agent.bumps.iter().chain(&self.in_the_way).copied().collect();
        let live = agent.live.clone();
        Ok(move || {
            let mut floor = map.free_space.clone();
            add_unmapped(&mut floor, &live);
            add_low_things(&mut floor, &map);
            for place in &touched {
                floor.set(floor.cell_at(place), CellState::Occupied);
            }
            let costmap = Costmap::from_free_space(&floor, &config);
            let path = find_path(&costmap, &start, &goal);
            let path = path.map(|path| Path { goal_yaw_rad: heading_rad, ..path });
            (costmap, path)
        })
    }
}

/// Drives straight on to beside `stand`, with its heading and without steering: the arm that is out would swing. What the
/// way lies beside the stand at its begin it lies beside it at its end.
pub fn step_to(agent: &mut Agent, nav: &NavConfig, stand: &Pose2, speed_m_per_s: f64) -> Result<DriveOutcome, Halt> {
    /// So near is there, metres.
    const NEAR_M: f64 = 0.01;
    const BRAKING_M_PER_S2: f64 = 0.3;
    /// The heading is held by this much, 1/s, no faster than this, rad/s.
    const TURN: (f64, f64) = (1.0, 0.2);
    /// Below this it stands: something is before the base, metres per second.
    const STANDS_M_PER_S: f64 = 0.01;
    let still = JointVelocities::zeros(&agent.model().arm.joints);
    let ahead = Vector2::new(stand.yaw_rad.cos(), stand.yaw_rad.sin());
    let radius_m = agent.model().settings.base.footprint_radius_m;
    let whole_m = (stand.position - Pose2::from_pose(&agent.world_from_base()?).position).norm();
    let end = agent.now() + Span::from_s(PATIENCE.0 + whole_m / PATIENCE.1);
    // What may have come nearer since it was seen is seen again, or forgotten, within this.
    let forgotten_after = Span::from_s(nav.live.memory_s);
    let mut went_at = agent.now();
    agent.take_touch();
    while agent.now() < end {
        if agent.held().is_some() && agent.grip_state()?.width_m < HOLDS_M {
            agent.rest(Span::from_s(0.5))?;
            return Ok(DriveOutcome::Dropped);
        }
        let world_from_base = agent.world_from_base()?;
        let pose = Pose2::from_pose(&world_from_base);
        let left_m = (stand.position - pose.position).dot(&ahead);
        if left_m < NEAR_M {
            agent.rest(Span::from_s(0.2))?;
            return Ok(DriveOutcome::Arrived);
        }
        let limits = find_speed_limits(agent, &world_from_base, radius_m, nav);
        let braking = (2.0 * BRAKING_M_PER_S2 * left_m).sqrt();
        let forward_m_per_s = speed_m_per_s.min(braking).min(limits.forward_m_per_s);
        if forward_m_per_s < STANDS_M_PER_S {
            if agent.now() - went_at > forgotten_after {
                // As near as what is before the base lets it.
                return Ok(DriveOutcome::Blocked(format!("{left_m:.2} m are left")));
            }
            agent.tick(Twist::default(), &still)?;
            continue;
        }
        went_at = agent.now();
        let turn_rad_per_s = (TURN.0 * wrap_angle(stand.yaw_rad - pose.yaw_rad)).clamp(-TURN.1, TURN.1);
        let sent = agent.slowed(Twist { forward_m_per_s, turn_rad_per_s })?;
        if agent.is_close_ahead() {
            agent.log(format!("the arm is close to something {left_m:.2} m before the stand"));
            agent.rest(Span::from_s(0.2))?;
            return Ok(DriveOutcome::Arrived);
        }
        agent.tick(sent, &still)?;
        if agent.take_touch() {
            come_free(agent, sent)?;
            return Ok(DriveOutcome::Blocked("the arm touches something".into()));
        }
    }
    Ok(DriveOutcome::TimeUp)
}

/// What the cameras showed a moment ago holds the base back.
fn find_speed_limits(agent: &mut Agent, world_from_base: &Pose, radius_m: f64, nav: &NavConfig) -> SpeedLimits {
    let now = agent.now();
    let floor = &agent.map().free_space;
    let known = |place: &Point2<f64>| is_mapped(floor, floor.cell_at(place));
    agent.live.find_speed_limits((now, world_from_base), radius_m, &known, &nav.live)
}

/// What lies beside a mapped obstacle is the same one, seen from a pose that wandered.
fn is_mapped(floor: &FreeSpace, [x, y]: [i32; 2]) -> bool {
    let mut around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [x + dx, y + dy]));
    around.any(|cell| floor.state(cell) == CellState::Occupied)
}

/// Adds what the cameras see now and the map does not show yet; what is mapped must not close a door.
fn add_unmapped(floor: &mut FreeSpace, live: &LiveObstacles) {
    let mut unmapped: Vec<[i32; 2]> = live.points().map(|point| floor.cell_at(&point)).collect();
    unmapped.dedup();
    unmapped.retain(|cell| !is_mapped(floor, *cell));
    for cell in unmapped {
        floor.set(cell, CellState::Occupied);
    }
}

/// Adds small things that lie on the floor: what is lower than the floor grid's obstacles is run over all the same.
fn add_low_things(floor: &mut FreeSpace, map: &Map) {
    /// What stands higher is in the grid, metres.
    const HIGHEST_M: f64 = 0.12;
    /// Lower than this are rugs and noise, metres.
    const LOWEST_M: f64 = 0.02;
    /// What is wider is no thing that somebody dropped, metres.
    const WIDEST_M: f64 = 0.4;
    let lies = |object: &&MapObject| {
        let (size, top_m) = (object.bounds.size, object.bounds.top_m());
        (LOWEST_M..HIGHEST_M).contains(&top_m) && size.x.max(size.y) < WIDEST_M
    };
    for object in map.stable_objects().filter(lies) {
        for point in &object.points {
            floor.set(floor.cell_at(&point.position.cast::<f64>().xy()), CellState::Occupied);
        }
    }
}

/// What is held up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HeldUp {
    Base,
    /// It sticks out of the footprint, so that the base says nothing of where.
    Arm,
}

/// Something unseen holds up what was `sent`: drives a little the other way, and remembers where if it was the base.
fn come_free(agent: &mut Agent, sent: Twist) -> Result<HeldUp, Halt> {
    const SPEED_M_PER_S: f64 = 0.09;
    const DURATION: Span = Span(2_000_000_000);
    /// The thing is a little beyond the footprint, metres.
    const BEYOND_M: f64 = 0.04;
    /// A robot that sticks out of its footprint by less is folded, metres.
    const FOLDED_M: f64 = 0.02;
    let way = if sent.forward_m_per_s < 0.0 { -1.0 } else { 1.0 };
    let world_from_base = agent.world_from_base()?;
    let radius_m = agent.model().settings.base.footprint_radius_m;
    let configuration = agent.configuration()?;
    let out_m = agent.model().radius_m(&configuration);
    // A load is folded in as far as it goes, and keeps to no side.
    let is_arm = out_m > radius_m + FOLDED_M && agent.held().is_none();
    let held_up = if is_arm { HeldUp::Arm } else { HeldUp::Base };
    if held_up == HeldUp::Base {
        let ahead = world_from_base * Point3::new(way * (radius_m + BEYOND_M), 0.0, 0.0);
        agent.bumps.push(ahead.xy());
        agent.note(format!("something unseen is in the way at ({:.2}, {:.2})", ahead.x, ahead.y));
    } else {
        agent.note("the arm touches something");
    }
    let still = JointVelocities::zeros(&agent.model().arm.joints);
    let end = agent.now() + DURATION;
    while agent.now() < end {
        agent.tick(Twist { forward_m_per_s: -way * SPEED_M_PER_S, turn_rad_per_s: 0.0 }, &still)?;
    }
    agent.take_touch();
    Ok(held_up)
}
