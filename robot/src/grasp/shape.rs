//! The simple shape that a partly observed cloud is taken for.

use super::cloud::quantile;
use nalgebra::{DMatrix, DVector, Point2, Point3, Vector2, Vector3};

/// A shape with its axis upright. World frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its centre.
        center: Point3<f64>,
        /// Its radius.
        radius_m: f64,
    },
    /// An upright cylinder: a can, a mug, a glass.
    Cylinder {
        /// Its centre.
        center: Point3<f64>,
        /// Its radius.
        radius_m: f64,
        /// Its height.
        height_m: f64,
    },
    /// An upright box: a carton, a standing book.
    Block {
        /// Its centre.
        center: Point3<f64>,
        /// Its full sides along its own x, its own y and the vertical.
        size: Vector3<f64>,
        /// Direction of its own x, radians from the world's x.
        yaw_rad: f64,
    },
}

/// Round things are larger than this; smaller radii come from noise on edges.
const MIN_RADIUS_M: f64 = 0.008;
/// A round shape wider than this times what was seen of it is a flat face taken for an arc; depth lacks at its edges.
const WIDER_THAN_SEEN: f64 = 1.3;
/// Nothing with a larger radius fits between the fingers; larger fits are flat walls taken for arcs.
const MAX_RADIUS_M: f64 = 0.15;

impl Shape {
    /// The shape with the smallest residual, round ones first when they are as good. `support_z_m` is the height it
    /// stands on. `None` for fewer than 12 points.
    pub fn fit(points: &[Point3<f64>], support_z_m: f64) -> Option<Self> {
        if points.len() < 12 {
            return None;
        }
        let top = quantile(points.iter().map(|p| p.z), 0.99)?;
        let (block, block_residual) = fit_block(points, support_z_m, top)?;
        // Noise makes even a true fit leave millimetres; a round shape must not be much worse than the box.
        let mut best = (block, block_residual * 0.95);
        let widest_m = block.widest_m();
        for (shape, residual) in
            [fit_cylinder(points, support_z_m, top), fit_sphere(points, support_z_m, top)].into_iter().flatten()
        {
            // Half of a round thing is seen from anywhere, and so is its width.
            if residual < best.1 && shape.widest_m() < WIDER_THAN_SEEN * widest_m {
                best = (shape, residual);
            }
        }
        Some(best.0)
    }

    /// Its centre.
    pub fn center(&self) -> Point3<f64> {
        match self {
            Self::Sphere { center, .. } | Self::Cylinder { center, .. } | Self::Block { center, .. } => *center,
        }
    }

    /// Its greater horizontal extent, metres.
    fn widest_m(&self) -> f64 {
        match self {
            Self::Sphere { radius_m, .. } | Self::Cylinder { radius_m, .. } => 2.0 * radius_m,
            Self::Block { size, .. } => size.x.max(size.y),
        }
    }

    /// Half its extent along a unit direction in the world frame, metres.
    pub fn half_extent_m(&self, direction: &Vector3<f64>) -> f64 {
        let flat = direction.xy().norm();
        match self {
            Self::Sphere { radius_m, .. } => *radius_m,
            Self::Cylinder { radius_m, height_m, .. } => radius_m * flat + 0.5 * height_m * direction.z.abs(),
            Self::Block { size, yaw_rad, .. } => {
                let (sin, cos) = yaw_rad.sin_cos();
                let along_x = (direction.x * cos + direction.y * sin).abs();
                let along_y = (direction.y * cos - direction.x * sin).abs();
                0.5 * (size.x * along_x + size.y * along_y + size.z * direction.z.abs())
            }
        }
    }

    /// Horizontal directions in which closing meets parallel surfaces: the axes of a box, all around for round shapes.
    pub(crate) fn closing_directions(&self) -> Vec<Vector3<f64>> {
        let directions = |first: f64, count: u32, step: f64| {
            (0..count).map(|i| first + f64::from(i) * step).map(|a| Vector3::new(a.cos(), a.sin(), 0.0)).collect()
        };
        match self {
            Self::Block { yaw_rad, .. } => directions(*yaw_rad, 2, std::f64::consts::FRAC_PI_2),
            _ => directions(0.0, 8, std::f64::consts::PI / 8.0),
        }
    }

