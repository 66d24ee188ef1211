//! Grasping: choose a place, drive there, look again, reach, look with the wrist camera, close, lift, verify twice.

use super::Outcome;
use super::approach::{Approach, find_approaches};
use super::arm::{ArmOutcome, ToolMove, fold, move_through, move_tool};
use super::drive::{Drive, DriveOutcome};
use super::obstacles::find_obstacles;
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::map::{CellState, Map, ObjectId};
use dsm::time::Span;
use dsm_robot::control::{IkRequest, find_ik};
use dsm_robot::drivers::Twist;
use dsm_robot::grasp::{
    ApproachFrom, GraspCandidate, GraspConfig, GraspScene, PlacementConfig, Refinement, find_placements, plan_grasps,
    refine_grasp,
};
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::collision::Obstacle;
use dsm_robot::model::{Configuration, RobotModel};
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2};
use nalgebra::{Point2, Point3, Translation3};
use std::sync::Arc;

/// Parameters of the grasp skill.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSettings {
    /// Grasp planning.
    pub planner: GraspConfig,
    /// Choice of the base's place.
    pub placement: PlacementConfig,
    /// Attempts before the skill gives up. Default 4.
    pub max_attempts: usize,
    /// Grip force, newtons. Default 25.
    pub grip_force_n: f64,
    /// Speed of free motions of the tool, metres per second. Default 0.3.
    pub free_speed_m_per_s: f64,
    /// Speed of the approach and of the lift, metres per second. Default 0.1.
    pub approach_speed_m_per_s: f64,
    /// Speed of the base with the arm unfolded, metres per second. Default 0.2.
    pub step_speed_m_per_s: f64,
    /// Narrower than this the hand holds nothing, metres. Default 0.008.
    pub min_width_m: f64,
}

impl Default for GraspSettings {
    fn default() -> Self {
        Self {
            planner: GraspConfig::default(),
            placement: PlacementConfig::default(),
            max_attempts: 4,
            grip_force_n: 25.0,
            free_speed_m_per_s: 0.3,
            approach_speed_m_per_s: 0.1,
            step_speed_m_per_s: 0.2,
            min_width_m: 0.008,
        }
    }
}

/// The posture path that unfolds the arm, and the postures from which reach is searched.
pub(super) const UNFOLD: &str = "carry_to_ready_down";
const READY: [&str; 2] = ["ready_down", "ready_front"];

/// Why a grasp is not even tried.
const NO_PLACE: &str = "no place from which the object can be reached";

/// A grasp with joints that reach it, in the frame of a standing base.
struct Reach {
    grasp: GraspCandidate,
    joints: JointPositions,
}

/// Drives to an object and lifts it.
pub fn grasp(agent: &mut Agent, nav: &NavConfig, settings: &GraspSettings, id: ObjectId) -> Result<Outcome, Halt> {
    let mut last = (Stage::Planning, "no attempt was made".to_owned());
    for attempt in 0..settings.max_attempts {
        let result = try_grasp(agent, nav, settings, id, attempt)?;
        let now_s = agent.now().as_s();
        match result {
            Ok(reason) => return Ok(Outcome::Done(reason)),
            Err((stage, reason)) => {
                let picture = agent.find_frame("head").map(|seen| seen.frame.clone());
                agent.journal.note(
                    now_s,
                    format!("grasp attempt {attempt} failed ({stage:?}): {reason}"),
                    picture.as_ref(),
                );
                last = (stage, reason);
                if stage == Stage::Planning && last.1 == NO_PLACE {
                    // Nothing has moved, and asking again gives the same answer.
                    break;
                }
                retreat(agent)?;
            }
        }
    }
    Ok(Outcome::Failed(last.0, format!("{} attempts; the last: {}", settings.max_attempts, last.1)))
}

type Attempt = Result<String, (Stage, String)>;

