//! What of a piece of furniture stands open, by its shape: fronts that stand out of the others, and boards that lean out.

use super::fronts::{Side, choose_handle};
use dsm::Pose;
use dsm::ground::{Part, PartKind, PartPlace};
use dsm_robot::grasp::{Front, Handle, find_front, find_handles};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::collections::BTreeSet;

/// What stands out less is closed, metres: tops overhang, and depth is off.
pub(super) const CLOSED_M: f64 = 0.045;
/// Planes of one side are so many at most.
const MOST_PLANES: usize = 6;
/// Points this near to a plane belong to it, metres.
const PLANE_M: f64 = 0.012;
/// Boards lean out by these angles when they count as open doors, radians.
const LEANS_RAD: (f64, f64) = (0.2, 1.37);
/// Directions in which leaning boards are looked for, degrees: each finds what is turned by up to 14 more.
const LEANS_DEG: [f64; 6] = [25.0, -25.0, 45.0, -45.0, 65.0, -65.0];
/// Width and least height of a door, metres.
const DOOR_M: ((f64, f64), f64) = ((0.18, 0.8), 0.2);
/// Points lie on so much of the area of a board at least.
const LEAST_SEEN: f64 = 0.5;
/// A door is pushed so far inside of its edge, metres: beside its handle ...
const INSIDE_M: f64 = 0.12;
/// ... but not nearer to its hinge than this share of its width, and at heights between these, metres.
const LEAST_SHARE: f64 = 0.55;
const HEIGHT_M: (f64, f64) = (0.4, 0.95);

/// A door or drawer that stands open, and how it is pushed to. Frame of the points that it was found in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ajar {
    /// Door or drawer.
    pub kind: PartKind,
    /// Where to push.
    pub at: Point3<f64>,
    /// Which way, level, of length 1.
    pub way: Vector3<f64>,
    /// How far until it is closed, metres.
    pub way_m: f64,
}

impl Ajar {
    /// The same in another frame.
    pub(super) fn moved(&self, to_from: &Pose) -> Self {
        Self { at: to_from * self.at, way: to_from * self.way, ..*self }
    }
}

/// What a look at a side says about the part that is meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stand {
    /// It stands open.
    Open(Ajar),
    /// It is seen to be flush with the others.
    Closed,
    /// Nothing of its kind is seen.
    Unseen,
}

/// Reads from points before a side (both in one frame, z up) how the part stands. The furniture is `top_m` high.
pub(super) fn read_stand(points: &[Point3<f64>], side: &Side, top_m: f64, part: Part) -> Stand {
    let near = of_side(points, side, top_m);
    let planes = find_planes(&near, &side.normal);
    // The largest of them shows how the furniture really faces.
    let normal = planes.first().map_or(side.normal, |plane| plane.normal);
    let drawers = || read_drawers(&near, &planes, (side, top_m), part);
    let doors = || read_doors(&near, &planes, (&normal, side), part);
    match part.kind {
        Some(PartKind::Drawer) => drawers(),
        Some(PartKind::Door) => doors(),
        None => match doors() {
            Stand::Open(door) => Stand::Open(door),
            _ => drawers(),
        },
    }
}

/// Points that may be of the side or stand out of it.
fn of_side(points: &[Point3<f64>], side: &Side, top_m: f64) -> Vec<Point3<f64>> {
    /// Beside, behind and before the side as the map has it, metres: the map's box may hold what stands open, or not.
    const ASIDE_M: f64 = 0.2;
    const BEHIND_M: f64 = 0.55;
    const BEFORE_M: f64 = 0.65;
    const LOWEST_M: f64 = 0.08;
    let right = Vector3::z().cross(&side.normal);
    let middle = Vector3::new(side.middle.x, side.middle.y, 0.0);
    let belongs = |p: &&Point3<f64>| {
        let off = p.coords - middle;
        let out_m = off.dot(&side.normal);
        off.dot(&right).abs() < side.half_m + ASIDE_M
            && out_m > -BEHIND_M.min(side.depth_m)
            && out_m < BEFORE_M
            && p.z > LOWEST_M
            && p.z < top_m + 0.03
    };
    points.iter().filter(belongs).copied().collect()
}

