//! How to fold the arm around what the hand holds: the posture that keeps the robot narrowest without the load touching it.

use super::approach::configured;
use super::grasp::UNFOLD;
use dsm_robot::joints::JointPositions;
use dsm_robot::model::{Configuration, RobotModel};
use nalgebra::{Point3, Vector3};

/// Distance between the robot's own parts, load included, in the posture and on the way to it, metres.
const APART_M: f64 = 0.012;
/// Samples of the way.
const SAMPLES: usize = 12;
/// How the folded posture is varied: offsets of each joint of the arm group in their order (lift first), metres and
/// radians. Joints that are not listed keep the fold's value.
const LIFT_M: [f64; 4] = [0.0, 0.12, 0.24, 0.34];
const SHOULDER_RAD: [f64; 4] = [0.0, -0.25, -0.5, -0.8];
const ELBOW_RAD: [f64; 4] = [0.0, -0.25, -0.5, -0.8];
const WRIST_RAD: [f64; 8] = [0.0, -0.4, -0.8, -1.3, -1.9, -2.4, -2.9, 0.5];
const ROLL_RAD: [f64; 3] = [0.0, 1.57, -1.57];
/// Offsets of the first joint: the fold as the robot's file has it, and for bulky loads one that is turned to a side.
const TURN_RAD: [&[f64]; 2] = [&[0.0], &[-0.9, -0.6, -0.3, 0.3]];
/// Order of the joints in the arm group that are varied.
const VARIED: [usize; 6] = [0, 1, 2, 4, 6, 7];
/// A deviation from the fold must make the robot narrower by this, metres per unit.
const DEVIATION_COST_M: f64 = 0.01;
/// Metres of radius for each metre of the lever with which the load's weight turns it between the pads: what has turned is
/// put down aslant and falls over.
const LEVER_COST: f64 = 1.0;

/// The postures that lead from the unfolded arm to one that carries what `model` holds; `None` when every variant touches
/// something. The first and second posture of the robot's unfolding path are the fold and the way out of it.
/// `balance_in_tool` is the centre of mass of what is held.
pub(super) fn find_carry(
    model: &RobotModel,
    configuration: &Configuration,
    balance_in_tool: &Point3<f64>,
) -> Option<Vec<JointPositions>> {
    let path = model.settings.paths.get(UNFOLD)?;
    let fold = model.find_posture(path.first()?)?;
    let side = model.find_posture(path.get(1)?)?;
    let outside = configured(model, configuration, &side);
    let folded = configured(model, configuration, &fold);
    let found = TURN_RAD.iter().find_map(|turns| find_variant(model, &folded, &outside, turns, balance_in_tool))?;
    let values = model.arm.values_of(&found);
    let carry = JointPositions::from_values(&model.arm.joints, values)?;
    Some(vec![side, carry])
}

/// The narrowest variant of the fold with one of the `turns` of the first joint that touches nothing on the way from
/// `outside`.
fn find_variant(
    model: &RobotModel,
    folded: &Configuration,
    outside: &Configuration,
    turns: &[f64],
    balance_in_tool: &Point3<f64>,
) -> Option<Configuration> {
    let start = model.arm.values_of(folded);
    let mut variants: Vec<(f64, Configuration)> = Vec::new();
    for turn in turns {
        for lift in LIFT_M {
            for shoulder in SHOULDER_RAD {
                for elbow in ELBOW_RAD {
                    for wrist in WRIST_RAD {
                        for roll in ROLL_RAD {
                            let offsets = [lift, *turn, shoulder, elbow, wrist, roll];
                            let Some(values) = varied(model, &start, &offsets) else { continue };
                            let mut variant = folded.clone();
                            variant.apply_group(&model.arm, &values);
                            let deviation: f64 = offsets.iter().map(|offset| offset.abs()).sum();
                            let cost = model.radius_m(&variant)
                                + DEVIATION_COST_M * deviation
                                + LEVER_COST * lever_m(model, &variant, balance_in_tool);
                            variants.push((cost, variant));
                        }
                    }
                }
            }
        }
    }
    variants.sort_by(|a, b| a.0.total_cmp(&b.0));
    let found = variants.into_iter().find(|(_, v)| is_free(model, v) && is_way_free(model, outside, v))?;
    Some(found.1)
}

