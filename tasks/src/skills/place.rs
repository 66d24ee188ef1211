//! Placing: drive to a free spot on a surface, lower what is held, open, retreat, and look.

use super::Outcome;
use super::approach::{Approach, Ground, come_to, find_approach_around, find_approaches, plan_on_ground};
use super::arm::{ArmOutcome, STUCK_AFTER, ToolMove, move_tool, move_tool_around};
use super::grasp::{GraspSettings, finger_links, seeds};
use super::held::{Held, carry, carrying, obstacles_but_held};
use super::navigate::navigate_to_object;
use super::retreat::retreat;
use super::seen::{find_put_down, look_from_aside};
use super::spots::{Spot, find_spots};
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::map::ObjectId;
use dsm::time::Span;
use dsm_robot::control::{IkRequest, find_ik};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::collision::Obstacle;
use dsm_robot::model::{Configuration, RobotModel};
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2, wrap_angle};
use nalgebra::{Point2, Point3, Translation3, UnitQuaternion, Vector3};

/// Attempts before the skill gives up, and those after which no spot means that there is none.
const MAX_ATTEMPTS: usize = 5;
const MAX_LOOKS: usize = 3;
/// Nothing has moved when there is no spot to go to.
const NO_SPOT: &str = "no free spot on the surface can be reached";
/// The load is let go this far above the surface, metres.
const LET_GO_ABOVE_M: f64 = 0.006;
/// The load comes from this far above its place, metres.
const ABOVE_M: f64 = 0.11;
/// The load comes to its spot this far above it, metres.
const OVER_M: f64 = 0.08;
/// Distances from a spot at which the base may stand, metres.
const STAND_M: [f64; 7] = [0.62, 0.56, 0.68, 0.5, 0.74, 0.8, 0.86];
/// Spots that are tested.
const MAX_SPOTS: usize = 24;
/// Directions around a spot in which standing places are looked for.
const DIRECTIONS: usize = 24;
/// Turns of the hand about the vertical that are tried, radians.
const TURNS_RAD: [f64; 7] = [0.0, 0.5, -0.5, 1.1, -1.1, 1.7, -1.7];

/// Puts what is held on an object of the map. The arm is folded.
pub fn place(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    held: &Held,
    surface: ObjectId,
) -> Result<Outcome, Halt> {
    let mut last = (Stage::Planning, "no attempt was made".to_owned());
    for attempt in 0..MAX_ATTEMPTS {
        match try_place(agent, nav, settings, held, surface, attempt)? {
            Ok(reason) => return Ok(Outcome::Done(reason)),
            Err((stage, reason)) => {
                agent.note(format!("place attempt {attempt} failed ({stage:?}): {reason}"));
                let nowhere = reason == NO_SPOT;
                last = (stage, reason);
                if agent.held().is_some() && agent.grip_state()?.width_m < settings.min_width_m {
                    agent.hold(None);
                    last = (Stage::Hold, "the object slipped out of the fingers on the way".into());
                }
                if agent.held().is_none() || nowhere && attempt + 1 >= MAX_LOOKS {
                    break;
                }
                if nowhere {
                    // A look from near, and less room, may show a spot.
                    navigate_to_object(agent, nav, surface, None)?;
                    continue;
                }
                raise(agent, settings, held, ABOVE_M)?;
                if let Outcome::Failed(stage, reason) = carry(agent, held, settings)? {
                    last = (stage, reason);
                    break;
                }
            }
        }
    }
    Ok(Outcome::Failed(last.0, last.1))
}

/// Lifts the load off what it may stand among by some metres, best effort: backing off would drag it.
pub fn raise(agent: &mut Agent, settings: &GraspSettings, held: &Held, by_m: f64) -> Result<(), Halt> {
    let world_from_base = agent.world_from_base()?;
    let obstacles = obstacles_but_held(agent, &world_from_base, held)?;
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let base_from_tool = model.kinematics.root_from_link(&configuration, model.tool);
    let mut touching = finger_links(&model);
    touching.push(model.tool);
    let up = ToolMove {
        goal: Translation3::new(0.0, 0.0, by_m) * base_from_tool,
        obstacles: &obstacles,
        touching: &touching,
        speed_m_per_s: settings.approach_speed_m_per_s,
        posture: None,
        give_up_after: STUCK_AFTER,
        gentle: false,
        clearance_m: None,
    };
    move_tool(agent, &up)?;
    Ok(())
}

