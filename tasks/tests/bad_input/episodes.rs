//! Episode files.

use crate::bench::{Bench, refuse};

const RUN: [&str; 2] = ["run", "episode.toml"];

fn episode(from: &str, to: &str) -> Bench {
    Bench::new().edit("episode.toml", from, to)
}

fn episode_of(bytes: impl AsRef<[u8]>) -> Bench {
    Bench::new().file("episode.toml", bytes)
}

fn disturbed(disturbance: &str) -> Bench {
    episode("object = \"apple_1\"", &format!("object = \"apple_1\"\n\n[[disturb]]\n{disturbance}"))
}

fn broken(fault: &str) -> Bench {
    episode("object = \"apple_1\"", &format!("object = \"apple_1\"\n\n[[fault]]\n{fault}"))
}

refuse! {
    episode_is_missing: Bench::new(), ["run", "nowhere.toml"], ["nowhere.toml", "No such file"];
    episode_is_a_folder: Bench::new().folder("episodes"), ["run", "episodes"], ["episodes", "directory"];
    episode_is_empty: episode_of(""), RUN, ["episode.toml:1:", "missing field"];
    episode_is_binary: episode_of([0, 159, 146, 150, 255, 254]), RUN, ["episode.toml", "UTF-8"];
    episode_is_latin1: episode_of(b"version = 1\nscene = \"k\xfcche.xml\"\n"), RUN, ["episode.toml", "UTF-8"];
    episode_breaks_off: episode("time_limit_s = 60", "time_limit_s ="), RUN, ["episode.toml:5:"];
    episode_key_is_misspelt: episode("time_limit_s", "time_limt_s"), RUN,
        ["episode.toml:5: unknown key `time_limt_s`; did you mean `time_limit_s`?"];
    step_key_is_misspelt: episode("command =", "comand ="), RUN,
        ["episode.toml:8: unknown key `step[0].comand`; did you mean `command`?"];
    expectation_key_is_misspelt: episode("object = ", "objct = "), RUN,
        ["episode.toml:12: unknown key `expect[0].objct`; did you mean `object`?"];
    episode_version_is_unknown: episode("version = 1", "version = 2"), RUN, ["episode.toml:1:", "version", "2"];
    episode_version_is_missing: episode("version = 1\n", ""), RUN, ["episode.toml:", "missing field `version`"];
    time_limit_is_too_long: episode("time_limit_s = 60", "time_limit_s = 1e9"), RUN,
        ["episode.toml:5: `time_limit_s` is 1e9; expected >= 1 and <= 36000"];
    seed_is_a_text: episode("seed = 1", "seed = \"one\""), RUN, ["episode.toml:4:", "expected u64"];
    seed_is_negative: episode("seed = 1", "seed = -1"), RUN, ["episode.toml:4: `seed` is -1; expected >= 0"];
    start_is_nan: episode("[[step]]", "[start]\nx_m = nan\ny_m = 0.0\n\n[[step]]"), RUN,
        ["episode.toml:8: `start.x_m` is nan; expected a finite number"];
    expectation_is_unknown: episode("object_lifted", "object_lifed"), RUN,
        ["episode.toml:11:", "\"object_lifed\"", "did you mean `object_lifted`?"];
    step_says_nothing: episode("command = \"Grasp the apple\"", ""), RUN,
        ["episode.toml:7:", "command = \"text\"", "skill = explore"];
    step_says_two_things: episode("command =", "skill = \"explore\"\ncommand ="), RUN, ["episode.toml:7:", "either command"];
    grasp_without_target: episode("command = \"Grasp the apple\"", "skill = \"grasp\""), RUN,
        ["episode.toml:7:", "target = \"text\""];
    skill_is_unknown: episode("command = \"Grasp the apple\"", "skill = \"gasp\"\ntarget = \"apple\""), RUN,
        ["episode.toml:8:", "\"gasp\"", "did you mean `grasp`?"];
    no_step: episode("[[step]]\ncommand = \"Grasp the apple\"\n", ""), RUN, ["episode.toml:", "at least one [[step]]"];
    expectation_without_object: episode("object = \"apple_1\"\n", ""), RUN, ["episode.toml:10:", "object for this kind"];
    expected_height_is_too_high: episode("object = \"apple_1\"", "object = \"apple_1\"\nheight_m = 20"), RUN,
        ["episode.toml:13: `expect[0].height_m` is 20; expected >= 0.01 and <= 2"];
    expected_body_is_unknown: episode("object = \"apple_1\"", "object = \"aple_1\""), RUN,
        ["episode.toml:12: body `aple_1` is not in the scene; did you mean `apple_1`?"];
    expected_room_is_unknown:
        episode("kind = \"object_lifted\"\nobject = \"apple_1\"", "kind = \"robot_near\"\nroom = \"kitchn\""), RUN,
        ["episode.toml:12: room `kitchn` is not in the scene; did you mean `kitchen`?"];
    disturbance_without_start: disturbed("kind = \"light_off\""), RUN,
        ["episode.toml:14:", "one of at_s, on and within_m says when it begins"];
    disturbance_with_two_starts: disturbed("kind = \"light_off\"\nat_s = 3\non = \"lifts\""), RUN, ["episode.toml:14:", "one of"];
    disturbance_is_unknown: disturbed("kind = \"light_of\"\nat_s = 3"), RUN,
        ["episode.toml:15:", "\"light_of\"", "did you mean `light_off`?"];
    disturbance_key_is_misspelt: disturbed("kind = \"light_off\"\nats = 3"), RUN,
        ["episode.toml:16: unknown key `disturb[0].ats`; did you mean `at_s`?"];
    disturbance_share_is_too_large: disturbed("kind = \"frames\"\nat_s = 3\nshare = 1.0"), RUN,
        ["episode.toml:17: `disturb[0].share` is 1.0; expected >= 0 and <= 0.95"];
    disturbance_of_nothing: disturbed("kind = \"slip\"\non = \"lifts\""), RUN, ["episode.toml:14:", "object = \"body\""];
    disturbed_body_is_unknown: disturbed("kind = \"slip\"\non = \"lifts\"\nobject = \"aple_1\""), RUN,
        ["episode.toml:17: free body `aple_1` is not in the scene; did you mean `apple_1`?"];
    fault_is_unknown: broken("kind = \"joint_nan\"\nat_s = 3"), RUN,
        ["episode.toml:15:", "\"joint_nan\"", "did you mean `joints_nan`?"];
    fault_key_is_misspelt: broken("kind = \"estop\"\natt_s = 3"), RUN,
        ["episode.toml:16: unknown key `fault[0].att_s`; did you mean `at_s`?"];
    fault_without_time: broken("kind = \"estop\""), RUN, ["episode.toml:14:", "missing field `at_s`"];
    fault_without_part: broken("kind = \"joints_nan\"\nat_s = 3"), RUN, ["episode.toml:14:", "`part` for this kind"];
    fault_of_another_part: broken("kind = \"joints_nan\"\nat_s = 3\npart = \"base\""), RUN,
        ["episode.toml:14:", "part = arm or head"];
    fault_share_is_too_large: broken("kind = \"frames_lost\"\nat_s = 3\nshare = 1.5"), RUN,
        ["episode.toml:17: `fault[0].share` is 1.5; expected >= 0.05 and <= 1"];
    scene_of_episode_is_missing: episode("scene.xml", "scenes.xml"), RUN, ["scenes.xml", "MJCF"];
    robot_of_episode_is_unknown: episode("porter", "butler"), RUN, ["robot `butler`", "porter"];
    suite_with_a_broken_episode: Bench::new().file("episodes/broken.toml", "version = 1\nscen = \"x\"\n"), ["suite", "episodes"],
        ["broken.toml:2: unknown key `scen`; did you mean `scene`?"];
    suite_in_a_broken_scene: Bench::new().edit("scene.xml", "material=\"red\"", "material=\"rad\""), ["suite", "episode.toml"],
        ["scene.xml:10: there is no material `rad`"];
    config_of_a_broken_episode: episode("seed = 1", "sed = 1"), ["config", "show", "episode.toml"],
        ["episode.toml:4: unknown key `sed`; did you mean `seed`?"];
}
