//! Contract: what people write in MJCF is read as MuJoCo reads it, and what is not simulated is said with its line.

mod others;

use dsm_sim::physics::Rapier;
use dsm_sim::scene::{
    BodyMotion, Effect, Outcome, SceneModel, SceneNote, Semantics, Stage, TextureSpan, scene_file, survey_scene,
};
use nalgebra::{Point3, Vector3};
use std::path::{Path, PathBuf};

fn write(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let file = folder.join(name);
    std::fs::create_dir_all(file.parent().expect("a folder")).expect("made");
    std::fs::write(&file, bytes).expect("written");
    file
}

fn load(body: &str) -> (SceneModel, Vec<SceneNote>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(folder.path(), "scene.xml", format!("<mujoco>\n{body}\n</mujoco>"));
    SceneModel::load_with_notes(folder.path()).expect("valid")
}

/// Elements with their effects, in the order of the file.
fn effects(notes: &[SceneNote]) -> Vec<(&str, Effect)> {
    notes.iter().map(|note| (note.element.as_str(), note.effect)).collect()
}

const BALL: &str = "<freejoint/><geom size=\".1\"/>";

/// A triangle with texture coordinates in MuJoCo's binary format.
fn msh() -> Vec<u8> {
    let mut bytes: Vec<u8> = [3_i32, 0, 3, 1].iter().flat_map(|v| v.to_le_bytes()).collect();
    let numbers = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25];
    bytes.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend([0_i32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

#[test]
fn meshes_of_all_formats_count_texture_rows_from_the_top() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(folder.path(), "m/a.MSH", msh());
    write(folder.path(), "m/b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.25\nf 1/1 2/2 3/3\n");
    let text = r#"<mujoco><compiler meshdir="m"/><asset><mesh file="a.MSH" scale="2 1 1"/><mesh file="b.obj"/>
        <mesh name="c" vertex="0 0 0 1 0 0 0 1 0" texcoord="0 0 1 0 0 .25" face="0 1 2"/></asset>
        <worldbody><geom type="mesh" mesh="a"/><geom type="mesh" mesh="b"/><geom type="mesh" mesh="c"/></worldbody></mujoco>"#;
    let scene = SceneModel::load(&write(folder.path(), "scene.xml", text)).expect("valid");
    assert_eq!(scene.meshes[0].positions[1], Point3::new(2.0, 0.0, 0.0));
    // MSH and MJCF count as the pictures are stored, OBJ from the bottom.
    let third = |mesh: usize| scene.meshes[mesh].uvs[2];
    assert_eq!((third(0), third(1), third(2)), ([0.0, 0.25], [0.0, 0.75], [0.0, 0.25]));
}

#[test]
fn a_broken_msh_file_is_refused_with_its_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(folder.path(), "a.msh", &msh()[..20]);
    let text = "<mujoco><asset>\n<mesh file=\"a.msh\"/></asset></mujoco>";
    let error = SceneModel::load(&write(folder.path(), "scene.xml", text)).expect_err("broken").to_string();
    assert!(error.contains("scene.xml:2:") && error.contains("its counts ask for"), "{error}");
}

#[test]
fn cubes_layers_and_classes_decide_how_materials_look() {
    let (scene, _) = load(
        r#"<default><default class="shiny"><material specular="1" texuniform="true" texrepeat="4 5"/></default></default>
        <asset><texture name="flat" type="2d" builtin="flat" rgb1="1 0 0" width="4" height="4"/>
          <texture name="wrapped" builtin="flat" rgb1="0 1 0" width="4" height="4"/>
          <material name="classed" class="shiny" texture="flat"/>
          <material name="cube" texture="wrapped" texrepeat="3 3" texuniform="true"/>
          <material name="layered"><layer role="normal" texture="flat"/><layer role="rgb" texture="wrapped"/></material>
        </asset>"#,
    );
    let [classed, cube, layered] = &scene.materials[..] else { panic!("{:?}", scene.materials) };
    assert_eq!((classed.specular, classed.texture_repeat), (1.0, [4.0, 5.0]));
    assert_eq!(classed.texture_span, TextureSpan::Metre);
    // A cube is MuJoCo's default, and is never repeated.
    assert_eq!((cube.texture_span, cube.texture_repeat, cube.texture), (TextureSpan::Cube, [1.0; 2], Some(1)));
    assert_eq!(layered.texture, Some(1));
}

