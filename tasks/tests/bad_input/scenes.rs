//! Scenes and their semantics.

use crate::bench::{Bench, refuse};

const CHECK: [&str; 3] = ["scene", "check", "scene.xml"];
const RUN: [&str; 2] = ["run", "episode.toml"];
const EXPLORE: [&str; 2] = ["explore", "scene.xml"];

fn scene(from: &str, to: &str) -> Bench {
    Bench::new().edit("scene.xml", from, to)
}

fn semantics(from: &str, to: &str) -> Bench {
    Bench::new().edit("semantics.toml", from, to)
}

/// One more asset, and the apple's material replaced.
fn asset(element: &str) -> Bench {
    scene("<asset>", &format!("<asset>\n    {element}"))
}

refuse! {
    scene_is_missing: Bench::new().without("scene.xml"), CHECK, ["scene.xml", "cannot be read", "expected an MJCF scene"];
    scene_folder_without_scene: Bench::new().folder("flat"), ["scene", "check", "flat"],
        ["flat/scene.xml", "expected an MJCF scene"];
    scene_is_empty: Bench::new().file("scene.xml", ""), CHECK, ["scene.xml:1: not well-formed XML"];
    scene_is_binary: Bench::new().file("scene.xml", [0xff, 0xfe, 0, 1, 2]), CHECK, ["scene.xml", "UTF-8"];
    tag_is_not_closed: scene("</asset>", ""), CHECK, ["scene.xml:13: not well-formed XML", "mujoco"];
    scene_is_another_document: Bench::new().file("scene.xml", "<robot name=\"x\"/>"), CHECK,
        ["scene.xml:1:", "unknown element `robot`", "mujoco"];
    attribute_is_misspelt: scene("size=\"0.035\"", "siz=\"0.035\""), CHECK,
        ["scene.xml:10:", "unknown attribute `siz` in <geom>", "did you mean `size`?"];
    element_is_misspelt: scene("<freejoint/>", "<freejont/>"), CHECK,
        ["scene.xml:9:", "unknown element `freejont`", "did you mean `freejoint`?"];
    size_is_no_number: scene("size=\"0.035\"", "size=\"small\""), CHECK, ["scene.xml:10:", "`small`", "1 to 3 numbers >= 0"];
    size_is_negative: scene("size=\"0.035\"", "size=\"-0.035\""), CHECK, ["scene.xml:10:", "`-0.035`", ">= 0"];
    size_is_nan: scene("size=\"0.035\"", "size=\"nan\""), CHECK, ["scene.xml:10:", "`nan`"];
    size_is_incomplete: scene("size=\"0.3 0.3 0.2\"", "size=\"0.3 0.3\""), CHECK,
        ["scene.xml:7:", "size", "expected 3 positive numbers"];
    body_exists_twice: scene("table_1", "apple_1"), CHECK,
        ["scene.xml:8: body `apple_1` exists already at scene.xml:7", "unique name"];
    material_is_unknown: scene("material=\"red\"", "material=\"rad\""), CHECK,
        ["scene.xml:10: there is no material `rad`; did you mean `red`?"];
    mesh_is_missing: asset("<mesh name=\"m\" file=\"apple.obj\"/>"), CHECK,
        ["scene.xml:3: the mesh file", "apple.obj", "does not exist"];
    mesh_is_garbage: asset("<mesh name=\"m\" file=\"apple.obj\"/>").file("apple.obj", "not a mesh"), CHECK,
        ["scene.xml:3: the mesh file", "apple.obj", "expected"];
    texture_is_missing: asset("<texture name=\"t\" type=\"2d\" file=\"wood.png\"/>"), CHECK,
        ["scene.xml:3: the texture file", "wood.png", "does not exist"];
    texture_is_garbage: asset("<texture name=\"t\" type=\"2d\" file=\"wood.png\"/>").file("wood.png", "no picture"), CHECK,
        ["scene.xml:3: the texture file", "wood.png", "cannot be decoded", "expected"];
    include_is_missing: scene("<asset>", "<include file=\"more.xml\"/><asset>"), CHECK,
        ["scene.xml:2: the include file", "more.xml", "does not exist"];
    scene_includes_itself: scene("<asset>", "<include file=\"scene.xml\"/><asset>"), CHECK, ["scene.xml:2:", "includes itself"];
    free_body_weighs_nothing: scene("mass=\"0.18\"", "mass=\"0\""), CHECK, ["scene.xml:8:", "`apple_1` has no mass", "positive `mass`"];
    semantics_key_is_misspelt: semantics("category = \"apple\"", "categry = \"apple\""), CHECK,
        ["semantics.toml:17: unknown key `object[1].categry`; did you mean `category`?"];
    semantics_body_is_unknown: semantics("body = \"apple_1\"", "body = \"appel_1\""), CHECK,
        ["semantics.toml:16: there is no body `appel_1`; did you mean `apple_1`?"];
    semantics_body_stands_twice: semantics("body = \"table_1\"", "body = \"apple_1\""), CHECK,
        ["semantics.toml:16:", "`apple_1` exists already at semantics.toml:12"];
    placement_is_out_of_range: semantics("x_m = 0.05", "x_m = -0.05"), CHECK,
        ["semantics.toml:18: `object[1].placement.x_m` is -0.05; expected >= 0 and <= 5"];
    semantics_version_is_unknown: semantics("version = 1", "version = 7"), CHECK, ["semantics.toml:1: `version` is 7; expected"];
    room_has_two_corners: semantics("[[-3, -3], [3, -3], [3, 3], [-3, 3]]", "[[-3, -3], [3, 3]]"), CHECK,
        ["semantics.toml:9: `room[0].polygon`", "expected at least 3 values"];
    semantics_breaks_off: semantics("category = \"table\"", "category = \"table"), CHECK, ["semantics.toml:13:"];
    run_in_a_broken_scene: scene("material=\"red\"", "material=\"rad\""), RUN, ["scene.xml:10: there is no material `rad`"];
    exploring_a_broken_scene: scene("material=\"red\"", "material=\"rad\""), EXPLORE, ["scene.xml:10: there is no material `rad`"];
    run_with_broken_semantics: semantics("category = \"apple\"", "categry = \"apple\""), RUN, ["semantics.toml:17: unknown key"];
}
