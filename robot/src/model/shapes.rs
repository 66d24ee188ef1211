//! Shapes of links: for collision checks and for the cameras.

use dsm::Pose;
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use parry3d::shape::SharedShape;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;
use std::sync::Arc;

/// A triangle mesh in its link's shape frame, metres (the URDF's scale applied).
#[derive(Debug, PartialEq)]
pub struct Mesh {
    /// The file it came from.
    pub file: PathBuf,
    /// Corners in metres.
    pub vertices: Vec<Point3<f64>>,
    /// Triangles as indices of corners, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A solid about the origin of its own frame. Cylinders and capsules stand along z.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A box with full edge lengths.
    Box {
        /// Edge lengths in metres.
        size_m: Vector3<f64>,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius in metres.
        radius_m: f64,
        /// Full length in metres.
        length_m: f64,
    },
    /// A capsule along z.
    Capsule {
        /// Radius in metres.
        radius_m: f64,
        /// Length of the straight part in metres.
        length_m: f64,
    },
    /// A sphere.
    Sphere {
        /// Radius in metres.
        radius_m: f64,
    },
    /// A mesh; collision checks use its convex hull.
    Mesh(Arc<Mesh>),
}

/// A shape that collides.
#[derive(Clone, Debug, PartialEq)]
pub struct CollisionShape {
    /// Where it sits on the link.
    pub link_from_shape: Pose,
    /// What it is.
    pub geometry: Geometry,
}

/// A shape that is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct VisualShape {
    /// Where it sits on the link.
    pub link_from_shape: Pose,
    /// What it is.
    pub geometry: Geometry,
    /// Colour, sRGB with alpha, 0 to 1; mid grey where the URDF is silent.
    pub rgba: [f32; 4],
}

/// The same rigid transform in the collision library's single precision.
pub(crate) fn to_parry(pose: &Pose) -> parry3d::math::Pose {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    parry3d::math::Pose::from_parts(
        parry3d::math::Vector::new(t.x as f32, t.y as f32, t.z as f32),
        parry3d::math::Rotation::from_xyzw(q.x as f32, q.y as f32, q.z as f32, q.w as f32).normalize(),
    )
}

/// A vector of the collision library in double precision.
pub(crate) fn from_parry(vector: parry3d::math::Vector) -> Vector3<f64> {
    Vector3::new(f64::from(vector.x), f64::from(vector.y), f64::from(vector.z))
}

impl Geometry {
    /// The collision library's shape and where it sits in the shape frame; `None` for a mesh without a hull (fewer
    /// than four corners, or all of them in one plane).
    pub fn find_parry_shape(&self) -> Option<(SharedShape, Pose)> {
        let z = |half: f64| parry3d::math::Vector::new(0.0, 0.0, half as f32);
        let shape = match self {
            Self::Box { size_m: s } => SharedShape::cuboid((s.x * 0.5) as f32, (s.y * 0.5) as f32, (s.z * 0.5) as f32),
            Self::Capsule { radius_m, length_m } => {
                SharedShape::capsule(z(-length_m * 0.5), z(length_m * 0.5), *radius_m as f32)
            }
            Self::Sphere { radius_m } => SharedShape::ball(*radius_m as f32),
            // parry's cylinder stands along y.
            Self::Cylinder { radius_m, length_m } => {
                let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
                let cylinder = SharedShape::cylinder((length_m * 0.5) as f32, *radius_m as f32);
                return Some((cylinder, Pose::from_parts(Translation3::identity(), upright)));
            }
            Self::Mesh(mesh) => {
                let corner = |p: &Point3<f64>| parry3d::math::Vector::new(p.x as f32, p.y as f32, p.z as f32);
                let corners: Vec<_> = mesh.vertices.iter().map(corner).collect();
                SharedShape::convex_hull(&corners)?
            }
        };
        Some((shape, Pose::identity()))
    }
}
