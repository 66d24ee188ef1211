//! Where to stand to see or reach a target.

use super::costmap::Costmap;
use super::planner::{Field, Pose2};
use super::sight::{Sight, Visibility};
use dsm::geometry::OrientedBox;
use dsm::map::{Map, Room};
use nalgebra::{Point2, Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How far from a target to stand, metres on the floor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StandRange {
    /// Nearest. Range 0 to 5.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub min_m: f64,
    /// Best. Range `min_m` to `max_m`.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub preferred_m: f64,
    /// Farthest. Range `min_m` to 5.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub max_m: f64,
}

/// Parameters of the choice of standing places.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GoalConfig {
    /// Distances from the outline of a target that is to be looked at. Default 0.45, 0.7, 2.0.
    pub view: StandRange,
    /// Distances from the centre of a target that is to be grasped. Default 0.45, 0.62, 0.9.
    pub reach: StandRange,
    /// Height of the camera that looks, metres. Default 1.25, range 0.1 to 2.5.
    #[schemars(range(min = 0.1, max = 2.5))]
    pub camera_height_m: f64,
    /// How many metres of path one metre off the preferred distance is worth. Default 8, range 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub distance_weight: f64,
    /// How many metres of path a fully hidden target is worth. Default 3, range 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub hidden_weight_m: f64,
    /// Smallest distance between two places that are returned, metres. Default 0.2, range 0.05 to 2.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub spacing_m: f64,
    /// Largest number of places returned. Default 16, range 1 to 200.
    #[schemars(range(min = 1, max = 200))]
    pub max_places: usize,
}

impl Default for GoalConfig {
    fn default() -> Self {
        Self {
            view: StandRange { min_m: 0.45, preferred_m: 0.7, max_m: 2.0 },
            reach: StandRange { min_m: 0.45, preferred_m: 0.62, max_m: 0.9 },
            camera_height_m: 1.25,
            distance_weight: 8.0,
            hidden_weight_m: 3.0,
            spacing_m: 0.2,
            max_places: 16,
        }
    }
}

/// A place to stand, facing the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandPose {
    /// Where and with which heading.
    pub pose: Pose2,
    /// 1 / (1 + cost in metres of path), so between 0 and 1; higher is better.
    pub score: f64,
    /// Way to go, metres.
    pub path_length_m: f64,
    /// Share of the target's test points in sight, 0 to 1.
    pub visible_share: f64,
}

/// Places from which the target can be seen, best first; empty when there is none. At least a third of the target's
/// test points is in sight from each.
pub fn find_view_poses(
    map: &Map,
    costmap: &Costmap,
    field: &Field,
    target: &OrientedBox,
    config: &GoalConfig,
) -> Vec<StandPose> {
    find_poses(map, costmap, field, target, &config.view, &|p| outline_distance(target, p), config)
}

/// Places from which an arm may reach the centre of the target, best first; empty when there is none. Whether the arm
/// can is for [`crate::grasp::find_placements`] to say.
pub fn find_reach_poses(
    map: &Map,
    costmap: &Costmap,
    field: &Field,
    target: &OrientedBox,
    config: &GoalConfig,
) -> Vec<StandPose> {
    let center = Point2::new(target.center.x, target.center.y);
    find_poses(map, costmap, field, target, &config.reach, &|p| (p - center).norm(), config)
}

/// The reachable place nearest to the centre of a room and inside its outline, and the way to it in metres.
pub fn find_room_pose(room: &Room, costmap: &Costmap, field: &Field) -> Option<(Point2<f64>, f64)> {
    const SEARCH_RADIUS_M: f64 = 2.0;
    costmap
        .grid()
        .cells_within(room.center, SEARCH_RADIUS_M)
        .filter(|&cell| costmap.is_traversable(cell))
        .filter_map(|cell| Some((costmap.grid().center_of(cell), field.find_length_m(cell)?)))
        .filter(|(point, _)| room.polygon.len() < 3 || is_inside(&room.polygon, point))
        .min_by(|a, b| (a.0 - room.center).norm_squared().total_cmp(&(b.0 - room.center).norm_squared()))
}