type Attempt = Result<String, (Stage, String)>;

/// Share of the usual room around a spot that an attempt asks for: on a small surface that carries something already
/// there is no more than the object itself needs.
fn spare(attempt: usize) -> f64 {
    [1.0, 0.55, 0.25].get(attempt).copied().unwrap_or(0.25)
}

fn try_place(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    held: &Held,
    surface: ObjectId,
    attempt: usize,
) -> Result<Attempt, Halt> {
    // Where to stand, and which spot that is for.
    let map = agent.map().clone();
    let spots = find_spots(&map, surface, Some(held.id), &held.load, spare(attempt));
    let goals: Vec<Point2<f64>> = apart(spots, 0.1, MAX_SPOTS).iter().map(|spot| spot.point.xy()).collect();
    let nav = &carrying(agent, nav, &goals)?;
    let choices = choose_stands(agent, nav, held, surface, spare(attempt))?;
    let Some((spot, approach)) = choices.get(attempt.min(choices.len().saturating_sub(1))).cloned() else {
        return Ok(Err((Stage::Planning, NO_SPOT.into())));
    };
    let at = spot.point;
    agent.note(format!("a free spot at ({:.2}, {:.2}, {:.2})", at.x, at.y, at.z));
    let obstacles = |agent: &mut Agent| {
        let world_from_base = agent.world_from_base()?;
        obstacles_but_held(agent, &world_from_base, held)
    };
    if let Err(failure) = come_to(agent, nav, &approach, "surface", &at, settings.step_speed_m_per_s, obstacles)? {
        return Ok(Err(failure));
    }
    // Look again from here, and choose the spot for where the base really stands.
    agent.rest(Span::from_s(1.2))?;
    agent.note("before the surface");
    let Some((spot, base_from_tool, joints)) = choose_spot(agent, held, surface, &at, spare(attempt))? else {
        return Ok(Err((Stage::Reach, "no free spot is within reach from here".into())));
    };
    // Over the spot, down, open.
    let world_from_base = agent.world_from_base()?;
    let obstacles = obstacles_but_held(agent, &world_from_base, held)?;
    let fingers = finger_links(agent.model());
    // The load stands in the tool's frame, and is to touch the surface.
    let mut lowering = fingers.clone();
    lowering.push(agent.model().tool);
    let above = Translation3::new(0.0, 0.0, ABOVE_M) * base_from_tool;
    let ways = [
        (above, &fingers, settings.free_speed_m_per_s, 0.04),
        (base_from_tool, &lowering, settings.approach_speed_m_per_s, 0.02),
    ];
    for (goal, touching, speed_m_per_s, tolerance_m) in ways {
        let way = ToolMove {
            goal,
            obstacles: &obstacles,
            touching,
            speed_m_per_s,
            posture: Some(&joints),
            give_up_after: STUCK_AFTER,
            gentle: true,
            clearance_m: None,
        };
        if let ArmOutcome::Stuck { error_m, error_rad } = move_tool_around(agent, &way, (tolerance_m, 0.2))?
            && (error_m > tolerance_m || error_rad > 0.2)
        {
            return Ok(Err((Stage::Reach, format!("stuck {error_m:.3} m, {error_rad:.2} rad before the spot"))));
        }
    }
    if agent.grip_state()?.width_m < settings.min_width_m {
        agent.hold(None);
        return Ok(Err((Stage::Hold, "the object slipped out of the fingers on the way".into())));
    }
    // The fingers open no wider than the room that was asked for beside the object.
    let beside_m = spare(attempt) * settings.planner.opening_margin_m;
    let opening_m = (held.width_m + beside_m).min(agent.model().settings.gripper.max_aperture_m);
    // What the surface carries before, to tell the load from it if it rolls or falls over.
    let before = agent.map().clone();
    agent.grip(opening_m, 10.0);
    agent.rest(Span::from_s(1.0))?;
    agent.note("let go");
    let back = ToolMove {
        goal: base_from_tool * Translation3::new(0.0, 0.0, -ABOVE_M),
        obstacles: &obstacles,
        touching: &lowering,
        speed_m_per_s: settings.approach_speed_m_per_s,
        posture: None,
        give_up_after: STUCK_AFTER,
        gentle: false,
        clearance_m: None,
    };
    move_tool(agent, &back)?;
    agent.hold(None);
    retreat(agent)?;
    // Verify by looking.
    agent.gaze = Gaze::Point(spot.point + Vector3::new(0.0, 0.0, 0.5 * held.load.height_m));
    agent.rest(Span::from_s(1.5))?;
    agent.note("looks at what was put down");
    if let Some(reason) = find_put_down(agent, &before, surface, &spot, held) {
        return Ok(Ok(reason));
    }
    // The surface, or what stands on it, may hide it from here.
    if look_from_aside(agent, nav, &spot, held)?
        && let Some(reason) = find_put_down(agent, &before, surface, &spot, held)
    {
        return Ok(Ok(reason));
    }
    Ok(Err((Stage::Place, "it is not seen where it was put, from two sides".into())))
}

