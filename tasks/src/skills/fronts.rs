//! Looking at a piece of furniture: the clouds of a few frames, its front, and the handles on it.

use crate::agent::{Agent, Halt};
use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::ground::{Part, PartKind, PartPlace};
use dsm::time::Span;
use dsm_robot::grasp::{Front, Handle, find_front, find_handles};
use nalgebra::{Point2, Point3, Vector3};

/// What stands farther from a box than this is not seen as its front, metres: boxes of the map are off by less.
const AROUND_M: f64 = 0.12;

/// A side of a piece of furniture. World frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    /// Its middle on the floor.
    pub middle: Point2<f64>,
    /// Outwards, level, of length 1.
    pub normal: Vector3<f64>,
    /// Half of its width.
    pub half_m: f64,
    /// How deep the furniture is behind it.
    pub depth_m: f64,
}

/// The four sides of an upright box.
pub(super) fn sides_of(bounds: &OrientedBox) -> [Side; 4] {
    let axis = |k: usize| {
        let axis = bounds.rotation * Vector3::ith(k, 1.0);
        Vector3::new(axis.x, axis.y, 0.0).try_normalize(1e-6).unwrap_or_else(|| Vector3::ith(k, 1.0))
    };
    [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)].map(|(k, sign)| {
        let normal = axis(k) * sign;
        Side {
            middle: bounds.center.xy() + normal.xy() * (0.5 * bounds.size[k]),
            normal,
            half_m: 0.5 * bounds.size[1 - k],
            depth_m: bounds.size[k],
        }
    })
}

/// The points that a camera sees in a few frames, in the frame of a base that stands.
pub(super) fn gather(agent: &mut Agent, camera: &str, frames: usize) -> Result<Vec<Point3<f64>>, Halt> {
    const PERIOD: Span = Span(210_000_000);
    let is_head = camera == "head";
    if !is_head {
        agent.watched.push(camera.to_owned());
    }
    let mut points = Vec::new();
    let mut last = agent.find_frame(camera).map(|seen| seen.frame.id);
    for _ in 0..frames {
        agent.rest(PERIOD)?;
        let Some(seen) = agent.find_frame(camera) else { continue };
        if last == Some(seen.frame.id) {
            continue;
        }
        last = Some(seen.frame.id);
        let base_from_camera = seen.world_from_base.inverse() * seen.frame.world_from_camera;
        let found = (0..seen.frame.depth_m.len()).filter_map(|pixel| seen.frame.find_point_in_camera(pixel));
        points.extend(found.map(|point| base_from_camera * point).filter(|p| p.coords.xy().norm() < 2.2));
    }
    if !is_head {
        agent.watched.retain(|watched| watched != camera);
    }
    Ok(points)
}

/// Where a front is expected, in the frame of the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expected {
    /// A point of it.
    pub at: Point3<f64>,
    /// Its normal.
    pub normal: Vector3<f64>,
    /// It lies no farther before or behind that than this, metres: less than the depth of the furniture, for the wall behind
    /// low furniture is a larger plane.
    pub within_m: f64,
}

impl Expected {
    /// The side of a box (world frame).
    pub(super) fn side(side: &Side, world_from_base: &Pose) -> Self {
        let at = Point3::new(side.middle.x, side.middle.y, 0.0);
        let within_m = (0.4 * side.depth_m).clamp(0.06, 0.15);
        Self { at: world_from_base.inverse() * at, normal: world_from_base.inverse() * side.normal, within_m }
    }

    /// The front of a handle in the frame of the base.
    pub(super) fn of(handle: &Handle) -> Self {
        Self { at: handle.center - handle.normal * handle.off_m, normal: handle.normal, within_m: 0.1 }
    }
}

