//! Boxes in space and their outlines on the floor.

mod footprint;

pub use footprint::{convex_hull, distance_m, intersection_area_m2, rectangle_axis};

use crate::Pose;
use nalgebra::{Point2, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// An axis-aligned box in the world frame, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// Lowest corner.
    pub min: Point3<f64>,
    /// Highest corner.
    pub max: Point3<f64>,
}

/// A box with an orientation, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrientedBox {
    /// Centre in the world frame.
    pub center: Point3<f64>,
    /// Full side lengths along the box axes.
    pub size: Vector3<f64>,
    /// Rotation from the box frame to the world frame.
    pub rotation: UnitQuaternion<f64>,
}

impl Aabb {
    /// The smallest box around the points; `None` for none.
    pub fn from_points<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = *points.next()?;
        Some(points.fold(Self { min: first, max: first }, |b, p| Self { min: b.min.inf(p), max: b.max.sup(p) }))
    }

    /// Side lengths.
    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }

    /// Centre.
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// Volume in cubic metres.
    pub fn volume_m3(&self) -> f64 {
        let s = self.size();
        s.x.max(0.0) * s.y.max(0.0) * s.z.max(0.0)
    }

    /// The box grown by `margin_m` on every side.
    pub fn grown(&self, margin_m: f64) -> Self {
        let margin = Vector3::repeat(margin_m);
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// The common part, if any.
    pub fn find_intersection(&self, other: &Self) -> Option<Self> {
        let common = Self { min: self.min.sup(&other.min), max: self.max.inf(&other.max) };
        (0..3).all(|i| common.min[i] <= common.max[i]).then_some(common)
    }

    /// Intersection over union of the volumes, 0 to 1.
    pub fn iou(&self, other: &Self) -> f64 {
        let common = self.find_intersection(other).map_or(0.0, |b| b.volume_m3());
        let union = self.volume_m3() + other.volume_m3() - common;
        if union > 0.0 { common / union } else { 0.0 }
    }

    /// Whether the point lies inside or on the border.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        (0..3).all(|i| self.min[i] <= point[i] && point[i] <= self.max[i])
    }
}

impl OrientedBox {
    /// The pose of the box: `world_from_box`.
    pub fn world_from_box(&self) -> Pose {
        Pose::from_parts(Translation3::from(self.center.coords), self.rotation)
    }

    /// The eight corners in the world frame.
    pub fn corners(&self) -> [Point3<f64>; 8] {
        let h = self.size * 0.5;
        let pose = self.world_from_box();
        std::array::from_fn(|i| {
            let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            pose * Point3::new(sign(0) * h.x, sign(1) * h.y, sign(2) * h.z)
        })
    }

    /// The axis-aligned box around it.
    pub fn aabb(&self) -> Aabb {
        let corners = self.corners();
        corners
            .iter()
            .skip(1)
            .fold(Aabb { min: corners[0], max: corners[0] }, |b, p| Aabb { min: b.min.inf(p), max: b.max.sup(p) })
    }

    /// Volume in cubic metres.
    pub fn volume_m3(&self) -> f64 {
        self.size.x * self.size.y * self.size.z
    }

    /// Corners of its outline on the floor, world frame, counter-clockwise. Exact for an upright box; for a tilted one
    /// the outline of its lower and upper face along the box axes, turned by its yaw.
    pub fn footprint(&self) -> [Point2<f64>; 4] {
        let axis = self.rotation * Vector3::x();
        let (sin, cos) = axis.y.atan2(axis.x).sin_cos();
        let (half_x, half_y) = (0.5 * self.size.x, 0.5 * self.size.y);
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(sx, sy)| {
            let (x, y) = (sx * half_x, sy * half_y);
            Point2::new(self.center.x + cos * x - sin * y, self.center.y + sin * x + cos * y)
        })
    }

    /// Height of its lowest point, metres.
    pub fn bottom_m(&self) -> f64 {
        self.center.z - 0.5 * self.height_m()
    }

    /// Height of its highest point, metres.
    pub fn top_m(&self) -> f64 {
        self.center.z + 0.5 * self.height_m()
    }

    /// From its lowest to its highest point, metres.
    pub fn height_m(&self) -> f64 {
        let matrix = self.rotation.to_rotation_matrix();
        (0..3).map(|i| matrix[(2, i)].abs() * self.size[i]).sum()
    }

    /// Common volume of two upright boxes in cubic metres.
    pub fn intersection_volume_m3(&self, other: &Self) -> f64 {
        let height = self.top_m().min(other.top_m()) - self.bottom_m().max(other.bottom_m());
        if height <= 0.0 { 0.0 } else { height * intersection_area_m2(&self.footprint(), &other.footprint()) }
    }

    /// Intersection over union of two upright boxes, 0 to 1.
    pub fn iou(&self, other: &Self) -> f64 {
        let common = self.intersection_volume_m3(other);
        let union = self.volume_m3() + other.volume_m3() - common;
        if union > 0.0 { common / union } else { 0.0 }
    }

    /// Whether the point in the world frame lies inside or on the border, with a margin in metres.
    pub fn contains(&self, point_in_world: &Point3<f64>, margin_m: f64) -> bool {
        let p = self.world_from_box().inverse_transform_point(point_in_world);
        (0..3).all(|i| p[i].abs() <= 0.5 * self.size[i] + margin_m)
    }
}

/// Boxes that are asked together whether one of them holds a point: almost all points lie outside the box around all.
pub struct BoxUnion<'a> {
    boxes: &'a [OrientedBox],
    margin_m: f64,
    around: Option<Aabb>,
}

impl<'a> BoxUnion<'a> {
    /// The union of `boxes`, each grown by `margin_m`.
    pub fn new(boxes: &'a [OrientedBox], margin_m: f64) -> Self {
        let corners: Vec<Point3<f64>> = boxes.iter().flat_map(OrientedBox::corners).collect();
        // A margin along a turned box's axes reaches farther along the world's.
        let around = Aabb::from_points(&corners).map(|bounds| bounds.grown(2.0 * margin_m));
        Self { boxes, margin_m, around }
    }

    /// Whether one of them holds the point.
    pub fn contains(&self, point_in_world: &Point3<f64>) -> bool {
        self.around.is_some_and(|around| around.contains(point_in_world))
            && self.boxes.iter().any(|each| each.contains(point_in_world, self.margin_m))
    }
}

/// The upright box around the points whose outline fits them best ([`rectangle_axis`]); `None` for none.
pub fn upright_box_around(points: &[Point3<f64>]) -> Option<OrientedBox> {
    let flat: Vec<Point2<f64>> = points.iter().map(|p| p.xy()).collect();
    let hull = convex_hull(&flat);
    let axis = rectangle_axis(&hull, &hull);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), axis.y.atan2(axis.x));
    let turned: Vec<Point3<f64>> = points.iter().map(|p| rotation.inverse() * p).collect();
    let bounds = Aabb::from_points(&turned)?;
    Some(OrientedBox { center: rotation * bounds.center(), size: bounds.size(), rotation })
}

impl From<Aabb> for OrientedBox {
    fn from(aabb: Aabb) -> Self {
        Self { center: aabb.center(), size: aabb.size(), rotation: UnitQuaternion::identity() }
    }
}
