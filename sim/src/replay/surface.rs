//! Points spread evenly over the drawn surface of a body.

use crate::camera::CameraRig;
use nalgebra::{Point3, Vector3};

/// Points that an object gets at most, about.
const WANTED: f64 = 4000.0;
/// Smallest and largest area that one point stands for, square metres.
const AREA_M2: (f64, f64) = (0.006 * 0.006, 0.04 * 0.04);
/// The plastic number's powers: an additive sequence that fills a square evenly.
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];

/// A point of a surface in the frame of its body.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyPoint {
    pub(super) position: Point3<f32>,
    /// Outward, unit length.
    pub(super) normal: Vector3<f32>,
    /// Surface that it stands for, square metres.
    pub(super) area_m2: f32,
}

/// Surface points and all corners of each body of a scene, in the frames of the bodies.
pub(super) fn sample(rig: &CameraRig, body_count: usize) -> Vec<(Vec<BodyPoint>, Vec<Point3<f64>>)> {
    let mut triangles: Vec<Vec<[Point3<f64>; 3]>> = vec![Vec::new(); body_count];
    rig.visit_triangles(|body, triangle| {
        if let Some(list) = triangles.get_mut(body) {
            list.push(triangle);
        }
    });
    triangles
        .into_iter()
        .map(|triangles| {
            let corners = triangles.iter().flatten().copied().collect();
            (spread(&triangles), corners)
        })
        .collect()
}

fn spread(triangles: &[[Point3<f64>; 3]]) -> Vec<BodyPoint> {
    let area = |[a, b, c]: &[Point3<f64>; 3]| 0.5 * (b - a).cross(&(c - a)).norm();
    let total_m2: f64 = triangles.iter().map(area).sum();
    let each_m2 = (total_m2 / WANTED).clamp(AREA_M2.0, AREA_M2.1);
    let mut points = Vec::new();
    // What is left of an area goes on to the next triangle, so that small triangles are not lost.
    let (mut due, mut place) = (0.5, [0.5, 0.5]);
    for triangle in triangles {
        let [a, b, c] = triangle;
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(1e-12) else { continue };
        due += area(triangle) / each_m2;
        while due >= 1.0 {
            due -= 1.0;
            place = [(place[0] + STEPS[0]).fract(), (place[1] + STEPS[1]).fract()];
            let [mut u, mut v]: [f64; 2] = place;
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let position: Point3<f64> = a + (b - a) * u + (c - a) * v;
            points.push(BodyPoint { position: position.cast(), normal: normal.cast(), area_m2: each_m2 as f32 });
        }
    }
    points
}

#[cfg(test)]
mod tests {
    //! Contract: points lie on the triangles, stand for all of the area, and reach every part of it.
    use super::*;

    #[test]
    fn points_cover_a_square_evenly() {
        let p = |x: f64, y: f64| Point3::new(x, y, 0.3);
        let points = spread(&[[p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0)], [p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]]);
        let area: f64 = points.iter().map(|p| f64::from(p.area_m2)).sum();
        assert!((area - 1.0).abs() < 0.01, "{area}");
        assert!(points.iter().all(|p| p.normal.z > 0.99 && (p.position.z - 0.3).abs() < 1e-6));
        for (x, y) in (0..100).map(|i| (i % 10, i / 10)) {
            let inside = |p: &&BodyPoint| (p.position.x * 10.0) as i32 == x && (p.position.y * 10.0) as i32 == y;
            let count = points.iter().filter(inside).count();
            assert!(count * 100 > points.len() / 2, "cell {x} {y}: {count} of {}", points.len());
        }
    }
}