fn find_poses(
    map: &Map,
    costmap: &Costmap,
    field: &Field,
    target: &OrientedBox,
    range: &StandRange,
    distance_to: &dyn Fn(&Point2<f64>) -> f64,
    config: &GoalConfig,
) -> Vec<StandPose> {
    const MIN_VISIBLE: f64 = 0.33;
    /// Who stands a metre off does not stand at it. Less what outlines are off (0.1 m), where the robot believes to be and
    /// where it stops (0.1 m); farther off it must be worth the more to stay.
    const AT_M: f64 = 0.8;
    const BEYOND: f64 = 4.0;
    const MAX_TESTED: usize = 400;
    let center = Point2::new(target.center.x, target.center.y);
    let half_diagonal = 0.5 * Vector3::new(target.size.x, target.size.y, 0.0).norm();
    let mut places: Vec<(f64, usize, f64)> = costmap
        .grid()
        .cells_within(center, range.max_m + half_diagonal)
        .filter(|&cell| costmap.is_traversable(cell))
        .filter_map(|cell| {
            let path_length = field.find_length_m(cell)?;
            let distance = distance_to(&costmap.grid().center_of(cell));
            let crowding = costmap.find_cost(cell)? - 1.0;
            let off_m = (distance - range.preferred_m).abs() + BEYOND * (distance - AT_M).max(0.0);
            let cost = path_length + config.distance_weight * off_m + 0.1 * crowding.max(0.0);
            (range.min_m..=range.max_m).contains(&distance).then_some((cost, cell, path_length))
        })
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let sight = Sight::among(map, costmap, target);
    let mut found: Vec<StandPose> = Vec::new();
    // Places much worse than the first ones that were found are not worth the test.
    for (cost, cell, path_length_m) in thinned(&places, costmap, 0.1).into_iter().take(MAX_TESTED) {
        let position = costmap.grid().center_of(cell);
        if found.len() >= 4 * config.max_places {
            break;
        }
        let visible_share = visible_share(&sight, &position, target, config.camera_height_m);
        if visible_share >= MIN_VISIBLE {
            let cost = cost + config.hidden_weight_m * (1.0 - visible_share);
            let pose = Pose2::facing(position, &center);
            found.push(StandPose { pose, score: 1.0 / (1.0 + cost), path_length_m, visible_share });
        }
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<StandPose> = Vec::new();
    for place in found {
        let apart = |other: &StandPose| (other.pose.position - place.pose.position).norm() >= config.spacing_m;
        if kept.len() < config.max_places && kept.iter().all(apart) {
            kept.push(place);
        }
    }
    kept
}

/// The given places in order, without those nearer than `spacing_m` to an earlier one.
fn thinned(places: &[(f64, usize, f64)], costmap: &Costmap, spacing_m: f64) -> Vec<(f64, usize, f64)> {
    let grid = costmap.grid();
    let mut taken = vec![false; grid.len()];
    let mut kept = Vec::new();
    for place in places {
        if !taken[place.1] {
            kept.push(*place);
            grid.cells_within(grid.center_of(place.1), spacing_m - 1e-9).for_each(|cell| taken[cell] = true);
        }
    }
    kept
}

/// Share of five points of the target (centre, and halfway to the top and to the three other nearer faces) in sight.
fn visible_share(sight: &Sight<'_>, position: &Point2<f64>, target: &OrientedBox, camera_height_m: f64) -> f64 {
    let camera = Point3::new(position.x, position.y, camera_height_m);
    let pose = target.world_from_box();
    let h = target.size * 0.25;
    let offsets = [
        Vector3::zeros(),
        Vector3::new(0.0, 0.0, h.z),
        Vector3::new(h.x, 0.0, 0.0),
        Vector3::new(-h.x, 0.0, 0.0),
        Vector3::new(0.0, h.y, 0.0),
        Vector3::new(0.0, -h.y, 0.0),
    ];
    let ignored = 0.5 * target.size.norm() + 0.03;
    let clear = offsets
        .iter()
        .filter(|offset| sight.check(&camera, &(pose * Point3::from(**offset)), ignored) == Visibility::Clear)
        .count();
    clear as f64 / offsets.len() as f64
}

/// Distance on the floor from a point to the outline of a box, metres; 0 inside.
pub(crate) fn outline_distance(target: &OrientedBox, point: &Point2<f64>) -> f64 {
    let in_box = target.world_from_box().inverse_transform_point(&Point3::new(point.x, point.y, target.center.z));
    let beyond = |value: f64, size: f64| (value.abs() - 0.5 * size).max(0.0);
    beyond(in_box.x, target.size.x).hypot(beyond(in_box.y, target.size.y))
}

/// Whether a point lies inside a simple polygon (even-odd rule).
fn is_inside(polygon: &[Point2<f64>], point: &Point2<f64>) -> bool {
    let mut inside = false;
    let mut previous = polygon[polygon.len() - 1];
    for &corner in polygon {
        if (corner.y > point.y) != (previous.y > point.y) {
            let at = corner.x + (point.y - corner.y) / (previous.y - corner.y) * (previous.x - corner.x);
            inside ^= point.x < at;
        }
        previous = corner;
    }
    inside
}

#[cfg(test)]
mod tests {
    //! Contract: every place is floor the base can reach, within range, facing the target, with the target in sight; a
    //! target that can only be seen from one side is looked at from that side.
    use super::*;
    use crate::nav::CostmapConfig;
    use crate::nav::grid::wrap_angle;
    use crate::nav::sight::tests::{boxed, map_of, room_grid};
    use dsm::map::RoomId;

    #[test]
    fn places_are_reachable_and_face_the_target() {
        let table = boxed(1, [2.0, 2.5, 0.35], [1.0, 0.6, 0.7], &[0, 1, 2, 3, 5]);
        let apple = boxed(2, [1.8, 2.4, 0.74], [0.08; 3], &[0, 1, 2, 3, 5]);
        let map = map_of(room_grid(), vec![table, apple.clone()]);
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let field = Field::from_start(&costmap, &Point2::new(7.0, 1.0));
        let config = GoalConfig::default();
        let views = find_view_poses(&map, &costmap, &field, &apple.bounds, &config);
        let reaches = find_reach_poses(&map, &costmap, &field, &apple.bounds, &config);
        assert!(views.len() >= 5 && reaches.len() >= 3, "{} and {}", views.len(), reaches.len());
        for (places, range) in [(&views, config.view), (&reaches, config.reach)] {
            assert!(places.windows(2).all(|w| w[0].score >= w[1].score));
            for place in places.iter() {
                let to_target = Point2::new(1.8, 2.4) - place.pose.position;
                assert!(to_target.norm() <= range.max_m + 0.06 && to_target.norm() >= range.min_m - 0.01);
                assert!(wrap_angle(to_target.y.atan2(to_target.x) - place.pose.yaw_rad).abs() < 1e-9);
                assert!(field.find_path(&costmap, &place.pose.position).is_some());
                assert!(place.visible_share >= 0.33);
            }
        }
    }

    #[test]
    fn a_shelf_is_looked_at_from_its_front() {
        let mut shelf = boxed(1, [2.0, 2.0, 0.9], [0.4, 1.0, 1.8], &[0, 2, 3, 5]);
        shelf.points.extend(boxed(9, [2.0, 2.0, 0.69], [0.4, 1.0, 0.02], &[5]).points);
        let apple = boxed(2, [2.06, 2.0, 0.74], [0.08; 3], &[0, 1, 2, 3, 5]);
        let map = map_of(room_grid(), vec![shelf, apple.clone()]);
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let field = Field::from_start(&costmap, &Point2::new(1.0, 2.0));
        let places = find_view_poses(&map, &costmap, &field, &apple.bounds, &GoalConfig::default());
        assert!(!places.is_empty());
        assert!(places.iter().all(|p| p.pose.position.x > 2.2), "only the side +x is open: {places:?}");
    }

    #[test]
    fn rooms_are_entered() {
        let mut map = map_of(room_grid(), vec![boxed(1, [6.0, 2.0, 0.4], [0.8, 0.8, 0.8], &[5])]);
        let corner = |x: f64, y: f64| Point2::new(x, y);
        map.rooms.push(Room {
            id: RoomId(0),
            name: "room".to_owned(),
            polygon: vec![corner(4.0, 0.0), corner(8.0, 0.0), corner(8.0, 4.0), corner(4.0, 4.0)],
            center: Point2::new(6.0, 2.0),
            area_m2: 16.0,
            neighbours: Vec::new(),
        });
        let costmap = Costmap::from_free_space(&map.free_space, &CostmapConfig::default());
        let field = Field::from_start(&costmap, &Point2::new(1.0, 2.0));
        let (place, length) = find_room_pose(&map.rooms[0], &costmap, &field).unwrap();
        assert!(place.x > 4.0 && costmap.is_traversable_at(&place) && length > 3.0);
    }
}
