//! Doors between rooms: which of the map close a way, and how one of them opens, read from its shape.
//!
//! A leaf lies nearly flush with the wall of the room into which it opens, and deep in its doorway on the other side. So one
//! who stands before it pulls where the leaf is flush, and pushes where it lies deep. Handles sit near the free edge.

use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::map::{Map, MapObject, ObjectId};
use dsm_robot::grasp::{Front, Handle, find_front, find_handles};
use dsm_robot::nav::{Costmap, Field, Pose2};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};

/// What the map calls them.
const NAME: &str = "door";
/// Width of a leaf, its least height as far as a camera that looks down shows it, and how thick its box in the map is at
/// most, metres.
const WIDE_M: (f64, f64) = (0.5, 1.4);
const HIGH_M: f64 = 1.1;
const THICK_M: f64 = 0.45;
/// Distances from a leaf for a look, the best first, and to the side of its middle, metres.
const LOOK_M: [f64; 4] = [0.95, 1.05, 1.2, 1.35];
const ASIDE_M: [f64; 5] = [0.0, 0.15, -0.15, 0.3, -0.3];
/// Behind a closed door no floor that the base reaches is nearer than this, metres.
const BEHIND_M: [f64; 3] = [0.5, 0.7, 0.9];
/// A leaf that lies deeper than this behind the wall opens away from the viewer, metres: walls are thicker than leaves.
const DEEP_M: f64 = 0.03;
/// Walls beside a leaf are looked at so far from its edges, and lie so far before it at most, metres.
const WALL_M: (f64, f64) = (0.04, 0.3);
const WALL_BEFORE_M: (f64, f64) = (-0.03, 0.16);
/// So many points tell where the wall is.
const WALL_POINTS: usize = 150;
/// Heights of handles, and how far from the free edge they are at most, metres.
const HANDLE_M: (f64, f64) = (0.75, 1.3);
const FROM_EDGE_M: f64 = 0.2;

/// A door of the map with floor on one side that the base reaches, and none on the other. World frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ClosedDoor {
    /// The object.
    pub id: ObjectId,
    /// Its box.
    pub bounds: OrientedBox,
    /// Where it stands, at the floor.
    pub middle: Point2<f64>,
    /// Out of its face towards where the base can be, level, of length 1.
    pub normal: Vector3<f64>,
    /// Half of its width.
    pub half_m: f64,
    /// Where to look at it from.
    pub look_from: Pose2,
}

/// The closed doors that a base can come to, the nearest first; none near places in `tried`.
pub(super) fn find_closed_doors(map: &Map, costmap: &Costmap, field: &Field, tried: &[Point2<f64>]) -> Vec<ClosedDoor> {
    /// Two doorways are farther apart than this, metres.
    const SAME_M: f64 = 0.75;
    let is_new = |door: &ClosedDoor| tried.iter().all(|place| (place - door.middle).norm() > SAME_M);
    let doors = map.stable_objects().filter(|object| object.name() == NAME);
    let mut found: Vec<(f64, ClosedDoor)> =
        doors.filter_map(|object| closed_door(object, costmap, field)).filter(|(_, door)| is_new(door)).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
    found.into_iter().map(|(_, door)| door).collect()
}

