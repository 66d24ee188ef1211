//! Distances between links, and between links and obstacles.

use super::kinematics::{Kinematics, LinkId, LinkPoses};
use super::shapes::{from_parry, to_parry};
use dsm::Pose;
use nalgebra::{Point3, Unit, Vector3};
use parry3d::query;
use parry3d::shape::SharedShape;

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

    /// Its velocity in m/s.
    pub fn velocity_m_per_s(&self) -> Vector3<f64> {
        match self {
            Self::Box { velocity_m_per_s, .. } | Self::Ball { velocity_m_per_s, .. } => *velocity_m_per_s,
        }
    }

    fn solid(&self) -> Solid {
        match self {
            Self::Box { base_from_box, half_size_m: h, .. } => Solid {
                shape: SharedShape::cuboid(h.x as f32, h.y as f32, h.z as f32),
                pose: to_parry(base_from_box),
                center: base_from_box.translation.vector.into(),
                radius_m: h.norm(),
            },
            Self::Ball { center_in_base, radius_m, .. } => Solid {
                shape: SharedShape::ball(*radius_m as f32),
                pose: to_parry(&Pose::translation(center_in_base.x, center_in_base.y, center_in_base.z)),
                center: *center_in_base,
                radius_m: *radius_m,
            },
        }
    }
}

/// A shape at its place, with a ball about it for the first, cheap test.
struct Solid {
    shape: SharedShape,
    pose: parry3d::math::Pose,
    center: Point3<f64>,
    radius_m: f64,
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
                parts.push(Part {
                    link: LinkId(index),
                    shape,
                    link_from_shape,
                    center_in_link,
                    radius_m: f64::from(ball.radius()),
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

    /// Pairs of links nearer to each other than `reach_m`, one entry for each pair of shapes, in a fixed order.
    pub fn self_distances(&self, poses: &LinkPoses, reach_m: f64) -> Vec<PairDistance> {
        let solids: Vec<Solid> = self.parts.iter().map(|part| part.solid(poses)).collect();
        let near = |(first, second): &(usize, usize)| {
            let other = Other::Link(self.parts[*second].link);
            find_distance(self.parts[*first].link, other, &solids[*first], &solids[*second], reach_m)
        };
        self.pairs.iter().filter_map(near).collect()
    }

    /// Links of `only` (all when empty) nearer to an obstacle than `reach_m`, in a fixed order.
    pub fn obstacle_distances(
        &self,
        poses: &LinkPoses,
        obstacles: &[Obstacle],
        only: &[LinkId],
        reach_m: f64,
    ) -> Vec<PairDistance> {
        let wanted = |part: &&Part| only.is_empty() || only.contains(&part.link);
        let parts: Vec<(LinkId, Solid)> =
            self.parts.iter().filter(wanted).map(|part| (part.link, part.solid(poses))).collect();
        let mut found = Vec::new();
        for (index, obstacle) in obstacles.iter().enumerate() {
            let solid = obstacle.solid();
            for (link, part) in &parts {
                found.extend(find_distance(*link, Other::Obstacle(index), part, &solid, reach_m));
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
    fn solid(&self, poses: &LinkPoses) -> Solid {
        let base_from_link = poses.get(self.link);
        Solid {
            shape: self.shape.clone(),
            pose: to_parry(&(base_from_link * self.link_from_shape)),
            center: base_from_link * self.center_in_link,
            radius_m: self.radius_m,
        }
    }
}

/// The closest points when they are nearer than `reach_m`.
fn find_distance(link: LinkId, other: Other, first: &Solid, second: &Solid, reach_m: f64) -> Option<PairDistance> {
    let between = second.center - first.center;
    if between.norm() > first.radius_m + second.radius_m + reach_m {
        return None;
    }
    let contact = query::contact(&first.pose, &*first.shape, &second.pose, &*second.shape, reach_m as f32);
    if let Ok(Some(contact)) = contact {
        let normal = Unit::try_new(from_parry(contact.normal1), 1e-6)?;
        return Some(PairDistance {
            link,
            other,
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
        distance_m: -first.radius_m.min(second.radius_m),
        point_on_link: first.center,
        point_on_other: second.center,
        normal_to_other: Unit::try_new(between, 1e-9).unwrap_or(Vector3::z_axis()),
    })
}
