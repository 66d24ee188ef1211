//! Whether something can be seen from a standing place.

use super::costmap::Costmap;
use dsm::geometry::{Aabb, OrientedBox};
use dsm::map::{CellState, Map, MapObject, MapPoint, ObjectId};
use nalgebra::{Point2, Point3};

/// What stands between a camera and a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// Nothing known.
    Clear,
    /// A known object.
    BehindObject(ObjectId),
    /// Something tall that is no object of the map: a wall.
    BehindWall,
}

/// Answers questions of sight on a map: known objects hide what lies behind their points, occupied floor that no object
/// explains is a wall. Unknown space hides nothing.
pub struct Sight<'a> {
    costmap: &'a Costmap,
    objects: Vec<Occluder<'a>>,
    /// It hides nothing of itself, and stands in cells of its own.
    target: (OrientedBox, Aabb),
}

struct Occluder<'a> {
    id: ObjectId,
    bounds: OrientedBox,
    around: Aabb,
    points: &'a [MapPoint],
}

/// A ray that passes this near to a point of an object is taken to hit it: somewhat more than half the spacing of points.
const HIT_RADIUS_M: f64 = 0.025;
/// How far beyond its box an object explains occupied cells: a cell's half diagonal and the noise of depth. Any more, and
/// furniture against a wall explains the wall.
const EXPLAINED_MARGIN_M: f64 = 0.05;

impl<'a> Sight<'a> {
    /// Sight among the stable objects of `map`, without those that are the target itself (either centre in the other box, of comparable volume).
    pub fn among(map: &'a Map, costmap: &'a Costmap, target: &OrientedBox) -> Self {
        let occluder = |object: &'a MapObject| Occluder {
            id: object.id,
            bounds: object.bounds,
            around: object.bounds.aabb().grown(HIT_RADIUS_M),
            points: &object.points,
        };
        let objects = map.stable_objects().filter(|o| !is_same(&o.bounds, target)).map(occluder).collect();
        Self { costmap, objects, target: (*target, target.aabb().grown(HIT_RADIUS_M)) }
    }

    /// What stands between a camera and a point of a target, both in the world frame. Things nearer to the point than
    /// `ignored_m` do not count.
    pub fn check(&self, camera: &Point3<f64>, point: &Point3<f64>, ignored_m: f64) -> Visibility {
        let length = (point - camera).norm();
        let reach = (length - ignored_m).max(0.0);
        if self.is_behind_wall(camera, point, reach) {
            return Visibility::BehindWall;
        }
        let direction = (point - camera) / length.max(1e-9);
        for occluder in &self.objects {
            if !crosses(&occluder.around, camera, point) {
                continue;
            }
            let hits = occluder.points.iter().filter(|p| {
                let offset = p.position.cast::<f64>() - camera;
                let along = offset.dot(&direction);
                along > 0.05 && along < reach && (offset - direction * along).norm_squared() < HIT_RADIUS_M.powi(2)
            });
            if hits.take(2).count() == 2 {
                return Visibility::BehindObject(occluder.id);
            }
        }
        Visibility::Clear
    }

    fn is_behind_wall(&self, camera: &Point3<f64>, point: &Point3<f64>, reach_m: f64) -> bool {
        const WALL_NEAR_TARGET_M: f64 = 0.15;
        let (from, to) = (Point2::new(camera.x, camera.y), Point2::new(point.x, point.y));
        let floor_length = (to - from).norm();
        // What is that near along the ray is nearer along the floor.
        let reach_m = reach_m * floor_length / (point - camera).norm().max(1e-9);
        let reach = (floor_length - WALL_NEAR_TARGET_M).min(reach_m);
        let yaw = super::grid::bearing(&from, &to);
        self.costmap.grid().ray(from, yaw, reach.max(0.0)).any(|(cell, distance)| {
            self.costmap.state(cell) == CellState::Occupied && {
                let at = self.costmap.grid().center_of(cell);
                let height = camera.z + (point.z - camera.z) * distance / floor_length.max(1e-9);
                !self.is_explained(&Point3::new(at.x, at.y, height))
            }
        })
    }

    /// Whether a ray that crosses an occupied cell at `point` passes through or over an object that stands there. What
    /// hangs above the ray says nothing about what stands below it.
    fn is_explained(&self, point: &Point3<f64>) -> bool {
        let target = (&self.target.0, &self.target.1);
        self.objects.iter().map(|o| (&o.bounds, &o.around)).chain([target]).any(|(bounds, around)| {
            let level = Point3::new(point.x, point.y, bounds.center.z);
            around.min.z <= point.z
                && around.grown(EXPLAINED_MARGIN_M).contains(&level)
                && bounds.contains(&level, EXPLAINED_MARGIN_M)
        })
    }
}

