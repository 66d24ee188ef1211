//! How fast the unfolded arm, or the folded one around its load, may move where something is near.
//!
//! ```text
//! speed of a link <= sqrt(v0^2 + 2 a max(0, d - d0)),   d = distance of the link from the nearest thing of the map
//! ```
//!
//! Dampers keep links from what the map shows where the map shows it. The map is off by what localisation wanders, and
//! where things are, there are things that it does not hold: whatever is hit near them is hit slowly. All velocities are
//! scaled alike, so that a way stays the way that was planned.

use crate::skills::obstacles::{find_obstacles, leave_out_held};
use dsm::Pose;
use dsm::geometry::OrientedBox;
use dsm::map::Map;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::collision::{Obstacle, PairDistance};
use dsm_robot::model::{Configuration, LinkId, RobotModel};
use dsm_robot::nav::LiveObstacles;
use nalgebra::{DVector, Point3, Unit, Vector3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Speed at which a touch does no harm, metres per second.
const TOUCH_M_PER_S: f64 = 0.07;
/// Nearer than this a link may touch: localisation wanders by 3 cm, and surfaces are known to one, metres.
const UNSURE_M: f64 = 0.04;
/// So near is as near as the base brings the arm, metres: what is measured every tenth of a second at the speed of a touch.
const CLOSE_M: f64 = 0.015;
/// What lies farther to the side of a link than this cosine is passed.
const AHEAD: f64 = 0.3;
/// Braking that base and arm can count on, m/s^2.
const BRAKING_M_PER_S2: f64 = 0.5;
/// What is farther from a link does not slow it, metres.
const REACH_M: f64 = 0.25;
/// A robot that sticks out of its footprint by less is folded: the base's own distances hold for it, metres.
const FOLDED_M: f64 = 0.01;
/// Distances are measured this often.
const MEASURED_EVERY: Span = Span(100_000_000);
/// The map is asked for what is near this often.
const ASKED_EVERY: Span = Span(500_000_000);

/// What is near the arm.
#[derive(Default)]
pub struct Pace {
    asked: Option<(Stamp, Pose, Vec<Obstacle>)>,
    measured_at: Option<Stamp>,
    near: Vec<Near>,
}

/// What is next to a link, base frame.
struct Near {
    link: LinkId,
    /// The nearest point of the link.
    point: Point3<f64>,
    distance_m: f64,
    /// From the link to what is near.
    towards: Unit<Vector3<f64>>,
}

/// The robot at one moment.
pub struct Posture<'a> {
    /// The model, with what it holds.
    pub model: &'a Arc<RobotModel>,
    /// All joints.
    pub configuration: &'a Configuration,
    /// Where the robot believes to be.
    pub world_from_base: &'a Pose,
    /// What the hand holds, in the tool frame.
    pub held: Option<&'a OrientedBox>,
}

impl Pace {
    /// Whether it is time to look what is near.
    pub fn is_due(&self, now: Stamp) -> bool {
        self.measured_at.is_none_or(|at| now - at >= MEASURED_EVERY)
    }

    /// Whether nothing that sticks out has anything near.
    pub fn is_free(&self) -> bool {
        self.near.is_empty()
    }

    /// Looks what is near.
    pub fn measure(&mut self, now: Stamp, map: &Map, live: &LiveObstacles, posture: &Posture<'_>) {
        self.measured_at = Some(now);
        self.near.clear();
        let Posture { model, configuration, world_from_base, held } = posture;
        if !is_unfolded(model, configuration) {
            self.asked = None;
            return;
        }
        if self.asked.as_ref().is_none_or(|(at, _, _)| now - *at >= ASKED_EVERY) {
            let mut obstacles = find_obstacles(map, Some(live), world_from_base, None);
            let tool = model.kinematics.root_from_link(configuration, model.tool);
            leave_out_held(&mut obstacles, *held, &tool);
            self.asked = Some((now, **world_from_base, obstacles));
        }
        let Some((_, world_from_then, obstacles)) = &self.asked else { return };
        let now_from_then = world_from_base.inverse() * world_from_then;
        let moved: Vec<Obstacle>;
        let obstacles = if now_from_then.translation.vector.norm() + now_from_then.rotation.angle() < 1e-3 {
            obstacles
        } else {
            moved = obstacles.iter().map(|obstacle| obstacle.seen_from(&now_from_then)).collect();
            &moved
        };
        let poses = model.kinematics.root_from_links(configuration);
        let mut nearest: BTreeMap<LinkId, Near> = BTreeMap::new();
        for pair in model.collision.obstacle_distances(&poses, obstacles, &model.arm_links(), REACH_M) {
            let PairDistance { link, point_on_link: point, distance_m, normal_to_other: towards, .. } = pair;
            if nearest.get(&link).is_none_or(|known| distance_m < known.distance_m) {
                nearest.insert(link, Near { link, point, distance_m, towards });
            }
        }
        self.near = nearest.into_values().collect();
    }

