//! Where to unfold the arm before a grasp: the sweep from the fold to the ready posture takes room that a place before a
//! shelf does not have, so the arm unfolds a step back and the base drives the last step with the arm ready.

use super::arm::{ArmOutcome, NEAR_ENOUGH_RAD, move_joints_around, move_through};
use super::drive::{Drive, DriveOutcome, step_to};
use super::obstacles::find_obstacles;
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::map::{Map, ObjectId};
use dsm_robot::control::{IkRequest, PathRequest, find_ik, find_joint_path};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::collision::Obstacle;
use dsm_robot::model::{Configuration, RobotModel};
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2};
use nalgebra::{Point2, Point3, Translation3, Vector2};

/// Steps back that are tried, metres.
const BACK_M: [f64; 7] = [0.0, 0.25, 0.4, 0.55, 0.7, 0.9, 1.1];
/// Heights of the lift that are tried for the last step, as shares of its range.
const LIFT_SHARES: [f64; 3] = [0.45, 0.75, 1.0];
/// Where the hand is held when things on a high surface leave no room for it at the ready posture with the lift raised:
/// forward and up from there, metres.
const RAISED_M: [(f64, f64); 4] = [(0.0, 0.12), (-0.06, 0.2), (-0.1, 0.3), (-0.16, 0.3)];
/// Distance that the arm keeps from obstacles in the plan, metres.
const MARGIN_M: f64 = 0.03;
/// Samples of each motion.
const SAMPLES: usize = 8;

/// A place to grasp from and the way to get there with the arm ready.
#[derive(Clone, Debug, PartialEq)]
pub struct Approach {
    /// Where the arm unfolds.
    pub unfold_at: Pose2,
    /// Where the grasp begins.
    pub stand: Pose2,
    /// Postures of the arm on the way from the fold to ready, in order.
    pub postures: Vec<JointPositions>,
}

impl Approach {
    /// Length of the last step, metres.
    pub fn step_m(&self) -> f64 {
        (self.stand.position - self.unfold_at.position).norm()
    }
}

/// Drives to where the arm unfolds, unfolds it with its eyes on `look_at` (world frame), and drives the last step slowly.
/// `what` names the goal in the reasons of failure; `obstacles` says what is in the arm's way where it unfolds.
pub(super) fn come_to(
    agent: &mut Agent,
    nav: &NavConfig,
    approach: &Approach,
    what: &str,
    look_at: &Point3<f64>,
    step_speed_m_per_s: f64,
    obstacles: impl FnOnce(&mut Agent) -> Result<Vec<Obstacle>, Halt>,
) -> Result<Result<(), (Stage, String)>, Halt> {
    agent.gaze = Gaze::AHEAD;
    agent.mark(format!("approaches the {what}"));
    let arrived = Drive::to_pose(nav, approach.unfold_at).run(agent)?;
    if arrived != DriveOutcome::Arrived {
        return Ok(Err((Stage::Planning, format!("the way to the {what} failed: {arrived:?}"))));
    }
    agent.gaze = Gaze::Point(*look_at);
    let obstacles = obstacles(agent)?;
    let mut unfolded = move_through(agent, &approach.postures, &obstacles)?;
    if let (ArmOutcome::Stuck { .. }, Some(ready)) = (unfolded, approach.postures.last()) {
        // The postures on the way were made for an empty hand.
        unfolded = move_joints_around(agent, ready, &obstacles)?;
    }
    if let ArmOutcome::Stuck { error_m, .. } = unfolded
        && error_m > NEAR_ENOUGH_RAD
    {
        return Ok(Err((Stage::Reach, format!("the arm cannot unfold here; {error_m:.2} rad are left"))));
    }
    if approach.step_m() > 0.01 {
        let arrived = step_to(agent, nav, &approach.stand, step_speed_m_per_s)?;
        if arrived != DriveOutcome::Arrived {
            return Ok(Err((Stage::Planning, format!("the last step to the {what} failed: {arrived:?}"))));
        }
    }
    Ok(Ok(()))
}

/// What the plan of an approach reads.
pub struct Ground<'a> {
    /// What stands where.
    pub map: &'a Map,
    /// The robot.
    pub model: &'a RobotModel,
    /// Where the base may drive.
    pub costmap: &'a Costmap,
    /// Ways from where the base is.
    pub field: &'a Field,
    /// The robot as it drives.
    pub folded: &'a Configuration,
    /// What is held is no obstacle; a target that is yet to be grasped is one.
    pub held: Option<ObjectId>,
}