    /// Cosine between the closing direction and the surface where pads touch it that hold it `raise_m` above its middle.
    pub(crate) fn surface_cosine(&self, raise_m: f64) -> f64 {
        match self {
            Self::Sphere { radius_m, .. } => (1.0 - (raise_m / radius_m).powi(2)).max(0.0).sqrt(),
            _ => 1.0,
        }
    }
}

fn fit_sphere(points: &[Point3<f64>], support_z_m: f64, top_m: f64) -> Option<(Shape, f64)> {
    let rows: Vec<Vec<f64>> = points.iter().map(|p| vec![p.x, p.y, p.z]).collect();
    let (center, radius_m, residual) = fit_ball(&rows)?;
    let center = Point3::new(center[0], center[1], center[2]);
    // It must fill the height between the support and its top.
    let tolerance = 0.3 * radius_m + 0.004;
    let fits = (center.z + radius_m - top_m).abs() < tolerance && (center.z - radius_m - support_z_m).abs() < tolerance;
    fits.then_some((Shape::Sphere { center, radius_m }, residual))
}

fn fit_cylinder(points: &[Point3<f64>], support_z_m: f64, top_m: f64) -> Option<(Shape, f64)> {
    /// A handle stands out by so much at most.
    const OUTSIDE_M: f64 = 0.04;
    // The lid is no part of the wall; without it at least half the wall must be left.
    let wall: Vec<&Point3<f64>> = points.iter().filter(|p| p.z < top_m - 0.012).collect();
    if wall.len() < 12 || top_m - support_z_m < 0.03 {
        return None;
    }
    let rows: Vec<Vec<f64>> = wall.iter().map(|p| vec![p.x, p.y]).collect();
    let (center, radius_m, residual) = fit_ball(&rows)?;
    let height_m = top_m - support_z_m;
    let inside = points.iter().all(|p| (p.xy() - Point2::new(center[0], center[1])).norm() < radius_m + OUTSIDE_M);
    let center = Point3::new(center[0], center[1], 0.5 * (top_m + support_z_m));
    inside.then_some((Shape::Cylinder { center, radius_m, height_m }, residual))
}

/// Circle or sphere that most points agree on: the algebraic solution, then Gauss-Newton on the distances, with weights
/// that fade where a point is off by more than the others (Geman-McClure): a handle is no part of the wall. Gives
/// centre, radius and residual (see [`residual_of`]).
fn fit_ball(rows: &[Vec<f64>]) -> Option<(DVector<f64>, f64, f64)> {
    const PLAIN_ROUNDS: usize = 8;
    const ROBUST_ROUNDS: usize = 10;
    let (n, dimension) = (rows.len(), rows.first()?.len());
    let origin: DVector<f64> =
        rows.iter().fold(DVector::zeros(dimension), |sum, row| sum + DVector::from_column_slice(row)) / n as f64;
    let local: Vec<DVector<f64>> = rows.iter().map(|row| DVector::from_column_slice(row) - &origin).collect();
    let system = DMatrix::from_fn(n, dimension + 1, |i, j| if j < dimension { 2.0 * local[i][j] } else { 1.0 });
    let squares = DVector::from_fn(n, |i, _| local[i].norm_squared());
    let solution = (system.transpose() * &system).lu().solve(&(system.transpose() * squares))?;
    let mut center = solution.rows(0, dimension).into_owned();
    let mut radius = (solution[dimension] + center.norm_squared()).max(0.0).sqrt();
    let off = |center: &DVector<f64>, radius: f64| DVector::from_fn(n, |i, _| (center - &local[i]).norm() - radius);
    for round in 0..PLAIN_ROUNDS + ROBUST_ROUNDS {
        let residuals = off(&center, radius);
        let scale_m = (2.0 * 1.48 * quantile(residuals.iter().map(|r| r.abs()), 0.5)?).max(1e-4);
        let weight = |i: usize| {
            if round < PLAIN_ROUNDS { 1.0 } else { (1.0 + (residuals[i] / scale_m).powi(2)).powi(-2) }
        };
        let jacobian = DMatrix::from_fn(n, dimension + 1, |i, j| {
            if j == dimension {
                return -1.0;
            }
            let offset = &center - &local[i];
            offset[j] / offset.norm().max(1e-9)
        });
        let weighted = DMatrix::from_fn(n, dimension + 1, |i, j| weight(i) * jacobian[(i, j)]);
        let mut normal = weighted.transpose() * &jacobian;
        (0..=dimension).for_each(|i| normal[(i, i)] += 1e-9 * n as f64);
        let step = normal.lu().solve(&(weighted.transpose() * residuals))?;
        center -= step.rows(0, dimension);
        radius -= step[dimension];
    }
    let valid = (MIN_RADIUS_M..MAX_RADIUS_M).contains(&radius) && center.iter().all(|c| c.is_finite());
    let residual = residual_of(off(&center, radius).iter().copied())?;
    valid.then(|| (center + origin, radius, residual))
}

