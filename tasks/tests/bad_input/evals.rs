//! Measuring maps.

use crate::bench::{Bench, refuse};

const EVAL: [&str; 4] = ["eval", "map", "scene.xml", "--drives=drives"];

refuse! {
    scene_to_measure_is_missing: Bench::new().without("scene.xml"), EVAL, ["scene.xml", "cannot be read", "expected an MJCF scene"];
    scene_to_measure_is_broken: Bench::new().edit("scene.xml", "material=\"red\"", "material=\"rad\""), EVAL,
        ["scene.xml:10: there is no material `rad`; did you mean `red`?"];
    recorded_drive_is_garbage: Bench::new().folder("drives").file("drives/scene-0.json", "{\n\"version\": x}"), EVAL,
        ["drives/scene-0.json", "not a recorded drive", "line 2"];
    recorded_drive_is_of_another_version: Bench::new().folder("drives")
        .file("drives/scene-0.json", "{\"version\": 9, \"scene\": \"scene\", \"seed\": 0, \"moments\": []}"), EVAL,
        ["drives/scene-0.json", "version 9", "expected 1"];
    recorded_drive_is_of_another_scene: Bench::new().folder("drives")
        .file("drives/scene-0.json", "{\"version\": 1, \"scene\": \"flat\", \"seed\": 0, \"moments\": []}"), EVAL,
        ["drives/scene-0.json", "a drive of flat with seed 0"];
    pose_noise_is_a_word: Bench::new(), ["eval", "map", "scene.xml", "--pose-noise-cm", "1,much"],
        ["--pose-noise-cm", "expected centimetres"];
    ablation_is_unknown: Bench::new(), ["eval", "map", "scene.xml", "--ablate", "windw"], ["windw", "window"];
}
