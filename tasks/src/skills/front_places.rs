//! Where to stand before furniture: to look at its sides, and to pull or swing a handle.

use super::approach::{Approach, Ground, find_approach_around, find_approaches};
use super::fronts::{Grabbed, Side, sides_of};
use super::navigate::opens;
use super::swing::{Hinge, rehearse};
use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::map::{CellState, Map, ObjectId};
use dsm_robot::control::{IkRequest, find_ik};
use dsm_robot::joints::JointPositions;
use dsm_robot::model::{Configuration, RobotModel};
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2};
use nalgebra::{Point2, Translation3, Vector3};
use std::sync::Arc;

/// Distances from a front for a first look, the best first, metres: near enough that a bar of 12 mm has five pixels.
const LOOK_M: [f64; 5] = [0.95, 0.8, 1.1, 0.7, 1.25];
/// ... and to the side of its middle.
const ASIDE_M: [f64; 7] = [0.0, 0.15, -0.15, 0.3, -0.3, 0.45, -0.45];
/// Distances of the base from the handle that it pulls, the best first, metres.
const PULL_FROM_M: [f64; 6] = [0.62, 0.66, 0.58, 0.7, 0.54, 0.5];
/// How far beside the handle of a drawer the base stands, metres.
const PULL_ASIDE_M: [f64; 3] = [0.0, 0.08, -0.08];
/// ... and how far towards the hinge from that of a door: its face turns there.
const SWING_ASIDE_M: [f64; 4] = [0.3, 0.22, 0.15, 0.08];
/// Room in which the arm unfolds, behind the place to pull from, metres.
const UNFOLD_BACK_M: [f64; 3] = [0.35, 0.25, 0.45];
/// From so far before the handle the wrist camera looks at it, metres: its nearest range, and room for errors.
pub(super) const WRIST_LOOK_M: f64 = 0.2;
/// A door that opens less than this is not worth a try, radians.
const LEAST_SWING_RAD: f64 = 0.6;
/// So many stands from which a door can be swung are compared.
const COMPARED: usize = 4;

/// How the arm reaches a handle.
pub(super) struct Reach {
    /// How far the part can be moved from there, radians for a door.
    pub swing_rad: f64,
    /// Where the hand holds it, in the frame of the base at its stand.
    pub base_from_grip: Pose,
    /// Joints with the hand before it.
    pub joints: JointPositions,
}

/// Places to look at the sides of a box from, the likeliest front first: free floor before it, a wall behind.
pub(super) fn places_to_look(map: &Map, bounds: &OrientedBox, costmap: &Costmap, field: &Field) -> Vec<(Side, Pose2)> {
    let mut sides = sides_of(bounds);
    sides.sort_by(|a, b| frontness(map, b).total_cmp(&frontness(map, a)));
    let place = |side: &Side| {
        let across = Vector3::z().cross(&side.normal).xy();
        let ways = LOOK_M.iter().flat_map(|off_m| ASIDE_M.iter().map(move |aside_m| (off_m, aside_m)));
        ways.map(|(off_m, aside_m)| side.middle + side.normal.xy() * *off_m + across * *aside_m)
            .filter(|p| is_seen_from(map, side, p))
            .find(|p| costmap.is_traversable_at(p) && field.find_length_to_m(p).is_some())
            .map(|p| (*side, Pose2::facing(p, &side.middle)))
    };
    sides.iter().filter_map(place).collect()
}

/// Says of each new map, at most once a second, whether a place before a front of the object can be reached from `start`.
pub(crate) fn way_to_front(nav: &NavConfig, id: ObjectId, start: Point2<f64>) -> impl FnMut(&Arc<Map>) -> bool + use<> {
    opens(nav, id, start, |map, bounds, costmap, field| !places_to_look(map, bounds, costmap, field).is_empty())
}

/// Whether no wall stands between a place and the middle of a side.
fn is_seen_from(map: &Map, side: &Side, place: &Point2<f64>) -> bool {
    const STEP_M: f64 = 0.04;
    /// What the furniture itself marks before its side, metres: handles. Walls that it stands against reach farther.
    const OWN_M: f64 = 0.1;
    let way = side.middle - place;
    let steps = ((way.norm() - OWN_M) / STEP_M).max(0.0) as i32;
    let on_it = |i: i32| place + way.normalize() * (f64::from(i) * STEP_M);
    (0..=steps).all(|i| map.free_space.state_at(&on_it(i)) != CellState::Occupied)
}

/// How likely the side is the front: free floor before it, none behind the furniture.
fn frontness(map: &Map, side: &Side) -> f64 {
    let across = Vector3::z().cross(&side.normal).xy();
    let share = |from_m: f64, to_m: f64| {
        let cells = (0..8).flat_map(|i| (-3..=3).map(move |j| (f64::from(i) / 7.0, f64::from(j) / 3.0)));
        let places: Vec<Point2<f64>> = cells
            .map(|(out, along)| {
                let out_m = from_m + out * (to_m - from_m);
                side.middle + side.normal.xy() * out_m + across * (along * 0.8 * side.half_m)
            })
            .collect();
        let free = places.iter().filter(|p| map.free_space.state_at(p) == CellState::Free).count();
        free as f64 / places.len() as f64
    };
    // Fronts are the long sides more often than not.
    share(0.15, 0.9) - share(-side.depth_m - 0.35, -side.depth_m - 0.1)
        + 0.2 * f64::from(u8::from(side.half_m > 0.5 * side.depth_m))
}

