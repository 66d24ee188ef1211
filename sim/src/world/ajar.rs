//! Doors and drawers that stand open when a run begins, with what lies in them.

use super::WorldError;
use crate::scene::{BodyMotion, SceneBody, SceneJoint, SceneModel, SceneShape};
use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A door or drawer that stands open at the start of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OpenPart {
    /// MJCF body on a hinge or slide with a range.
    pub part: String,
    /// Share of its way by which it is open. Default 0.7, range 0.05 to 1.
    #[serde(default = "default_share")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub share: f64,
}

fn default_share() -> f64 {
    0.7
}

impl OpenPart {
    /// What is wrong with it, as what was expected; `None` when it is sound.
    pub fn find_flaw(&self) -> Option<&'static str> {
        (!(0.05..=1.0).contains(&self.share)).then_some("share from 0.05 to 1")
    }
}

/// Opens parts of a scene; free things that lie in them come along.
///
/// # Errors
/// [`WorldError::NoPart`] for a body that no joint with a range moves.
pub(super) fn stand_open(scene: &mut SceneModel, parts: &[OpenPart]) -> Result<(), WorldError> {
    for open in parts {
        let joint =
            scene.joints.iter().find(|joint| scene.bodies[joint.part].name == open.part && joint.range.is_some());
        let Some(joint) = joint.cloned() else {
            let known = scene.joints.iter().filter(|joint| joint.range.is_some());
            let known = known.map(|joint| scene.bodies[joint.part].name.clone()).collect();
            return Err(WorldError::NoPart { part: open.part.clone(), known });
        };
        let contents = find_contents(scene, joint.part);
        let before = scene.bodies[joint.part].world_from_body;
        let after =
            scene.bodies[joint.carrier].world_from_body * joint.carrier_from_part(position_of(&joint, open.share));
        scene.bodies[joint.part].world_from_body = after;
        let world_from_world = after * before.inverse();
        for body in contents {
            let pose = &mut scene.bodies[body].world_from_body;
            *pose = world_from_world * *pose;
        }
    }
    Ok(())
}

/// The position at a share of a joint's way; it is closed at 0, or at the end nearest to that.
fn position_of(joint: &SceneJoint, share: f64) -> f64 {
    let Some([low, high]) = joint.range else { return joint.reference };
    let closed = 0.0_f64.clamp(low, high);
    let far = if high - closed >= closed - low { high } else { low };
    closed + share * (far - closed)
}

/// Free bodies whose origin lies in the box around a part.
fn find_contents(scene: &SceneModel, part: usize) -> Vec<usize> {
    let Some((low, high)) = box_around(&scene.bodies[part]) else { return Vec::new() };
    let part_from_world = scene.bodies[part].world_from_body.inverse();
    let is_inside = |body: &&SceneBody| {
        let at = part_from_world * Point3::from(body.world_from_body.translation.vector);
        (0..3).all(|k| at[k] > low[k] && at[k] < high[k])
    };
    let bodies = scene.bodies.iter().enumerate().filter(|(_, body)| body.motion == BodyMotion::Free);
    bodies.filter(|(_, body)| is_inside(body)).map(|(index, _)| index).collect()
}

/// The corners of the box around the boxes of a body, in its frame; `None` for a body without any.
fn box_around(body: &SceneBody) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let boxes = body.geoms.iter().filter_map(|geom| match &geom.shape {
        SceneShape::Box { half_m } => {
            let half = geom.body_from_geom.rotation.to_rotation_matrix().matrix().abs() * half_m;
            let at = geom.body_from_geom.translation.vector;
            Some((at - half, at + half))
        }
        _ => None,
    });
    boxes.reduce(|(low, high), (a, b)| (low.inf(&a), high.sup(&b)))
}
