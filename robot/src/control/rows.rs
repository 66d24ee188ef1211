//! The rows of a moment: which distances matter, and the damper of each.

use super::columns::{BallMotion, Columns};
use super::config::ControllerConfig;
use super::damper::{Approach, Damper, Moment, find_damper, find_damper_ahead, influence_m};
use super::{obstacle_limit, self_collision_limit};
use crate::model::{CollisionModel, Kinematics, LinkId, LinkPoses, Obstacle, Other, PairDistance};
use dsm::Pose;
use nalgebra::{DVector, Vector3};

/// Distances up to this far beyond the stop distance are reported even if they hold nothing back, m.
const REPORTED_M: f64 = 0.02;

/// Dampers of a moment.
#[derive(Default)]
pub(super) struct Rows {
    pub(super) dampers: Vec<Damper>,
    pub(super) min_distance_m: Option<f64>,
}

/// What rows are made of.
pub(super) struct RowSources<'a> {
    pub(super) config: &'a ControllerConfig,
    pub(super) columns: &'a Columns,
    pub(super) kinematics: &'a Kinematics,
    pub(super) collision: &'a CollisionModel,
    pub(super) poses: &'a LinkPoses,
    /// On the way of a brake that begins now; empty when that is short.
    pub(super) ahead: Vec<Ahead>,
    /// Links to keep from obstacles.
    pub(super) kept: &'a [LinkId],
    pub(super) obstacles: &'a [Obstacle],
}

/// The robot somewhere on the way of the brake that would begin now.
pub(super) struct Ahead {
    /// In the base frame of the present.
    pub(super) poses: LinkPoses,
    /// The base in its present frame.
    pub(super) base: Pose,
    /// The way there, by variable.
    pub(super) delta: DVector<f64>,
    /// Part of the whole way.
    pub(super) share: f64,
}

/// How fast parts can get nearer to each other within the box: an upper bound without knowing where they touch.
///
/// ```text
/// |v| <= | sum of v_k at the middle of the box | + |w| r + sum of half the width of the box times the lever
/// ```
struct Speeds {
    variables: usize,
    joints: usize,
    radii_m: Vec<f64>,
    /// By part, then variable.
    motions: Vec<BallMotion>,
    /// Middle and half of the width of the box, by variable.
    middle: Vec<f64>,
    half: Vec<f64>,
    /// Results of [`Self::between`]: of each part alone, and of pairs of parts.
    alone: Vec<(f64, f64)>,
    paired: Vec<(f64, f64)>,
}

impl Speeds {
    fn new(sources: &RowSources<'_>, moment: &Moment<'_>) -> Self {
        let RowSources { columns, kinematics, collision, poses, .. } = sources;
        let variables = columns.len();
        let balls = collision.balls(poses);
        let mut motions = vec![BallMotion::default(); balls.len() * variables];
        for (ball, motions) in balls.iter().zip(motions.chunks_mut(variables.max(1))) {
            columns.ball_motions((kinematics, poses), ball.link, (&ball.center, ball.radius_m), motions);
        }
        let mut speeds = Self {
            variables,
            joints: columns.find_base().unwrap_or(variables),
            radii_m: balls.iter().map(|ball| ball.radius_m).collect(),
            motions,
            middle: (0..variables).map(|k| 0.5 * (moment.lower[k] + moment.upper[k])).collect(),
            half: (0..variables).map(|k| 0.5 * (moment.upper[k] - moment.lower[k])).collect(),
            alone: Vec::new(),
            paired: vec![(0.0, 0.0); balls.len() * balls.len()],
        };
        speeds.alone = (0..speeds.parts()).map(|part| speeds.between(part, None)).collect();
        for (first, second) in collision.pairs() {
            speeds.paired[first * balls.len() + second] = speeds.between(*first, Some(*second));
        }
        speeds
    }

    /// The same as [`Self::between`] for a pair that is checked.
    fn find(&self, part: usize, other: Option<usize>) -> (f64, f64) {
        match other {
            None => self.alone[part],
            Some(other) => self.paired[part * self.parts() + other],
        }
    }