fn try_grasp(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    id: ObjectId,
    attempt: usize,
) -> Result<Attempt, Halt> {
    // Where to stand.
    let Some(bounds) = agent.map().find_object(id).map(|o| o.bounds) else {
        return Ok(Err((Stage::Mapping, format!("object {} left the map", id.0))));
    };
    let approaches = choose_approaches(agent, nav, settings, id, attempt + 1)?;
    let Some(approach) = approaches.get(attempt.min(approaches.len().saturating_sub(1))).cloned() else {
        return Ok(Err((Stage::Planning, NO_PLACE.into())));
    };
    agent.gaze = Gaze::AHEAD;
    let arrived = Drive::to_pose(nav, approach.unfold_at).run(agent)?;
    if arrived != DriveOutcome::Arrived {
        return Ok(Err((Stage::Planning, format!("the way to the object failed: {arrived:?}"))));
    }
    // Unfold a step back, with everything but the target in the way, and drive the last step with the arm ready.
    agent.gaze = Gaze::Point(bounds.center);
    let obstacles = obstacles_now(agent, id)?;
    if let ArmOutcome::Stuck { error_m, .. } = move_through(agent, &approach.postures, &obstacles)? {
        return Ok(Err((Stage::Reach, format!("the arm cannot unfold here; {error_m:.2} rad are left"))));
    }
    if approach.step_m() > 0.01 {
        let mut slow = nav.clone();
        slow.follower.max_speed_m_per_s = settings.step_speed_m_per_s;
        let arrived = Drive::to_pose(&slow, approach.stand).run(agent)?;
        if arrived != DriveOutcome::Arrived {
            return Ok(Err((Stage::Planning, format!("the last step to the object failed: {arrived:?}"))));
        }
    }
    // Look again from here.
    agent.rest(Span::from_s(1.2))?;
    let now_s = agent.now().as_s();
    let picture = agent.find_frame("head").map(|seen| seen.frame.clone());
    agent.journal.note(now_s, "before the object", picture.as_ref());
    // Choose a grasp for where the base really stands.
    let (reach, support_z_m) = match choose_grasp(agent, settings, id)? {
        Ok(chosen) => chosen,
        Err(failure) => return Ok(Err(failure)),
    };
    let world_from_base = agent.world_from_base()?;
    let base_from_world = world_from_base.inverse();
    agent.grip(reach.grasp.opening_m, 10.0);
    let obstacles = obstacles_now(agent, id)?;
    let pregrasp = base_from_world * reach.grasp.world_from_pregrasp(&settings.planner);
    let free = ToolMove {
        goal: pregrasp,
        obstacles: &obstacles,
        touching: &[],
        speed_m_per_s: settings.free_speed_m_per_s,
        posture: Some(&reach.joints),
    };
    agent.log(format!("to the pregrasp of {:?} (score {:.2})", reach.grasp.approach, reach.grasp.score));
    if let ArmOutcome::Stuck { error_m, error_rad } = move_tool(agent, &free)? {
        return Ok(Err((Stage::Reach, format!("stuck {error_m:.3} m, {error_rad:.2} rad before the pregrasp"))));
    }
    // Look with the wrist camera, then go in. All in the base frame: the base stands, and localisation may wander.
    let grasp = match look_with_wrist(agent, settings, &reach.grasp, &world_from_base, support_z_m)? {
        Ok(grasp) => grasp,
        Err(failure) => return Ok(Err(failure)),
    };
    let base_from_grasp = base_from_world * grasp.world_from_tool;
    let fingers = finger_links(agent.model());
    let goals = [base_from_world * grasp.world_from_pregrasp(&settings.planner), base_from_grasp];
    for goal in goals {
        let slow = ToolMove {
            goal,
            obstacles: &obstacles,
            touching: &fingers,
            speed_m_per_s: settings.approach_speed_m_per_s,
            posture: Some(&reach.joints),
        };
        if let ArmOutcome::Stuck { error_m, error_rad } = move_tool(agent, &slow)?
            && (error_m > 0.012 || error_rad > 0.15)
        {
            return Ok(Err((Stage::Reach, format!("stuck {error_m:.3} m, {error_rad:.2} rad before the grasp"))));
        }
    }
    // Close and lift.
    let width_m = close(agent, settings)?;
    if width_m < settings.min_width_m {
        return Ok(Err((Stage::Grasp, format!("the fingers closed to {:.0} mm: nothing between them", 1e3 * width_m))));
    }
    let before = points_of(agent.map(), id);
    let up = ToolMove {
        goal: Translation3::new(0.0, 0.0, settings.planner.lift_m) * base_from_grasp,
        obstacles: &[],
        touching: &fingers,
        speed_m_per_s: settings.approach_speed_m_per_s,
        posture: Some(&reach.joints),
    };
    let lifted = move_tool(agent, &up)?;
    verify(agent, settings, &before, lifted)
}

