//! Handles of drawers and doors by their shape: thin bars that stand off an upright front.

use super::cloud::{find_clusters, quantile, thin};
use nalgebra::{Point3, UnitQuaternion, Vector3};

/// A front may be turned by so much against what is expected of it, in steps, degrees: boxes of maps are off by less.
const TURNED_DEG: i32 = 14;
/// Side of the cells in which a front is counted, metres.
const CELL_M: f64 = 0.01;
/// Least area of a front, square metres: that of the smallest drawers.
const LEAST_M2: f64 = 0.02;
/// Depth within which points belong to one plane, metres: twice what a camera a metre away is off.
const PLANE_M: f64 = 0.008;
/// Points of one front lie no farther apart, metres: gaps between drawers, and what handles hide.
const JOINED_M: f64 = 0.03;
/// How far handles stand out from their front, metres: room for fingers, and no farther than shins allow.
const OFF_M: (f64, f64) = (0.012, 0.085);
/// Length of bars that a hand is meant to hold, metres.
const LENGTH_M: (f64, f64) = (0.055, 0.26);
/// Greatest thickness of such a bar as it is measured, metres: 18 mm, and the blur of depth at its edges.
const THICK_M: f64 = 0.034;
/// A bar is longer than thick by this factor.
const SLENDER: f64 = 2.2;
/// Points of one bar lie no farther apart, metres.
const STEP_M: f64 = 0.014;
/// Thickness that a measured one is taken for at least and at most, metres.
const REAL_THICK_M: (f64, f64) = (0.01, 0.025);

/// An upright plane that shows a front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Front {
    /// A point of it.
    pub point: Point3<f64>,
    /// Its normal towards the viewer, level, of length 1.
    pub normal: Vector3<f64>,
    /// Its extent to the viewer's right of the point, metres.
    pub right_m: (f64, f64),
    /// The heights between which it lies, metres.
    pub height_m: (f64, f64),
}

impl Front {
    /// The level direction along the front, to the viewer's right.
    pub fn right(&self) -> Vector3<f64> {
        Vector3::z().cross(&self.normal)
    }

    /// How far a point lies before the front, metres.
    pub fn off_m(&self, point: &Point3<f64>) -> f64 {
        (point - self.point).dot(&self.normal)
    }
}

/// A bar before a front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// Its middle.
    pub center: Point3<f64>,
    /// Its long axis, of length 1: up, or along the front.
    pub along: Vector3<f64>,
    /// Its length, metres.
    pub length_m: f64,
    /// Its thickness, metres.
    pub thick_m: f64,
    /// How far its middle stands off the front, metres.
    pub off_m: f64,
    /// Normal of the front, towards the viewer.
    pub normal: Vector3<f64>,
}

impl Handle {
    /// Whether it stands upright, as those of doors do.
    pub fn is_upright(&self) -> bool {
        self.along.z.abs() > 0.5
    }

    /// Where the tool holds it: it looks against the normal (+z) and closes across the bar (+y); the second pose is the hand
    /// turned over. Fingers that reach `beyond_m` past the tool stay before the front.
    pub fn grips(&self, beyond_m: f64) -> [dsm::Pose; 2] {
        /// Room left between finger tips and the front, metres.
        const SPARE_M: f64 = 0.006;
        let out_m = (beyond_m + SPARE_M - self.off_m).max(0.0);
        let at = self.center + self.normal * out_m;
        [1.0, -1.0].map(|sign| {
            let z = -self.normal;
            let y = self.along.cross(&z) * sign;
            let basis = nalgebra::Rotation3::from_basis_unchecked(&[y.cross(&z), y, z]);
            dsm::Pose::from_parts(at.coords.into(), UnitQuaternion::from_rotation_matrix(&basis))
        })
    }
}

