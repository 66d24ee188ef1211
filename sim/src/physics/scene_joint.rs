//! Joints of a scene in rapier: each a joint of a multibody, which knows damping, dry friction and springs.

use super::convert::{from_pose, to_pose};
use super::inertia::body_inertia;
use super::{ANGULAR_DAMPING_PER_S, GRAVITY_M_PER_S2, LINEAR_DAMPING_PER_S, PhysicsError};
use crate::scene::{BodyMotion, JointMotion, SceneJoint, SceneModel};
use dsm::Pose;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use rapier3d::math::Pose as RapierPose;
use rapier3d::prelude::*;

/// Effort that moves nothing, newtons or newton metres: what rounding leaves of gravity along a level axis.
const NO_EFFORT: f64 = 1e-6;

/// A body on a joint that was not moved yet. Its pose is that of its carrier and its place there, to the last bit: poses
/// in single precision would make a closed drawer tremble by a tenth of a micrometre against its cabinet.
#[derive(Clone, Copy, Debug)]
pub(super) struct StandingPart {
    carrier: usize,
    carrier_from_part: Pose,
    /// Where the engine has it as long as it stands.
    pose: RapierPose,
}

/// Where bodies on joints stand at the start, by body.
pub(super) fn find_standing(
    scene: &SceneModel,
    world: &PhysicsWorld,
    handles: &[RigidBodyHandle],
) -> Vec<Option<StandingPart>> {
    let mut standing = vec![None; handles.len()];
    for joint in &scene.joints {
        standing[joint.part] = Some(StandingPart {
            carrier: joint.carrier,
            carrier_from_part: scene.standing_part(joint),
            pose: *world.bodies[handles[joint.part]].position(),
        });
    }
    standing
}

/// Pose of a body.
pub(super) fn pose_of(
    body: usize,
    world: &PhysicsWorld,
    handles: &[RigidBodyHandle],
    standing: &[Option<StandingPart>],
) -> Pose {
    let pose = world.bodies[handles[body]].position();
    match &standing[body] {
        Some(part) if part.pose == *pose => pose_of(part.carrier, world, handles, standing) * part.carrier_from_part,
        _ => from_pose(pose),
    }
}

/// Whether a body on a joint stays where it is when nothing touches it: then it sleeps from the start.
pub(super) fn stands_still(scene: &SceneModel, part: usize) -> Result<bool, PhysicsError> {
    let Some(joint) = scene.find_joint(part) else { return Ok(false) };
    if scene.bodies[scene.find_root(part)].motion != BodyMotion::Fixed {
        return Ok(false);
    }
    let world_from_joint = scene.bodies[part].world_from_body * joint.part_from_joint;
    let axis = world_from_joint.rotation * Vector3::z();
    let mut effort = joint.stiffness * (joint.spring_reference - scene.joint_position(joint));
    for index in (1..scene.bodies.len()).filter(|body| scene.hangs_on(*body, part)) {
        let body = &scene.bodies[index];
        let inertia = body_inertia(scene, body)?;
        let weight = Vector3::new(0.0, 0.0, -GRAVITY_M_PER_S2 * inertia.mass_kg);
        effort += match joint.motion {
            JointMotion::Slide => axis.dot(&weight),
            JointMotion::Hinge => {
                let center: Point3<f64> = body.world_from_body * inertia.center_in_body;
                axis.dot(&(center.coords - world_from_joint.translation.vector).cross(&weight))
            }
        };
    }
    Ok(effort.abs() <= joint.friction + NO_EFFORT)
}

/// Puts the joints of a scene between its bodies.
pub(super) fn insert_joints(world: &mut PhysicsWorld, scene: &SceneModel, handles: &[RigidBodyHandle]) {
    let inserted: Vec<_> = scene.joints.iter().map(|joint| insert_joint(world, scene, joint, handles)).collect();
    // Inserting a joint joins multibodies: what belongs to a degree of freedom is set when all are there.
    for (joint, handle) in scene.joints.iter().zip(inserted) {
        let Some((multibody, link)) = handle.and_then(|handle| world.multibody_joints.get_mut(handle)) else {
            continue;
        };
        let Some(at) = multibody.link(link).map(|link| link.assembly_id()) else { continue };
        multibody.damping_mut()[at] = joint.damping as f32;
        multibody.frictions_mut()[at] = joint.friction as f32;
        multibody.armature_mut()[at] = joint.armature as f32;
        let root = multibody.root();
        if root.joint().ndofs() == 6 {
            // A free body that carries a part is damped as all free bodies are.
            let properties = world.bodies[root.rigid_body_handle()].mass_properties().local_mprops;
            let mean = properties.principal_inertia().element_sum() / 3.0;
            let damping = multibody.damping_mut();
            for axis in 0..3 {
                damping[axis] = LINEAR_DAMPING_PER_S as f32 * properties.mass();
                damping[3 + axis] = ANGULAR_DAMPING_PER_S as f32 * mean;
            }
        }
    }
}

fn insert_joint(
    world: &mut PhysicsWorld,
    scene: &SceneModel,
    joint: &SceneJoint,
    handles: &[RigidBodyHandle],
) -> Option<MultibodyJointHandle> {
    let carrier = &scene.bodies[joint.carrier];
    // All joints of one multibody are solved and sleep together: those on what never moves have nothing to do with each
    // other, so each gets a fixed body of its own to hang on.
    let parent = if carrier.motion == BodyMotion::Fixed {
        world.insert_body(RigidBodyBuilder::fixed().pose(to_pose(&carrier.world_from_body)))
    } else {
        handles[joint.carrier]
    };
    // The engine's axis is x, and its coordinates begin at 0 where the bodies are.
    let from_axis = Pose::from_parts(
        Default::default(),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_2),
    );
    let at = scene.joint_position(joint);
    let in_carrier = joint.carrier_from_joint * joint.displacement(at) * from_axis;
    let in_part = joint.part_from_joint * from_axis;
    let (free, locked) = match joint.motion {
        JointMotion::Slide => (JointAxis::LinX, JointAxesMask::LOCKED_PRISMATIC_AXES),
        JointMotion::Hinge => (JointAxis::AngX, JointAxesMask::LOCKED_REVOLUTE_AXES),
    };
    let mut data = GenericJointBuilder::new(locked).local_frame1(to_pose(&in_carrier)).local_frame2(to_pose(&in_part));
    if let Some(range) = joint.range {
        data = data.limits(free, range.map(|end| (end - at) as f32));
    }
    let handle = world.multibody_joints.insert(parent, handles[joint.part], data.build(), false)?;
    if joint.stiffness > 0.0
        && let Some((multibody, link)) = world.multibody_joints.get_mut(handle)
        && let Some(link) = multibody.link_mut(link)
    {
        link.joint.set_spring(free as usize, joint.stiffness as f32, (joint.spring_reference - at) as f32);
    }
    Some(handle)
}