/// The planes that face `towards`, the largest first.
fn find_planes(points: &[Point3<f64>], towards: &Vector3<f64>) -> Vec<Front> {
    let mut left = points.to_vec();
    let mut planes = Vec::new();
    for _ in 0..MOST_PLANES {
        let Some(plane) = find_front(&left, towards) else { break };
        left.retain(|p| !is_of(p, &plane));
        // A board that leans out is found where it is cut aslant.
        if plane.normal.angle(towards) < LEANS_RAD.0 {
            planes.push(plane);
        }
    }
    planes
}

fn is_of(p: &Point3<f64>, plane: &Front) -> bool {
    const BORDER_M: f64 = 0.02;
    let right_m = (p - plane.point).dot(&plane.right());
    let within = |value: f64, (low, high): (f64, f64)| value > low - BORDER_M && value < high + BORDER_M;
    plane.off_m(p).abs() < PLANE_M && within(right_m, plane.right_m) && within(p.z, plane.height_m)
}

/// How deep the closed front lies along a normal: by the front edge of the top, as far as no front reaches up to it, and the
/// largest front that is near that; else by the rearmost plane.
fn closed_depth_m(
    points: &[Point3<f64>],
    planes: &[Front],
    normal: &Vector3<f64>,
    (side, top_m): (&Side, f64),
) -> Option<f64> {
    /// The top is seen when so many points are of it.
    const LEAST_POINTS: usize = 150;
    const LEVEL_M: f64 = 0.025;
    /// ... and so far inside of the ends of the side, metres.
    const INSET_M: f64 = 0.03;
    const EDGE: f64 = 0.97;
    /// A front has its upper edge in the top's height and is so thick, metres.
    const THICK_M: f64 = 0.03;
    /// Closed fronts lie so far behind and before the edge at most, metres.
    const ABOUT_M: (f64, f64) = (0.03, 0.06);
    let is_edge = |p: &Point3<f64>| planes.iter().any(|plane| (-THICK_M..THICK_M).contains(&plane.off_m(p)));
    // What stands beside it has no part in it.
    let right = Vector3::z().cross(normal);
    let aside_m = |p: &Point3<f64>| (p.xy() - side.middle).dot(&right.xy()).abs();
    let is_top = |p: &&Point3<f64>| (p.z - top_m).abs() < LEVEL_M && aside_m(p) < side.half_m - INSET_M && !is_edge(p);
    let top = points.iter().filter(is_top);
    let mut top: Vec<f64> = top.map(|p| p.coords.dot(normal)).collect();
    top.sort_by(f64::total_cmp);
    let depth_m = |plane: &Front| plane.point.coords.dot(normal);
    if top.len() >= LEAST_POINTS {
        let edge_m = *top.get((EDGE * top.len() as f64) as usize)?;
        // The largest of them: they come in this order.
        let mut near = planes.iter().map(depth_m).filter(|at_m| (-ABOUT_M.0..ABOUT_M.1).contains(&(at_m - edge_m)));
        return Some(near.next().unwrap_or(edge_m));
    }
    planes.iter().map(depth_m).min_by(f64::total_cmp)
}

/// Where the rearmost fronts of two rows (depth and height of each) lie alike: drawers are hardly ever open by the same, and
/// what is seen of the top may be little, or things on it.
fn agreed_depth_m(mut fronts: Vec<(f64, f64)>) -> Option<f64> {
    const ALIKE_M: f64 = 0.015;
    const ROW_M: f64 = 0.08;
    fronts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let alike = |a: &(f64, f64), b: &(f64, f64)| b.0 - a.0 < ALIKE_M && (b.1 - a.1).abs() > ROW_M;
    let pairs = fronts.iter().enumerate().flat_map(|(i, a)| fronts[i + 1..].iter().map(move |b| (a, b)));
    pairs.into_iter().find(|(a, b)| alike(a, b)).map(|(a, b)| 0.5 * (a.0 + b.0))
}

