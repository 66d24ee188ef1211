//! Contract: a camera sees the bodies where they are, under their labels; the sensor model spoils the image as a cheap
//! depth camera would, by its key alone.

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm_robot::model::shapes::Geometry;
use dsm_sim::camera::{
    CameraError, CameraRig, LightDraw, NoiseKey, NoiseParameters, ROBOT_LABEL, RobotVisual, SensorModel, TrueImage,
    label_of_body,
};
use dsm_sim::scene::{BodyMotion, SceneBody, SceneGeom, SceneMaterial, SceneModel, SceneShape, TextureSpan};
use nalgebra::{Point3, Vector3};

fn body(name: &str, shape: SceneShape, place: [f64; 3], material: usize) -> SceneBody {
    let geom = SceneGeom {
        name: None,
        body_from_geom: Pose::identity(),
        shape,
        material,
        friction: 0.5,
        collides: true,
        kinds: 1,
        touches: 1,
        visible: true,
    };
    let world_from_body = Pose::translation(place[0], place[1], place[2]);
    SceneBody {
        name: name.to_owned(),
        world_from_body,
        motion: BodyMotion::Fixed,
        mass_kg: 0.0,
        spread: None,
        geoms: vec![geom],
    }
}

fn material(name: &str, rgba: [f32; 4]) -> SceneMaterial {
    SceneMaterial {
        name: name.to_owned(),
        rgba,
        texture: None,
        texture_repeat: [1.0; 2],
        texture_span: TextureSpan::Face,
        specular: 0.0,
        shininess: 0.5,
        metallic: 0.0,
        emission: 0.0,
    }
}

/// A wall 3 m ahead (world x), a red ball before it and the floor.
fn model() -> SceneModel {
    SceneModel {
        name: "test".to_owned(),
        bodies: vec![
            body("world", SceneShape::Plane { half_m: [0.0; 2] }, [0.0; 3], 0),
            body("wall", SceneShape::Box { half_m: Vector3::new(0.1, 4.0, 4.0) }, [3.1, 0.0, 0.0], 0),
            body("ball", SceneShape::Sphere { radius_m: 0.2 }, [1.5, 0.0, 1.0], 1),
        ],
        materials: vec![material("grey", [0.6, 0.6, 0.6, 1.0]), material("red", [0.9, 0.1, 0.1, 1.0])],
        textures: vec![],
        meshes: vec![],
        lights: vec![],
        ..SceneModel::default()
    }
}

fn poses(model: &SceneModel) -> Vec<Pose> {
    model.bodies.iter().map(|body| body.world_from_body).collect()
}

fn camera() -> CameraModel {
    CameraModel::from_vertical_fov(320, 240, 1.0)
}

/// One metre above the origin, looking along world x.
fn pose() -> Pose {
    dsm::raster::look_at(&Point3::new(0.0, 0.0, 1.0), &Point3::new(1.0, 0.0, 1.0))
}

fn true_image() -> TrueImage {
    let model = model();
    let mut rig = CameraRig::new(&model, &[], &LightDraw::unchanged()).expect("sound scene");
    rig.render(&poses(&model), &[], &camera(), &pose())
}

const CENTRE: usize = 120 * 320 + 160;

#[test]
fn bodies_are_seen_where_they_are_and_move_with_their_poses() {
    let model = model();
    let mut rig = CameraRig::new(&model, &[], &LightDraw::unchanged()).expect("sound scene");
    let mut places = poses(&model);
    let before = rig.render(&places, &[], &camera(), &pose());
    assert_eq!(before.labels[CENTRE], label_of_body(2));
    assert!((before.depth_m[CENTRE] - 1.3).abs() < 0.005, "{}", before.depth_m[CENTRE]);
    let [red, green, blue] = before.color[CENTRE].map(u32::from);
    assert!(red > 2 * green && red > 2 * blue, "{:?}", before.color[CENTRE]);
    assert_eq!(before.labels[CENTRE + 110 * 320], label_of_body(0));
    places[2] = Pose::translation(1.5, 1.0, 1.0);
    let after = rig.render(&places, &[], &camera(), &pose());
    assert_eq!(after.labels[CENTRE], label_of_body(1));
    assert!((after.depth_m[CENTRE] - 3.0).abs() < 1e-4);
    // World y is to the left.
    let column = 160 - (1.0 / 1.5 * camera().fx) as usize;
    assert_eq!(after.labels[120 * 320 + column], label_of_body(2));
    assert!(rig.render(&poses(&model), &[], &camera(), &pose()) == before, "looking changed something");
}

