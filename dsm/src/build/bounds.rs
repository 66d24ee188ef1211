//! Boxes around surfaces that were seen from some sides only.

use super::observation::find_percentiles;
use crate::geometry::{Aabb, OrientedBox, convex_hull, rectangle_axis};
use crate::map::MapPoint;
use nalgebra::{Point2, Point3, UnitQuaternion, Vector2, Vector3};

/// Things larger than this are not completed to round ones, metres.
const ROUND_BELOW_M: f64 = 0.25;
/// Length of the mean of the unit directions to the viewers from which a thing was seen from one side only.
const ONE_SIDED: f64 = 0.7;
/// Share of the width that must have shown in depth: half a cylinder shows half its width, less what the views lost.
const BULGE: f64 = 0.25;
/// Width of the nearest quarter of a round thing over its whole width: two thirds without noise, all of it for a box.
const ROUND_FRONT: f64 = 0.85;
/// How far behind its near side the surface of a round thing lies on the mean over the pixels that show it, as a share of its
/// width: (1 - pi / 4) / 2.
const MEAN_DEPTH: f64 = 0.107;
/// Things narrower than this are no flatter or deeper than noise of depth tells, metres: three deviations at 3 m.
const NARROW_M: f64 = 0.05;
/// Fronts wider than this are those of furniture, whose kind tells the depth, or of walls, metres.
const FRONT_BELOW_M: f64 = 0.6;
/// Depth of a small thing over its width when only a flat front was seen and nothing is known of its kind.
const FLAT_DEPTH: f64 = 0.6;
/// Share of the width from which a depth was seen well enough to be kept.
const SEEN_DEPTH: f64 = 0.45;
/// Height over width of what hangs flat on a wall, at least, when hardly a view reached its upper edge; but no more than the
/// other, metres.
const CUT_HEIGHT: (f64, f64) = (0.85, 1.0);
/// What hangs flat on a wall is no deeper than this, metres.
const FLAT_ON_WALL_M: f64 = 0.1;
/// Greatest angle between the viewing direction and the side that is completed, as a cosine.
const ALONG: f64 = 0.7;

/// A surface is looked for from this far outside of the outermost points to this far inside, metres: depth noise puts the
/// outermost ones before the surface.
const FACE_SEARCH_M: (f64, f64) = (0.01, 0.07);
/// Side of the columns in which the depth of a surface is measured, in voxels: neighbours in depth share one whatever the
/// heading of the box.
const COLUMN_VOXELS: f64 = 1.5;
/// What lies farther from the mean of a column belongs to another surface, metres: three deviations of depth at 3 m.
const COLUMN_TRIM_M: f64 = 0.03;
/// Width of a bin of that search, metres.
const FACE_BIN_M: f64 = 0.005;
/// Share of a side's area that points within 1.5 cm of a plane must cover to make it a face.
const FACE_SHARE: f64 = 0.3;
/// Sides whose shorter edge is below this are too small to tell a face from a curve, metres ...
const FACE_LEAST_M: f64 = 0.12;
/// ... unless the thing is thinner than this and than half of that edge.
const SHEET_M: f64 = 0.05;
/// Share of the points of a sheet that lie within 1.5 cm of its plane.
const SHEET_SHARE: f64 = 0.5;
/// Thickness of a thing of which one face was seen and nothing more is known, metres.
const THINNEST_M: f64 = 0.02;
/// Share of the usual depth below which only the front can have been seen.
const FRONT_SHARE: f64 = 0.5;

/// From where a thing was seen.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seen {
    /// Mean of the horizontal unit directions from the thing to its viewers; near zero when they stood all around it.
    pub(super) towards: Vector2<f64>,
    /// Share of the viewers above it less that of those below.
    pub(super) above: f64,
    /// What the best view lost of the outline, where masks and depth mix two surfaces, metres.
    pub(super) lost_m: f64,
    /// Whether the upper edge of the image cut the thing off in most views.
    pub(super) cut_above: bool,
}

