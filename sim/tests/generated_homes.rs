//! Contract of the generator: the same seed gives the same bytes; every home loads, is sound (nothing overlaps, falls or
//! cannot be reached), holds what was asked for, and gives a robot room to start.

use dsm_robot::model::RobotModel;
use dsm_sim::scene::{
    BodyMotion, Doorways, Furniture, GenerateError, GeneratedScene, HomeConfig, ImportError, JointMotion, RobotSize,
    SceneModel, SceneShape, Semantics, check_scene, generate_home, import_ithor, scene_file,
};
use dsm_sim::world::{World, WorldConfig};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn home(seed: u64) -> GeneratedScene {
    generate_home(&HomeConfig { seed, rooms: 5, objects: 90, ..HomeConfig::default() }).expect("there is room")
}

fn write(scene: &GeneratedScene, folder: &Path) {
    for (name, bytes) in &scene.files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("in the folder")).expect("a folder");
        std::fs::write(path, bytes).expect("written");
    }
}

fn load(folder: &Path) -> (SceneModel, Semantics) {
    let model = SceneModel::load(folder).expect("loads");
    let semantics = Semantics::load(&scene_file(folder), &model).expect("fits");
    (model, semantics)
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
    assert_eq!(home(3), home(3));
    assert_ne!(home(3).files, home(4).files);
}

#[test]
fn twenty_homes_are_sound() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for seed in 0..20 {
        let scene = home(seed);
        assert_eq!((scene.rooms, scene.objects), (5, 90), "seed {seed}");
        assert!(scene.categories >= 25, "seed {seed}: {} categories", scene.categories);
        let path = folder.path().join(&scene.name);
        write(&scene, &path);
        let checked = check_scene(&path, RobotSize::default()).expect("loads");
        assert!(checked.findings.is_empty(), "seed {seed}: {:#?}", checked.findings);
        assert!(checked.free_bodies >= 20, "seed {seed}: {} free bodies", checked.free_bodies);
        assert!(checked.held_joints().next().is_none(), "seed {seed}: all doors and drawers move");
        assert!(checked.jointed_bodies >= 5, "seed {seed}: {} doors and drawers", checked.jointed_bodies);
    }
}

#[test]
fn articulated_homes_are_the_same_homes_with_furniture_that_opens() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (mut drawers, mut hidden) = (0, 0);
    for seed in 0..8 {
        let plain = home(seed);
        let furniture = Furniture::Articulated;
        let config = HomeConfig { seed, rooms: 5, objects: 90, furniture, ..HomeConfig::default() };
        let scene = generate_home(&config).expect("there is room");
        assert_eq!(scene, generate_home(&config).expect("there is room"), "same bytes");
        let paths = [(&plain, "plain"), (&scene, "open")].map(|(scene, name)| {
            let path = folder.path().join(format!("{name}_{seed}"));
            write(scene, &path);
            path
        });
        let [(before, _), (model, semantics)] = [load(&paths[0]), load(&paths[1])];
        for body in &before.bodies {
            let same = model.bodies.iter().find(|other| other.name == body.name).expect("it is still there");
            assert_eq!((same.world_from_body, same.motion), (body.world_from_body, body.motion), "{}", body.name);
        }
        let checked = check_scene(&paths[1], RobotSize::default()).expect("loads");
        assert!(checked.findings.is_empty(), "seed {seed}: {:#?}", checked.findings);
        for joint in &model.joints {
            let (part, slides) = (&model.bodies[joint.part], joint.motion == JointMotion::Slide);
            // The handle is a bar that the hand closes around, with room behind it, and the drawer or door follows it.
            let [front, .., bar, _, _] = &part.geoms[..] else { panic!("{}: {} geoms", part.name, part.geoms.len()) };
            let (SceneShape::Box { half_m: front_half }, SceneShape::Box { half_m: bar_half }) =
                (&front.shape, &bar.shape)
            else {
                panic!("{}: boxes", part.name)
            };
            let (length, thick) = (2.0 * bar_half.max(), 2.0 * bar_half.min());
            assert!((0.1..=0.165).contains(&length) && (0.012..=0.018).contains(&thick), "{length} by {thick} m");
            let gap = front.body_from_geom.translation.y - front_half.y - bar.body_from_geom.translation.y - bar_half.y;
            assert!((0.0299..=0.0401).contains(&gap), "{}: {gap} m behind the bar", part.name);
            let arm_m = if slides { 1.0 } else { bar.body_from_geom.translation.x.abs() };
            let force_n = (joint.friction + joint.damping * 0.2 / arm_m) / arm_m;
            assert!((5.0..=20.0).contains(&force_n), "{}: {force_n} N at the handle", part.name);
            assert!((0.3..=20.0).contains(&part.mass_kg), "{} weighs {} kg", part.name, part.mass_kg);
            let [low, high] = joint.range.expect("it ends");
            assert!(low.min(high.abs()).abs() < 1e-9 || high.abs() < 1e-9, "closed at one end: {low} to {high}");
            assert!(if slides { (0.2..=0.5).contains(&high) } else { high - low > 1.5 }, "{low} to {high}");
            drawers += usize::from(slides);
        }
        hidden += model.bodies.len() - before.bodies.len();
        assert!(semantics.objects.iter().all(|object| !object.body.contains("_drawer_")), "parts are not listed");
    }
    assert!(hidden >= drawers / 3 && hidden <= 2 * drawers, "{hidden} things in {drawers} drawers");
}

