//! Contract: on noisy clouds seen from one side the first grasp holds the true shape squarely; neighbours, boards and
//! supports are respected; what does not fit yields nothing but reasons.
use super::*;
use nalgebra::Point2;
use rand::SeedableRng;
use rand_distr_free::{gauss, unit};

/// Random draws without another crate.
mod rand_distr_free {
    use nalgebra::Vector3;
    use rand::RngExt;

    pub(super) fn gauss(rng: &mut impl rand::Rng) -> f64 {
        (0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0
    }

    pub(super) fn unit(rng: &mut impl rand::Rng) -> Vector3<f64> {
        loop {
            let v =
                Vector3::new(rng.random_range(-1.0..1.0_f64), rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
            if v.norm() < 1.0 && v.norm() > 0.1 {
                return v.normalize();
            }
        }
    }
}

fn jitter(rng: &mut impl rand::Rng, noise_m: f64) -> Vector3<f64> {
    Vector3::new(gauss(rng), gauss(rng), gauss(rng)) * noise_m
}

pub(crate) fn sphere(center: Point3<f64>, radius: f64, noise_m: f64, count: usize, seed: u64) -> Vec<Point3<f64>> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| center + unit(&mut rng) * radius + jitter(&mut rng, noise_m)).collect()
}

pub(crate) fn cylinder(
    center: Point3<f64>,
    radius: f64,
    height: f64,
    noise_m: f64,
    count: usize,
    seed: u64,
) -> Vec<Point3<f64>> {
    use rand::RngExt;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|i| {
            let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
            let lid = i % 4 == 0;
            let r = if lid { radius * rng.random_range(0.0..1.0_f64).sqrt() } else { radius };
            let z = if lid { 0.5 * height } else { rng.random_range(-0.5..0.5) * height };
            center + Vector3::new(r * angle.cos(), r * angle.sin(), z) + jitter(&mut rng, noise_m)
        })
        .collect()
}

pub(crate) fn block(
    center: Point3<f64>,
    size: Vector3<f64>,
    yaw: f64,
    noise_m: f64,
    count: usize,
    seed: u64,
) -> Vec<Point3<f64>> {
    use rand::RngExt;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    (0..count)
        .map(|i| {
            let mut p =
                Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5));
            // The faces +-x, +-y and the top.
            match i % 5 {
                0 => p.x = 0.5,
                1 => p.x = -0.5,
                2 => p.y = 0.5,
                3 => p.y = -0.5,
                _ => p.z = 0.5,
            }
            center + turn * p.component_mul(&size) + jitter(&mut rng, noise_m)
        })
        .collect()
}

/// The points on the side of `center` towards `direction`.
pub(crate) fn seen_from(
    points: &[Point3<f64>],
    center: &Point3<f64>,
    direction: Vector3<f64>,
    beyond_m: f64,
) -> Vec<Point3<f64>> {
    points.iter().filter(|p| (*p - center).dot(&direction.normalize()) > beyond_m).copied().collect()
}

/// A horizontal board of 1 x 0.5 m around a point.
fn board(center: Point3<f64>, seed: u64) -> Vec<Point3<f64>> {
    use rand::RngExt;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..8000)
        .map(|_| {
            center
                + Vector3::new(rng.random_range(-0.25..0.25), rng.random_range(-0.5..0.5), 0.0)
                + jitter(&mut rng, 0.003)
        })
        .collect()
}

fn everywhere(_: &Pose) -> Option<f32> {
    Some(1.0)
}

const BASE: ApproachFrom = ApproachFrom::Base(Point2::new(0.3, 0.0));

fn closing(candidate: &GraspCandidate) -> Vector3<f64> {
    candidate.world_from_tool.rotation * Vector3::y()
}

fn approach(candidate: &GraspCandidate) -> Vector3<f64> {
    candidate.world_from_tool.rotation * Vector3::z()
}

#[test]
fn an_apple_on_a_table() {
    for (seed, noise_m) in [(1, 0.002), (2, 0.004), (3, 0.006)] {
        let center = Point3::new(1.0, 0.1, 0.736);
        let all = sphere(center, 0.036, noise_m, 1500, seed);
        let target = seen_from(&all, &center, Vector3::new(-1.0, 0.0, 0.7), -0.005);
        let scene = GraspScene::from_points(&target, &board(Point3::new(1.0, 0.0, 0.7), 9), BASE).unwrap();
        assert!((scene.support_z_m - 0.7).abs() < 0.006, "{}", scene.support_z_m);
        let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
        assert!(plan.candidates.len() >= 10, "{:?}", plan.rejected);
        for candidate in plan.candidates.iter().take(5) {
            let offset = candidate.world_from_tool.inverse_transform_point(&center);
            assert!(offset.y.abs() < 0.012, "off by {offset:?} along the closing direction");
            assert!(offset.x.abs() < 0.02 && offset.z.abs() < 0.03, "{offset:?}");
            assert!((candidate.width_m - 0.072).abs() < 0.018, "noise {noise_m}: {}", candidate.width_m);
            assert!(candidate.opening_m > candidate.width_m + 0.02 && candidate.opening_m <= 0.13);
            let tip = candidate.world_from_tool * Point3::new(0.0, 0.0, 0.015);
            assert!(tip.z > 0.7 + 0.006);
            assert!((closing(candidate).dot(&approach(candidate))).abs() < 1e-9);
        }
        assert!(plan.candidates.iter().any(|c| c.approach == Approach::TopDown));
        assert!(plan.candidates.iter().any(|c| c.approach != Approach::TopDown));
    }
}

