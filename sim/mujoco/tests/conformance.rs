//! Contract: MuJoCo is an engine as every engine has to be, and refuses parameters out of range.

#[path = "../../tests/blocks/mod.rs"]
mod blocks;
#[path = "../../tests/conformance/mod.rs"]
mod conformance;

use blocks::{floor, porter, start};
use dsm::time::Span;
use dsm_sim::physics::PhysicsError;
use dsm_sim_mujoco::{Mujoco, MujocoConfig, MujocoPhysics};

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
