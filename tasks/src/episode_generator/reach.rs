//! Which things of a home a robot can get at: nobody is asked for what no place on the floor is near enough to.

use super::home::Home;
use dsm_robot::nav::{Costmap, CostmapConfig, Field};
use dsm_sim::scene::{SceneModel, Semantics};
use dsm_sim::world::floor_of;
use nalgebra::Point2;

/// Radius of the footprint and height of the robot that the episodes name, metres.
const ROBOT_M: (f64, f64) = (0.27, 1.3);
/// Its arm reaches so far from the middle of the base at the heights of beds and tables, metres.
const ARM_M: f64 = 0.9;
/// To be at a thing is to stand within a metre of its outline; less what a robot stops short of, metres.
const AT_M: f64 = 0.9;
/// What is put on a surface is put at least so far from its edge, metres.
const INSIDE_M: f64 = 0.1;

/// Marks what cannot be reached as nothing to grasp, to go to or to put things on. A home whose floor cannot be told stays
/// as it is.
pub(super) fn drop_out_of_reach(home: &mut Home, model: &SceneModel, semantics: &Semantics) {
    let Ok(floor) = floor_of(model, ROBOT_M.1) else { return };
    let config = CostmapConfig { footprint_radius_m: ROBOT_M.0, ..CostmapConfig::default() };
    let costmap = Costmap::from_free_space(&floor, &config);
    let grid = costmap.grid();
    let fields: Vec<Field> = semantics
        .start
        .areas
        .iter()
        .map(|area| Point2::new(area.x_m, area.y_m))
        .filter(|start| costmap.is_traversable_at(start))
        .map(|start| Field::from_start(&costmap, &start))
        .collect();
    // Where the base can stand, with the room of each place. Without a start that says which, all free floor counts.
    let stands: Vec<(Point2<f64>, Option<&str>)> = (0..grid.len())
        .filter(|cell| costmap.is_traversable(*cell))
        .filter(|cell| fields.is_empty() || fields.iter().any(|field| field.find_length_m(*cell).is_some()))
        .map(|cell| grid.center_of(cell))
        .map(|place| (place, semantics.find_room(place).map(|room| room.name.as_str())))
        .collect();
    for object in &mut home.objects {
        let nearest_m = stands
            .iter()
            .filter(|(_, room)| object.room.is_none() || *room == object.room.as_deref())
            .map(|(place, _)| (object.distance_m(place), (place - object.at.xy()).norm()))
            .fold((f64::INFINITY, f64::INFINITY), |a, b| (a.0.min(b.0), a.1.min(b.1)));
        object.graspable &= nearest_m.1 <= ARM_M;
        object.stands &= nearest_m.0 <= AT_M;
        object.is_surface &= nearest_m.0 + INSIDE_M <= ARM_M;
    }
}
