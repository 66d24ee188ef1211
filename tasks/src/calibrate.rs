//! From a recording to the mounting of a camera: which of its frames were taken at rest, and what they say together.

use crate::assemble::find_robot;
use crate::error::TaskError;
use crate::replay::{Entry, EntrySource, Head, read_head};
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::time::Stamp;
use dsm_robot::calibrate::{CalibrateConfig, Calibration, CalibrationOutcome, View, calibrate};
use dsm_robot::joints::{JointNames, JointPositions};
use dsm_robot::model::RobotModel;
use dsm_robot::recorded::{JointTalk, Period};
use dsm_robot::timing::{BufferLimits, TimedBuffer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Version of the report's layout.
const SCHEMA: u32 = 1;
/// At most so many views are used: each is compared with each.
const MOST_VIEWS: usize = 24;
/// A joint that moves faster, in radians or metres per second, is not at rest.
const STILL_PER_S: f64 = 0.02;
/// The base stood still between two views when odometry differs by no more, metres and radians.
const STOOD: f64 = 1e-3;
/// Views whose joints differ by less show the same, radians or metres.
const SAME: f64 = 0.02;

/// What was found of a camera's mounting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CalibrationReport {
    /// Version of this layout.
    pub schema: u32,
    /// The camera.
    pub camera: String,
    /// Its frame in the URDF.
    pub frame: String,
    /// Views that were used.
    pub views: usize,
    /// Whether something was found.
    pub estimated: bool,
    /// `offset_xyz_m` for `robot.toml`; null when nothing was found.
    pub offset_xyz_m: Option<[f64; 3]>,
    /// `offset_rpy_rad` for `robot.toml`; null when nothing was found.
    pub offset_rpy_rad: Option<[f64; 3]>,
    /// Standard deviations along and about x, y, z of the camera; metres, then radians.
    pub sigma: Option<[f64; 6]>,
    /// Root mean square distance between planes that were seen twice, before and after, metres.
    pub residual_m: Option<[f64; 2]>,
    /// Pairs of planes.
    pub matches: usize,
    /// What happened, in words.
    pub reason: String,
}

/// A frame of a camera at rest.
struct Still {
    frame: RgbdFrame,
    odom_from_base: Pose,
    arm: JointPositions,
    head: JointPositions,
}

/// Estimates how `camera` is mounted from a recording; `robot` is described elsewhere than the recorded one when given.
///
/// # Errors
/// [`TaskError`]: no recording, a damaged one, no such camera or robot.
pub fn calibrate_camera(
    mut source: Box<dyn EntrySource>,
    camera: &str,
    robot: Option<&str>,
) -> Result<CalibrationReport, TaskError> {
    let head = read_head(&mut *source)?;
    let model = RobotModel::load(&find_robot(robot.unwrap_or(&head.robot))?)?;
    let Some((settings, link)) = model.find_camera(camera) else {
        let known: Vec<&str> = model.settings.camera.iter().map(|camera| camera.name.as_str()).collect();
        return Err(TaskError::Usage(format!("no camera `{camera}`; {} has {known:?}", model.settings.name)));
    };
    let stills = choose(find_stills(&mut *source, &head, camera)?);
    let view = |still: &Still| {
        let mut configuration = model.kinematics.zero();
        configuration.apply(&still.arm);
        configuration.apply(&still.head);
        let base_from_mount = model.kinematics.root_from_link(&configuration, link);
        View::new(base_from_mount, still.frame.model, &still.frame.depth_m)
    };
    let views: Vec<View> = stills.iter().map(view).collect();
    let outcome = calibrate(&views, &Pose::identity(), &CalibrateConfig::default());
    // The model has what is known of the mounting already: what was found comes on top of it.
    Ok(report(outcome, camera, &settings.frame, &settings.frame_from_camera(), views.len()))
}

/// Frames of a camera that were taken while nothing moved.
fn find_stills(source: &mut dyn EntrySource, head: &Head, camera: &str) -> Result<Vec<Still>, TaskError> {
    let names = |names: &[String]| -> JointNames { names.iter().map(|name| Arc::from(name.as_str())).collect() };
    let (arm_joints, head_joints) = (names(&head.arm_joints), names(&head.head_joints));
    let limits = BufferLimits::default();
    let (mut arm, mut neck, mut odom) = (TimedBuffer::new(limits), TimedBuffer::new(limits), TimedBuffer::new(limits));
    let (mut stills, mut waiting) = (Vec::new(), Vec::<RgbdFrame>::new());
    let mut moved = Stamp(i64::MIN);
    while let Some(entry) = source.next_entry()? {
        match entry {
            Entry::Frame(frame) if &*frame.camera == camera => waiting.push(*frame),
            Entry::Period(period) => {
                let is_still = note(&mut arm, &period.arm, &arm_joints) & note(&mut neck, &period.head, &head_joints);
                if let Some(Ok(pose)) = period.odom_from_base.find(0) {
                    odom.insert(pose.stamp, pose.pose);
                }
                if !is_still {
                    moved = period.now;
                }
                // States of a frame's moment may be heard of after it.
                waiting.retain(|frame| {
                    let at = (arm.at(frame.stamp).find(), neck.at(frame.stamp).find(), odom.at(frame.stamp).find());
                    let (Some(arm), Some(head), Some(odom_from_base)) = at else { return is_young(frame, &period) };
                    if frame.stamp > moved {
                        stills.push(Still { frame: frame.clone(), odom_from_base, arm, head });
                    }
                    false
                });
            }
            _ => {}
        }
    }
    Ok(stills)
}

