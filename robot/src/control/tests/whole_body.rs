//! Contract: with the base in the program the tool reaches goals beyond the arm; the base does little near the goal,
//! keeps its limits, stops before walls, and faces where the arm works. Without it nothing of the base moves.

use super::super::*;
use super::{DT_S, PerfectArm, porter};
use crate::model::{Obstacle, RobotModel};
use dsm::Pose;
use dsm::geometry::OrientedBox;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

/// A robot that does exactly what it is told.
struct PerfectRobot<'a> {
    arm: PerfectArm<'a>,
    world_from_base: Pose,
    base: Twist,
}

impl<'a> PerfectRobot<'a> {
    fn new(model: &'a RobotModel) -> Self {
        Self { arm: PerfectArm::at(model, "ready_front"), world_from_base: Pose::identity(), base: Twist::default() }
    }

    fn world_from_tool(&self) -> Pose {
        self.world_from_base * self.arm.base_from_tool()
    }

    fn tick(&mut self, controller: &mut Controller, world_from_tool: &Pose, obstacles: &[Obstacle]) -> ControlOutput {
        let base_from_world = self.world_from_base.inverse();
        let in_base: Vec<Obstacle> = obstacles.iter().map(|obstacle| obstacle.seen_from(&base_from_world)).collect();
        let goal = ToolGoal::from(base_from_world * world_from_tool);
        let output = controller.tick_with_base(&self.arm.state, self.base, &goal, &in_base, DT_S);
        let limits = &self.arm.model.settings.base;
        let (speed, turn) = (output.base.forward_m_per_s, output.base.turn_rad_per_s);
        assert!(speed.abs() <= limits.max_speed_m_per_s + 1e-9 && turn.abs() <= limits.max_turn_rate_rad_per_s + 1e-9);
        let (gained, turned) = (speed - self.base.forward_m_per_s, turn - self.base.turn_rad_per_s);
        assert!(gained.abs() <= limits.max_acceleration_m_per_s2 * DT_S + 1e-9, "{gained}");
        assert!(turned.abs() <= limits.max_turn_acceleration_rad_per_s2 * DT_S + 1e-9, "{turned}");
        self.arm.follow(&output.velocities);
        self.base = output.base;
        let step = Isometry3::new(Vector3::new(speed * DT_S, 0.0, 0.0), Vector3::z() * (turn * DT_S));
        self.world_from_base *= step;
        output
    }

    fn least_distance_m(&self, obstacle: &Obstacle) -> f64 {
        let seen = obstacle.seen_from(&self.world_from_base.inverse());
        let poses = self.arm.model.kinematics.root_from_links(&self.arm.configuration);
        let found = self.arm.model.collision.obstacle_distances(&poses, &[seen], &[], 0.5);
        found.iter().map(|pair| pair.distance_m).fold(f64::INFINITY, f64::min)
    }
}

#[test]
fn base_and_arm_reach_goals_beyond_the_arm_and_the_base_rests_at_the_goal() {
    let model = porter();
    for (x, y, yaw) in [(1.5, 0.3, 0.0), (1.0, -0.8, -0.7), (0.15, 0.05, 0.2)] {
        let mut controller = Controller::with_base(&model, ControllerConfig::default());
        let mut robot = PerfectRobot::new(&model);
        let start = robot.world_from_tool();
        let goal = Pose::translation(x, y, 0.05) * Pose::rotation(Vector3::z() * yaw) * start;
        let ticks = (0..1500).find(|_| robot.tick(&mut controller, &goal, &[]).status == ControlStatus::Reached);
        assert!(ticks.is_some(), "{x} {y} {yaw}: {:?}", robot.world_from_tool());
        assert!(robot.base.forward_m_per_s.abs() < 0.1, "the base still drives at {:?}", robot.base);
    }
}

