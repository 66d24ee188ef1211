//! Contract: generated episodes are valid, name bodies that are there, and their words mean one thing only.
use super::*;
use crate::episode::{Episode, ExpectationKind, SkillName};
use dsm::ground::{Action, PartKind, parse_command, split_sequence};
use dsm_sim::scene::{Doorways, Furniture, HomeConfig, generate_home};
use std::path::Path;

fn load_home(seed: u64) -> (tempfile::TempDir, SceneModel, Semantics) {
    load_home_with(seed, Furniture::Plain)
}

fn load_home_with(seed: u64, furniture: Furniture) -> (tempfile::TempDir, SceneModel, Semantics) {
    load_made(&HomeConfig { seed, rooms: 5, objects: 90, furniture, ..HomeConfig::default() })
}

fn load_made(config: &HomeConfig) -> (tempfile::TempDir, SceneModel, Semantics) {
    let folder = tempfile::tempdir().unwrap();
    let scene = generate_home(config).unwrap();
    for (name, bytes) in &scene.files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let file = folder.path().join("scene.xml");
    let model = SceneModel::load(&file).unwrap();
    let semantics = Semantics::load(&file, &model).unwrap();
    (folder, model, semantics)
}

#[test]
fn episodes_are_valid_and_name_what_is_there() {
    let knowledge = Knowledge::embedded().unwrap();
    let mut kinds = Vec::new();
    let (mut drives, mut explored) = (0, 0);
    for seed in 20..26 {
        let (folder, model, semantics) = load_home(seed);
        let episodes = write_episodes(&model, &semantics, &knowledge, seed, 8, (&KINDS, None));
        assert_eq!(episodes.len(), 8, "home {seed}");
        assert_eq!(
            episodes,
            write_episodes(&model, &semantics, &knowledge, seed, 8, (&KINDS, None)),
            "the same texts again"
        );
        let home = Home::read(&model, &semantics);
        let mut commands = Vec::new();
        for generated in &episodes {
            let path = folder.path().join(format!("{}.toml", generated.name));
            std::fs::write(&path, &generated.text).unwrap();
            let episode = Episode::load(&path).unwrap_or_else(|error| panic!("{error}\n{}", generated.text));
            let command = episode.steps.last().unwrap().command.clone().unwrap();
            parse_command(&command, &knowledge).unwrap_or_else(|error| panic!("{command}: {error}"));
            let expect = &episode.expectations[0];
            let find = |body: &Option<String>| home.objects.iter().find(|o| Some(&o.body) == body.as_ref());
            match expect.kind {
                ExpectationKind::RobotNear if expect.room.is_some() => {}
                ExpectationKind::RobotNear => assert!(find(&expect.object).is_some_and(|o| o.stands)),
                _ => assert!(find(&expect.object).is_some_and(|o| o.graspable && o.support.is_some()), "{command}"),
            }
            let explores = episode.steps[0].skill == Some(SkillName::Explore);
            assert_eq!(episode.steps.len(), 1 + usize::from(explores));
            if expect.kind == ExpectationKind::RobotNear {
                (drives, explored) = (drives + 1, explored + usize::from(explores));
            } else {
                assert!(!explores, "what is not known is explored when it is asked for: {command}");
            }
            if expect.kind == ExpectationKind::ObjectOn {
                assert!(find(&expect.surface).is_some_and(|o| o.is_surface), "{command}");
            }
            kinds.push(expect.kind);
            commands.push(command);
        }
        commands.sort();
        commands.dedup();
        assert_eq!(commands.len(), 8, "no command twice in one home");
    }
    assert!(explored.abs_diff(drives - explored) <= 3, "{explored} of {drives} drives are on a finished map");
    for kind in [ExpectationKind::RobotNear, ExpectationKind::ObjectLifted, ExpectationKind::ObjectOn] {
        assert!(kinds.iter().filter(|k| **k == kind).count() >= 6, "{kind:?}");
    }
}