/// Verified twice: by the width between the fingers, and by looking at where the object was.
fn verify(
    agent: &mut Agent,
    settings: &GraspSettings,
    before: &[Point3<f64>],
    lifted: ArmOutcome,
) -> Result<Attempt, Halt> {
    agent.rest(Span::from_s(0.8))?;
    let width_m = agent.grip_state()?.width_m;
    let now_s = agent.now().as_s();
    let picture = agent.find_frame("head").map(|seen| seen.frame.clone());
    agent.journal.note(now_s, format!("lifted; {:.0} mm between the fingers", 1e3 * width_m), picture.as_ref());
    if width_m < settings.min_width_m {
        return Ok(Err((Stage::Hold, "the object slipped out of the fingers".into())));
    }
    if let ArmOutcome::Stuck { error_m, .. } = lifted
        && error_m > 0.5 * settings.planner.lift_m
    {
        return Ok(Err((Stage::Hold, format!("the lift ended {error_m:.2} m too low"))));
    }
    let still_there = share_still_there(agent, before);
    if still_there > 0.5 {
        return Ok(Err((Stage::Grasp, format!("{:.0} % of the object is seen where it was", 100.0 * still_there))));
    }
    Ok(Ok(format!("lifted; {:.0} mm between the fingers", 1e3 * width_m)))
}

fn obstacles_now(agent: &mut Agent, id: ObjectId) -> Result<Vec<Obstacle>, Halt> {
    let world_from_base = agent.world_from_base()?;
    Ok(find_obstacles(agent.map(), &world_from_base, Some(id)))
}

pub(super) fn finger_links(model: &RobotModel) -> Vec<dsm_robot::model::LinkId> {
    let names = &model.settings.gripper.finger_links;
    names.iter().filter_map(|name| model.kinematics.find_link(name)).collect()
}

fn points_of(map: &Map, id: ObjectId) -> Vec<Point3<f64>> {
    map.find_object(id).map_or_else(Vec::new, |o| o.points.iter().map(|p| p.position.cast()).collect())
}

/// Postures from which inverse kinematics is searched.
pub(super) fn seeds(model: &RobotModel) -> Vec<JointPositions> {
    READY.iter().filter_map(|name| model.find_posture(name)).collect()
}

/// Joints for a tool pose and for its pregrasp; `None` when either is out of reach.
fn find_reach(
    model: &RobotModel,
    start: &Configuration,
    seeds: &[JointPositions],
    obstacles: &[Obstacle],
    base_from_tool: &Pose,
    planner: &GraspConfig,
) -> Option<JointPositions> {
    let request = IkRequest { seeds, obstacles: &[], restarts: 1, ..IkRequest::new(start) };
    let joints = find_ik(model, base_from_tool, &request)?;
    let near = [joints.clone()];
    let back = base_from_tool * Translation3::new(0.0, 0.0, -planner.pregrasp_m);
    let request = IkRequest { seeds: &near, obstacles, restarts: 0, ..IkRequest::new(start) };
    find_ik(model, &back, &request)?;
    Some(joints)
}

fn choose_approaches(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    id: ObjectId,
    wanted: usize,
) -> Result<Vec<Approach>, Halt> {
    let (map, model) = (agent.map().clone(), agent.model().clone());
    let start = Pose2::from_pose(&agent.world_from_base()?).position;
    let configuration = agent.configuration()?;
    let (nav, settings) = (nav.clone(), settings.clone());
    agent.plan(move || {
        let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
        let field = Field::from_start(&costmap, &start);
        let Some(scene) = GraspScene::from_map(&map, id, ApproachFrom::Anywhere) else { return Vec::new() };
        let plan = plan_grasps(&scene, &settings.planner, &|_| Some(1.0));
        let seeds = seeds(&model);
        let reach = |world_from_base: &Pose, world_from_tool: &Pose| {
            let goal = world_from_base.inverse() * world_from_tool;
            find_reach(&model, &configuration, &seeds, &[], &goal, &settings.planner).map(|_| 1.0)
        };
        let places = find_placements(&plan.candidates, &costmap, &field, &reach, &settings.placement);
        let stands: Vec<Pose2> = places.into_iter().map(|place| place.base).collect();
        find_approaches(&map, &model, &costmap, &field, &configuration, &stands, id, wanted)
    })
}

