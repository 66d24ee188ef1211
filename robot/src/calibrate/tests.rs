//! Contract: a camera that hangs 2 cm and 2 degrees off is found again from noisy depth, with deviations that tell how well;
//! what the motion or the scene leaves open is refused with its direction. The Jacobian is that of finite differences.

use super::*;
use dsm::Pose;
use dsm::camera::CameraModel;
use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A plane of the scene in the base frame: a point of it and its normal.
type Wall = (Point3<f64>, Vector3<f64>);

/// A room of 6 x 5 x 2.6 m with two slanted boards.
fn room() -> Vec<Wall> {
    let at = |x: f64, y: f64, z: f64, n: [f64; 3]| (Point3::new(x, y, z), Vector3::from(n).normalize());
    vec![
        at(2.9, 0.0, 0.0, [-1.0, 0.0, 0.0]),
        at(0.0, 2.4, 0.0, [0.0, -1.0, 0.0]),
        at(0.0, -2.4, 0.0, [0.0, 1.0, 0.0]),
        at(0.0, 0.0, 0.0, [0.0, 0.0, 1.0]),
        at(0.0, 0.0, 2.6, [0.0, 0.0, -1.0]),
        at(2.4, 1.4, 0.0, [-1.0, -0.8, 0.3]),
        at(2.2, -1.2, 0.3, [-1.0, 0.7, 0.5]),
    ]
}

/// `base_from_mount` of a pan-tilt head: the optical frame looks along z, x to the right, y down.
fn mount(pan_rad: f64, tilt_rad: f64) -> Pose {
    let pan = Pose::from_parts(
        Vector3::new(0.1, 0.0, 1.1).into(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pan_rad),
    );
    let tilt = Pose::from_parts(
        Vector3::new(0.05, 0.0, 0.08).into(),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt_rad),
    );
    let optical = Rotation3::from_basis_unchecked(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
    let optical =
        Pose::from_parts(Vector3::new(0.04, 0.02, 0.0).into(), UnitQuaternion::from_rotation_matrix(&optical));
    pan * tilt * optical
}

/// A depth image with the disparity steps and noise of the preset `noisy`.
fn depth_image(walls: &[Wall], base_from_camera: &Pose, model: &CameraModel, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let mut normal = || {
        let (a, b): (f64, f64) = (rng.random::<f64>().max(1e-12), rng.random());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    };
    let mut image = Vec::with_capacity(model.pixel_count());
    for row in 0..model.height {
        for column in 0..model.width {
            let ray = base_from_camera.rotation * model.back_project(column, row, 1.0).coords;
            let origin = base_from_camera.translation.vector;
            let hit = |(point, n): &Wall| n.dot(&(point.coords - origin)) / n.dot(&ray);
            let z = walls.iter().map(hit).filter(|z| *z > 0.05).fold(f64::INFINITY, f64::min);
            let steps = ((35.130 / z + 0.0278 * normal()) * 8.0).round();
            let measured_m = 35.130 * 8.0 / steps;
            image.push(((measured_m * 1000.0).round() / 1000.0) as f32);
        }
    }
    image
}

fn views(walls: &[Wall], gazes: &[(f64, f64)], mount_from_camera: &Pose, seed: u64) -> Vec<View> {
    let model = CameraModel::from_vertical_fov(640, 480, 1.0);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let view = |&(pan_rad, tilt_rad): &(f64, f64)| {
        let base_from_mount = mount(pan_rad, tilt_rad);
        let image = depth_image(walls, &(base_from_mount * mount_from_camera), &model, &mut rng);
        View::new(base_from_mount, model, &image)
    };
    gazes.iter().map(view).collect()
}

/// A grid of gazes.
fn grid() -> Vec<(f64, f64)> {
    [-0.5, -0.17, 0.17, 0.5].iter().flat_map(|pan| [-0.15, 0.2, 0.5].map(|tilt| (*pan, tilt))).collect()
}

