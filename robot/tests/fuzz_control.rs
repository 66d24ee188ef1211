//! Contract: whatever state, step and obstacles the controller meets, it does not panic, and every answer keeps all
//! limits or is a brake and says so; from states at rest it never lets standing obstacles come nearer than the stop
//! distance, nor own links touch.
//!
//! `DSM_FUZZ_TICKS` sets the number of ticks; `tests/run --full` sets a million.

use dsm::Pose;
use dsm::time::{Span, Stamp};
use dsm_robot::control::columns::Columns;
use dsm_robot::control::damper::closing_speed_bound;
use dsm_robot::control::joint_limit::JointEnvelope;
use dsm_robot::control::qp::least_in_box;
use dsm_robot::control::{
    ControlOutput, ControlStatus, Controller, ControllerConfig, ToolGoal, base_limit, obstacle_limit,
    self_collision_limit,
};
use dsm_robot::drivers::{JointState, Twist};
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::{Configuration, Hull, LinkId, LinkPoses, Obstacle, Other, PairDistance, RobotModel};
use nalgebra::{DVector, Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::sync::Arc;

const SHORT: usize = 6_000;
/// Speed by which rounding may pass a bound, m/s, rad/s.
const ROUNDING: f64 = 2e-6;
/// What single-precision distances and the turning within a step may take from the stop distance, m.
const KEPT_WITHIN_M: f64 = 0.002;
/// The same between own links, whose long parallel edges turn: the closest points of a pair may jump from one end of an
/// edge to the other. It is less than their stop distance.
const OWN_WITHIN_M: f64 = 0.008;

fn ticks() -> usize {
    std::env::var("DSM_FUZZ_TICKS").map_or(SHORT, |text| text.parse().expect("DSM_FUZZ_TICKS is a number"))
}

struct Robot<'a> {
    model: &'a RobotModel,
    config: ControllerConfig,
    envelopes: Vec<JointEnvelope>,
    columns: Columns,
    links: Vec<LinkId>,
    configuration: Configuration,
    state: JointState,
    base: Twist,
    obstacles: Vec<Obstacle>,
    goal: Pose,
    dt_s: f64,
}

impl<'a> Robot<'a> {
    fn new(model: &'a RobotModel, with_base: bool) -> Self {
        let config = ControllerConfig::default();
        let arm = &model.arm;
        let envelope = |k: usize| {
            JointEnvelope::new(&arm.limits[k], arm.max_accelerations[k], config.limit_margin, config.velocity_share)
        };
        let mut envelopes: Vec<JointEnvelope> = (0..arm.len()).map(envelope).collect();
        if with_base {
            envelopes.extend(base_limit::base_envelopes(&model.settings.base, config.velocity_share));
        }
        let everything = (0..model.kinematics.links.len()).map(LinkId).collect();
        Self {
            model,
            envelopes,
            columns: Columns::new(&model.kinematics, arm, with_base),
            links: if with_base { everything } else { model.arm_links() },
            configuration: model.kinematics.zero(),
            state: JointState {
                stamp: Stamp(0),
                positions: JointPositions::zeros(&arm.joints),
                velocities: JointVelocities::zeros(&arm.joints),
            },
            base: Twist::default(),
            obstacles: Vec::new(),
            goal: Pose::identity(),
            dt_s: 0.01,
            config,
        }
    }

    fn controller(&self) -> Controller {
        match self.columns.find_base() {
            Some(_) => Controller::with_base(self.model, self.config.clone()),
            None => Controller::new(self.model, self.config.clone()),
        }
    }

    fn poses(&self) -> LinkPoses {
        self.model.kinematics.root_from_links(&self.configuration)
    }