/// The upright box with the rectangle that fits best.
///
/// A flat side lies where most of its points are, for depth noise is the same before and behind a surface. Other sides lie
/// at the 1st and 99th percentile, grown by what the views lost. What was seen from the front alone is completed away from
/// its viewers: a bulging or very narrow thing becomes as deep as it is wide, a front gets the usual depth of its kind
/// (`depth_m`), one up to 60 cm wide whose kind tells none 0.6 of its width, a larger sheet 2 cm. What hangs flat on a wall
/// and was cut off by the image's upper edge is taken for nearly as high as wide.
pub(super) fn upright_box(
    (points, masses): (&[MapPoint], &[f32]),
    aabb: &Aabb,
    voxel_m: f64,
    seen: &Seen,
    depth_m: Option<f64>,
) -> Option<OrientedBox> {
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
    let turned: Vec<Point3<f32>> = points.iter().map(|p| box_from_world * p.position).collect();
    let mut sides = Sides::find(&turned)?;
    let towards = rotation.inverse() * Vector3::new(seen.towards.x, seen.towards.y, 0.0);
    let towards = Vector3::new(towards.x, towards.y, seen.above);
    let outermost = (sides.low, sides.high);
    sides.settle_faces(&turned, masses, voxel_m, seen.lost_m);
    complete_small(&mut sides, &towards, (&turned, masses), outermost, depth_m);
    sides.thicken(&towards, depth_m);
    if seen.cut_above && depth_m.is_some_and(|depth| depth <= FLAT_ON_WALL_M) {
        let width = (sides.high - sides.low).xy().max();
        sides.high.z = sides.high.z.max(sides.low.z + (CUT_HEIGHT.0 * width).min(CUT_HEIGHT.1));
    }
    let Sides { low, high, .. } = sides;
    let size = (high - low).map(|side| side.max(0.5 * voxel_m));
    Some(OrientedBox { center: rotation * Point3::from((low + high) * 0.5), size, rotation })
}

/// The sides of a box along its own axes.
struct Sides {
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// Which sides are flat faces that were measured, low and high of each axis.
    faces: [[bool; 2]; 3],
}

impl Sides {
    /// Between the 1st and the 99th percentile.
    fn find(points: &[Point3<f32>]) -> Option<Self> {
        let (mut low, mut high) = (Vector3::zeros(), Vector3::zeros());
        let mut values: Vec<f32> = Vec::with_capacity(points.len());
        for i in 0..3 {
            values.clear();
            values.extend(points.iter().map(|p| p[i]));
            (low[i], high[i]) = find_percentiles(&mut values)?;
        }
        Some(Self { low, high, faces: [[false; 2]; 3] })
    }

    /// Puts flat sides where their points are and grows the others by what was lost of the outline.
    fn settle_faces(&mut self, points: &[Point3<f32>], masses: &[f32], voxel_m: f64, lost_m: f64) {
        let (low, size) = (self.low, self.high - self.low);
        let cell_m = COLUMN_VOXELS * voxel_m;
        for axis in 0..3 {
            let across = [(axis + 1) % 3, (axis + 2) % 3];
            let [u, v] = across.map(|i| size[i]);
            let is_sheet = size[axis] < SHEET_M && size[axis] < 0.5 * u.min(v);
            let is_side = is_sheet || u.min(v) >= FACE_LEAST_M;
            for (side, outward) in [(0, -1.0), (1, 1.0)] {
                let edge = if side == 0 { self.low[axis] } else { self.high[axis] };
                let face = is_side.then(|| {
                    // A side lies before the middle: behind it is the opposite one. The sides of a sheet are the same.
                    let deepest_m = if is_sheet { FACE_SEARCH_M.1 } else { FACE_SEARCH_M.1.min(0.5 * size[axis]) };
                    let inside = |p: &Point3<f32>| {
                        Some((edge - f64::from(p[axis])) * outward).filter(|depth| *depth < deepest_m)
                    };
                    let columns = find_columns(points, masses, across.map(|i| (i, low[i], size[i])), cell_m, inside);
                    let covered = FACE_SHARE * u * v / (cell_m * cell_m);
                    let enough = if is_sheet { covered.max(SHEET_SHARE * columns.len() as f64) } else { covered };
                    find_face_m(columns.into_iter(), enough)
                });
                let face = face.flatten();
                self.faces[axis][side] = face.is_some();
                let moved = edge + outward * face.map_or(lost_m, |inside| -inside);
                if side == 0 { self.low[axis] = moved } else { self.high[axis] = moved }
            }
        }
    }

