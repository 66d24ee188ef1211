//! Contract: an MJCF scene loads into bodies, shapes, masses, surfaces and lights as MuJoCo reads it; a broken scene is
//! refused with file, line and what was expected.

use dsm::Pose;
use dsm_sim::scene::{BodyMotion, Effect, JointMotion, LightKind, SceneModel, SceneShape, TextureSpan};
use nalgebra::{Point3, Vector3};
use std::path::{Path, PathBuf};

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let file = folder.join(name);
    std::fs::write(&file, text).expect("written");
    file
}

fn load(body: &str) -> Result<SceneModel, String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(folder.path(), "scene.xml", &format!("<mujoco model=\"t\">\n<compiler angle=\"radian\"/>\n{body}</mujoco>"));
    SceneModel::load(folder.path()).map_err(|error| error.to_string())
}

fn world(inner: &str) -> Result<SceneModel, String> {
    load(&format!("<worldbody>\n{inner}\n</worldbody>"))
}

#[test]
fn nested_fixed_bodies_get_world_poses_and_free_bodies_swallow_their_children() {
    let scene = world(
        r#"<body name="table" pos="1 0 0" euler="0 0 1.5707963"><geom type="box" size="1 1 .1"/>
             <body name="tray" pos="0.5 0 0.2"><geom type="box" size=".1 .1 .1"/></body></body>
           <body name="mug" pos="0 0 1"><freejoint/><geom type="cylinder" size=".04 .05" mass=".25"/>
             <body name="handle" pos=".05 0 0"><geom type="box" size=".01 .01 .02" mass=".05"/></body></body>"#,
    )
    .expect("valid");
    let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["world", "table", "tray", "mug"]);
    let tray = scene.bodies[2].world_from_body * Point3::origin();
    assert!((tray - Point3::new(1.0, 0.5, 0.2)).norm() < 1e-6, "{tray}");
    let mug = &scene.bodies[3];
    assert_eq!((mug.motion, mug.geoms.len()), (BodyMotion::Free, 2));
    assert!((mug.mass_kg - 0.3).abs() < 1e-12);
    assert!((mug.geoms[1].body_from_geom.translation.vector - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-12);
    assert_eq!(scene.bodies[1].mass_kg, 0.0);
}