#[test]
fn parts_name_their_own_parts_beside_themselves_or_beside_the_main_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let main = "<mujoco><include file=\"kitchen/all.xml\"/></mujoco>";
    let file = write(folder.path(), "scene.xml", main);
    let all = "<any><worldbody><include file=\"kettle.xml\"/><include file=\"kitchen/oven.xml\"/></worldbody></any>";
    write(folder.path(), "kitchen/all.xml", all);
    for thing in ["kettle", "oven"] {
        let text = format!("<x><body name=\"{thing}\"><geom size=\"1\"/></body></x>");
        write(folder.path(), &format!("kitchen/{thing}.xml"), text);
    }
    let scene = SceneModel::load(&file).expect("valid");
    let names: Vec<&str> = scene.bodies.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(names, ["world", "kettle", "oven"]);
}

#[test]
fn kinds_exclusions_and_ties_are_read() {
    let (scene, notes) = load(&format!(
        r#"<default><geom contype="4"/></default>
        <worldbody><body name="a">{BALL}</body><body name="post" pos="1 0 0"><geom size=".1" conaffinity="6"/>
          <body name="hook" pos="0 0 1"><geom size=".1"/></body></body>
          <body name="b" pos="1 0 2">{BALL}</body></worldbody>
        <contact><exclude body1="b" body2="a"/></contact>
        <equality><weld body1="b" body2="hook"/><connect body1="a" anchor="0 0 .5"/>
          <weld body1="a" body2="b" active="false"/><weld body1="post" body2="hook"/>
          <weld site1="s" site2="t"/></equality>"#
    ));
    let bits = |body: usize| (scene.bodies[body].geoms[0].kinds, scene.bodies[body].geoms[0].touches);
    assert_eq!((bits(1), bits(2)), ((4, 1), (4, 6)));
    let index = |name: &str| scene.bodies.iter().position(|body| body.name == name).expect("it exists");
    assert_eq!(scene.excluded, [[index("a"), index("b")]]);
    // What is off, and what cannot move anyway, is no tie.
    let [weld, connect] = &scene.ties[..] else { panic!("{:?}", scene.ties) };
    assert_eq!((weld.bodies, weld.rigid), ([index("b"), index("hook")], true));
    // Held as they stand: the ball's middle is a metre above the hook.
    let meet = weld.body_from_tie[0].inverse_transform_point(&Point3::origin());
    assert!((weld.body_from_tie[1] * meet - Point3::new(0.0, 0.0, 1.0)).norm() < 1e-9);
    assert_eq!((connect.bodies, connect.rigid), ([index("a"), 0], false));
    assert_eq!(connect.body_from_tie.map(|pose| pose.translation.z), [0.5, 0.5]);
    assert_eq!(effects(&notes), [("equality/weld", Effect::NotConstrained)]);
}

#[test]
fn a_written_inertia_is_kept_unless_the_geoms_are_to_weigh() {
    let free = |compiler: &str| {
        let body = "<freejoint/><inertial pos=\".1 0 0\" mass=\"2\" diaginertia=\".3 .2 .1\"/><geom size=\".1\"/>";
        load(&format!("{compiler}<worldbody><body name=\"a\">{body}</body></worldbody>")).0.bodies.remove(1)
    };
    let body = free("");
    let spread = body.spread.expect("it is written");
    assert_eq!((body.mass_kg, spread.center_in_body), (2.0, Point3::new(0.1, 0.0, 0.0)));
    assert!((spread.inertia_kg_m2.diagonal() - Vector3::new(0.3, 0.2, 0.1)).norm() < 1e-12);
    let body = free("<compiler inertiafromgeom=\"true\"/>");
    assert!(body.spread.is_none() && (body.mass_kg - 4.18879).abs() < 1e-4, "{}", body.mass_kg);
    let (scene, _) = load(
        r#"<compiler inertiagrouprange="2 3"/><worldbody><body name="a"><freejoint/>
        <geom size=".1" group="1" mass="7"/><geom size=".1" group="2" mass="3"/></body></worldbody>"#,
    );
    assert_eq!(scene.bodies[1].mass_kg, 3.0);
}