/// Whether a box of the map is the target box: either centre in the other box, of comparable volume.
pub(crate) fn is_same(bounds: &OrientedBox, target: &OrientedBox) -> bool {
    let ratio = (bounds.volume_m3() + 1e-6) / (target.volume_m3() + 1e-6);
    (0.33..3.0).contains(&ratio) && bounds.contains(&target.center, 0.01) && target.contains(&bounds.center, 0.01)
}

/// Whether a segment meets an axis-aligned box (slab test).
fn crosses(bounds: &Aabb, from: &Point3<f64>, to: &Point3<f64>) -> bool {
    let direction = to - from;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        if direction[axis].abs() < 1e-12 {
            if from[axis] < bounds.min[axis] || from[axis] > bounds.max[axis] {
                return false;
            }
            continue;
        }
        let a = (bounds.min[axis] - from[axis]) / direction[axis];
        let b = (bounds.max[axis] - from[axis]) / direction[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave
}

#[cfg(test)]
pub(crate) mod tests {
    //! Contract: walls and the points of other objects hide; furniture lower than the line of sight, the target itself
    //! and the open front of a shelf do not.
    use super::*;
    use crate::nav::CostmapConfig;
    use dsm::map::{Attributes, FreeSpace, MapChange, MapUpdate, ObjectState, Votes};
    use dsm::time::Stamp;
    use nalgebra::{UnitQuaternion, Vector3};

    /// Two rooms of 4 x 4 m side by side, joined by a door of 0.8 m at (4, 2).
    pub(crate) fn room_grid() -> FreeSpace {
        let mut grid = FreeSpace::new(0.05);
        for column in 0..=160 {
            for row in 0..=80 {
                let wall = column == 0 || column == 160 || row == 0 || row == 80;
                let divider = column == 80 && !(32..48).contains(&row);
                grid.set([column, row], if wall || divider { CellState::Occupied } else { CellState::Free });
            }
        }
        grid
    }

    /// A box-shaped stable object whose given faces (0..6: -x, +x, -y, +y, -z, +z) carry points every 2.5 cm.
    pub(crate) fn boxed(id: u64, center: [f64; 3], size: [f64; 3], faces: &[usize]) -> MapObject {
        let center = Point3::from(center);
        let size = Vector3::from(size);
        let mut points = Vec::new();
        for &face in faces {
            let axis = face / 2;
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let count = |side: usize| (size[side] / 0.025).ceil() as usize;
            for i in 0..=count(u) {
                for j in 0..=count(v) {
                    let mut offset = Vector3::zeros();
                    offset[axis] = if face % 2 == 0 { -0.5 } else { 0.5 } * size[axis];
                    offset[u] = (i as f64 / count(u) as f64 - 0.5) * size[u];
                    offset[v] = (j as f64 / count(v) as f64 - 0.5) * size[v];
                    points.push(MapPoint { position: (center + offset).cast(), color: [128; 3] });
                }
            }
        }
        MapObject {
            id: ObjectId(id),
            state: ObjectState::Stable,
            names: Votes::default(),
            points,
            bounds: OrientedBox { center, size, rotation: UnitQuaternion::identity() },
            attributes: Attributes::default(),
            visual_feature: Vec::new(),
            provenance: Default::default(),
            text_feature: Vec::new(),
            room: None,
            observations: 10,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        }
    }

    /// A map with the given floor and objects; the floor under each object taller than 5 cm that stands on it is occupied.
    pub(crate) fn map_of(mut free_space: FreeSpace, objects: Vec<MapObject>) -> Map {
        for object in &objects {
            let bounds = object.bounds.aabb();
            if bounds.min.z < 0.3 {
                let low = free_space.cell_at(&Point2::new(bounds.min.x, bounds.min.y));
                let high = free_space.cell_at(&Point2::new(bounds.max.x, bounds.max.y));
                for column in low[0]..=high[0] {
                    for row in low[1]..=high[1] {
                        free_space.set([column, row], CellState::Occupied);
                    }
                }
            }
        }
        let mut map = Map::new(free_space.resolution_m);
        map.free_space = free_space;
        let changes = objects.into_iter().map(|o| MapChange::Put(Box::new(o))).collect();
        map.apply(MapUpdate { stamp: Stamp::default(), changes });
        map
    }

    #[test]
    fn walls_and_points_hide() {
        let table = boxed(1, [2.0, 2.0, 0.35], [1.0, 0.6, 0.7], &[0, 1, 2, 3, 5]);
        let apple = boxed(2, [2.0, 2.0, 0.74], [0.08; 3], &[0, 1, 2, 3, 5]);
        let cupboard = boxed(3, [2.0, 3.2, 0.9], [1.0, 0.4, 1.8], &[0, 1, 2, 3]);
        let map = map_of(room_grid(), vec![table, apple.clone(), cupboard]);
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let sight = Sight::among(&map, &costmap, &apple.bounds);
        let look = |x: f64, y: f64| sight.check(&Point3::new(x, y, 1.25), &apple.bounds.center, 0.07);
        assert_eq!(look(1.0, 2.0), Visibility::Clear, "over the edge of the table");
        assert_eq!(look(2.0, 3.7), Visibility::BehindObject(ObjectId(3)));
        assert_eq!(look(6.0, 2.0), Visibility::Clear, "through the door");
        assert_eq!(look(6.0, 1.0), Visibility::BehindWall);
    }

    #[test]
    fn furniture_and_pictures_do_not_explain_the_wall_behind_them() {
        let dresser = boxed(1, [3.72, 1.0, 0.4], [0.44, 1.0, 0.8], &[0, 2, 3, 5]);
        let picture = boxed(2, [3.96, 1.0, 1.6], [0.04, 0.5, 0.4], &[0]);
        let book = boxed(3, [3.75, 1.0, 0.9], [0.04, 0.13, 0.19], &[0, 2, 5]);
        let map = map_of(room_grid(), vec![dresser, picture, book.clone()]);
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let sight = Sight::among(&map, &costmap, &book.bounds);
        let look = |x: f64| sight.check(&Point3::new(x, 1.0, 1.25), &book.bounds.center, 0.15);
        assert_eq!(look(3.0), Visibility::Clear);
        assert_eq!(look(4.6), Visibility::BehindWall);
    }

    #[test]
    fn low_furniture_does_not_hide_itself() {
        // Its own cells were taken for a wall: no place before a nightstand in the open would do.
        let nightstand = boxed(1, [3.6, 2.6, 0.24], [0.46, 0.43, 0.48], &[0, 2, 3, 5]);
        let map = map_of(room_grid(), vec![nightstand.clone()]);
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let target = nightstand.bounds;
        let sight = Sight::among(&map, &costmap, &target);
        let look = |x: f64, y: f64| sight.check(&Point3::new(x, y, 1.25), &target.center, 0.5 * target.size.norm());
        assert_eq!(look(2.7, 2.6), Visibility::Clear);
        assert_eq!(look(3.6, 1.6), Visibility::Clear);
        assert_eq!(look(4.6, 2.8), Visibility::BehindWall, "beside the door, the wall is a wall");
    }

    #[test]
    fn a_shelf_hides_from_behind_but_not_from_its_open_front() {
        // Open at +x; boards at 0.5 and 0.9 m; the apple lies on the lower one.
        let mut shelf = boxed(1, [0.5, 2.0, 0.9], [0.4, 1.0, 1.8], &[0, 2, 3, 5]);
        shelf.points.extend(boxed(9, [0.5, 2.0, 0.49], [0.4, 1.0, 0.02], &[5]).points);
        shelf.points.extend(boxed(9, [0.5, 2.0, 0.9], [0.4, 1.0, 0.02], &[4]).points);
        let apple = boxed(2, [0.58, 2.0, 0.54], [0.08; 3], &[0, 1, 2, 3, 5]);
        let map = map_of(room_grid(), vec![shelf, apple.clone()]);
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let sight = Sight::among(&map, &costmap, &apple.bounds);
        let look = |x: f64, y: f64, z: f64| sight.check(&Point3::new(x, y, z), &apple.bounds.center, 0.07);
        assert_eq!(look(2.0, 2.0, 1.25), Visibility::Clear);
        assert_eq!(look(0.15, 2.0, 1.25), Visibility::BehindObject(ObjectId(1)));
        assert_eq!(look(0.5, 0.8, 1.25), Visibility::BehindObject(ObjectId(1)));
        assert_eq!(look(0.9, 2.0, 1.6), Visibility::BehindObject(ObjectId(1)), "the upper board hides from above");
    }
}
