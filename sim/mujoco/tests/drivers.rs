//! Contract: the drivers of the simulated robot behave on MuJoCo as drivers have to, bare and within the envelope.

#[path = "../../tests/blocks/mod.rs"]
mod blocks;
#[path = "../../tests/drivers/mod.rs"]
mod drivers;

use blocks::{floor, porter, porter_model, start};
use drivers::{robot_on, trials};
use dsm_robot::safety::Envelope;
use dsm_sim_mujoco::{MujocoConfig, MujocoPhysics};
use std::sync::Arc;

#[test]
fn the_drivers_of_mujoco_behave_bare_and_within_the_envelope() {
    let robot = || {
        let physics = MujocoPhysics::new(&floor(), &porter(), &start("carry", 0.08), MujocoConfig::default());
        robot_on(Box::new(physics.expect("a valid world")), &porter_model())
    };
    trials(&mut robot(), &porter_model());
    let model = Arc::new(porter_model());
    trials(&mut Envelope::new(robot(), &model), &model);
}