    /// Gives what shows one face alone its thickness, away from the viewers: the usual depth of a front, else 2 cm.
    fn thicken(&mut self, towards: &Vector3<f64>, depth_m: Option<f64>) {
        let extent = self.high - self.low;
        // A row of cupboards is seen aslant: the front is the sheet, wherever along it the viewer stands.
        let thin = usize::from(extent.y < extent.x);
        let deep = if extent[thin] < SHEET_M { thin } else { usize::from(towards.y.abs() > towards.x.abs()) };
        for axis in 0..3 {
            let size = self.high[axis] - self.low[axis];
            let lies = self.high.z - self.low.z < SHEET_M;
            let front = axis == deep && !lies && towards[axis].abs() > 0.3 && self.faces[axis].contains(&true);
            let usual = depth_m.filter(|_| front);
            // A front may be thinner than it was measured, but no front is deeper than it was seen to be.
            let is_thin = usual.is_some_and(|depth| size < FRONT_SHARE * depth || depth < SHEET_M && size < SHEET_M);
            let wanted = usual.filter(|_| is_thin).unwrap_or(THINNEST_M);
            if size >= wanted && !is_thin {
                continue;
            }
            if towards[axis] >= 0.0 {
                self.low[axis] = self.high[axis] - wanted;
            } else {
                self.high[axis] = self.low[axis] + wanted;
            }
        }
    }
}

/// How far inside of a side the surface lies in each column of a grid across it, as far as it lies within the search for
/// faces: the mean of what was measured there, by its mass, without what is farther than [`COLUMN_TRIM_M`] from it. Depth
/// noise fills several layers of voxels, of which the outer ones hold little.
fn find_columns(
    points: &[Point3<f32>],
    masses: &[f32],
    across: [(usize, f64, f64); 2],
    cell_m: f64,
    inside: impl Fn(&Point3<f32>) -> Option<f64>,
) -> Vec<f64> {
    let counts = across.map(|(_, _, size)| (size / cell_m) as usize + 1);
    let column = |p: &Point3<f32>| {
        let [u, v] = [0, 1].map(|i| {
            let (axis, low, _) = across[i];
            (((f64::from(p[axis]) - low) / cell_m).max(0.0) as usize).min(counts[i] - 1)
        });
        u * counts[1] + v
    };
    let near = points.iter().zip(masses).filter_map(|(p, mass)| {
        let depth = inside(p).filter(|depth| (-FACE_SEARCH_M.0..FACE_SEARCH_M.1).contains(depth))?;
        Some((column(p), depth, f64::from(*mass).max(1e-6)))
    });
    let near: Vec<(usize, f64, f64)> = near.collect();
    let mean = |reach_m: f64, around: &[(f64, f64)]| {
        let mut sums = vec![(0.0, 0.0); counts[0] * counts[1]];
        for &(column, depth, mass) in &near {
            if around.get(column).is_none_or(|(mass, moment)| (depth - moment / mass).abs() <= reach_m) {
                sums[column].0 += mass;
                sums[column].1 += mass * depth;
            }
        }
        sums
    };
    let sums = mean(COLUMN_TRIM_M, &mean(0.0, &[]));
    sums.into_iter().filter(|(mass, _)| *mass > 0.0).map(|(mass, moment)| moment / mass).collect()
}

/// How far inside of the outermost points a plane lies that enough points are close to; the outermost such plane. `inside`
/// is that depth of each point.
fn find_face_m(inside: impl Iterator<Item = f64>, enough: f64) -> Option<f64> {
    const BINS: usize = ((FACE_SEARCH_M.0 + FACE_SEARCH_M.1) / FACE_BIN_M) as usize;
    let mut bins = [(0.0f64, 0.0f64); BINS];
    for depth in inside {
        let bin = (depth + FACE_SEARCH_M.0) / FACE_BIN_M;
        if bin >= 0.0 && bin < BINS as f64 {
            bins[bin as usize].0 += 1.0;
            bins[bin as usize].1 += depth;
        }
    }
    let around = |middle: usize, reach: usize| {
        let part = &bins[middle.saturating_sub(reach)..(middle + reach + 1).min(BINS)];
        part.iter().fold((0.0, 0.0), |(count, sum), bin| (count + bin.0, sum + bin.1))
    };
    let peak = (0..BINS).find(|&i| around(i, 1).0 >= enough && around(i, 1).0 >= around((i + 1).min(BINS - 1), 1).0)?;
    let (count, sum) = around(peak, 2);
    Some(sum / count)
}