    fn parts(&self) -> usize {
        self.radii_m.len()
    }

    fn of(&self, part: usize) -> &[BallMotion] {
        &self.motions[part * self.variables..(part + 1) * self.variables]
    }

    /// Greatest relative speed (m/s) and turning rate (rad/s) of a part against the floor, or against another part. What
    /// moves both moves neither against the other. Zero when nothing moves one against the other.
    fn between(&self, part: usize, other: Option<usize>) -> (f64, f64) {
        let mut linear = Vector3::zeros();
        let mut angular = [Vector3::zeros(); 2];
        let (mut slack, mut slack_turn) = (0.0, 0.0);
        let mut add = |k: usize, motion: &BallMotion, side: usize| {
            let sign = if side == 0 { 1.0 } else { -1.0 };
            linear += motion.linear * (sign * self.middle[k]);
            angular[side] += motion.angular * self.middle[k];
            slack += motion.greatest * self.half[k].max(1e-9);
            slack_turn += motion.angular.norm() * self.half[k];
        };
        match other {
            None => {
                for (k, motion) in self.of(part).iter().enumerate().filter(|(_, motion)| motion.moves) {
                    add(k, motion, 0);
                }
            }
            Some(other) => {
                for (k, (a, b)) in self.of(part).iter().zip(self.of(other)).enumerate().take(self.joints) {
                    match (a.moves, b.moves) {
                        (true, false) => add(k, a, 0),
                        (false, true) => add(k, b, 1),
                        _ => {}
                    }
                }
            }
        }
        let turns = [angular[0].norm(), angular[1].norm()];
        let swept = turns[0] * self.radii_m[part] + other.map_or(0.0, |other| turns[1] * self.radii_m[other]);
        (linear.norm() + swept + slack, turns[0] + turns[1] + slack_turn)
    }
}

/// Dampers that the box does not already hold.
pub(super) fn find_rows(sources: &RowSources<'_>, moment: &Moment<'_>) -> Rows {
    let RowSources { config, columns, kinematics, collision, poses, kept, obstacles, .. } = sources;
    let speeds = Speeds::new(sources, moment);
    let (dt_s, time_s) = (moment.dt_s, moment.longest_braking_time_s());
    // |p''| <= 2 v w for a point of a chain of turning joints: so much may one step's closing differ from the linear one.
    let curvature_m = |(speed, turn): (f64, f64)| speed * turn * dt_s * dt_s;
    let reach_m = |stop_m: f64, between: (f64, f64), other_m_per_s: f64| {
        let influence = influence_m(config, between.0 + other_m_per_s, time_s, dt_s) + curvature_m(between);
        stop_m + influence.max(REPORTED_M)
    };
    let standing: Vec<f64> =
        speeds.alone.iter().map(|between| reach_m(config.obstacle_stop_m, *between, 0.0)).collect();
    let drifts: Vec<f64> = obstacles.iter().map(|obstacle| obstacle.velocity_m_per_s().norm()).collect();
    let mut pairs = collision.self_distances_within(poses, |first, second| {
        match speeds.find(first, Some(second)) {
            // Nothing of the group moves one against the other: not the group's to keep apart.
            (0.0, _) => -f64::INFINITY,
            between => reach_m(config.self_stop_m, between, 0.0),
        }
    });
    // An empty list would mean every link.
    if !kept.is_empty() && !obstacles.is_empty() {
        let found = collision.obstacle_distances_within(poses, obstacles, kept, |part, index| match drifts[index] {
            0.0 => standing[part],
            drift => reach_m(config.obstacle_stop_m, speeds.alone[part], drift),
        });
        pairs.extend(nearest_of_each_link(found));
    }
    let mut rows = Rows::default();
    let tree = (*kinematics, *poses);
    for pair in &pairs {
        let (coefficients, stop_m, receding_m_per_s, moving) = match pair.other {
            Other::Obstacle(index) => {
                let coefficients = obstacle_limit::closing_coefficients(columns, tree, &Pose::identity(), pair);
                let obstacle = &obstacles[index];
                let moving = obstacle.velocity_m_per_s().norm_squared() > 0.0;
                (coefficients, config.obstacle_stop_m, obstacle_limit::receding_m_per_s(pair, obstacle), moving)
            }
            Other::Link(_) => match self_collision_limit::closing_coefficients(columns, tree, pair) {
                Some(coefficients) => (coefficients, config.self_stop_m, 0.0, false),
                None => continue,
            },
        };
        if amax(&coefficients) < 1e-9 {
            continue;
        }
        rows.min_distance_m = Some(rows.min_distance_m.map_or(pair.distance_m, |m| m.min(pair.distance_m)));
        let approach = Approach {
            coefficients,
            distance_m: pair.distance_m,
            stop_m,
            curvature_m: curvature_m(speeds.find(pair.parts.0, pair.parts.1)),
            receding_m_per_s,
            moving,
        };
        rows.dampers.extend(find_damper(config, approach, moment));
    }
    for ahead in &sources.ahead {
        add_rows_ahead(sources, ahead, (&speeds, moment), &mut rows);
    }
    rows
}

