use super::*;
use dsm::Pose;
use nalgebra::{Point3, Vector3};

mod parts;

fn porter() -> RobotModel {
    RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter")).expect("porter loads")
}

/// A configuration away from zero, so that no axis is special.
fn bent(model: &RobotModel) -> Configuration {
    let mut configuration = model.kinematics.zero();
    for (k, name) in model.kinematics.variables.clone().iter().enumerate() {
        let limits = model.kinematics.find_joint(name).expect("variable is a joint").limits;
        let (lower, upper) = (limits.lower.max(-3.0), limits.upper.min(3.0));
        configuration.set(k, lower + (upper - lower) * (0.35 + 0.04 * (k % 7) as f64));
    }
    configuration
}

#[test]
fn porter_loads_with_its_groups_frames_and_cameras() {
    let model = porter();
    assert_eq!(model.arm.joints[0].as_ref(), "lift_joint");
    assert_eq!(model.arm.len(), 8);
    assert_eq!(model.head.len(), 2);
    assert_eq!(model.gripper.len(), 2);
    assert!(model.find_camera("head").is_some() && model.find_camera("wrist").is_some());
    assert!(model.kinematics.links.iter().all(|link| link.inertial.mass_kg >= 0.0));
}

#[test]
fn forward_kinematics_of_one_link_agrees_with_that_of_all() {
    let model = porter();
    let configuration = bent(&model);
    let poses = model.kinematics.root_from_links(&configuration);
    for link in 0..model.kinematics.links.len() {
        let alone = model.kinematics.root_from_link(&configuration, LinkId(link));
        assert!((alone.to_homogeneous() - poses.get(LinkId(link)).to_homogeneous()).norm() < 1e-12);
    }
}

#[test]
fn the_stretched_porter_has_its_tool_where_the_urdf_says() {
    let model = porter();
    let tool = model.kinematics.root_from_link(&model.kinematics.zero(), model.tool);
    // Lift at 0.06, shoulder at 0.06, links 0.36 and 0.34, wrist to tool 0.20; the approach axis points forward.
    assert!((tool.translation.vector - Vector3::new(1.02, 0.0, 0.65)).norm() < 1e-9, "{tool}");
    assert!((tool * Vector3::z() - Vector3::x()).norm() < 1e-9);
    assert!((tool * Vector3::y() - Vector3::y()).norm() < 1e-9);
}

#[test]
fn the_jacobian_equals_finite_differences_for_every_link_and_group() {
    let model = porter();
    let configuration = bent(&model);
    let poses = model.kinematics.root_from_links(&configuration);
    let step = 1e-6;
    for group in &model.groups {
        for index in 0..model.kinematics.links.len() {
            let link = LinkId(index);
            let point_in_link = Point3::new(0.05, -0.02, 0.11);
            let jacobian = model.kinematics.jacobian(&poses, link, &(poses.get(link) * point_in_link), group);
            for (column, variable) in group.variables.iter().enumerate() {
                let moved = |by: f64| {
                    let mut other = configuration.clone();
                    other.set(*variable, configuration.value(*variable) + by);
                    model.kinematics.root_from_link(&other, link)
                };
                let (before, after) = (moved(-step), moved(step));
                let linear = (after * point_in_link - before * point_in_link) / (2.0 * step);
                let angular = (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * step);
                for row in 0..3 {
                    assert!((jacobian[(row, column)] - linear[row]).abs() < 1e-7, "{index} {column} {row}");
                    assert!((jacobian[(row + 3, column)] - angular[row]).abs() < 1e-7, "{index} {column} {row}");
                }
            }
        }
    }
}

#[test]
fn postures_of_porter_touch_nothing_of_itself() {
    let model = porter();
    for name in model.settings.postures.keys() {
        let mut configuration = model.kinematics.zero();
        assert!(configuration.apply(&model.find_posture(name).expect("listed")).is_empty());
        let poses = model.kinematics.root_from_links(&configuration);
        let hits: Vec<_> = model.collision.self_distances(&poses, 0.002);
        let names: Vec<_> =
            hits.iter().map(|h| (&model.kinematics.links[h.link.0].name, h.other, h.distance_m)).collect();
        assert!(hits.is_empty(), "{name}: {names:?}");
    }
}

