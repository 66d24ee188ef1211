//! Doors between rooms: what of a scene they are, and the scene as one who opens them finds it.

use super::joints::JointMotion;
use super::model::SceneModel;
use super::semantics::Semantics;

/// Category of what closes a doorway.
const DOOR: &str = "door";

impl Semantics {
    /// The bodies that swing in doorways. Doors of furniture are none.
    pub fn find_leaves(&self, scene: &SceneModel) -> Vec<usize> {
        let is_door = |body: usize| self.find_object(&scene.bodies[body].name).is_some_and(|o| o.category == DOOR);
        let hinges = scene.joints.iter().filter(|joint| joint.motion == JointMotion::Hinge);
        let leaves = hinges.filter(|joint| is_door(joint.part) || is_door(scene.find_root(joint.part)));
        leaves.map(|joint| joint.part).collect()
    }

    /// The same scene without the leaves of its doors: what stands in nobody's way who can open it.
    pub fn with_doorways_open(&self, scene: &SceneModel) -> SceneModel {
        scene.without_solids_of(&self.find_leaves(scene))
    }
}

impl SceneModel {
    /// The same scene, but some bodies are not there to be seen or touched.
    pub fn without_solids_of(&self, bodies: &[usize]) -> Self {
        let mut less = self.clone();
        bodies.iter().for_each(|body| less.bodies[*body].geoms.clear());
        less
    }
}
