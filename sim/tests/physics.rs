//! Contract: rapier is an engine as every engine has to be, and refuses parameters out of range.

mod blocks;
mod conformance;

use blocks::{floor, porter, start};
use dsm::time::Span;
use dsm_sim::physics::{PhysicsConfig, PhysicsError, Rapier, RapierPhysics};

conformance::conformance!(Rapier::default());

#[test]
fn parameters_out_of_range_are_refused() {
    let refuse =
        |config| RapierPhysics::new(&floor(), &porter(), &start("carry", 0.08), config).err().expect("refused");
    let config = PhysicsConfig::default();
    for config in [
        PhysicsConfig { step: Span::from_s(0.02), ..config },
        PhysicsConfig { solver_iterations: 0, ..config },
        PhysicsConfig { sweeps: 9, ..config },
    ] {
        assert!(matches!(refuse(config), PhysicsError::OutOfRange { .. }));
    }
}
