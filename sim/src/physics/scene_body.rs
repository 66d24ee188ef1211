//! A scene in rapier: its bodies, what ties them together and what may touch.

use super::convert::to_pose;
use super::inertia::{body_inertia, density};
use super::robot_body::find_link_of_tag;
use super::scene_joint::{insert_joints, stands_still};
use super::shapes::scene_shape;
use super::{ANGULAR_DAMPING_PER_S, LINEAR_DAMPING_PER_S, PhysicsError};
use crate::scene::{BodyMotion, SceneBody, SceneGeom, SceneModel};
use rapier3d::math::{AngVector, Rotation};
use rapier3d::prelude::*;
use std::collections::BTreeSet;

/// Puts the bodies of a scene, its joints and ties into the engine.
pub(super) fn insert_scene(world: &mut PhysicsWorld, scene: &SceneModel) -> Result<Vec<RigidBodyHandle>, PhysicsError> {
    let colliding = || scene.bodies.iter().flat_map(|body| &body.geoms).filter(|geom| geom.collides);
    // Where all are of one kind nothing has to be told apart.
    let has_kinds = colliding().any(|geom| (geom.kinds, geom.touches) != (1, 1));
    let mut handles = Vec::with_capacity(scene.bodies.len());
    for (index, body) in scene.bodies.iter().enumerate() {
        let is_excluded = scene.excluded.iter().any(|pair| pair.contains(&index));
        handles.push(insert_body(world, scene, index, body, (has_kinds, is_excluded))?);
    }
    insert_joints(world, scene, &handles);
    for tie in &scene.ties {
        let [a, b] = tie.bodies.map(|body| handles[body]);
        let [at_a, at_b] = tie.body_from_tie.map(|pose| to_pose(&pose));
        if tie.rigid {
            let joint = FixedJointBuilder::new().local_frame1(at_a).local_frame2(at_b);
            world.insert_impulse_joint(a, b, joint);
        } else {
            let joint = SphericalJointBuilder::new().local_anchor1(at_a.translation).local_anchor2(at_b.translation);
            world.insert_impulse_joint(a, b, joint);
        }
    }
    Ok(handles)
}

/// Kinds as the engine's groups: a pair touches when one is of a kind that the other touches. The two highest bits meet
/// nobody but the robot, which is of all kinds and touches all: it meets everything.
fn groups(geom: &SceneGeom) -> InteractionGroups {
    const LOW: u32 = (1 << 30) - 1;
    let bits = Group::from_bits_retain;
    let (kinds, touches) = (bits(geom.kinds & LOW | 1 << 31), bits(geom.touches & LOW | 1 << 30));
    InteractionGroups::new(kinds, touches, InteractionTestMode::Or)
}

fn insert_body(
    world: &mut PhysicsWorld,
    scene: &SceneModel,
    index: usize,
    body: &SceneBody,
    (has_kinds, is_excluded): (bool, bool),
) -> Result<RigidBodyHandle, PhysicsError> {
    let builder = match body.motion {
        BodyMotion::Fixed => RigidBodyBuilder::fixed(),
        BodyMotion::Free => RigidBodyBuilder::dynamic()
            .linear_damping(LINEAR_DAMPING_PER_S as f32)
            .angular_damping(ANGULAR_DAMPING_PER_S as f32),
        // Damping is the joint's.
        BodyMotion::Jointed => RigidBodyBuilder::dynamic().sleeping(stands_still(scene, index)?),
    };
    let handle = world.insert_body(builder.pose(to_pose(&body.world_from_body)));
    let mut shapes = Vec::new();
    for geom in body.geoms.iter().filter(|g| g.collides) {
        let (geom_from_shape, shape) = scene_shape(scene, &body.name, &geom.shape, body.motion)?;
        shapes.push((to_pose(&geom.body_from_geom) * geom_from_shape, shape, geom));
    }
    let density = match body.spread {
        Some(_) => 0.0,
        None => density(body, shapes.iter().map(|(_, shape, _)| shape))?,
    };
    for (pose, shape, geom) in shapes {
        let mut collider = ColliderBuilder::new(shape)
            .position(pose)
            .density(density)
            .friction(geom.friction as f32)
            .friction_combine_rule(CoefficientCombineRule::GeometricMean)
            .user_data(index as u128);
        if has_kinds {
            collider = collider.collision_groups(groups(geom));
        }
        if is_excluded {
            collider = collider.active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS);
        }
        world.insert_collider(collider, Some(handle));
    }
    // Mass properties are otherwise computed with the first step only.
    if let Some(inserted) = world.bodies.get_mut(handle) {
        if body.spread.is_some() {
            let inertia = body_inertia(scene, body)?;
            let moments = inertia.moments_kg_m2;
            let q = inertia.body_from_principal;
            let properties = MassProperties::with_principal_inertia_frame(
                super::convert::to_vector(&inertia.center_in_body.coords),
                inertia.mass_kg as f32,
                AngVector::new(moments.x as f32, moments.y as f32, moments.z as f32),
                Rotation::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32),
            );
            inserted.set_additional_mass_properties(properties, false);
        }
        inserted.recompute_mass_properties_from_colliders(&world.colliders);
    }
    Ok(handle)
}

/// Tells the engine which links, and which bodies of the scene, never collide.
pub(super) struct IgnoredPairs {
    links: BTreeSet<(usize, usize)>,
    bodies: BTreeSet<[usize; 2]>,
}

impl IgnoredPairs {
    /// The scene's own pairs, and the given pairs of links.
    pub(super) fn new(scene: &SceneModel, links: BTreeSet<(usize, usize)>) -> Self {
        Self { links, bodies: scene.excluded.iter().copied().collect() }
    }
}

impl PhysicsHooks for IgnoredPairs {
    fn filter_contact_pair(&self, context: &PairFilterContext) -> Option<SolverFlags> {
        let tag = |collider| context.colliders.get(collider).map(|collider| collider.user_data);
        let [a, b] = [context.collider1, context.collider2].map(tag);
        let link = |tag: Option<u128>| tag.and_then(find_link_of_tag);
        let ignored = match (link(a), link(b)) {
            (Some(a), Some(b)) => a == b || self.links.contains(&(a.min(b), a.max(b))),
            (None, None) => {
                let [a, b] = [a, b].map(|tag| tag.unwrap_or_default() as usize);
                self.bodies.contains(&[a.min(b), a.max(b)])
            }
            _ => false,
        };
        (!ignored).then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }
}
