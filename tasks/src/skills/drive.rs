//! Driving to a pose: plan, follow, plan again while driving.

use crate::agent::{Agent, Halt};
use dsm::map::{CellState, Map};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use dsm_robot::nav::{BlockReason, Costmap, FollowStatus, Follower, NavConfig, Path, PlanFailure, Pose2, find_path};
use nalgebra::{Point2, Point3};
use std::sync::Arc;

/// The path is planned anew this often while driving.
const REPLAN_EVERY: Span = Span(1_000_000_000);
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
}

type Planned = (Costmap, Result<Path, PlanFailure>);

impl<'a> Drive<'a> {
    /// To a pose.
    pub fn to_pose(nav: &'a NavConfig, goal: Pose2) -> Self {
        Self { nav, goal: goal.position, heading_rad: Some(goal.yaw_rad), end: None, enough: None }
    }

    /// To a place, with any heading.
    pub fn to_place(nav: &'a NavConfig, goal: Point2<f64>) -> Self {
        Self { nav, goal, heading_rad: None, end: None, enough: None }
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
        let still = JointVelocities::zeros(&agent.model().arm.joints);
        let mut trouble = 0;
        let work = self.planning(agent)?;
        let (mut costmap, path) = agent.plan(work)?;
        let mut follower = match path {
            Ok(path) => Follower::new(self.nav.follower.clone(), path),
            Err(failure) => return Ok(DriveOutcome::NoPath(failure)),
        };
        let mut planning = None;
        let mut planned_at = agent.now();
        let mut seen_map = agent.map().clone();
        loop {
            let now = agent.now();
            if self.end.is_some_and(|end| now >= end) {
                return Ok(DriveOutcome::TimeUp);
            }
            let world_from_base = agent.world_from_base()?;
            let velocity = agent.base_velocity()?;
            let output = follower.tick(&world_from_base, velocity, &costmap, agent.period().as_s());
            agent.tick(output.twist, &still)?;
            match output.status {
                FollowStatus::Following { .. } => {}
                FollowStatus::Arrived => return Ok(DriveOutcome::Arrived),
                FollowStatus::Blocked { reason } => {
                    trouble += 1;
                    if trouble >= MAX_TROUBLE {
                        return Ok(DriveOutcome::Blocked(format!("{reason:?}")));
                    }
                    if reason == BlockReason::Stalled {
                        come_free(agent)?;
                        // What the follower commanded before does not hold any more.
                        follower = Follower::new(self.nav.follower.clone(), follower.path().clone());
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
                    Ok(path) => follower.set_path(path),
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
        let bumps = agent.bumps.clone();
        Ok(move || {
            let mut floor = map.free_space.clone();
            for bump in &bumps {
                floor.set(floor.cell_at(bump), CellState::Occupied);
            }
            let costmap = Costmap::from_free_space(&floor, &config);
            let path = find_path(&costmap, &start, &goal);
            let path = path.map(|path| Path { goal_yaw_rad: heading_rad, ..path });
            (costmap, path)
        })
    }
}

/// Something unseen holds the base up: remembers where, and drives a little the other way.
fn come_free(agent: &mut Agent) -> Result<(), Halt> {
    const SPEED_M_PER_S: f64 = 0.12;
    const DURATION: Span = Span(1_500_000_000);
    /// The thing is a little beyond the footprint, metres.
    const BEYOND_M: f64 = 0.04;
    let world_from_base = agent.world_from_base()?;
    let radius_m = agent.model().settings.base.footprint_radius_m;
    let ahead = world_from_base * Point3::new(radius_m + BEYOND_M, 0.0, 0.0);
    agent.bumps.push(ahead.xy());
    agent.note(format!("something unseen is in the way at ({:.2}, {:.2})", ahead.x, ahead.y));
    let still = JointVelocities::zeros(&agent.model().arm.joints);
    let end = agent.now() + DURATION;
    while agent.now() < end {
        agent.tick(Twist { forward_m_per_s: -SPEED_M_PER_S, turn_rad_per_s: 0.0 }, &still)?;
    }
    Ok(())
}
