//! How the mass of a scene's body is spread, the same for every engine.

use super::PhysicsError;
use super::convert::{from_point, from_vector, to_pose};
use super::shapes::scene_shape;
use crate::scene::{BodyMotion, MassSpread, SceneBody, SceneModel};
use nalgebra::{Point3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rapier3d::prelude::MassProperties;
use rapier3d::prelude::SharedShape;

/// Mass properties of a body in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyInertia {
    /// Kilograms.
    pub mass_kg: f64,
    /// Centre of mass.
    pub center_in_body: Point3<f64>,
    /// Rotation of the principal axes.
    pub body_from_principal: UnitQuaternion<f64>,
    /// Moments about them, kg m^2.
    pub moments_kg_m2: Vector3<f64>,
}

/// Mass properties of a body that moves: as the scene says, else its mass spread over the colliding geoms by volume.
///
/// # Errors
/// [`PhysicsError::NoMass`] without a mass, [`PhysicsError::BadShape`] without volume.
pub fn body_inertia(scene: &SceneModel, body: &SceneBody) -> Result<BodyInertia, PhysicsError> {
    if let Some(spread) = &body.spread {
        return written_inertia(body, spread);
    }
    let mut shapes = Vec::new();
    for geom in body.geoms.iter().filter(|geom| geom.collides) {
        let (geom_from_shape, shape) = scene_shape(scene, &body.name, &geom.shape, body.motion)?;
        shapes.push((to_pose(&geom.body_from_geom) * geom_from_shape, shape));
    }
    let density = density(body, shapes.iter().map(|(_, shape)| shape))?;
    let mut sum: MassProperties = nalgebra::zero();
    for (pose, shape) in &shapes {
        sum += shape.mass_properties(density).transform_by(pose);
    }
    let frame = sum.principal_inertia_local_frame;
    let rotation = Quaternion::new(f64::from(frame.w), f64::from(frame.x), f64::from(frame.y), f64::from(frame.z));
    Ok(BodyInertia {
        mass_kg: body.mass_kg,
        center_in_body: from_point(sum.local_com),
        body_from_principal: UnitQuaternion::new_normalize(rotation),
        moments_kg_m2: from_vector(sum.principal_inertia()),
    })
}

/// What the scene says, about the principal axes.
fn written_inertia(body: &SceneBody, spread: &MassSpread) -> Result<BodyInertia, PhysicsError> {
    if !(body.mass_kg > 0.0 && body.mass_kg.is_finite()) {
        return Err(PhysicsError::NoMass { name: body.name.clone(), mass_kg: body.mass_kg });
    }
    let eigen = spread.inertia_kg_m2.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let moments = eigen.eigenvalues;
    if !moments.iter().all(|moment| moment.is_finite() && *moment > 0.0) {
        let reason = format!("principal moments of inertia must be above 0, got {:?}", moments.as_slice());
        return Err(PhysicsError::BadShape { owner: body.name.clone(), reason });
    }
    Ok(BodyInertia {
        mass_kg: body.mass_kg,
        center_in_body: spread.center_in_body,
        body_from_principal: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
        moments_kg_m2: moments,
    })
}

/// Density that gives a body its mass, kg/m^3; 0 for fixed ones.
pub(super) fn density<'a>(
    body: &SceneBody,
    shapes: impl Iterator<Item = &'a SharedShape>,
) -> Result<f32, PhysicsError> {
    if body.motion == BodyMotion::Fixed {
        return Ok(0.0);
    }
    if !(body.mass_kg > 0.0 && body.mass_kg.is_finite()) {
        return Err(PhysicsError::NoMass { name: body.name.clone(), mass_kg: body.mass_kg });
    }
    let volume: f32 = shapes.map(|shape| shape.mass_properties(1.0).mass()).sum();
    let density = body.mass_kg as f32 / volume;
    if !density.is_finite() {
        let reason = "a body that moves needs a colliding geom with volume".into();
        return Err(PhysicsError::BadShape { owner: body.name.clone(), reason });
    }
    Ok(density)
}
