//! The colliding shapes of a scene for questions of geometry: what touches what, what is near, what carries what.

use crate::physics::{PhysicsError, from_vector, scene_shape, to_pose};
use crate::scene::{SceneModel, SceneShape};
use dsm::Pose;
use dsm::geometry::Aabb;
use nalgebra::Point3;
use parry3d::math::Pose as ParryPose;
use parry3d::query;
use parry3d::shape::SharedShape;

/// One colliding geom.
pub(crate) struct Solid {
    /// Index of its body in the scene.
    pub(crate) body: usize,
    /// The unbounded floor.
    pub(crate) is_plane: bool,
    body_from_solid: ParryPose,
    /// Around the shape, in its body's frame; unbounded for planes.
    center_in_body: Point3<f64>,
    radius_m: f64,
    shape: SharedShape,
}

/// All colliding geoms of a scene, body by body.
pub(crate) struct Solids {
    list: Vec<Solid>,
    /// Where each body's solids begin in the list; one more than there are bodies.
    first: Vec<usize>,
}

impl Solids {
    /// Takes the colliding geoms of a scene.
    pub(crate) fn new(scene: &SceneModel) -> Result<Self, PhysicsError> {
        let (mut list, mut first) = (Vec::new(), vec![0]);
        for (index, body) in scene.bodies.iter().enumerate() {
            for geom in body.geoms.iter().filter(|geom| geom.collides) {
                let (geom_from_shape, shape) = scene_shape(scene, &body.name, &geom.shape, body.motion)?;
                let body_from_solid = to_pose(&geom.body_from_geom) * geom_from_shape;
                let sphere = shape.compute_bounding_sphere(&body_from_solid);
                list.push(Solid {
                    body: index,
                    center_in_body: Point3::from(from_vector(sphere.center)),
                    radius_m: f64::from(sphere.radius),
                    is_plane: matches!(geom.shape, SceneShape::Plane { half_m: [x, y] } if x <= 0.0 || y <= 0.0),
                    body_from_solid,
                    shape,
                });
            }
            first.push(list.len());
        }
        Ok(Self { list, first })
    }

    /// All solids.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Solid> {
        self.list.iter()
    }

    /// The solids of a body.
    pub(crate) fn of_body(&self, body: usize) -> &[Solid] {
        &self.list[self.first[body]..self.first[body + 1]]
    }

    /// The box around a body's solids along the world's axes; `None` without any.
    pub(crate) fn find_bounds(&self, body: usize, world_from_body: &Pose) -> Option<Aabb> {
        let corners: Vec<_> =
            self.of_body(body).iter().map(|s| s.bounds(world_from_body)).flat_map(|b| [b.min, b.max]).collect();
        Aabb::from_points(&corners)
    }

    /// Depth in metres by which two bodies overlap; negative = their distance; `None` when farther than `reach_m`.
    pub(crate) fn find_depth_m(&self, a: (usize, &Pose), b: (usize, &Pose), reach_m: f64) -> Option<f64> {
        let mut deepest: Option<f64> = None;
        for first in self.of_body(a.0) {
            for second in self.of_body(b.0) {
                let depth = first.find_depth_m(a.1, second, b.1, reach_m);
                deepest = match (deepest, depth) {
                    (Some(x), Some(y)) => Some(x.max(y)),
                    (x, y) => x.or(y),
                };
            }
        }
        deepest
    }
}

impl Solid {
    /// Whether it is surely farther from an upright cylinder than `reach_m`: cheaper than any box.
    pub(crate) fn is_far_from_column(&self, world_from_body: &Pose, column: &Column, reach_m: f64) -> bool {
        // Boxes and spheres of the collision library are single precision.
        const SLACK_M: f64 = 0.05;
        let center = world_from_body * self.center_in_body;
        let away_m = (center.x - column.x_m).hypot(center.y - column.y_m);
        // Boxes touch before their spheres do: along the diagonal a box reaches farther by the root of two.
        away_m > std::f64::consts::SQRT_2 * (self.radius_m + column.radius_m + reach_m + SLACK_M)
    }