#[test]
fn doors_hang_where_they_swing_free_and_change_nothing_else() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut doors = 0;
    for seed in 0..6 {
        let plain = home(seed);
        let config = HomeConfig { seed, rooms: 5, objects: 90, doorways: Doorways::Doors, ..HomeConfig::default() };
        let scene = generate_home(&config).expect("there is room");
        assert_eq!(scene, generate_home(&config).expect("there is room"), "same bytes");
        let paths = [(&plain, "plain"), (&scene, "doors")].map(|(scene, name)| {
            let path = folder.path().join(format!("{name}_{seed}"));
            write(scene, &path);
            path
        });
        // What is not of a door is written as before.
        let texts = paths.clone().map(|path| std::fs::read_to_string(path.join("scene.xml")).expect("written"));
        let bodies = |text: &str| text[text.find("<worldbody>").expect("there")..].to_owned();
        let before = bodies(&texts[0]);
        assert!(
            bodies(&texts[1])
                .starts_with(before.trim_end_matches("</mujoco>\n").trim_end().trim_end_matches("</worldbody>"))
        );
        let [_, (model, semantics)] = [load(&paths[0]), load(&paths[1])];
        let checked = check_scene(&paths[1], RobotSize::default()).expect("loads");
        assert!(checked.findings.is_empty(), "seed {seed}: {:#?}", checked.findings);
        let leaves = semantics.find_leaves(&model);
        doors += leaves.len();
        for leaf in leaves {
            let (body, joint) = (&model.bodies[leaf], model.find_joint(leaf).expect("it hangs on hinges"));
            let [board, bar, ..] = &body.geoms[..] else { panic!("{}: {} geoms", body.name, body.geoms.len()) };
            let (SceneShape::Box { half_m: board_m }, SceneShape::Box { half_m: bar_m }) = (&board.shape, &bar.shape)
            else {
                panic!("{}: boxes", body.name)
            };
            assert!((0.76..=0.9).contains(&(2.0 * board_m.x)) && (2.0 * board_m.y - 0.04).abs() < 1e-6, "{board_m}");
            assert!((0.012..=0.018).contains(&(2.0 * bar_m.min())), "{bar_m}");
            let radius_m = bar.body_from_geom.translation.x.abs();
            let force_n = (joint.friction + joint.damping * 0.2 / radius_m) / radius_m;
            assert!((5.0..=20.0).contains(&force_n), "{}: {force_n} N at the handle", body.name);
            assert!((10.0..=25.0).contains(&body.mass_kg), "{} weighs {} kg", body.name, body.mass_kg);
            let [low, high] = joint.range.expect("it ends");
            assert!((high - low - 1.5).abs() < 1e-6 && low.min(0.0) * high.max(0.0) == 0.0, "{low} to {high}");
            sweeps_free(&model, leaf, low + high);
        }
    }
    assert!(doors >= 12, "{doors} doors in six homes");
}

/// Holds that no other body stands in the quarter disc that a leaf sweeps, up to its end at `open_rad`.
fn sweeps_free(model: &SceneModel, leaf: usize, open_rad: f64) {
    let joint = model.find_joint(leaf).expect("it hangs on hinges");
    let [board, ..] = &model.bodies[leaf].geoms[..] else { panic!("a board") };
    let SceneShape::Box { half_m: board_m } = &board.shape else { panic!("a box") };
    for step in 1..=10 {
        let from_part = joint.carrier_from_part(open_rad * f64::from(step) / 10.0);
        let world_from_board = model.bodies[joint.carrier].world_from_body * from_part * board.body_from_geom;
        for other in model.bodies.iter().enumerate().filter(|(index, _)| *index > 0 && *index != leaf) {
            for geom in other.1.geoms.iter().filter(|geom| geom.collides) {
                let at = nalgebra::Point3::from((other.1.world_from_body * geom.body_from_geom).translation.vector);
                let within = world_from_board.inverse_transform_point(&at).coords.abs();
                let inside = (0..3).all(|k| within[k] < board_m[k]);
                assert!(!inside, "{} stands in the way of {}", other.1.name, model.bodies[leaf].name);
            }
        }
    }
}

