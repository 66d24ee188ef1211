//! Lifting what the fingers hold: up, out from under what is above it, on when it slipped; each verified.

use super::arm::{ArmOutcome, STUCK_AFTER, ToolMove, move_tool};
use super::grasp::{GraspTask, finger_links};
use super::hold::{Lifted, verify};
use super::obstacles::find_obstacles;
use super::retreat::back_off;
use crate::agent::{Agent, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm_robot::joints::JointPositions;
use dsm_robot::model::collision::Obstacle;
use nalgebra::{Point3, Translation3, Vector2, Vector3};

/// What slips is held again after a part of the lift: so much higher is a thing that slipped unseen, metres.
const HIDDEN_LIFT_M: f64 = 0.08;
/// Error of the lower end of what hangs in the hand, metres.
const SAG_ERROR_M: f64 = 0.03;
/// A lift that ends by more than this too low is not done, metres.
const LIFT_LEFT_M: f64 = 0.03;
/// How far out to the front the hand goes where it cannot go up, metres.
const OUT_M: f64 = 0.25;
/// How far the base backs off with what is held when that does not help, and its speed.
const BACK_M: f64 = 0.3;
const BACK_M_PER_S: f64 = 0.06;

/// Where a lift begins.
pub(super) struct Way<'a> {
    /// The tool as it closed, base frame.
    pub(super) base_from_grasp: &'a Pose,
    /// Joints to prefer.
    pub(super) joints: &'a JointPositions,
    /// What the arm keeps off, base frame.
    pub(super) obstacles: &'a [Obstacle],
}

/// Lifts, and verifies that the thing came along. `before` are its points as they were.
pub(super) fn lift(
    agent: &mut Agent,
    task: &GraspTask<'_>,
    way: &Way<'_>,
    before: &[Point3<f64>],
) -> Result<Result<Lifted, (Stage, String)>, Halt> {
    let settings = task.settings;
    let lifted = go_up(agent, task, way)?;
    let lifted = back_off_if_short(agent, task, way.joints, lifted)?;
    let mut verified = verify(agent, settings, before, lifted)?;
    if let Ok(Lifted { sagged_m: None, .. }) = verified {
        // The arm hides whether it slipped: as high as if it had.
        agent.log("the arm hides where it was: lifts on");
        raise_by(agent, task, way.joints, HIDDEN_LIFT_M)?;
        verified = verify(agent, settings, before, lifted)?;
    }
    let Ok(Lifted { sagged_m: Some(sagged_m), .. }) = verified else { return Ok(verified) };
    if sagged_m <= 0.0 {
        return Ok(verified);
    }
    agent.note(format!("it slipped by {:.0} mm in the hand: lifts on", 1e3 * sagged_m));
    let raised = raise_by(agent, task, way.joints, sagged_m + SAG_ERROR_M)?;
    let raised = back_off_if_short(agent, task, way.joints, raised)?;
    Ok(match verify(agent, settings, before, raised)? {
        Ok(Lifted { sagged_m: Some(left_m), .. }) if left_m > 0.0 => {
            Err((Stage::Hold, format!("it still hangs {:.0} mm too low", 1e3 * left_m)))
        }
        verified => verified,
    })
}

/// Goes up; where something is above the arm, out to the front first: on a shelf there is no room to lift.
fn go_up(agent: &mut Agent, task: &GraspTask<'_>, way: &Way<'_>) -> Result<ArmOutcome, Halt> {
    let lift_m = task.settings.planner.lift_m;
    let fingers = finger_links(agent.model());
    let to = |goal: Pose| ToolMove {
        goal,
        obstacles: way.obstacles,
        touching: &fingers,
        speed_m_per_s: task.settings.approach_speed_m_per_s,
        posture: Some(way.joints),
        give_up_after: STUCK_AFTER,
        gentle: false,
        clearance_m: None,
    };
    let lifted = move_tool(agent, &to(Translation3::new(0.0, 0.0, lift_m) * way.base_from_grasp))?;
    let ArmOutcome::Stuck { error_m, .. } = lifted else { return Ok(lifted) };
    if error_m < LIFT_LEFT_M {
        return Ok(lifted);
    }
    agent.log(format!("{error_m:.2} m short of the lift: out to the front first"));
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let tool_now = model.kinematics.root_from_link(&configuration, model.tool);
    let back = -(way.base_from_grasp.rotation * Vector3::z()).xy();
    let back = back.try_normalize(0.2).unwrap_or_else(|| -Vector2::x()) * OUT_M;
    move_tool(agent, &to(Translation3::new(back.x, back.y, 0.0) * tool_now))?;
    move_tool(agent, &to(Translation3::new(back.x, back.y, lift_m) * way.base_from_grasp))
}

/// After a way up that ended too low: backs off with what is held, out of what the arm stands in, and lifts by what is left.
fn back_off_if_short(
    agent: &mut Agent,
    task: &GraspTask<'_>,
    joints: &JointPositions,
    outcome: ArmOutcome,
) -> Result<ArmOutcome, Halt> {
    match outcome {
        ArmOutcome::Stuck { error_m, .. } if error_m > LIFT_LEFT_M => {
            agent.log(format!("{error_m:.2} m short of the lift: backs off with it"));
            back_off(agent, BACK_M, BACK_M_PER_S)?;
            raise_by(agent, task, joints, error_m)
        }
        outcome => Ok(outcome),
    }
}

/// Raises what is held.
fn raise_by(agent: &mut Agent, task: &GraspTask<'_>, joints: &JointPositions, by_m: f64) -> Result<ArmOutcome, Halt> {
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let world_from_base = agent.world_from_base()?;
    let id = task.target.id();
    let obstacles = find_obstacles(&task.target.in_map(agent.map()), Some(&agent.live), &world_from_base, Some(id));
    let up = ToolMove {
        goal: Translation3::new(0.0, 0.0, by_m) * model.kinematics.root_from_link(&configuration, model.tool),
        obstacles: &obstacles,
        touching: &finger_links(&model),
        speed_m_per_s: task.settings.approach_speed_m_per_s,
        posture: Some(joints),
        give_up_after: STUCK_AFTER,
        gentle: false,
        clearance_m: None,
    };
    move_tool(agent, &up)
}
