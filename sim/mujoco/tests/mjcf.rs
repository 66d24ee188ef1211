//! Contract: MJCF files that others wrote work on MuJoCo as they do on rapier.

#[path = "../../tests/others/mod.rs"]
mod others;

use dsm_sim_mujoco::Mujoco;

#[test]
fn files_of_others_work_or_say_where_they_are_wrong() {
    if let Some(scenes) = others::survey_all("mjcf on MuJoCo", &Mujoco::default()) {
        others::check(&scenes);
    }
}