/// Plans from where the robot stands, with its posture and map of now, beside the loop. `held` as in [`Ground`].
pub fn plan_on_ground<T: Send + 'static>(
    agent: &mut Agent,
    nav: &NavConfig,
    held: Option<ObjectId>,
    plan: impl FnOnce(&Ground<'_>) -> T + Send + 'static,
) -> Result<T, Halt> {
    let (map, nav, model) = (agent.map().clone(), nav.clone(), agent.model().clone());
    let start = Pose2::from_pose(&agent.world_from_base()?).position;
    let folded = agent.configuration()?;
    agent.plan(move || {
        let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
        let field = Field::from_start(&costmap, &start);
        plan(&Ground { map: &map, model: &model, costmap: &costmap, field: &field, folded: &folded, held })
    })
}

/// Finds how to come to the first `wanted` of the `stands` that have room for it with the arm ready, and with the tool at
/// least at `tool_z_m` above the floor.
pub fn find_approaches(ground: &Ground<'_>, stands: &[Pose2], tool_z_m: f64, wanted: usize) -> Vec<Approach> {
    let &Ground { model, folded, .. } = ground;
    let unfoldings = find_unfoldings(model, folded);
    let mut unfoldings: Vec<_> =
        unfoldings.into_iter().filter_map(|postures| raised_to(model, folded, postures, tool_z_m)).collect();
    if unfoldings.is_empty() {
        unfoldings.extend(raised_by_arm(model, folded, tool_z_m));
    }
    let way = |stand: &Pose2| find_approach(ground, &unfoldings, stand);
    stands.iter().filter_map(way).take(wanted).collect()
}

/// As [`find_approaches`], for the first of a few stands, with a way of the arm that is planned around what stands there:
/// between a bed and a wall the arm does not sweep out to its side.
pub fn find_approach_around(ground: &Ground<'_>, stands: &[Pose2], tool_z_m: f64) -> Option<Approach> {
    /// Each failure costs the whole search.
    const MAX_STANDS: usize = 3;
    const BACK_M: [f64; 3] = [0.0, 0.25, 0.4];
    const MAX_NODES: usize = 600;
    let &Ground { map, model, costmap, field, folded, held } = ground;
    let mut ends: Vec<Vec<JointPositions>> = LIFT_SHARES
        .iter()
        .rev()
        .filter_map(|&share| raised_to(model, folded, unfolding(model, share)?, tool_z_m))
        .collect();
    if ends.is_empty() {
        ends.extend(raised_by_arm(model, folded, tool_z_m));
    }
    stands.iter().take(MAX_STANDS).find_map(|stand| {
        let near_stand = find_obstacles(map, None, &stand.to_pose(), held);
        BACK_M.iter().find_map(|&back_m| {
            let unfold_at = step_back(costmap, field, stand, back_m)?;
            let near_unfold = find_obstacles(map, None, &unfold_at.to_pose(), held);
            ends.iter().find_map(|postures| {
                let ready = configured(model, folded, postures.last()?);
                if !is_step_free(model, &ready, &near_stand, back_m) {
                    return None;
                }
                let goal = JointPositions::from_values(&model.arm.joints, model.arm.values_of(&ready))?;
                let request = PathRequest {
                    obstacles: &near_unfold,
                    margin_m: MARGIN_M,
                    max_nodes: MAX_NODES,
                    ..PathRequest::new(folded)
                };
                let postures = find_joint_path(model, &goal, &request)?;
                Some(Approach { unfold_at, stand: *stand, postures })
            })
        })
    })
}

/// Where the base stands before its last step straight to the stand; `None` where it cannot.
fn step_back(costmap: &Costmap, field: &Field, stand: &Pose2, back_m: f64) -> Option<Pose2> {
    let ahead = Vector2::new(stand.yaw_rad.cos(), stand.yaw_rad.sin());
    let position: Point2<f64> = stand.position - ahead * back_m;
    let is_way = costmap.is_traversable_at(&position)
        && costmap.find_segment_cost(&position, &stand.position).is_some()
        && field.find_length_to_m(&position).is_some();
    is_way.then_some(Pose2 { position, yaw_rad: stand.yaw_rad })
}

/// Whether the last step is free with the arm ready: the obstacles seen from the stand are moved by what is left of the way.
fn is_step_free(model: &RobotModel, ready: &Configuration, near_stand: &[Obstacle], back_m: f64) -> bool {
    (0..=SAMPLES).all(|i| {
        let left_m = back_m * (1.0 - i as f64 / SAMPLES as f64);
        !collides(model, ready, &shifted(near_stand, left_m))
    })
}

