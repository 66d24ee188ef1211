//! Contract: what tasks and limits say about velocities equals finite differences of what they are about, for joints and
//! for the base. A step of the base moves its frame; what stands on the floor moves the other way in it.

use super::super::camera_task::{Watch, watch_error};
use super::super::columns::Columns;
use super::super::facing_task::bearing;
use super::super::manipulability::manipulability;
use super::super::{obstacle_limit, self_collision_limit};
use super::{PerfectArm, porter};
use crate::model::{Configuration, Obstacle, Other, PairDistance, RobotModel};
use dsm::Pose;
use nalgebra::{Isometry3, Point3, Vector3};

/// A robot a little on: joints moved and the base driven, by `by` along one variable.
fn stepped(model: &RobotModel, columns: &Columns, from: &Configuration, k: usize, by: f64) -> (Configuration, Pose) {
    let mut configuration = from.clone();
    let mut before_from_after = Pose::identity();
    match columns.find_base() {
        Some(base) if k == base => before_from_after = Pose::translation(by, 0.0, 0.0),
        Some(base) if k == base + 1 => before_from_after = Isometry3::rotation(Vector3::z() * by),
        _ => {
            let variable = model.arm.variables[k];
            configuration.set(variable, from.value(variable) + by);
        }
    }
    (configuration, before_from_after)
}

fn bent(model: &RobotModel, posture: &str) -> Configuration {
    let mut configuration = PerfectArm::at(model, posture).configuration;
    for (k, variable) in model.arm.variables.iter().enumerate() {
        configuration.set(*variable, configuration.value(*variable) + 0.11 * k as f64 - 0.2);
    }
    configuration
}

#[test]
fn the_jacobian_equals_finite_differences_of_the_pose() {
    let model = porter();
    let columns = Columns::new(&model.kinematics, &model.arm, true);
    let configuration = bent(&model, "ready_front");
    let poses = model.kinematics.root_from_links(&configuration);
    let tool = poses.get(model.tool);
    let point = Point3::from(tool.translation.vector);
    let jacobian = columns.jacobian(&model.kinematics, &poses, model.tool, &point);
    for k in 0..columns.len() {
        let at = |by: f64| {
            let (other, driven) = stepped(&model, &columns, &configuration, k, by);
            driven * model.kinematics.root_from_link(&other, model.tool)
        };
        let (less, more) = (at(-1e-6), at(1e-6));
        let linear = (more.translation.vector - less.translation.vector) / 2e-6;
        let angular = (more.rotation * less.rotation.inverse()).scaled_axis() / 2e-6;
        assert!((jacobian.fixed_view::<3, 1>(0, k) - linear).norm() < 1e-6, "{k}");
        assert!((jacobian.fixed_view::<3, 1>(3, k) - angular).norm() < 1e-6, "{k}");
    }
}

#[test]
fn the_manipulability_gradient_equals_finite_differences() {
    let model = porter();
    let configuration = bent(&model, "ready_front");
    let chain = model.kinematics.joints_to(model.tool);
    let place = |name: &str| chain.iter().position(|j| *model.kinematics.joints[*j].name == *name);
    let rank: Vec<usize> = model.arm.joints.iter().map(|name| place(name).expect("in chain")).collect();
    let at = |configuration: &Configuration| {
        let poses = model.kinematics.root_from_links(configuration);
        let point = Point3::from(poses.get(model.tool).translation.vector);
        manipulability(&model.kinematics.jacobian(&poses, model.tool, &point, &model.arm), &rank)
    };
    let (_, gradient) = at(&configuration);
    let columns = Columns::new(&model.kinematics, &model.arm, false);
    for k in 0..columns.len() {
        let moved = |by: f64| at(&stepped(&model, &columns, &configuration, k, by).0).0;
        let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
        assert!((gradient[k] - difference).abs() < 1e-7, "{k}: {} {difference}", gradient[k]);
    }
}

