//! A robot with something in its hand.

use super::collision::CollisionModel;
use super::shapes::{CollisionShape, Geometry};
use super::{LinkId, RobotModel};
use dsm::geometry::OrientedBox;
use nalgebra::Point2;
use std::sync::Arc;

impl RobotModel {
    /// The same robot holding a thing, given as a box in the tool frame: from here on the thing counts in all collision
    /// checks and in what the robot leaves out of what it sees. The fingers may touch it.
    pub fn holding(&self, held_in_tool: &OrientedBox) -> Self {
        let mut model = self.clone();
        model.kinematics.links[self.tool.0].collisions.push(CollisionShape {
            link_from_shape: held_in_tool.world_from_box(),
            geometry: Geometry::Box { size_m: held_in_tool.size },
        });
        let link = |name: &String| self.kinematics.find_link(name);
        let pairs = &self.settings.collision.ignored_pairs;
        let mut ignored: Vec<(LinkId, LinkId)> =
            pairs.iter().filter_map(|[first, second]| Some((link(first)?, link(second)?))).collect();
        ignored.extend(self.settings.gripper.finger_links.iter().filter_map(|name| Some((self.tool, link(name)?))));
        model.collision = Arc::new(CollisionModel::new(&model.kinematics, &ignored));
        model
    }

    /// Radius about the base's axis that holds the whole robot in this configuration, metres: its footprint when it
    /// carries something. What is fixed to the base lies within the footprint that the robot's file states.
    pub fn radius_m(&self, configuration: &super::Configuration) -> f64 {
        let bodies = self.kinematics.rigid_bodies();
        let base = bodies[self.kinematics.root.0];
        let moving: Vec<LinkId> = (0..bodies.len()).map(LinkId).filter(|link| bodies[link.0] != base).collect();
        let boxes = self.boxes_of(&moving, configuration, &dsm::Pose::identity());
        let corners = boxes.iter().flat_map(OrientedBox::corners);
        corners
            .map(|corner| Point2::from(corner.xy()).coords.norm())
            .fold(self.settings.base.footprint_radius_m, f64::max)
    }
}
