//! Getting away from where the hand was: back with arm and base, and the arm folded.

use super::arm::{ArmOutcome, STUCK_AFTER, ToolMove, fold, move_joints_around, move_tool};
use super::grasp::UNFOLD;
use super::obstacles::{find_obstacles, leave_out_overlaps};
use crate::agent::{Agent, Halt};
use dsm::map::CellState;
use dsm::time::Span;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use nalgebra::{Point3, Translation3};

/// Opens the hand, backs off with arm and base, and folds the arm, best effort.
pub(crate) fn retreat(agent: &mut Agent) -> Result<(), Halt> {
    const BACK_M: f64 = 0.45;
    const AGAIN_M: f64 = 0.2;
    /// What the arm brushes on its way out, where no camera looks, it brushes slowly.
    const SPEED_M_PER_S: f64 = 0.09;
    const BACK_M_PER_S: f64 = 0.06;
    let opening_m = agent.model().settings.gripper.max_aperture_m;
    agent.grip(opening_m, 10.0);
    agent.rest(Span::from_s(0.6))?;
    let model = agent.model().clone();
    let configuration = agent.configuration()?;
    let base_from_tool = model.kinematics.root_from_link(&configuration, model.tool);
    let world_from_base = agent.world_from_base()?;
    // What the fingers are around is left out; what they are beside they keep off.
    let mut obstacles = find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None);
    leave_out_overlaps(&model, &configuration, &mut obstacles);
    let back = ToolMove {
        goal: Translation3::new(0.0, 0.0, 0.06) * base_from_tool * Translation3::new(0.0, 0.0, -0.08),
        obstacles: &obstacles,
        touching: &[],
        speed_m_per_s: BACK_M_PER_S,
        posture: None,
        give_up_after: STUCK_AFTER,
        gentle: false,
        clearance_m: None,
    };
    move_tool(agent, &back)?;
    // An arm that sticks out would sweep along walls later: farther back there is room to fold it.
    for back_m in [BACK_M, AGAIN_M, AGAIN_M] {
        back_off(agent, back_m, SPEED_M_PER_S)?;
        let world_from_base = agent.world_from_base()?;
        let mut obstacles = find_obstacles(agent.map(), Some(&agent.live), &world_from_base, None);
        leave_out_overlaps(&model, &agent.configuration()?, &mut obstacles);
        if fold(agent, UNFOLD, &obstacles)? == ArmOutcome::Reached {
            break;
        }
        // Not the way that it unfolds, then one that is planned around what stands there.
        let folded = model.settings.paths.get(UNFOLD).and_then(|names| model.find_posture(names.first()?));
        if let Some(folded) = folded
            && move_joints_around(agent, &folded, &obstacles)? == ArmOutcome::Reached
        {
            break;
        }
    }
    Ok(())
}

/// Drives straight back, as far as the map says that there is floor.
pub(super) fn back_off(agent: &mut Agent, distance_m: f64, speed_m_per_s: f64) -> Result<(), Halt> {
    /// Floor that must be left behind the base: localisation wanders by 3 cm, and braking takes one.
    const GAP_M: f64 = 0.06;
    let still = JointVelocities::zeros(&agent.model().arm.joints);
    let start = agent.odom_from_base()?;
    let radius_m = agent.model().settings.base.footprint_radius_m;
    let begin = agent.now();
    // Beside things the arm slows the base.
    while (agent.now() - begin).as_s() < 3.0 * distance_m / speed_m_per_s {
        let gone_m = (agent.odom_from_base()?.translation.vector - start.translation.vector).norm();
        let world_from_base = agent.world_from_base()?;
        let map = agent.map();
        let is_floor = |angle_rad: f64| {
            let reach_m = radius_m + GAP_M;
            let behind = world_from_base * Point3::new(-reach_m * angle_rad.cos(), reach_m * angle_rad.sin(), 0.0);
            map.free_space.state_at(&behind.xy()) == CellState::Free
        };
        // All that the base sweeps, every few centimetres.
        let free = (-6..=6).all(|i| is_floor(f64::from(i) * 0.18));
        if gone_m >= distance_m || !free || agent.take_touch() {
            break;
        }
        // Braking in time: v <= sqrt(2 a d).
        let speed = speed_m_per_s.min((2.0 * 0.3 * (distance_m - gone_m)).sqrt()).max(0.03);
        agent.tick(Twist { forward_m_per_s: -speed, turn_rad_per_s: 0.0 }, &still)?;
    }
    agent.rest(Span::from_s(0.3))
}