fn read_drawers(points: &[Point3<f64>], planes: &[Front], (side, top_m): (&Side, f64), part: Part) -> Stand {
    let Some(normal) = planes.first().map(|plane| plane.normal) else { return Stand::Unseen };
    let Some(mut closed_m) = closed_depth_m(points, planes, &normal, (side, top_m)) else { return Stand::Unseen };
    let handles = planes.iter().flat_map(|plane| find_handles(points, plane)).filter(|bar| !bar.is_upright());
    let fronts = handles.map(|bar| (bar.center.coords.dot(&normal) - bar.off_m, bar.center.z));
    if let Some(agreed_m) = agreed_depth_m(fronts.collect()) {
        closed_m = agreed_m;
    }
    let out_m = |bar: &Handle| bar.center.coords.dot(&normal) - bar.off_m - closed_m;
    let mut bars: Vec<Handle> = Vec::new();
    for plane in planes {
        let found = find_handles(points, plane).into_iter().filter(|bar| !bar.is_upright());
        let is_new = |bar: &Handle, bars: &[Handle]| bars.iter().all(|known| (known.center - bar.center).norm() > 0.05);
        let mut new: Vec<Handle> = found.filter(|bar| is_new(bar, &bars)).collect();
        // A front that stands out is one, whether its handle is seen or not: it is pushed at its middle.
        if new.is_empty() && plane.point.coords.dot(&normal) - closed_m > CLOSED_M {
            let (along, off_m) = (plane.right(), 0.0);
            let bar = Handle { center: plane.point, along, length_m: 0.1, thick_m: 0.0, off_m, normal: plane.normal };
            // A piece of a front whose handle was found is no other one.
            let beside = bars.iter().any(|known| (known.center.z - bar.center.z).abs() < 0.1);
            new.extend((!beside).then_some(bar));
        }
        bars.extend(new);
    }
    bars.sort_by(|a, b| b.center.z.total_cmp(&a.center.z));
    let told: Vec<String> =
        bars.iter().map(|bar| format!("{:.2} m high out by {:.3}", bar.center.z, out_m(bar))).collect();
    tracing::debug!("{} planes; handles: {}", planes.len(), told.join(", "));
    let open: Vec<Handle> = bars.iter().filter(|bar| out_m(bar) > CLOSED_M).copied().collect();
    // Words that say no place mean the one that stands open.
    let named = choose_handle(&bars, part).filter(|_| part.place.is_some());
    let farthest = open.iter().max_by(|a, b| out_m(a).total_cmp(&out_m(b))).copied();
    match named.filter(|bar| open.contains(bar)).or(farthest.filter(|_| named.is_none())) {
        Some(bar) => {
            let at = bar.center + bar.normal * (0.5 * bar.thick_m);
            Stand::Open(Ajar { kind: PartKind::Drawer, at, way: -normal, way_m: out_m(&bar) })
        }
        None if bars.is_empty() => Stand::Unseen,
        None => Stand::Closed,
    }
}

fn read_doors(points: &[Point3<f64>], planes: &[Front], (normal, side): (&Vector3<f64>, &Side), part: Part) -> Stand {
    let left: Vec<Point3<f64>> =
        points.iter().filter(|p| !planes.iter().any(|plane| is_of(p, plane))).copied().collect();
    let turned = |degrees: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians()) * normal;
    let boards = LEANS_DEG.iter().filter_map(|degrees| find_front(&left, &turned(*degrees)));
    let boards = boards.filter(|board| share_seen(&left, board) > LEAST_SEEN);
    let leaning: Vec<(Leaning, f64)> = boards.filter_map(|board| leaning_of(&board, normal, side)).collect();
    let fits = |door: &&(Leaning, f64)| match part.place {
        Some(PartPlace::Left) => door.0.is_left,
        Some(PartPlace::Right) => !door.0.is_left,
        _ => true,
    };
    // The largest: one door may be found from two directions.
    match leaning.iter().filter(fits).max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((door, _)) => Stand::Open(door.ajar),
        None => {
            let upright = |plane: &Front| find_handles(points, plane).iter().any(Handle::is_upright);
            if planes.iter().any(upright) { Stand::Closed } else { Stand::Unseen }
        }
    }
}

