//! Where the base should stand for a grasp.

use super::candidates::GraspCandidate;
use crate::nav::{Costmap, Field, Pose2, StandRange};
use dsm::Pose;
use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`find_placements`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlacementConfig {
    /// Distance from the base to the tool on the floor, metres. Default 0.45, 0.62, 1.0: with a slanted hand the arm reaches
    /// 0.95 to 1.0 at the heights of beds and tables.
    pub distance: StandRange,
    /// How many metres of path a metre off the preferred distance is worth. Default 4, range 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub distance_weight: f64,
    /// Largest angle between the direction to the target and a side approach, radians. Default 0.8, range 0.1 to 3.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub max_side_rad: f64,
    /// Largest number of places that are tested. Default 40, range 1 to 1000.
    #[schemars(range(min = 1, max = 1000))]
    pub max_places: usize,
    /// Largest number of grasps kept per place. Default 6, range 1 to 100.
    #[schemars(range(min = 1, max = 100))]
    pub max_grasps: usize,
    /// Smallest distance between tested places, metres. Default 0.1, range 0.02 to 1.
    #[schemars(range(min = 0.02, max = 1.0))]
    pub spacing_m: f64,
}

impl Default for PlacementConfig {
    fn default() -> Self {
        Self {
            distance: StandRange { min_m: 0.45, preferred_m: 0.62, max_m: 1.0 },
            distance_weight: 4.0,
            max_side_rad: 0.8,
            max_places: 40,
            max_grasps: 6,
            spacing_m: 0.1,
        }
    }
}

/// A place for the base from which at least one grasp can be reached.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Where, facing the target.
    pub base: Pose2,
    /// Indices into the candidates that can be reached from there, best first, with grasp score times reach.
    pub grasps: Vec<(usize, f64)>,
    /// Way to go, metres.
    pub path_length_m: f64,
    /// Best grasp, number of reachable grasps and way together; higher is better.
    pub score: f64,
}

/// Places for the base to carry out one of the `candidates` (planned with [`super::ApproachFrom::Anywhere`]), best first.
/// `reach(world_from_base, world_from_tool)` gives 0 to 1, or `None` when the arm cannot; it is asked at most
/// once for each place and candidate.
pub fn find_placements(
    candidates: &[GraspCandidate],
    costmap: &Costmap,
    field: &Field,
    reach: &dyn Fn(&Pose, &Pose) -> Option<f32>,
    config: &PlacementConfig,
) -> Vec<Placement> {
    let Some(best) = candidates.first() else { return Vec::new() };
    let target = floor_point(&best.world_from_tool);
    let grid = costmap.grid();
    let mut places: Vec<(f64, usize, f64)> = grid
        .cells_within(target, config.distance.max_m)
        .filter(|&cell| costmap.is_traversable(cell))
        .filter_map(|cell| {
            let path_length_m = field.find_length_m(cell)?;
            let distance = (grid.center_of(cell) - target).norm();
            let cost = path_length_m + config.distance_weight * (distance - config.distance.preferred_m).abs();
            (distance >= config.distance.min_m).then_some((cost, cell, path_length_m))
        })
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut tested: Vec<Point2<f64>> = Vec::new();
    let mut found = Vec::new();
    for (cost, cell, path_length_m) in places {
        let position = grid.center_of(cell);
        if tested.iter().any(|t| (t - position).norm() < config.spacing_m) {
            continue;
        }
        if tested.len() == config.max_places {
            break;
        }
        tested.push(position);
        let base = Pose2::facing(position, &target);
        let grasps = reachable(candidates, &base, reach, config);
        if let Some((_, best)) = grasps.first() {
            let choice = 0.85 + 0.15 * grasps.len() as f64 / config.max_grasps as f64;
            let score = best * choice / (1.0 + 0.2 * cost);
            found.push(Placement { base, grasps, path_length_m, score });
        }
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found
}

fn reachable(
    candidates: &[GraspCandidate],
    base: &Pose2,
    reach: &dyn Fn(&Pose, &Pose) -> Option<f32>,
    config: &PlacementConfig,
) -> Vec<(usize, f64)> {
    let world_from_base = base.to_pose();
    let mut grasps: Vec<(usize, f64)> = candidates
        .iter()
        .enumerate()
        .filter(|(_, candidate)| {
            let approach = candidate.world_from_tool.rotation * nalgebra::Vector3::z();
            let steep = approach.xy().norm() < 0.4;
            let off = crate::nav::wrap_angle(approach.y.atan2(approach.x) - base.yaw_rad).abs();
            steep || off <= config.max_side_rad
        })
        .filter_map(|(i, candidate)| {
            let share = reach(&world_from_base, &candidate.world_from_tool)?;
            Some((i, candidate.score * f64::from(share).clamp(0.0, 1.0)))
        })
        .take(config.max_grasps)
        .collect();
    grasps.sort_by(|a, b| b.1.total_cmp(&a.1));
    grasps
}

fn floor_point(world_from_tool: &Pose) -> Point2<f64> {
    Point2::new(world_from_tool.translation.x, world_from_tool.translation.y)
}

#[cfg(test)]
mod tests {
    //! Contract: places are reachable floor within range that face the target and from which a grasp passes the test; a
    //! target that can only be taken from one side draws the base to that side.
    use super::*;
    use crate::grasp::candidates::tests::sphere;
    use crate::grasp::{ApproachFrom, GraspConfig, GraspScene, plan_grasps};
    use crate::nav::{CostmapConfig, room_grid};
    use dsm::map::CellState;
    use nalgebra::Point3;

    #[test]
    fn the_base_goes_to_the_side_that_works() {
        let mut floor = room_grid();
        for column in 34..46 {
            for row in 34..46 {
                floor.set([column, row], CellState::Occupied);
            }
        }
        let costmap = Costmap::from_free_space(&floor, &CostmapConfig::default());
        let field = Field::from_start(&costmap, &Point2::new(0.8, 0.8));
        let apple = sphere(Point3::new(2.2, 2.0, 0.74), 0.036, 0.003, 1500, 1);
        let scene = GraspScene::from_points(&apple, &[], ApproachFrom::Anywhere).unwrap();
        let plan = plan_grasps(&scene, &GraspConfig::default(), &|_| Some(1.0));
        let config = PlacementConfig::default();
        let reach = |world_from_base: &Pose, world_from_tool: &Pose| {
            let tool = world_from_base.inverse() * world_from_tool;
            let ahead = tool.translation.x;
            (ahead > 0.4 && ahead < 0.85 && tool.translation.y.abs() < 0.2).then_some(0.8)
        };
        let places = find_placements(&plan.candidates, &costmap, &field, &reach, &config);
        assert!(!places.is_empty());
        assert!(places.windows(2).all(|w| w[0].score >= w[1].score));
        for place in &places {
            let distance = (place.base.position - Point2::new(2.2, 2.0)).norm();
            assert!((0.44..=1.02).contains(&distance), "{place:?}");
            assert!(costmap.is_traversable_at(&place.base.position) && !place.grasps.is_empty());
        }
        // 12 cm from the table's edge at +x, the base reaches it from there or from the sides, not over the whole table.
        assert!(places[0].base.position.x > 1.7, "{:?}", places[0]);
        assert_eq!(find_placements(&plan.candidates, &costmap, &field, &|_, _| None, &config), Vec::new());
        assert_eq!(find_placements(&[], &costmap, &field, &reach, &config), Vec::new());
    }
}