#[test]
fn a_carton_is_held_across_its_shorter_side() {
    let center = Point3::new(1.0, 0.0, 0.8);
    let target = block(center, Vector3::new(0.06, 0.16, 0.2), 0.3, 0.003, 4000, 2);
    let scene = GraspScene::from_points(&target, &board(Point3::new(1.0, 0.0, 0.7), 9), BASE).unwrap();
    let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
    assert!(!plan.candidates.is_empty(), "{:?}", plan.rejected);
    let short = Vector3::new(0.3_f64.cos(), 0.3_f64.sin(), 0.0);
    for candidate in plan.candidates.iter().take(4) {
        assert!(closing(candidate).dot(&short).abs() > 0.97, "{candidate:?}");
        assert!((candidate.width_m - 0.06).abs() < 0.012, "{candidate:?}");
    }
    assert!(plan.rejected[&RejectReason::TooWide] > 0, "the long side does not fit");
}

#[test]
fn a_can_between_two_neighbours_is_held_through_the_gap() {
    let center = Point3::new(1.0, 0.0, 0.76);
    let target = cylinder(center, 0.033, 0.12, 0.003, 2500, 3);
    let mut obstacles = board(Point3::new(1.0, 0.0, 0.7), 9);
    for side in [-1.0, 1.0] {
        // 1 cm between the walls: no room for a finger there, but in front and behind.
        obstacles.extend(cylinder(center + Vector3::new(0.0, side * 0.076, 0.0), 0.033, 0.12, 0.003, 2500, 4));
    }
    let scene = GraspScene::from_points(&target, &obstacles, BASE).unwrap();
    let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
    assert!(!plan.candidates.is_empty(), "{:?}", plan.rejected);
    assert!(plan.rejected[&RejectReason::FingersCollide] > 0);
    for candidate in &plan.candidates {
        assert!(closing(candidate).x.abs() > 0.8, "closes in front and behind: {candidate:?}");
    }
}

#[test]
fn an_apple_under_a_board_is_taken_from_the_front() {
    let center = Point3::new(1.0, 0.0, 0.84);
    let all = sphere(center, 0.038, 0.004, 1500, 5);
    let target = seen_from(&all, &center, Vector3::new(-1.0, 0.0, 0.2), -0.005);
    let mut obstacles = board(Point3::new(1.0, 0.0, 0.8), 9);
    obstacles.extend(board(Point3::new(1.0, 0.0, 1.1), 10));
    let scene = GraspScene::from_points(&target, &obstacles, BASE).unwrap();
    let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
    assert!(!plan.candidates.is_empty(), "{:?}", plan.rejected);
    assert!(plan.candidates.iter().all(|c| c.approach != Approach::TopDown));
    assert!(plan.candidates[0].approach == Approach::Frontal || plan.candidates[0].approach == Approach::Angled);
    assert!(approach(&plan.candidates[0]).x > 0.5, "from the side of the base");
    let camera_up = plan.candidates[0].world_from_tool.rotation * -Vector3::x();
    assert!(camera_up.z > 0.5, "the wrist camera looks from above");
    assert!(plan.rejected[&RejectReason::PalmCollides] + plan.rejected[&RejectReason::FingersCollide] > 10);
}

#[test]
fn what_is_low_is_held_so_that_it_can_be_put_down() {
    let center = Point3::new(0.5, 0.0, 0.735);
    let target = sphere(center, 0.035, 0.002, 900, 8);
    let scene = GraspScene::from_points(&target, &board(Point3::new(0.7, 0.0, 0.7), 9), BASE).unwrap();
    let config = GraspConfig::default();
    // Nothing comes from above.
    let beneath = |pose: &Pose| ((pose.rotation * Vector3::z()).z > -0.9).then_some(1.0);
    let plan = plan_grasps(&scene, &config, &beneath);
    let best = &plan.candidates[0];
    let low_m = |grasp: &GraspCandidate| {
        (grasp.world_from_tool * Point3::new(0.03, 0.0, -0.1))
            .z
            .min((grasp.world_from_tool * Point3::new(-0.03, 0.0, -0.1)).z)
    };
    assert!(low_m(best) > 0.72, "the palm comes down before the ball: {best:?}");
    // Under a board there is no other.
    let level = |pose: &Pose| ((pose.rotation * Vector3::z()).z > -0.1).then_some(1.0);
    let plan = plan_grasps(&scene, &config, &level);
    assert!(low_m(&plan.candidates[0]) < 0.72, "over the edge there is room for the palm");
}

