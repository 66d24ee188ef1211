//! Which things of a home a robot can get at: nobody is asked for what no place on the floor is near enough to.

use super::home::Home;
use dsm_robot::nav::{Costmap, CostmapConfig, Field};
use dsm_sim::scene::{SceneModel, Semantics};
use dsm_sim::world::floor_of;
use nalgebra::Point2;

/// Radius of the footprint and height of the robot that the episodes name, metres.
pub(super) const ROBOT_M: (f64, f64) = (0.27, 1.3);
/// Its arm reaches so far from the middle of the base at the heights of beds and tables, metres.
const ARM_M: f64 = 0.9;
/// To be at a thing is to stand within a metre of its outline; less what a robot stops short of, metres.
const AT_M: f64 = 0.9;
/// What is put on a surface is put at least so far from its edge, metres.
const INSIDE_M: f64 = 0.1;

/// What it costs a robot (its radius and height, metres) to stand on the floor of a scene; `None` when that cannot be told.
pub(super) fn costmap_of(model: &SceneModel, (footprint_radius_m, height_m): (f64, f64)) -> Option<Costmap> {
    let floor = floor_of(model, height_m).ok()?;
    Some(Costmap::from_free_space(&floor, &CostmapConfig { footprint_radius_m, ..CostmapConfig::default() }))
}

/// Where the base can stand, with the room of each place. Without a start that says which, all free floor counts.
pub(super) struct Stands {
    places: Vec<(Point2<f64>, Option<String>)>,
    cell_m: f64,
}

impl Stands {
    /// The places of a home; none when its floor cannot be told.
    pub(super) fn find(model: &SceneModel, semantics: &Semantics) -> Self {
        let Some(costmap) = costmap_of(model, ROBOT_M) else { return Self { places: Vec::new(), cell_m: 0.0 } };
        let grid = costmap.grid();
        let fields: Vec<Field> = semantics
            .start
            .areas
            .iter()
            .map(|area| Point2::new(area.x_m, area.y_m))
            .filter(|start| costmap.is_traversable_at(start))
            .map(|start| Field::from_start(&costmap, &start))
            .collect();
        let places = (0..grid.len())
            .filter(|cell| costmap.is_traversable(*cell))
            .filter(|cell| fields.is_empty() || fields.iter().any(|field| field.find_length_m(*cell).is_some()))
            .map(|cell| grid.center_of(cell))
            .map(|place| (place, semantics.find_room(place).map(|room| room.name.clone())))
            .collect();
        Self { places, cell_m: grid.resolution_m }
    }

    /// Whether the base can stand at a place in a room; in any when none is given.
    pub(super) fn has(&self, place: &Point2<f64>, room: Option<&str>) -> bool {
        let is_here = |stand: &Point2<f64>| (stand - place).abs().max() <= 0.5 * self.cell_m + 1e-9;
        self.places.iter().any(|(stand, of)| is_here(stand) && (room.is_none() || of.as_deref() == room))
    }

    /// Marks what cannot be reached as nothing to grasp, to go to or to put things on. A home whose floor cannot be told
    /// stays as it is.
    pub(super) fn drop_out_of_reach(&self, home: &mut Home) {
        if self.cell_m == 0.0 {
            return;
        }
        for object in &mut home.objects {
            let nearest_m = self
                .places
                .iter()
                .filter(|(_, room)| object.room.is_none() || *room == object.room)
                .map(|(place, _)| (object.distance_m(place), (place - object.at.xy()).norm()))
                .fold((f64::INFINITY, f64::INFINITY), |a, b| (a.0.min(b.0), a.1.min(b.1)));
            object.graspable &= nearest_m.1 <= ARM_M;
            object.stands &= nearest_m.0 <= AT_M;
            object.is_surface &= nearest_m.0 + INSIDE_M <= ARM_M;
        }
    }
}