/// A room with a table, a desk and things on them; the flat floor is its only wall. `half_m` is half the table's side.
fn tiny(half_m: f64) -> (SceneModel, Semantics) {
    let folder = tempfile::tempdir().unwrap();
    let fixed = |name: &str, x: f64, top: f64, half_m: f64| {
        format!(
            "<body name=\"{name}\" pos=\"{x} 0 0\"><geom type=\"box\" pos=\"0 0 {}\" size=\"{half_m} {half_m} .02\"/></body>",
            top - 0.02
        )
    };
    let thing = |name: &str, x: f64, y: f64, z: f64| {
        format!(
            "<body name=\"{name}\" pos=\"{x} {y} {z}\"><freejoint/><geom type=\"cylinder\" pos=\"0 0 .05\" size=\".04 .05\" mass=\".3\"/></body>"
        )
    };
    let xml = format!(
        "<mujoco><worldbody>{}{}{}{}{}</worldbody></mujoco>",
        fixed("table_1", 0.0, 0.7, half_m),
        fixed("desk_1", 3.0, 0.74, 0.5),
        thing("mug_1", 0.1, 0.0, 0.7005),
        thing("mug_2", 2.8, 0.2, 0.7405),
        thing("mug_3", 2.8, -0.3, 0.7405),
    );
    std::fs::write(folder.path().join("scene.xml"), xml).unwrap();
    let object = |body: &str, category: &str, color: &str, pattern: &str| {
        format!(
            "[[object]]\nbody = \"{body}\"\ncategory = \"{category}\"\ncolor = \"{color}\"\npattern = \"{pattern}\"\naffordances = [\"pick up\"]\n"
        )
    };
    let text = format!(
        "version = 1\nname = \"tiny\"\n{}{}{}{}{}",
        object("table_1", "table", "brown", "plain"),
        object("desk_1", "desk", "brown", "plain"),
        object("mug_1", "mug", "red", "plain"),
        object("mug_2", "mug", "blue", "plain"),
        object("mug_3", "mug", "green", "striped"),
    );
    std::fs::write(folder.path().join("semantics.toml"), text).unwrap();
    let file = folder.path().join("scene.xml");
    let model = SceneModel::load(Path::new(&file)).unwrap();
    let semantics = Semantics::load(&file, &model).unwrap();
    (model, semantics)
}

#[test]
fn furniture_of_two_colours_is_not_told_by_its_colour() {
    let folder = tempfile::tempdir().unwrap();
    let counter = |name: &str, x: f64, body: &str, top: &str| {
        format!(
            "<body name=\"{name}\" pos=\"{x} 0 0\"><geom type=\"box\" pos=\"0 0 .4\" size=\".6 .3 .4\" rgba=\"{body} 1\"/>\
             <geom type=\"box\" pos=\"0 0 .82\" size=\".6 .3 .02\" rgba=\"{top} 1\"/></body>"
        )
    };
    let (white, purple) = (".9 .9 .9", ".4 .1 .5");
    let xml = format!(
        "<mujoco><worldbody>{}{}{}</worldbody></mujoco>",
        counter("a", 0.0, white, white),
        counter("b", 2.0, white, purple),
        counter("c", 4.0, purple, purple),
    );
    std::fs::write(folder.path().join("scene.xml"), xml).unwrap();
    let object = |body: &str, color: &str| {
        format!("[[object]]\nbody = \"{body}\"\ncategory = \"countertop\"\ncolor = \"{color}\"\n")
    };
    let text = format!(
        "version = 1\nname = \"tiny\"\n{}{}{}",
        object("a", "white"),
        object("b", "purple"),
        object("c", "purple")
    );
    std::fs::write(folder.path().join("semantics.toml"), text).unwrap();
    let file = folder.path().join("scene.xml");
    let model = SceneModel::load(Path::new(&file)).unwrap();
    let home = Home::read(&model, &Semantics::load(&file, &model).unwrap());
    let told: Vec<(bool, Option<&str>)> = home.objects.iter().map(|o| (o.mixed, o.color.as_deref())).collect();
    assert_eq!(told, [(false, Some("white")), (true, None), (false, Some("purple"))]);
    let knowledge = Knowledge::embedded().unwrap();
    for index in 0..3 {
        let names = find_names(index, &home, &knowledge);
        assert!(names.iter().all(|name| !name.starts_with("white") && !name.starts_with("purple")), "{names:?}");
    }
}

#[test]
fn names_hold_for_one_object_alone() {
    let knowledge = Knowledge::embedded().unwrap();
    let (model, semantics) = tiny(0.5);
    let home = Home::read(&model, &semantics);
    assert_eq!(home.objects.iter().map(|o| o.support).collect::<Vec<_>>(), [None, None, Some(0), Some(1), Some(1)]);
    // The striped mug may be called by any colour, so colours help nobody; a desk is a table, too, so that "on the table"
    // holds for all three mugs.
    for index in 2..5 {
        let names = find_names(index, &home, &knowledge);
        assert!(!names.contains(&"mug".to_owned()), "there are three mugs: {names:?}");
        assert!(names.iter().all(|name| !name.starts_with("red") && !name.starts_with("blue")), "{names:?}");
        assert!(!names.contains(&"mug on the table".to_owned()), "a desk is a table: {names:?}");
    }
    assert!(find_names(1, &home, &knowledge).contains(&"desk".to_owned()));
    assert!(!find_names(0, &home, &knowledge).contains(&"table".to_owned()), "the desk may be called a table");
}

