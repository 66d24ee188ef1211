//! Where the bodies of a scene lie in MuJoCo's model and state.

use crate::compose::{body_name, refused};
use dsm::Pose;
use dsm_sim::physics::{ANGULAR_DAMPING_PER_S, LINEAR_DAMPING_PER_S, PhysicsError};
use dsm_sim::scene::{BodyMotion, SceneBody, SceneModel};
use mujoco_rs::prelude::{MjModel, MjtObjBase};
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};

/// Where a scene body's state lies.
#[derive(Clone, Copy, Debug)]
pub(crate) enum BodyPlace {
    /// It never moves.
    Fixed(Pose),
    /// Its position and velocity begin at these indices.
    Free { position: usize, velocity: usize, center_in_body: Vector3<f64> },
}

impl BodyPlace {
    /// World pose of the body, given the positions of all joints.
    pub(crate) fn pose(&self, positions: &[f64]) -> Pose {
        match *self {
            Self::Fixed(pose) => pose,
            Self::Free { position, .. } => {
                let q = &positions[position..position + 7];
                pose(&[q[0], q[1], q[2]], &[q[3], q[4], q[5], q[6]])
            }
        }
    }
}

/// Numbers of the scene's bodies in the model.
pub(crate) fn find_scene_bodies(model: &MjModel, scene: &SceneModel) -> Result<Vec<usize>, PhysicsError> {
    (0..scene.bodies.len()).map(|index| find_body(model, &body_name(index))).collect()
}

/// Where the state of each of the scene's bodies lies.
pub(crate) fn find_places(model: &MjModel, scene: &SceneModel, ids: &[usize]) -> Vec<BodyPlace> {
    let place = |(body, id): (&SceneBody, &usize)| match body.motion {
        BodyMotion::Fixed => BodyPlace::Fixed(body.world_from_body),
        BodyMotion::Free => {
            let joint = model.body_jntadr()[*id] as usize;
            BodyPlace::Free {
                position: model.jnt_qposadr()[joint] as usize,
                velocity: model.jnt_dofadr()[joint] as usize,
                center_in_body: model.body_ipos()[*id].into(),
            }
        }
    };
    scene.bodies.iter().zip(ids).map(place).collect()
}

fn find_body(model: &MjModel, name: &str) -> Result<usize, PhysicsError> {
    model.name_to_id(MjtObjBase::mjOBJ_BODY, name).ok_or_else(|| refused(format!("lost body `{name}`")))
}

/// Rolling and air resistance, in proportion to mass and inertia.
pub(crate) fn damp(model: &mut MjModel, bodies: &[BodyPlace], ids: &[usize]) {
    for (place, id) in bodies.iter().zip(ids) {
        let BodyPlace::Free { velocity, .. } = *place else { continue };
        let (mass, moments) = (model.body_mass()[*id], model.body_inertia()[*id]);
        let mean = moments.iter().sum::<f64>() / 3.0;
        let damping = &mut model.dof_damping_mut()[velocity..velocity + 6];
        damping[..3].fill(LINEAR_DAMPING_PER_S * mass);
        damping[3..].fill(ANGULAR_DAMPING_PER_S * mean);
    }
}

/// A pose from position and quaternion as MuJoCo has them.
pub(crate) fn pose(position: &[f64; 3], wxyz: &[f64; 4]) -> Pose {
    let [w, x, y, z] = *wxyz;
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    Pose::from_parts(Translation3::new(position[0], position[1], position[2]), rotation)
}