fn find_approach(ground: &Ground<'_>, unfoldings: &[Vec<JointPositions>], stand: &Pose2) -> Option<Approach> {
    let &Ground { map, model, costmap, field, folded, held } = ground;
    let near_stand = find_obstacles(map, None, &stand.to_pose(), held);
    for back_m in BACK_M {
        let Some(unfold_at) = step_back(costmap, field, stand, back_m) else { continue };
        let near_unfold = find_obstacles(map, None, &unfold_at.to_pose(), held);
        for postures in unfoldings {
            if !is_free_along(model, folded, postures, &near_unfold) {
                continue;
            }
            let ready = configured(model, folded, postures.last()?);
            if is_step_free(model, &ready, &near_stand, back_m) {
                return Some(Approach { unfold_at, stand: *stand, postures: postures.clone() });
            }
        }
    }
    None
}

/// Ways to unfold: to ready at several heights of the lift, then with the hand above that.
fn find_unfoldings(model: &RobotModel, folded: &Configuration) -> Vec<Vec<JointPositions>> {
    let mut all: Vec<Vec<JointPositions>> = LIFT_SHARES.iter().filter_map(|&share| unfolding(model, share)).collect();
    let Some(highest) = all.last().cloned() else { return all };
    let Some(last) = highest.last() else { return all };
    let ready = configured(model, folded, last);
    let base_from_tool = model.kinematics.root_from_link(&ready, model.tool);
    for (forward_m, up_m) in RAISED_M {
        let goal = Translation3::new(forward_m, 0.0, up_m) * base_from_tool;
        let request = IkRequest { restarts: 0, ..IkRequest::new(&ready) };
        let Some(joints) = find_ik(model, &goal, &request) else { continue };
        // Along the way nothing but the robot itself is checked here; obstacles are where it unfolds.
        if find_joint_path(model, &joints, &PathRequest::new(&ready)).is_some_and(|path| path.len() == 1) {
            all.push(highest.iter().cloned().chain([joints]).collect());
        }
    }
    all
}

/// The postures with the lift high enough in the last one that the tool is at `tool_z_m`; `None` beyond the lift's travel.
fn raised_to(
    model: &RobotModel,
    folded: &Configuration,
    mut postures: Vec<JointPositions>,
    tool_z_m: f64,
) -> Option<Vec<JointPositions>> {
    let last = postures.last_mut()?;
    let ready = configured(model, folded, last);
    let missing_m = tool_z_m - model.kinematics.root_from_link(&ready, model.tool).translation.z;
    if missing_m > 0.0 {
        let (lift, limits) = (model.arm.joints.first()?, model.arm.limits.first()?);
        let index = last.names().iter().position(|name| name == lift)?;
        let raised = last.values()[index] + missing_m;
        if raised > limits.upper {
            return None;
        }
        last.values_mut()[index] = raised;
    }
    Some(postures)
}

/// The postures to ready with the lift up, and one with the hand above that at `tool_z_m`: what the lift cannot do the arm
/// does, nearer to the base.
fn raised_by_arm(model: &RobotModel, folded: &Configuration, tool_z_m: f64) -> Option<Vec<JointPositions>> {
    const FORWARD_M: [f64; 5] = [0.0, -0.06, -0.12, -0.18, 0.08];
    let mut postures = unfolding(model, 1.0)?;
    let ready = configured(model, folded, postures.last()?);
    let base_from_tool = model.kinematics.root_from_link(&ready, model.tool);
    let up_m = (tool_z_m - base_from_tool.translation.z).max(0.0);
    let raised = FORWARD_M.iter().find_map(|&forward_m| {
        let goal = Translation3::new(forward_m, 0.0, up_m) * base_from_tool;
        let joints = find_ik(model, &goal, &IkRequest { restarts: 2, ..IkRequest::new(&ready) })?;
        find_joint_path(model, &joints, &PathRequest::new(&ready)).filter(|path| path.len() <= 2)
    })?;
    postures.extend(raised);
    Some(postures)
}

/// The postures from the fold to ready, with the lift at a share of its range in the last one.
fn unfolding(model: &RobotModel, lift_share: f64) -> Option<Vec<JointPositions>> {
    let path = model.settings.paths.get(super::grasp::UNFOLD)?;
    let mut postures: Vec<JointPositions> = path.iter().filter_map(|name| model.find_posture(name)).collect();
    // The lift is the first joint of the arm group.
    let (lift, limits) = (model.arm.joints.first()?, model.arm.limits.first()?);
    let last = postures.pop()?;
    let mut names: Vec<_> = last.names().iter().filter(|name| *name != lift).cloned().collect();
    let mut values: Vec<f64> = names.iter().filter_map(|name| last.find(name)).collect();
    names.push(lift.clone());
    values.push(limits.lower + lift_share * (limits.upper - limits.lower));
    postures.push(JointPositions::from_values(&names.into(), values)?);
    Some(postures)
}