#[test]
fn a_wall_stops_base_and_arm_at_the_stop_distance() {
    let model = porter();
    let mut controller = Controller::with_base(&model, ControllerConfig::default());
    let mut robot = PerfectRobot::new(&model);
    let goal = Pose::translation(1.5, 0.0, 0.0) * robot.world_from_tool();
    let wall = Obstacle::still_box(Pose::translation(1.3, 0.0, 0.8), Vector3::new(0.1, 2.0, 0.8));
    let mut least_m = f64::INFINITY;
    for _ in 0..900 {
        let output = robot.tick(&mut controller, &goal, std::slice::from_ref(&wall));
        assert!(!matches!(output.status, ControlStatus::Braking { .. }), "{:?}", output.status);
        least_m = least_m.min(robot.least_distance_m(&wall));
    }
    let stop_m = ControllerConfig::default().obstacle_stop_m;
    assert!(least_m > stop_m - 0.001, "came as near as {least_m}");
    assert!(robot.least_distance_m(&wall) < stop_m + 0.02, "it should come close to the wall");
}

#[test]
fn the_base_turns_towards_a_goal_beside_it() {
    let model = porter();
    let turned_rad = |facing_weight: f64| {
        let config = ControllerConfig { facing_weight, ..ControllerConfig::default() };
        let mut controller = Controller::with_base(&model, config);
        let mut robot = PerfectRobot::new(&model);
        let goal = Pose::rotation(Vector3::z() * 0.9) * robot.world_from_tool();
        for _ in 0..300 {
            robot.tick(&mut controller, &goal, &[]);
        }
        robot.world_from_base.rotation.scaled_axis().z
    };
    let (without, with) = (turned_rad(0.0), turned_rad(0.3));
    assert!(with > without + 0.1, "{with} against {without}");
}

#[test]
fn a_watched_point_comes_into_the_middle_of_the_wrist_camera_while_the_tool_keeps_its_place() {
    let model = porter();
    let (_, camera) = model.find_camera("wrist").expect("porter has it");
    let angle_rad = |camera_weight: f64| {
        // The tool may turn a little for it.
        let config =
            ControllerConfig { camera_weight, turn_weight: 0.01, recovery: false, ..ControllerConfig::default() };
        let mut controller = Controller::new(&model, config);
        let mut arm = PerfectArm::at(&model, "ready_front");
        let tool = arm.base_from_tool();
        let point_in_base = Point3::from(tool.translation.vector + Vector3::new(0.5, 0.25, -0.1));
        controller.set_watch(Some(Watch { camera, point_in_base }));
        let goal = Pose::from_parts(tool.translation, tool.rotation * UnitQuaternion::from_euler_angles(0.0, 0.0, 0.3));
        for _ in 0..400 {
            let output = controller.tick(&arm.state, &ToolGoal::from(goal), &[], DT_S);
            arm.follow(&output.velocities);
        }
        let off = (arm.base_from_tool().translation.vector - tool.translation.vector).norm();
        assert!(off < 0.01, "the tool left its place by {off}");
        let pose = model.kinematics.root_from_link(&arm.configuration, camera);
        (pose.rotation * Vector3::z()).angle(&(point_in_base - Point3::from(pose.translation.vector)))
    };
    let (without, with) = (angle_rad(0.0), angle_rad(0.05));
    assert!(with < 0.5 * without, "{with} against {without}");
}

#[test]
fn a_held_thing_is_kept_from_obstacles_like_a_link() {
    let empty = porter();
    let held = OrientedBox {
        center: Point3::new(0.0, 0.0, 0.1),
        size: Vector3::new(0.06, 0.06, 0.2),
        rotation: UnitQuaternion::identity(),
    };
    let holding = empty.holding(&held);
    let stops_m = |model: &RobotModel| {
        let mut controller = Controller::new(model, ControllerConfig::default());
        let mut arm = PerfectArm::at(model, "ready_front");
        let start = arm.base_from_tool();
        let goal = Pose::translation(0.35, 0.0, 0.0) * start;
        let wall =
            Obstacle::still_box(Pose::translation(start.translation.x + 0.4, 0.0, 0.8), Vector3::new(0.1, 1.0, 0.8));
        for _ in 0..400 {
            let output = controller.tick(&arm.state, &ToolGoal::from(goal), std::slice::from_ref(&wall), DT_S);
            arm.follow(&output.velocities);
            let least_m = arm.clearance_m(std::slice::from_ref(&wall));
            assert!(least_m > ControllerConfig::default().obstacle_stop_m - 0.002, "came as near as {least_m}");
        }
        arm.base_from_tool().translation.x
    };
    let (without, with) = (stops_m(&empty), stops_m(&holding));
    assert!(with < without - 0.1, "with the thing it stops at {with}, without at {without}");
}