    /// Joints anywhere, `beyond` their limits by that share of their range; velocities up to `speed` times the limits.
    fn draw_state(&mut self, rng: &mut ChaCha8Rng, beyond: f64, speed: f64) {
        for k in 0..self.model.arm.len() {
            let (limits, envelope) = (&self.model.arm.limits[k], &self.envelopes[k]);
            let range = (limits.upper - limits.lower) * beyond;
            self.state.positions.values_mut()[k] = rng.random_range(limits.lower - range..=limits.upper + range);
            self.state.velocities.values_mut()[k] = rng.random_range(-1.0..=1.0) * envelope.velocity * speed;
        }
        if let Some(base) = self.columns.find_base() {
            let (forward, turn) = (self.envelopes[base].velocity * speed, self.envelopes[base + 1].velocity * speed);
            self.base = Twist {
                forward_m_per_s: rng.random_range(-1.0..=1.0) * forward,
                turn_rad_per_s: rng.random_range(-1.0..=1.0) * turn,
            };
        }
        self.state.stamp = Stamp(0);
        self.configuration.apply_group(&self.model.arm, self.state.positions.values());
        // 20 to 500 Hz.
        self.dt_s = 0.002 * 25.0_f64.powf(rng.random_range(0.0..=1.0));
    }

    /// Boxes and balls about the moved links, and a goal somewhere in front.
    fn draw_surroundings(&mut self, rng: &mut ChaCha8Rng, most: usize, moving: bool) {
        let poses = self.poses();
        let mut vector = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..=size));
        let shift = vector(0.6);
        let turn = vector(1.5);
        self.goal =
            Pose::translation(0.5, 0.0, 0.8) * Pose::translation(shift.x, shift.y, shift.z) * Pose::rotation(turn);
        self.obstacles.clear();
        let corners = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.15, 0.0], [0.0, 0.0, 0.1], [0.1, 0.1, 0.12]];
        let wedge = Arc::new(Hull::of(&corners.map(Point3::from)).expect("a solid"));
        for _ in 0..rng.random_range(0..=most) {
            let link = self.links[rng.random_range(0..self.links.len())];
            let mut vector = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..=size));
            let center = poses.get(link).translation.vector + vector(0.35);
            let (turn, half, velocity) = (vector(3.0), vector(0.15), vector(0.8));
            let velocity_m_per_s = if moving && rng.random_bool(0.5) { velocity } else { Vector3::zeros() };
            self.obstacles.push(match rng.random_range(0..3) {
                0 => Obstacle::Ball { center_in_base: center.into(), radius_m: half.x.abs() + 0.01, velocity_m_per_s },
                1 => Obstacle::Hull { base_from_hull: Pose::new(center, turn), hull: wedge.clone(), velocity_m_per_s },
                _ => Obstacle::Box {
                    base_from_box: Pose::new(center, turn),
                    half_size_m: half.abs().add_scalar(0.01),
                    velocity_m_per_s,
                },
            });
        }
    }

    fn velocities(&self) -> DVector<f64> {
        let base = [self.base.forward_m_per_s, self.base.turn_rad_per_s];
        let all = self.state.velocities.values().iter().chain(&base).copied();
        DVector::from_iterator(self.columns.len(), all.take(self.columns.len()))
    }

    /// Checks an answer by the definition of the limits; the state is the one before the step.
    fn check(&self, output: &ControlOutput, before: &DVector<f64>) {
        let base = [output.base.forward_m_per_s, output.base.turn_rad_per_s];
        let all = output.velocities.values().iter().chain(&base).copied();
        let answer = DVector::from_iterator(self.columns.len(), all.take(self.columns.len()));
        assert!(answer.iter().all(|v| v.is_finite()), "{output:?}");
        for (k, envelope) in self.envelopes.iter().enumerate() {
            let gained = answer[k] - before[k];
            assert!(gained.abs() <= envelope.acceleration * self.dt_s + 1e-9, "{k} gains {gained}");
        }
        if let ControlStatus::Braking { .. } = output.status {
            assert!((0..answer.len()).all(|k| answer[k].abs() <= before[k].abs()), "{answer} {before}");
            return;
        }
        let (mut lower, mut upper) = (before.clone(), before.clone());
        // Joints come to rest together, and so does the base: times from the present, and from the box.
        let joints = self.model.arm.len();
        let (mut stops_in_s, mut greatest_s) = ([0.0_f64; 2], [0.0_f64; 2]);
        for (k, envelope) in self.envelopes.iter().enumerate() {
            let position = self.state.positions.values().get(k).copied().unwrap_or(0.0);
            (lower[k], upper[k]) = envelope.allowed(position, before[k], self.dt_s);
            assert!((lower[k] - 1e-9..=upper[k] + 1e-9).contains(&answer[k]), "{k}: {}", answer[k]);
            let part = usize::from(k >= joints);
            stops_in_s[part] = stops_in_s[part].max(before[k].abs() / envelope.acceleration);
            greatest_s[part] = greatest_s[part].max(lower[k].abs().max(upper[k].abs()) / envelope.acceleration);
        }
        // What no row may allow less than.
        let braked = DVector::from_fn(before.len(), |k, _| {
            let left = (1.0 - self.dt_s / stops_in_s[usize::from(k >= joints)].max(self.dt_s)).max(0.0);
            (before[k] * left).clamp(lower[k], upper[k])
        });
        let poses = self.poses();
        let tree = (&self.model.kinematics, &poses);
        let mut pairs = self.model.collision.self_distances(&poses, 0.1);
        pairs.extend(self.model.collision.obstacle_distances(&poses, &self.obstacles, &self.links, 0.1));
        for pair in &pairs {
            let (coefficients, stop_m, receding) = match pair.other {
                Other::Link(_) => {
                    let found = self_collision_limit::closing_coefficients(&self.columns, tree, pair);
                    (found.expect("links"), self.config.self_stop_m, 0.0)
                }
                Other::Obstacle(index) => (
                    obstacle_limit::closing_coefficients(&self.columns, tree, &Pose::identity(), pair),
                    self.config.obstacle_stop_m,
                    obstacle_limit::receding_m_per_s(pair, &self.obstacles[index]),
                ),
            };
            let spare_m = pair.distance_m - stop_m;
            let with_base = coefficients.iter().skip(joints).any(|c| c.abs() > 1e-9);
            let time_s = if with_base { greatest_s[0].max(greatest_s[1]) } else { greatest_s[0] };
            let wanted = closing_speed_bound(&self.config, spare_m, time_s, self.dt_s) + receding;
            let bound = wanted.max(least_in_box(&coefficients, &lower, &upper)).max(coefficients.dot(&braked));
            let closing = coefficients.dot(&answer);
            assert!(closing <= bound + ROUNDING, "{pair:?} closes at {closing}, allowed {bound}");
        }
    }

    /// Does what it is told; what stands on the floor moves the other way in the base frame.
    fn follow(&mut self, output: &ControlOutput) {
        for (k, velocity) in output.velocities.values().iter().enumerate() {
            self.state.positions.values_mut()[k] += velocity * self.dt_s;
        }
        self.state.velocities = output.velocities.clone();
        self.state.stamp = self.state.stamp + Span::from_s(self.dt_s);
        self.configuration.apply_group(&self.model.arm, self.state.positions.values());
        self.base = output.base;
        let (way_m, turn_rad) = (self.base.forward_m_per_s * self.dt_s, self.base.turn_rad_per_s * self.dt_s);
        // Along the arc.
        let half = Isometry3::rotation(Vector3::z() * (0.5 * turn_rad));
        let after_from_before = (half * Pose::translation(way_m, 0.0, 0.0) * half).inverse();
        self.goal = after_from_before * self.goal;
        for obstacle in &mut self.obstacles {
            let way = obstacle.velocity_m_per_s() * self.dt_s;
            let drifted = Pose::translation(way.x, way.y, way.z);
            *obstacle = obstacle.seen_from(&drifted).seen_from(&after_from_before);
        }
    }

    /// The least spare distances: to what stands, and between own links.
    fn spare_m(&self) -> (f64, f64) {
        let poses = self.poses();
        let least = |pairs: Vec<PairDistance>, stop_m: f64| {
            pairs.iter().map(|pair| pair.distance_m - stop_m).fold(f64::INFINITY, f64::min)
        };
        // A pair that only joints outside the group move is not the controller's.
        let own = self.model.collision.self_distances(&poses, 0.05).into_iter().filter(|pair| {
            self_collision_limit::closing_coefficients(&self.columns, (&self.model.kinematics, &poses), pair)
                .is_some_and(|c| c.amax() > 1e-9)
        });
        let around = self.model.collision.obstacle_distances(&poses, &self.obstacles, &self.links, 0.05);
        (least(around, self.config.obstacle_stop_m), least(own.collect(), self.config.self_stop_m))
    }
}