    /// The box around it along the world's axes.
    pub(crate) fn bounds(&self, world_from_body: &Pose) -> Aabb {
        let aabb = self.shape.compute_aabb(&(to_pose(world_from_body) * self.body_from_solid));
        Aabb { min: Point3::from(from_vector(aabb.mins)), max: Point3::from(from_vector(aabb.maxs)) }
    }

    fn find_depth_m(&self, own: &Pose, other: &Self, its: &Pose, reach_m: f64) -> Option<f64> {
        match (self.is_plane, other.is_plane) {
            (true, true) => return None,
            (true, false) => return other.find_depth_in_plane_m(its, self, own, reach_m),
            (false, true) => return self.find_depth_in_plane_m(own, other, its, reach_m),
            (false, false) => {}
        }
        let far = self.bounds(own).grown(reach_m).find_intersection(&other.bounds(its)).is_none();
        if far {
            return None;
        }
        let (pose_a, pose_b) = (to_pose(own) * self.body_from_solid, to_pose(its) * other.body_from_solid);
        let contact = query::contact(&pose_a, &*self.shape, &pose_b, &*other.shape, reach_m as f32);
        contact.ok().flatten().map(|contact| -f64::from(contact.dist))
    }

    /// How deep it reaches below an unbounded plane, whose solid side is its frame's lower half.
    fn find_depth_in_plane_m(&self, own: &Pose, plane: &Self, its: &Pose, reach_m: f64) -> Option<f64> {
        let world_from_plane = to_pose(its) * plane.body_from_solid;
        let in_plane = self.shape.compute_aabb(&world_from_plane.inv_mul(&(to_pose(own) * self.body_from_solid)));
        let depth = -f64::from(in_plane.mins.z);
        (depth >= -reach_m).then_some(depth)
    }

    /// Whether a point in the world lies over it, at least `margin_m` from its sides, seen along its body's vertical.
    pub(crate) fn is_below(&self, world_from_body: &Pose, point_in_world: &Point3<f64>, margin_m: f64) -> bool {
        let point = world_from_body.inverse_transform_point(point_in_world);
        let aabb = self.shape.compute_aabb(&self.body_from_solid);
        let (low, high) = (from_vector(aabb.mins), from_vector(aabb.maxs));
        (0..2).all(|i| {
            let margin = margin_m.min(0.5 * (high[i] - low[i]));
            low[i] + margin <= point[i] && point[i] <= high[i] - margin
        })
    }

    /// Distance in metres to an upright cylinder that stands between two heights; 0 when they touch. `None` when farther
    /// than `reach_m`.
    pub(crate) fn find_distance_to_column_m(
        &self,
        world_from_body: &Pose,
        column: &Column,
        reach_m: f64,
    ) -> Option<f64> {
        if self.is_plane || self.bounds(world_from_body).find_intersection(&column.bounds().grown(reach_m)).is_none() {
            return None;
        }
        let pose = to_pose(world_from_body) * self.body_from_solid;
        let half = 0.5 * (column.top_m - column.bottom_m);
        let center = Pose::translation(column.x_m, column.y_m, column.bottom_m + half);
        // Cylinders of the collision library lie along y.
        let upright = center * Pose::rotation(nalgebra::Vector3::x() * std::f64::consts::FRAC_PI_2);
        let cylinder = SharedShape::cylinder(half as f32, column.radius_m as f32);
        let found = query::distance(&pose, &*self.shape, &to_pose(&upright), &*cylinder);
        found.ok().map(|d| f64::from(d.distance)).filter(|distance| *distance <= reach_m)
    }
}

/// An upright cylinder in the world, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) radius_m: f64,
    pub(crate) bottom_m: f64,
    pub(crate) top_m: f64,
}

impl Column {
    fn bounds(&self) -> Aabb {
        let r = self.radius_m;
        Aabb {
            min: Point3::new(self.x_m - r, self.y_m - r, self.bottom_m),
            max: Point3::new(self.x_m + r, self.y_m + r, self.top_m),
        }
    }
}
