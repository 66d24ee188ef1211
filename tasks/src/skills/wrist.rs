//! Centring a grasp with the wrist camera before the fingers go in.

use super::arm::{ArmOutcome, STUCK_AFTER, ToolMove, move_tool};
use super::grasp::{GraspSettings, finger_links};
use crate::agent::{Agent, Halt};
use crate::summary::Stage;
use dsm::Pose;
use dsm::time::Span;
use dsm_robot::grasp::{GraspCandidate, Refinement, refine_grasp};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::RobotModel;
use dsm_robot::model::collision::Obstacle;
use nalgebra::{Point3, Translation3};

/// Looks with the wrist camera, moves the hand over what it sees, and looks again until the hand stands right: a look from
/// aside shows one side of a thing, so that its middle is only known from above it.
pub(super) fn center_with_wrist(
    agent: &mut Agent,
    settings: &GraspSettings,
    chosen: &GraspCandidate,
    joints: &JointPositions,
    (world_from_base, support_z_m): (&Pose, f64),
    obstacles: &[Obstacle],
) -> Result<Result<GraspCandidate, (Stage, String)>, Halt> {
    const MAX_LOOKS: usize = 4;
    /// A look that moves the grasp by less settles it.
    const SETTLED_M: f64 = 0.015;
    /// How far the hand backs off when the camera sees nothing.
    const BACK_M: f64 = 0.08;
    let base_from_world = world_from_base.inverse();
    let mut grasp = chosen.clone();
    let mut last = (Stage::Grasp, String::new());
    let near_m = look_back_m(agent.model(), &grasp, settings);
    let fingers = finger_links(agent.model());
    for look in 0..MAX_LOOKS {
        let back_m = match look_with_wrist(agent, settings, &grasp, world_from_base, support_z_m)? {
            Ok((refined, shift_m)) => {
                grasp = refined;
                if shift_m < SETTLED_M || look + 1 == MAX_LOOKS {
                    return Ok(Ok(grasp));
                }
                0.0
            }
            Err(failure) => {
                last = failure;
                BACK_M
            }
        };
        let over = ToolMove {
            goal: base_from_world * look_pose(&grasp, settings, near_m + back_m),
            obstacles,
            touching: &fingers,
            speed_m_per_s: settings.approach_speed_m_per_s,
            posture: Some(joints),
            give_up_after: STUCK_AFTER,
            gentle: true,
            clearance_m: Some(settings.planner.clearance_m),
        };
        if let ArmOutcome::Stuck { error_m, .. } = move_tool(agent, &over)?
            && back_m == 0.0
            && error_m > near_m + 0.03
        {
            return Ok(Err((Stage::Reach, format!("stuck {error_m:.3} m before the place over the object"))));
        }
    }
    Ok(Err(last))
}

/// The re-centred grasp and how far it moved, metres; or why the look fails.
type Look = Result<(GraspCandidate, f64), (Stage, String)>;

/// How far behind the pregrasp the hand must stand for its camera to measure the object, metres.
pub(super) fn look_back_m(model: &RobotModel, grasp: &GraspCandidate, settings: &GraspSettings) -> f64 {
    /// Distance beyond the nearest that the camera measures, metres.
    const SPARE_M: f64 = 0.04;
    let Some((camera, link)) = model.find_camera("wrist") else { return 0.0 };
    let zero = model.kinematics.zero();
    let root_from = |link| model.kinematics.root_from_link(&zero, link);
    let camera_in_tool = root_from(model.tool).inverse() * root_from(link);
    let behind_m = settings.planner.pregrasp_m - camera_in_tool.translation.z - grasp.front_m;
    (camera.nearest_m + SPARE_M - behind_m).max(0.0)
}

/// Where the tool stands for a look at the object, `back_m` behind the pregrasp.
pub(super) fn look_pose(grasp: &GraspCandidate, settings: &GraspSettings, back_m: f64) -> Pose {
    grasp.world_from_pregrasp(&settings.planner) * Translation3::new(0.0, 0.0, -back_m)
}

/// Re-centres the grasp on what the wrist camera sees, and says how far it moved. `world_from_base` fixes the world of the
/// grasp to the base.
fn look_with_wrist(
    agent: &mut Agent,
    settings: &GraspSettings,
    grasp: &GraspCandidate,
    world_from_base: &Pose,
    support_z_m: f64,
) -> Result<Look, Halt> {
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
        Refinement::Refined { grasp, .. } if grasp.width_m < settings.min_width_m => (
            "sees nothing as wide as a thing".into(),
            Err((Stage::Grasp, "the wrist camera sees a surface only".into())),
        ),
        Refinement::Refined { grasp, shift_m } => {
            let at = grasp.world_from_tool.translation;
            let width_mm = 1e3 * grasp.width_m;
            let place = format!("to ({:.3}, {:.3}, {:.3}), {width_mm:.0} mm wide", at.x, at.y, at.z);
            (format!("moves the grasp by {:.0} mm {place}", 1e3 * shift_m), Ok((grasp, shift_m)))
        }
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
