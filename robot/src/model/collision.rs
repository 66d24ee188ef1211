//! Distances between links, and between links and obstacles.

use super::kinematics::{Kinematics, LinkId, LinkPoses};
pub use super::obstacle::Obstacle;
use super::shapes::{from_parry, to_parry};
use dsm::Pose;
use nalgebra::{Point3, Unit, Vector3};
use parry3d::query;
use parry3d::shape::SharedShape;

/// A shape at its place, with a ball about it for the first, cheap test.
pub(super) struct Solid {
    pub(super) shape: SharedShape,
    pub(super) pose: parry3d::math::Pose,
    pub(super) center: Point3<f64>,
    pub(super) radius_m: f64,
}

/// The ball about one collision shape of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartBall {
    /// The link.
    pub link: LinkId,
    /// Centre in the base frame.
    pub center: Point3<f64>,
    /// Radius in metres.
    pub radius_m: f64,
}

/// What the first link is close to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Other {
    /// Another link of the robot.
    Link(LinkId),
    /// The obstacle with this index.
    Obstacle(usize),
}

/// The closest points of a link and something else, in the base frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PairDistance {
    /// The link.
    pub link: LinkId,
    /// The other side.
    pub other: Other,
    /// Indices of the shapes in [`CollisionModel::balls`]: the link's, and the other link's.
    pub parts: (usize, Option<usize>),
    /// Distance in metres; negative is the depth of an overlap.
    pub distance_m: f64,
    /// The point on the link.
    pub point_on_link: Point3<f64>,
    /// The point on the other side.
    pub point_on_other: Point3<f64>,
    /// Unit direction from the link to the other side: moving the link along it closes the gap.
    pub normal_to_other: Unit<Vector3<f64>>,
}

/// One collision shape of a link.
#[derive(Clone, Debug)]
struct Part {
    link: LinkId,
    shape: SharedShape,
    link_from_shape: Pose,
    /// Centre of the bounding ball in the link frame, and its radius.
    center_in_link: Point3<f64>,
    radius_m: f64,
    /// The box about it: its centre and axes in the link frame, and half of its edges.
    link_from_box: Pose,
    half_size_m: Vector3<f64>,
}

/// Where the bounds of a part are, in the base frame.
struct Bounds {
    link: LinkId,
    center: Point3<f64>,
    radius_m: f64,
    base_from_box: Pose,
    half_size_m: Vector3<f64>,
}

impl Bounds {
    /// At most the distance of a ball from the part.
    fn distance_to(&self, center: &Point3<f64>, radius_m: f64) -> f64 {
        let outside = self.base_from_box.inverse_transform_point(center).coords.abs() - self.half_size_m;
        outside.map(|v| v.max(0.0)).norm() - radius_m
    }
}

/// The collision shapes of all links and the pairs to be checked.
#[derive(Clone)]
pub struct CollisionModel {
    parts: Vec<Part>,
    /// Indices of `parts`, first < second.
    pairs: Vec<(usize, usize)>,
}

impl std::fmt::Debug for CollisionModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CollisionModel").field("parts", &self.parts.len()).field("pairs", &self.pairs.len()).finish()
    }
}