/// Root mean square of the smaller 85 % of the distances, metres: handles, stalks and bleeding masks are no part of the
/// shape.
fn residual_of(distances_m: impl Iterator<Item = f64>) -> Option<f64> {
    const KEPT: f64 = 0.85;
    let mut squares: Vec<f64> = distances_m.map(|d| d * d).collect();
    squares.sort_by(f64::total_cmp);
    squares.truncate((squares.len() as f64 * KEPT).ceil() as usize);
    let n = squares.len();
    (n > 0).then(|| (squares.iter().sum::<f64>() / n as f64).sqrt())
}

/// The upright box with the smallest footprint around the middle 97 % of the points, by trying 90 directions.
fn fit_block(points: &[Point3<f64>], support_z_m: f64, top_m: f64) -> Option<(Shape, f64)> {
    const DIRECTIONS: u32 = 90;
    let mut best: Option<(f64, f64, Vector2<f64>, Vector2<f64>)> = None;
    for step in 0..DIRECTIONS {
        let yaw = f64::from(step) / f64::from(DIRECTIONS) * std::f64::consts::FRAC_PI_2;
        let (sin, cos) = yaw.sin_cos();
        let range = |values: Vec<f64>| Some((quantile(values.iter().copied(), 0.015)?, quantile(values, 0.985)?));
        let (x_low, x_high) = range(points.iter().map(|p| p.x * cos + p.y * sin).collect())?;
        let (y_low, y_high) = range(points.iter().map(|p| p.y * cos - p.x * sin).collect())?;
        let area = (x_high - x_low) * (y_high - y_low);
        if best.as_ref().is_none_or(|(smallest, ..)| area < *smallest) {
            best = Some((area, yaw, Vector2::new(x_low, y_low), Vector2::new(x_high, y_high)));
        }
    }
    let (_, yaw_rad, low, high) = best?;
    let (sin, cos) = yaw_rad.sin_cos();
    let middle = 0.5 * (low + high);
    let center =
        Point3::new(middle.x * cos - middle.y * sin, middle.x * sin + middle.y * cos, 0.5 * (top_m + support_z_m));
    let size = Vector3::new(high.x - low.x, high.y - low.y, (top_m - support_z_m).max(0.002));
    let from_sides = |p: &Point3<f64>| {
        let (x, y) = (p.x * cos + p.y * sin - middle.x, p.y * cos - p.x * sin - middle.y);
        (0.5 * size.x - x.abs(), 0.5 * size.y - y.abs())
    };
    let lid_m = find_lid_m(points, from_sides, support_z_m, top_m);
    let distances = points.iter().map(|p| {
        let (x, y) = from_sides(p);
        x.abs().min(y.abs()).min((p.z - top_m).abs()).min((p.z - lid_m).abs())
    });
    Some((Shape::Block { center, size, yaw_rad }, residual_of(distances)?))
}

/// Height of a box's lid, which lies below its top when something stands out of it: the tissue of a tissue box.
fn find_lid_m(
    points: &[Point3<f64>],
    from_sides: impl Fn(&Point3<f64>) -> (f64, f64),
    support_z_m: f64,
    top_m: f64,
) -> f64 {
    /// Points of the lid lie so far inside the sides, metres.
    const INSIDE_M: f64 = 0.01;
    /// What is lower is the inside of something open.
    const LOWEST: f64 = 0.6;
    let inside = points.iter().filter(|p| {
        let (x, y) = from_sides(p);
        x.min(y) > INSIDE_M
    });
    let lid_m = quantile(inside.map(|p| p.z), 0.5).unwrap_or(top_m);
    if lid_m > support_z_m + LOWEST * (top_m - support_z_m) { lid_m } else { top_m }
}