/// Rows of a pose on the way of the brake, for what would come too near there.
fn add_rows_ahead(sources: &RowSources<'_>, ahead: &Ahead, (speeds, moment): (&Speeds, &Moment<'_>), rows: &mut Rows) {
    let RowSources { config, columns, kinematics, collision, kept, obstacles, .. } = sources;
    // What one more step of the greatest velocities can change.
    let reach_m = |stop_m: f64, speed: f64| stop_m + 2.0 * speed * moment.dt_s;
    let mut pairs =
        collision.self_distances_within(&ahead.poses, |first, second| match speeds.find(first, Some(second)).0 {
            0.0 => -f64::INFINITY,
            speed => reach_m(config.self_stop_m, speed),
        });
    if !kept.is_empty() && !obstacles.is_empty() {
        let standing: Vec<bool> = obstacles.iter().map(|o| o.velocity_m_per_s().norm_squared() == 0.0).collect();
        let reach: Vec<f64> = speeds.alone.iter().map(|between| reach_m(config.obstacle_stop_m, between.0)).collect();
        let found = collision.obstacle_distances_within(&ahead.poses, obstacles, kept, |part, index| {
            if standing[index] { reach[part] } else { -f64::INFINITY }
        });
        pairs.extend(nearest_of_each_link(found));
    }
    let tree = (*kinematics, &ahead.poses);
    for pair in &pairs {
        let (coefficients, stop_m) = match pair.other {
            Other::Link(_) => match self_collision_limit::closing_coefficients(columns, tree, pair) {
                Some(coefficients) => (coefficients, config.self_stop_m),
                None => continue,
            },
            Other::Obstacle(_) => {
                (obstacle_limit::closing_coefficients(columns, tree, &ahead.base, pair), config.obstacle_stop_m)
            }
        };
        if amax(&coefficients) > 1e-9 {
            rows.dampers.extend(find_damper_ahead(
                coefficients,
                pair.distance_m - stop_m,
                (&ahead.delta, ahead.share),
                moment,
            ));
        }
    }
}

fn amax(coefficients: &DVector<f64>) -> f64 {
    coefficients.iter().fold(0.0, |most, c| c.abs().max(most))
}

/// The obstacles nearest to each link. A cloud of points gives a link dozens of them, which press the same way; those
/// farther off get their turn in the next tick, when they are the nearest.
fn nearest_of_each_link(pairs: Vec<PairDistance>) -> Vec<PairDistance> {
    const KEPT: usize = 12;
    if pairs.len() <= KEPT {
        return pairs;
    }
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    let key = |k: usize| (pairs[k].link, pairs[k].distance_m);
    order.sort_by(|a, b| {
        let (a, b) = (key(*a), key(*b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let mut rank = 0;
    let mut kept = Vec::with_capacity(pairs.len());
    for (at, &k) in order.iter().enumerate() {
        let same = at > 0 && pairs[order[at - 1]].link == pairs[k].link;
        rank = if same { rank + 1 } else { 0 };
        if rank < KEPT {
            kept.push(pairs[k].clone());
        }
    }
    kept
}