impl CollisionModel {
    /// Shapes of all links. Links that one joint (or a row of fixed joints) connects are never checked against each
    /// other, nor are the `ignored` pairs.
    pub fn new(kinematics: &Kinematics, ignored: &[(LinkId, LinkId)]) -> Self {
        let mut parts = Vec::new();
        for (index, link) in kinematics.links.iter().enumerate() {
            for collision in &link.collisions {
                let Some((shape, shape_from_parry)) = collision.geometry.find_parry_shape() else { continue };
                let link_from_shape = collision.link_from_shape * shape_from_parry;
                let ball = shape.compute_local_bounding_sphere();
                let center_in_link = link_from_shape * Point3::from(from_parry(ball.center()));
                let bounds = shape.compute_local_aabb();
                let middle = from_parry(bounds.center());
                parts.push(Part {
                    link: LinkId(index),
                    shape,
                    link_from_shape,
                    center_in_link,
                    radius_m: f64::from(ball.radius()),
                    link_from_box: link_from_shape * Pose::translation(middle.x, middle.y, middle.z),
                    half_size_m: from_parry(bounds.half_extents()),
                });
            }
        }
        let bodies = kinematics.rigid_bodies();
        let neighbours = |a: usize, b: usize| {
            bodies[a] == bodies[b]
                || kinematics.joints.iter().any(|joint| {
                    let (up, down) = (bodies[joint.parent.0], bodies[joint.child.0]);
                    (up, down) == (bodies[a], bodies[b]) || (up, down) == (bodies[b], bodies[a])
                })
        };
        let mut pairs = Vec::new();
        for first in 0..parts.len() {
            for second in first + 1..parts.len() {
                let (a, b) = (parts[first].link, parts[second].link);
                let skip = ignored.contains(&(a, b)) || ignored.contains(&(b, a)) || neighbours(a.0, b.0);
                if !skip {
                    pairs.push((first, second));
                }
            }
        }
        Self { parts, pairs }
    }

    /// The same shapes with further pairs of links ignored.
    pub fn ignoring(&self, more: &[(LinkId, LinkId)]) -> Self {
        let mut model = self.clone();
        model.pairs.retain(|(first, second)| {
            let (a, b) = (self.parts[*first].link, self.parts[*second].link);
            !more.contains(&(a, b)) && !more.contains(&(b, a))
        });
        model
    }

    /// The pairs of parts that are checked against each other, first < second.
    pub fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }

    /// Balls about all shapes, in a fixed order: the parts of [`Self::self_distances_within`].
    pub fn balls(&self, poses: &LinkPoses) -> Vec<PartBall> {
        let ball = |part: &Part| PartBall { link: part.link, center: part.center(poses), radius_m: part.radius_m };
        self.parts.iter().map(ball).collect()
    }

    /// Pairs of links nearer to each other than `reach_m`, one entry for each pair of shapes, in a fixed order.
    pub fn self_distances(&self, poses: &LinkPoses, reach_m: f64) -> Vec<PairDistance> {
        self.self_distances_within(poses, |_, _| reach_m)
    }

    /// The same with a reach for each pair of parts.
    pub fn self_distances_within(&self, poses: &LinkPoses, reach_m: impl Fn(usize, usize) -> f64) -> Vec<PairDistance> {
        let bounds: Vec<Bounds> = self.parts.iter().map(|part| part.bounds(poses)).collect();
        let mut solids: Vec<Option<Solid>> = self.parts.iter().map(|_| None).collect();
        let mut found = Vec::new();
        for (k, l) in &self.pairs {
            let reach_m = reach_m(*k, *l);
            let (a, b) = (&bounds[*k], &bounds[*l]);
            if (b.center - a.center).norm() > a.radius_m + b.radius_m + reach_m
                || a.distance_to(&b.center, b.radius_m) > reach_m
                || b.distance_to(&a.center, a.radius_m) > reach_m
            {
                continue;
            }
            for part in [*k, *l] {
                solids[part].get_or_insert_with(|| self.parts[part].solid(poses));
            }
            if let (Some(first), Some(second)) = (&solids[*k], &solids[*l]) {
                let names = (a.link, Other::Link(b.link), (*k, Some(*l)));
                found.extend(find_distance(names, first, second, reach_m));
            }
        }
        found
    }

    /// Links of `only` (all when empty) nearer to an obstacle than `reach_m`, in a fixed order.
    pub fn obstacle_distances(
        &self,
        poses: &LinkPoses,
        obstacles: &[Obstacle],
        only: &[LinkId],
        reach_m: f64,
    ) -> Vec<PairDistance> {
        self.obstacle_distances_within(poses, obstacles, only, |_, _| reach_m)
    }

    /// The same with a reach for each part and obstacle.
    pub fn obstacle_distances_within(
        &self,
        poses: &LinkPoses,
        obstacles: &[Obstacle],
        only: &[LinkId],
        reach_m: impl Fn(usize, usize) -> f64,
    ) -> Vec<PairDistance> {
        let wanted: Vec<usize> =
            (0..self.parts.len()).filter(|k| only.is_empty() || only.contains(&self.parts[*k].link)).collect();
        let bounds: Vec<Bounds> = self.parts.iter().map(|part| part.bounds(poses)).collect();
        let mut solids: Vec<Option<Solid>> = self.parts.iter().map(|_| None).collect();
        let mut found = Vec::new();
        for (index, obstacle) in obstacles.iter().enumerate() {
            let mut solid = None;
            let (center, radius_m) = obstacle.ball();
            for &k in &wanted {
                let (part, bounds, reach_m) = (&self.parts[k], &bounds[k], reach_m(k, index));
                if obstacle.distance_to(&bounds.center) > part.radius_m + reach_m
                    || bounds.distance_to(&center, radius_m) > reach_m
                {
                    continue;
                }
                let first = solids[k].get_or_insert_with(|| part.solid(poses));
                let second = solid.get_or_insert_with(|| obstacle.solid());
                let names = (part.link, Other::Obstacle(index), (k, None));
                found.extend(find_distance(names, first, second, reach_m));
            }
        }
        found
    }

    /// Whether the robot, the links of `only` (all when empty), comes nearer than `margin_m` to an obstacle, or
    /// nearer than `self_margin_m` to itself.
    pub fn collides(
        &self,
        poses: &LinkPoses,
        obstacles: &[Obstacle],
        only: &[LinkId],
        margin_m: f64,
        self_margin_m: f64,
    ) -> bool {
        !self.self_distances(poses, self_margin_m).is_empty()
            || !self.obstacle_distances(poses, obstacles, only, margin_m).is_empty()
    }
}

