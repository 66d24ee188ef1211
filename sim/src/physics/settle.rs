//! A scene left to itself, without a robot.

use super::rapier::new_world;
use super::scene_body::{IgnoredPairs, insert_scene};
use super::scene_joint::{find_standing, pose_of};
use super::{PhysicsConfig, PhysicsError};
use crate::scene::SceneModel;
use dsm::Pose;
use dsm::time::Span;
use std::collections::BTreeSet;

/// Lets the scene rest for `span` and returns the pose of every body, in the order of the scene.
pub(crate) fn settle_scene(scene: &SceneModel, span: Span, config: PhysicsConfig) -> Result<Vec<Pose>, PhysicsError> {
    let mut world = new_world(config);
    let handles = insert_scene(&mut world, scene)?;
    let standing = find_standing(scene, &world, &handles);
    let filter = IgnoredPairs::new(scene, BTreeSet::new());
    for _ in 0..span.0 / config.step.0.max(1) {
        world.step_with_events(&filter, &());
    }
    Ok((0..handles.len()).map(|body| pose_of(body, &world, &handles, &standing)).collect())
}

#[cfg(test)]
mod tests {
    //! Contract: what is carried stays, what is not falls.
    use super::*;

    #[test]
    fn a_carried_box_stays_and_a_floating_one_falls() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("scene.xml");
        let text = r#"<mujoco><worldbody><geom type="plane" size="0 0 1"/>
            <body name="on" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>
            <body name="up" pos="1 0 .9"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>
            </worldbody></mujoco>"#;
        std::fs::write(&file, text).expect("written");
        let scene = SceneModel::load(&file).expect("valid");
        let poses = settle_scene(&scene, Span::from_s(2.0), PhysicsConfig::default()).expect("simulated");
        assert!((poses[1].translation.z - 0.1).abs() < 2e-3, "{}", poses[1]);
        assert!((poses[2].translation.z - 0.1).abs() < 5e-3, "{}", poses[2]);
    }
}
