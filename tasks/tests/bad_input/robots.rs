//! Robots: robot.toml and URDF.

use crate::bench::{Bench, refuse};
use std::fs;
use std::path::Path;

const CHECK: [&str; 3] = ["robot", "check", "robot.toml"];

/// A folder with a robot that is right.
fn robot() -> Bench {
    let porter = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter");
    let read = |name: &str| fs::read(porter.join(name)).unwrap();
    Bench::new().file("robot.toml", read("robot.toml")).file("robot.urdf", read("robot.urdf"))
}

fn toml(from: &str, to: &str) -> Bench {
    robot().edit("robot.toml", from, to)
}

fn urdf(from: &str, to: &str) -> Bench {
    robot().edit("robot.urdf", from, to)
}

#[test]
fn the_robot_that_the_cases_break_is_right() {
    let output = robot().run(&CHECK);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}

refuse! {
    robot_file_is_missing: robot().without("robot.toml"), ["robot", "check", "./robot.toml"], ["robot.toml", "expected the path"];
    robot_file_is_binary: robot().file("robot.toml", [0xff, 0x00, 0xfe]), CHECK, ["robot.toml", "UTF-8"];
    robot_key_is_misspelt: toml("footprint_radius_m", "footprint_radus_m"), CHECK,
        ["robot.toml:", "unknown key `base.footprint_radus_m`; did you mean `footprint_radius_m`?"];
    robot_version_is_unknown: toml("version = 1", "version = 2"), CHECK, ["robot.toml:2: `version` is 2; expected"];
    footprint_is_negative: toml("footprint_radius_m = 0.27", "footprint_radius_m = -0.27"), CHECK,
        ["robot.toml:", "`base.footprint_radius_m` is -0.27; expected >"];
    joint_is_unknown: toml("joints = [\"head_pan_joint\", ", "joints = [\"neck_pan_joint\", "), CHECK,
        ["robot.toml:", "there is no moving joint `neck_pan_joint`; did you mean `head_pan_joint`?"];
    accelerations_are_too_few: toml("max_accelerations = [8.0, 8.0]", "max_accelerations = [8.0]"), CHECK,
        ["robot.toml:", "group `head` has 2 joints and 1 max_accelerations; expected one for each"];
    tool_frame_is_unknown: toml("frame = \"tool_frame\"", "frame = \"tol_frame\""), CHECK,
        ["robot.toml:", "there is no link `tol_frame`; did you mean `tool_frame`?"];
    camera_frame_is_unknown: toml("frame = \"head_camera_optical_frame\"", "frame = \"eye\""), CHECK,
        ["robot.toml:", "there is no link `eye`"];
    safety_key_is_misspelt: toml("[collision]", "[safety]\nsensor_timeot_s = 1.0\n\n[collision]"), CHECK,
        ["robot.toml:", "unknown key `safety.sensor_timeot_s`; did you mean `sensor_timeout_s`?"];
    safety_timeout_is_too_long: toml("[collision]", "[safety]\ncommand_timeout_s = 5.0\n\n[collision]"), CHECK,
        ["robot.toml:", "`safety.command_timeout_s` is 5.0; expected >= 0.02 and <= 1"];
    area_is_a_line: toml("[collision]", "[safety]\narea = [[0.0, 0.0], [1.0, 0.0]]\n\n[collision]"), CHECK,
        ["robot.toml:", "safety.area: expected three corners or more"];
    tool_heights_are_reversed: toml("[collision]", "[safety]\ntool_lowest_m = 1.0\ntool_highest_m = 0.5\n\n[collision]"), CHECK,
        ["robot.toml:", "expected less than tool_highest_m"];
    drivers_of_an_unknown_robot: robot(), ["drivers", "check", "--robot", "butler"], ["robot `butler`", "porter"];
    drivers_in_a_missing_scene: robot(), ["drivers", "check", "--robot", "robot.toml", "--scene", "nowhere"], ["nowhere"];
    group_is_missing: toml("name = \"gripper\"", "name = \"hand\""), CHECK, ["robot.toml:", "there is no group `gripper`"];
    posture_is_out_of_limits: toml("arm_6_joint = -1.01", "arm_6_joint = -9.0"), CHECK, ["robot.toml:", "arm_6_joint", "-9"];
    urdf_is_missing: robot().without("robot.urdf"), CHECK, ["robot.toml:4:", "robot.urdf", "does not exist"];
    urdf_is_no_xml: urdf("</robot>", ""), CHECK, ["robot.urdf:"];
    urdf_is_empty: robot().file("robot.urdf", ""), CHECK, ["robot.urdf:1:"];
    urdf_parent_is_unknown: urdf("<parent link=\"arm_1_link\"/>", "<parent link=\"arm_0_link\"/>"), CHECK,
        ["robot.urdf:", "arm_0_link"];
    urdf_mesh_is_missing:
        urdf("<cylinder radius=\"0.055\" length=\"0.12\"/></geometry></collision>",
            "<mesh filename=\"shoulder.stl\"/></geometry></collision>"),
        CHECK, ["robot.urdf:", "shoulder.stl"];
    urdf_speed_limit_is_negative:
        urdf("lower=\"0\" upper=\"0.45\" velocity=\"0.2\"", "lower=\"0\" upper=\"0.45\" velocity=\"-0.2\""),
        CHECK, ["robot.urdf:", "`velocity` is \"-0.2\"; expected 1 finite number >= 0"];
    urdf_link_stands_twice: urdf("<link name=\"arm_2_link\"", "<link name=\"arm_1_link\""), CHECK,
        ["robot.urdf:", "link `arm_1_link` stands already in line", "expected a unique name"];
    urdf_limits_are_reversed: urdf("lower=\"0\" upper=\"0.45\"", "lower=\"0.45\" upper=\"0\""), CHECK,
        ["robot.urdf:", "lift_joint", "lower"];
    urdf_joint_stands_twice: urdf("<joint name=\"arm_2_joint\"", "<joint name=\"arm_1_joint\""), CHECK,
        ["robot.urdf:", "joint `arm_1_joint` stands already in line", "expected a unique name"];
    run_with_a_broken_robot: toml("version = 1", "version = 2"), ["run", "episode.toml", "--robot", "robot.toml"],
        ["robot.toml:2: `version` is 2"];
}
