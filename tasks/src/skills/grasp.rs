//! Grasping: choose a place, drive there, look again, reach, look with the wrist camera, close, lift, verify twice.

use super::approach::{Approach, Ground, come_to, find_approach_around, find_approaches};
use super::arm::{ArmOutcome, STUCK_AFTER, ToolMove, move_tool, move_tool_around};
use super::hold::{between_fingers, close};
use super::lift::{Way, lift};
use super::meaning::Meaning;
use super::obstacles::find_obstacles;
use super::target::Target;
use super::wrist::{center_with_wrist, look_back_m, look_pose};
use crate::agent::{Agent, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::map::{Map, ObjectId};
use dsm::time::Span;
use dsm_robot::control::{IkRequest, find_ik};
use dsm_robot::grasp::{
    ApproachFrom, GraspCandidate, GraspConfig, GraspScene, HandConfig, PlacementConfig, find_placements, plan_grasps,
};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::collision::Obstacle;
use dsm_robot::model::{Configuration, RobotModel};
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2, Sight, Visibility};
use nalgebra::{Point2, Point3, Translation3};

/// Parameters of the grasp skill.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSettings {
    /// Grasp planning.
    pub planner: GraspConfig,
    /// Choice of the base's place.
    pub placement: PlacementConfig,
    /// Attempts before the skill gives up. Default 4.
    pub max_attempts: usize,
    /// Grip force, newtons. Default 36, for a hand that has 40.
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
            grip_force_n: 36.0,
            free_speed_m_per_s: 0.3,
            approach_speed_m_per_s: 0.09,
            step_speed_m_per_s: 0.2,
            min_width_m: 0.008,
        }
    }
}

impl GraspSettings {
    /// The defaults with the hand of a robot.
    pub fn for_robot(model: &RobotModel) -> Self {
        let gripper = &model.settings.gripper;
        let defaults = Self::default();
        let planner = GraspConfig { hand: HandConfig::from_settings(gripper), ..defaults.planner };
        Self { planner, grip_force_n: GRIP_SHARE * gripper.max_force_n, ..defaults }
    }
}

/// Share of the greatest grip force that holds things: most of it, because what is held off its middle turns between the
/// fingers when their friction gives way.
const GRIP_SHARE: f64 = 0.9;

/// The posture path that unfolds the arm, and the postures from which reach is searched.
pub(super) const UNFOLD: &str = "carry_to_ready_down";
const READY: [&str; 2] = ["ready_down", "ready_front"];

/// The fingers go in so often from one place, and close when they come this near to where they were to be, metres: what
/// holds them up twice does so again.
const SHORT_M: [f64; 2] = [0.012, 0.024];

/// Over what stands lower than this the arm reaches, metres.
const ARM_OVER_M: f64 = 1.3;

/// Why a grasp is not even tried.
pub(super) const NO_PLACE: &str = "no place from which the object can be reached";

/// A grasp with joints that reach it, in the frame of a standing base.
struct Reach {
    grasp: GraspCandidate,
    joints: JointPositions,
}

/// One grasp, as it is asked for.
pub(super) struct GraspTask<'a> {
    pub(super) nav: &'a NavConfig,
    pub(super) settings: &'a GraspSettings,
    pub(super) target: &'a Target,
    /// What the words that led to it mean; what stands there is held against them from near.
    pub(super) meaning: Option<&'a Meaning>,
}

pub(super) type Attempt = Result<String, (Stage, String)>;