/// The front that is expected there and its handles, within a box of the map (world frame).
pub(super) fn read_front(
    points: &[Point3<f64>],
    bounds: &OrientedBox,
    world_from_base: &Pose,
    expected: &Expected,
) -> Option<(Front, Vec<Handle>)> {
    /// Handles stand out so far at most, metres.
    const OUT_M: f64 = 0.09;
    let of_it = |p: &&Point3<f64>| {
        let off_m = (*p - expected.at).dot(&expected.normal);
        off_m > -expected.within_m
            && off_m < expected.within_m + OUT_M
            && bounds.contains(&(world_from_base * **p), AROUND_M)
    };
    let of_it: Vec<Point3<f64>> = points.iter().filter(of_it).copied().collect();
    let front = find_front(&of_it, &expected.normal)?;
    let front = within_box(front, bounds, world_from_base);
    let mut handles = find_handles(&of_it, &front);
    let right = front.right();
    handles.retain(|handle| {
        let right_m = (handle.center - front.point).dot(&right);
        front.right_m.0 < right_m && right_m < front.right_m.1
    });
    Some((front, handles))
}

/// The front no wider than the box says: neighbours of one depth show one front.
fn within_box(front: Front, bounds: &OrientedBox, world_from_base: &Pose) -> Front {
    /// Boxes of the map are off by so much where they are well seen, metres.
    const OFF_M: f64 = 0.03;
    let right = world_from_base.rotation * front.right();
    let point = world_from_base * front.point;
    let sides = bounds.corners().map(|corner| (corner - point).dot(&right));
    let (left_m, right_m) = sides.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    let (left_m, right_m) = (front.right_m.0.max(left_m - OFF_M), front.right_m.1.min(right_m + OFF_M));
    Front { right_m: (left_m, right_m), ..front }
}

/// The handle of the part that is meant; `None` when no handle is of that kind. Handles come from the top, those of one
/// height from left to right.
pub(super) fn choose_handle(handles: &[Handle], part: Part) -> Option<Handle> {
    // Bars of drawers lie, those of doors stand.
    let fits = |handle: &&Handle| match part.kind {
        Some(PartKind::Drawer) => !handle.is_upright(),
        Some(PartKind::Door) => handle.is_upright(),
        None => true,
    };
    let fitting: Vec<&Handle> = handles.iter().filter(fits).collect();
    let right = fitting.first()?.normal;
    let right = Vector3::z().cross(&right);
    let right_m = |handle: &&&Handle| handle.center.coords.dot(&right);
    let chosen = match part.place {
        None | Some(PartPlace::Top) => fitting.first(),
        Some(PartPlace::Bottom) => fitting.last(),
        Some(PartPlace::Middle) => fitting.get(fitting.len() / 2),
        Some(PartPlace::FromTop(n)) => fitting.get(usize::from(n)),
        Some(PartPlace::Left) => fitting.iter().min_by(|a, b| right_m(a).total_cmp(&right_m(b))),
        Some(PartPlace::Right) => fitting.iter().max_by(|a, b| right_m(a).total_cmp(&right_m(b))),
    };
    chosen.map(|handle| **handle)
}

/// The hinge of the door that an upright handle belongs to (a point on it, in the frame of the front) and the sense in which
/// it opens: 1 for to the left, seen from above. A handle sits at the free edge: of two side by side each opens to its own
/// side, and one alone is hinged at the farther edge of the front. `None` for the handle of a drawer.
pub(super) fn find_hinge(front: &Front, handles: &[Handle], handle: &Handle) -> Option<(Point2<f64>, f64)> {
    /// Handles of two doors that meet are no farther apart, metres.
    const PAIR_M: f64 = 0.2;
    if !handle.is_upright() {
        return None;
    }
    let right = front.right();
    let right_m = |handle: &Handle| (handle.center - front.point).dot(&right);
    let at_m = right_m(handle);
    let partner =
        handles.iter().filter(|other| other.is_upright() && (other.center.z - handle.center.z).abs() < PAIR_M);
    let partner = partner.map(|other| right_m(other) - at_m).find(|off_m| off_m.abs() > 0.02 && off_m.abs() < PAIR_M);
    let (left_m, edge_m) = front.right_m;
    let is_left = match partner {
        // The other one is to its right: it is the left door, hinged at the left.
        Some(off_m) => off_m > 0.0,
        None => at_m - left_m > edge_m - at_m,
    };
    let hinge_m = if is_left { left_m } else { edge_m };
    let at = front.point + right * hinge_m;
    // Hinged at the left it opens towards the viewer and to the left: clockwise, seen from above.
    Some((at.xy(), if is_left { -1.0 } else { 1.0 }))
}

