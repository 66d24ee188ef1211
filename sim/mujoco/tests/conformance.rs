//! Contract: MuJoCo is an engine as every engine has to be, and refuses parameters out of range.

#![allow(clippy::unwrap_used, reason = "a failing step fails the test")]

#[path = "../../tests/blocks/mod.rs"]
mod blocks;
#[path = "../../tests/conformance/mod.rs"]
mod conformance;

use blocks::{floor, porter, start};
use dsm::time::Span;
use dsm_sim::physics::{Physics, PhysicsError};
use dsm_sim::scene::{SceneModel, scene_file};
use dsm_sim_mujoco::{Mujoco, MujocoConfig, MujocoPhysics};
use std::path::Path;

conformance::conformance!(Mujoco::default());

#[test]
fn parameters_out_of_range_are_refused() {
    let refuse =
        |config| MujocoPhysics::new(&floor(), &porter(), &start("carry", 0.08), config).err().expect("refused");
    let config = MujocoConfig::default();
    for config in [
        MujocoConfig { step: Span::from_s(0.02), ..config },
        MujocoConfig { friction_stiffness: 0.0, ..config },
        MujocoConfig { sleep_below_m_per_s: 1.0, ..config },
    ] {
        assert!(matches!(refuse(config), PhysicsError::OutOfRange { .. }));
    }
}

#[test]
fn what_lies_still_in_a_home_sleeps_within_two_seconds() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scene = SceneModel::load(&scene_file(&root.join("scenes/apartment"))).unwrap();
    let mut world = MujocoPhysics::new(&scene, &porter(), &start("carry", 0.08), MujocoConfig::default()).unwrap();
    assert!(world.copy_of_data().ffi().ntree_awake > 30, "all things are free to move at first");
    (0..400).for_each(|_| world.step());
    assert_eq!(world.copy_of_data().ffi().ntree_awake, 1, "the robot alone never sleeps");
}
