//! Boxes around the links, for leaving the robot out of what it sees.

use super::{Configuration, LinkId, RobotModel};
use crate::model::shapes::{Geometry, from_parry};
use dsm::Pose;
use dsm::geometry::OrientedBox;
use nalgebra::{Point3, Vector3};

impl RobotModel {
    /// One box per collision shape in the world frame.
    pub fn link_boxes(&self, configuration: &Configuration, world_from_base: &Pose) -> Vec<OrientedBox> {
        let links: Vec<LinkId> = (0..self.kinematics.links.len()).map(LinkId).collect();
        self.boxes_of(&links, configuration, world_from_base)
    }

    /// One box per collision shape of these links in the world frame.
    pub(super) fn boxes_of(
        &self,
        links: &[LinkId],
        configuration: &Configuration,
        world_from_base: &Pose,
    ) -> Vec<OrientedBox> {
        let poses = self.kinematics.root_from_links(configuration);
        links
            .iter()
            .map(|link| (&self.kinematics.links[link.0], &poses.as_slice()[link.0]))
            .flat_map(|(link, base_from_link)| link.collisions.iter().map(move |shape| (shape, base_from_link)))
            .filter_map(|(shape, base_from_link)| {
                let (center, size, shape_from_box) = find_bounds(&shape.geometry)?;
                let world_from_shape = world_from_base * base_from_link * shape.link_from_shape * shape_from_box;
                Some(OrientedBox { center: world_from_shape * center, size, rotation: world_from_shape.rotation })
            })
            .collect()
    }
}

/// Centre and size of the box about a geometry, in a frame that lies so in the shape's frame.
fn find_bounds(geometry: &Geometry) -> Option<(Point3<f64>, Vector3<f64>, Pose)> {
    if let Geometry::Mesh(mesh) = geometry {
        let first = mesh.vertices.first()?.coords;
        let fold = |pick: fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>| {
            mesh.vertices.iter().fold(first, |bound, corner| pick(&bound, &corner.coords))
        };
        let (low, high) = (fold(Vector3::inf), fold(Vector3::sup));
        return Some((Point3::from((low + high) * 0.5), high - low, Pose::identity()));
    }
    let (shape, shape_from_parry) = geometry.find_parry_shape()?;
    let bounds = shape.compute_local_aabb();
    Some((Point3::from(from_parry(bounds.center())), from_parry(bounds.extents()), shape_from_parry))
}