impl Part {
    fn center(&self, poses: &LinkPoses) -> Point3<f64> {
        poses.get(self.link) * self.center_in_link
    }

    fn bounds(&self, poses: &LinkPoses) -> Bounds {
        Bounds {
            link: self.link,
            center: self.center(poses),
            radius_m: self.radius_m,
            base_from_box: poses.get(self.link) * self.link_from_box,
            half_size_m: self.half_size_m,
        }
    }

    fn solid(&self, poses: &LinkPoses) -> Solid {
        let base_from_link = poses.get(self.link);
        Solid {
            shape: self.shape.clone(),
            pose: to_parry(&(base_from_link * self.link_from_shape)),
            center: self.center(poses),
            radius_m: self.radius_m,
        }
    }
}

/// The closest points when they are nearer than `reach_m`. Callers leave out what bounding balls rule out.
fn find_distance(
    (link, other, parts): (LinkId, Other, (usize, Option<usize>)),
    first: &Solid,
    second: &Solid,
    reach_m: f64,
) -> Option<PairDistance> {
    let contact = query::contact(&first.pose, &*first.shape, &second.pose, &*second.shape, reach_m as f32);
    if let Ok(Some(contact)) = contact {
        let normal = Unit::try_new(from_parry(contact.normal1), 1e-6)?;
        return Some(PairDistance {
            link,
            other,
            parts,
            distance_m: f64::from(contact.dist),
            point_on_link: from_parry(contact.point1).into(),
            point_on_other: from_parry(contact.point2).into(),
            normal_to_other: normal,
        });
    }
    // The penetration search may give up on a deep overlap; an overlap must never pass as distance.
    let overlap = query::intersection_test(&first.pose, &*first.shape, &second.pose, &*second.shape);
    overlap.is_ok_and(|found| found.intersecting).then(|| PairDistance {
        link,
        other,
        parts,
        distance_m: -first.radius_m.min(second.radius_m),
        point_on_link: first.center,
        point_on_other: second.center,
        normal_to_other: Unit::try_new(second.center - first.center, 1e-9).unwrap_or(Vector3::z_axis()),
    })
}
