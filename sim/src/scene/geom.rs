//! Shapes of geoms: their sizes, poses and volumes.

use super::bodies::to_pose;
use super::mesh::{find_mesh, mesh_volume_m3};
use super::model::{SceneMesh, SceneShape};
use dsm::Pose;
use mjcf_rs::body::{Geom, GeomType};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};

/// Pose in the body and shape of a geom. The error says what was expected.
pub(super) fn shape_of(geom: &Geom, meshes: &[SceneMesh]) -> Result<(Pose, SceneShape), String> {
    let mut size = geom.size;
    let mut pose = to_pose(&geom.pose);
    if let Some([x1, y1, z1, x2, y2, z2]) = geom.fromto {
        let (from, to) = (Point3::new(x1, y1, z1), Point3::new(x2, y2, z2));
        let axis = to - from;
        // MuJoCo points the local z axis from the first to the second point.
        let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        pose = Pose::from_parts(Translation3::from(nalgebra::center(&from, &to).coords), rotation);
        let half = 0.5 * axis.norm();
        match geom.type_ {
            GeomType::Capsule | GeomType::Cylinder => size[1] = half,
            GeomType::Box | GeomType::Ellipsoid => {
                size[1] = size[0];
                size[2] = half;
            }
            _ => return Err("`fromto` only on a capsule, cylinder, box or ellipsoid".to_owned()),
        }
    }
    let needed = match geom.type_ {
        GeomType::Sphere => 1,
        GeomType::Capsule | GeomType::Cylinder => 2,
        GeomType::Box | GeomType::Ellipsoid => 3,
        _ => 0,
    };
    if size[..needed].iter().any(|value| *value <= 0.0) {
        if geom.mesh.is_some() {
            return Err(format!("{needed} positive numbers: shapes are not fitted to meshes"));
        }
        return Err(format!("{needed} positive numbers"));
    }
    let shape = match geom.type_ {
        GeomType::Plane => SceneShape::Plane { half_m: [size[0], size[1]] },
        GeomType::Sphere => SceneShape::Sphere { radius_m: size[0] },
        GeomType::Capsule => SceneShape::Capsule { radius_m: size[0], half_length_m: size[1] },
        GeomType::Cylinder => SceneShape::Cylinder { radius_m: size[0], half_length_m: size[1] },
        GeomType::Ellipsoid => SceneShape::Ellipsoid { radii_m: Vector3::from(size) },
        GeomType::Box => SceneShape::Box { half_m: Vector3::from(size) },
        GeomType::Mesh => match geom.mesh.as_deref().and_then(|name| find_mesh(meshes, name)) {
            Some(mesh) => SceneShape::Mesh { mesh },
            None => return Err("a `mesh` of the asset block".to_owned()),
        },
        GeomType::Hfield | GeomType::Sdf => return Err("a shape other than hfield or sdf".to_owned()),
    };
    Ok((pose, shape))
}

/// Volume of a shape in cubic metres; 0 for a plane.
pub(super) fn volume_m3(shape: &SceneShape, meshes: &[SceneMesh]) -> f64 {
    use std::f64::consts::PI;
    match shape {
        SceneShape::Plane { .. } => 0.0,
        SceneShape::Box { half_m } => 8.0 * half_m.product(),
        SceneShape::Sphere { radius_m } => 4.0 / 3.0 * PI * radius_m.powi(3),
        SceneShape::Cylinder { radius_m, half_length_m } => 2.0 * PI * radius_m.powi(2) * half_length_m,
        SceneShape::Capsule { radius_m, half_length_m } => {
            PI * radius_m.powi(2) * (4.0 / 3.0 * radius_m + 2.0 * half_length_m)
        }
        SceneShape::Ellipsoid { radii_m } => 4.0 / 3.0 * PI * radii_m.product(),
        SceneShape::Mesh { mesh } => mesh_volume_m3(&meshes[*mesh]),
    }
}