#[test]
fn masses_come_from_inertial_then_mass_then_density() {
    let free = |inner: &str| format!("<body name=\"b\" pos=\"0 0 1\"><freejoint/>{inner}</body>");
    let mass = |inner: &str| world(&free(inner)).expect("valid").bodies[1].mass_kg;
    assert!((mass(r#"<geom type="box" size=".1 .1 .1"/>"#) - 8.0).abs() < 1e-9);
    assert!((mass(r#"<geom type="box" size=".1 .1 .1" density="100"/>"#) - 0.8).abs() < 1e-9);
    assert!((mass(r#"<geom type="box" size=".1 .1 .1" mass="2"/>"#) - 2.0).abs() < 1e-9);
    let inertial = r#"<inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/><geom type="box" size=".1 .1 .1" mass="2"/>"#;
    assert!((mass(inertial) - 3.0).abs() < 1e-9);
}

#[test]
fn shapes_frames_contact_and_visibility_follow_mjcf() {
    let scene = world(
        r#"<geom name="floor" type="plane" size="0 0 1" friction=".4 0.1"/>
           <geom name="rod" type="capsule" size=".05" fromto="0 0 1 0 0 2"/>
           <geom name="paint" type="box" size="1 1 .01" contype="0" conaffinity="0"/>
           <geom name="hull" type="sphere" size=".2" group="3"/>"#,
    )
    .expect("valid");
    let geoms = &scene.bodies[0].geoms;
    assert_eq!(geoms[0].shape, SceneShape::Plane { half_m: [0.0, 0.0] });
    assert_eq!(geoms[0].friction, 0.4);
    assert_eq!(geoms[1].shape, SceneShape::Capsule { radius_m: 0.05, half_length_m: 0.5 });
    assert!((geoms[1].body_from_geom.translation.z - 1.5).abs() < 1e-12);
    assert!(!geoms[2].collides && geoms[2].visible);
    assert!(geoms[3].collides && !geoms[3].visible);
}

#[test]
fn materials_textures_and_lights_are_read() {
    let scene = load(
        r#"<asset><texture name="check" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="8" height="8"/>
             <material name="tiles" texture="check" texrepeat="3 2" texuniform="true" rgba="1 1 1 1"/></asset>
           <worldbody><light directional="true" dir="0 0 -2" diffuse=".5 .5 .5"/><light pos="1 2 3" ambient=".1 .1 .1"/>
             <geom type="box" size="1 1 1" material="tiles"/><geom type="box" size="1 1 1" material="tiles" rgba="0 1 0 1"/>
             <geom type="box" size="1 1 1" rgba="0 0 1 .5"/></worldbody>"#,
    )
    .expect("valid");
    assert_eq!((scene.textures[0].rgb[0], scene.textures[0].rgb[4]), ([255, 0, 0], [0, 0, 255]));
    let material = |geom: usize| &scene.materials[scene.bodies[0].geoms[geom].material];
    assert_eq!((material(0).texture, material(0).texture_repeat), (Some(0), [3.0, 2.0]));
    assert_eq!(material(0).texture_span, TextureSpan::Metre);
    assert_eq!((material(1).texture, material(1).rgba), (Some(0), [0.0, 1.0, 0.0, 1.0]));
    assert_eq!((material(2).texture, material(2).rgba), (None, [0.0, 0.0, 1.0, 0.5]));
    assert_eq!(scene.lights[0].kind, LightKind::Directional { direction: -Vector3::z() });
    assert_eq!(scene.lights[1].kind, LightKind::Point { position: Point3::new(1.0, 2.0, 3.0) });
}

#[test]
fn meshes_come_from_obj_files_and_inline_vertices_with_scale() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    write(folder.path(), "tetra.obj", tetrahedron);
    let file = write(
        folder.path(),
        "scene.xml",
        r#"<mujoco><asset><mesh file="tetra.obj" scale="2 2 2"/>
             <mesh name="own" vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 2 1 0 1 3 0 3 2 1 2 3"/></asset>
           <worldbody><body name="t"><freejoint/><geom type="mesh" mesh="tetra" density="6"/></body></worldbody></mujoco>"#,
    );
    let scene = SceneModel::load(&file).expect("valid");
    assert_eq!(scene.meshes[0].indices.len(), 4);
    assert_eq!(scene.meshes[1].positions.len(), 4);
    // Volume of the doubled tetrahedron: 8 / 6 m3.
    assert!((scene.bodies[1].mass_kg - 8.0).abs() < 1e-5, "{}", scene.bodies[1].mass_kg);
}

#[test]
fn includes_of_any_root_are_inlined_and_errors_in_them_name_their_own_file_and_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let main = "<mujoco>\n<include file=\"sub/things.xml\"/>\n<worldbody><geom size=\"1\"/></worldbody></mujoco>";
    let file = write(folder.path(), "scene.xml", main);
    std::fs::create_dir(folder.path().join("sub")).expect("made");
    let things =
        "<mujocoinclude>\n<worldbody>\n<body name=\"a\"><geom size=\".1\"/></body>\n</worldbody></mujocoinclude>";
    write(folder.path(), "sub/things.xml", things);
    let scene = SceneModel::load(&file).expect("valid");
    assert_eq!(scene.bodies[1].name, "a");
    write(folder.path(), "sub/things.xml", &things.replace("size=\".1\"", "siez=\".1\""));
    let error = SceneModel::load(&file).expect_err("misspelt").to_string();
    assert!(error.contains("things.xml:3: unknown attribute `siez` in <geom>; did you mean `size`?"), "{error}");
    write(folder.path(), "sub/things.xml", "<x><include file=\"sub/things.xml\"/></x>");
    let error = SceneModel::load(&file).expect_err("a cycle").to_string();
    assert!(error.contains("things.xml:1:") && error.contains("includes itself"), "{error}");
}

#[test]
fn broken_scenes_say_where_and_what_was_expected() {
    // Lines 1 and 2 are <mujoco> and <compiler>, line 3 opens the world body.
    let cases = [
        (world("<body name=\"a\">"), "scene.xml:", "not well-formed XML"),
        (world("<body name=\"a\"/>\n<body name=\"a\"/>"), "scene.xml:5:", "body `a` exists already at"),
        (world("<geom size=\"-1\"/>"), "scene.xml:4:", "`size` of <geom> is `-1`; expected 1 to 3 numbers >= 0"),
        (world("<geom size=\"abc\"/>"), "scene.xml:4:", "expected 1 to 3 numbers >= 0"),
        (world("<geom type=\"box\" size=\"1 1\"/>"), "scene.xml:4:", "expected 3 positive numbers"),
        (world("<geom type=\"bix\" size=\"1 1 1\"/>"), "scene.xml:4:", "expected one of plane"),
        (world("<geom size=\"1\" material=\"oka\"/>"), "scene.xml:4:", "there is no material `oka`; known: none"),
        (world("<geom size=\"1\" class=\"x\"/>"), "scene.xml:4:", "there is no class `x`"),
        (world("<bdy name=\"a\"/>"), "scene.xml:4:", "unknown element `bdy` in <worldbody>; did you mean `body`?"),
        (world("<body name=\"a\"><freejoint/></body>"), "scene.xml:4:", "the free body `a` has no mass"),
        (world("<replicate count=\"3\"/>"), "scene.xml:4:", "<replicate> is not supported"),
        (world("<geom type=\"mesh\" mesh=\"m\"/>"), "scene.xml:4:", "there is no mesh `m`"),
        (
            world("<body name=\"a\"><body name=\"b\"><freejoint/><geom size=\"1\"/></body></body>"),
            "scene.xml:4:",
            "free joint of the nested body `b`",
        ),
        (load("<asset><mesh file=\"no.obj\"/></asset>"), "scene.xml:3:", "no.obj` does not exist"),
        (load("<asset><texture name=\"t\" type=\"2d\" file=\"no.png\"/></asset>"), "scene.xml:3:", "the texture file"),
        (load("<asset><material name=\"m\" texture=\"t\"/></asset>"), "scene.xml:3:", "there is no texture `t`"),
        (load("<include file=\"no.xml\"/>"), "scene.xml:3:", "the include file"),
        (load("<compiler angel=\"radian\"/>"), "scene.xml:3:", "did you mean `angle`?"),
        (load("<worldbdy/>"), "scene.xml:3:", "did you mean `worldbody`?"),
    ];
    for (result, place, message) in cases {
        let error = result.expect_err(message);
        assert!(error.contains(place) && error.contains(message), "expected `{place} {message}`, got `{error}`");
    }
    let error = SceneModel::load(Path::new("/nowhere/scene.xml")).expect_err("missing").to_string();
    assert!(error.contains("cannot be read") && error.contains("expected an MJCF scene"), "{error}");
}

#[test]
fn a_truncated_picture_or_mesh_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(folder.path(), "t.png", "no picture");
    write(folder.path(), "m.obj", "v 0 0 0\nf 1 2 9\n");
    let scene = |asset: &str| {
        let text = format!("<mujoco><asset>\n{asset}</asset></mujoco>");
        SceneModel::load(&write(folder.path(), "scene.xml", &text)).expect_err("broken").to_string()
    };
    let error = scene("<texture name=\"t\" type=\"2d\" file=\"t.png\"/>");
    assert!(error.contains("scene.xml:2:") && error.contains("expected an 8-bit or 16-bit PNG"), "{error}");
    let error = scene("<mesh file=\"m.obj\"/>");
    assert!(error.contains("scene.xml:2:") && error.contains("expected an OBJ, STL or MSH mesh"), "{error}");
}

#[test]
fn a_door_is_a_body_on_a_joint() {
    let scene = world(
        r#"<body name="cupboard" pos="1 0 0" euler="0 0 1.5707963"><geom type="box" size=".3 .3 .5"/>
             <body name="door" pos="-.3 -.32 0">
               <joint name="hinge" pos="0 .02 0" axis="0 0 1" range="-1.5 0" ref="-.5" damping="2" frictionloss=".3"
                 stiffness="4" springref="-.1" armature=".01"/>
               <geom type="box" size=".3 .01 .5" pos=".3 0 0" mass="5"/>
               <body name="knob" pos=".5 -.03 0"><geom type="box" size=".01 .03 .01" mass=".1"/></body></body></body>
           <body name="table"><geom type="box" size="1 1 .1"/></body>"#,
    )
    .expect("valid");
    // What moves comes last, whatever the file's order: the numbers of all others do not depend on it.
    let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["world", "cupboard", "table", "door"]);
    let door = &scene.bodies[3];
    assert_eq!((door.motion, door.geoms.len()), (BodyMotion::Jointed, 2));
    assert!((door.mass_kg - 5.1).abs() < 1e-12);
    let [joint] = &scene.joints[..] else { panic!("{:?}", scene.joints) };
    assert_eq!((joint.name.as_str(), joint.part, joint.carrier, joint.motion), ("hinge", 3, 1, JointMotion::Hinge));
    assert_eq!((joint.range, joint.reference), (Some([-1.5, 0.0]), -0.5));
    assert_eq!([joint.damping, joint.friction, joint.stiffness], [2.0, 0.3, 4.0]);
    assert_eq!([joint.spring_reference, joint.armature], [-0.1, 0.01]);
    assert!((scene.joint_position(joint) + 0.5).abs() < 1e-12);
    // It turns about its anchor.
    let anchor = |pose: Pose| pose * Point3::new(0.0, 0.02, 0.0);
    let moved = scene.bodies[1].world_from_body * joint.carrier_from_part(-1.5);
    assert!((anchor(moved) - anchor(door.world_from_body)).norm() < 1e-12);
    assert!((moved.rotation.angle_to(&door.world_from_body.rotation) - 1.0).abs() < 1e-9);
    // Held, it is a part of the cupboard.
    let held = scene.with_joints_held();
    assert_eq!((held.bodies.len(), held.bodies[1].geoms.len(), held.joints.len()), (3, 3, 0));
    let knob = held.bodies[1].world_from_body * held.bodies[1].geoms[2].body_from_geom * Point3::origin();
    assert!((knob - door.world_from_body * Point3::new(0.5, -0.03, 0.0)).norm() < 1e-12);
}

#[test]
fn joints_that_cannot_be_simulated_are_held_fast_and_reported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = |joints: &str, geom: &str, rest: &str| {
        format!(
            r#"<mujoco><worldbody><body name="cupboard"><geom size="1"/>
               <body name="door">{joints}<geom size=".1" {geom}/></body></body></worldbody>{rest}</mujoco>"#
        )
    };
    let hinge = "<joint name=\"hinge_1\" axis=\"0 0 1\"/>";
    for text in [
        text(&format!("{hinge}<joint type=\"slide\"/>"), "", ""),
        text("<joint name=\"hinge_1\" type=\"ball\"/>", "", ""),
        text(hinge, "", "<actuator><position joint=\"hinge_1\"/></actuator>"),
        text(hinge, "", "<tendon><fixed><joint joint=\"hinge_1\" coef=\"1\"/></fixed></tendon>"),
        text(hinge, "mass=\"0\"", ""),
        text(hinge, "contype=\"0\" conaffinity=\"0\"", ""),
    ] {
        let file = write(folder.path(), "scene.xml", &text);
        let (scene, notes) = SceneModel::load_with_notes(&file).expect("valid");
        let held: Vec<_> = notes.iter().filter(|note| note.effect == Effect::HeldFast).collect();
        assert_eq!((held[0].name.as_deref(), held[0].line), (Some("hinge_1"), Some(2)), "{text}");
        // The door is held fast: it is a part of the cupboard, with its geom, and no body of its own.
        assert_eq!((scene.bodies.len(), scene.joints.len()), (2, 0), "{text}");
        assert_eq!((scene.bodies[1].motion, scene.bodies[1].geoms.len()), (BodyMotion::Fixed, 2));
    }
}
