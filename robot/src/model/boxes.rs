//! Boxes around the links, for leaving the robot out of what it sees.

use super::{Configuration, RobotModel};
use crate::model::shapes::from_parry;
use dsm::Pose;
use dsm::geometry::OrientedBox;
use nalgebra::Point3;

impl RobotModel {
    /// One box per collision shape in the world frame.
    pub fn link_boxes(&self, configuration: &Configuration, world_from_base: &Pose) -> Vec<OrientedBox> {
        let poses = self.kinematics.root_from_links(configuration);
        let links = self.kinematics.links.iter().zip(poses.as_slice());
        links
            .flat_map(|(link, base_from_link)| link.collisions.iter().map(move |shape| (shape, base_from_link)))
            .filter_map(|(shape, base_from_link)| {
                let (parry_shape, shape_from_parry) = shape.geometry.find_parry_shape()?;
                let bounds = parry_shape.compute_local_aabb();
                let world_from_shape = world_from_base * base_from_link * shape.link_from_shape * shape_from_parry;
                Some(OrientedBox {
                    center: world_from_shape * Point3::from(from_parry(bounds.center())),
                    size: from_parry(bounds.extents()),
                    rotation: world_from_shape.rotation,
                })
            })
            .collect()
    }
}