type Chosen = Result<(Reach, f64), (Stage, String)>;

/// The best grasp that the arm reaches from where the base stands, and the height of the support.
fn choose_grasp(agent: &mut Agent, settings: &GraspSettings, id: ObjectId) -> Result<Chosen, Halt> {
    let (map, model) = (agent.map().clone(), agent.model().clone());
    let world_from_base = agent.world_from_base()?;
    let configuration = agent.configuration()?;
    let settings = settings.clone();
    agent.plan(move || {
        let from = ApproachFrom::Base(Point2::from(world_from_base.translation.vector.xy()));
        let Some(scene) = GraspScene::from_map(&map, id, from) else {
            return Err((Stage::Mapping, "the object left the map".to_owned()));
        };
        let obstacles = find_obstacles(&map, &world_from_base, Some(id));
        let seeds = seeds(&model);
        let base_from_world = world_from_base.inverse();
        let reach = |world_from_tool: &Pose| {
            let goal = base_from_world * world_from_tool;
            find_reach(&model, &configuration, &seeds, &obstacles, &goal, &settings.planner)
        };
        let plan = plan_grasps(&scene, &settings.planner, &|pose| reach(pose).map(|_| 1.0));
        let chosen = plan
            .candidates
            .iter()
            .find_map(|grasp| Some(Reach { joints: reach(&grasp.world_from_tool)?, grasp: grasp.clone() }));
        chosen
            .map(|reach| (reach, scene.support_z_m))
            .ok_or_else(|| (Stage::Reach, format!("no grasp from here; proposals dropped: {:?}", plan.rejected)))
    })
}

/// Re-centres the grasp on what the wrist camera sees. `world_from_base` fixes the world of the grasp to the base.
fn look_with_wrist(
    agent: &mut Agent,
    settings: &GraspSettings,
    grasp: &GraspCandidate,
    world_from_base: &Pose,
    support_z_m: f64,
) -> Result<Result<GraspCandidate, (Stage, String)>, Halt> {
    agent.watched.push("wrist".into());
    agent.rest(Span::from_s(0.7))?;
    agent.watched.retain(|camera| camera != "wrist");
    let Some(seen) = agent.find_frame("wrist").cloned() else {
        return Ok(Err((Stage::Mapping, "the wrist camera gives no frame".into())));
    };
    let base_from_camera = seen.world_from_base.inverse() * seen.frame.world_from_camera;
    let world_from_camera = world_from_base * base_from_camera;
    let around = Point3::from(grasp.world_from_tool.translation.vector);
    let points: Vec<Point3<f64>> = (0..seen.frame.depth_m.len())
        .step_by(2)
        .filter_map(|pixel| Some(world_from_camera * seen.frame.find_point_in_camera(pixel)?))
        .filter(|p| (p - around).norm() < 0.25)
        .collect();
    let now_s = agent.now().as_s();
    let refinement = refine_grasp(grasp, &points, support_z_m, &settings.planner);
    let (said, result) = match refinement {
        Refinement::Refined { grasp, shift_m } => (format!("moves the grasp by {:.0} mm", 1e3 * shift_m), Ok(grasp)),
        Refinement::NotSeen => {
            ("does not see the object".into(), Err((Stage::Grasp, "the wrist camera does not see the object".into())))
        }
        Refinement::Moved { shift_m } => (
            "finds it elsewhere".to_owned(),
            Err((Stage::Grasp, format!("the object is {:.0} mm from where it was", 1e3 * shift_m))),
        ),
        Refinement::TooWide { width_m } => {
            ("finds it too wide".to_owned(), Err((Stage::Grasp, format!("the object is {:.0} mm wide", 1e3 * width_m))))
        }
    };
    agent.journal.note(now_s, format!("the wrist camera {said}"), Some(&seen.frame));
    Ok(result)
}

