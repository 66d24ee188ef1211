//! Boxes around surfaces that were seen from some sides only.

use super::observation::find_percentiles;
use crate::geometry::{Aabb, OrientedBox, convex_hull, rectangle_axis};
use crate::map::MapPoint;
use nalgebra::{Point2, Point3, UnitQuaternion, Vector2, Vector3};

/// Things larger than this are not completed to round ones, metres.
const ROUND_BELOW_M: f64 = 0.25;
/// Length of the mean of the unit directions to the viewers from which a thing was seen from one side only.
const ONE_SIDED: f64 = 0.7;
/// Share of the width that must have shown in depth: half a cylinder shows half its width; a flat front shows less.
const BULGE: f64 = 0.45;
/// Share of the points before the near side of a completed thing: depth noise spreads them towards the viewer, and of a
/// round front this share lies within a few millimetres.
const NEAR_SHARE: f64 = 0.1;
/// Greatest angle between the viewing direction and the side that is completed, as a cosine.
const ALONG: f64 = 0.7;

/// From where a thing was seen.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seen {
    /// Mean of the horizontal unit directions from the thing to its viewers; near zero when they stood all around it.
    pub(super) towards: Vector2<f64>,
    /// What the best view lost of the outline, where masks and depth mix two surfaces, metres.
    pub(super) lost_m: f64,
}

/// The upright box with the rectangle that fits best, between the 1st and 99th percentile along its axes, grown sideways by
/// what the views lost, and completed away from the viewers when a small thing bulges towards them.
pub(super) fn upright_box(points: &[MapPoint], aabb: &Aabb, voxel_m: f64, seen: &Seen) -> Option<OrientedBox> {
    let margin = 0.5 * voxel_m;
    let flat: Vec<Point2<f64>> = points
        .iter()
        .map(|p| p.position.cast::<f64>().xy())
        .filter(|p| (0..2).all(|i| p[i] >= aabb.min[i] - margin && p[i] <= aabb.max[i] + margin))
        .collect();
    let axis = rectangle_axis(&flat, &convex_hull(&flat));
    let yaw_rad = axis.y.atan2(axis.x).rem_euclid(std::f64::consts::FRAC_PI_2);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let box_from_world = rotation.inverse().cast::<f32>();
    let mut low = Vector3::zeros();
    let mut high = Vector3::zeros();
    let turned: Vec<Point3<f32>> = points.iter().map(|p| box_from_world * p.position).collect();
    let mut values: Vec<f32> = Vec::with_capacity(turned.len());
    for i in 0..3 {
        values.clear();
        values.extend(turned.iter().map(|p| p[i]));
        (low[i], high[i]) = find_percentiles(&mut values)?;
    }
    let towards = rotation.inverse() * Vector3::new(seen.towards.x, seen.towards.y, 0.0);
    for i in 0..2 {
        low[i] -= seen.lost_m;
        high[i] += seen.lost_m;
    }
    complete(&mut low, &mut high, &towards, &turned);
    let size = (high - low).map(|side| side.max(0.5 * voxel_m));
    Some(OrientedBox { center: rotation * Point3::from((low + high) * 0.5), size, rotation })
}

/// Makes the outline of a small thing as deep as it is wide when it was seen from one side and bulges: mugs, bowls, bottles
/// and fruit are as deep as they are wide, and their far half never shows. A flat front says nothing about what is behind.
fn complete(low: &mut Vector3<f64>, high: &mut Vector3<f64>, towards: &Vector3<f64>, points: &[Point3<f32>]) {
    let distance = towards.norm();
    if distance < ONE_SIDED {
        return;
    }
    let deep = usize::from(towards.y.abs() > towards.x.abs());
    let (depth, width) = (high[deep] - low[deep], high[1 - deep] - low[1 - deep]);
    if towards[deep].abs() < ALONG * distance || width > ROUND_BELOW_M || !(BULGE * width..width).contains(&depth) {
        return;
    }
    let mut along: Vec<f32> = points.iter().map(|p| p[deep]).collect();
    let cut = (NEAR_SHARE * along.len() as f64) as usize;
    let near = if towards[deep] > 0.0 { along.len().saturating_sub(1 + cut) } else { cut };
    if near >= along.len() {
        return;
    }
    let near = f64::from(*along.select_nth_unstable_by(near, f32::total_cmp).1);
    (low[deep], high[deep]) = if towards[deep] > 0.0 { (near - width, near) } else { (near, near + width) };
}

#[cfg(test)]
mod tests {
    //! Contract: a half-seen cylinder gets the box of the whole one; a front, and a thing seen from all sides, stay.
    use super::*;

    fn surface(places: impl Iterator<Item = (f64, f64)>) -> Vec<MapPoint> {
        let heights = [0.0, 0.02, 0.04, 0.06, 0.08, 0.1];
        let column = |(x, y): (f64, f64)| heights.map(|z| Point3::new(x as f32, y as f32, z as f32));
        places.flat_map(column).map(|position| MapPoint { position, color: [9; 3] }).collect()
    }

    fn bound(points: &[MapPoint], towards: [f64; 2]) -> OrientedBox {
        let all: Vec<Point3<f64>> = points.iter().map(|p| p.position.cast()).collect();
        let seen = Seen { towards: Vector2::from(towards), lost_m: 0.0 };
        upright_box(points, &Aabb::from_points(&all).unwrap(), 0.01, &seen).unwrap()
    }

    #[test]
    fn half_a_cylinder_is_completed() {
        // The side that faces a viewer at +x.
        let arc = (-30..=30).map(|i| (f64::from(i) * 0.05).sin_cos()).map(|(sin, cos)| (0.04 * cos, 0.04 * sin));
        let half = surface(arc);
        let whole = OrientedBox::from(Aabb { min: Point3::new(-0.04, -0.04, 0.0), max: Point3::new(0.04, 0.04, 0.1) });
        assert!(bound(&half, [0.95, 0.0]).iou(&whole) > 0.85);
        assert!(bound(&half, [0.2, 0.0]).iou(&whole) < 0.6, "seen from all sides it is what it is");
    }

    #[test]
    fn a_flat_front_is_not_completed() {
        let front = surface((0..20).map(|i| (0.002 * f64::from(i % 2), 0.01 * f64::from(i))));
        assert!(bound(&front, [1.0, 0.0]).size.xy().min() < 0.02);
    }
}
