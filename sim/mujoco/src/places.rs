//! Where the bodies of a scene lie in MuJoCo's model and state.

use crate::compose::{body_name, joint_name, refused};
use dsm::Pose;
use dsm_sim::physics::{ANGULAR_DAMPING_PER_S, LINEAR_DAMPING_PER_S, PhysicsError};
use dsm_sim::scene::{BodyMotion, JointMotion, SceneJoint, SceneModel};
use mujoco_rs::prelude::{MjModel, MjtObjBase};
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};

/// Where a scene body's state lies.
#[derive(Clone, Debug)]
enum BodyPlace {
    /// It never moves.
    Fixed(Pose),
    /// Its position and velocity begin at these indices.
    Free { position: usize, velocity: usize, center_in_body: Vector3<f64> },
    /// Those of its joint are at these indices.
    Jointed { position: usize, velocity: usize, center_in_body: Vector3<f64>, joint: Box<SceneJoint> },
}

/// Where the states of all bodies of a scene lie.
#[derive(Clone, Debug)]
pub(crate) struct Places(Vec<BodyPlace>);

impl Places {
    /// Number of bodies.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// World poses of all bodies, given the positions of all joints.
    pub(crate) fn poses(&self, positions: &[f64]) -> Vec<Pose> {
        (0..self.len()).map(|body| self.pose(body, positions)).collect()
    }

    /// World pose of a body, given the positions of all joints.
    pub(crate) fn pose(&self, body: usize, positions: &[f64]) -> Pose {
        match &self.0[body] {
            BodyPlace::Fixed(pose) => *pose,
            BodyPlace::Free { position, .. } => {
                let q = &positions[*position..position + 7];
                pose(&[q[0], q[1], q[2]], &[q[3], q[4], q[5], q[6]])
            }
            BodyPlace::Jointed { position, joint, .. } => {
                self.pose(joint.carrier, positions) * joint.carrier_from_part(positions[*position])
            }
        }
    }

    /// Velocity of a body in the world: of the point of it that is at `point`, and its turning.
    pub(crate) fn velocity_at(
        &self,
        body: usize,
        point: &Vector3<f64>,
        (positions, velocities): (&[f64], &[f64]),
    ) -> (Vector3<f64>, Vector3<f64>) {
        match &self.0[body] {
            BodyPlace::Fixed(_) => (Vector3::zeros(), Vector3::zeros()),
            BodyPlace::Free { velocity, .. } => {
                let v = &velocities[*velocity..velocity + 6];
                let pose = self.pose(body, positions);
                // MuJoCo gives the velocity of the body's frame in the world and its turning in the body.
                let angular = pose.rotation * Vector3::new(v[3], v[4], v[5]);
                let linear = Vector3::new(v[0], v[1], v[2]) + angular.cross(&(point - pose.translation.vector));
                (linear, angular)
            }
            BodyPlace::Jointed { velocity, joint, .. } => {
                let (linear, angular) = self.velocity_at(joint.carrier, point, (positions, velocities));
                let frame = self.pose(joint.carrier, positions) * joint.carrier_from_joint;
                let along = frame.rotation * Vector3::z() * velocities[*velocity];
                match joint.motion {
                    JointMotion::Slide => (linear + along, angular),
                    JointMotion::Hinge => (linear + along.cross(&(point - frame.translation.vector)), angular + along),
                }
            }
        }
    }

    /// Centre of mass of a body in the world.
    pub(crate) fn center(&self, body: usize, positions: &[f64]) -> Vector3<f64> {
        let pose = self.pose(body, positions);
        let in_body = match &self.0[body] {
            BodyPlace::Fixed(_) => Vector3::zeros(),
            BodyPlace::Free { center_in_body, .. } | BodyPlace::Jointed { center_in_body, .. } => *center_in_body,
        };
        pose.translation.vector + pose.rotation * in_body
    }

    /// Puts the joints where they stand in the scene: MuJoCo begins with all at their reference.
    pub(crate) fn place_joints(&self, scene: &SceneModel, positions: &mut [f64]) {
        for place in &self.0 {
            if let BodyPlace::Jointed { position, joint, .. } = place {
                positions[*position] = scene.joint_position(joint);
            }
        }
    }
}

/// Numbers of the scene's bodies in the model.
pub(crate) fn find_scene_bodies(model: &MjModel, scene: &SceneModel) -> Result<Vec<usize>, PhysicsError> {
    (0..scene.bodies.len()).map(|index| find_body(model, &body_name(index))).collect()
}

/// Where the state of each of the scene's bodies lies.
pub(crate) fn find_places(model: &MjModel, scene: &SceneModel, ids: &[usize]) -> Result<Places, PhysicsError> {
    let place = |index: usize| {
        let (body, id) = (&scene.bodies[index], ids[index]);
        let center_in_body = model.body_ipos()[id].into();
        Ok(match (body.motion, scene.find_joint(index)) {
            (BodyMotion::Jointed, Some(joint)) => {
                let name = joint_name(index);
                let found = model.name_to_id(MjtObjBase::mjOBJ_JOINT, &name);
                let found = found.ok_or_else(|| refused(format!("lost joint `{name}`")))?;
                BodyPlace::Jointed {
                    position: model.jnt_qposadr()[found] as usize,
                    velocity: model.jnt_dofadr()[found] as usize,
                    center_in_body,
                    joint: Box::new(joint.clone()),
                }
            }
            (BodyMotion::Free, _) => {
                let joint = model.body_jntadr()[id] as usize;
                BodyPlace::Free {
                    position: model.jnt_qposadr()[joint] as usize,
                    velocity: model.jnt_dofadr()[joint] as usize,
                    center_in_body,
                }
            }
            _ => BodyPlace::Fixed(body.world_from_body),
        })
    };
    Ok(Places((0..scene.bodies.len()).map(place).collect::<Result<_, PhysicsError>>()?))
}

fn find_body(model: &MjModel, name: &str) -> Result<usize, PhysicsError> {
    model.name_to_id(MjtObjBase::mjOBJ_BODY, name).ok_or_else(|| refused(format!("lost body `{name}`")))
}

/// Rolling and air resistance of free bodies, in proportion to mass and inertia.
pub(crate) fn damp(model: &mut MjModel, bodies: &Places, ids: &[usize]) {
    for (place, id) in bodies.0.iter().zip(ids) {
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