/// An object as a closed door, and the way to where it is looked at.
fn closed_door(object: &MapObject, costmap: &Costmap, field: &Field) -> Option<(f64, ClosedDoor)> {
    let bounds = object.bounds;
    let along = usize::from(bounds.size.y > bounds.size.x);
    let (wide_m, thick_m) = (bounds.size[along], bounds.size[1 - along]);
    let is_leaf = (WIDE_M.0..=WIDE_M.1).contains(&wide_m) && thick_m <= THICK_M && bounds.top_m() >= HIGH_M;
    if !is_leaf {
        return None;
    }
    let axis = bounds.rotation * Vector3::ith(1 - along, 1.0);
    let axis = Vector3::new(axis.x, axis.y, 0.0).try_normalize(1e-6)?;
    let middle = bounds.center.xy();
    let reached = |place: &Point2<f64>| costmap.is_traversable_at(place) && field.find_length_to_m(place).is_some();
    let sides = [1.0, -1.0].map(|sign| {
        let normal = axis * sign;
        let across = Vector3::z().cross(&normal).xy();
        let behind =
            BEHIND_M.iter().flat_map(|off_m| ASIDE_M.map(|aside_m| middle - normal.xy() * *off_m + across * aside_m));
        if behind.into_iter().any(|place| reached(&place)) {
            return None;
        }
        let places =
            LOOK_M.iter().flat_map(|off_m| ASIDE_M.map(|aside_m| middle + normal.xy() * *off_m + across * aside_m));
        let place = places.into_iter().find(reached)?;
        let look_from = Pose2::facing(place, &middle);
        let door = ClosedDoor { id: object.id, bounds, middle, normal, half_m: 0.5 * wide_m, look_from };
        Some((field.find_length_to_m(&place)?, door))
    });
    sides.into_iter().flatten().next()
}

/// Which way a leaf opens for one who stands before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opens {
    /// Towards the viewer: it is pulled.
    Towards,
    /// Away: it is pushed.
    Away,
}

/// A closed leaf as it is seen. In the frame of the points that it was read from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaf {
    /// Its face.
    pub front: Front,
    /// The bar at its free edge.
    pub handle: Handle,
    /// A point on its hinges.
    pub hinge: Point2<f64>,
    /// How far the wall beside it stands out before its face, metres.
    pub deep_m: f64,
    /// Which way it opens.
    pub opens: Opens,
}

impl Leaf {
    /// The same in another frame.
    pub(super) fn moved(&self, to_from: &Pose) -> Self {
        let front = Front { point: to_from * self.front.point, normal: to_from * self.front.normal, ..self.front };
        let handle = super::fronts::moved(&self.handle, to_from);
        let hinge = (to_from * Point3::new(self.hinge.x, self.hinge.y, 0.0)).xy();
        Self { front, handle, hinge, ..*self }
    }

    /// The box through which it goes when it is opened: the square that its quarter disc fills, and its handles on both sides.
    pub(super) fn swept(&self, opens: Opens) -> OrientedBox {
        const ABOUT_M: f64 = 0.12;
        const HIGH_M: f64 = 2.0;
        let along = (self.handle.center.xy() - self.hinge).normalize();
        let to = match opens {
            Opens::Towards => self.front.normal.xy(),
            Opens::Away => -self.front.normal.xy(),
        };
        let side_m = self.front.right_m.1 - self.front.right_m.0 + 2.0 * ABOUT_M;
        let center = self.hinge + (along + to) * (0.5 * side_m - ABOUT_M);
        OrientedBox {
            center: Point3::new(center.x, center.y, 0.5 * HIGH_M),
            size: Vector3::new(side_m, side_m, HIGH_M),
            rotation: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), along.y.atan2(along.x)),
        }
    }

    /// The middle between its edges, at the floor.
    pub(super) fn middle(&self) -> Point2<f64> {
        let (left_m, right_m) = self.front.right_m;
        (self.front.point + self.front.right() * (0.5 * (left_m + right_m))).xy()
    }
}

