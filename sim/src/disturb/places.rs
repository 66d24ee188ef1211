//! Where disturbed things go.

use super::actors::BOX_HALF_M;
use crate::physics::Physics;
use crate::scene::SceneModel;
use crate::world::{Column, FLOOR_TOP_M, Mover, Solids};
use dsm::Pose;
use nalgebra::{Point3, Translation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// The world as it stands now, for questions of room.
pub(super) struct Ground {
    /// Bodies with their geoms; their poses are brought up to date before each question.
    pub(super) scene: SceneModel,
    pub(super) solids: Solids,
    /// Bodies that are there for disturbances alone: nothing keeps clear of them.
    pub(super) actors: Vec<usize>,
}

impl Ground {
    fn update(&mut self, physics: &dyn Physics) {
        for (index, body) in self.scene.bodies.iter_mut().enumerate() {
            body.world_from_body = physics.world_from_body(index);
        }
    }

    /// A place up to `by_m` away on what carries the body, as far as there is room: poses of the body and what it carries.
    pub(super) fn find_elsewhere(
        &mut self,
        physics: &dyn Physics,
        body: usize,
        by_m: f64,
        rng: &mut ChaCha8Rng,
    ) -> Option<Vec<(usize, Pose)>> {
        /// The full way first, then less: a nightstand is small.
        const SHARES: [f64; 4] = [1.0, 0.7, 0.5, 0.35];
        const TRIES: usize = 24;
        self.update(physics);
        SHARES.iter().find_map(|share| {
            (0..TRIES).find_map(|_| {
                let (way, yaw_rad) = (PI * (2.0 * rng.random::<f64>() - 1.0), PI * (2.0 * rng.random::<f64>() - 1.0));
                let shift = Vector3::new(way.cos(), way.sin(), 0.0) * (share * by_m);
                Mover::new(&self.scene, &self.solids).find_moved(body, shift, yaw_rad)
            })
        })
    }

    /// The poses of two bodies that change places: each stands where the other stood, turned as it was.
    pub(super) fn find_swapped(&mut self, physics: &dyn Physics, a: usize, b: usize) -> Option<[(usize, Pose); 2]> {
        self.update(physics);
        let [pose_a, pose_b] = [a, b].map(|body| self.scene.bodies[body].world_from_body);
        let [low_a, low_b] = [self.solids.find_bounds(a, &pose_a)?.min.z, self.solids.find_bounds(b, &pose_b)?.min.z];
        let moved = |from: &Pose, from_low_m: f64, to: &Pose, to_low_m: f64| {
            // Nothing begins inside of what carries it.
            const ABOVE_M: f64 = 0.002;
            let z = from.translation.z - from_low_m + to_low_m + ABOVE_M;
            Pose::from_parts(Translation3::new(to.translation.x, to.translation.y, z), from.rotation)
        };
        Some([(a, moved(&pose_a, low_a, &pose_b, low_b)), (b, moved(&pose_b, low_b, &pose_a, low_a))])
    }

    /// A free place for the box on the floor, straight ahead of the base.
    pub(super) fn find_ahead(&mut self, physics: &dyn Physics) -> Option<Pose> {
        /// From the base's centre: a base that sees at once what stands there stops in time at any of its speeds, metres.
        const AHEAD_M: [f64; 4] = [1.2, 1.35, 1.5, 1.1];
        const APART_M: f64 = 0.06;
        self.update(physics);
        let world_from_base = physics.world_from_base();
        let radius_m = BOX_HALF_M[0].hypot(BOX_HALF_M[1]) + APART_M;
        AHEAD_M.iter().find_map(|ahead_m| {
            let at = world_from_base * Point3::new(*ahead_m, 0.0, 0.0);
            let column = Column { x_m: at.x, y_m: at.y, radius_m, bottom_m: FLOOR_TOP_M, top_m: 2.0 * BOX_HALF_M[2] };
            let free = self.solids.iter().filter(|solid| !self.actors.contains(&solid.body)).all(|solid| {
                let pose = &self.scene.bodies[solid.body].world_from_body;
                solid.is_far_from_column(pose, &column, 0.0)
                    || solid.find_distance_to_column_m(pose, &column, 0.0).is_none()
            });
            free.then(|| Pose::translation(at.x, at.y, 0.0) * Pose::rotation(world_from_base.rotation.scaled_axis()))
        })
    }
}