#[cfg(test)]
mod tests {
    //! Contract: with 4 mm of noise and one side seen, round things get their radius within 6 mm, boxes their seen sides.
    use super::*;
    use crate::grasp::candidates::tests::{block, cylinder, seen_from, sphere};

    #[test]
    fn half_a_ball_gives_its_radius() {
        let center = Point3::new(1.0, 2.0, 0.84);
        let all = sphere(center, 0.04, 0.004, 1200, 3);
        let points = seen_from(&all, &center, Vector3::new(-1.0, 0.2, 0.5), 0.0);
        match Shape::fit(&points, 0.8) {
            Some(Shape::Sphere { center: found, radius_m }) => {
                assert!((radius_m - 0.04).abs() < 0.006, "{radius_m}");
                assert!((found - center).norm() < 0.01);
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn half_a_can_gives_its_radius() {
        let center = Point3::new(1.0, 2.0, 0.86);
        let all = cylinder(center, 0.033, 0.12, 0.003, 2500, 4);
        let points = seen_from(&all, &center, Vector3::new(-1.0, 0.2, 0.3), 0.0);
        match Shape::fit(&points, 0.8) {
            Some(Shape::Cylinder { center: found, radius_m, height_m }) => {
                assert!((radius_m - 0.033).abs() < 0.006, "{radius_m}");
                assert!((found - center).norm() < 0.012 && (height_m - 0.12).abs() < 0.01);
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_handle_does_not_widen_a_mug() {
        let center = Point3::new(1.0, 2.0, 0.85);
        let all = cylinder(center, 0.04, 0.095, 0.002, 1500, 4);
        let mut points = seen_from(&all, &center, Vector3::new(-1.0, 0.2, 0.3), 0.0);
        let wall = points.len();
        // The handle stands out on the seen side, at the edge of what is seen.
        points.extend(block(
            center + Vector3::new(-0.02, -0.05, 0.0),
            Vector3::new(0.02, 0.03, 0.05),
            0.3,
            0.001,
            120,
            6,
        ));
        assert!(points.len() > wall + 50);
        match Shape::fit(&points, 0.8025) {
            Some(Shape::Cylinder { radius_m, center: found, .. }) => {
                assert!((radius_m - 0.04).abs() < 0.007, "{radius_m}");
                assert!((found.xy() - center.xy()).norm() < 0.01, "{found}");
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_flat_face_is_no_arc() {
        // An alarm clock on a dresser, seen from its front with a bulge in its face: a circle of 8 cm radius fits it well.
        let bulge = |x: f64| 0.08 - (0.0064 - x * x).sqrt();
        let face = (0..600).map(|i| (f64::from(i % 30) / 29.0 - 0.5, f64::from(i / 30) / 19.0));
        let points: Vec<Point3<f64>> =
            face.map(|(x, z)| Point3::new(2.0 + 0.1 * x, 1.0 + bulge(0.1 * x), 0.84 + 0.1 * z)).collect();
        match Shape::fit(&points, 0.84) {
            Some(Shape::Block { size, .. }) => assert!(size.x.max(size.y) < 0.12, "{size:?}"),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_tissue_makes_its_box_no_cylinder() {
        let center = Point3::new(1.0, 2.0, 0.855);
        let all = block(center, Vector3::repeat(0.11), 0.4, 0.003, 4000, 5);
        let mut points = seen_from(&all, &center, Vector3::new(-1.0, 0.2, 0.9), 0.0);
        points.extend(sphere(center + Vector3::new(0.0, 0.0, 0.06), 0.018, 0.002, 250, 6));
        match Shape::fit(&points, 0.8) {
            Some(Shape::Block { size, .. }) => assert!(size.x.max(size.y) < 0.12, "{size:?}"),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_carton_gives_its_sides() {
        let center = Point3::new(1.0, 2.0, 0.9);
        let size = Vector3::new(0.06, 0.1, 0.2);
        match Shape::fit(&block(center, size, 0.5, 0.003, 4000, 5), 0.8) {
            Some(shape @ Shape::Block { yaw_rad, .. }) => {
                assert!((shape.center() - center).norm() < 0.005);
                let turned = Vector3::new(0.5_f64.cos(), 0.5_f64.sin(), 0.0);
                assert!((shape.half_extent_m(&turned) - 0.03).abs() < 0.006, "{shape:?} {yaw_rad}");
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(Shape::fit(&[center; 5], 0.8), None);
    }
}