/// Tries once, from the `attempt`-th best place. `slipped_z_m` remembers at which heights the thing slipped.
pub(super) fn try_grasp(
    agent: &mut Agent,
    task: &GraspTask<'_>,
    attempt: usize,
    slipped_z_m: &mut Vec<f64>,
) -> Result<Attempt, Halt> {
    let &GraspTask { nav, settings, target, meaning } = task;
    // Where to stand.
    let id = target.id();
    let Some(bounds) = target.in_map(agent.map()).find_object(id).map(|o| o.bounds) else {
        return Ok(Err((Stage::Mapping, format!("object {} left the map", id.0))));
    };
    let approaches = choose_approaches(agent, nav, settings, target, attempt + 1)?;
    let Some(approach) = approaches.get(attempt.min(approaches.len().saturating_sub(1))).cloned() else {
        return Ok(Err((Stage::Planning, NO_PLACE.into())));
    };
    // The arm keeps off the object until it reaches for it.
    let obstacles = |agent: &mut Agent| {
        let world_from_base = agent.world_from_base()?;
        Ok(find_obstacles(&target.in_map(agent.map()), Some(&agent.live), &world_from_base, None))
    };
    let step_m_per_s = settings.step_speed_m_per_s;
    if let Err(failure) = come_to(agent, nav, &approach, "object", &bounds.center, step_m_per_s, obstacles)? {
        return Ok(Err(failure));
    }
    // Look again from here.
    agent.await_light()?;
    agent.rest(Span::from_s(1.2))?;
    let now_s = agent.now().as_s();
    let picture = agent.find_frame("head").map(|seen| seen.frame.clone());
    agent.journal.note(now_s, "before the object", picture.as_ref());
    // Choose a grasp for where the base really stands.
    let (reach, support_z_m) = match choose_grasp(agent, settings, target, slipped_z_m)? {
        Ok(chosen) => chosen,
        Err(failure) => return Ok(Err(failure)),
    };
    let world_from_base = agent.world_from_base()?;
    let base_from_world = world_from_base.inverse();
    agent.grip(reach.grasp.opening_m, 10.0);
    let obstacles = find_obstacles(&target.in_map(agent.map()), Some(&agent.live), &world_from_base, Some(id));
    let back_m = look_back_m(agent.model(), &reach.grasp, settings);
    let free = ToolMove {
        goal: base_from_world * look_pose(&reach.grasp, settings, back_m),
        obstacles: &obstacles,
        touching: &[],
        speed_m_per_s: settings.free_speed_m_per_s,
        posture: Some(&reach.joints),
        give_up_after: STUCK_AFTER,
        gentle: false,
        clearance_m: None,
    };
    let at = reach.grasp.world_from_tool.translation;
    agent.log(format!(
        "to the pregrasp of {:?} (score {:.2}) at ({:.3}, {:.3}, {:.3}), {:.0} mm wide, support at {support_z_m:.3}",
        reach.grasp.approach,
        reach.grasp.score,
        at.x,
        at.y,
        at.z,
        1e3 * reach.grasp.width_m
    ));
    // The place to look from lies behind the pregrasp, for which the reach was checked: near it is good enough.
    if let ArmOutcome::Stuck { error_m, error_rad } = move_tool_around(agent, &free, (back_m, 0.2))?
        && (error_m > back_m || error_rad > 0.2)
    {
        return Ok(Err((Stage::Reach, format!("stuck {error_m:.3} m, {error_rad:.2} rad before the pregrasp"))));
    }
    // Look with the wrist camera, then go in. All in the base frame: the base stands, and localisation may wander.
    let mut grasp = match center_with_wrist(
        agent,
        settings,
        &reach.grasp,
        &reach.joints,
        (&world_from_base, support_z_m),
        &obstacles,
    )? {
        Ok(grasp) => grasp,
        Err(failure) => return Ok(Err(failure)),
    };
    // The arm hides it from the head by now.
    if let Some(reason) = meaning.map_or(Ok(None), |meaning| meaning.find_contradiction(agent, id))? {
        return Ok(Err((Stage::Grounding, reason)));
    }
    let fingers = finger_links(agent.model());
    for (entry, short_m) in SHORT_M.into_iter().enumerate() {
        agent.grip(grasp.opening_m, 10.0);
        let goals = [grasp.world_from_pregrasp(&settings.planner), grasp.world_from_tool];
        let mut stuck = None;
        for goal in goals {
            let slow = ToolMove {
                goal: base_from_world * goal,
                obstacles: &obstacles,
                touching: &fingers,
                speed_m_per_s: settings.approach_speed_m_per_s,
                posture: Some(&reach.joints),
                give_up_after: STUCK_AFTER,
                gentle: true,
                clearance_m: Some(settings.planner.clearance_m),
            };
            if let ArmOutcome::Stuck { error_m, error_rad } = move_tool(agent, &slow)?
                && (error_m > short_m || error_rad > 0.15)
            {
                stuck = Some((Stage::Reach, format!("stuck {error_m:.3} m, {error_rad:.2} rad before the grasp")));
                break;
            }
        }
        let Some(failure) = stuck else { break };
        if entry + 1 == SHORT_M.len() {
            return Ok(Err(failure));
        }
        // The fingers stand on something: up again, wider, and another look.
        agent.note(failure.1);
        agent.grip(settings.planner.hand.max_aperture_m, 10.0);
        let up = ToolMove {
            goal: base_from_world * grasp.world_from_pregrasp(&settings.planner),
            obstacles: &[],
            touching: &fingers,
            speed_m_per_s: settings.approach_speed_m_per_s,
            posture: Some(&reach.joints),
            give_up_after: STUCK_AFTER,
            gentle: true,
            clearance_m: None,
        };
        move_tool(agent, &up)?;
        grasp = match center_with_wrist(
            agent,
            settings,
            &grasp,
            &reach.joints,
            (&world_from_base, support_z_m),
            &obstacles,
        )? {
            Ok(grasp) => GraspCandidate { opening_m: settings.planner.hand.max_aperture_m, ..grasp },
            Err(failure) => return Ok(Err(failure)),
        };
    }
    let base_from_grasp = base_from_world * grasp.world_from_tool;
    // Close and lift.
    let width_m = close(agent, settings)?;
    if width_m < settings.min_width_m {
        slipped_z_m.push(grasp.world_from_tool.translation.z);
        return Ok(Err((Stage::Grasp, format!("the fingers closed to {:.0} mm: nothing between them", 1e3 * width_m))));
    }
    let aperture_m = settings.planner.hand.max_aperture_m;
    let before =
        between_fingers(&points_of(&target.in_map(agent.map()), id), &grasp.world_from_tool, support_z_m, aperture_m);
    agent.mark("lifts");
    let way = Way { base_from_grasp: &base_from_grasp, joints: &reach.joints, obstacles: &obstacles };
    let verified = lift(agent, task, &way, &before)?;
    if matches!(verified, Err((Stage::Hold, _))) {
        slipped_z_m.push(grasp.world_from_tool.translation.z);
    }
    Ok(verified.map(|lifted| format!("lifted; {:.0} mm between the fingers", 1e3 * lifted.width_m)))
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
    target: &Target,
    wanted: usize,
) -> Result<Vec<Approach>, Halt> {
    let (id, map, model) = (target.id(), target.in_map(agent.map()), agent.model().clone());
    let start = Pose2::from_pose(&agent.world_from_base()?).position;
    let configuration = agent.configuration()?;
    let (nav, settings) = (nav.clone(), settings.clone());
    let (approaches, tried) = agent.plan(move || {
        let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
        let field = Field::from_start(&costmap, &start);
        let Some(scene) = GraspScene::from_map(&map, id, ApproachFrom::Anywhere) else {
            return (Vec::new(), "the object left the map".to_owned());
        };
        // From all sides: what can only be reached from afar needs the slanted ones among them.
        let planner = GraspConfig { max_candidates: 2 * settings.planner.max_candidates, ..settings.planner.clone() };
        let plan = plan_grasps(&scene, &planner, &|_| Some(1.0));
        let seeds = seeds(&model);
        let target = map.find_object(id).map(|object| object.bounds);
        let sight = target.map(|bounds| (Sight::among(&map, &costmap, &bounds), bounds));
        let reach = |world_from_base: &Pose, world_from_tool: &Pose| {
            // No arm reaches through a wall.
            let over = world_from_base * Point3::new(0.0, 0.0, ARM_OVER_M);
            let walled = |(sight, bounds): &(Sight<'_>, OrientedBox)| {
                sight.check(&over, &bounds.center, 0.5 * bounds.size.norm()) == Visibility::BehindWall
            };
            if sight.as_ref().is_some_and(walled) {
                return None;
            }
            let goal = world_from_base.inverse() * world_from_tool;
            find_reach(&model, &configuration, &seeds, &[], &goal, &settings.planner).map(|_| 1.0)
        };
        let places = find_placements(&plan.candidates, &costmap, &field, &reach, &settings.placement);
        let stands: Vec<Pose2> = places.into_iter().map(|place| place.base).collect();
        let ground =
            Ground { map: &map, model: &model, costmap: &costmap, field: &field, folded: &configuration, held: None };
        let approaches = find_approaches(&ground, &stands, 0.0, wanted);
        let around = || find_approach_around(&ground, &stands, 0.0);
        let approaches = if approaches.is_empty() { around().into_iter().collect() } else { approaches };
        let tried = format!(
            "{} grasps (dropped: {:?}), {} places that reach one, {} ways there",
            plan.candidates.len(),
            plan.rejected,
            stands.len(),
            approaches.len()
        );
        (approaches, tried)
    })?;
    agent.log(tried);
    Ok(approaches)
}

