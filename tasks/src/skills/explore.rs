//! Exploration: look around, drive to the best frontier, look around there, until nothing worth seeing is left.

use super::drive::{Drive, DriveOutcome};
use crate::agent::{Agent, Gaze, Halt};
use dsm::map::Map;
use dsm::time::{Span, Stamp};
use dsm_robot::nav::{Costmap, CoverageGrid, Field, FrontierMemory, NavConfig, Pose2, find_frontiers};
use std::sync::Arc;

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
}

enum Next {
    Frontier(dsm_robot::nav::Frontier),
    Viewpoint(dsm_robot::nav::Viewpoint),
    Nothing,
}

impl Explorer {
    /// An explorer that has been nowhere.
    pub fn new(nav: NavConfig) -> Self {
        let coverage = CoverageGrid::default();
        Self { nav, frontiers: FrontierMemory::default(), coverage, views_noted: 0, looked_around: false }
    }

    /// Explores until `enough` says so, nothing is left, or `end` comes.
    pub fn run(
        &mut self,
        agent: &mut Agent,
        end: Stamp,
        enough: &mut dyn FnMut(&Arc<Map>) -> bool,
    ) -> Result<ExploreOutcome, Halt> {
        if !self.looked_around {
            look_around(agent, 2.4)?;
            self.looked_around = true;
        }
        loop {
            if enough(agent.map()) {
                return Ok(ExploreOutcome::Enough);
            }
            if agent.now() >= end {
                return Ok(ExploreOutcome::TimeUp);
            }
            match self.choose(agent)? {
                Next::Frontier(frontier) => {
                    let now_s = agent.now().as_s();
                    agent.journal.note(
                        now_s,
                        format!("frontier at ({:.1}, {:.1})", frontier.center.x, frontier.center.y),
                        None,
                    );
                    self.frontiers.record(&frontier, &self.nav.frontier);
                    match self.visit(agent, frontier.stand, end, enough)? {
                        DriveOutcome::Arrived => look_around(agent, 1.0)?,
                        DriveOutcome::Enough => return Ok(ExploreOutcome::Enough),
                        _ => self.frontiers.give_up(&frontier, &self.nav.frontier),
                    }
                }
                Next::Viewpoint(view) => {
                    let now_s = agent.now().as_s();
                    agent.journal.note(
                        now_s,
                        format!("viewpoint at ({:.1}, {:.1})", view.stand.position.x, view.stand.position.y),
                        None,
                    );
                    self.coverage.settle(&view);
                    if self.visit(agent, view.stand, end, enough)? == DriveOutcome::Enough {
                        return Ok(ExploreOutcome::Enough);
                    }
                    look_around(agent, 0.5)?;
                }
                Next::Nothing => return Ok(ExploreOutcome::Complete),
            }
        }
    }

    fn visit(
        &mut self,
        agent: &mut Agent,
        stand: Pose2,
        end: Stamp,
        enough: &mut dyn FnMut(&Arc<Map>) -> bool,
    ) -> Result<DriveOutcome, Halt> {
        // The head looks ahead and a little down while driving.
        agent.gaze = Gaze::Joints(vec![0.0, 0.42]);
        Drive::new(&self.nav, stand).until(end).stop_when(enough).run(agent)
    }

    fn choose(&mut self, agent: &mut Agent) -> Result<Next, Halt> {
        let map = agent.map().clone();
        let views = &agent.journal.views;
        let new_views = views[self.views_noted..].to_vec();
        self.views_noted = views.len();
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let (nav, memory) = (self.nav.clone(), self.frontiers.clone());
        let mut coverage = std::mem::take(&mut self.coverage);
        let (next, coverage) = agent.plan(move || {
            let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
            for world_from_camera in &new_views {
                coverage.observe(&costmap, world_from_camera, &nav.coverage);
            }
            let field = Field::from_start(&costmap, &start);
            let frontier = find_frontiers(&costmap, &field, &memory, &nav.frontier).into_iter().next();
            let next = frontier.map(Next::Frontier).unwrap_or_else(|| {
                let views = coverage.find_viewpoints(&map, &costmap, &field, &nav.coverage);
                views.into_iter().next().map_or(Next::Nothing, Next::Viewpoint)
            });
            (next, coverage)
        })?;
        self.coverage = coverage;
        Ok(next)
    }
}

/// Pans the head from side to side, `half_rad` each way, looking a little down.
pub fn look_around(agent: &mut Agent, half_rad: f64) -> Result<(), Halt> {
    const TILT_RAD: f64 = 0.42;
    const PAN_RATE_RAD_PER_S: f64 = 1.6;
    let limits = agent.model().head.limits.first().map_or((-half_rad, half_rad), |l| (l.lower, l.upper));
    let (low, high) = ((-half_rad).max(limits.0), half_rad.min(limits.1));
    let period_s = agent.period().as_s();
    for (from, to) in [(0.0, high), (high, low), (low, 0.0)] {
        let ticks = ((to - from).abs() / PAN_RATE_RAD_PER_S / period_s).ceil().max(1.0) as usize;
        for i in 1..=ticks {
            agent.gaze = Gaze::Joints(vec![from + (to - from) * i as f64 / ticks as f64, TILT_RAD]);
            agent.rest(Span::from_s(period_s))?;
        }
    }
    Ok(())
}