/// A board that leans out of a front.
#[derive(Clone, Copy, Debug)]
struct Leaning {
    ajar: Ajar,
    /// Its hinge is at the left, seen from before.
    is_left: bool,
}

/// Share of a board's area that points lie on: a plane laid across other things is mostly empty.
fn share_seen(points: &[Point3<f64>], board: &Front) -> f64 {
    const CELL_M: f64 = 0.02;
    let right = board.right();
    let cell = |value_m: f64| (value_m / CELL_M).floor() as i64;
    let on_it = points.iter().filter(|p| is_of(p, board));
    let cells: BTreeSet<(i64, i64)> = on_it.map(|p| (cell((p - board.point).dot(&right)), cell(p.z))).collect();
    let area = |(low, high): (f64, f64)| (high - low) / CELL_M;
    cells.len() as f64 / (area(board.right_m) * area(board.height_m)).max(1.0)
}

/// A board as a door of a side that stands open, with its area; `None` when it is none.
fn leaning_of(board: &Front, normal: &Vector3<f64>, side: &Side) -> Option<(Leaning, f64)> {
    /// A door ends so far beside its side at most, metres: boxes of the map are off.
    const BESIDE_M: f64 = 0.1;
    let right = Vector3::z().cross(normal);
    let ends = [board.right_m.0, board.right_m.1].map(|by| board.point + board.right() * by);
    let depth_m = ends.map(|end| end.coords.dot(normal));
    let (hinge, edge) = if depth_m[0] < depth_m[1] { (ends[0], ends[1]) } else { (ends[1], ends[0]) };
    let (along, high_m) = (edge - hinge, board.height_m.1 - board.height_m.0);
    let width_m = along.norm();
    let lean_rad = along.dot(normal).atan2(along.dot(&right).abs());
    let is_door = (DOOR_M.0.0..=DOOR_M.0.1).contains(&width_m)
        && high_m > DOOR_M.1
        && (LEANS_RAD.0..=LEANS_RAD.1).contains(&lean_rad);
    let to_edge = along.dot(&right).signum();
    let aside_m = |p: &Point3<f64>| (p.xy() - side.middle).dot(&right.xy()).abs();
    let closed_edge = hinge + right * (to_edge * width_m);
    let is_of_side = [hinge, closed_edge].iter().all(|end| aside_m(end) < side.half_m + BESIDE_M);
    tracing::debug!(
        "a board of {width_m:.2} by {high_m:.2} m, leaning by {lean_rad:.2} rad, hinge at {hinge:.2}: door {is_door}, of \
         this side {is_of_side}"
    );
    if !is_door || !is_of_side {
        return None;
    }
    let radius_m = (width_m - INSIDE_M).max(LEAST_SHARE * width_m);
    let height_m = (0.5 * (board.height_m.0 + board.height_m.1)).clamp(HEIGHT_M.0, HEIGHT_M.1);
    let level = |p: Point3<f64>| Point3::new(p.x, p.y, height_m);
    let at = level(hinge + along * (radius_m / width_m));
    let closed = level(hinge + right * (to_edge * radius_m));
    let way_m = (closed - at).norm();
    let way = (closed - at) / way_m.max(1e-9);
    let ajar = Ajar { kind: PartKind::Door, at, way, way_m };
    Some((Leaning { ajar, is_left: to_edge > 0.0 }, width_m * high_m))
}

#[cfg(test)]
mod tests {
    //! Contract: a drawer that stands out is pushed at its handle, straight back; a door that leans out is pushed beside its
    //! edge along the chord of its arc; what is flush is closed.
    use super::*;
    use nalgebra::Point2;

    /// Points of an upright board of a width and height about a middle, facing along its normal.
    fn board(middle: [f64; 3], along: Vector3<f64>, size_m: (f64, f64)) -> Vec<Point3<f64>> {
        let steps = |length_m: f64| (0..=(length_m / 0.005) as i32).map(move |i| f64::from(i) * 0.005 - 0.5 * length_m);
        let middle = Point3::from(middle);
        steps(size_m.0).flat_map(|u| steps(size_m.1).map(move |v| middle + along * u + Vector3::z() * v)).collect()
    }