#[test]
fn things_are_many_of_a_kind_graspable_and_a_third_unusual() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (mut targets, mut with_two_distractors, mut objects, mut unusual) = (0, 0, 0, 0);
    for seed in 0..10 {
        let scene = home(seed);
        let path = folder.path().join(&scene.name);
        write(&scene, &path);
        let (model, semantics) = load(&path);
        let text = std::fs::read_to_string(path.join("semantics.toml")).expect("written");
        objects += semantics.objects.len();
        unusual += text.lines().filter(|line| line.ends_with("# unusual")).count();
        let mut per_kind: BTreeMap<&str, usize> = BTreeMap::new();
        for body in model.bodies.iter().filter(|body| body.motion == BodyMotion::Free) {
            let object = semantics.find_object(&body.name).expect("listed");
            *per_kind.entry(&object.category).or_default() += 1;
            let z_m = body.world_from_body.translation.z;
            assert!((0.3..=1.26).contains(&z_m), "seed {seed}: {} lies at {z_m} m", body.name);
            assert!((0.02..=2.0).contains(&body.mass_kg), "seed {seed}: {} weighs {}", body.name, body.mass_kg);
            let narrow = matches!(object.category.as_str(), "pillow" | "plate") || narrowest_m(body) <= 0.125;
            assert!(narrow, "seed {seed}: {} is too wide for a hand", body.name);
        }
        targets += per_kind.values().sum::<usize>();
        with_two_distractors += per_kind.values().filter(|count| **count >= 3).sum::<usize>();
    }
    assert!(2 * with_two_distractors >= targets, "{with_two_distractors} of {targets} have two distractors");
    let share = unusual as f64 / objects as f64;
    assert!((0.25..=0.42).contains(&share), "{unusual} of {objects} contradict their category");
}

/// The smaller horizontal extent of a body's widest solid.
fn narrowest_m(body: &dsm_sim::scene::SceneBody) -> f64 {
    let extent = |shape: &SceneShape| match shape {
        SceneShape::Box { half_m } => 2.0 * half_m.x.min(half_m.y),
        SceneShape::Cylinder { radius_m, .. } | SceneShape::Sphere { radius_m } => 2.0 * radius_m,
        SceneShape::Ellipsoid { radii_m } => 2.0 * radii_m.x.min(radii_m.y),
        _ => f64::INFINITY,
    };
    body.geoms.iter().filter(|geom| geom.collides).map(|geom| extent(&geom.shape)).fold(0.0, f64::max)
}

#[test]
fn a_robot_finds_a_start_in_homes_of_any_size() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let robot = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter");
    let robot = Arc::new(RobotModel::load(&robot).expect("the robot loads"));
    for (rooms, objects) in [(1, 25), (4, 60), (8, 150)] {
        let scene =
            generate_home(&HomeConfig { seed: 11, rooms, objects, ..HomeConfig::default() }).expect("there is room");
        let path = folder.path().join(format!("{rooms}"));
        write(&scene, &path);
        let world = World::load(&path, robot.clone(), WorldConfig { seed: 5, ..WorldConfig::default() });
        let world = world.unwrap_or_else(|error| panic!("{rooms} rooms: {error}"));
        assert_eq!(world.room_names().len(), rooms as usize);
    }
}

#[test]
fn numbers_out_of_range_and_homes_that_are_too_full_are_refused() {
    let refused = |rooms, objects| {
        generate_home(&HomeConfig { seed: 1, rooms, objects, ..HomeConfig::default() }).expect_err("refused")
    };
    assert_eq!(refused(0, 90).to_string(), "rooms is 0; expected 1 to 12");
    assert_eq!(refused(5, 9).to_string(), "objects is 9; expected 10 to 600");
    assert!(matches!(refused(1, 600), GenerateError::Full { rooms: 1, .. }));
}