/// The tool's pose in the base frame for putting the load on a spot, with the hand turned about the vertical.
fn base_from_tool_on(world_from_base: &Pose, spot: &Spot, held: &Held, turn_rad: f64) -> Pose {
    let at = world_from_base.inverse_transform_point(&spot.point);
    let height_m = held.tool_above_bottom_m + LET_GO_ABOVE_M;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn_rad);
    Pose::from_parts(Translation3::new(at.x, at.y, at.z + height_m), turn * held.base_from_tool)
}

/// Turns of the hand about the vertical that put the load on a spot as it must lie there, for a base with this yaw.
fn turns_on(spot: &Spot, held: &Held, base_yaw_rad: f64) -> Vec<f64> {
    let Some(yaw_rad) = spot.yaw_rad else { return TURNS_RAD.to_vec() };
    // Turned around, a box lies as before.
    let turn_rad = wrap_angle(yaw_rad - base_yaw_rad - held.base_from_side_rad);
    let around_rad = wrap_angle(turn_rad + std::f64::consts::PI);
    let (near, far) = if turn_rad.abs() <= around_rad.abs() { (turn_rad, around_rad) } else { (around_rad, turn_rad) };
    vec![near, far]
}

/// Joints that put the load on a spot from above; `None` out of reach.
fn find_reach(
    model: &RobotModel,
    start: &Configuration,
    obstacles: &[Obstacle],
    base_from_tool: &Pose,
) -> Option<JointPositions> {
    let seeds = seeds(model);
    let request = IkRequest { seeds: &seeds, restarts: 1, ..IkRequest::new(start) };
    let joints = find_ik(model, base_from_tool, &request)?;
    let near = [joints.clone()];
    let above = Translation3::new(0.0, 0.0, ABOVE_M) * base_from_tool;
    let request = IkRequest { seeds: &near, obstacles, restarts: 0, ..IkRequest::new(start) };
    find_ik(model, &above, &request)?;
    Some(joints)
}

/// Spots apart from each other, those with most room first.
fn apart(spots: Vec<Spot>, spacing_m: f64, most: usize) -> Vec<Spot> {
    let mut kept: Vec<Spot> = Vec::new();
    for spot in spots {
        if kept.len() < most && kept.iter().all(|other| (other.point - spot.point).norm() >= spacing_m) {
            kept.push(spot);
        }
    }
    kept
}