/// Distance of the load's centre of mass from the vertical plane through the axis between the pads, metres.
fn lever_m(model: &RobotModel, configuration: &Configuration, balance_in_tool: &Point3<f64>) -> f64 {
    let base_from_tool = model.kinematics.root_from_link(configuration, model.tool).rotation;
    (base_from_tool * balance_in_tool.coords).cross(&Vector3::z()).dot(&(base_from_tool * Vector3::y())).abs()
}

fn varied(model: &RobotModel, start: &[f64], offsets: &[f64; 6]) -> Option<Vec<f64>> {
    let mut values = start.to_vec();
    for (joint, offset) in VARIED.iter().zip(offsets) {
        let (value, limits) = (values.get_mut(*joint)?, model.arm.limits.get(*joint)?);
        *value += offset;
        if !(limits.lower..=limits.upper).contains(value) {
            return None;
        }
    }
    Some(values)
}

fn is_free(model: &RobotModel, configuration: &Configuration) -> bool {
    let poses = model.kinematics.root_from_links(configuration);
    model.collision.self_distances(&poses, APART_M).is_empty()
}

fn is_way_free(model: &RobotModel, from: &Configuration, to: &Configuration) -> bool {
    let (a, b) = (model.arm.values_of(from), model.arm.values_of(to));
    (1..SAMPLES).all(|i| {
        let share = i as f64 / SAMPLES as f64;
        let between: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + (b - a) * share).collect();
        let mut configuration = from.clone();
        configuration.apply_group(&model.arm, &between);
        is_free(model, &configuration)
    })
}

#[cfg(test)]
mod tests {
    //! Contract: an empty hand folds as the robot's file says; with a load the fold keeps clear of it and the robot stays
    //! narrow enough for a door.
    use super::*;
    use dsm::geometry::OrientedBox;
    use nalgebra::UnitQuaternion;
    use std::path::Path;

    #[test]
    fn folds_around_a_load() {
        let model = RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter")).unwrap();
        let ready = configured(&model, &model.kinematics.zero(), &model.find_posture("ready_down").unwrap());
        let empty = find_carry(&model, &ready, &Point3::origin()).expect("an empty hand folds");
        let fold = model.arm.values_of(&configured(&model, &ready, &model.find_posture("carry").unwrap()));
        assert!(empty[1].values().iter().zip(&fold).all(|(a, b)| (a - b).abs() < 1e-9));
        for (size, sunk_m) in [(Vector3::new(0.1, 0.1, 0.1), 0.03), (Vector3::new(0.07, 0.07, 0.25), 0.08)] {
            let held =
                OrientedBox { center: Point3::new(0.0, 0.0, sunk_m), size, rotation: UnitQuaternion::identity() };
            let holding = model.holding(&held);
            let ready = holding.with_gripper_width(ready.clone(), size.y);
            let carried = find_carry(&holding, &ready, &held.center).expect("a load is carried");
            let configuration = configured(&holding, &ready, &carried[1]);
            assert!(is_free(&holding, &configuration));
            let radius_m = holding.radius_m(&configuration);
            assert!(radius_m < 0.36, "{size:?}: {radius_m:.3} m");
        }
    }

    #[test]
    fn a_cereal_box_is_carried() {
        let model = RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter")).unwrap();
        let ready = configured(&model, &model.kinematics.zero(), &model.find_posture("ready_down").unwrap());
        // Held at its upper end, from above: its long side along the tool's x, its height along the approach.
        let size = Vector3::new(0.21, 0.066, 0.29);
        let held = OrientedBox { center: Point3::new(0.0, 0.0, 0.06), size, rotation: UnitQuaternion::identity() };
        let holding = model.holding(&held);
        let ready = holding.with_gripper_width(ready, size.y);
        let carried = find_carry(&holding, &ready, &held.center).expect("it is carried");
        let configuration = configured(&holding, &ready, &carried[1]);
        assert!(is_free(&holding, &configuration), "{:.3} m", holding.radius_m(&configuration));
    }
}