/// The largest upright plane that faces `towards` (level, of any length) more or less.
pub fn find_front(points: &[Point3<f64>], towards: &Vector3<f64>) -> Option<Front> {
    let cells = thin(points, CELL_M);
    let expected = Vector3::new(towards.x, towards.y, 0.0).try_normalize(1e-9)?;
    let turned =
        |degrees: i32| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), f64::from(degrees).to_radians()) * expected;
    let ways = (-TURNED_DEG..=TURNED_DEG).step_by(2).map(turned);
    let (mut normal, mut level_m, _) = ways
        .filter_map(|normal| fullest(&cells, &normal).map(|(level_m, count)| (normal, level_m, count)))
        .fold(None, |best: Option<(Vector3<f64>, f64, usize)>, found| match best {
            Some(best) if best.2 >= found.2 => Some(best),
            _ => Some(found),
        })?;
    let mut inliers = Vec::new();
    for _ in 0..4 {
        let right = Vector3::z().cross(&normal);
        let near = |p: &&Point3<f64>| (p.coords.dot(&normal) - level_m).abs() < PLANE_M;
        inliers = cells.iter().filter(near).copied().collect::<Vec<_>>();
        // Least squares of the depth over the way along the front.
        let n = inliers.len() as f64;
        let along = |p: &Point3<f64>| p.coords.dot(&right);
        let (mean_u, mean_s) = inliers.iter().fold((0.0, 0.0), |(u, s), p| (u + along(p), s + p.coords.dot(&normal)));
        let (mean_u, mean_s) = (mean_u / n, mean_s / n);
        let (uu, us) = inliers.iter().fold((0.0, 0.0), |(uu, us), p| {
            let u = along(p) - mean_u;
            (uu + u * u, us + u * (p.coords.dot(&normal) - mean_s))
        });
        if uu > 1e-9 {
            let middle = right * mean_u + normal * mean_s;
            normal = (normal - right * (us / uu)).normalize();
            level_m = middle.dot(&normal);
        }
    }
    // What lies in the same plane elsewhere, a lamp over the edge or a neighbour's side, is not of the front.
    let main = find_clusters(&inliers, JOINED_M).into_iter().next()?;
    let inliers: Vec<Point3<f64>> = main.into_iter().map(|index| inliers[index]).collect();
    if (inliers.len() as f64) * CELL_M * CELL_M < LEAST_M2 {
        return None;
    }
    let right = Vector3::z().cross(&normal);
    let extent = |axis: Vector3<f64>| {
        let values = || inliers.iter().map(move |p| p.coords.dot(&axis));
        Some((quantile(values(), 0.01)?, quantile(values(), 0.99)?))
    };
    let (along, height_m) = (extent(right)?, extent(Vector3::z())?);
    let middle_m = 0.5 * (along.0 + along.1);
    let point = Point3::from(right * middle_m + normal * level_m + Vector3::z() * 0.5 * (height_m.0 + height_m.1));
    Some(Front { point, normal, right_m: (along.0 - middle_m, along.1 - middle_m), height_m })
}

/// The depth along a normal at which most cells lie, and how many.
fn fullest(cells: &[Point3<f64>], normal: &Vector3<f64>) -> Option<(f64, usize)> {
    let mut depths: Vec<f64> = cells.iter().map(|p| p.coords.dot(normal)).collect();
    depths.sort_by(f64::total_cmp);
    let mut first = 0;
    let mut best: Option<(f64, usize)> = None;
    for last in 0..depths.len() {
        while depths[last] - depths[first] > 1.5 * PLANE_M {
            first += 1;
        }
        let count = last + 1 - first;
        if best.is_none_or(|(_, most)| count > most) {
            best = Some((0.5 * (depths[first] + depths[last]), count));
        }
    }
    best
}

/// The bars before a front, the highest first, those of one height from left to right.
pub fn find_handles(points: &[Point3<f64>], front: &Front) -> Vec<Handle> {
    /// A front's own border is blurred, metres.
    const BORDER_M: f64 = 0.02;
    /// Heights nearer than this are one row, metres.
    const ROW_M: f64 = 0.05;
    let right = front.right();
    let before: Vec<Point3<f64>> = points
        .iter()
        .filter(|p| {
            let (off_m, right_m) = (front.off_m(p), (*p - front.point).dot(&right));
            let within = |value: f64, (low, high): (f64, f64)| value > low - BORDER_M && value < high + BORDER_M;
            off_m > OFF_M.0 && off_m < OFF_M.1 && within(right_m, front.right_m) && within(p.z, front.height_m)
        })
        .copied()
        .collect();
    let before = thin(&before, 0.004);
    let of_front: Vec<Point3<f64>> = points.iter().filter(|p| front.off_m(p).abs() < PLANE_M).copied().collect();
    let of_front = thin(&of_front, CELL_M);
    let clusters = find_clusters(&before, STEP_M);
    let bars = clusters.iter().filter_map(|cluster| {
        let members: Vec<Point3<f64>> = cluster.iter().map(|&index| before[index]).collect();
        bar_of(&members, front).filter(|bar| is_on_front(bar, &of_front))
    });
    let mut bars: Vec<Handle> = bars.collect();
    bars.sort_by(|a, b| b.center.z.total_cmp(&a.center.z));
    // Rows from the top, each from left to right.
    let mut rows: Vec<Vec<Handle>> = Vec::new();
    for bar in bars {
        match rows.last_mut() {
            Some(row) if (row[0].center.z - bar.center.z).abs() < ROW_M => row.push(bar),
            _ => rows.push(vec![bar]),
        }
    }
    let right_m = |handle: &Handle| (handle.center - front.point).dot(&right);
    rows.iter_mut().for_each(|row| row.sort_by(|a, b| right_m(a).total_cmp(&right_m(b))));
    rows.into_iter().flatten().collect()
}