/// Completes the outline of a thing that was seen from one side. Mugs, bowls, bottles and fruit bulge and are as deep as they
/// are wide; their far half never shows. So are things so narrow that noise hides how deep they are. Of a flat front whose
/// kind tells no depth the depth is guessed.
fn complete_small(
    sides: &mut Sides,
    towards: &Vector3<f64>,
    (points, masses): (&[Point3<f32>], &[f32]),
    (lowest, highest): (Vector3<f64>, Vector3<f64>),
    depth_m: Option<f64>,
) {
    let distance = towards.xy().norm();
    if distance < ONE_SIDED || depth_m.is_some_and(|depth| depth <= FLAT_ON_WALL_M) {
        return;
    }
    let deep = usize::from(towards.y.abs() > towards.x.abs());
    let (depth, width) = (highest[deep] - lowest[deep], sides.high[1 - deep] - sides.low[1 - deep]);
    let height = sides.high.z - sides.low.z;
    let narrow = width < NARROW_M && depth < width + NARROW_M;
    if towards[deep].abs() < ALONG * distance || width > FRONT_BELOW_M || depth >= width && !narrow {
        return;
    }
    let outward = towards[deep].signum();
    let front = if outward > 0.0 { highest[deep] } else { lowest[deep] };
    let inside = |p: &Point3<f32>| (front - f64::from(p[deep])) * outward;
    let bulges = || depth >= BULGE * width && is_round(points, 1 - deep, 0.25 * depth, inside);
    let (near, depth) = if width <= ROUND_BELOW_M && (narrow || bulges()) {
        let weighed = points.iter().zip(masses).map(|(p, mass)| (f64::from(*mass), inside(p)));
        let (mass, moment) = weighed.fold((1e-9, 0.0), |sum, (mass, depth)| (sum.0 + mass, sum.1 + mass * depth));
        (front - outward * (moment / mass - MEAN_DEPTH * width), width)
    } else if depth < SEEN_DEPTH * width && depth_m.is_none() && height > SHEET_M {
        let near = if outward > 0.0 { sides.high[deep] } else { sides.low[deep] };
        (near, FLAT_DEPTH * width)
    } else {
        return;
    };
    (sides.low[deep], sides.high[deep]) = if outward > 0.0 { (near - depth, near) } else { (near, near + depth) };
}

/// Whether the points that are nearer than `reach` are narrower across than all of them.
fn is_round(points: &[Point3<f32>], across: usize, reach: f64, inside: impl Fn(&Point3<f32>) -> f64) -> bool {
    let width = |values: &mut [f32]| find_percentiles(values).map_or(0.0, |(low, high)| high - low);
    let mut all: Vec<f32> = points.iter().map(|p| p[across]).collect();
    let mut front: Vec<f32> = points.iter().filter(|p| inside(p) < reach).map(|p| p[across]).collect();
    width(&mut front) < ROUND_FRONT * width(&mut all)
}

#[cfg(test)]
mod tests {
    //! Contract: a half-seen cylinder gets the box of the whole one; a thing seen from all sides stays; a flat side lies
    //! amid its noise; a sheet and a front are completed away from their viewers.
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn surface(places: impl Iterator<Item = (f64, f64)>) -> Vec<MapPoint> {
        let heights = [0.0, 0.02, 0.04, 0.06, 0.08, 0.1];
        let column = |(x, y): (f64, f64)| heights.map(|z| Point3::new(x as f32, y as f32, z as f32));
        places.flat_map(column).map(|position| MapPoint { position, color: [9; 3] }).collect()
    }

    fn bound(points: &[MapPoint], towards: [f64; 2], depth_m: Option<f64>) -> OrientedBox {
        let all: Vec<Point3<f64>> = points.iter().map(|p| p.position.cast()).collect();
        let seen = Seen { towards: Vector2::from(towards), above: 1.0, ..Seen::default() };
        upright_box((points, &vec![1.0; points.len()]), &Aabb::from_points(&all).unwrap(), 0.01, &seen, depth_m)
            .unwrap()
    }

    /// A square of 0.4 m across `axis` at `place_m`, measured every centimetre with an error of 8 mm.
    fn noisy_square(axis: usize, place_m: f64) -> Vec<MapPoint> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut error = || (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>() * 0.008;
        let mut point = |i: i32, j: i32| {
            let mut p = Point3::origin();
            p[axis] = (place_m + error()) as f32;
            p[(axis + 1) % 3] = 0.01 * i as f32;
            p[(axis + 2) % 3] = 0.01 * j as f32;
            MapPoint { position: p, color: [9; 3] }
        };
        (0..40).flat_map(|i| (0..40).map(move |j| (i, j))).map(|(i, j)| point(i, j)).collect()
    }

