//! Joint values for a tool pose: damped least squares with restarts, within limits and clear of collisions.

use super::descent::{Chain, Descent};
use crate::joints::JointPositions;
use crate::model::{Configuration, Obstacle, RobotModel};
use dsm::Pose;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What to look for, and how hard.
#[derive(Clone, Debug)]
pub struct IkRequest<'a> {
    /// Where every joint is; the search starts here, and joints outside the arm stay.
    pub start: &'a Configuration,
    /// Further starts, tried after `start` in their order.
    pub seeds: &'a [JointPositions],
    /// Obstacles in the base frame.
    pub obstacles: &'a [Obstacle],
    /// Distance to keep from obstacles in m; default 0.01.
    pub margin_m: f64,
    /// Random starts after the others; default 12.
    pub restarts: usize,
    /// Steps for each start; default 60.
    pub steps: usize,
    /// Seed of the random starts; default 0.
    pub seed: u64,
}

impl<'a> IkRequest<'a> {
    /// A request with the defaults.
    pub fn new(start: &'a Configuration) -> Self {
        Self { start, seeds: &[], obstacles: &[], margin_m: 0.01, restarts: 12, steps: 60, seed: 0 }
    }
}

/// Distance kept from joint limits, in rad or m.
const LIMIT_MARGIN: f64 = 0.01;
/// Distance kept from own links in m.
const SELF_MARGIN_M: f64 = 0.005;

/// Joint values of the arm group that bring the tool to `base_from_tool`: the first found that collides with nothing.
///
/// `None` after the bounded search; that proves nothing about the pose.
pub fn find_ik(model: &RobotModel, base_from_tool: &Pose, request: &IkRequest<'_>) -> Option<JointPositions> {
    let mut rng = ChaCha8Rng::seed_from_u64(request.seed);
    let arm = &model.arm;
    let chain = Chain::new(&model.kinematics, arm, model.tool, request.start, LIMIT_MARGIN);
    if !chain.is_searchable() {
        return None;
    }
    let from_start = arm.values_of(request.start);
    let seeded = request.seeds.iter().map(|seed| {
        let value = |k: usize| seed.find(&arm.joints[k]).unwrap_or(from_start[k]);
        (0..arm.len()).map(value).collect::<Vec<f64>>()
    });
    let mut starts: Vec<Vec<f64>> = std::iter::once(from_start.clone()).chain(seeded).collect();
    for _ in 0..request.restarts {
        let draw = |k: usize, rng: &mut ChaCha8Rng| {
            let (lower, upper) = chain.ranges[k];
            rng.random_range(lower..=upper)
        };
        starts.push((0..arm.len()).map(|k| draw(k, &mut rng)).collect());
    }
    let moved = model.arm_links();
    starts.into_iter().find_map(|start| {
        let mut descent = Descent::new(&chain, start);
        let arrived = (0..request.steps).find_map(|_| match descent.step(&chain, base_from_tool) {
            Some(false) => None,
            end => Some(end == Some(true)),
        });
        let values = if arrived? { descent.values } else { return None };
        let mut configuration = request.start.clone();
        configuration.apply_group(arm, &values);
        let poses = model.kinematics.root_from_links(&configuration);
        let clear = !model.collision.collides(&poses, request.obstacles, &moved, request.margin_m, SELF_MARGIN_M);
        if clear { JointPositions::from_values(&arm.joints, values) } else { None }
    })
}
