//! Convex outlines on the floor. Corners in metres, world frame, counter-clockwise.

use nalgebra::{Point2, Vector2};

fn cross(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    a.x * b.y - a.y * b.x
}

/// The convex hull of the points, counter-clockwise without repeated corners (Andrew's monotone chain).
pub fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = drop_inner(points);
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

/// The points without most of those that cannot be corners of their hull: what lies well inside the outline of the extreme
/// points in eight directions (Akl and Toussaint).
fn drop_inner(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    const FEW: usize = 64;
    const WELL_M: f64 = 1e-6;
    if points.len() < FEW {
        return points.to_vec();
    }
    let mut extremes = [points[0]; 8];
    let mut reach = [f64::NEG_INFINITY; 8];
    for p in points {
        // Counter-clockwise from +x.
        let along = [p.x, p.x + p.y, p.y, p.y - p.x, -p.x, -p.x - p.y, -p.y, p.x - p.y];
        for (i, value) in along.into_iter().enumerate() {
            if value > reach[i] {
                (reach[i], extremes[i]) = (value, *p);
            }
        }
    }
    let sides: Vec<(Point2<f64>, Vector2<f64>)> = (0..8)
        .filter_map(|i| Some((extremes[i], (extremes[(i + 1) % 8] - extremes[i]).try_normalize(WELL_M)?)))
        .collect();
    let is_inner =
        |p: &Point2<f64>| !sides.is_empty() && sides.iter().all(|(from, along)| cross(*along, p - from) > WELL_M);
    points.iter().filter(|p| !is_inner(p)).copied().collect()
}

/// Direction (unit vector) of a side of the upright rectangle that fits points seen from some sides only, with `hull`
/// their convex hull. The world's x axis when there is no area.
///
/// The rectangle of least area shares a side with the hull, but for two walls of a corner - all that one view shows of a
/// cabinet - the one along the hypotenuse has the same area. So among the directions whose area is within 15 % of the
/// least, the one wins whose sides run closest to the points (closeness criterion of L-shape fitting).
pub fn rectangle_axis(points: &[Point2<f64>], hull: &[Point2<f64>]) -> Vector2<f64> {
    const SAMPLES: usize = 300;
    const CAP_M: f64 = 0.1;
    let edges = (0..hull.len()).filter_map(|i| (hull[(i + 1) % hull.len()] - hull[i]).try_normalize(0.02));
    let turns =
        (0..30).map(|i| f64::from(i) * std::f64::consts::FRAC_PI_2 / 30.0).map(|a| Vector2::new(a.cos(), a.sin()));
    let candidates: Vec<(Vector2<f64>, [f64; 4], f64)> = turns
        .chain(edges)
        .map(|axis| {
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for p in hull {
                for (i, along) in [p.coords.dot(&axis), cross(axis, p.coords)].into_iter().enumerate() {
                    low[i] = low[i].min(along);
                    high[i] = high[i].max(along);
                }
            }
            // A thin set has no area; a centimetre keeps its length in the comparison.
            (axis, [low[0], high[0], low[1], high[1]], (high[0] - low[0] + 0.01) * (high[1] - low[1] + 0.01))
        })
        .collect();
    let least = candidates.iter().map(|c| c.2).fold(f64::INFINITY, f64::min);
    let step = points.len().div_ceil(SAMPLES).max(1);
    let mut best = (f64::INFINITY, Vector2::x());
    for (axis, [x0, x1, y0, y1], area) in candidates.into_iter().filter(|c| c.2 <= 1.15 * least) {
        // The smaller area decides where the points lie equally close.
        let mut sum = 0.02 * CAP_M * (points.len() / step) as f64 * (area / least - 1.0);
        for p in points.iter().step_by(step) {
            let (x, y) = (p.coords.dot(&axis), cross(axis, p.coords));
            sum += (x - x0).min(x1 - x).min(y - y0).min(y1 - y).clamp(0.0, CAP_M);
        }
        if sum < best.0 - 1e-9 {
            best = (sum, axis);
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

    #[test]
    fn points_inside_change_no_hull() {
        let place = |i: i32| {
            let (angle, radius) = (f64::from(i) * 2.4, (f64::from(i) / 500.0).sqrt());
            Point2::new(3.0 + 2.0 * radius * angle.cos(), radius * angle.sin())
        };
        let many: Vec<Point2<f64>> = (0..500).map(place).collect();
        let kept = drop_inner(&many);
        assert!(kept.len() < 200, "{}", kept.len());
        let hull = convex_hull(&many);
        assert_eq!(hull, convex_hull(&kept));
        let outside =
            |p: &Point2<f64>| (0..hull.len()).any(|i| cross(hull[(i + 1) % hull.len()] - hull[i], p - hull[i]) < -1e-9);
        assert!(!many.iter().any(outside));
        // On one line nothing is inside.
        let line: Vec<Point2<f64>> = (0..100).map(|i| Point2::new(f64::from(i), 2.0 * f64::from(i))).collect();
        assert_eq!(drop_inner(&line).len(), 100);
    }

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
        let axis = rectangle_axis(&hull, &hull);
        let angle = axis.y.atan2(axis.x).rem_euclid(std::f64::consts::FRAC_PI_2);
        assert!((angle - 0.4).abs() < 1e-9, "{angle}");
    }

    #[test]
    fn two_sides_of_a_corner_give_the_corner_not_the_hypotenuse() {
        let mut points: Vec<_> = (0..60).map(|i| Point2::new(0.6, 0.02 * f64::from(i))).collect();
        points.extend((0..30).map(|i| Point2::new(0.02 * f64::from(i), 1.2)));
        let axis = rectangle_axis(&points, &convex_hull(&points));
        let angle = axis.y.atan2(axis.x).rem_euclid(std::f64::consts::FRAC_PI_2);
        assert!(angle.min(std::f64::consts::FRAC_PI_2 - angle) < 0.03, "{angle}");
    }
}