    #[test]
    fn half_a_cylinder_is_completed() {
        // The side that faces a viewer at +x, as its pixels show it.
        let arc = (-30..=30).map(|i| f64::from(i) / 30.0).map(|y| (0.04 * (1.0 - y * y).sqrt(), 0.04 * y));
        let half = surface(arc);
        let whole = OrientedBox::from(Aabb { min: Point3::new(-0.04, -0.04, 0.0), max: Point3::new(0.04, 0.04, 0.1) });
        assert!(bound(&half, [0.95, 0.0], None).iou(&whole) > 0.85);
        assert!(bound(&half, [0.2, 0.0], None).iou(&whole) < 0.6, "seen from all sides it is what it is");
    }

    #[test]
    fn a_flat_front_gets_the_usual_depth_of_its_kind_away_from_the_viewer() {
        // A front at x = 1 with a viewer at +x: less deep than wide when nothing is known of it.
        let front = noisy_square(0, 1.0);
        let unknown = bound(&front, [1.0, 0.0], None);
        assert!((unknown.size.x - FLAT_DEPTH * unknown.size.y).abs() < 0.02, "{unknown:?}");
        assert!((unknown.aabb().max.x - 1.0).abs() < 0.004, "{unknown:?}");
        let cabinet = bound(&front, [1.0, 0.0], Some(0.5));
        assert!((cabinet.size.x - 0.5).abs() < 1e-6 && (cabinet.center.x - 0.75).abs() < 0.002, "{cabinet:?}");
    }

    #[test]
    fn a_front_seen_aslant_gets_its_depth_too() {
        let front = noisy_square(0, 1.0);
        let cabinet = bound(&front, [0.55, 0.8], Some(0.5));
        assert!((cabinet.size.x - 0.5).abs() < 1e-6 && (cabinet.center.x - 0.75).abs() < 0.002, "{cabinet:?}");
    }

    #[test]
    fn a_thin_layer_of_noise_before_a_face_does_not_move_it() {
        let layer = |x: f32| {
            let row = |i: u8| (0..20u8).map(move |j| [0.02 * f32::from(i), 0.02 * f32::from(j)]);
            (0..20).flat_map(row).map(move |[y, z]| MapPoint { position: Point3::new(x, y, z), color: [9; 3] })
        };
        // Noise fills voxels before and behind the face, each with a twentieth of what was measured.
        let points: Vec<MapPoint> = layer(0.975).chain(layer(1.0)).chain(layer(1.025)).collect();
        let masses: Vec<f32> = (0..1200).map(|i| if (400..800).contains(&i) { 60.0 } else { 3.0 }).collect();
        let all: Vec<Point3<f64>> = points.iter().map(|p| p.position.cast()).collect();
        let seen = Seen { towards: Vector2::new(0.95, 0.0), above: 0.0, ..Seen::default() };
        let aabb = Aabb::from_points(&all).unwrap();
        let bounds = upright_box((&points, &masses), &aabb, 0.02, &seen, Some(0.5)).unwrap();
        let front = bounds.aabb().max.x;
        assert!((front - 1.0).abs() < 0.004, "{front}");
    }

    #[test]
    fn of_what_is_narrower_than_the_noise_the_depth_is_its_width() {
        // A candle of 3 cm whose depth spreads over 6 cm.
        let points: Vec<MapPoint> = (0..7)
            .flat_map(|i| (0..4).flat_map(move |j| (0..12).map(move |k| (i, j, k))))
            .map(|(i, j, k)| [0.01 * (i as f32 - 3.0), 0.01 * j as f32 - 0.015, 0.01 * k as f32])
            .map(|[x, y, z]| MapPoint { position: Point3::new(x, y, z), color: [9; 3] })
            .collect();
        let candle = bound(&points, [0.98, 0.0], None);
        assert!((candle.size.x - candle.size.y).abs() < 1e-6 && candle.size.x < 0.04, "{candle:?}");
        assert!(candle.center.x.abs() < 0.02, "{candle:?}");
    }

    #[test]
    fn a_board_seen_from_above_reaches_down() {
        let board = bound(&noisy_square(2, 0.8), [0.0, 0.5], Some(0.3));
        assert!((board.top_m() - 0.8).abs() < 0.002 && (board.size.z - 0.02).abs() < 1e-6, "{board:?}");
    }
}
