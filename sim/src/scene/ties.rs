//! What a scene says about pairs of bodies: which are held together, and which never touch.

use super::bodies::{Bodies, to_pose};
use super::defaults::is_default;
use super::model::{BodyMotion, SceneTie};
use super::notes::{Effect, Notes};
use dsm::Pose;
use mjcf_rs::Model;
use mjcf_rs::equality::{Equality, EqualityConnect, EqualityWeld};
use nalgebra::Translation3;
use roxmltree::{Document, Node};

/// A parsed body by name; no name means the world.
fn find_body(model: &Model, name: Option<&str>) -> Option<usize> {
    name.filter(|name| !name.is_empty() && *name != "world").map_or(Some(0), |name| model.body_id_by_name(name))
}

/// Pairs of bodies that never touch each other.
pub(super) fn find_excluded(model: &Model, bodies: &Bodies) -> Vec<[usize; 2]> {
    let pair = |exclude: &mjcf_rs::contact::ContactExclude| {
        let [a, b] = [&exclude.body1, &exclude.body2].map(|name| find_body(model, Some(name)));
        let (a, b) = (bodies.owner[a?], bodies.owner[b?]);
        (a != b).then_some([a.min(b), a.max(b)])
    };
    let mut pairs: Vec<[usize; 2]> = model.contact.excludes.iter().filter_map(pair).collect();
    // As in MuJoCo: what moves does not touch the part that moves on it, but all that stands does.
    let on_moving = bodies.joints.iter().filter(|joint| bodies.bodies[joint.carrier].motion != BodyMotion::Fixed);
    pairs.extend(on_moving.map(|joint| [joint.part.min(joint.carrier), joint.part.max(joint.carrier)]));
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Welds and connections between bodies that can move against each other; what is not simulated is noted.
pub(super) fn find_ties(
    model: &Model,
    document: &Document<'_>,
    bodies: &Bodies,
    notes: &mut Notes<'_>,
) -> Vec<SceneTie> {
    let is_tie = |node: &Node<'_, '_>| node.has_tag_name("connect") || node.has_tag_name("weld");
    let in_equality = |node: &Node<'_, '_>| node.parent().is_some_and(|parent| parent.has_tag_name("equality"));
    let nodes = document.root_element().descendants().filter(|n| is_tie(n) && in_equality(n) && !is_default(n));
    // The parser keeps the order of the document.
    let parsed = model.equality.iter().filter(|e| matches!(e, Equality::Connect(_) | Equality::Weld(_)));
    let mut ties = Vec::new();
    for (node, equality) in nodes.zip(parsed) {
        let (common, names) = match equality {
            Equality::Connect(connect) => (&connect.common, [Some(&connect.body1), connect.body2.as_ref()]),
            Equality::Weld(weld) => (&weld.common, [Some(&weld.body1), weld.body2.as_ref()]),
            _ => continue,
        };
        if node.has_attribute("site1") || node.has_attribute("site2") {
            notes.add(node, Effect::NotConstrained);
            continue;
        }
        let [Some(a), Some(b)] = names.map(|name| find_body(model, name.map(String::as_str))) else {
            notes.add(node, Effect::NotConstrained);
            continue;
        };
        let owners = [bodies.owner[a], bodies.owner[b]];
        let moves = owners.iter().any(|owner| bodies.bodies[*owner].motion != BodyMotion::Fixed);
        // What is off stays off, and what cannot move needs nothing that holds it.
        if !common.active || owners[0] == owners[1] || !moves {
            continue;
        }
        let part_from_tie = match equality {
            Equality::Weld(weld) => frames_of_weld(weld, [a, b], bodies),
            Equality::Connect(connect) => frames_of_connect(connect, [a, b], bodies),
            _ => continue,
        };
        let body_from_tie = [0, 1].map(|side| {
            let part = [a, b][side];
            let body_from_part = bodies.bodies[owners[side]].world_from_body.inv_mul(&bodies.world_from[part]);
            body_from_part * part_from_tie[side]
        });
        ties.push(SceneTie { bodies: owners, body_from_tie, rigid: matches!(equality, Equality::Weld(_)) });
    }
    ties
}

/// A weld holds two bodies as `relpose` says, which is where the first has the second's anchor, or as they stand.
fn frames_of_weld(weld: &EqualityWeld, [a, b]: [usize; 2], bodies: &Bodies) -> [Pose; 2] {
    let standing = bodies.world_from[a].inv_mul(&bodies.world_from[b]);
    // A quaternion of zeros means that nothing is said.
    let said = weld.relpose.filter(|pose| pose.rotation.length_squared() > 1e-9);
    let anchor = weld.anchor.unwrap_or_default();
    let anchor = Pose::from_parts(Translation3::from(anchor), nalgebra::UnitQuaternion::identity());
    [said.map_or(standing * anchor, |pose| to_pose(&pose)), anchor]
}

/// A connection holds the point that `anchor` names in the first body where the second has it in the scene.
fn frames_of_connect(connect: &EqualityConnect, [a, b]: [usize; 2], bodies: &Bodies) -> [Pose; 2] {
    let anchor = Pose::from_parts(Translation3::from(connect.anchor), nalgebra::UnitQuaternion::identity());
    [anchor, bodies.world_from[b].inv_mul(&bodies.world_from[a]) * anchor]
}
