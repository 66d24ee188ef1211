//! Paths of the arm around obstacles: straight in joint space where that is free, else RRT-Connect with shortcuts.
//!
//! Two trees grow towards each other from start and goal by steps of [`STEP`]; after they meet, random shortcuts take the
//! detours out (Kuffner and LaValle 2000). For motions on which the controller is held up: it follows the error downhill
//! and cannot back out of a dead end.

use crate::joints::JointPositions;
use crate::model::{Configuration, LinkId, Obstacle, RobotModel};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What to plan, and how hard.
#[derive(Clone, Debug)]
pub struct PathRequest<'a> {
    /// Where every joint is; joints outside the arm stay.
    pub start: &'a Configuration,
    /// Obstacles in the base frame.
    pub obstacles: &'a [Obstacle],
    /// Distance to keep from obstacles in m; default 0.01. Around a start that is nearer, a share of it must do.
    pub margin_m: f64,
    /// Nodes of both trees together; default 1500.
    pub max_nodes: usize,
    /// Seed of the random nodes; default 0.
    pub seed: u64,
}

impl<'a> PathRequest<'a> {
    /// A request with the defaults.
    pub fn new(start: &'a Configuration) -> Self {
        Self { start, obstacles: &[], margin_m: 0.01, max_nodes: 1500, seed: 0 }
    }
}

/// Length of a step of the trees, in the norm of all joints, rad or m.
const STEP: f64 = 0.35;
/// Largest change of any joint between two checks, rad or m.
const CHECK: f64 = 0.06;
/// Shortcuts that are tried.
const SHORTCUTS: usize = 40;
/// Distance kept from own links in m.
const SELF_MARGIN_M: f64 = 0.005;
/// How far from the start, in the norm of all joints, its own distance from obstacles will do, rad or m.
const NEAR_START: f64 = 0.3;
/// Share of random nodes that lean towards the other tree's root.
const TO_ROOT: f64 = 0.1;

/// Way points of the arm group from the start (left out) to `goal` (the last), free when joints go straight between them.
///
/// `None` when start or goal touch something, or when the bounded search finds none; that proves nothing.
pub fn find_joint_path(
    model: &RobotModel,
    goal: &JointPositions,
    request: &PathRequest<'_>,
) -> Option<Vec<JointPositions>> {
    let start = model.arm.values_of(request.start);
    let mut space = Space {
        model,
        request,
        moved: model.arm_links(),
        start_margin_m: request.margin_m,
        start: start.clone(),
        configuration: request.start.clone(),
    };
    let value = |k: usize| goal.find(&model.arm.joints[k]).unwrap_or(start[k]);
    let goal: Vec<f64> = (0..start.len()).map(value).collect();
    // A motion that is held up stands at the distance at which it was stopped.
    const SHARES: [f64; 4] = [1.0, 0.6, 0.3, 0.0];
    let fits = |share: &&f64| {
        space.start_margin_m = **share * request.margin_m;
        space.is_free(&start)
    };
    SHARES.iter().find(fits)?;
    if !space.is_free(&goal) {
        return None;
    }
    let mut path = if space.is_way_free(&start, &goal) {
        vec![start, goal]
    } else {
        let mut rng = ChaCha8Rng::seed_from_u64(request.seed);
        let found = space.connect(start, goal, &mut rng)?;
        space.shorten(found, &mut rng)
    };
    path.remove(0);
    path.into_iter().map(|values| JointPositions::from_values(&model.arm.joints, values)).collect()
}

struct Space<'a> {
    model: &'a RobotModel,
    request: &'a PathRequest<'a>,
    moved: Vec<LinkId>,
    /// Margin within [`NEAR_START`] of the start.
    start_margin_m: f64,
    start: Vec<f64>,
    configuration: Configuration,
}

/// Nodes with their parents; the root is its own.
struct Tree {
    nodes: Vec<(Vec<f64>, usize)>,
}

impl Tree {
    fn nearest(&self, to: &[f64]) -> usize {
        let key = |node: &(Vec<f64>, usize)| distance(&node.0, to);
        let all = self.nodes.iter().enumerate();
        all.min_by(|a, b| key(a.1).total_cmp(&key(b.1))).map_or(0, |(i, _)| i)
    }

    /// From a node to the root.
    fn branch(&self, mut at: usize) -> Vec<Vec<f64>> {
        let mut way = vec![self.nodes[at].0.clone()];
        while self.nodes[at].1 != at {
            at = self.nodes[at].1;
            way.push(self.nodes[at].0.clone());
        }
        way
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn between(a: &[f64], b: &[f64], share: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + (b - a) * share).collect()
}

impl Space<'_> {
    fn is_free(&mut self, values: &[f64]) -> bool {
        self.configuration.apply_group(&self.model.arm, values);
        let poses = self.model.kinematics.root_from_links(&self.configuration);
        let is_near = distance(values, &self.start) < NEAR_START;
        let margin_m = if is_near { self.start_margin_m } else { self.request.margin_m };
        !self.model.collision.collides(&poses, self.request.obstacles, &self.moved, margin_m, SELF_MARGIN_M)
    }

    /// Whether the straight way between two free ends is free.
    fn is_way_free(&mut self, from: &[f64], to: &[f64]) -> bool {
        let most = from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let checks = (most / CHECK).ceil() as usize;
        (1..checks).all(|i| self.is_free(&between(from, to, i as f64 / checks as f64)))
    }