fn porter() -> RobotModel {
    RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter")).expect("porter loads")
}

#[test]
#[allow(clippy::print_stderr, reason = "the counts are the result")]
fn any_state_gets_a_feasible_answer_or_a_brake() {
    let model = porter();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut robots = [Robot::new(&model, false), Robot::new(&model, true)];
    let mut controllers = robots.each_ref().map(Robot::controller);
    let (mut done, mut active, mut braking) = (0, 0, 0);
    while done < ticks() / 2 {
        let which = usize::from(rng.random_bool(0.5));
        let (robot, controller) = (&mut robots[which], &mut controllers[which]);
        robot.draw_state(&mut rng, 0.15, 1.3);
        robot.draw_surroundings(&mut rng, 4, true);
        controller.reset();
        for _ in 0..4 {
            let mut state = robot.state.clone();
            let broken = rng.random_bool(0.01);
            if broken {
                state.positions.values_mut()[3] = if rng.random_bool(0.5) { f64::NAN } else { f64::INFINITY };
            }
            let goal = ToolGoal::from(robot.goal);
            let output = controller.tick_with_base(&state, robot.base, &goal, &robot.obstacles, robot.dt_s);
            robot.check(&output, &robot.velocities());
            let brakes = matches!(output.status, ControlStatus::Braking { .. });
            assert!(brakes || !broken);
            done += 1;
            active += usize::from(output.active_rows > 0);
            braking += usize::from(brakes);
            robot.follow(&output);
        }
    }
    eprintln!("{done} ticks, {active} with an active row, {braking} braking");
    assert!(active * 10 >= done * 3, "only {active} of {done} ticks have an active row");
}