/// A handle and, for a door, its hinge and the sense in which it opens. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grabbed {
    /// The handle.
    pub handle: Handle,
    /// A point on the hinge, and 1 for a door that opens to the left, seen from above, else -1.
    pub hinge: Option<(Point2<f64>, f64)>,
}

/// The handle in another frame.
pub(super) fn moved(handle: &Handle, to_from: &Pose) -> Handle {
    Handle {
        center: to_from * handle.center,
        along: to_from * handle.along,
        normal: to_from * handle.normal,
        ..*handle
    }
}

#[cfg(test)]
mod tests {
    //! Contract: words pick the handle that a viewer means; sides of a box face outwards.
    use super::*;
    use nalgebra::UnitQuaternion;

    fn handle(y: f64, z: f64, upright: bool) -> Handle {
        let along = if upright { Vector3::z() } else { Vector3::y() };
        let center = Point3::new(1.0, y, z);
        Handle { center, along, length_m: 0.12, thick_m: 0.015, off_m: 0.04, normal: -Vector3::x() }
    }

    #[test]
    fn words_pick_handles() {
        // Seen along +x, +y is to the left: two doors under a row of drawers.
        let all = [
            handle(0.0, 0.8, false),
            handle(0.0, 0.6, false),
            handle(0.0, 0.4, false),
            handle(0.05, 0.2, true),
            handle(-0.05, 0.2, true),
        ];
        let pick = |kind, place| choose_handle(&all, Part { kind, place });
        assert_eq!(pick(Some(PartKind::Drawer), Some(PartPlace::Bottom)), Some(all[2]));
        assert_eq!(pick(Some(PartKind::Drawer), Some(PartPlace::FromTop(1))), Some(all[1]));
        assert_eq!(pick(Some(PartKind::Drawer), Some(PartPlace::Middle)), Some(all[1]));
        assert_eq!(pick(Some(PartKind::Door), Some(PartPlace::Left)), Some(all[3]));
        assert_eq!(pick(Some(PartKind::Door), Some(PartPlace::Right)), Some(all[4]));
        assert_eq!(pick(None, None), Some(all[0]));
        assert_eq!(choose_handle(&all[..3], Part { kind: Some(PartKind::Door), place: None }), None);
        assert_eq!(pick(Some(PartKind::Drawer), Some(PartPlace::FromTop(4))), None);
    }

    #[test]
    fn handles_sit_at_the_free_edges_of_doors() {
        // Seen along +x, +y is to the left.
        let front = Front {
            point: Point3::new(1.04, 0.0, 0.5),
            normal: -Vector3::x(),
            right_m: (-0.4, 0.4),
            height_m: (0.0, 1.0),
        };
        let pair = [handle(0.045, 0.5, true), handle(-0.045, 0.5, true)];
        let (at, sense) = find_hinge(&front, &pair, &pair[0]).unwrap();
        assert!((at.y - 0.4).abs() < 1e-9 && sense == -1.0, "{at}");
        let (at, sense) = find_hinge(&front, &pair, &pair[1]).unwrap();
        assert!((at.y + 0.4).abs() < 1e-9 && sense == 1.0, "{at}");
        // A fridge: one door over the other, both hinged at the left.
        let fridge = [handle(-0.35, 1.1, true), handle(-0.35, 0.4, true)];
        assert!(fridge.iter().all(|h| find_hinge(&front, &fridge, h).is_some_and(|(at, s)| at.y > 0.3 && s == -1.0)));
        assert_eq!(find_hinge(&front, &pair, &handle(0.0, 0.8, false)), None);
    }

    #[test]
    fn sides_face_outwards() {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.3);
        let bounds = OrientedBox { center: Point3::new(1.0, 2.0, 0.4), size: Vector3::new(0.4, 0.9, 0.8), rotation };
        for side in sides_of(&bounds) {
            let out = side.middle - bounds.center.xy();
            assert!((out.normalize() - side.normal.xy()).norm() < 1e-9);
            assert!((2.0 * out.norm() - side.depth_m).abs() < 1e-9);
        }
    }
}
