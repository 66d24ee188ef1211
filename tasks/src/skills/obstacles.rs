//! What the arm must not touch: surfaces of the map's objects, and what stands on the floor without a name.

use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::map::{CellState, Map, ObjectId};
use dsm_robot::model::collision::{Obstacle, Other};
use dsm_robot::model::{Configuration, RobotModel};
use dsm_robot::nav::LiveObstacles;
use nalgebra::{Point2, Point3, Vector3};
use std::collections::BTreeSet;

/// Side of the voxels that surfaces are thinned to, metres.
const VOXEL_M: f64 = LiveObstacles::VOXEL_M;
/// Obstacles farther from the base than this are out of reach, metres.
const REACH_M: f64 = 1.25;
/// Height of what stands on the floor without a name (walls), metres.
const WALL_HEIGHT_M: f64 = 1.6;
/// Points of others this near to the target belong to it for the arm's purposes, metres: clouds are not sharp.
const TARGET_MARGIN_M: f64 = 0.012;

/// Voxels that are seen this near to the target belong to it, metres: half a voxel, and what its box is off.
const SEEN_TARGET_MARGIN_M: f64 = 0.03;

/// Obstacles in the base frame, without the object that is to be touched: what the map holds, and the surfaces that are
/// `seen` now. The map keeps few points of large things and misses thin edges; what is seen now is gone elsewhere.
pub fn find_obstacles(
    map: &Map,
    seen: Option<&LiveObstacles>,
    world_from_base: &Pose,
    target: Option<ObjectId>,
) -> Vec<Obstacle> {
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
        cover(&mut columns, map, &object.bounds);
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
    for p in seen.into_iter().flat_map(LiveObstacles::surfaces) {
        let free = target_box.is_some_and(|b| b.contains(&p, SEEN_TARGET_MARGIN_M));
        if !free && (p.xy() - base).norm() < REACH_M {
            voxels.insert([p.x, p.y, p.z].map(|v| (v / VOXEL_M).floor() as i32));
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

/// Leaves out what the map or the cameras still take for a thing and is in the hand: points within what the hand holds, in
/// the tool frame, or next to it.
pub fn leave_out_held(obstacles: &mut Vec<Obstacle>, held: Option<&OrientedBox>, base_from_tool: &Pose) {
    const NEXT_M: f64 = 0.03;
    let Some(held) = held else { return };
    obstacles.retain(|obstacle| match obstacle {
        Obstacle::Ball { center_in_base, .. } => {
            !held.contains(&base_from_tool.inverse_transform_point(center_in_base), NEXT_M)
        }
        Obstacle::Box { .. } | Obstacle::Hull { .. } => true,
    });
}

/// Leaves out what overlaps the arm where it is: surfaces are known to a voxel, and what the arm stands in is not there. What
/// is next to it stays, so that it goes no deeper.
pub(super) fn leave_out_overlaps(model: &RobotModel, configuration: &Configuration, obstacles: &mut Vec<Obstacle>) {
    let poses = model.kinematics.root_from_links(configuration);
    let pairs = model.collision.obstacle_distances(&poses, obstacles, &model.arm_links(), 0.0);
    let overlaps: BTreeSet<usize> = pairs
        .into_iter()
        .filter_map(|pair| match pair.other {
            Other::Obstacle(index) if pair.distance_m < 0.0 => Some(index),
            _ => None,
        })
        .collect();
    let mut index = 0..;
    obstacles.retain(|_| index.next().is_none_or(|index| !overlaps.contains(&index)));
}

/// Marks the cells under an object: its own points say more about it than the floor grid.
fn cover(columns: &mut BTreeSet<[i32; 2]>, map: &Map, bounds: &OrientedBox) {
    /// Noise of depth and the side of a cell widen what the floor grid holds of an object.
    const INSIDE_M: f64 = 0.02;
    const EDGE_M: f64 = 0.06;
    let floor = &map.free_space;
    let around = bounds.aabb().grown(EDGE_M);
    let low = floor.cell_at(&Point2::new(around.min.x, around.min.y));
    let high = floor.cell_at(&Point2::new(around.max.x, around.max.y));
    let middle = bounds.center.xy();
    for cell in (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| [x, y])) {
        let center = floor.center_of(cell);
        let at_level = Point3::new(center.x, center.y, bounds.center.z);
        let is_inside = bounds.contains(&at_level, INSIDE_M);
        // At an open side the widened edge is the object's; where no floor follows, a wall begins.
        let is_edge = || {
            let local = bounds.world_from_box().inverse_transform_point(&at_level);
            let half = bounds.size * 0.5;
            let nearest = Point3::from(local.coords.zip_map(&half, |value, half| value.clamp(-half, half)));
            let outward = (bounds.world_from_box() * (local - nearest)).xy();
            let outward = outward.try_normalize(1e-6).unwrap_or_else(|| (center - middle).normalize());
            floor.state_at(&(center + outward * floor.resolution_m)) == CellState::Free
        };
        if is_inside || (bounds.contains(&at_level, EDGE_M) && is_edge()) {
            columns.insert(cell);
        }
    }
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

#[cfg(test)]
mod tests {
    //! Contract: the wall behind a counter is an obstacle, the counter's own front edge is none beyond its points.
    use super::*;
    use dsm::map::{Attributes, MapChange, MapObject, MapUpdate, ObjectState, Votes};
    use dsm::time::Stamp;
    use nalgebra::UnitQuaternion;
    use std::path::Path;

    #[test]
    fn the_wall_behind_a_counter_is_an_obstacle() {
        let mut map = Map::new(0.05);
        for (x, y) in (0..40).flat_map(|x| (0..40).map(move |y| (x, y))) {
            // A wall of two cells from y = 1.5 m, a counter from y = 0.9 m whose front edge the grid widens by a cell.
            let occupied = y == 30 || y == 31 || (17..30).contains(&y) && (8..32).contains(&x);
            map.free_space.set([x, y], if occupied { CellState::Occupied } else { CellState::Free });
        }
        let bounds = OrientedBox {
            center: Point3::new(1.0, 1.19, 0.45),
            size: Vector3::new(1.2, 0.58, 0.9),
            rotation: UnitQuaternion::identity(),
        };
        let counter = MapObject {
            id: ObjectId(1),
            state: ObjectState::Stable,
            names: Votes::default(),
            points: Vec::new(),
            bounds,
            attributes: Attributes::default(),
            visual_feature: Vec::new(),
            provenance: Default::default(),
            text_feature: Vec::new(),
            room: None,
            observations: 9,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        };
        map.apply(MapUpdate { stamp: Stamp::default(), changes: vec![MapChange::Put(Box::new(counter))] });
        let at = Pose::translation(1.0, 0.5, 0.0);
        let columns: Vec<Point2<f64>> = find_obstacles(&map, None, &at, None)
            .into_iter()
            .filter_map(|obstacle| match obstacle {
                Obstacle::Box { base_from_box, .. } => Some((at * base_from_box).translation.vector.xy().into()),
                Obstacle::Ball { .. } | Obstacle::Hull { .. } => None,
            })
            .collect();
        let behind = columns.iter().filter(|c| (c.y - 1.525).abs() < 0.01 && (c.x - 1.0).abs() < 0.5).count();
        assert!(behind > 15, "{behind} cells of the wall");
        let front = columns.iter().filter(|c| c.y < 1.5 && (c.x - 1.0).abs() < 0.5).count();
        assert_eq!(front, 0, "{columns:?}");
    }

    #[test]
    fn what_the_arm_stands_in_is_not_there() {
        let model = RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter")).unwrap();
        let configuration = model.kinematics.zero();
        let hand = model.kinematics.root_from_link(&configuration, model.arm_links()[model.arm_links().len() - 1]);
        let at = Point3::from(hand.translation.vector);
        let ball = |x_m: f64| Obstacle::still_ball(at + Vector3::new(x_m, 0.0, 0.0), 0.015);
        let mut obstacles = vec![ball(1.0), ball(0.0), ball(0.9)];
        leave_out_overlaps(&model, &configuration, &mut obstacles);
        assert_eq!(obstacles, [ball(1.0), ball(0.9)]);
    }
}
