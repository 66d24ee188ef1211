//! How fast the parts may move where they are: near things, near people, at the border of their area.

use super::core::Core;
use crate::control::joint_limit::braking_bound;
use crate::drivers::{Robot, Twist};
use crate::nav::Pose2;
use nalgebra::{DVector, Point3};

/// Time between a command and the next chance to brake, seconds: two control periods.
const NEXT_S: f64 = 0.02;
/// Braking of the tool up and down that its borders count on, m/s^2.
const TOOL_BRAKING_M_PER_S2: f64 = 0.3;

impl<R: Robot> Core<R> {
    fn base_braking_m_per_s2(&self) -> f64 {
        self.settings.depth.braking_share * self.base.limits.max_acceleration_m_per_s2
    }

    /// Speed for the people near; infinite without any.
    fn people_m_per_s(&self) -> f64 {
        let Some(place) = self.place.find_newest() else { return f64::INFINITY };
        let (radius_m, braking) = (self.base.limits.footprint_radius_m, self.base_braking_m_per_s2());
        self.people.allowed_m_per_s(self.now, &place.odom_from_base, radius_m, braking, &self.settings.people)
    }

    /// The wanted twist at the speed that fits the place, along the same arc.
    pub(super) fn capped(&mut self, wanted: Twist) -> Twist {
        let people = self.people_m_per_s();
        let turn_share = (people / self.base.limits.max_speed_m_per_s).min(1.0);
        let speed = wanted.forward_m_per_s.abs();
        let (things, area) = match self.place.find_newest() {
            Some(place) if speed > 0.0 => {
                let base = Pose2::from_pose(&place.world_from_base);
                let braking = self.base_braking_m_per_s2();
                let stops = |way_m: f64| braking_bound(way_m, braking, NEXT_S);
                let area = super::area::allowed_m_per_s(&self.settings.area, &base, wanted, stops);
                (self.things_m_per_s(&place.odom_from_base, wanted), area)
            }
            _ => (f64::INFINITY, f64::INFINITY),
        };
        self.report.near_things += u64::from(speed > things);
        self.report.area += u64::from(speed > area);
        self.report.near_people += u64::from(speed > people || (wanted.turn_rad_per_s != 0.0 && turn_share < 1.0));
        let share = if speed > 0.0 { (things.min(area).min(people) / speed).min(1.0) } else { 1.0 };
        Twist {
            forward_m_per_s: share * wanted.forward_m_per_s,
            turn_rad_per_s: share.min(turn_share) * wanted.turn_rad_per_s,
        }
    }

    /// Speed from which the base stops before what the cameras measured on its arc.
    fn things_m_per_s(&self, odom_from_base: &dsm::Pose, wanted: Twist) -> f64 {
        let settings = &self.settings.depth;
        let braking = self.base_braking_m_per_s2();
        let top = self.base.limits.max_speed_m_per_s.min(wanted.forward_m_per_s.abs());
        let reach_m = top * top / (2.0 * braking) + top * NEXT_S;
        let footprint = (self.base.limits.footprint_radius_m, settings.margin_m);
        let way_m = self.depth.find_way_m(odom_from_base, wanted, footprint, reach_m);
        way_m.map_or(f64::INFINITY, |way_m| braking_bound(way_m, braking, NEXT_S).max(settings.creep_m_per_s))
    }

    /// Share of arm velocities that fits people and the borders of the tool, 0 to 1.
    pub(super) fn arm_share(&mut self, velocities: &[f64], positions: &[f64]) -> f64 {
        let people = (self.people_m_per_s() / self.base.limits.max_speed_m_per_s).min(1.0);
        let moves = velocities.iter().any(|velocity| *velocity != 0.0);
        self.report.near_people += u64::from(moves && people < 1.0);
        let tool = self.tool_share(velocities, positions);
        self.report.area += u64::from(tool < 1.0);
        people.min(tool)
    }

    fn tool_share(&self, velocities: &[f64], positions: &[f64]) -> f64 {
        let (lowest_m, highest_m) = (self.settings.tool_lowest_m, self.settings.tool_highest_m);
        if lowest_m.is_none() && highest_m.is_none() {
            return 1.0;
        }
        let model = &self.model;
        let mut configuration = model.kinematics.zero();
        configuration.apply_group(&model.arm, positions);
        let poses = model.kinematics.root_from_links(&configuration);
        let tool = Point3::from(poses.get(model.tool).translation.vector);
        let jacobian = model.kinematics.jacobian(&poses, model.tool, &tool, &model.arm);
        let rising = (jacobian.row(2) * DVector::from_column_slice(velocities))[0];
        let left_m = if rising < 0.0 {
            lowest_m.map(|lowest| tool.z - lowest)
        } else {
            highest_m.map(|highest| highest - tool.z)
        };
        let bound = left_m.map_or(f64::INFINITY, |left_m| braking_bound(left_m, TOOL_BRAKING_M_PER_S2, NEXT_S));
        (bound / rising.abs().max(1e-9)).min(1.0)
    }
}