    /// Grows `tree` by one step from its nearest node towards `to`: the new node, and whether it is there.
    fn extend(&mut self, tree: &mut Tree, to: &[f64]) -> Option<(usize, bool)> {
        let near = tree.nearest(to);
        let from = tree.nodes[near].0.clone();
        let length = distance(&from, to);
        let arrives = length <= STEP;
        let next = if arrives { to.to_vec() } else { between(&from, to, STEP / length) };
        if !self.is_free(&next) || !self.is_way_free(&from, &next) {
            return None;
        }
        tree.nodes.push((next, near));
        Some((tree.nodes.len() - 1, arrives))
    }

    fn connect(&mut self, start: Vec<f64>, goal: Vec<f64>, rng: &mut ChaCha8Rng) -> Option<Vec<Vec<f64>>> {
        let mut trees = [Tree { nodes: vec![(start, 0)] }, Tree { nodes: vec![(goal, 0)] }];
        let limits = &self.model.arm.limits;
        let ranges: Vec<(f64, f64)> =
            limits.iter().map(|l| (l.lower.max(-std::f64::consts::PI), l.upper.min(std::f64::consts::PI))).collect();
        // Every try costs, also one that adds no node.
        for round in 0..self.request.max_nodes {
            let (grown, other) = (round % 2, 1 - round % 2);
            let lean = rng.random_range(0.0..1.0) < TO_ROOT;
            let drawn: Vec<f64> = ranges.iter().map(|(low, high)| rng.random_range(*low..=*high)).collect();
            let to = if lean { trees[other].nodes[0].0.clone() } else { drawn };
            let Some((new, _)) = self.extend(&mut trees[grown], &to) else { continue };
            let meeting = trees[grown].nodes[new].0.clone();
            // The other tree comes as far as it can.
            while let Some((last, arrives)) = self.extend(&mut trees[other], &meeting) {
                if arrives {
                    let (mine, theirs) = (trees[grown].branch(new), trees[other].branch(last));
                    let (head, tail) = if grown == 0 { (mine, theirs) } else { (theirs, mine) };
                    return Some(head.into_iter().rev().chain(tail.into_iter().skip(1)).collect());
                }
                if trees[other].nodes.len() > self.request.max_nodes {
                    return None;
                }
            }
        }
        None
    }

    fn shorten(&mut self, mut path: Vec<Vec<f64>>, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        for _ in 0..SHORTCUTS {
            if path.len() < 3 {
                break;
            }
            let from = rng.random_range(0..path.len() - 2);
            let to = rng.random_range(from + 2..path.len());
            if self.is_way_free(&path[from].clone(), &path[to].clone()) {
                path.drain(from + 1..to);
            }
        }
        path
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a free straight way is one step; around a wall the way is free at every point that is checked; the same
    //! seed gives the same way; what cannot be reached gives none.
    use super::*;
    use nalgebra::Vector3;

    fn porter() -> RobotModel {
        RobotModel::load(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter")).unwrap()
    }

    /// ready_down, turned about the first joint of the arm.
    fn turned(model: &RobotModel, turn_rad: f64) -> JointPositions {
        let mut values = model.find_posture("ready_down").unwrap();
        let index = values.names().iter().position(|name| &**name == "arm_1_joint").unwrap();
        values.values_mut()[index] += turn_rad;
        values
    }

    #[test]
    fn the_way_leads_around_a_board() {
        let model = porter();
        let mut start = model.kinematics.zero();
        start.apply(&turned(&model, 0.0));
        let goal = turned(&model, 1.0);
        let free = find_joint_path(&model, &goal, &PathRequest::new(&start)).unwrap();
        assert_eq!(free.len(), 1, "straight");
        // A board stands upright in the middle of the swing.
        let mut middle = start.clone();
        middle.apply(&turned(&model, 0.5));
        let tool = model.kinematics.root_from_link(&middle, model.tool).translation.vector;
        let board = dsm::Pose::new(tool, Vector3::z() * 0.5);
        let obstacles = [Obstacle::still_box(board, Vector3::new(0.12, 0.01, 0.06))];
        let request = PathRequest { obstacles: &obstacles, ..PathRequest::new(&start) };
        let path = find_joint_path(&model, &goal, &request);
        let Some(path) = path else { panic!("no way around the board") };
        assert!(path.len() > 1);
        let mut from = model.arm.values_of(&start);
        let links = model.arm_links();
        for to in &path {
            let to = to.values().to_vec();
            for i in 0..=40 {
                let mut configuration = start.clone();
                configuration.apply_group(&model.arm, &between(&from, &to, f64::from(i) / 40.0));
                let poses = model.kinematics.root_from_links(&configuration);
                assert!(!model.collision.collides(&poses, &obstacles, &links, 0.0, 0.0));
            }
            from = to;
        }
        assert_eq!(find_joint_path(&model, &goal, &request).unwrap(), path);
        // Walled in: no way, and an end.
        let tool = model.kinematics.root_from_link(&start, model.tool);
        let cage = [Obstacle::still_box(tool, Vector3::repeat(0.05))];
        let request = PathRequest { obstacles: &cage, ..PathRequest::new(&start) };
        assert!(find_joint_path(&model, &goal, &request).is_none());
    }
}
