//! Which joints of a file move here: hinges and slides of a body with no other joint, that nothing acts on.

use super::bodies::Context;
use super::joints::{JointMotion, SceneJoint};
use dsm::Pose;
use mjcf_rs::body::{Joint, JointType};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use roxmltree::Document;
use std::collections::BTreeSet;

/// Attributes that name joints in the blocks whose elements act on them.
const NAMING: [&str; 4] = ["joint", "jointinparent", "joint1", "joint2"];

/// For each parsed body the joint that moves it. All others are held fast: ball joints and several joints of one body are
/// not simulated; a joint with a motor, tendon or equality would hang limp, for these are not simulated either; and what has
/// no mass, or nothing that collides, cannot move.
pub(super) fn find_live_joints<'a>(context: &Context<'a>) -> Vec<Option<&'a Joint>> {
    let entries = &context.model.bodies;
    let acted = find_acted(context.document);
    let candidate = |id: usize| {
        let [joint] = &entries[id].body.joints[..] else { return None };
        let moves = matches!(joint.type_, JointType::Hinge | JointType::Slide);
        let alone = joint.name.as_deref().is_none_or(|name| !acted.contains(name));
        (moves && alone && Vector3::from(joint.axis).norm() > 1e-9).then_some(joint)
    };
    let mut found: Vec<Option<&Joint>> = (0..entries.len()).map(candidate).collect();
    if found.iter().all(Option::is_none) {
        return found;
    }
    // What a part weighs, and whether it can be touched, with all that is rigidly attached to it. Children come after their
    // parents.
    let mut weight_kg: Vec<f64> = (0..entries.len()).map(|id| context.mass_of_body(id)).collect();
    let collides = |id: usize| entries[id].body.geoms.iter().any(|geom| geom.contype != 0 || geom.conaffinity != 0);
    let mut solid: Vec<bool> = (0..entries.len()).map(collides).collect();
    for id in (0..entries.len()).rev() {
        if !(solid[id] && weight_kg[id] > 0.0) {
            found[id] = None;
        }
        if let (None, Some(parent)) = (found[id], entries[id].parent) {
            weight_kg[parent] += weight_kg[id];
            solid[parent] |= solid[id];
        }
    }
    // A free body that is nothing without the parts on its joints is one with them.
    for id in 0..entries.len() {
        let is_free = entries[id].body.joints.iter().any(|joint| joint.type_ == JointType::Free);
        if is_free && !(solid[id] && weight_kg[id] > 0.0) {
            (id + 1..entries.len())
                .filter(|below| hangs_below(context, *below, id))
                .for_each(|below| found[below] = None);
        }
    }
    found
}

/// Whether a parsed body is below another one.
fn hangs_below(context: &Context<'_>, body: usize, above: usize) -> bool {
    let parent = |id: &usize| context.model.bodies[*id].parent;
    std::iter::successors(Some(body), parent).any(|id| id == above)
}

/// Names of joints that motors, tendons and equalities act on.
fn find_acted<'a>(document: &'a Document<'a>) -> BTreeSet<&'a str> {
    let blocks = document.root_element().descendants();
    let blocks = blocks.filter(|node| matches!(node.tag_name().name(), "actuator" | "tendon" | "equality"));
    let elements = blocks.flat_map(|block| block.descendants());
    elements.flat_map(|node| NAMING.into_iter().filter_map(move |attribute| node.attribute(attribute))).collect()
}

/// A joint between a part and its carrier (their indices, in this order).
pub(super) fn joint_of(
    joint: &Joint,
    autolimits: bool,
    body: &str,
    (part, carrier): (usize, usize),
    carrier_from_part: &Pose,
) -> SceneJoint {
    let axis = Vector3::from(joint.axis);
    let along = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let part_from_joint = Pose::from_parts(Translation3::from(Vector3::from(joint.pos)), along);
    let limited = joint.limited.resolve(autolimits, joint.range.is_some());
    SceneJoint {
        name: joint.name.clone().unwrap_or_else(|| body.to_owned()),
        part,
        carrier,
        motion: if joint.type_ == JointType::Slide { JointMotion::Slide } else { JointMotion::Hinge },
        carrier_from_joint: carrier_from_part * part_from_joint,
        part_from_joint,
        reference: joint.ref_,
        range: joint.range.filter(|[low, high]| limited && low < high),
        damping: joint.damping.max(0.0),
        friction: joint.frictionloss.max(0.0),
        stiffness: joint.stiffness.max(0.0),
        spring_reference: joint.springref,
        armature: joint.armature.max(0.0),
    }
}