fn choose_stands(
    agent: &mut Agent,
    nav: &NavConfig,
    held: &Held,
    surface: ObjectId,
    spare: f64,
) -> Result<Vec<(Spot, Approach)>, Halt> {
    const MAX_STANDS: usize = 6;
    /// Spots for which ways around things are planned: a search each.
    const MAX_AROUND: usize = 4;
    let held = held.clone();
    plan_on_ground(agent, nav, Some(held.id), move |ground| {
        let &Ground { map, model, costmap, field, folded, .. } = ground;
        let spots = apart(find_spots(map, surface, Some(held.id), &held.load, spare), 0.1, MAX_SPOTS);
        let (spot_count, mut stand_count, mut reach_count, mut way_count) = (spots.len(), 0, 0, 0);
        let mut found = Vec::new();
        let mut reached = Vec::new();
        // The load passes over the spot and what is as high as itself.
        let over = |spot: &Spot| spot.point.z + held.tool_above_bottom_m + OVER_M;
        for spot in spots {
            let reaches = |stand: &Pose2| {
                let world_from_base = stand.to_pose();
                turns_on(&spot, &held, stand.yaw_rad).into_iter().any(|turn| {
                    let goal = base_from_tool_on(&world_from_base, &spot, &held, turn);
                    find_reach(model, folded, &[], &goal).is_some()
                })
            };
            let stands = stands_around(costmap, field, &spot.point.xy());
            stand_count += stands.len();
            let stands: Vec<Pose2> = stands.into_iter().take(MAX_STANDS).filter(reaches).collect();
            reach_count += stands.len();
            let over_m = over(&spot);
            let approaches = find_approaches(ground, &stands, over_m, 1);
            reached.push((spot, stands));
            way_count += approaches.len();
            found.extend(approaches.into_iter().map(|approach| (spot, approach)));
            if found.len() >= MAX_ATTEMPTS {
                break;
            }
        }
        if found.is_empty() {
            let around = |(spot, stands): (Spot, Vec<Pose2>)| {
                let way = find_approach_around(ground, &stands, over(&spot))?;
                Some((spot, way))
            };
            found
                .extend(reached.into_iter().filter(|(_, stands)| !stands.is_empty()).take(MAX_AROUND).find_map(around));
        }
        tracing::debug!(
            "{spot_count} spots, {stand_count} places around them, {reach_count} of the tested reach, {way_count} ways, {} kept",
            found.len()
        );
        found
    })
}

/// Standing places around a spot, cheapest first.
pub(super) fn stands_around(costmap: &Costmap, field: &Field, spot: &Point2<f64>) -> Vec<Pose2> {
    let mut stands: Vec<(f64, Pose2)> = Vec::new();
    for distance_m in STAND_M {
        for i in 0..DIRECTIONS {
            let angle = i as f64 * std::f64::consts::TAU / DIRECTIONS as f64;
            let position = spot + distance_m * nalgebra::Vector2::new(angle.cos(), angle.sin());
            let Some(length_m) = field.find_length_to_m(&position) else { continue };
            if costmap.is_traversable_at(&position) {
                let cost = length_m + 4.0 * (distance_m - STAND_M[0]).abs();
                stands.push((cost, Pose2::facing(position, spot)));
            }
        }
    }
    stands.sort_by(|a, b| a.0.total_cmp(&b.0));
    stands.into_iter().map(|(_, stand)| stand).collect()
}

/// The spot for where the base stands: near the one that was planned, with joints that reach it.
fn choose_spot(
    agent: &mut Agent,
    held: &Held,
    surface: ObjectId,
    planned: &Point3<f64>,
    spare: f64,
) -> Result<Option<(Spot, Pose, JointPositions)>, Halt> {
    const NEAR_M: f64 = 0.3;
    const MAX_SPOTS: usize = 30;
    let world_from_base = agent.world_from_base()?;
    let obstacles = obstacles_but_held(agent, &world_from_base, held)?;
    let (map, model) = (agent.map().clone(), agent.model().clone());
    let configuration = agent.configuration()?;
    let (held, planned) = (held.clone(), *planned);
    agent.plan(move || {
        let mut spots = find_spots(&map, surface, Some(held.id), &held.load, spare);
        spots.retain(|spot| (spot.point - planned).norm() < NEAR_M);
        let yaw_rad = Pose2::from_pose(&world_from_base).yaw_rad;
        // Room counts, and so does being where the base was sent for.
        let worth = |spot: &Spot| spot.clearance_m - 0.5 * (spot.point - planned).norm();
        spots.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
        apart(spots, 0.05, MAX_SPOTS).into_iter().find_map(|spot| {
            turns_on(&spot, &held, yaw_rad).into_iter().find_map(|turn| {
                let goal = base_from_tool_on(&world_from_base, &spot, &held, turn);
                Some((spot, goal, find_reach(&model, &configuration, &obstacles, &goal)?))
            })
        })
    })
}