#[test]
fn what_is_not_simulated_is_said_with_its_line() {
    let (scene, notes) = load(
        r#"<option gravity="0 0 -1"/>
<worldbody><body name="door"><joint name="hinge" axis="0 0 1"/><geom size=".1"/></body>
<body name="marker"><freejoint/><geom size=".1" contype="0" conaffinity="0"/></body>
<body name="hand" mocap="true"><site name="grip" type="mesh"/></body>
<light mode="trackcom"/></worldbody>
<actuator><motor name="m" joint="hinge"/></actuator>
<tendon><fixed name="f"><joint joint="hinge" coef="1"/></fixed><spatial name="s"/></tendon>
<equality><joint joint1="hinge"/></equality>
<sensor><jointpos joint="hinge"/></sensor>
<contact><pair geom1="a" geom2="b"/></contact>
<keyframe><key qpos="0"/></keyframe>"#,
    );
    // A marker that touches nothing would fall for ever.
    assert_eq!(scene.bodies.iter().filter(|body| body.motion == BodyMotion::Free).count(), 0);
    let expected = [
        ("option", Effect::OtherValue, 2),
        ("joint", Effect::HeldFast, 3),
        ("body", Effect::StandsStill, 5),
        ("light", Effect::StandsStill, 6),
        ("actuator/motor", Effect::NoJoints, 7),
        ("tendon/fixed", Effect::NoJoints, 8),
        ("tendon/spatial", Effect::NotConstrained, 8),
        ("equality/joint", Effect::NoJoints, 9),
        ("sensor/jointpos", Effect::NotRead, 10),
        ("contact/pair", Effect::NotRead, 11),
        ("keyframe/key", Effect::NotRead, 12),
        ("body", Effect::TouchesNothing, 4),
    ];
    let found: Vec<_> = notes.iter().map(|n| (n.element.as_str(), n.effect, n.line.expect("a line"))).collect();
    assert_eq!(found, expected);
    let text = notes[1].to_string();
    assert!(text.contains("scene.xml:3: <joint> `hinge` is held fast"), "{text}");
    assert!(load("<option gravity=\"0 0 -9.81\" timestep=\".002\"/><worldbody/>").1.is_empty());
}

#[test]
fn shapes_for_authors_are_hidden_where_others_show_the_thing() {
    let eye = "contype=\"0\" conaffinity=\"0\" group=\"1\"";
    let cube = "type=\"box\" size=\".1 .1 .1\"";
    let visible = |geoms: &str| {
        let (scene, _) = load(&format!("<worldbody><body name=\"a\">{geoms}</body></worldbody>"));
        scene.bodies[1].geoms.iter().map(|geom| geom.visible).collect::<Vec<_>>()
    };
    // See-through, without a colour, or a twin of what is seen.
    assert_eq!(visible(&format!("<geom size=\".1\" {eye}/><geom {cube} rgba=\".8 .8 .8 .3\"/>")), [true, false]);
    assert_eq!(visible(&format!("<geom size=\".1\" {eye}/><geom {cube}/>")), [true, false]);
    assert_eq!(visible(&format!("<geom {cube} {eye}/><geom {cube} rgba=\"1 0 0 1\"/>")), [true, false]);
    // A coloured shape beside a decoration is the thing itself, and so is one that stands alone.
    assert_eq!(visible(&format!("<geom size=\".1\" {eye}/><geom {cube} rgba=\"1 0 0 1\"/>")), [true, true]);
    assert_eq!(visible(&format!("<geom {cube} rgba=\".8 .8 .8 .3\"/>")), [true]);
}

#[test]
fn one_object_without_a_floor_is_surveyed_and_named_by_its_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = r#"<mujoco model="red_coffee_mug"><worldbody><body><body name="object">
        <geom type="cylinder" size=".04 .05"/></body></body></worldbody></mujoco>"#;
    let file = write(folder.path(), "mug.xml", text);
    let (survey, frame) = survey_scene(&file, &Rapier::default());
    assert_eq!((survey.outcome, survey.geoms), (Outcome::Works, 1));
    assert_eq!(survey.categories.iter().map(String::as_str).collect::<Vec<_>>(), ["mug"]);
    // The mug fills a good part of the picture.
    let frame = frame.expect("it is drawn");
    assert_eq!(frame.rgb.len(), 640 * 480);
    assert!((0.1..0.9).contains(&survey.seen), "{}", survey.seen);
    let scene = SceneModel::load(&file).expect("valid");
    assert_eq!(Semantics::load(&scene_file(&file), &scene).expect("valid").objects.len(), 1);
}

#[test]
fn parts_and_faults_are_told_apart() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let outcome = |text: &str| survey_scene(&write(folder.path(), "a.xml", text), &Rapier::default()).0;
    assert_eq!(outcome("<mujocoinclude><body/></mujocoinclude>").outcome, Outcome::Part);
    assert_eq!(outcome("<mujoco><body/></mujoco>").outcome, Outcome::Part);
    let fails = outcome("<mujoco><worldbody><geom size=\"x\"/></worldbody></mujoco>");
    assert_eq!(fails.outcome, Outcome::Fails(Stage::Load));
    assert!(fails.reason.expect("a reason").contains("a.xml:1: `size` of <geom> is `x`"));
}

#[test]
fn files_of_others_work_or_say_where_they_are_wrong() {
    if let Some(scenes) = others::survey_all("mjcf", &Rapier::default()) {
        others::check(&scenes);
    }
}