/// Reads a leaf from points before it: about `middle`, facing along `normal`, half as wide as `half_m` (all in the frame of the
/// points, z up). Or what is missing.
pub(super) fn read_leaf(
    points: &[Point3<f64>],
    middle: &Point2<f64>,
    normal: &Vector3<f64>,
    half_m: f64,
) -> Result<Leaf, String> {
    /// Before and behind the leaf as the map has it, and beside it, metres.
    const ABOUT_M: f64 = 0.25;
    const BESIDE_M: f64 = 0.45;
    const LEVELS_M: (f64, f64) = (0.08, 1.95);
    let right = Vector3::z().cross(normal);
    let at = Vector3::new(middle.x, middle.y, 0.0);
    let about = |aside_m: f64| {
        let is_near = move |p: &&Point3<f64>| {
            let off = p.coords - at;
            off.dot(&right).abs() < aside_m && off.dot(normal).abs() < ABOUT_M && p.z > LEVELS_M.0 && p.z < LEVELS_M.1
        };
        points.iter().filter(is_near).copied().collect::<Vec<Point3<f64>>>()
    };
    let near = about(half_m + BESIDE_M);
    let mut front = find_front(&about(half_m), normal).ok_or("no board is seen")?;
    // Its edges may lie beyond the map's box.
    if let Some(wider) = find_front(&about(half_m + 0.12), normal).filter(is_leaf_wide) {
        front = wider;
    }
    if !is_leaf_wide(&front) {
        return Err(format!("the board is {:.2} m wide", front.right_m.1 - front.right_m.0));
    }
    let deep_m = depth_behind_wall_m(&near, &front).ok_or("no wall is seen beside it")?;
    let side_m = |handle: &Handle| (handle.center - front.point).dot(&front.right());
    let to_edge_m = |handle: &Handle| (side_m(handle) - front.right_m.0).min(front.right_m.1 - side_m(handle));
    let is_handle = |handle: &Handle| {
        handle.is_upright()
            && (HANDLE_M.0..=HANDLE_M.1).contains(&handle.center.z)
            && (-0.02..FROM_EDGE_M).contains(&to_edge_m(handle))
    };
    let handles = find_handles(&near, &front);
    let handle = handles.into_iter().find(is_handle).ok_or("no handle is seen near an edge")?;
    let is_right = front.right_m.1 - side_m(&handle) < side_m(&handle) - front.right_m.0;
    let hinge_m = if is_right { front.right_m.0 } else { front.right_m.1 };
    let hinge = (front.point + front.right() * hinge_m).xy();
    let opens = if deep_m > DEEP_M { Opens::Away } else { Opens::Towards };
    Ok(Leaf { front, handle, hinge, deep_m, opens })
}

fn is_leaf_wide(front: &Front) -> bool {
    (WIDE_M.0..=WIDE_M.1).contains(&(front.right_m.1 - front.right_m.0))
}

/// How far the wall beside a leaf stands out before it: the median of what is seen there. `None` when too little is.
fn depth_behind_wall_m(points: &[Point3<f64>], front: &Front) -> Option<f64> {
    const LEVELS_M: (f64, f64) = (0.4, 1.7);
    let right = front.right();
    let (left_m, right_m) = front.right_m;
    let beside = |p: &&Point3<f64>| {
        let aside_m = (*p - front.point).dot(&right);
        let beyond_m = (left_m - aside_m).max(aside_m - right_m);
        let off_m = front.off_m(p);
        (WALL_M.0..WALL_M.1).contains(&beyond_m)
            && (WALL_BEFORE_M.0..WALL_BEFORE_M.1).contains(&off_m)
            && (LEVELS_M.0..LEVELS_M.1).contains(&p.z)
    };
    let mut offs: Vec<f64> = points.iter().filter(beside).map(|p| front.off_m(p)).collect();
    offs.sort_by(f64::total_cmp);
    (offs.len() >= WALL_POINTS).then(|| offs[offs.len() / 2])
}

#[cfg(test)]
mod tests {
    //! Contract: a leaf that lies deep in its doorway is pushed, one that is flush with the wall is pulled; its hinges are where
    //! its handle is not. A door with floor to drive on both sides is no closed one.
    use super::*;
    use dsm::map::{CellState, FreeSpace, MapChange, MapUpdate, Votes};
    use dsm::time::Stamp;
    use dsm_robot::nav::CostmapConfig;

    /// Points of a board that faces the origin from x, between y and z.
    fn board(x: f64, y: (f64, f64), z: (f64, f64)) -> Vec<Point3<f64>> {
        let steps =
            |(low, high): (f64, f64)| (0..=((high - low) / 0.006) as i32).map(move |i| low + 0.006 * f64::from(i));
        steps(y).flat_map(|y| steps(z).map(move |z| Point3::new(x, y, z))).collect()
    }