    /// Whether something is so near before a link that a base which drives on would touch it.
    pub fn is_close_ahead(&self) -> bool {
        self.near.iter().any(|near| near.distance_m < CLOSE_M && near.towards.x > AHEAD)
    }

    /// The share of these velocities at which every link is slow enough for what is near it, 0 to 1.
    pub fn share(&self, model: &RobotModel, configuration: &Configuration, base: Twist, arm: &JointVelocities) -> f64 {
        let poses = model.kinematics.root_from_links(configuration);
        let joints = DVector::from_column_slice(arm.values());
        let share = |Near { link, point, distance_m, .. }: &Near| {
            let jacobian = model.kinematics.jacobian(&poses, *link, point, &model.arm);
            let of_arm = jacobian.rows(0, 3) * &joints;
            let turn = Vector3::z().cross(&point.coords) * base.turn_rad_per_s;
            let speed =
                (Vector3::new(of_arm[0], of_arm[1], of_arm[2]) + turn + Vector3::x() * base.forward_m_per_s).norm();
            allowed_m_per_s(*distance_m) / speed.max(1e-9)
        };
        self.near.iter().map(share).fold(1.0, f64::min)
    }
}

/// Whether arm or load sticks out of the footprint.
pub fn is_unfolded(model: &RobotModel, configuration: &Configuration) -> bool {
    model.radius_m(configuration) > model.settings.base.footprint_radius_m + FOLDED_M
}

/// Speed of a link that is so far from the nearest thing, metres per second.
fn allowed_m_per_s(distance_m: f64) -> f64 {
    (TOUCH_M_PER_S * TOUCH_M_PER_S + 2.0 * BRAKING_M_PER_S2 * (distance_m - UNSURE_M).max(0.0)).sqrt()
}

#[cfg(test)]
mod tests {
    //! Contract: what sticks out moves slowly beside a wall, by arm or by base; away from it, or folded, it does not.
    use super::*;
    use dsm::map::CellState;
    use dsm_robot::joints::JointPositions;
    use std::path::Path;

    #[test]
    fn what_sticks_out_is_slow_beside_a_wall() {
        let model = RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter")).unwrap();
        let model = Arc::new(model);
        let posed = |name: &str| {
            let posture: JointPositions = model.find_posture(name).unwrap();
            let mut configuration = model.kinematics.zero();
            configuration.apply(&posture);
            configuration
        };
        let (ready, folded) = (posed("ready_front"), posed("carry"));
        let mut map = Map::new(0.05);
        let reach_m = model.radius_m(&ready);
        for (x, y) in (-60..60).flat_map(|x| (-60..60).map(move |y| (x, y))) {
            map.free_space.set([x, y], if x == 40 { CellState::Occupied } else { CellState::Free });
        }
        let share = |configuration: &Configuration, to_wall_m: f64, forward_m_per_s: f64, turn_rad_per_s: f64| {
            let world_from_base = Pose::translation(2.0 - reach_m - to_wall_m, 0.0, 0.0);
            let mut pace = Pace::default();
            let posture = Posture { model: &model, configuration, world_from_base: &world_from_base, held: None };
            assert!(pace.is_due(Stamp(0)));
            pace.measure(Stamp(0), &map, &LiveObstacles::default(), &posture);
            assert!(!pace.is_due(Stamp(0)));
            let still = JointVelocities::zeros(&model.arm.joints);
            pace.share(&model, configuration, Twist { forward_m_per_s, turn_rad_per_s }, &still)
        };
        let near = share(&ready, 0.03, 0.6, 0.0);
        assert!(0.6 * near < 0.1 && 0.6 * near > 0.05, "{near}");
        assert!(share(&ready, 0.03, 0.05, 0.0) == 1.0, "slow enough already");
        let turning = share(&ready, 0.03, 0.0, 1.0);
        assert!(turning < 0.3, "the hand swings: {turning}");
        assert!(share(&ready, 0.15, 0.6, 0.0) > 2.0 * near, "braking is left");
        assert_eq!(share(&ready, 0.6, 0.6, 1.0), 1.0, "nothing is near");
        assert_eq!(share(&folded, 0.03, 0.6, 1.0), 1.0, "the base keeps its own distance");
    }
}
