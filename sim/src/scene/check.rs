//! What is wrong with a scene that loads: things that overlap, fall, have no category or cannot be moved.

use super::model::{BodyMotion, SceneModel};
use super::semantics::Semantics;
use super::{HeldJoint, scene_file};
use crate::physics::{PhysicsConfig, settle_scene};
use crate::world::{Solids, WorldError};
use dsm::Pose;
use dsm::time::Span;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

/// Overlap that is still contact, metres.
const OVERLAP_M: f64 = 0.001;
/// Free bodies may move this far while they come to rest, metres ...
const REST_MOVE_M: f64 = 0.01;
/// ... and turn this far, radians.
const REST_TURN_RAD: f64 = 0.1;
/// Time in which they come to rest.
const REST: Span = Span(2_000_000_000);

/// Something that is wrong with a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Finding {
    /// A free body overlaps another body at the start.
    Overlap {
        /// The free body.
        body: String,
        /// The other one.
        other: String,
        /// How deep, metres.
        depth_m: f64,
    },
    /// A free body does not stay where the scene puts it.
    Moves {
        /// The body.
        body: String,
        /// How far its origin moves within two seconds, metres.
        distance_m: f64,
        /// How far it turns, radians.
        turn_rad: f64,
    },
    /// A body that semantics.toml does not list.
    Unlisted {
        /// The body.
        body: String,
    },
    /// A hinge, slide or ball joint, which is held fast.
    HeldJoint {
        /// The joint.
        joint: String,
        /// The body that it would move.
        body: String,
    },
    /// The robot can start nowhere in the areas of semantics.toml: none is given.
    NoStartArea,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Overlap { body, other, depth_m } => {
                write!(f, "`{body}` overlaps `{other}` by {:.1} mm at the start", depth_m * 1e3)
            }
            Self::Moves { body, distance_m, turn_rad } => {
                let (mm, degrees) = (distance_m * 1e3, turn_rad.to_degrees());
                write!(f, "`{body}` moves {mm:.0} mm and turns {degrees:.0} degrees before it rests")
            }
            Self::Unlisted { body } => write!(f, "`{body}` is not listed in semantics.toml"),
            Self::HeldJoint { joint, body } => {
                write!(f, "joint `{joint}` of `{body}` is held fast: articulated scenes are not simulated")
            }
            Self::NoStartArea => write!(f, "semantics.toml names no [start] areas"),
        }
    }
}

/// A scene that was checked.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedScene {
    /// Its name.
    pub name: String,
    /// Bodies besides the world.
    pub bodies: usize,
    /// How many of them are free.
    pub free_bodies: usize,
    /// Categories in semantics.toml.
    pub categories: usize,
    /// What is wrong.
    pub findings: Vec<Finding>,
}

/// Loads a scene, lets it rest for two seconds and says what is wrong with it.
///
/// # Errors
/// [`WorldError`] when the scene does not load or cannot be simulated.
pub fn check_scene(path: &Path) -> Result<CheckedScene, WorldError> {
    let (scene, held) = SceneModel::load_with_joints(path)?;
    let semantics = Semantics::load(&scene_file(path), &scene)?;
    let settled = settle_scene(&scene, REST, PhysicsConfig::default())?;
    let mut findings = find_overlaps(&scene, &Solids::new(&scene)?);
    findings.extend(find_movers(&scene, &settled));
    findings.extend(find_unlisted(&scene, &semantics));
    findings.extend(held.into_iter().map(|HeldJoint { joint, body, .. }| Finding::HeldJoint { joint, body }));
    if semantics.start.areas.is_empty() {
        findings.push(Finding::NoStartArea);
    }
    let categories: BTreeSet<&str> = semantics.objects.iter().map(|object| object.category.as_str()).collect();
    let free_bodies = scene.bodies.iter().filter(|body| body.motion == BodyMotion::Free).count();
    Ok(CheckedScene {
        name: scene.name.clone(),
        bodies: scene.bodies.len() - 1,
        free_bodies,
        categories: categories.len(),
        findings,
    })
}

