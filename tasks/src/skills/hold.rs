//! Closing the fingers, and verifying that they hold something.

use super::arm::ArmOutcome;
use super::grasp::{Attempt, GraspSettings};
use crate::agent::{Agent, Halt};
use crate::summary::Stage;
use dsm::time::Span;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use nalgebra::Point3;
use std::sync::Arc;

/// Verified twice: by the width between the fingers, and by looking at where the object was.
pub(super) fn verify(
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
    // Only what a lift leaves behind tells: the lower end of a tall thing now stands where its upper end was.
    let bottom_z_m = before.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let vacated_z_m = bottom_z_m + settings.planner.lift_m - 0.03;
    let left: Vec<Point3<f64>> = before.iter().filter(|p| p.z < vacated_z_m).copied().collect();
    let still_there = share_still_there(agent, &left);
    if still_there > 0.5 {
        return Ok(Err((Stage::Grasp, format!("{:.0} % of the object is seen where it was", 100.0 * still_there))));
    }
    Ok(Ok(format!("lifted; {:.0} mm between the fingers", 1e3 * width_m)))
}

/// Closes the fingers until they stop; the width between them.
pub(super) fn close(agent: &mut Agent, settings: &GraspSettings) -> Result<f64, Halt> {
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
