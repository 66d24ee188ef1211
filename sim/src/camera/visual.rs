//! What the robot looks like.

use crate::scene::SceneShape;
use dsm::Pose;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use thiserror::Error;

/// One visible shape of a robot link.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotVisual {
    /// Index of its link in the list of link names, and of link poses, that the rig is given.
    pub link: usize,
    /// Pose of the shape in the link frame.
    pub link_from_shape: Pose,
    /// The shape.
    pub shape: SceneShape,
    /// Colour, sRGB and alpha, 0 to 1.
    pub rgba: [f32; 4],
}

/// Why a robot cannot be drawn.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum VisualError {
    /// A visual is a mesh file; boxes, cylinders, capsules and spheres can be drawn.
    #[error("visual of link `{link}` is the mesh `{file}`; boxes, cylinders, capsules and spheres can be drawn")]
    Mesh {
        /// The link.
        link: String,
        /// The file it names.
        file: String,
    },
    /// A link that is not in the list of links.
    #[error("link `{link}` is not among the links {known:?}")]
    NoLink {
        /// The link.
        link: String,
        /// The links there are.
        known: Vec<String>,
    },
}

/// The colour of a visual without material: URDF leaves it open.
const DEFAULT_RGBA: [f32; 4] = [0.6, 0.6, 0.62, 1.0];

/// The visuals of a URDF; links are numbered by their place in `link_names`.
pub fn visuals_from_urdf(robot: &urdf_rs::Robot, link_names: &[String]) -> Result<Vec<RobotVisual>, VisualError> {
    // A material may be defined once, anywhere, and then only be named.
    let visuals = || robot.links.iter().flat_map(|link| link.visual.iter().map(move |visual| (link, visual)));
    let named: BTreeMap<&str, [f32; 4]> = (robot.materials.iter())
        .chain(visuals().filter_map(|(_, visual)| visual.material.as_ref()))
        .filter_map(|material| Some((material.name.as_str(), color(material)?)))
        .collect();
    visuals()
        .map(|(link, visual)| {
            let index = link_names.iter().position(|name| *name == link.name);
            let rgba = visual.material.as_ref().and_then(|m| color(m).or_else(|| named.get(m.name.as_str()).copied()));
            let (xyz, rpy) = (visual.origin.xyz.0, visual.origin.rpy.0);
            Ok(RobotVisual {
                link: index
                    .ok_or_else(|| VisualError::NoLink { link: link.name.clone(), known: link_names.to_vec() })?,
                link_from_shape: Pose::from_parts(
                    Translation3::new(xyz[0], xyz[1], xyz[2]),
                    UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]),
                ),
                shape: shape(&visual.geometry, &link.name)?,
                rgba: rgba.unwrap_or(DEFAULT_RGBA),
            })
        })
        .collect()
}

fn color(material: &urdf_rs::Material) -> Option<[f32; 4]> {
    material.color.as_ref().map(|color| color.rgba.0.map(|value| value as f32))
}

fn shape(geometry: &urdf_rs::Geometry, link: &str) -> Result<SceneShape, VisualError> {
    use urdf_rs::Geometry;
    Ok(match geometry {
        Geometry::Box { size } => SceneShape::Box { half_m: Vector3::from(size.0) * 0.5 },
        Geometry::Cylinder { radius, length } => {
            SceneShape::Cylinder { radius_m: *radius, half_length_m: 0.5 * length }
        }
        Geometry::Capsule { radius, length } => SceneShape::Capsule { radius_m: *radius, half_length_m: 0.5 * length },
        Geometry::Sphere { radius } => SceneShape::Sphere { radius_m: *radius },
        Geometry::Mesh { filename, .. } => {
            return Err(VisualError::Mesh { link: link.to_owned(), file: filename.clone() });
        }
    })
}

#[cfg(test)]
mod tests {
    //! Contract: shapes, places and colours come from the URDF, also where a material is only named.
    use super::*;

    #[test]
    fn named_materials_are_found_and_meshes_are_refused() {
        let text = |geometry: &str| {
            format!(
                r#"<robot name="r"><link name="a"><visual><geometry><box size="2 4 6"/></geometry>
                <material name="red"><color rgba="1 0 0 1"/></material></visual></link>
                <link name="b"><visual><origin xyz="0 0 1" rpy="0 0 1.5707963"/><geometry>{geometry}</geometry>
                <material name="red"/></visual></link></robot>"#
            )
        };
        let robot = urdf_rs::read_from_string(&text(r#"<cylinder radius="0.1" length="1"/>"#)).expect("sound URDF");
        let names = ["b".to_owned(), "a".to_owned()];
        let visuals = visuals_from_urdf(&robot, &names).expect("sound visuals");
        assert_eq!(visuals[0].shape, SceneShape::Box { half_m: Vector3::new(1.0, 2.0, 3.0) });
        assert_eq!((visuals[0].link, visuals[1].link), (1, 0));
        assert_eq!(visuals[1].rgba, [1.0, 0.0, 0.0, 1.0]);
        let turned = visuals[1].link_from_shape * nalgebra::Point3::new(1.0, 0.0, 0.0);
        assert!((turned - nalgebra::Point3::new(0.0, 1.0, 1.0)).norm() < 1e-6);
        let missing = visuals_from_urdf(&robot, &names[..1]);
        assert!(matches!(missing, Err(VisualError::NoLink { link, .. }) if link == "a"));
        let robot = urdf_rs::read_from_string(&text(r#"<mesh filename="x.stl"/>"#)).expect("sound URDF");
        assert!(matches!(visuals_from_urdf(&robot, &names), Err(VisualError::Mesh { file, .. }) if file == "x.stl"));
    }
}