    /// A dresser whose front is at x = 1, seen from the origin; two drawers, the lower one out by `out_m`.
    fn dresser(out_m: f64) -> Vec<Point3<f64>> {
        let mut points = Vec::new();
        for (z, out_m) in [(0.65, 0.0), (0.35, out_m)] {
            points.extend(board([1.0 - out_m, 0.0, z], Vector3::y(), (0.7, 0.28)));
            points.extend(board([0.955 - out_m, 0.0, z], Vector3::y(), (0.13, 0.014)));
        }
        let top =
            (0..60).flat_map(|i| (0..140).map(move |k| [1.0 + 0.005 * f64::from(i), 0.005 * f64::from(k) - 0.35]));
        points.extend(top.map(|[x, y]| Point3::new(x, y, 0.82)));
        points
    }

    fn side() -> Side {
        Side { middle: Point2::new(1.0, 0.0), normal: -Vector3::x(), half_m: 0.36, depth_m: 0.45 }
    }

    #[test]
    fn two_rows_that_lie_alike_are_closed() {
        let fronts = vec![(1.0, 0.2), (1.005, 0.5), (1.2, 0.7)];
        assert!(agreed_depth_m(fronts).is_some_and(|depth_m| (depth_m - 1.0025).abs() < 1e-9));
        assert_eq!(
            agreed_depth_m(vec![(1.0, 0.2), (1.3, 0.5), (1.31, 0.52)]),
            None,
            "one row, and two handles of another"
        );
    }

    fn drawer(place: Option<PartPlace>) -> Part {
        Part { kind: Some(PartKind::Drawer), place }
    }

    #[test]
    fn a_drawer_that_stands_out_is_open() {
        for place in [None, Some(PartPlace::Bottom)] {
            let Stand::Open(ajar) = read_stand(&dresser(0.3), &side(), 0.82, drawer(place)) else {
                panic!("{place:?}")
            };
            assert!((ajar.at - Point3::new(0.65, 0.0, 0.35)).norm() < 0.03, "{ajar:?}");
            assert!((ajar.way - Vector3::x()).norm() < 0.05 && (ajar.way_m - 0.3).abs() < 0.03, "{ajar:?}");
        }
        assert_eq!(read_stand(&dresser(0.3), &side(), 0.82, drawer(Some(PartPlace::Top))), Stand::Closed);
        assert_eq!(read_stand(&dresser(0.0), &side(), 0.82, drawer(None)), Stand::Closed);
        assert_eq!(read_stand(&[], &side(), 0.82, drawer(None)), Stand::Unseen);
    }

    #[test]
    fn a_door_that_leans_out_is_pushed_along_its_chord() {
        // Seen along +x, +y is to the left: a door hinged at the left, open by 40 degrees.
        let lean_rad = 40_f64.to_radians();
        let along = Vector3::new(-lean_rad.sin(), -lean_rad.cos(), 0.0);
        let hinge = Vector3::new(1.0, 0.35, 0.0);
        let middle = hinge + along * 0.2;
        let mut points = board([middle.x, middle.y, 0.6], along, (0.4, 0.9));
        points.extend(board([1.0, -0.17, 0.6], Vector3::y(), (0.34, 0.9)));
        let part = |place| Part { kind: Some(PartKind::Door), place };
        let Stand::Open(ajar) = read_stand(&points, &side(), 1.8, part(Some(PartPlace::Left))) else { panic!("open") };
        let at = hinge + along * 0.28;
        assert!((ajar.at.coords.xy() - at.xy()).norm() < 0.03, "{ajar:?}");
        let closed = hinge - Vector3::y() * 0.28;
        assert!((ajar.way - (closed - at).normalize()).norm() < 0.08, "{ajar:?}");
        assert!((ajar.way_m - 2.0 * 0.28 * (0.5 * lean_rad).sin()).abs() < 0.03, "{ajar:?}");
        assert!(!matches!(read_stand(&points, &side(), 1.8, part(Some(PartPlace::Right))), Stand::Open(_)));
    }
}
