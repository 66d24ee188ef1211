//! Flags, environment variables and output folders.

use crate::bench::{Bench, refuse};
use std::net::TcpListener;

refuse! {
    unknown_command: Bench::new(), ["fly", "episode.toml"], ["unrecognized subcommand 'fly'", "Usage: dsm"];
    unknown_flag: Bench::new(), ["run", "episode.toml", "--sed", "3"], ["unexpected argument '--sed'", "'--seed'"];
    missing_argument: Bench::new(), ["ground", "map.dsm"], ["required arguments", "<TEXT>"];
    no_thread: Bench::new(), ["run", "episode.toml", "--threads", "0"], ["'0' for '--threads", "1..=256"];
    negative_seed: Bench::new(), ["run", "episode.toml", "--seed=-3"], ["'-3' for '--seed", "invalid digit"];
    view_port_is_no_number: Bench::new(), ["run", "episode.toml", "--view=http"], ["'http' for '--view", "invalid digit"];
    endless_time: Bench::new(), ["run", "episode.toml", "--time-limit-s", "nan"],
        ["time_limit_s is NaN", "expected 1 to 36000 seconds"];
    no_time: Bench::new(), ["run", "episode.toml", "--time-limit-s", "0"],
        ["time_limit_s is 0", "expected 1 to 36000 seconds"];
    unknown_physics: Bench::new(), ["run", "episode.toml", "--physics", "bullet"],
        ["'bullet' for '--physics", "possible values: rapier, mujoco"];
    physics_not_built_in: Bench::new(), ["run", "episode.toml", "--physics", "mujoco"],
        ["physics `mujoco` is not built in", "--features mujoco"];
    unknown_perception: Bench::new(), ["run", "episode.toml", "--perception", "perfect"],
        ["'perfect' for '--perception", "possible values: noisy, oracle, pixels"];
    unknown_robot: Bench::new(), ["run", "episode.toml", "--robot", "portr"],
        ["robot `portr`", "expected the path of a robot.toml, or one of: porter"];
    unknown_robot_to_check: Bench::new(), ["robot", "check", "butler"], ["robot `butler`", "one of: porter"];
    unknown_schema: Bench::new(), ["schema", "sumary"], ["'sumary'", "episode, robot, semantics, summary"];
    seed_variable_is_no_number: Bench::new().variable("DSM_SEED", "one"), ["run", "episode.toml"],
        ["environment variable DSM_SEED is `one`"];
    perception_variable_is_unknown: Bench::new().variable("DSM_PERCEPTION", "perfect"), ["run", "episode.toml"],
        ["perception is `perfect`; expected noisy, oracle or pixels"];
    threads_variable_is_zero: Bench::new().variable("DSM_THREADS", "0"), ["run", "episode.toml"],
        ["threads is 0; expected 1 to 256"];
    seeds_run_backwards: Bench::new(), ["suite", "episode.toml", "--seeds", "9..2"],
        ["expected A..B with A < B, for example 0..10, got `9..2`"];
    seeds_are_no_range: Bench::new(), ["suite", "episode.toml", "--seeds", "ten"], ["expected A..B", "got `ten`"];
    suite_of_no_generated_episode: Bench::new(), ["suite", "--generate", "0"], ["'0' for '--generate", "1..=10000"];
    suite_of_files_and_generated_homes: Bench::new(), ["suite", "episode.toml", "--generate", "2"],
        ["--generate", "cannot be used with"];
    suite_without_anything: Bench::new(), ["suite"], ["required arguments", "PATHS"];
    home_without_rooms: Bench::new(), ["scene", "generate", "--rooms", "0", "--out", "home"],
        ["rooms is 0; expected 1 to 12"];
    home_with_too_much_in_it: Bench::new(), ["scene", "generate", "--rooms", "1", "--objects", "600", "--out", "home"],
        ["1 rooms hold", "objects at most", "ask for fewer objects or more rooms"];
    home_over_other_files: Bench::new().file("home/notes.txt", "mine"), ["scene", "generate", "--out", "home"],
        ["home: the folder is not empty", "--force"];
    layout_is_missing: Bench::new(), ["scene", "import", "plan.json", "--out", "room"], ["plan.json: No such file"];
    layout_is_no_layout: Bench::new().file("plan.json", "{\n\"scene_id\": 3}"),
        ["scene", "import", "plan.json", "--out", "room"], ["plan.json:2: invalid type: integer `3`, expected a string"];
    layout_is_empty: Bench::new().file("plan.json", "{\"scene_id\": \"a\", \"objects\": []}"),
        ["scene", "import", "plan.json", "--out", "room"], ["plan.json: the layout has no objects"];
    suite_of_nothing: Bench::new().folder("empty"), ["suite", "empty"],
        ["no episode found; expected files, or folders that hold episodes/*.toml"];
    suite_path_is_missing: Bench::new(), ["suite", "nowhere"], ["nowhere: no such file or folder"];
    suite_to_compare_is_missing: Bench::new(), ["suite-compare", "a", "b"], ["a: No such file"];
    suites_have_nothing_in_common: Bench::new()
            .file("a/suite.json", "{\"schema\": 1, \"episodes\": []}")
            .file("b/suite.json", "{\"schema\": 1, \"episodes\": []}"),
        ["suite-compare", "a", "b"], ["a and b have no episode and seed in common"];
    suite_of_another_layout: Bench::new().file("a/suite.json", "{\"schema\": 2, \"episodes\": []}"), ["suite-page", "a"],
        ["a/suite.json:1: schema 2 is not known; expected 1"];
    suite_without_episodes: Bench::new().file("a/suite.json", "{\n\"schema\": 1}"), ["suite-page", "a"],
        ["a/suite.json:2: missing field `episodes`"];
    output_folder_is_in_use: Bench::new().file("results/notes.txt", "mine"), ["run", "episode.toml", "--out", "results"],
        ["results: the folder is not empty", "--force"];
    output_folder_is_a_file: Bench::new().file("results", "mine"), ["run", "episode.toml", "--out", "results"],
        ["results: is a file; --out needs a folder"];
}

#[test]
fn view_port_is_in_use() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let fragments = [format!("--view: 127.0.0.1:{port} cannot be used"), "in use".to_owned()];
    let fragments = [fragments[0].as_str(), fragments[1].as_str()];
    Bench::new().refuses(&["run", "episode.toml", &format!("--view={port}")], &fragments);
}