#[test]
fn distances_to_obstacles_have_sign_points_and_direction() {
    let model = porter();
    let poses = model.kinematics.root_from_links(&model.kinematics.zero());
    let wrist = model.kinematics.find_link("arm_6_link").expect("link");
    let center = poses.get(wrist).translation.vector;
    // The wrist is a ball of 0.042 m.
    let ahead = Obstacle::still_ball(Point3::from(center + Vector3::new(0.0, 0.0, 0.1)), 0.01);
    let found = model.collision.obstacle_distances(&poses, &[ahead], &[wrist], 0.2);
    assert_eq!(found.len(), 1);
    assert!((found[0].distance_m - 0.048).abs() < 1e-5, "{found:?}");
    assert!((found[0].normal_to_other.into_inner() - Vector3::z()).norm() < 1e-4);
    let inside = Obstacle::still_box(Pose::translation(center.x, center.y, center.z), Vector3::new(0.3, 0.3, 0.01));
    let found = model.collision.obstacle_distances(&poses, &[inside], &[wrist], 0.2);
    assert!(found[0].distance_m < -0.03, "{found:?}");
}

/// Loads a URDF written for the test.
fn load_text(name: &str, urdf: &str) -> Result<Kinematics, ModelError> {
    let folder = std::env::temp_dir().join(format!("dsm-urdf-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("temporary folder");
    let file = folder.join("robot.urdf");
    std::fs::write(&file, urdf).expect("temporary file");
    let loaded = Kinematics::load_urdf(&file);
    std::fs::remove_dir_all(&folder).expect("temporary folder");
    loaded
}

#[test]
fn mimic_joints_follow_their_joint_in_poses_and_jacobians() {
    let urdf = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
        <joint name="lead" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/><limit lower="0" upper="1" velocity="1" effort="1"/></joint>
        <joint name="follow" type="prismatic"><parent link="a"/><child link="c"/><axis xyz="0 1 0"/><limit lower="-9" upper="9" velocity="1" effort="1"/><mimic joint="lead" multiplier="-2" offset="0.5"/></joint></robot>"#;
    let kinematics = load_text("mimic", urdf).expect("loads");
    assert_eq!(kinematics.variables.len(), 1);
    let mut configuration = kinematics.zero();
    configuration.set(0, 0.3);
    let link = kinematics.find_link("c").expect("link");
    let poses = kinematics.root_from_links(&configuration);
    assert!((poses.get(link).translation.y - (0.5 - 0.6)).abs() < 1e-12);
    let group = Group {
        name: "g".into(),
        joints: kinematics.variables.clone(),
        variables: vec![0],
        limits: vec![kinematics.joints[0].limits],
        max_accelerations: vec![1.0],
    };
    assert!((kinematics.jacobian(&poses, link, &Point3::origin(), &group)[(1, 0)] + 2.0).abs() < 1e-12);
}

#[test]
fn broken_urdfs_name_file_line_and_what_was_expected() {
    let link = "<link name=\"a\"/>\n<link name=\"b\"/>";
    let joint = |inner: &str| format!("<robot name=\"r\">\n{link}\n<joint name=\"j\" {inner}</joint></robot>");
    let ends = "<parent link=\"a\"/><child link=\"b\"/>";
    let cases = [
        ("<robot name=\"r\">\n<link name=\"a\">\n</robot>".to_owned(), 3, "not well-formed"),
        (joint("type=\"revolute\"><parent link=\"a\"/><child link=\"bb\"/>"), 4, "did you mean `b`"),
        (joint(&format!("type=\"floating\">{ends}")), 4, "expected fixed, revolute"),
        (joint(&format!("type=\"revolute\">{ends}<limit lower=\"2\" upper=\"1\" velocity=\"1\" effort=\"1\"/>")), 4, "above"),
        (joint(&format!("type=\"revolute\">{ends}<axis xyz=\"0 0\"/>")), 4, "expected 3 finite numbers"),
        (joint(&format!("type=\"revolute\">{ends}<limit velocity=\"1\" effort=\"1\"/><mimic joint=\"k\"/>")), 4, "mimics `k`"),
        ("<robot name=\"r\">\n<link name=\"a\"/>\n<link name=\"b\"/>\n</robot>".to_owned(), 1, "expected one root link"),
        ("<robot name=\"r\">\n<link name=\"a\">\n<visual><geometry><mesh filename=\"package://x/no.stl\"/></geometry></visual></link></robot>".to_owned(), 3, "does not exist"),
        ("<robot name=\"r\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n<xacro:include filename=\"x\"/></robot>".to_owned(), 1, "xacro"),
        ("<mujoco/>".to_owned(), 1, "expected <robot>"),
    ];
    for (index, (urdf, line, words)) in cases.iter().enumerate() {
        let error = load_text(&format!("broken{index}"), urdf).expect_err("the URDF is broken").to_string();
        assert!(error.contains(&format!("robot.urdf:{line}: ")) && error.contains(words), "{index}: {error}");
    }
}

#[test]
fn robot_toml_that_does_not_fit_the_urdf_names_line_and_nearest_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter");
    let text = std::fs::read_to_string(folder.join("robot.toml")).expect("robot.toml");
    let broken = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let changed = text.replacen(from, to, 1);
        let place = std::env::temp_dir().join(format!("dsm-toml-{}", std::process::id()));
        std::fs::create_dir_all(&place).expect("temporary folder");
        std::fs::copy(folder.join("robot.urdf"), place.join("robot.urdf")).expect("copy");
        std::fs::write(place.join("robot.toml"), &changed).expect("write");
        let error = RobotModel::load(&place).expect_err("robot.toml is broken").to_string();
        std::fs::remove_dir_all(&place).expect("temporary folder");
        error
    };
    let error = broken("frame = \"tool_frame\"", "frame = \"tol_frame\"");
    assert!(error.contains("there is no link `tol_frame`; did you mean `tool_frame`?"), "{error}");
    let error = broken("\"arm_3_joint\", ", "\"arm_33_joint\", ");
    assert!(error.contains("there is no moving joint `arm_33_joint`; did you mean `arm_3_joint`?"), "{error}");
    let error = broken("finger_friction = 0.9", "finger_friction = 1.9");
    assert!(error.contains("`gripper.finger_friction` is 1.9; expected >= 0.01 and <= 1"), "{error}");
    let error = broken("max_aperture_m", "max_apperture_m");
    assert!(error.contains("did you mean `max_aperture_m`?"), "{error}");
    let error = broken("lift_joint = 0.08", "lift_joint = 0.8");
    assert!(error.contains("sets `lift_joint` to 0.8; expected [0, 0.45]"), "{error}");
    let error = broken("urdf = \"robot.urdf\"", "urdf = \"robt.urdf\"");
    assert!(error.contains("robot.toml:") && error.contains("does not exist"), "{error}");
}

#[test]
// The message is how a reader of the test's output learns that nothing was checked.
#[allow(clippy::print_stderr)]
fn tiago_and_panda_of_example_robot_data_load_unchanged() {
    let Some(data) = std::env::var_os("DSM_ROBOT_DATA") else {
        eprintln!("skipped: DSM_ROBOT_DATA does not name the folder of example-robot-data");
        return;
    };
    let robots = Path::new(&data).join("robots");
    let panda = Kinematics::load_urdf(&robots.join("panda_description/urdf/panda.urdf")).expect("panda loads");
    assert!(panda.find_joint("panda_joint7").is_some());
    let tiago = Kinematics::load_urdf(&robots.join("tiago_description/robots/tiago.urdf")).expect("tiago loads");
    assert!(tiago.find_joint("arm_7_joint").is_some() && tiago.variables.len() >= 14);
    for kinematics in [&panda, &tiago] {
        let poses = kinematics.root_from_links(&kinematics.zero());
        assert!(poses.as_slice().iter().all(|pose| pose.translation.vector.norm() < 3.0));
    }
}
