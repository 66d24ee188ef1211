//! Solid things near the robot.

use super::collision::Solid;
use super::shapes::{from_parry, to_parry};
use dsm::Pose;
use nalgebra::{Point3, Vector3};
use parry3d::shape::SharedShape;
use std::sync::Arc;

/// A convex solid given by its corners.
#[derive(Clone)]
pub struct Hull {
    corners: Vec<Point3<f64>>,
    shape: SharedShape,
    /// Centre and half edges of the box about it.
    bounds: (Point3<f64>, Vector3<f64>),
}

impl Hull {
    /// The convex hull of points; `None` when they lie in one plane or are not finite.
    pub fn of(points: &[Point3<f64>]) -> Option<Self> {
        if points.len() < 4 || points.iter().any(|p| p.coords.iter().any(|v| !v.is_finite())) {
            return None;
        }
        let corners: Vec<_> =
            points.iter().map(|p| parry3d::math::Vector::new(p.x as f32, p.y as f32, p.z as f32)).collect();
        let shape = SharedShape::convex_hull(&corners)?;
        let aabb = shape.compute_local_aabb();
        let bounds = (Point3::from(from_parry(aabb.center())), from_parry(aabb.half_extents()));
        Some(Self { corners: points.to_vec(), shape, bounds })
    }

    /// The points it was made of.
    pub fn corners(&self) -> &[Point3<f64>] {
        &self.corners
    }
}

impl PartialEq for Hull {
    fn eq(&self, other: &Self) -> bool {
        self.corners == other.corners
    }
}

impl std::fmt::Debug for Hull {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hull").field("corners", &self.corners).finish()
    }
}

/// Something solid near the robot, in the base frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Obstacle {
    /// An oriented box.
    Box {
        /// Where its centre and axes are.
        base_from_box: Pose,
        /// Half of its edge lengths in metres.
        half_size_m: Vector3<f64>,
        /// Velocity of its centre in m/s.
        velocity_m_per_s: Vector3<f64>,
    },
    /// A ball: a voxel or a measured point with its margin.
    Ball {
        /// Its centre.
        center_in_base: Point3<f64>,
        /// Radius in metres.
        radius_m: f64,
        /// Velocity of its centre in m/s.
        velocity_m_per_s: Vector3<f64>,
    },
    /// A convex hull, for things that a box fits badly.
    Hull {
        /// Where the frame of its corners is.
        base_from_hull: Pose,
        /// The solid.
        hull: Arc<Hull>,
        /// Velocity of its frame in m/s.
        velocity_m_per_s: Vector3<f64>,
    },
}

impl Obstacle {
    /// A box that does not move.
    pub fn still_box(base_from_box: Pose, half_size_m: Vector3<f64>) -> Self {
        Self::Box { base_from_box, half_size_m, velocity_m_per_s: Vector3::zeros() }
    }

    /// A ball that does not move.
    pub fn still_ball(center_in_base: Point3<f64>, radius_m: f64) -> Self {
        Self::Ball { center_in_base, radius_m, velocity_m_per_s: Vector3::zeros() }
    }

    /// A convex hull that does not move.
    pub fn still_hull(base_from_hull: Pose, hull: Arc<Hull>) -> Self {
        Self::Hull { base_from_hull, hull, velocity_m_per_s: Vector3::zeros() }
    }

    /// Its velocity in m/s.
    pub fn velocity_m_per_s(&self) -> Vector3<f64> {
        match self {
            Self::Box { velocity_m_per_s, .. }
            | Self::Ball { velocity_m_per_s, .. }
            | Self::Hull { velocity_m_per_s, .. } => *velocity_m_per_s,
        }
    }

    /// The same thing, velocity included, in another frame.
    pub fn seen_from(&self, other_from_base: &Pose) -> Self {
        let mut seen = self.clone();
        match &mut seen {
            Self::Box { base_from_box, velocity_m_per_s, .. } => {
                *base_from_box = other_from_base * *base_from_box;
                *velocity_m_per_s = other_from_base * *velocity_m_per_s;
            }
            Self::Ball { center_in_base, velocity_m_per_s, .. } => {
                *center_in_base = other_from_base * *center_in_base;
                *velocity_m_per_s = other_from_base * *velocity_m_per_s;
            }
            Self::Hull { base_from_hull, velocity_m_per_s, .. } => {
                *base_from_hull = other_from_base * *base_from_hull;
                *velocity_m_per_s = other_from_base * *velocity_m_per_s;
            }
        }
        seen
    }