/// 2 cm and 2 degrees in a direction that the seed draws.
fn wrong(seed: u64) -> Pose {
    let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
    let mut direction = || Vector3::from_fn(|_, _| rng.random::<f64>() - 0.5).normalize();
    let shift = 0.02 * direction();
    let turn = 2.0_f64.to_radians() * direction();
    Pose::from_parts(shift.into(), UnitQuaternion::from_scaled_axis(turn))
}

#[test]
fn a_wrong_mounting_is_found_from_noisy_depth() {
    for seed in 0..4 {
        let truth = wrong(seed);
        let seen = views(&room(), &grid(), &truth, seed);
        let outcome = calibrate(&seen, &Pose::identity(), &CalibrateConfig::default());
        let CalibrationOutcome::Estimated(found) = outcome else { panic!("seed {seed}: {outcome:?}") };
        let shift_m = (found.mount_from_camera.translation.vector - truth.translation.vector).norm();
        let turn_deg = found.mount_from_camera.rotation.angle_to(&truth.rotation).to_degrees();
        assert!(shift_m < 0.004 && turn_deg < 0.25, "seed {seed}: off by {shift_m} m, {turn_deg} deg: {found:?}");
        assert!(found.residual_m[1] < found.residual_m[0]);
        assert!(found.sigma.iter().all(|sigma| (1e-6..0.01).contains(sigma)), "{:?}", found.sigma);
    }
}

#[test]
fn a_motion_about_one_axis_is_refused_with_the_open_direction() {
    let pans: Vec<(f64, f64)> = (0..9).map(|i| (0.12 * f64::from(i) - 0.48, 0.2)).collect();
    let seen = views(&room(), &pans, &wrong(1), 7);
    let outcome = calibrate(&seen, &Pose::identity(), &CalibrateConfig::default());
    let CalibrationOutcome::Undetermined { direction, information, required } = outcome else { panic!("{outcome:?}") };
    assert!(information < 0.5 * required, "{information}");
    // A shift along the axis of the pan, or a turn about it: up, seen from the tilted camera.
    let up = (mount(0.0, 0.2) * wrong(1)).rotation.inverse() * Vector3::z();
    let shift = Vector3::new(direction[0], direction[1], direction[2]);
    let turn = Vector3::new(direction[3], direction[4], direction[5]);
    let off_axis = (shift - up * up.dot(&shift)).norm() + (turn - up * up.dot(&turn)).norm();
    assert!(off_axis < 0.3, "{direction:?}");
}

#[test]
fn too_little_is_refused() {
    let seen = views(&room(), &grid()[..5], &Pose::identity(), 1);
    let config = CalibrateConfig::default();
    assert_eq!(calibrate(&seen, &Pose::identity(), &config), CalibrationOutcome::TooFewViews { views: 5, required: 6 });
    // A wall so far away that its depth is all steps.
    let wall = [(Point3::new(9.0, 0.0, 0.0), -Vector3::x())];
    let outcome = calibrate(&views(&wall, &grid(), &Pose::identity(), 1), &Pose::identity(), &config);
    assert_eq!(outcome, CalibrationOutcome::TooFewMatches { matches: 0, required: 1200 });
}

#[test]
fn patches_lie_on_their_planes() {
    let model = CameraModel::from_vertical_fov(640, 480, 1.0);
    let camera = mount(0.1, 0.3);
    let image = depth_image(&room(), &camera, &model, &mut ChaCha8Rng::seed_from_u64(3));
    let patches = find_patches(&model, &image);
    assert!(patches.len() > 600, "{}", patches.len());
    let walls = room();
    let near = |patch: &&Patch| {
        let (center, normal) = (camera * patch.center, camera.rotation * patch.normal);
        walls.iter().any(|(point, n)| n.dot(&(center - point)).abs() < 0.02 && n.dot(&normal) > 0.99)
    };
    let right = patches.iter().filter(near).count();
    // Some span a corner of two walls.
    assert!(100 * right > 90 * patches.len(), "{right} of {}", patches.len());
}
