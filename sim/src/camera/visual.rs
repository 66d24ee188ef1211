//! What the robot looks like.

use crate::scene::SceneShape;
use dsm::Pose;
use dsm_robot::model::Kinematics;
use dsm_robot::model::shapes::{Geometry, Mesh};
use std::sync::Arc;

/// One visible shape of a robot link.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotVisual {
    /// Index of its link in the robot's list of links, and in the list of link poses that the rig is given.
    pub link: usize,
    /// Pose of the shape in the link frame.
    pub link_from_shape: Pose,
    /// The shape.
    pub geometry: Geometry,
    /// Colour, sRGB and alpha, 0 to 1.
    pub rgba: [f32; 4],
}

/// The visuals of all links.
pub fn robot_visuals(robot: &Kinematics) -> Vec<RobotVisual> {
    let of_links = robot.links.iter().enumerate();
    let visuals = of_links.flat_map(|(link, own)| own.visuals.iter().map(move |visual| (link, visual)));
    let visuals = visuals.map(|(link, visual)| RobotVisual {
        link,
        link_from_shape: visual.link_from_shape,
        geometry: visual.geometry.clone(),
        rgba: visual.rgba,
    });
    visuals.collect()
}

/// The geometry as a solid, or the mesh that it is.
pub(super) fn as_solid(geometry: &Geometry) -> Result<SceneShape, &Arc<Mesh>> {
    Ok(match geometry {
        Geometry::Box { size_m } => SceneShape::Box { half_m: size_m * 0.5 },
        Geometry::Cylinder { radius_m, length_m } => {
            SceneShape::Cylinder { radius_m: *radius_m, half_length_m: 0.5 * length_m }
        }
        Geometry::Capsule { radius_m, length_m } => {
            SceneShape::Capsule { radius_m: *radius_m, half_length_m: 0.5 * length_m }
        }
        Geometry::Sphere { radius_m } => SceneShape::Sphere { radius_m: *radius_m },
        Geometry::Mesh(mesh) => return Err(mesh),
    })
}