fn is_young(frame: &RgbdFrame, period: &Period) -> bool {
    (period.now - frame.stamp).as_s() < 0.5
}

/// Notes the state of a group; whether it was at rest.
fn note(buffer: &mut TimedBuffer<JointPositions>, talk: &JointTalk, own: &JointNames) -> bool {
    let Some(Ok(reading)) = talk.state.find(0) else { return true };
    let Some(state) = reading.find_state(own) else { return true };
    buffer.insert(state.stamp, state.positions);
    state.velocities.values().iter().all(|velocity| velocity.abs() < STILL_PER_S)
}

/// Those of the longest stand, one for each posture, and not too many.
fn choose(stills: Vec<Still>) -> Vec<Still> {
    let mut stands: Vec<Vec<Still>> = Vec::new();
    for still in stills {
        let stood = |stand: &Vec<Still>| stand.first().is_some_and(|first| is_same_stand(first, &still));
        match stands.last_mut().filter(|stand| stood(stand)) {
            Some(stand) if stand.iter().any(|other| is_same_posture(other, &still)) => {}
            Some(stand) => stand.push(still),
            None => stands.push(vec![still]),
        }
    }
    let longest = stands.into_iter().max_by_key(Vec::len).unwrap_or_default();
    let count = longest.len();
    let wanted = count.min(MOST_VIEWS);
    let is_chosen = |index: usize| wanted == count || (index * wanted) / count != ((index + 1) * wanted) / count;
    longest.into_iter().enumerate().filter(|(index, _)| is_chosen(*index)).map(|(_, still)| still).collect()
}

fn is_same_stand(a: &Still, b: &Still) -> bool {
    let moved = a.odom_from_base.inv_mul(&b.odom_from_base);
    moved.translation.vector.norm() < STOOD && moved.rotation.angle() < STOOD
}

fn is_same_posture(a: &Still, b: &Still) -> bool {
    let close =
        |a: &JointPositions, b: &JointPositions| a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() < SAME);
    close(&a.arm, &b.arm) && close(&a.head, &b.head)
}

fn report(outcome: CalibrationOutcome, camera: &str, frame: &str, known: &Pose, views: usize) -> CalibrationReport {
    let reason = words(&outcome);
    let found = if let CalibrationOutcome::Estimated(found) = outcome { Some(found) } else { None };
    let offset = found.as_ref().map(|found: &Calibration| known * found.mount_from_camera);
    CalibrationReport {
        schema: SCHEMA,
        camera: camera.into(),
        frame: frame.into(),
        views,
        estimated: found.is_some(),
        offset_xyz_m: offset.map(|offset| offset.translation.vector.into()),
        offset_rpy_rad: offset.map(|offset| offset.rotation.euler_angles().into()),
        sigma: found.as_ref().map(|found| found.sigma),
        residual_m: found.as_ref().map(|found| found.residual_m),
        matches: found.as_ref().map_or(0, |found| found.matches),
        reason,
    }
}

fn words(outcome: &CalibrationOutcome) -> String {
    match outcome {
        CalibrationOutcome::Estimated(found) => format!(
            "{} pairs of planes in {} views lie {:.1} mm apart where they lay {:.1} mm apart before",
            found.matches,
            found.views,
            1e3 * found.residual_m[1],
            1e3 * found.residual_m[0]
        ),
        CalibrationOutcome::TooFewViews { views, required } => {
            format!("{views} views from different postures at rest, at one place of the base; {required} are needed")
        }
        CalibrationOutcome::TooFewMatches { matches, required } => format!(
            "{matches} pairs of planes that two views have in common; {required} are needed: look at walls and furniture"
        ),
        CalibrationOutcome::Undetermined { direction: d, information, required } => format!(
            "the motion leaves a direction open: shift ({:.2}, {:.2}, {:.2}) with turn ({:.2}, {:.2}, {:.2}) along and about \
             x, y, z of the camera is known by {information:.1e} only, {required:.1e} is needed; turn the head about two axes",
            d[0], d[1], d[2], d[3], d[4], d[5]
        ),
        CalibrationOutcome::NoBetter { residual_m } => format!(
            "planes lie {:.1} mm apart, {:.1} mm before: the scene did not stand still, or the camera is elsewhere altogether",
            1e3 * residual_m[1],
            1e3 * residual_m[0]
        ),
    }
}