/// Whether the front goes on to either side of a bar.
fn is_on_front(bar: &Handle, of_front: &[Point3<f64>]) -> bool {
    /// How far to either side is looked, metres: one who looks down at 45 degrees sees nothing right below a bar.
    const ASIDE_M: (f64, f64) = (0.012, 0.092);
    /// Least share of the cells there that show the front.
    const SHARE: f64 = 0.25;
    let across = bar.along.cross(&bar.normal);
    let count = |sign: f64| {
        let beside = |p: &&Point3<f64>| {
            let off = *p - bar.center;
            let aside_m = sign * off.dot(&across);
            off.dot(&bar.along).abs() < 0.5 * bar.length_m && aside_m > ASIDE_M.0 && aside_m < ASIDE_M.1
        };
        of_front.iter().filter(beside).count() as f64
    };
    let all = bar.length_m * (ASIDE_M.1 - ASIDE_M.0) / (CELL_M * CELL_M);
    [-1.0, 1.0].iter().all(|sign| count(*sign) > SHARE * all)
}

/// The bar that a few points are, if they are one.
fn bar_of(members: &[Point3<f64>], front: &Front) -> Option<Handle> {
    const LEAST_POINTS: usize = 12;
    if members.len() < LEAST_POINTS {
        return None;
    }
    let right = front.right();
    let range = |axis: Vector3<f64>| {
        let values = || members.iter().map(move |p| (p - front.point).dot(&axis));
        Some((quantile(values(), 0.03)?, quantile(values(), 0.97)?))
    };
    let (level, rise) = (range(right)?, range(Vector3::z())?);
    let (wide_m, high_m) = (level.1 - level.0, rise.1 - rise.0);
    let (along, length_m, across_m) =
        if wide_m > high_m { (right, wide_m, high_m) } else { (Vector3::z(), high_m, wide_m) };
    if !(LENGTH_M.0..=LENGTH_M.1).contains(&length_m) || across_m > THICK_M || length_m < SLENDER * across_m {
        return None;
    }
    // Its outer face; what it is thick across it is thick along the normal, too.
    let off = |share: f64| quantile(members.iter().map(|p| front.off_m(p)), share);
    let outer_m = off(0.85)?;
    // A fifth may be the posts; a thing that stands before the front is deeper.
    if off(0.97)? - off(0.2)? > THICK_M {
        return None;
    }
    let thick_m = across_m.clamp(REAL_THICK_M.0, REAL_THICK_M.1);
    let off_m = outer_m - 0.5 * thick_m;
    if off_m < OFF_M.0 {
        return None;
    }
    let center = front.point
        + right * (0.5 * (level.0 + level.1))
        + Vector3::z() * (0.5 * (rise.0 + rise.1))
        + front.normal * off_m;
    Some(Handle { center, along, length_m, thick_m, off_m, normal: front.normal })
}

#[cfg(test)]
mod tests {
    //! Contract: the front of a piece of furniture and the bars before it are found in a noisy cloud, where they are and as
    //! they lie; boards, things and a block that is no bar are not taken for handles.
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    struct Cloud {
        points: Vec<Point3<f64>>,
        rng: ChaCha8Rng,
        turned: UnitQuaternion<f64>,
    }

    impl Cloud {
        fn new(turned_rad: f64) -> Self {
            let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turned_rad);
            Self { points: Vec::new(), rng: ChaCha8Rng::seed_from_u64(3), turned }
        }

