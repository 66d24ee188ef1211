//! Contract: a part on a joint is seen, and counts, as a part of what carries it unless the scene lists it; the truth knows
//! it by itself; it goes where its carrier goes.

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::eval::Truth;
use dsm_robot::model::RobotModel;
use dsm_sim::camera::{CameraRig, LightDraw, label_of_body};
use dsm_sim::scene::{HomeConfig, SceneModel, Semantics, generate_home, scene_file};
use dsm_sim::world::{OpenPart, World, WorldConfig, WorldError};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const SCENE: &str = r#"<mujoco><compiler angle="radian"/><worldbody><geom type="plane" size="0 0 1"/>
  <body name="cabinet" pos="2 0 .4"><geom type="box" size=".3 .3 .4"/>
    <body name="cabinet_drawer" pos="-.311 0 0"><joint name="runner" type="slide" axis="-1 0 0" range="0 .3" frictionloss="5"/>
      <geom type="box" size=".01 .29 .1" mass="2"/><geom type="box" size=".01 .06 .01" pos="-.05 0 0" mass=".1"/></body>
    <body name="cabinet_lid" pos="0 .3 .41"><joint name="lid" axis="1 0 0" range="-1.5 0" frictionloss="1"/>
      <geom type="box" size=".2 .2 .005" pos="0 -.2 0" mass=".5"/></body></body>
  <body name="mug" pos="0 3 .05"><freejoint/><geom type="cylinder" size=".04 .05" mass=".3"/></body>
</worldbody></mujoco>"#;

const CABINET: &str = "version = 1\nname = \"t\"\n[start]\nareas = [{ x_m = 0, y_m = 0 }]\n[[object]]\nbody = \"mug\"\ncategory = \"mug\"\n\
     [[object]]\nbody = \"cabinet\"\ncategory = \"cabinet\"\nplacement = { x_m = 0.2, y_m = 0.2, yaw_rad = 0.3 }\n";
const DRAWER: &str = "[[object]]\nbody = \"cabinet_drawer\"\ncategory = \"drawer\"\n";

fn write(semantics: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.xml"), SCENE).expect("written");
    std::fs::write(folder.path().join("semantics.toml"), semantics).expect("written");
    folder
}

fn first_truth(folder: &Path, seed: u64) -> Truth {
    let robot = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter");
    let robot = Arc::new(RobotModel::load(&robot).expect("the robot loads"));
    let world = World::load(folder, robot, WorldConfig { seed, ..WorldConfig::default() }).expect("a valid world");
    world.into_parts().truth.recv().expect("a sample")
}

#[test]
fn a_drawer_is_seen_as_its_cabinet_unless_it_is_listed() {
    for (semantics, expected) in [(CABINET.to_owned(), "cabinet"), (format!("{CABINET}{DRAWER}"), "cabinet_drawer")] {
        let folder = write(&semantics);
        let scene = SceneModel::load(folder.path()).expect("valid");
        let semantics = Semantics::load(&scene_file(folder.path()), &scene).expect("valid");
        let wholes = semantics.find_wholes(&scene);
        let mut rig = CameraRig::new(&scene, &[], &LightDraw::unchanged()).expect("drawn").showing(&scene, &wholes);
        let poses: Vec<Pose> = scene.bodies.iter().map(|body| body.world_from_body).collect();
        let camera = CameraModel::from_vertical_fov(64, 48, 0.3);
        // From the origin along x at the height of the drawer: all that shows is its front.
        let look = UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2);
        let eye = Pose::from_parts(Translation3::new(0.0, 0.0, 0.4), look);
        let image = rig.render(&poses, &[], &camera, &eye);
        let body = scene.bodies.iter().position(|body| body.name == expected).expect("there");
        assert_eq!(image.labels[24 * 64 + 32], label_of_body(body), "{expected}");
    }
}

#[test]
fn the_truth_knows_parts_by_themselves_and_their_joints() {
    let folder = write(CABINET);
    let truth = first_truth(folder.path(), 3);
    let names: Vec<&str> = truth.objects.iter().map(|object| object.body.as_str()).collect();
    assert_eq!(names, ["cabinet", "mug"]);
    let [drawer, lid] = &truth.parts[..] else { panic!("{:?}", truth.parts) };
    assert_eq!(
        (drawer.object.category.as_str(), drawer.part_of.as_str(), drawer.joint.as_str()),
        ("drawer", "cabinet", "runner")
    );
    assert_eq!((lid.object.category.as_str(), lid.slides, drawer.slides), ("lid", false, true));
    assert_eq!((drawer.range, drawer.velocity), (Some([0.0, 0.3]), 0.0));
    assert!(
        drawer.position.abs() < 1e-9 && lid.position.abs() < 1e-9,
        "closed: {} and {}",
        drawer.position,
        lid.position
    );
    assert!(!drawer.object.free && (drawer.object.bounds.size.y - 0.58).abs() < 1e-9);
    // The cabinet reaches from its back to the handle of its drawer.
    assert!((truth.objects[0].bounds.size.x - (0.6 + 0.071)).abs() < 1e-9, "{}", truth.objects[0].bounds.size);
    // A scene that lists the drawer has it among the objects, and the cabinet ends at its own front.
    let truth = first_truth(write(&format!("{CABINET}{DRAWER}")).path(), 3);
    assert_eq!(truth.objects.len(), 3);
    assert!((truth.objects[0].bounds.size.x - 0.6).abs() < 1e-9, "{}", truth.objects[0].bounds.size);
}