/// A table with an apple, a shelf volume with a book, a fridge that holds an egg, a room of 4 m.
const LAYOUT: &str = r#"{ "scene_id": "Plan 1", "objects": [
  { "id": "Floor|1", "category": "Floor", "center": [0, 0, -0.05], "size": [4, 4, 0.1] },
  { "id": "DiningTable|1", "category": "DiningTable", "center": [1, 1, 0.5], "size": [1, 0.8, 1.0], "mass": 20,
    "materials": ["Wood"], "affordances": ["receptacle", "moveable"] },
  { "id": "Apple|1", "category": "Apple", "center": [1, 1, 0.79], "size": [0.08, 0.08, 0.08], "mass": 0.2,
    "materials": ["Food"], "affordances": ["pickupable"] },
  { "id": "Fridge|1", "category": "Fridge", "center": [-1.6, 1.6, 0.9], "size": [0.7, 0.7, 1.8] },
  { "id": "Egg|1", "category": "Egg", "center": [-1.6, 1.55, 1.13], "size": [0.05, 0.05, 0.06] },
  { "id": "GarbageCan|1", "category": "GarbageCan", "center": [-1.7, -1.7, 0.25], "size": [0.3, 0.3, 0.5] },
  { "id": "SpaceHeater|1", "category": "SpaceHeater", "center": [1.8, -1.8, 0.25], "size": [0.3, 0.3, 0.5],
    "oriented_corners": [[1.8,-2.0,0],[2.0,-1.8,0],[1.8,-1.6,0],[1.6,-1.8,0],[1.8,-2.0,0.5],[2.0,-1.8,0.5],[1.8,-1.6,0.5],[1.6,-1.8,0.5]] }
] }"#;

#[test]
fn a_layout_becomes_a_room_whose_receptacles_are_hollow() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = import_ithor(LAYOUT, 1).expect("a layout");
    assert_eq!(scene, import_ithor(LAYOUT, 1).expect("a layout"), "same bytes");
    assert_ne!(scene.files, import_ithor(LAYOUT, 2).expect("a layout").files, "colours by seed");
    write(&scene, folder.path());
    let (model, semantics) = load(folder.path());
    let categories: Vec<&str> = semantics.objects.iter().map(|o| o.category.as_str()).collect();
    assert_eq!(categories, ["dining table", "apple", "fridge", "egg", "garbage can", "space heater"]);
    assert!(model.bodies.iter().all(|body| body.motion == BodyMotion::Fixed));
    let checked = check_scene(folder.path(), RobotSize::default()).expect("loads");
    assert!(
        checked.findings.is_empty(),
        "what lies in a fridge or on a table overlaps nothing: {:#?}",
        checked.findings
    );
    let material = |body: &str| semantics.find_object(body).and_then(|o| o.material.clone());
    assert_eq!((material("apple_1").as_deref(), material("fridge_1").as_deref()), (Some("organic"), None));
    // Corners give the heading: the heater stands at 45 degrees with sides of 0.28 m.
    let heater = model.bodies.iter().find(|body| body.name == "space_heater_1").expect("there");
    let yaw = heater.world_from_body.rotation.euler_angles().2.to_degrees().rem_euclid(90.0);
    assert!((yaw - 45.0).abs() < 0.1, "{yaw}");
}

#[test]
fn broken_layouts_are_refused_with_line_or_object() {
    let refused = |text: &str| import_ithor(text, 1).expect_err("refused").to_string();
    assert!(refused("{\n\"scene_id\": \"a\",\n\"objects\": 3}").starts_with("line 3: "));
    assert!(matches!(import_ithor("{\"scene_id\": \"a\", \"objects\": []}", 1), Err(ImportError::Empty)));
    let text = LAYOUT.replace("\"size\": [0.08, 0.08, 0.08]", "\"size\": [0.08, -0.08, 0.08]");
    assert_eq!(refused(&text), "object `Apple|1`: size is -0.08; expected 0 to 50 m");
}

#[test]
// The message is how a reader of the test's output learns that nothing was measured.
#[allow(clippy::print_stderr)]
fn floor_plans_import_when_they_are_there() {
    let Some(data) = std::env::var_os("DSM_DATA") else {
        eprintln!("skipped: DSM_DATA does not name the folder with ithor/");
        return;
    };
    let entries = std::fs::read_dir(PathBuf::from(data).join("ithor")).expect("floor plans");
    let target = tempfile::tempdir().expect("a temporary folder");
    for entry in entries {
        let path = entry.expect("listed").path();
        let scene = import_ithor(&std::fs::read_to_string(&path).expect("text"), 1);
        let scene = scene.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let out = target.path().join(&scene.name);
        write(&scene, &out);
        let (model, semantics) = load(&out);
        assert_eq!(model.bodies.len() - 1, semantics.objects.len(), "{}", path.display());
        assert!(!semantics.start.areas.is_empty(), "{}: the robot can stand somewhere", path.display());
    }
}
