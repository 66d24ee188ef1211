//! Collision shapes of scene geoms and URDF links.

use super::convert::to_pose;
use super::{PhysicsError, SLAB_M};
use crate::scene::{BodyMotion, SceneModel, SceneShape};
use dsm::Pose;
use dsm_robot::model::shapes::Geometry;
use nalgebra::UnitQuaternion;
use rapier3d::math::{Pose as RapierPose, Vector};
use rapier3d::parry::shape::SharedShape;
use std::f64::consts::FRAC_PI_2;

/// Rapier's cylinders and capsules lie along y, ours along z.
fn z_from_y() -> Pose {
    Pose::from_parts(Default::default(), UnitQuaternion::from_euler_angles(FRAC_PI_2, 0.0, 0.0))
}

fn bad(owner: &str, reason: &str) -> PhysicsError {
    PhysicsError::BadShape { owner: owner.into(), reason: reason.into() }
}

fn positive(owner: &str, values: &[f64]) -> Result<(), PhysicsError> {
    let fine = values.iter().all(|v| v.is_finite() && *v > 0.0);
    if fine { Ok(()) } else { Err(bad(owner, &format!("sizes must be above 0, got {values:?}"))) }
}

/// The collision shape of a scene geom and its pose in the geom's frame.
///
/// Meshes of bodies that move become their convex hull, those of fixed bodies stay triangle meshes.
pub(crate) fn scene_shape(
    scene: &SceneModel,
    owner: &str,
    shape: &SceneShape,
    motion: BodyMotion,
) -> Result<(RapierPose, SharedShape), PhysicsError> {
    let centred = |shape| Ok((RapierPose::IDENTITY, shape));
    let along_z = |shape| Ok((to_pose(&z_from_y()), shape));
    match shape {
        SceneShape::Plane { half_m: [x, y] } if *x > 0.0 && *y > 0.0 => Ok((
            to_pose(&Pose::translation(0.0, 0.0, -0.5 * SLAB_M)),
            SharedShape::cuboid(*x as f32, *y as f32, 0.5 * SLAB_M as f32),
        )),
        SceneShape::Plane { .. } => centred(SharedShape::halfspace(Vector::Z)),
        SceneShape::Box { half_m } => {
            positive(owner, half_m.as_slice())?;
            centred(SharedShape::cuboid(half_m.x as f32, half_m.y as f32, half_m.z as f32))
        }
        SceneShape::Sphere { radius_m } => {
            positive(owner, &[*radius_m])?;
            centred(SharedShape::ball(*radius_m as f32))
        }
        SceneShape::Cylinder { radius_m, half_length_m } => {
            positive(owner, &[*radius_m, *half_length_m])?;
            along_z(SharedShape::cylinder(*half_length_m as f32, *radius_m as f32))
        }
        SceneShape::Capsule { radius_m, half_length_m } => {
            positive(owner, &[*radius_m, *half_length_m])?;
            along_z(SharedShape::capsule_y(*half_length_m as f32, *radius_m as f32))
        }
        SceneShape::Ellipsoid { radii_m } => {
            positive(owner, radii_m.as_slice())?;
            let points = ellipsoid_points([radii_m.x as f32, radii_m.y as f32, radii_m.z as f32]);
            centred(SharedShape::convex_hull(&points).ok_or_else(|| bad(owner, "the ellipsoid has no hull"))?)
        }
        SceneShape::Mesh { mesh } => {
            let mesh = scene.meshes.get(*mesh).ok_or_else(|| bad(owner, "the mesh index is out of range"))?;
            let points: Vec<Vector> = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
            let shape = match motion {
                BodyMotion::Free | BodyMotion::Jointed => SharedShape::convex_hull(&points),
                BodyMotion::Fixed => SharedShape::trimesh(points, mesh.indices.clone()).ok(),
            };
            centred(shape.ok_or_else(|| bad(owner, &format!("mesh `{}` encloses no volume", mesh.name)))?)
        }
    }
}

/// Points on an ellipsoid, dense enough that its hull is within 1 % of it.
fn ellipsoid_points(radii: [f32; 3]) -> Vec<Vector> {
    let (rings, sectors) = (12_u8, 24_u8);
    let mut points = vec![Vector::new(0.0, 0.0, radii[2]), Vector::new(0.0, 0.0, -radii[2])];
    for ring in 1..rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for sector in 0..sectors {
            let around = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
            let unit = [polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()];
            points.push(Vector::new(radii[0] * unit[0] as f32, radii[1] * unit[1] as f32, radii[2] * unit[2] as f32));
        }
    }
    points
}

/// The collision shape of a link's geometry and its pose in the geometry's frame; meshes become their convex hull.
pub(super) fn link_shape(owner: &str, geometry: &Geometry) -> Result<(RapierPose, SharedShape), PhysicsError> {
    match geometry {
        Geometry::Box { size_m } => {
            positive(owner, size_m.as_slice())?;
            let half = size_m.map(|s| 0.5 * s as f32);
            Ok((RapierPose::IDENTITY, SharedShape::cuboid(half.x, half.y, half.z)))
        }
        Geometry::Cylinder { radius_m, length_m } => {
            positive(owner, &[*radius_m, *length_m])?;
            Ok((to_pose(&z_from_y()), SharedShape::cylinder(0.5 * *length_m as f32, *radius_m as f32)))
        }
        Geometry::Capsule { radius_m, length_m } => {
            positive(owner, &[*radius_m, *length_m])?;
            Ok((to_pose(&z_from_y()), SharedShape::capsule_y(0.5 * *length_m as f32, *radius_m as f32)))
        }
        Geometry::Sphere { radius_m } => {
            positive(owner, &[*radius_m])?;
            Ok((RapierPose::IDENTITY, SharedShape::ball(*radius_m as f32)))
        }
        Geometry::Mesh(mesh) => {
            let corners: Vec<Vector> =
                mesh.vertices.iter().map(|p| Vector::new(p.x as f32, p.y as f32, p.z as f32)).collect();
            let hull = SharedShape::convex_hull(&corners)
                .ok_or_else(|| bad(owner, &format!("mesh `{}` encloses no volume", mesh.file.display())))?;
            Ok((RapierPose::IDENTITY, hull))
        }
    }
}
