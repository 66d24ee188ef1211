//! Convex outlines on the floor. Corners in metres, world frame, counter-clockwise.

use nalgebra::{Point2, Vector2};

fn cross(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    a.x * b.y - a.y * b.x
}

/// The convex hull of the points, counter-clockwise without repeated corners (Andrew's monotone chain).
pub fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let half = |points: &mut dyn Iterator<Item = Point2<f64>>| {
        let mut chain: Vec<Point2<f64>> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..] {
                if cross(b - a, point - b) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// Direction (unit vector) of a side of the rectangle of least area around a convex outline. A rectangle of least area
/// shares a side with its hull, so only the hull's edges are tried. The world's x axis when there is no area.
pub fn smallest_rectangle_axis(hull: &[Point2<f64>]) -> Vector2<f64> {
    let mut best = (f64::INFINITY, Vector2::x());
    for (i, corner) in hull.iter().enumerate() {
        let Some(axis) = (hull[(i + 1) % hull.len()] - corner).try_normalize(1e-9) else { continue };
        let normal = Vector2::new(-axis.y, axis.x);
        let extent = |direction: Vector2<f64>| {
            let (low, high) = hull.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
                let along = p.coords.dot(&direction);
                (low.min(along), high.max(along))
            });
            high - low
        };
        let area = extent(axis) * extent(normal);
        if area < best.0 - 1e-12 {
            best = (area, axis);
        }
    }
    best.1
}

/// Area common to two convex outlines, square metres (Sutherland-Hodgman clipping).
pub fn intersection_area_m2(first: &[Point2<f64>], second: &[Point2<f64>]) -> f64 {
    let mut polygon = first.to_vec();
    for (i, from) in second.iter().enumerate() {
        let edge = second[(i + 1) % second.len()] - from;
        let inside = |p: &Point2<f64>| cross(edge, p - from);
        let mut clipped = Vec::with_capacity(polygon.len() + 1);
        for (j, current) in polygon.iter().enumerate() {
            let next = polygon[(j + 1) % polygon.len()];
            let (a, b) = (inside(current), inside(&next));
            if a >= 0.0 {
                clipped.push(*current);
            }
            if (a < 0.0) != (b < 0.0) {
                clipped.push(current + (next - current) * (a / (a - b)));
            }
        }
        polygon = clipped;
        if polygon.len() < 3 {
            return 0.0;
        }
    }
    let doubled: f64 =
        (0..polygon.len()).map(|i| cross(polygon[i].coords, polygon[(i + 1) % polygon.len()].coords)).sum();
    0.5 * doubled.abs()
}

/// Smallest distance between two convex outlines, metres; 0 when they overlap.
pub fn distance_m(first: &[Point2<f64>], second: &[Point2<f64>]) -> f64 {
    let contains = |outline: &[Point2<f64>], p: &Point2<f64>| {
        (0..outline.len()).all(|i| cross(outline[(i + 1) % outline.len()] - outline[i], p - outline[i]) >= 0.0)
    };
    if intersection_area_m2(first, second) > 0.0
        || first.iter().any(|p| contains(second, p))
        || second.iter().any(|p| contains(first, p))
    {
        return 0.0;
    }
    let to_edges = |points: &[Point2<f64>], outline: &[Point2<f64>]| {
        let mut least = f64::INFINITY;
        for p in points {
            for (i, from) in outline.iter().enumerate() {
                let edge = outline[(i + 1) % outline.len()] - from;
                let along = ((p - from).dot(&edge) / edge.norm_squared().max(1e-12)).clamp(0.0, 1.0);
                least = least.min((p - (from + edge * along)).norm());
            }
        }
        least
    };
    to_edges(first, second).min(to_edges(second, first))
}

#[cfg(test)]
mod tests {
    //! Contract: hull, rectangle, overlap and distance agree with shapes known by hand.
    use super::*;

    fn square(x: f64, y: f64, side: f64) -> Vec<Point2<f64>> {
        vec![Point2::new(x, y), Point2::new(x + side, y), Point2::new(x + side, y + side), Point2::new(x, y + side)]
    }

    #[test]
    fn overlap_and_distance_of_squares() {
        let a = square(0.0, 0.0, 2.0);
        assert!((intersection_area_m2(&a, &square(1.0, 1.0, 2.0)) - 1.0).abs() < 1e-12);
        assert_eq!(intersection_area_m2(&a, &square(3.0, 0.0, 1.0)), 0.0);
        assert!((distance_m(&a, &square(3.0, 0.0, 1.0)) - 1.0).abs() < 1e-12);
        assert_eq!(distance_m(&a, &square(0.5, 0.5, 0.1)), 0.0);
    }

    #[test]
    fn rectangle_axis_of_a_turned_rectangle() {
        let turn = nalgebra::Rotation2::new(0.4);
        let corners: Vec<_> =
            [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 1.0), (1.5, 0.5)].map(|(x, y)| turn * Point2::new(x, y)).into();
        let hull = convex_hull(&corners);
        assert_eq!(hull.len(), 4);
        let axis = smallest_rectangle_axis(&hull);
        let angle = axis.y.atan2(axis.x).rem_euclid(std::f64::consts::FRAC_PI_2);
        assert!((angle - 0.4).abs() < 1e-9, "{angle}");
    }
}