/// Where to stand and how to reach to pull a drawer, or to swing a door by `wanted_rad`, and the way there.
pub(super) fn plan_reach(ground: &Ground<'_>, target: &Grabbed, wanted_rad: f64) -> Result<(Reach, Approach), String> {
    let &Ground { model, costmap, field, folded, .. } = ground;
    let handle = &target.handle;
    let tip_m = model.settings.gripper.tip_beyond_tool_m;
    let normal = handle.normal.xy();
    let across = Vector3::z().cross(&handle.normal).xy();
    let yaw_rad = (-normal.y).atan2(-normal.x);
    let is_place = |p: &Point2<f64>| costmap.is_traversable_at(p) && field.find_length_to_m(p).is_some();
    let mut reached = 0;
    let mut found: Vec<(f64, Reach, Approach)> = Vec::new();
    let asides: Vec<f64> = match target.hinge {
        None => PULL_ASIDE_M.to_vec(),
        // A door that opens to the right has its hinge to the left.
        Some((_, sense)) => SWING_ASIDE_M.iter().map(|aside_m| sense * aside_m).collect(),
    };
    for (from_m, aside_m) in PULL_FROM_M.iter().flat_map(|from_m| asides.iter().map(move |aside_m| (*from_m, *aside_m)))
    {
        let stand = Pose2 { position: handle.center.xy() + normal * from_m + across * aside_m, yaw_rad };
        let unfolds = UNFOLD_BACK_M.iter().map(|back_m| Pose2 { position: stand.position + normal * *back_m, yaw_rad });
        let unfolds: Vec<Pose2> = unfolds.filter(|place| is_place(&place.position)).collect();
        if unfolds.is_empty() {
            continue;
        }
        let base_from_world = stand.to_pose().inverse();
        let grips = handle.grips(tip_m).map(|grip| base_from_world * grip);
        for base_from_grip in grips {
            let Some((at_grip, joints)) = reaches(model, folded, &base_from_grip) else { continue };
            reached += 1;
            let swung_rad = match target.hinge {
                None => wanted_rad,
                Some((at, sense)) => {
                    let at = (base_from_world * nalgebra::Point3::new(at.x, at.y, 0.0)).xy();
                    {
                        let along = (at.coords - base_from_grip.translation.vector.xy()).normalize();
                        rehearse(model, folded, &base_from_grip, &at_grip, &Hinge { at, along, sense }, wanted_rad)
                    }
                }
            };
            if swung_rad < LEAST_SWING_RAD.min(wanted_rad) || found.iter().any(|best| best.0 >= swung_rad) {
                continue;
            }
            let approach = unfolds.iter().find_map(|unfold_at| {
                let stands = [*unfold_at];
                let swept = find_approaches(ground, &stands, 0.0, 1).into_iter().next();
                swept.or_else(|| find_approach_around(ground, &stands, 0.0))
            });
            let Some(approach) = approach else { continue };
            found.push((swung_rad, Reach { swing_rad: swung_rad, base_from_grip, joints }, approach));
            if swung_rad >= wanted_rad - 1e-9 || found.len() >= COMPARED {
                break;
            }
        }
        if found.last().is_some_and(|best| best.0 >= wanted_rad - 1e-9) || found.len() >= COMPARED {
            break;
        }
    }
    // Each that was kept is better than those before.
    match (found.pop(), reached) {
        (Some((_, reach, approach)), _) => Ok((reach, approach)),
        (None, 0) => Err("the arm does not reach the handle from anywhere".into()),
        (None, n) => Err(format!("no way to any of {n} places that reach the handle")),
    }
}

/// Joints with the hand at a handle, and with the hand before it, when it can go on from there.
pub(super) fn reaches(
    model: &RobotModel,
    folded: &Configuration,
    base_from_grip: &Pose,
) -> Option<(JointPositions, JointPositions)> {
    let seeds: Vec<JointPositions> =
        ["ready_front", "ready_down"].iter().filter_map(|name| model.find_posture(name)).collect();
    let request = IkRequest { seeds: &seeds, restarts: 6, ..IkRequest::new(folded) };
    let near = [find_ik(model, base_from_grip, &request)?];
    let before = base_from_grip * Translation3::new(0.0, 0.0, -WRIST_LOOK_M);
    let before = find_ik(model, &before, &IkRequest { seeds: &near, restarts: 0, ..IkRequest::new(folded) })?;
    let [at] = near;
    Some((at, before))
}

/// The pose whose hand is turned as the other's, more or less.
pub(super) fn nearest_roll(grips: &[Pose; 2], like: &Pose) -> Pose {
    let angle = |pose: &Pose| pose.rotation.angle_to(&like.rotation);
    if angle(&grips[0]) <= angle(&grips[1]) { grips[0] } else { grips[1] }
}
