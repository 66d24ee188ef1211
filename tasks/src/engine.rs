//! The physics engines that this program was built with.

use crate::cli::PhysicsChoice;
use crate::error::TaskError;
use clap::ValueEnum;
use dsm_sim::physics::{Engine, Rapier};
use std::sync::Arc;

/// The engine of a name.
///
/// # Errors
/// [`TaskError::NotBuiltIn`] for an engine that the program was built without, [`TaskError::Usage`] for an unknown one.
pub fn find_engine(name: &str) -> Result<Arc<dyn Engine>, TaskError> {
    match PhysicsChoice::from_str(name, false) {
        Ok(PhysicsChoice::Rapier) => Ok(Arc::new(Rapier::default())),
        Ok(PhysicsChoice::Mujoco) => mujoco(),
        Err(_) => Err(TaskError::Usage(format!("physics is `{name}`; expected rapier or mujoco"))),
    }
}

#[cfg(feature = "mujoco")]
fn mujoco() -> Result<Arc<dyn Engine>, TaskError> {
    Ok(Arc::new(dsm_sim_mujoco::Mujoco::default()))
}

#[cfg(not(feature = "mujoco"))]
fn mujoco() -> Result<Arc<dyn Engine>, TaskError> {
    Err(TaskError::NotBuiltIn {
        feature: "physics `mujoco`".into(),
        hint: "build it with `export \"$(sim/mujoco/fetch.sh)\" && cargo build --release --features mujoco`; this \
               program has rapier only"
            .into(),
    })
}