/// Free bodies that overlap another body by more than a millimetre.
pub(crate) fn find_overlaps(scene: &SceneModel, solids: &Solids) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, body) in scene.bodies.iter().enumerate().filter(|(_, body)| body.motion == BodyMotion::Free) {
        for (other_index, other) in scene.bodies.iter().enumerate() {
            let once = other.motion == BodyMotion::Fixed || other_index > index;
            if other_index == index || !once {
                continue;
            }
            let depth =
                solids.find_depth_m((index, &body.world_from_body), (other_index, &other.world_from_body), 0.0);
            if let Some(depth_m) = depth.filter(|depth| *depth > OVERLAP_M) {
                findings.push(Finding::Overlap { body: body.name.clone(), other: other.name.clone(), depth_m });
            }
        }
    }
    findings
}

/// Free bodies that are elsewhere after coming to rest; `settled` holds the poses of all bodies.
pub fn find_movers(scene: &SceneModel, settled: &[Pose]) -> Vec<Finding> {
    let free = scene.bodies.iter().zip(settled).filter(|(body, _)| body.motion == BodyMotion::Free);
    free.filter_map(|(body, settled)| {
        let motion = body.world_from_body.inv_mul(settled);
        let (distance_m, turn_rad) = (motion.translation.vector.norm(), motion.rotation.angle());
        let moves = distance_m > REST_MOVE_M || turn_rad > REST_TURN_RAD;
        moves.then(|| Finding::Moves { body: body.name.clone(), distance_m, turn_rad })
    })
    .collect()
}

fn find_unlisted(scene: &SceneModel, semantics: &Semantics) -> Vec<Finding> {
    let unlisted = scene.bodies.iter().skip(1).filter(|body| semantics.find_object(&body.name).is_none());
    unlisted.map(|body| Finding::Unlisted { body: body.name.clone() }).collect()
}

#[cfg(test)]
mod tests {
    //! Contract: each fault of a scene is found and named, and a sound scene passes.
    use super::*;

    fn check(inner: &str, semantics: Option<&str>) -> CheckedScene {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let text = format!("<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\"/>{inner}</worldbody></mujoco>");
        std::fs::write(folder.path().join("scene.xml"), text).expect("written");
        if let Some(semantics) = semantics {
            std::fs::write(folder.path().join("semantics.toml"), semantics).expect("written");
        }
        check_scene(folder.path()).expect("loads")
    }

    const START: &str = "version = 1\nname = \"t\"\n[start]\nareas = [{ x_m = 0, y_m = 0 }]\n";

    fn free(name: &str, x_m: f64, z_m: f64) -> String {
        format!(
            "<body name=\"{name}\" pos=\"{x_m} 0 {z_m}\"><freejoint/><geom type=\"box\" size=\".1 .1 .1\" mass=\"1\"/></body>"
        )
    }

    #[test]
    fn a_sound_scene_has_no_findings() {
        let semantics = format!("{START}[[object]]\nbody = \"a\"\ncategory = \"box\"\n");
        let checked = check(&free("a", 0.0, 0.1), Some(&semantics));
        assert_eq!((checked.findings, checked.free_bodies, checked.categories), (vec![], 1, 1));
    }

    #[test]
    fn overlapping_falling_and_unlisted_bodies_are_named() {
        let inner = free("a", 0.0, 0.1) + &free("b", 0.15, 0.1) + &free("c", 2.0, 0.5);
        let text: Vec<String> = check(&inner, Some(START)).findings.iter().map(ToString::to_string).collect();
        assert!(text.iter().any(|t| t.starts_with("`a` overlaps `b` by 50.0 mm")), "{text:?}");
        assert!(text.iter().any(|t| t.starts_with("`c` moves 4")), "{text:?}");
        assert_eq!(text.iter().filter(|t| t.ends_with("is not listed in semantics.toml")).count(), 3);
    }

    #[test]
    fn held_joints_and_missing_start_areas_are_named() {
        let door = "<body name=\"door\"><joint name=\"h\" axis=\"0 0 1\"/><geom size=\".1\" pos=\"0 0 1\"/></body>";
        let findings = check(door, None).findings;
        assert!(findings.contains(&Finding::HeldJoint { joint: "h".to_owned(), body: "door".to_owned() }));
        assert!(findings.contains(&Finding::NoStartArea));
    }
}