        /// A box's front and upper face, seen along +x from the origin; depth is off by 2 mm.
        fn cuboid(&mut self, center: [f64; 3], size: [f64; 3]) {
            let step_m = 0.003;
            let count = |side_m: f64| (side_m / step_m).ceil() as i32;
            for (j, k) in (0..=count(size[1])).flat_map(|j| (0..=count(size[2])).map(move |k| (j, k))) {
                self.add(
                    center,
                    size,
                    [0.0, f64::from(j) / f64::from(count(size[1])), f64::from(k) / f64::from(count(size[2]))],
                );
            }
            for (i, j) in (0..=count(size[0])).flat_map(|i| (0..=count(size[1])).map(move |j| (i, j))) {
                self.add(
                    center,
                    size,
                    [f64::from(i) / f64::from(count(size[0])), f64::from(j) / f64::from(count(size[1])), 1.0],
                );
            }
        }

        fn add(&mut self, center: [f64; 3], size: [f64; 3], share: [f64; 3]) {
            let noise = self.rng.random_range(-0.004..0.004);
            let at = [0, 1, 2].map(|k| center[k] + (share[k] - 0.5) * size[k]);
            self.points.push(self.turned * Point3::new(at[0] + noise, at[1], at[2]));
        }
    }

    fn chest(turned_rad: f64) -> Cloud {
        let mut cloud = Cloud::new(turned_rad);
        cloud.cuboid([1.2, 0.1, 0.4], [0.4, 0.9, 0.8]);
        for z in [0.15, 0.4, 0.65] {
            cloud.cuboid([0.96, 0.1, z], [0.015, 0.14, 0.015]);
        }
        cloud
    }

    #[test]
    fn bars_before_a_turned_front_are_found() {
        for turned_rad in [0.0, 0.15, -0.12] {
            let cloud = chest(turned_rad);
            let front = find_front(&cloud.points, &-Vector3::x()).expect("a front");
            let normal = cloud.turned * -Vector3::x();
            assert!(front.normal.angle(&normal) < 0.01, "{} for {normal}", front.normal);
            let handles = find_handles(&cloud.points, &front);
            assert_eq!(handles.len(), 3, "{handles:?}");
            for (handle, z) in handles.iter().zip([0.65, 0.4, 0.15]) {
                let at = cloud.turned * Point3::new(0.96, 0.1, z);
                assert!((handle.center - at).norm() < 0.006, "{} for {at}", handle.center);
                assert!(!handle.is_upright() && (handle.length_m - 0.14).abs() < 0.015 && handle.off_m > 0.034);
                let [tool, turned] = handle.grips(0.015);
                assert!((tool * Vector3::z() + front.normal).norm() < 1e-9);
                assert!((tool * Vector3::y()).z.abs() > 0.999, "the fingers close up and down");
                assert!((turned * Vector3::y() + tool * Vector3::y()).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn upright_bars_come_from_left_to_right() {
        let mut cloud = Cloud::new(0.0);
        cloud.cuboid([1.2, 0.0, 0.6], [0.4, 0.8, 1.2]);
        cloud.cuboid([0.95, 0.05, 0.62], [0.014, 0.014, 0.15]);
        cloud.cuboid([0.95, -0.05, 0.6], [0.014, 0.014, 0.15]);
        let front = find_front(&cloud.points, &-Vector3::x()).expect("a front");
        let handles = find_handles(&cloud.points, &front);
        assert_eq!(handles.len(), 2);
        assert!(handles.iter().all(Handle::is_upright));
        // Seen along +x, +y is to the left.
        assert!(handles[0].center.y > 0.0 && handles[1].center.y < 0.0);
        let [tool, _] = handles[0].grips(0.015);
        assert!((tool * Vector3::y()).z.abs() < 1e-9, "the fingers close from the sides");
    }

    #[test]
    fn boards_and_things_are_no_handles() {
        let mut cloud = Cloud::new(0.0);
        cloud.cuboid([1.2, 0.0, 0.4], [0.4, 0.9, 0.8]);
        // A ledge along the whole front, a cup before it, a plate on the wall.
        cloud.cuboid([0.97, 0.0, 0.78], [0.06, 0.9, 0.02]);
        cloud.cuboid([0.95, 0.2, 0.05], [0.08, 0.08, 0.1]);
        cloud.cuboid([0.98, -0.2, 0.3], [0.02, 0.2, 0.2]);
        // The rim of a lamp on top, over the front's edge.
        cloud.cuboid([0.96, 0.3, 0.84], [0.02, 0.12, 0.02]);
        let front = find_front(&cloud.points, &-Vector3::x()).expect("a front");
        assert_eq!(find_handles(&cloud.points, &front), Vec::new());
        assert!(find_front(&cloud.points[..50], &-Vector3::x()).is_none(), "too small");
    }
}
