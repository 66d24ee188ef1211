//! Contract: another robot is data: URDFs that hang on each other, joints that are held, links that do not collide, heads
//! whose axes point elsewhere. What the skills need and a robot lacks is said when it is loaded.
use super::*;
use std::path::PathBuf;

fn porter_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(porter_folder().join(name)).expect("porter's file")
}

/// A robot from these files.
fn load(name: &str, files: &[(&str, &str)]) -> Result<RobotModel, ModelError> {
    let folder = std::env::temp_dir().join(format!("dsm-parts-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("temporary folder");
    for (file, text) in files {
        std::fs::write(folder.join(file), text).expect("write");
    }
    let loaded = RobotModel::load(&folder);
    std::fs::remove_dir_all(&folder).expect("temporary folder");
    loaded
}

/// Porter in two files: what hangs on the wrist, and the rest.
fn halves() -> (String, String) {
    let urdf = read("robot.urdf");
    let (from, to) = (urdf.find("  <link name=\"gripper_left_link\">"), urdf.find("  <link name=\"head_pan_link\">"));
    let (from, to) = (from.expect("the gripper"), to.expect("the head"));
    let hand = format!("<robot name=\"hand\">\n{}</robot>\n", &urdf[from..to]);
    (format!("{}{}", &urdf[..from], &urdf[to..]), hand)
}

#[test]
fn a_hand_may_stand_in_a_file_of_its_own() {
    let (body, hand) = halves();
    let toml =
        read("robot.toml").replace("urdf = \"robot.urdf\"", "urdf = \"robot.urdf\"\nattachments = [\"hand.urdf\"]");
    let joined =
        load("joined", &[("robot.toml", &toml), ("robot.urdf", &body), ("hand.urdf", &hand)]).expect("it loads");
    let whole = porter();
    let pose = |model: &RobotModel| model.kinematics.root_from_link(&bent(&whole), model.tool);
    let mut same = joined.kinematics.zero();
    assert!(same.apply(bent(&whole).positions()).is_empty());
    let tool = joined.kinematics.root_from_link(&same, joined.tool);
    assert!((tool.to_homogeneous() - pose(&whole).to_homogeneous()).norm() < 1e-12);

    let error = load("lost", &[("robot.toml", &toml), ("robot.urdf", &body)]).expect_err("no hand").to_string();
    assert!(error.contains("`attachments` is \"hand.urdf\", which does not exist"), "{error}");
    let twice = hand.replace("\"gripper_left_link\"", "\"arm_7_link\"");
    let files = [("robot.toml", toml.as_str()), ("robot.urdf", &body), ("hand.urdf", &twice)];
    let error = load("twice", &files).expect_err("a link stands twice").to_string();
    assert!(
        error.contains("hand.urdf:2: link `arm_7_link` stands already in line") && error.contains("robot.urdf"),
        "{error}"
    );
}

#[test]
fn the_script_that_fetches_a_missing_urdf_is_named() {
    let files = [("robot.toml", read("robot.toml")), ("fetch.sh", "#!/bin/sh\n".to_owned())];
    let error = load("fetch", &files.each_ref().map(|(name, text)| (*name, text.as_str()))).expect_err("no URDF");
    assert!(error.to_string().contains("fetch.sh` gets what this robot needs"), "{error}");
}

#[test]
fn held_joints_stay_at_zero_and_ignored_links_touch_nothing() {
    let toml = read("robot.toml");
    let start = toml.find("[[group]]\nname = \"head\"").expect("the head");
    let toml = format!(
        "{}\n{}",
        toml[..start].replace("urdf = \"robot.urdf\"", "urdf = \"robot.urdf\"\nlocked_joints = [\"spin_joint\"]"),
        toml[start..].replace("[collision]", "[collision]\nignored_links = [\"spin_link\"]")
    );
    let wheel = "<link name=\"spin_link\"><collision><geometry><sphere radius=\"0.9\"/></geometry></collision></link>\
                 <joint name=\"spin_joint\" type=\"continuous\"><parent link=\"base_link\"/><child link=\"spin_link\"/>\
                 <axis xyz=\"0 1 0\"/></joint></robot>";
    let urdf = read("robot.urdf").replace("</robot>", wheel);
    let model = load("held", &[("robot.toml", &toml), ("robot.urdf", &urdf)]).expect("it loads");
    assert!(model.kinematics.variables.iter().all(|name| &**name != "spin_joint"));
    assert_eq!(model.kinematics.find_joint("spin_joint").expect("it is there").kind, JointKind::Fixed);
    let link = model.kinematics.find_link("spin_link").expect("it is there");
    assert!(model.kinematics.links[link.0].collisions.is_empty());

    let misspelt = toml.replace("[\"spin_joint\"]", "[\"spn_joint\"]");
    let error = load("misspelt", &[("robot.toml", &misspelt), ("robot.urdf", &urdf)]).expect_err("no such joint");
    assert!(error.to_string().contains("there is no joint `spn_joint`; did you mean `spin_joint`?"), "{error}");
}

#[test]
fn a_head_may_tilt_about_any_side() {
    assert_eq!(porter().head_signs(), [1.0, 1.0]);
    let urdf = read("robot.urdf");
    let tilt = urdf.find("<joint name=\"head_tilt_joint\"").expect("the tilt");
    let turned =
        format!("{}{}", &urdf[..tilt], urdf[tilt..].replacen("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 -1 0\"/>", 1));
    let model = load("tilt", &[("robot.toml", &read("robot.toml")), ("robot.urdf", &turned)]).expect("it loads");
    assert_eq!(model.head_signs(), [1.0, -1.0]);
}

#[test]
fn what_the_skills_need_and_a_robot_lacks_is_named() {
    let lacking = |from: &str, to: &str| {
        let toml = read("robot.toml");
        assert!(toml.contains(from), "{from}");
        let files = [("robot.toml", toml.replace(from, to)), ("robot.urdf", read("robot.urdf"))];
        load("role", &files.each_ref().map(|(name, text)| (*name, text.as_str())))
            .expect_err("it lacks something")
            .to_string()
    };
    let error = lacking("name = \"wrist\"", "name = \"hand\"");
    assert!(error.contains("there is no camera `wrist`, which the skills need"), "{error}");
    let error = lacking("carry_to_ready_down = ", "carry_to_ready = ");
    assert!(error.contains("there is no path of two postures or more `carry_to_ready_down`"), "{error}");
}
