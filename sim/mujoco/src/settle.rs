//! A scene left to itself, without a robot.

use crate::MujocoConfig;
use crate::compose::{add_scene, new_spec, refused};
use crate::messages::route_messages;
use crate::places::{damp, find_places, find_scene_bodies};
use dsm::Pose;
use dsm::time::Span;
use dsm_sim::physics::PhysicsError;
use dsm_sim::scene::SceneModel;
use mujoco_rs::prelude::MjData;

/// Lets the scene rest for `span` and gives the pose of every body, in the order of the scene.
pub(crate) fn settle_scene(scene: &SceneModel, span: Span, config: &MujocoConfig) -> Result<Vec<Pose>, PhysicsError> {
    route_messages();
    config.check()?;
    let mut spec = new_spec(config);
    add_scene(&mut spec, scene)?;
    let mut model = Box::new(spec.compile().map_err(refused)?);
    let ids = find_scene_bodies(&model, scene)?;
    let places = find_places(&model, scene, &ids)?;
    damp(&mut model, &places, &ids);
    let mut data = MjData::new(model);
    places.place_joints(scene, data.qpos_mut());
    for _ in 0..span.0 / config.step.0.max(1) {
        data.step();
    }
    Ok(places.poses(data.qpos()))
}