#[test]
fn all_links_of_the_robot_share_one_label_and_links_without_a_pose_are_not_drawn() {
    let visual = |link| RobotVisual {
        link,
        link_from_shape: Pose::translation(0.0, 0.3, 0.0),
        geometry: Geometry::Box { size_m: Vector3::repeat(0.2) },
        rgba: [0.1, 0.1, 0.9, 1.0],
    };
    let mut rig = CameraRig::new(&model(), &[visual(0), visual(1)], &LightDraw::unchanged()).expect("sound scene");
    let links = [Pose::translation(1.0, 0.1, 1.0), Pose::translation(1.0, -0.7, 1.0)];
    let area = |rig: &mut CameraRig, links: &[Pose]| {
        let image = rig.render(&poses(&model()), links, &camera(), &pose());
        image.labels.iter().filter(|&&label| label == ROBOT_LABEL).count()
    };
    let one = area(&mut rig, &links[..1]);
    assert!(one > 500);
    assert!(area(&mut rig, &links).abs_diff(2 * one) < 20);
    assert_eq!(area(&mut rig, &[]), 0);
}

#[test]
fn invisible_things_are_not_drawn_and_broken_references_are_named() {
    let mut unseen = model();
    unseen.bodies[2].geoms[0].visible = false;
    unseen.materials[0].rgba[3] = 0.0;
    let mut rig = CameraRig::new(&unseen, &[], &LightDraw::unchanged()).expect("sound scene");
    assert!(rig.render(&poses(&unseen), &[], &camera(), &pose()).labels.iter().all(|&label| label == 0));
    let mut broken = model();
    broken.bodies[1].geoms[0].material = 7;
    let error = CameraRig::new(&broken, &[], &LightDraw::unchanged()).expect_err("there are two materials");
    let expected = CameraError::Missing { owner: "wall".to_owned(), kind: "material", index: 7, count: 2 };
    assert_eq!(error, expected);
    assert_eq!(error.to_string(), "wall refers to material 7, but there are 2");
}

#[test]
fn the_seed_draws_the_light() {
    let image = |light: LightDraw| {
        let model = model();
        let mut rig = CameraRig::new(&model, &[], &light).expect("sound scene");
        rig.render(&poses(&model), &[], &camera(), &pose())
    };
    let (first, again, other) = (image(LightDraw::new(1)), image(LightDraw::new(1)), image(LightDraw::new(2)));
    assert!(first == again);
    assert_ne!(first.color, other.color);
    assert_eq!((first.depth_m, first.labels), (other.depth_m, other.labels));
}

const KEY: NoiseKey = NoiseKey { seed: 3, stream: 1, frame: 9 };

fn noisy() -> SensorModel {
    SensorModel::noisy(NoiseParameters::default()).expect("the defaults lie in their ranges")
}

#[test]
fn the_oracle_rounds_depth_to_millimetres_and_changes_nothing_else() {
    let image = true_image();
    let sensed = SensorModel::oracle().sense(&image, &camera(), KEY);
    assert_eq!(sensed.color, image.color);
    // A camera hands depth out in 16 bits of whole millimetres.
    for (sensed, depth) in sensed.depth_m.iter().zip(&image.depth_m) {
        assert!((sensed - depth).abs() <= 0.000_501, "{sensed} {depth}");
        assert!((1000.0 * sensed - (1000.0 * sensed).round()).abs() < 0.01, "{sensed}");
    }
}

#[test]
fn depth_is_quantised_in_eighths_of_a_disparity_and_spreads_as_the_model_says() {
    let image = true_image();
    let sensed = noisy().sense(&image, &camera(), KEY);
    // The wall is a plane across the view at 3 m: leave out what lies near the borders of the ball.
    let wall: Vec<f32> = (image.labels.iter().zip(&sensed.depth_m))
        .filter(|(label, depth)| **label == label_of_body(1) && **depth > 2.5)
        .map(|(_, depth)| *depth)
        .collect();
    assert!(wall.len() > 20_000);
    let disparities: Vec<f32> = wall.iter().map(|depth| 8.0 * 35.130 / depth).collect();
    // Depth in whole millimetres: half of one is 0.016 steps at 3 m.
    assert!(disparities.iter().all(|d| (d - d.round()).abs() < 0.02));
    // 8 * 35.130 / 3 = 93.68: with a deviation of 8 * 0.0278 = 0.222 steps, 79 % fall on 94 and 21 % on 93.
    let share = disparities.iter().filter(|d| d.round() == 94.0).count() as f64 / disparities.len() as f64;
    assert!((share - 0.79).abs() < 0.02, "{share}");
    let mean = wall.iter().map(|d| f64::from(*d)).sum::<f64>() / wall.len() as f64;
    assert!((mean - 3.0).abs() < 0.01, "{mean}");
}

