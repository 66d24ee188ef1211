//! Hands from outside: what a disturbance does to bodies of a rapier world.

use super::convert::to_pose;
use super::{Hands, RapierPhysics};
use dsm::Pose;
use rapier3d::math::Vector;
use rapier3d::prelude::*;

impl Hands for RapierPhysics {
    fn put_body(&mut self, body: usize, world_from_body: &Pose) {
        let handle = self.scene_bodies[body];
        let Some(body) = self.world.bodies.get_mut(handle) else { return };
        body.set_position(to_pose(world_from_body), true);
        if body.is_dynamic() {
            body.set_linvel(Vector::ZERO, true);
            body.set_angvel(Vector::ZERO, true);
        }
    }

    fn take_away(&mut self, body: usize) {
        let handle = self.scene_bodies[body];
        if let Some(body) = self.world.bodies.get_mut(handle) {
            body.set_enabled(false);
        }
    }

    fn set_friction_share(&mut self, body: usize, share: f64) {
        let Some(rigid) = self.world.bodies.get(self.scene_bodies[body]) else { return };
        let colliders: Vec<ColliderHandle> = rigid.colliders().to_vec();
        let friction = |collider: &ColliderHandle| self.world.colliders.get(*collider).map_or(0.0, Collider::friction);
        let own = self.own_friction.entry(body).or_insert_with(|| colliders.iter().map(friction).collect());
        for (collider, own) in colliders.iter().zip(own) {
            if let Some(found) = self.world.colliders.get_mut(*collider) {
                found.set_friction(*own * share as f32);
            }
        }
    }
}