    /// Whether all its numbers are.
    pub fn is_finite(&self) -> bool {
        let of_pose = |pose: &Pose| pose.translation.vector.sum() + pose.rotation.coords.sum();
        let place = match self {
            Self::Box { base_from_box, half_size_m, .. } => of_pose(base_from_box) + half_size_m.sum(),
            Self::Ball { center_in_base, radius_m, .. } => center_in_base.coords.sum() + radius_m,
            Self::Hull { base_from_hull, .. } => of_pose(base_from_hull),
        };
        (place + self.velocity_m_per_s().sum()).is_finite()
    }

    /// A ball about it: centre in the base frame, and radius.
    pub(super) fn ball(&self) -> (Point3<f64>, f64) {
        match self {
            Self::Box { base_from_box, half_size_m, .. } => {
                (base_from_box.translation.vector.into(), half_size_m.norm())
            }
            Self::Ball { center_in_base, radius_m, .. } => (*center_in_base, *radius_m),
            Self::Hull { base_from_hull, hull, .. } => (base_from_hull * hull.bounds.0, hull.bounds.1.norm()),
        }
    }

    /// At most the distance of a point from it in metres; 0 inside.
    pub(super) fn distance_to(&self, point: &Point3<f64>) -> f64 {
        let from_box = |offset: Vector3<f64>, half: &Vector3<f64>| (offset.abs() - half).map(|v| v.max(0.0)).norm();
        match self {
            Self::Box { base_from_box, half_size_m, .. } => {
                from_box(base_from_box.inverse_transform_point(point).coords, half_size_m)
            }
            Self::Ball { center_in_base, radius_m, .. } => ((point - center_in_base).norm() - radius_m).max(0.0),
            Self::Hull { base_from_hull, hull, .. } => {
                let (center, half) = &hull.bounds;
                from_box(base_from_hull.inverse_transform_point(point) - center, half)
            }
        }
    }

    pub(super) fn solid(&self) -> Solid {
        let (center, radius_m) = self.ball();
        let (shape, pose) = match self {
            Self::Box { base_from_box, half_size_m: h, .. } => {
                (SharedShape::cuboid(h.x as f32, h.y as f32, h.z as f32), to_parry(base_from_box))
            }
            Self::Ball { center_in_base: c, radius_m, .. } => {
                (SharedShape::ball(*radius_m as f32), to_parry(&Pose::translation(c.x, c.y, c.z)))
            }
            Self::Hull { base_from_hull, hull, .. } => (hull.shape.clone(), to_parry(base_from_hull)),
        };
        Solid { shape, pose, center, radius_m }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a hull keeps the same distances as the box with the same corners, bounds never exceed distances, and
    //! another frame changes nothing but numbers.
    use super::*;

    #[test]
    fn a_hull_is_the_box_with_its_corners() {
        let half = Vector3::new(0.1, 0.2, 0.3);
        let corners: Vec<Point3<f64>> =
            (0..8).map(|k| Point3::new(half.x * sign(k & 1), half.y * sign(k & 2), half.z * sign(k & 4))).collect();
        let hull = Arc::new(Hull::of(&corners).expect("a solid"));
        let pose = Pose::new(Vector3::new(1.0, 0.2, 0.4), Vector3::new(0.3, -0.5, 0.7));
        let (as_hull, as_box) = (Obstacle::still_hull(pose, hull), Obstacle::still_box(pose, half));
        for k in 0..20 {
            let point = Point3::new((f64::from(k) * 1.3).sin(), (f64::from(k) * 2.1).cos(), 0.1 * f64::from(k) - 0.8);
            let (a, b) = (as_hull.distance_to(&point), as_box.distance_to(&point));
            assert!((a - b).abs() < 1e-6, "{a} {b}");
            let frame = Pose::new(Vector3::new(0.3, 0.1, -0.2), Vector3::new(0.1, 0.2, -1.0));
            let seen = as_hull.seen_from(&frame).distance_to(&(frame * point));
            assert!((a - seen).abs() < 1e-9);
        }
        assert!(Hull::of(&corners[..3]).is_none());
        assert!(Hull::of(&[Point3::new(f64::NAN, 0.0, 0.0); 5]).is_none());
    }

    fn sign(bit: usize) -> f64 {
        if bit == 0 { -1.0 } else { 1.0 }
    }
}