#[test]
fn edges_grazing_surfaces_and_what_is_out_of_range_return_nothing() {
    let image = true_image();
    let sensed = noisy().sense(&image, &camera(), KEY);
    let mut edges = 0;
    for pixel in 0..image.labels.len() - 1 {
        // Sideways borders of the ball: 1.5 m from the wall.
        if pixel % 320 < 319 && (image.depth_m[pixel] - image.depth_m[pixel + 1]).abs() > 0.5 {
            edges += 1;
            assert_eq!((sensed.depth_m[pixel], sensed.depth_m[pixel + 1]), (0.0, 0.0));
        }
    }
    assert!(edges > 50, "{edges}");
    let returned = sensed.depth_m.iter().filter(|depth| **depth > 0.0).count();
    assert!(returned as f64 > 0.9 * image.labels.len() as f64, "{returned}");

    // An endless floor seen from 1 m: at more than 80 degrees from the vertical, 5.67 m of distance, nothing returns.
    let mut model = model();
    model.bodies.truncate(1);
    let mut rig = CameraRig::new(&model, &[], &LightDraw::unchanged()).expect("sound scene");
    let image = rig.render(&poses(&model), &[], &camera(), &pose());
    let sensed = noisy().sense(&image, &camera(), KEY);
    let limit = 1.4_f64.tan();
    let (mut near, mut far) = (0, 0);
    for (pixel, (&depth, &measured)) in image.depth_m.iter().zip(&sensed.depth_m).enumerate() {
        if depth > 0.0 {
            let foot = pose() * camera().back_project(pixel as u32 % 320, pixel as u32 / 320, f64::from(depth));
            let distance = foot.x.hypot(foot.y);
            if distance < 0.97 * limit {
                near += 1;
                assert!(measured > 0.0, "no return from {distance}");
            } else if distance > 1.03 * limit {
                far += 1;
                assert_eq!(measured, 0.0, "return from {distance}");
            }
        }
    }
    assert!(near > 1000 && far > 1000, "{near}, {far}");

    // A wall beyond 10 m and one closer than 0.2 m.
    for (x, expected) in [(10.3, false), (9.7, true), (0.28, false), (0.32, true)] {
        let mut model = walled_model(x);
        model.bodies.remove(0);
        let mut rig = CameraRig::new(&model, &[], &LightDraw::unchanged()).expect("sound scene");
        let image = rig.render(&poses(&model), &[], &camera(), &pose());
        let sensed = noisy().sense(&image, &camera(), KEY);
        assert!(image.depth_m[CENTRE] > 0.0);
        assert_eq!(sensed.depth_m[CENTRE] > 0.0, expected, "wall at {x}");
    }
}

/// The floor and a wall whose face lies 0.1 m before `x_m`.
fn walled_model(x_m: f64) -> SceneModel {
    let mut model = model();
    model.bodies.pop();
    model.bodies[1].world_from_body = Pose::translation(x_m, 0.0, 0.0);
    model
}

#[test]
fn noise_is_a_function_of_its_key_and_not_of_threads() {
    let image = true_image();
    let sensor = noisy();
    let sensed: Vec<_> = [1, 3]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can start");
            pool.install(|| sensor.sense(&image, &camera(), KEY))
        })
        .collect();
    assert!(sensed[0] == sensed[1]);
    for key in [NoiseKey { seed: 4, ..KEY }, NoiseKey { stream: 2, ..KEY }, NoiseKey { frame: 10, ..KEY }] {
        let other = sensor.sense(&image, &camera(), key);
        assert_ne!(other.depth_m, sensed[0].depth_m);
        assert_ne!(other.color, sensed[0].color);
    }
}

#[test]
fn colour_noise_has_the_deviation_asked_for_and_exposure_varies() {
    let grey = TrueImage {
        width: 320,
        height: 240,
        color: vec![[120; 3]; 320 * 240],
        depth_m: vec![0.0; 320 * 240],
        labels: vec![0; 320 * 240],
    };
    let sensor = noisy();
    let mut means = Vec::new();
    for frame in 0..30 {
        let sensed = sensor.sense(&grey, &camera(), NoiseKey { frame, ..KEY });
        assert!(sensed.depth_m.iter().all(|depth| *depth == 0.0));
        let count = sensed.color.len() as f64;
        let mean = sensed.color.iter().map(|c| f64::from(c[1])).sum::<f64>() / count;
        let variance = sensed.color.iter().map(|c| (f64::from(c[1]) - mean).powi(2)).sum::<f64>() / count;
        // 1.5 + 2 sqrt(120 / 255) = 2.87, and rounding adds 1/12 to the variance.
        assert!((variance.sqrt() - 2.886).abs() < 0.05, "{}", variance.sqrt());
        means.push(mean);
    }
    let (low, high) = means.iter().fold((f64::MAX, f64::MIN), |(l, h), m| (l.min(*m), h.max(*m)));
    assert!(low > 110.0 && high < 130.0 && high - low > 4.0, "{low} to {high}");
}

#[test]
fn parameters_out_of_range_are_refused() {
    let error = SensorModel::noisy(NoiseParameters { disparity_sigma: -1.0, ..NoiseParameters::default() });
    let message = error.expect_err("a deviation cannot be negative").to_string();
    assert_eq!(message, "disparity_sigma = -1 is out of range: 0 to 1");
    assert!(SensorModel::noisy(NoiseParameters { grazing_limit_rad: f32::NAN, ..NoiseParameters::default() }).is_err());
}
