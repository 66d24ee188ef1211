//! What a scene says about pairs of bodies, and about how mass is spread, without a robot.

use crate::blocks::{add, add_free, body, cuboid, floor};
use dsm::Pose;
use dsm::time::Span;
use dsm_sim::physics::Engine;
use dsm_sim::scene::{BodyMotion, MassSpread, SceneModel, SceneTie};
use nalgebra::{Matrix3, Point3};

/// A floor, a fixed shelf at 1 m and a block on it.
fn shelf() -> (SceneModel, usize, usize) {
    let mut scene = floor();
    let board = body("shelf", Pose::translation(0.0, 0.0, 1.0), BodyMotion::Fixed, 0.0, cuboid(1.0, 1.0, 0.04), 0.6);
    let board = add(&mut scene, board);
    let block = add_free(&mut scene, [0.0, 0.0, 1.07], 0.5, cuboid(0.1, 0.1, 0.1), 0.6);
    (scene, board, block)
}

fn settled_height_m(engine: &dyn Engine, scene: &SceneModel, body: usize) -> f64 {
    engine.settle(scene, Span::from_s(2.0)).expect("simulated")[body].translation.z
}

pub(crate) fn kinds_and_exclusions_decide_what_touches(engine: &dyn Engine) {
    let (mut scene, board, block) = shelf();
    let height = |change: &dyn Fn(&mut SceneModel)| {
        let mut changed = scene.clone();
        change(&mut changed);
        settled_height_m(engine, &changed, block)
    };
    assert!((height(&|_| ()) - 1.07).abs() < 2e-3);
    let set = |body: usize, kinds: u32, touches: u32| {
        move |scene: &mut SceneModel| {
            let geom = &mut scene.bodies[body].geoms[0];
            (geom.kinds, geom.touches) = (kinds, touches);
        }
    };
    // The board is of a kind that the block does not touch, nor the other way round: it falls to the floor.
    assert!((height(&set(board, 2, 2)) - 0.05).abs() < 2e-3);
    // One of the two sides is enough.
    assert!((height(&set(board, 2, 1)) - 1.07).abs() < 2e-3);
    assert!((height(&set(block, 1, 0)) - 1.07).abs() < 2e-3);
    assert!((height(&move |scene: &mut SceneModel| scene.excluded = vec![[board, block]]) - 0.05).abs() < 2e-3);
    // Then it must not fall through anything else.
    scene.excluded = vec![[0, board]];
    assert!((settled_height_m(engine, &scene, block) - 1.07).abs() < 2e-3);
}

pub(crate) fn ties_hold_bodies_together(engine: &dyn Engine) {
    for rigid in [true, false] {
        let mut scene = floor();
        let at = |x: f64| Pose::translation(x, 0.0, 2.0);
        let post = add(&mut scene, body("post", at(0.0), BodyMotion::Fixed, 0.0, cuboid(0.1, 0.1, 0.1), 0.6));
        let arm = add_free(&mut scene, [0.3, 0.0, 2.0], 0.5, cuboid(0.2, 0.05, 0.05), 0.6);
        let body_from_tie = [Pose::translation(0.1, 0.0, 0.0), Pose::translation(-0.2, 0.0, 0.0)];
        scene.ties.push(SceneTie { bodies: [post, arm], body_from_tie, rigid });
        let poses = engine.settle(&scene, Span::from_s(0.3)).expect("simulated");
        let [held, holds] = [(arm, 1), (post, 0)]
            .map(|(body, side): (usize, usize)| (poses[body] * body_from_tie[side]).translation.vector);
        assert!((held - holds).norm() < 5e-3, "rigid {rigid}: {held} and {holds} are one point");
        let sunk_m = 2.0 - poses[arm].translation.z;
        // What is welded stays level; what hangs on a point swings down.
        assert!(if rigid { sunk_m.abs() < 5e-3 } else { sunk_m > 0.05 }, "rigid {rigid}: sunk by {sunk_m} m");
    }
}

pub(crate) fn a_written_center_of_mass_counts(engine: &dyn Engine) {
    // A block with more than half of it over the edge falls, unless its weight lies at the end that is supported.
    for (center_m, stays) in [(0.0, false), (-0.15, true)] {
        let mut scene = floor();
        let table = body("table", Pose::translation(0.0, 0.0, 0.5), BodyMotion::Fixed, 0.0, cuboid(1.0, 1.0, 1.0), 0.8);
        add(&mut scene, table);
        let block = add_free(&mut scene, [0.55, 0.0, 1.05], 1.0, cuboid(0.4, 0.2, 0.1), 0.8);
        scene.bodies[block].spread = Some(MassSpread {
            center_in_body: Point3::new(center_m, 0.0, 0.0),
            inertia_kg_m2: Matrix3::identity() * 5e-3,
        });
        let height_m = settled_height_m(engine, &scene, block);
        assert_eq!((height_m - 1.05).abs() < 2e-3, stays, "the weight at {center_m} m: {height_m} m high");
    }
}