#[test]
fn what_does_not_fit_yields_reasons() {
    let center = Point3::new(1.0, 0.0, 0.8);
    let target = block(center, Vector3::new(0.2, 0.25, 0.2), 0.0, 0.003, 4000, 2);
    let scene = GraspScene::from_points(&target, &[], BASE).unwrap();
    let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
    assert_eq!(plan.candidates, Vec::new());
    assert!(plan.rejected[&RejectReason::TooWide] >= 4, "{:?}", plan.rejected);
    let few = GraspScene::from_points(&target[..6], &[], BASE).unwrap();
    assert_eq!(plan_grasps(&few, &GraspConfig::default(), &everywhere).rejected[&RejectReason::TooFewPoints], 1);
    assert_eq!(GraspScene::from_points(&[], &[], BASE), None);
    let apple = GraspScene::from_points(&sphere(center, 0.036, 0.003, 1500, 1), &[], BASE).unwrap();
    let plan = plan_grasps(&apple, &GraspConfig::default(), &|_| None);
    assert!(plan.candidates.is_empty() && plan.rejected[&RejectReason::Unreachable] > 10);
}

#[test]
fn poses_retreat_and_lift() {
    let center = Point3::new(1.0, 0.0, 0.8);
    let scene = GraspScene::from_points(&sphere(center, 0.036, 0.003, 1500, 1), &[], BASE).unwrap();
    let config = GraspConfig::default();
    let plan = plan_grasps(&scene, &config, &everywhere);
    for candidate in &plan.candidates {
        let back =
            candidate.world_from_tool.translation.vector - candidate.world_from_pregrasp(&config).translation.vector;
        assert!((back - approach(candidate) * 0.11).norm() < 1e-9);
        let up = candidate.world_from_lift(&config).translation.vector - candidate.world_from_tool.translation.vector;
        assert!((up - Vector3::z() * 0.14).norm() < 1e-9);
    }
    assert_eq!(plan, plan_grasps(&scene, &config, &everywhere), "the same input gives the same plan");
}

#[test]
fn a_vase_is_held_where_its_sides_do_not_lean_together() {
    // A belly with a neck: the middle of its height lies on the shoulder, from which it slips out downwards.
    let (support_z_m, belly_m, half_m, radius_m) = (0.73, 0.07, 0.063, 0.046);
    let middle = Point3::new(1.0, 0.0, support_z_m + belly_m);
    let belly: Vec<Point3<f64>> = sphere(Point3::origin(), 1.0, 0.02, 3000, 3)
        .into_iter()
        .map(|p| middle + Vector3::new(radius_m * p.x, radius_m * p.y, half_m * p.z))
        .collect();
    let neck = cylinder(Point3::new(1.0, 0.0, support_z_m + 0.165), 0.025, 0.08, 0.001, 1200, 4);
    let vase: Vec<Point3<f64>> = belly.into_iter().chain(neck).collect();
    let scene =
        GraspScene::from_points(&seen_from(&vase, &middle, Vector3::new(-1.0, 0.0, 0.5), 0.0), &[], BASE).unwrap();
    let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
    let first = &plan.candidates[0];
    let over_belly_m = first.world_from_tool.translation.z - middle.z;
    assert!(!(0.02..=0.06).contains(&over_belly_m), "held {over_belly_m:.3} m over its belly: {first:?}");
}

#[test]
fn a_thermos_is_held_at_its_middle() {
    // Straight sides hold anywhere; what hangs off its middle turns between the pads on the way.
    let middle = Point3::new(1.0, 0.0, 0.73 + 0.12);
    for seed in 0..4 {
        let thermos = cylinder(middle, 0.035, 0.24, 0.003, 4000, seed);
        let seen = seen_from(&thermos, &middle, Vector3::new(-1.0, 0.0, 0.5), 0.0);
        let scene = GraspScene::from_points(&seen, &[], BASE).unwrap();
        let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
        let off_m = plan.candidates[0].world_from_tool.translation.z - middle.z;
        assert!(off_m > -0.02, "held {off_m:.3} m off its middle: {:?}", plan.candidates[0]);
    }
}

#[test]
fn a_bottle_is_held_at_its_balance() {
    // Half of its height is neck: held at the middle of its height it turned between the pads by 60 degrees on the way.
    let support_z_m = 0.73;
    let belly = cylinder(Point3::new(1.0, 0.0, support_z_m + 0.06), 0.033, 0.12, 0.001, 2500, 5);
    let neck = cylinder(Point3::new(1.0, 0.0, support_z_m + 0.155), 0.014, 0.07, 0.001, 800, 6);
    let bottle: Vec<Point3<f64>> = belly.into_iter().chain(neck).collect();
    let scene = GraspScene::from_points(&bottle, &board(Point3::new(1.0, 0.0, support_z_m), 9), BASE).unwrap();
    assert!((scene.balance_m() - 0.066).abs() < 0.012, "{}", scene.balance_m());
    let plan = plan_grasps(&scene, &GraspConfig::default(), &everywhere);
    let held_m = plan.candidates[0].world_from_tool.translation.z - support_z_m;
    assert!(held_m < 0.085, "held {held_m:.3} m above its bottom: {:?}", plan.candidates[0]);
}