#[test]
fn nobody_is_asked_for_what_no_place_is_near_enough_to() {
    let graspable = |half_m: f64| {
        let (model, semantics) = tiny(half_m);
        let mut home = Home::read(&model, &semantics);
        Stands::find(&model, &semantics).drop_out_of_reach(&mut home);
        home.objects.iter().map(|object| object.graspable).collect::<Vec<_>>()
    };
    assert_eq!(graspable(0.5), [false, false, true, true, true]);
    // In the middle of a table of two metres and a half.
    assert_eq!(graspable(1.25), [false, false, false, true, true]);
}

#[test]
fn disturbed_episodes_are_valid_and_suit_what_happens() {
    let knowledge = Knowledge::embedded().unwrap();
    let mut kinds = Vec::new();
    for seed in 20..26 {
        let (folder, model, semantics) = load_home(seed);
        let episodes = write_episodes(&model, &semantics, &knowledge, seed, 4, (&KINDS, Some(Disturb::InTurn)));
        assert_eq!(episodes, write_episodes(&model, &semantics, &knowledge, seed, 4, (&KINDS, Some(Disturb::InTurn))));
        let home = Home::read(&model, &semantics);
        for generated in &episodes {
            let path = folder.path().join(format!("{}.toml", generated.name));
            std::fs::write(&path, &generated.text).unwrap();
            let episode = Episode::load(&path).unwrap_or_else(|error| panic!("{error}\n{}", generated.text));
            let [disturbance] = &episode.disturbances[..] else { panic!("one disturbance: {}", generated.text) };
            let expected = &episode.expectations[0];
            if disturbance.kind.needs_object() {
                let object = home.objects.iter().find(|o| Some(&o.body) == disturbance.object.as_ref());
                assert!(object.is_some_and(|o| o.free), "{}", generated.text);
                let refused = disturbance.kind == DisturbanceKind::ObjectRemoved;
                assert_eq!(expected.kind == ExpectationKind::Refused, refused, "{}", generated.text);
                assert!(refused || expected.object == disturbance.object, "{}", generated.text);
            }
            kinds.push(disturbance.kind);
        }
    }
    for kind in DisturbanceKind::ALL {
        assert!(kinds.iter().filter(|k| **k == kind).count() >= 2, "{kind:?}: {kinds:?}");
    }
    assert!("all".parse() == Ok(Disturb::InTurn) && "slip".parse() == Ok(Disturb::With(DisturbanceKind::Slip)));
    assert!("slips".parse::<Disturb>().unwrap_err().contains("light_off"));
}

#[test]
fn sequences_are_three_commands_with_an_expectation_each() {
    let knowledge = Knowledge::embedded().unwrap();
    for seed in 20..23 {
        let (folder, model, semantics) = load_home(seed);
        let episodes = write_sequences(&model, &semantics, &knowledge, seed, 3);
        assert_eq!(episodes.len(), 3, "home {seed}");
        for generated in &episodes {
            let path = folder.path().join(format!("{}.toml", generated.name));
            std::fs::write(&path, &generated.text).unwrap();
            let episode = Episode::load(&path).unwrap_or_else(|error| panic!("{error}\n{}", generated.text));
            let parts = split_sequence(episode.steps[0].command.as_ref().unwrap(), &knowledge);
            assert_eq!((parts.len(), episode.expectations.len()), (3, 3), "{}", generated.text);
        }
    }
}