/// Closes the fingers until they stop; the width between them.
fn close(agent: &mut Agent, settings: &GraspSettings) -> Result<f64, Halt> {
    const LONGEST: Span = Span(3_000_000_000);
    const STILL_FOR: Span = Span(300_000_000);
    agent.grip(0.0, settings.grip_force_n);
    let still = JointVelocities::zeros(&agent.model().arm.joints);
    let begin = agent.now();
    let mut moved_at = begin;
    while agent.now() - begin < LONGEST {
        agent.tick(Twist::default(), &still)?;
        let now = agent.now();
        if agent.grip_state()?.moving || now - begin < STILL_FOR {
            moved_at = now;
        }
        if now - moved_at >= STILL_FOR {
            break;
        }
    }
    Ok(agent.grip_state()?.width_m)
}

/// The share of the object's points, as they were before the grasp, that the newest head frame still sees there.
fn share_still_there(agent: &Agent, before: &[Point3<f64>]) -> f64 {
    const SAME_M: f64 = 0.025;
    let Some(seen) = agent.find_frame("head") else { return 0.0 };
    let frame: &Arc<dsm::frame::RgbdFrame> = &seen.frame;
    let camera_from_world = frame.world_from_camera.inverse();
    let (mut there, mut visible) = (0_usize, 0_usize);
    for point in before {
        let p = camera_from_world * point;
        let Some((column, row)) = frame.model.find_pixel(&p) else { continue };
        let depth_m = f64::from(frame.depth_m[(row * frame.model.width + column) as usize]);
        // Something nearer hides the place: that says nothing.
        if depth_m <= 0.0 || depth_m < p.z - SAME_M {
            continue;
        }
        visible += 1;
        there += usize::from(depth_m < p.z + SAME_M);
    }
    // With almost nothing in view the width alone decides.
    if visible < 20 { 0.0 } else { there as f64 / visible as f64 }
}

/// Opens the hand, backs off with arm and base, and folds the arm, best effort.
pub(super) fn retreat(agent: &mut Agent) -> Result<(), Halt> {
    const BACK_M: f64 = 0.45;
    const SPEED_M_PER_S: f64 = 0.15;
    let opening_m = agent.model().settings.gripper.max_aperture_m;
    agent.grip(opening_m, 10.0);
    agent.rest(Span::from_s(0.6))?;
    let model = agent.model().clone();
    let configuration = agent.configuration()?;
    let base_from_tool = model.kinematics.root_from_link(&configuration, model.tool);
    let back = ToolMove {
        goal: Translation3::new(0.0, 0.0, 0.06) * base_from_tool * Translation3::new(0.0, 0.0, -0.08),
        obstacles: &[],
        touching: &[],
        speed_m_per_s: 0.15,
        posture: None,
    };
    move_tool(agent, &back)?;
    back_off(agent, BACK_M, SPEED_M_PER_S)?;
    let world_from_base = agent.world_from_base()?;
    let obstacles = find_obstacles(agent.map(), &world_from_base, None);
    fold(agent, UNFOLD, &obstacles)?;
    Ok(())
}

/// Drives straight back, as far as the map says that there is floor.
pub(super) fn back_off(agent: &mut Agent, distance_m: f64, speed_m_per_s: f64) -> Result<(), Halt> {
    let still = JointVelocities::zeros(&agent.model().arm.joints);
    let start = agent.odom_from_base()?;
    let radius_m = agent.model().settings.base.footprint_radius_m;
    let begin = agent.now();
    while (agent.now() - begin).as_s() < 1.5 * distance_m / speed_m_per_s {
        let gone_m = (agent.odom_from_base()?.translation.vector - start.translation.vector).norm();
        let world_from_base = agent.world_from_base()?;
        let behind = world_from_base * Point3::new(-radius_m - 0.08, 0.0, 0.0);
        let free = agent.map().free_space.state_at(&Point2::new(behind.x, behind.y)) == CellState::Free;
        if gone_m >= distance_m || !free {
            break;
        }
        // Braking in time: v <= sqrt(2 a d).
        let speed = speed_m_per_s.min((2.0 * 0.3 * (distance_m - gone_m)).sqrt()).max(0.03);
        agent.tick(Twist { forward_m_per_s: -speed, turn_rad_per_s: 0.0 }, &still)?;
    }
    agent.rest(Span::from_s(0.3))
}