    /// A doorway from y = -0.4 to 0.4 in a wall at x = 1.1, its leaf so much deeper, the handle at `handle_y`.
    fn doorway(deep_m: f64, handle_y: f64) -> Vec<Point3<f64>> {
        let mut points = board(1.1 + deep_m, (-0.39, 0.39), (0.02, 1.9));
        points.extend(board(1.1, (-0.8, -0.4), (0.0, 1.9)));
        points.extend(board(1.1, (0.4, 0.8), (0.0, 1.9)));
        points.extend(board(1.1 + deep_m - 0.055, (handle_y - 0.007, handle_y + 0.007), (0.93, 1.07)));
        points
    }

    #[test]
    fn a_leaf_says_how_it_opens() {
        for (deep_m, opens) in [(0.015, Opens::Towards), (0.045, Opens::Away)] {
            for handle_y in [0.32, -0.32] {
                let points = doorway(deep_m, handle_y);
                let middle = Point2::new(1.12, 0.03);
                let leaf = read_leaf(&points, &middle, &-Vector3::x(), 0.38).expect("a leaf");
                assert_eq!(leaf.opens, opens, "{deep_m}: {leaf:?}");
                assert!((leaf.hinge.y + 0.39 * handle_y.signum()).abs() < 0.02, "{handle_y}: {leaf:?}");
                assert!((leaf.hinge.x - 1.1 - deep_m).abs() < 0.01 && (leaf.handle.center.y - handle_y).abs() < 0.01);
                assert!(leaf.middle().y.abs() < 0.02);
                let swept = leaf.swept(opens);
                let beyond_m = swept.center.x - leaf.hinge.x;
                assert!(
                    (beyond_m.abs() - 0.39).abs() < 0.03 && (beyond_m > 0.0) == (opens == Opens::Away),
                    "{swept:?}"
                );
                assert!(swept.center.y.abs() < 0.03 && (swept.size.x - 1.02).abs() < 0.03, "{swept:?}");
            }
        }
        let bare = board(1.1, (-0.8, 0.8), (0.0, 1.9));
        assert!(read_leaf(&bare, &Point2::new(1.1, 0.0), &-Vector3::x(), 0.4).is_err());
    }

    #[test]
    fn only_what_closes_a_way_is_a_closed_door() {
        // Two rooms side by side, a wall at x = 2 with a doorway at y from 1 to 1.8.
        let floor = |is_closed: bool| {
            let mut floor = FreeSpace::new(0.05);
            for (x, y) in (0..80).flat_map(|x| (0..60).map(move |y| (x, y))) {
                let rim = x == 0 || y == 0 || x == 79 || y == 59;
                let wall = (39..=40).contains(&x) && (is_closed || !(20..36).contains(&y));
                floor.set([x, y], if rim || wall { CellState::Occupied } else { CellState::Free });
            }
            floor
        };
        let mut names = Votes::default();
        names.add("door", 9.0);
        let bounds = OrientedBox {
            center: Point3::new(2.0, 1.4, 1.0),
            size: Vector3::new(0.06, 0.8, 2.0),
            rotation: UnitQuaternion::identity(),
        };
        let mut map = Map::new(0.05);
        let door = MapObject::given(ObjectId(1), names, bounds);
        map.apply(MapUpdate { stamp: Stamp::default(), changes: vec![MapChange::Put(Box::new(door))] });
        let doors = |is_closed: bool, tried: &[Point2<f64>]| {
            let costmap = Costmap::from_free_space(&floor(is_closed), &CostmapConfig::default());
            let field = Field::from_start(&costmap, &Point2::new(1.0, 1.0));
            find_closed_doors(&map, &costmap, &field, tried)
        };
        let [door] = doors(true, &[])[..] else { panic!("one") };
        assert!(door.normal.x < -0.99 && door.look_from.position.x < 1.2, "{door:?}");
        assert!(doors(false, &[]).is_empty(), "it stands open");
        assert!(doors(true, &[door.middle]).is_empty(), "it was tried");
    }
}
