//! Closing the fingers, and verifying that they hold something.

use super::arm::ArmOutcome;
use super::grasp::GraspSettings;
use crate::agent::{Agent, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::time::Span;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use nalgebra::Point3;
use std::sync::Arc;

/// What a lift came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lifted {
    /// Between the fingers, metres.
    pub(super) width_m: f64,
    /// How far the object hangs lower than the hand went up, as its lower end is seen, metres; `None` when the arm hides
    /// where it was.
    pub(super) sagged_m: Option<f64>,
}

/// A lower end that is seen so little is noise.
const SAG_SHARE: f64 = 0.15;
/// What a lift vacates is looked at up to so far below its height, metres.
const BELOW_M: f64 = 0.03;

/// Verified twice: by the width between the fingers, and by looking at where the object was.
pub(super) fn verify(
    agent: &mut Agent,
    settings: &GraspSettings,
    before: &[Point3<f64>],
    lifted: ArmOutcome,
) -> Result<Result<Lifted, (Stage, String)>, Halt> {
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
    let vacated_z_m = bottom_z_m + settings.planner.lift_m - BELOW_M;
    let left: Vec<Point3<f64>> = before.iter().filter(|p| p.z < vacated_z_m).copied().collect();
    let still_there = share_still_there(agent, &left);
    if let Some(share) = still_there
        && share > 0.5
    {
        return Ok(Err((Stage::Grasp, format!("{:.0} % of the object is seen where it was", 100.0 * share))));
    }
    let sagged_m = still_there.map(|share| sag_m(share, settings.planner.lift_m));
    Ok(Ok(Lifted { width_m, sagged_m }))
}

/// How far a thing hangs lower than the hand went up, when this share of what it was to leave is still filled.
fn sag_m(still_there: f64, lift_m: f64) -> f64 {
    if still_there > SAG_SHARE { BELOW_M + still_there * (lift_m - BELOW_M) } else { 0.0 }
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

/// The share of the object's points, as they were before the grasp, that the newest head frame still sees there; `None`
/// when it sees almost nothing of the place.
fn share_still_there(agent: &Agent, before: &[Point3<f64>]) -> Option<f64> {
    const SAME_M: f64 = 0.025;
    let seen = agent.find_frame("head")?;
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
    (visible >= 20).then(|| there as f64 / visible as f64)
}

/// The points of an object that the hand takes with it: a cloud that holds some of the shelf says nothing about a lift.
pub(super) fn between_fingers(
    points: &[Point3<f64>],
    world_from_tool: &Pose,
    support_z_m: f64,
    aperture_m: f64,
) -> Vec<Point3<f64>> {
    /// Noise of depth over the support, metres.
    const ABOVE_M: f64 = 0.01;
    /// What is farther from the hand moves little or is something else, metres.
    const AROUND_M: f64 = 0.12;
    let tool = Point3::from(world_from_tool.translation.vector);
    let taken = |p: &&Point3<f64>| {
        let across_m = world_from_tool.inverse_transform_point(p).y.abs();
        p.z > support_z_m + ABOVE_M && (p.xy() - tool.xy()).norm() < AROUND_M && across_m < 0.5 * aperture_m
    };
    points.iter().filter(taken).copied().collect()
}

#[cfg(test)]
mod tests {
    //! Contract: only what the hand takes along tells whether a lift succeeded.
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    #[test]
    fn a_shampoo_that_slipped_by_nine_centimetres_is_lifted_on_by_as_much() {
        // Lifted by 14 cm, its lower end hangs 5 cm up: of the 11 cm that it was to leave it fills the upper 6.
        assert!((sag_m(6.0 / 11.0, 0.14) - 0.09).abs() < 1e-9);
        assert_eq!(sag_m(0.1, 0.14), 0.0, "noise");
    }

    #[test]
    fn the_shelf_in_a_bottles_cloud_stays_behind() {
        // A bottle on the lower board, from the front; the cloud also holds boards and back of the shelf.
        let bottle =
            (0..40).map(|i| Point3::new(1.0, 2.0 + 0.03 * f64::from(i % 5 - 2) / 2.0, 0.4 + 0.005 * f64::from(i)));
        let board = (0..60).map(|i| Point3::new(1.0, 1.7 + 0.01 * f64::from(i), 0.375));
        let back = (0..60).map(|i| Point3::new(1.16, 1.7 + 0.01 * f64::from(i), 0.5));
        let upper = (0..60).map(|i| Point3::new(1.1, 1.7 + 0.01 * f64::from(i), 0.7));
        let cloud: Vec<Point3<f64>> = bottle.chain(board).chain(back).chain(upper).collect();
        // Approach along x, closing along y.
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let tool = Pose::from_parts(Translation3::new(1.0, 2.0, 0.48), rotation);
        let taken = between_fingers(&cloud, &tool, 0.37, 0.13);
        assert!(taken.len() >= 40 && taken.len() <= 60, "{}", taken.len());
        assert!(taken.iter().all(|p| (p.y - 2.0).abs() < 0.07 && p.z > 0.38 && p.x < 1.15));
    }
}
