//! MuJoCo as an engine of the simulated world: the same scenes, the same robot, the same [`Physics`] as rapier's.
//!
//! ```text
//! SceneModel ─┐
//! RobotBody  ─┴─compose (mjSpec)──▶ model ──▶ MujocoPhysics ──step──▶ poses, joint states, contacts
//! ```
//!
//! The robot stands in the model as one tree: three joints move its base over the floor, each driven by a force-limited
//! motor, and its own joints hang below. Motors, set points and limits are those of [`dsm_sim::physics::Motors`]. What
//! the gripper holds, it holds by friction.
//!
//! [`draw`] and [`cast_rays`] look at a scene with MuJoCo's own renderer and its rays, so that ours can be held against
//! them.
//!
//! Invariants: the same inputs give the same bytes; reading never changes the world; a world that diverges is never put
//! back to its start. The crate does not know what a map or a task is.

mod compose;
mod egl;
mod messages;
mod picture;
mod places;
mod robot;
mod settle;
mod world;

pub use picture::{Eye, Picture, PictureError, cast_rays, draw};
pub use world::MujocoPhysics;

use dsm::Pose;
use dsm::time::Span;
use dsm_sim::physics::{Engine, Physics, PhysicsError, RobotBody, RobotStart};
use dsm_sim::scene::SceneModel;
use settle::settle_scene;

/// MuJoCo as the engine of a world.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mujoco(pub MujocoConfig);

impl Engine for Mujoco {
    fn build(
        &self,
        scene: &SceneModel,
        robot: &RobotBody,
        start: &RobotStart,
    ) -> Result<Box<dyn Physics>, PhysicsError> {
        Ok(Box::new(MujocoPhysics::new(scene, robot, start, self.0)?))
    }

    fn settle(&self, scene: &SceneModel, span: Span) -> Result<Vec<Pose>, PhysicsError> {
        settle_scene(scene, span, &self.0)
    }
}

/// Parameters of the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MujocoConfig {
    /// Length of a step; default 5 ms, range 0.5 to 5 ms. A multiple of it must make the control period.
    pub step: Span,
    /// How much stiffer friction is than the contact's normal; default 10, range 1 to 100. Friction is soft in MuJoCo: at
    /// 1 whatever is held creeps out of the hand.
    pub friction_stiffness: f64,
    /// Bodies slower than this for ten steps, metres per second, sleep until something wakes them; default 0.5 mm/s, for
    /// what lies still trembles by 0.3 mm/s in contacts as stiff as these; range 0 (nothing sleeps) to 1 mm/s.
    pub sleep_below_m_per_s: f64,
}

impl Default for MujocoConfig {
    fn default() -> Self {
        Self { step: Span(5_000_000), friction_stiffness: 10.0, sleep_below_m_per_s: 5e-4 }
    }
}

impl MujocoConfig {
    fn check(&self) -> Result<(), PhysicsError> {
        let out = |name: &str, value: f64, expected: &str| {
            Err(PhysicsError::OutOfRange { name: name.into(), value, expected: expected.into() })
        };
        if !(500_000..=5_000_000).contains(&self.step.0) {
            return out("physics step", self.step.as_s(), "0.0005 to 0.005 s");
        }
        if !(1.0..=100.0).contains(&self.friction_stiffness) {
            return out("friction_stiffness", self.friction_stiffness, "1 to 100");
        }
        if !(0.0..=1e-3).contains(&self.sleep_below_m_per_s) {
            return out("sleep_below_m_per_s", self.sleep_below_m_per_s, "0 to 0.001");
        }
        Ok(())
    }
}
