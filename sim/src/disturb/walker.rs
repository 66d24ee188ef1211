//! Somebody who walks to and fro through the robot's way.
//!
//! The person keeps to free floor, does not mind the robot until it is close, stops short of it, and turns back when it
//! does not get out of the way: who walks into whom is then the robot's doing.

use super::actors::PERSON_M;
use crate::physics::Physics;
use dsm::Pose;
use dsm::map::FreeSpace;
use dsm_robot::nav::{Costmap, CostmapConfig, Field, find_path};
use nalgebra::{Point2, Point3, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Walking at home, metres per second.
const SPEED_M_PER_S: f64 = 0.6;
/// The person stops when the robot is this near before it, skin to skin, metres.
const STOP_M: f64 = 0.3;
/// ... and turns back after so long, seconds.
const PATIENCE_S: f64 = 4.0;
/// Links of the robot are about this thick, metres.
const LINK_M: f64 = 0.08;
/// The walk passes this far before the base, metres: the first of these where one can walk.
const AHEAD_M: [f64; 5] = [1.6, 1.2, 2.0, 0.9, 2.5];
/// Its ends are so far from there, along the way, metres.
const LEG_M: (f64, f64) = (1.8, 4.0);
/// Nobody steps out of nothing nearer to the robot than this, metres.
const APART_M: f64 = 1.7;

/// Where people can walk.
pub(super) fn walkable(floor: &FreeSpace) -> Costmap {
    let config = CostmapConfig { footprint_radius_m: PERSON_M.0, ..CostmapConfig::default() };
    Costmap::from_free_space(floor, &config)
}

/// A walk under way.
pub(super) struct Walker {
    points: Vec<Point2<f64>>,
    /// The point that is walked to.
    next: usize,
    forth: bool,
    at: Point2<f64>,
    waited_s: f64,
}

impl Walker {
    /// A walk through the way of the base; `None` while there is none.
    pub(super) fn begin(physics: &dyn Physics, floor: &Costmap, rng: &mut ChaCha8Rng) -> Option<Self> {
        let world_from_base = physics.world_from_base();
        let base = Point2::from(world_from_base.translation.vector.xy());
        let middle = AHEAD_M.iter().find_map(|ahead_m| {
            let at = (world_from_base * Point3::new(*ahead_m, 0.0, 0.0)).xy();
            floor.is_traversable_at(&at).then_some(at)
        })?;
        let field = Field::from_start(floor, &middle);
        let grid = floor.grid();
        let ends: Vec<Point2<f64>> = (0..grid.len())
            .filter(|cell| field.find_length_m(*cell).is_some_and(|m| (LEG_M.0..=LEG_M.1).contains(&m)))
            .map(|cell| grid.center_of(cell))
            .filter(|at| (at - base).norm() >= APART_M)
            .collect();
        let first = *ends.get(rng.random_range(0..ends.len().max(1)))?;
        // To the other side: of a few, the one farthest from where the walk begins.
        const DRAWN: usize = 6;
        let drawn: Vec<Point2<f64>> = (0..DRAWN).map(|_| ends[rng.random_range(0..ends.len())]).collect();
        let last = drawn.into_iter().max_by(|a, b| (a - first).norm().total_cmp(&(b - first).norm()))?;
        let mut points = find_path(floor, &first, &middle).ok()?.points;
        points.extend(find_path(floor, &middle, &last).ok()?.points.into_iter().skip(1));
        (points.len() >= 2).then_some(Self { at: first, points, next: 1, forth: true, waited_s: 0.0 })
    }

    /// Walks on for `dt_s`; where the person stands then.
    pub(super) fn walk(&mut self, physics: &dyn Physics, dt_s: f64) -> Pose {
        let way = self.points[self.next] - self.at;
        let direction = way.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        if is_robot_before(physics, &self.at, &direction) {
            self.waited_s += dt_s;
            if self.waited_s >= PATIENCE_S {
                self.waited_s = 0.0;
                self.turn();
            }
        } else {
            self.waited_s = 0.0;
            let step_m = SPEED_M_PER_S * dt_s;
            if way.norm() > step_m {
                self.at += direction * step_m;
            } else {
                self.at = self.points[self.next];
                self.advance();
            }
        }
        self.pose(&direction)
    }

    /// Distance to the base over the floor, metres.
    pub(super) fn distance_m(&self, physics: &dyn Physics) -> f64 {
        (physics.world_from_base().translation.vector.xy() - self.at.coords).norm()
    }

    fn pose(&self, direction: &Vector2<f64>) -> Pose {
        Pose::new(Vector3::new(self.at.x, self.at.y, 0.0), Vector3::z() * direction.y.atan2(direction.x))
    }

    fn advance(&mut self) {
        let last = self.points.len() - 1;
        if (self.forth && self.next == last) || (!self.forth && self.next == 0) {
            self.turn();
        } else {
            self.next = if self.forth { self.next + 1 } else { self.next - 1 };
        }
    }

    fn turn(&mut self) {
        self.forth = !self.forth;
        let last = self.points.len() - 1;
        self.next = if self.forth { (self.next + 1).min(last) } else { self.next.saturating_sub(1) };
    }
}

/// Whether some part of the robot is near in the half plane that is walked into.
fn is_robot_before(physics: &dyn Physics, at: &Point2<f64>, direction: &Vector2<f64>) -> bool {
    let base_m = 0.27;
    let near = |place: Vector3<f64>, thick_m: f64| {
        let offset = place.xy() - at.coords;
        offset.norm() < PERSON_M.0 + thick_m + STOP_M && offset.dot(direction) > 0.0
    };
    near(physics.world_from_base().translation.vector, base_m)
        || (0..physics.link_names().len()).any(|link| near(physics.world_from_link(link).translation.vector, LINK_M))
}

#[cfg(test)]
mod tests {
    //! Contract: a walk keeps its line and its pace, to and fro.
    use super::*;

    #[test]
    fn the_turns_of_a_walk_stay_within_its_points() {
        let points: Vec<Point2<f64>> = (0..4).map(|i| Point2::new(f64::from(i), 0.0)).collect();
        let mut walker = Walker { at: points[0], points, next: 1, forth: true, waited_s: 0.0 };
        let mut visited = Vec::new();
        for _ in 0..8 {
            walker.at = walker.points[walker.next];
            visited.push(walker.next);
            walker.advance();
        }
        assert_eq!(visited, [1, 2, 3, 2, 1, 0, 1, 2]);
        walker.next = 0;
        walker.forth = false;
        walker.turn();
        assert_eq!((walker.next, walker.forth), (1, true));
    }
}
