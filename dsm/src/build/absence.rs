//! Telling gone from hidden: a ray test per point.

use super::config::BuildConfig;
use super::draft::Draft;
use super::observation::depth_noise_m;
use super::tracks::Tracks;
use crate::Pose;
use crate::frame::RgbdFrame;
use crate::geometry::Aabb;
use crate::map::{MapObject, ObjectState, RemovalReason};
use nalgebra::Point3;

/// Points of an object that are tested.
const SAMPLES: usize = 48;
/// Share of the samples that must lie in view and not hidden before a frame says anything.
const VISIBLE_SHARE: f64 = 0.3;
/// Share of the visible samples whose ray must have passed.
const PASSED_SHARE: f64 = 0.6;

/// What a frame says about an object that no detection showed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Presence {
    Present,
    Absent,
    /// Hidden, out of view, or out of range: never seen is not absent.
    Unknown,
}

/// Removes objects that several frames in a row saw through, and provisional ones that nothing confirmed.
pub(super) fn remove_absent(
    config: &BuildConfig,
    draft: &mut Draft,
    tracks: &mut Tracks,
    frame: &RgbdFrame,
    world_from_camera: &Pose,
) {
    let camera_from_world = world_from_camera.inverse();
    let eye = Point3::from(world_from_camera.translation.vector);
    // Farther away nothing is looked at; provisional objects die wherever they are.
    let around = Aabb { min: eye, max: eye }.grown(1.5 * config.max_object_depth_m);
    let mut asked = tracks.find_over(&around);
    asked.extend(draft.provisional());
    asked.sort_unstable();
    asked.dedup();
    let mut gone = Vec::new();
    for id in asked {
        let Some(track) = tracks.find(id) else { continue };
        let Some(object) = draft.find(id) else { continue };
        // What was seen later than this frame is there, whatever the frame shows.
        if object.last_seen >= frame.stamp {
            continue;
        }
        let in_range = {
            let center = camera_from_world * track.aabb.center();
            let radius = 0.5 * track.aabb.size().norm();
            center.z > -radius
                && center.z < config.max_object_depth_m + radius
                && center.x.abs() < 2.0 * (center.z + radius)
        };
        if in_range {
            let presence = presence(config, object, frame, &camera_from_world);
            tracks.change(id, |track| match presence {
                Presence::Absent => track.absent += 1,
                Presence::Present => track.absent = 0,
                Presence::Unknown => {}
            });
        }
        let absent = tracks.find(id).map_or(0, |track| track.absent);
        let age_s = (frame.stamp - object.last_seen).as_s();
        if absent >= config.absent_frames {
            gone.push((id, RemovalReason::Absent));
        } else if object.state == ObjectState::Provisional && age_s > config.provisional_life_s {
            gone.push((id, RemovalReason::Unconfirmed));
        }
    }
    for (id, reason) in gone {
        tracks.remove(id);
        draft.remove(id, reason);
    }
}

fn presence(config: &BuildConfig, object: &MapObject, frame: &RgbdFrame, camera_from_world: &Pose) -> Presence {
    let largest = object.bounds.size.max();
    let margin = (0.5 * largest).clamp(0.04, config.absent_depth_m);
    let (mut tested, mut present, mut passed) = (0usize, 0usize, 0usize);
    for point in object.points.iter().step_by(object.points.len().div_ceil(SAMPLES).max(1)) {
        tested += 1;
        let p: Point3<f64> = camera_from_world * point.position.cast::<f64>();
        let Some((column, row)) = frame.model.find_pixel(&p) else { continue };
        let depth = f64::from(frame.depth_m[(row * frame.model.width + column) as usize]);
        if depth <= 0.0 || p.z > config.max_object_depth_m {
            continue;
        }
        let noise = depth_noise_m(p.z);
        if depth > p.z + margin + noise {
            passed += 1;
        } else if depth > p.z - 0.05 - noise {
            present += 1;
        }
    }
    let visible = (present + passed) as f64;
    if visible < VISIBLE_SHARE * tested as f64 || visible == 0.0 {
        Presence::Unknown
    } else if passed as f64 >= PASSED_SHARE * visible {
        Presence::Absent
    } else {
        Presence::Present
    }
}