/// The configuration with the arm in a posture; fingers and head stay as they are.
pub(super) fn configured(model: &RobotModel, from: &Configuration, posture: &JointPositions) -> Configuration {
    let mut configuration = from.clone();
    configuration.apply(posture);
    let arm = model.arm.values_of(&configuration);
    let mut only_arm = from.clone();
    only_arm.apply_group(&model.arm, &arm);
    only_arm
}

fn is_free_along(
    model: &RobotModel,
    folded: &Configuration,
    postures: &[JointPositions],
    obstacles: &[Obstacle],
) -> bool {
    let mut from = folded.clone();
    for posture in postures {
        let to = configured(model, &from, posture);
        let (a, b) = (model.arm.values_of(&from), model.arm.values_of(&to));
        for i in 1..=SAMPLES {
            let share = i as f64 / SAMPLES as f64;
            let between: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + (b - a) * share).collect();
            let mut configuration = from.clone();
            configuration.apply_group(&model.arm, &between);
            if collides(model, &configuration, obstacles) {
                return false;
            }
        }
        from = to;
    }
    true
}

fn collides(model: &RobotModel, configuration: &Configuration, obstacles: &[Obstacle]) -> bool {
    let poses = model.kinematics.root_from_links(configuration);
    !model.collision.obstacle_distances(&poses, obstacles, &model.arm_links(), MARGIN_M).is_empty()
}

/// Obstacles as a base sees them that still has `left_m` to go straight ahead.
fn shifted(obstacles: &[Obstacle], left_m: f64) -> Vec<Obstacle> {
    let shift = dsm::Pose::translation(left_m, 0.0, 0.0);
    obstacles.iter().map(|obstacle| obstacle.seen_from(&shift)).collect()
}

#[cfg(test)]
mod tests {
    //! Contract: the hand arrives at least as high as was asked; where the arm cannot sweep out to its side, between a bed
    //! and a wall, a way over the bed is planned.
    use super::super::target::tests::{map_of, object};
    use super::*;
    use dsm::map::CellState;
    use dsm_robot::nav::CostmapConfig;
    use std::path::Path;

    /// Floor with a wall to the left of an aisle along x, and a bed to its right.
    fn aisle() -> Map {
        let top = (-60..60).flat_map(|x| (0..25).map(move |y| [0.03 * x as f32, -0.4 - 0.03 * y as f32, 0.55]));
        let side = (-60..60).flat_map(|x| (0..18).map(move |z| [0.03 * x as f32, -0.4, 0.03 * z as f32]));
        let points: Vec<[f32; 3]> = top.chain(side).collect();
        let mut map = Map::clone(&map_of(vec![object(1, [0.0, -0.76, 0.275], [3.6, 0.72, 0.55], &points)]));
        for (x, y) in (-60..60).flat_map(|x| (-30..30).map(move |y| (x, y))) {
            let state = if !(-8..=7).contains(&y) { CellState::Occupied } else { CellState::Free };
            map.free_space.set([x, y], state);
        }
        map
    }

    #[test]
    fn the_arm_unfolds_over_the_bed_and_as_high_as_asked() {
        let model = RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter")).unwrap();
        let folded = configured(&model, &model.kinematics.zero(), &model.find_posture("carry").unwrap());
        let stands = [Pose2 { position: Point2::new(0.0, 0.0), yaw_rad: 0.0 }];
        let ways = |map: &Map, tool_z_m: f64| {
            let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
            let field = Field::from_start(&costmap, &stands[0].position);
            let ground = Ground { map, model: &model, costmap: &costmap, field: &field, folded: &folded, held: None };
            let swept = find_approaches(&ground, &stands, tool_z_m, 1);
            (swept, find_approach_around(&ground, &stands, tool_z_m))
        };
        let (swept, around) = ways(&aisle(), 0.0);
        assert_eq!(swept, Vec::new(), "the arm would sweep through the wall");
        assert!(around.is_some_and(|way| way.postures.len() > 1));
        let mut open = aisle();
        open.objects.clear();
        (-60..60).for_each(|x| (-30..30).for_each(|y| open.free_space.set([x, y], CellState::Free)));
        for tool_z_m in [0.0, 0.6, 1.0, 1.22] {
            let (swept, _) = ways(&open, tool_z_m);
            let ready = configured(&model, &folded, swept[0].postures.last().unwrap());
            let z_m = model.kinematics.root_from_link(&ready, model.tool).translation.z;
            assert!(z_m > tool_z_m - 0.01, "{z_m} for {tool_z_m}");
        }
        assert_eq!(ways(&open, 2.0).0, Vec::new());
    }
}