#[test]
fn the_camera_error_changes_as_its_rates_say_for_a_camera_on_the_arm_and_one_on_the_base() {
    let model = porter();
    let columns = Columns::new(&model.kinematics, &model.arm, true);
    let configuration = bent(&model, "ready_front");
    let point_in_base = Point3::new(1.1, 0.4, 0.7);
    for camera in ["head", "wrist"] {
        let (_, camera) = model.find_camera(camera).expect("porter has it");
        let at = |configuration: &Configuration, driven: &Pose| {
            let poses = model.kinematics.root_from_links(configuration);
            let watch = Watch { camera, point_in_base: driven.inverse() * point_in_base };
            let (error, rates) = watch_error(&columns, (&model.kinematics, &poses), &watch);
            (driven * error, rates)
        };
        let (_, rates) = at(&configuration, &Pose::identity());
        for k in 0..columns.len() {
            let moved = |by: f64| {
                let (other, driven) = stepped(&model, &columns, &configuration, k, by);
                at(&other, &driven).0
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((rates.fixed_view::<3, 1>(0, k) - difference).norm() < 1e-6, "{k}: {rates} {difference}");
        }
        assert!(rates.amax() > 0.3, "a camera that nothing turns would pass");
    }
}

#[test]
fn the_bearing_of_the_goal_changes_as_its_rates_say() {
    for goal in [Point3::new(1.0, 0.7, 0.3), Point3::new(-0.8, -0.4, 1.0), Point3::new(0.1, 2.0, 0.0)] {
        let (_, rates) = bearing(&goal);
        for (k, rate) in rates.iter().enumerate() {
            let after = |by: f64| {
                let driven = match k {
                    0 => Pose::translation(by, 0.0, 0.0),
                    _ => Isometry3::rotation(Vector3::z() * by),
                };
                bearing(&(driven.inverse() * goal)).0
            };
            let difference = (after(1e-6) - after(-1e-6)) / 2e-6;
            assert!((rate - difference).abs() < 1e-6, "{goal} {k}: {rate} {difference}");
        }
    }
}

#[test]
fn rows_of_obstacles_and_links_equal_finite_differences_of_the_distance() {
    let model = porter();
    let columns = Columns::new(&model.kinematics, &model.arm, true);
    let arm = PerfectArm::at(&model, "ready_down");
    let poses = model.kinematics.root_from_links(&arm.configuration);
    let tool = arm.base_from_tool().translation.vector;
    let obstacles = [
        Obstacle::still_ball(Point3::from(tool + Vector3::new(0.07, 0.05, -0.1)), 0.03),
        Obstacle::still_ball(Point3::from(tool + Vector3::new(-0.1, 0.15, 0.2)), 0.03),
    ];
    let distances = |configuration: &Configuration, driven: &Pose| {
        let poses = model.kinematics.root_from_links(configuration);
        let moved: Vec<Obstacle> = obstacles.iter().map(|o| o.seen_from(&driven.inverse())).collect();
        let mut pairs = model.collision.self_distances(&poses, 0.6);
        pairs.extend(model.collision.obstacle_distances(&poses, &moved, &model.arm_links(), 0.6));
        pairs
    };
    let tree = (&model.kinematics, &poses);
    let coefficients = |pair: &PairDistance| match pair.other {
        Other::Link(_) => self_collision_limit::closing_coefficients(&columns, tree, pair).expect("a pair"),
        Other::Obstacle(_) => obstacle_limit::closing_coefficients(&columns, tree, &Pose::identity(), pair),
    };
    let pairs = distances(&arm.configuration, &Pose::identity());
    let (mut checked, mut astray) = ((0, 0), 0);
    for (index, pair) in pairs.iter().enumerate() {
        let coefficients = coefficients(pair);
        for k in 0..columns.len() {
            let moved = |by: f64| {
                let (other, driven) = stepped(&model, &columns, &arm.configuration, k, by);
                (distances(&other, &driven), driven)
            };
            let ((before, driven_back), (after, driven_on)) = (moved(-1e-3), moved(1e-3));
            if before.len() != pairs.len() || after.len() != pairs.len() {
                continue;
            }
            // Where faces are parallel the closest points jump and the distance has no gradient.
            let (before, after) = (&before[index], &after[index]);
            if (driven_back * before.point_on_link - driven_on * after.point_on_link).norm() > 0.02 {
                continue;
            }
            let difference = (after.distance_m - before.distance_m) / 2e-3;
            // Single-precision closest points on curved faces are good to about a degree.
            let agrees = (coefficients[k] + difference).abs() < 0.02;
            match pair.other {
                Other::Link(_) => {
                    checked.0 += 1;
                    astray += usize::from(!agrees);
                }
                Other::Obstacle(_) => {
                    checked.1 += 1;
                    assert!(agrees, "{pair:?} {k}: {} {difference}", coefficients[k]);
                }
            }
        }
    }
    // Between parallel faces any point is a closest point, and turning about another one than that found looks like
    // approach.
    assert!(astray * 20 < checked.0, "{astray} of {checked:?}");
    assert!(checked.0 > 50 && checked.1 > 50, "{checked:?}");
}