#[test]
fn drawers_that_can_be_come_to_are_called_by_what_tells_them_apart() {
    let knowledge = Knowledge::embedded().unwrap();
    let mut commands = Vec::new();
    for seed in 20..23 {
        let (folder, model, semantics) = load_home_with(seed, Furniture::Articulated);
        for generated in write_episodes(&model, &semantics, &knowledge, seed, 4, (&[Kind::OpenDrawer], None)) {
            let path = folder.path().join(format!("{}.toml", generated.name));
            std::fs::write(&path, &generated.text).unwrap();
            let episode = Episode::load(&path).unwrap_or_else(|error| panic!("{error}\n{}", generated.text));
            let expect = &episode.expectations[0];
            assert_eq!(expect.kind, ExpectationKind::JointOpen);
            let joint = model.joints.iter().find(|joint| Some(&model.bodies[joint.part].name) == expect.part.as_ref());
            let joint = joint.unwrap_or_else(|| panic!("{expect:?} is not in the scene"));
            assert_eq!(Some(&model.bodies[joint.carrier].name), expect.object.as_ref());
            let command = episode.steps[0].command.clone().unwrap();
            let parsed = parse_command(&command, &knowledge).unwrap_or_else(|error| panic!("{command}: {error}"));
            assert!(parsed.part.is_some() && !parsed.target.contains("drawer of"), "{command}: {parsed:?}");
            commands.push((seed, command));
        }
    }
    assert!(commands.len() >= 4, "{commands:?}");
    let mut unique = commands.clone();
    unique.dedup();
    assert_eq!(unique, commands);
}

#[test]
fn what_is_to_be_closed_stands_open_at_the_start() {
    let knowledge = Knowledge::embedded().unwrap();
    let mut kinds = Vec::new();
    for seed in 20..24 {
        let (folder, model, semantics) = load_home_with(seed, Furniture::Articulated);
        let asked = [Kind::CloseDrawer, Kind::CloseDoor];
        for generated in write_episodes(&model, &semantics, &knowledge, seed, 4, (&asked, None)) {
            let path = folder.path().join(format!("{}.toml", generated.name));
            std::fs::write(&path, &generated.text).unwrap();
            let episode = Episode::load(&path).unwrap_or_else(|error| panic!("{error}\n{}", generated.text));
            let ([open], expect) = (&episode.open[..], &episode.expectations[0]) else { panic!("{}", generated.text) };
            assert_eq!((expect.kind, expect.part.as_ref()), (ExpectationKind::JointClosed, Some(&open.part)));
            let joint = model.joints.iter().find(|joint| model.bodies[joint.part].name == open.part);
            assert!(joint.is_some_and(|joint| joint.range.is_some()), "{}", generated.text);
            let command = episode.steps[0].command.clone().unwrap();
            let parsed = parse_command(&command, &knowledge).unwrap_or_else(|error| panic!("{command}: {error}"));
            assert!(parsed.action == Action::Close && parsed.part.is_some(), "{command}: {parsed:?}");
            kinds.push(parsed.part.and_then(|part| part.kind));
        }
    }
    for kind in [PartKind::Drawer, PartKind::Door] {
        assert!(kinds.iter().filter(|k| **k == Some(kind)).count() >= 2, "{kinds:?}");
    }
}

#[test]
fn what_is_asked_for_behind_a_door_is_out_of_reach_until_that_door_opens() {
    let knowledge = Knowledge::embedded().unwrap();
    let mut count = 0;
    for seed in 20..23 {
        let doorways = Doorways::Doors;
        let (folder, model, semantics) =
            load_made(&HomeConfig { seed, rooms: 5, objects: 90, doorways, ..HomeConfig::default() });
        let home = Home::read(&model.with_joints_held(), &semantics);
        assert!(home.objects.iter().all(|object| object.category != "door"), "doors are not asked for");
        for generated in write_episodes(&model, &semantics, &knowledge, seed, 4, (&[Kind::PassDoor], None)) {
            let path = folder.path().join(format!("{}.toml", generated.name));
            std::fs::write(&path, &generated.text).unwrap();
            let episode = Episode::load(&path).unwrap_or_else(|error| panic!("{error}\n{}", generated.text));
            let command = episode.steps[0].command.clone().unwrap();
            parse_command(&command, &knowledge).unwrap_or_else(|error| panic!("{command}: {error}"));
            let [target, door] = &episode.expectations[..] else { panic!("{}", generated.text) };
            assert_eq!(door.kind, ExpectationKind::JointOpen);
            let leaf = model.bodies.iter().position(|body| Some(&body.name) == door.part.as_ref()).unwrap();
            let start = episode.start.unwrap();
            let start = nalgebra::Point2::new(start.x_m, start.y_m);
            let room = home.objects.iter().find(|o| Some(&o.body) == target.object.as_ref()).unwrap().room.clone();
            let leads = |open: &[usize]| {
                let costmap = reach::costmap_of(&model.without_solids_of(open), reach::ROBOT_M).unwrap();
                pass::find_rooms(&costmap, &start, &semantics).contains_key(room.as_ref().unwrap())
            };
            assert!(!leads(&[]) && leads(&[leaf]), "{}", generated.text);
            count += 1;
        }
    }
    assert!(count >= 6, "{count} episodes in three homes");
}