#[test]
fn a_cabinet_that_the_seed_moves_takes_its_drawer_along() {
    let folder = write(CABINET);
    let mut yaws = Vec::new();
    for seed in 0..4 {
        let truth = first_truth(folder.path(), seed);
        let cabinet = truth.objects[0].world_from_body;
        let within = cabinet.inv_mul(&truth.parts[0].object.world_from_body);
        assert!((within.translation.vector - Vector3::new(-0.311, 0.0, 0.0)).norm() < 1e-9, "{within}");
        assert!(within.rotation.angle() < 1e-9, "{within}");
        yaws.push(cabinet.rotation.euler_angles().2);
    }
    assert!(yaws.iter().any(|yaw| (yaw - yaws[0]).abs() > 0.01), "it is moved: {yaws:?}");
}

#[test]
fn a_home_with_closed_doors_looks_as_if_they_were_held() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let home = generate_home(&HomeConfig { seed: 3, rooms: 4, objects: 60, ..HomeConfig::default() }).expect("room");
    for (name, bytes) in &home.files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("in the folder")).expect("a folder");
        std::fs::write(path, bytes).expect("written");
    }
    let scene = SceneModel::load(folder.path()).expect("valid");
    let held = scene.with_joints_held();
    assert!(scene.joints.len() > 5 && held.joints.is_empty());
    let semantics = Semantics::load(&scene_file(folder.path()), &scene).expect("valid");
    let wholes = semantics.find_wholes(&scene);
    assert!(wholes.iter().all(|whole| *whole < held.bodies.len()));
    let mut live_rig = CameraRig::new(&scene, &[], &LightDraw::unchanged()).expect("drawn").showing(&scene, &wholes);
    let mut held_rig = CameraRig::new(&held, &[], &LightDraw::unchanged()).expect("drawn");
    let poses = |scene: &SceneModel| scene.bodies.iter().map(|body| body.world_from_body).collect::<Vec<Pose>>();
    let (live_poses, held_poses) = (poses(&scene), poses(&held));
    let camera = CameraModel::from_vertical_fov(160, 120, 1.0);
    let carriers: Vec<u32> = scene.joints.iter().map(|joint| label_of_body(joint.carrier)).collect();
    let mut parts = 0;
    for area in &semantics.start.areas {
        for turn in 0..4 {
            let yaw = f64::from(turn) * FRAC_PI_2;
            let look = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw)
                * UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2);
            let eye = Pose::from_parts(Translation3::new(area.x_m, area.y_m, 0.9), look);
            let live = live_rig.render(&live_poses, &[], &camera, &eye);
            let held = held_rig.render(&held_poses, &[], &camera, &eye);
            assert_eq!(live.labels, held.labels);
            assert_eq!(live.color, held.color);
            let apart = live.depth_m.iter().zip(&held.depth_m).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(apart < 1e-5, "{apart} m");
            parts += usize::from(live.labels.iter().any(|label| carriers.contains(label)));
        }
    }
    assert!(parts > 0, "furniture with doors is in view");
}

#[test]
fn a_drawer_that_stands_open_at_the_start_holds_what_lies_in_it() {
    // A tray that a runner carries, with a block on it.
    let scene = r#"<mujoco><compiler angle="radian"/><worldbody><geom type="plane" size="0 0 1"/>
  <body name="cabinet" pos="2 0 .2"><geom type="box" size=".3 .3 .1"/>
    <body name="tray" pos="0 0 .11"><joint name="runner" type="slide" axis="-1 0 0" range="0 .4" frictionloss="5"/>
      <geom type="box" size=".28 .28 .005" mass="2"/><geom type="box" size=".005 .28 .1" pos="-.28 0 .1" mass=".3"/></body></body>
  <body name="block" pos="2 .1 .346"><freejoint/><geom type="box" size=".03 .03 .03" mass=".1"/></body>
</worldbody></mujoco>"#;
    let semantics = "version = 1\nname = \"t\"\n[start]\nareas = [{ x_m = 0, y_m = 0 }]\n[[object]]\nbody = \"block\"\n\
         category = \"block\"\n[[object]]\nbody = \"cabinet\"\ncategory = \"cabinet\"\n";
    let folder = write(semantics);
    std::fs::write(folder.path().join("scene.xml"), scene).expect("written");
    let robot = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter");
    let robot = Arc::new(RobotModel::load(&robot).expect("the robot loads"));
    let load = |part: &str, share: f64| {
        let open = vec![OpenPart { part: part.into(), share }];
        World::load(folder.path(), robot.clone(), WorldConfig { open, ..WorldConfig::default() })
    };
    let first = |share: f64| load("tray", share).expect("valid").into_parts().truth.recv().expect("a sample");
    let (closed, open) = (first(0.05), first(0.5));
    assert!((open.parts[0].position - 0.2).abs() < 1e-9, "{}", open.parts[0].position);
    let block = |truth: &Truth| {
        let found = truth.objects.iter().find(|object| object.body == "block");
        found.expect("a block").world_from_body.translation.vector
    };
    let by = block(&open) - block(&closed);
    assert!((by - Vector3::new(-0.18, 0.0, 0.0)).norm() < 1e-6, "{by}");
    let Err(WorldError::NoPart { part, known }) = load("lid", 0.5) else { panic!("there is no lid") };
    assert_eq!((part.as_str(), known), ("lid", vec!["tray".to_owned()]));
    assert!(OpenPart { part: "tray".into(), share: 1.5 }.find_flaw().is_some());
}
