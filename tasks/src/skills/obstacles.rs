//! What the arm must not touch: surfaces of the map's objects, and what stands on the floor without a name.

use dsm::Pose;
use dsm::map::{CellState, Map, ObjectId};
use dsm_robot::model::collision::Obstacle;
use nalgebra::{Point2, Point3, Vector3};
use std::collections::BTreeSet;

/// Side of the voxels that surfaces are thinned to, metres.
const VOXEL_M: f64 = 0.03;
/// Obstacles farther from the base than this are out of reach, metres.
const REACH_M: f64 = 1.25;
/// Height of what stands on the floor without a name (walls), metres.
const WALL_HEIGHT_M: f64 = 1.6;
/// Points of others this near to the target belong to it for the arm's purposes, metres: clouds are not sharp.
const TARGET_MARGIN_M: f64 = 0.012;

/// Obstacles in the base frame, without the object that is to be touched.
pub fn find_obstacles(map: &Map, world_from_base: &Pose, target: Option<ObjectId>) -> Vec<Obstacle> {
    let base = Point2::from(world_from_base.translation.vector.xy());
    let base_from_world = world_from_base.inverse();
    let target_box = target.and_then(|id| map.find_object(id)).map(|o| o.bounds);
    let mut voxels: BTreeSet<[i32; 3]> = BTreeSet::new();
    let mut columns: BTreeSet<[i32; 2]> = BTreeSet::new();
    for object in map.objects.values() {
        let bounds = object.bounds.aabb().grown(0.05);
        let near = Point2::new(base.x.clamp(bounds.min.x, bounds.max.x), base.y.clamp(bounds.min.y, bounds.max.y));
        if (near - base).norm() > REACH_M {
            continue;
        }
        cover(&mut columns, map, &bounds);
        if Some(object.id) == target {
            continue;
        }
        for point in &object.points {
            let p: Point3<f64> = point.position.cast();
            let free = target_box.is_some_and(|b| b.contains(&p, TARGET_MARGIN_M));
            if !free && (Point2::new(p.x, p.y) - base).norm() < REACH_M {
                voxels.insert([p.x, p.y, p.z].map(|v| (v / VOXEL_M).floor() as i32));
            }
        }
    }
    let balls = voxels.into_iter().map(|voxel| {
        let center = Point3::from(Vector3::from(voxel.map(|v| (f64::from(v) + 0.5) * VOXEL_M)));
        Obstacle::still_ball(base_from_world * center, 0.5 * VOXEL_M)
    });
    let mut obstacles: Vec<Obstacle> = balls.collect();
    obstacles.extend(walls(map, &base, &columns, &base_from_world));
    obstacles
}

/// Marks the cells under an object's box: its own points say more about it than the floor grid.
fn cover(columns: &mut BTreeSet<[i32; 2]>, map: &Map, bounds: &dsm::geometry::Aabb) {
    let low = map.free_space.cell_at(&Point2::new(bounds.min.x, bounds.min.y));
    let high = map.free_space.cell_at(&Point2::new(bounds.max.x, bounds.max.y));
    columns.extend((low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| [x, y])));
}

fn walls(map: &Map, base: &Point2<f64>, covered: &BTreeSet<[i32; 2]>, base_from_world: &Pose) -> Vec<Obstacle> {
    let side = map.free_space.resolution_m;
    let reach = (REACH_M / side).ceil() as i32;
    let [x0, y0] = map.free_space.cell_at(base);
    let cells = (y0 - reach..=y0 + reach).flat_map(|y| (x0 - reach..=x0 + reach).map(move |x| [x, y]));
    cells
        .filter(|cell| map.free_space.state(*cell) == CellState::Occupied && !covered.contains(cell))
        .map(|cell| {
            let center = map.free_space.center_of(cell);
            let pose = base_from_world * Pose::translation(center.x, center.y, 0.5 * WALL_HEIGHT_M);
            Obstacle::still_box(pose, Vector3::new(0.5 * side, 0.5 * side, 0.5 * WALL_HEIGHT_M))
        })
        .collect()
}