type Chosen = Result<(Reach, f64), (Stage, String)>;

/// Where a thing slipped out of the fingers it does so again: at heights nearer to that than this, metres.
const SAME_HOLD_M: f64 = 0.02;

/// The best grasp that the arm reaches from where the base stands, and the height of the support. Heights at which the
/// thing slipped come last.
fn choose_grasp(
    agent: &mut Agent,
    settings: &GraspSettings,
    target: &Target,
    slipped_z_m: &[f64],
) -> Result<Chosen, Halt> {
    let (id, map, model) = (target.id(), target.in_map(agent.map()), agent.model().clone());
    let world_from_base = agent.world_from_base()?;
    let configuration = agent.configuration()?;
    let (settings, slipped_z_m, live) = (settings.clone(), slipped_z_m.to_vec(), agent.live.clone());
    agent.plan(move || {
        let from = ApproachFrom::Base(Point2::from(world_from_base.translation.vector.xy()));
        let Some(scene) = GraspScene::from_map(&map, id, from) else {
            return Err((Stage::Mapping, "the object left the map".to_owned()));
        };
        let obstacles = find_obstacles(&map, Some(&live), &world_from_base, Some(id));
        let seeds = seeds(&model);
        let base_from_world = world_from_base.inverse();
        let reach = |world_from_tool: &Pose| {
            let goal = base_from_world * world_from_tool;
            find_reach(&model, &configuration, &seeds, &obstacles, &goal, &settings.planner)
        };
        let plan = plan_grasps(&scene, &settings.planner, &|pose| reach(pose).map(|_| 1.0));
        let slips = |grasp: &&GraspCandidate| {
            slipped_z_m.iter().any(|z_m| (grasp.world_from_tool.translation.z - z_m).abs() < SAME_HOLD_M)
        };
        let (others, slippery): (Vec<_>, Vec<_>) = plan.candidates.iter().partition(|grasp| !slips(grasp));
        let chosen = others
            .into_iter()
            .chain(slippery)
            .find_map(|grasp| Some(Reach { joints: reach(&grasp.world_from_tool)?, grasp: grasp.clone() }));
        chosen
            .map(|reach| (reach, scene.support_z_m))
            .ok_or_else(|| (Stage::Reach, format!("no grasp from here; proposals dropped: {:?}", plan.rejected)))
    })
}