#[test]
#[allow(clippy::print_stderr, reason = "the counts are the result")]
fn from_rest_the_stop_distance_to_what_stands_is_kept() {
    let model = porter();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut robots = [Robot::new(&model, false), Robot::new(&model, true)];
    let mut controllers = robots.each_ref().map(Robot::controller);
    let (mut done, mut active, mut braking, mut least_m) = (0, 0, 0, (f64::INFINITY, f64::INFINITY));
    let mut worst = String::new();
    while done < ticks() / 2 {
        let which = usize::from(rng.random_bool(0.5));
        let (robot, controller) = (&mut robots[which], &mut controllers[which]);
        robot.draw_state(&mut rng, -0.02, 0.0);
        robot.draw_surroundings(&mut rng, 7, false);
        let (around_m, own_m) = robot.spare_m();
        if around_m.min(own_m) < 0.0 {
            continue;
        }
        let start = robot.state.positions.clone();
        controller.reset();
        for _ in 0..(1.5 / robot.dt_s) as usize {
            let goal = ToolGoal::from(robot.goal);
            let output = controller.tick_with_base(&robot.state, robot.base, &goal, &robot.obstacles, robot.dt_s);
            robot.follow(&output);
            done += 1;
            active += usize::from(output.active_rows > 0);
            braking += usize::from(matches!(output.status, ControlStatus::Braking { .. }));
            let (around_m, own_m) = robot.spare_m();
            if around_m < least_m.0 {
                worst = format!(
                    "at {} s, step {} s, base {}, from {start:?}, obstacles {:?}",
                    robot.state.stamp.as_s(),
                    robot.dt_s,
                    which == 1,
                    robot.obstacles
                );
            }
            least_m = (least_m.0.min(around_m), least_m.1.min(own_m));
        }
    }
    eprintln!("{done} ticks, {active} with an active row, {braking} braking, least spare {least_m:?} m");
    assert!(least_m.0 > -KEPT_WITHIN_M, "{} m beyond the stop distance {worst}", -least_m.0);
    assert!(least_m.1 > -OWN_WITHIN_M, "own links come {} m nearer than their stop distance", -least_m.1);
    // Standing surroundings hardly ever contradict each other from a state at rest.
    assert!(braking * 1000 <= done, "{braking} of {done} ticks brake");
    assert!(active * 10 >= done * 2, "only {active} of {done} ticks have an active row");
}
