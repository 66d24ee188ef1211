//! What is wrong with a scene that loads: things that overlap, fall, have no category, and rooms that cannot be reached.

use super::model::{BodyMotion, SceneModel};
use super::reach::find_unreachable_rooms;
use super::semantics::{SEMANTICS_FILE, Semantics};
use super::source::Source;
use super::{Effect, SceneNote, scene_file};
use crate::physics::{PhysicsConfig, settle_scene};
use crate::world::{Solids, WorldError};
use dsm::Pose;
use dsm::time::Span;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// Overlap that is still contact, metres.
const OVERLAP_M: f64 = 0.001;
/// Overlap of things that do not move that is still construction, not a mistake, metres.
const FIXED_OVERLAP_M: f64 = 0.02;
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
    /// A body overlaps another body at the start.
    Overlap {
        /// The body.
        body: String,
        /// The other one.
        other: String,
        /// How deep, metres.
        depth_m: f64,
    },
    /// A body that can move does not stay where the scene puts it.
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
    /// A room that the robot does not get into.
    Unreachable {
        /// The room.
        room: String,
        /// Radius of the robot, metres.
        radius_m: f64,
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
            Self::Unreachable { room, radius_m } => {
                write!(f, "room `{room}` cannot be reached by a robot of radius {radius_m} m")
            }
            Self::NoStartArea => write!(f, "semantics.toml names no [start] areas"),
        }
    }
}

/// A finding and where to look for it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Located {
    /// What is wrong.
    #[serde(flatten)]
    pub finding: Finding,
    /// The file that names the body or room.
    pub file: PathBuf,
    /// The line, from 1, where it is known.
    pub line: Option<u32>,
}

impl fmt::Display for Located {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.file.display(), self.finding),
            None => write!(f, "{}: {}", self.file.display(), self.finding),
        }
    }
}

/// How much room the robot needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotSize {
    /// Radius of its footprint in metres; default 0.27.
    pub radius_m: f64,
    /// Height in metres; default 1.3.
    pub height_m: f64,
}

impl Default for RobotSize {
    fn default() -> Self {
        Self { radius_m: 0.27, height_m: 1.3 }
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
    /// How many of them move on a joint: doors, drawers.
    pub jointed_bodies: usize,
    /// Categories in semantics.toml.
    pub categories: usize,
    /// What is not done as the file says, such as joints that are held fast: no fault of the scene.
    pub notes: Vec<SceneNote>,
    /// What is wrong.
    pub findings: Vec<Located>,
}

impl CheckedScene {
    /// Joints that are held fast: doors and drawers will not move.
    pub fn held_joints(&self) -> impl Iterator<Item = &SceneNote> {
        self.notes.iter().filter(|note| note.effect == Effect::HeldFast)
    }
}

/// Loads a scene, lets it rest for two seconds and says what is wrong with it for a robot of that size.
///
/// # Errors
/// [`WorldError`] when the scene does not load or cannot be simulated.
pub fn check_scene(path: &Path, robot: RobotSize) -> Result<CheckedScene, WorldError> {
    let (scene, notes) = SceneModel::load_with_notes(path)?;
    let semantics = Semantics::load(&scene_file(path), &scene)?;
    let settled = settle_scene(&scene, REST, PhysicsConfig::default())?;
    let solids = Solids::new(&scene)?;
    let mut findings = find_overlaps(&scene, &solids);
    findings.extend(find_movers(&scene, &settled));
    findings.extend(find_unlisted(&scene, &semantics));
    let open = semantics.with_doorways_open(&scene);
    let unreachable = find_unreachable_rooms(&open, &semantics, &Solids::new(&open)?, robot);
    findings.extend(unreachable.into_iter().map(|room| Finding::Unreachable { room, radius_m: robot.radius_m }));
    if semantics.start.areas.is_empty() {
        findings.push(Finding::NoStartArea);
    }
    let categories: BTreeSet<&str> = semantics.objects.iter().map(|object| object.category.as_str()).collect();
    let count = |motion| scene.bodies.iter().filter(|body| body.motion == motion).count();
    Ok(CheckedScene {
        name: scene.name.clone(),
        bodies: scene.bodies.len() - 1,
        free_bodies: count(BodyMotion::Free),
        jointed_bodies: count(BodyMotion::Jointed),
        categories: categories.len(),
        notes,
        findings: locate(findings, &scene_file(path))?,
    })
}

/// Adds file and line to each finding.
fn locate(findings: Vec<Finding>, file: &Path) -> Result<Vec<Located>, WorldError> {
    let source = Source::read(file)?;
    let semantics_file = file.with_file_name(SEMANTICS_FILE);
    let semantics = std::fs::read_to_string(&semantics_file).unwrap_or_default();
    let in_scene = |body: &str| {
        let names = [format!("name=\"{body}\""), format!("name='{body}'")];
        let at = names.iter().filter_map(|name| source.text.find(name.as_str())).min();
        at.map_or((file.to_owned(), None), |at| {
            let place = source.place(at);
            (place.file, place.line)
        })
    };
    let in_semantics = |text: &str| {
        let line = semantics.lines().position(|line| line.contains(text)).map(|index| index as u32 + 1);
        (semantics_file.clone(), line)
    };
    let place_of = |finding: &Finding| match finding {
        Finding::Overlap { body, .. } | Finding::Moves { body, .. } | Finding::Unlisted { body } => in_scene(body),
        Finding::Unreachable { room, .. } => in_semantics(&format!("\"{room}\"")),
        Finding::NoStartArea => in_semantics("[start]"),
    };
    let located = |finding: Finding| {
        let (file, line) = place_of(&finding);
        Located { finding, file, line }
    };
    Ok(findings.into_iter().map(located).collect())
}

/// Bodies that overlap: free ones by more than a millimetre, fixed ones by more than is common in construction.
pub(crate) fn find_overlaps(scene: &SceneModel, solids: &Solids) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, body) in scene.bodies.iter().enumerate().skip(1) {
        for (other_index, other) in scene.bodies.iter().enumerate() {
            let free = [body.motion, other.motion].map(|motion| motion == BodyMotion::Free);
            // Each pair once: a free body against fixed ones, else the later against the earlier.
            let once = if free[0] == free[1] { other_index > index || other_index == 0 } else { free[0] };
            if other_index == index || !once {
                continue;
            }
            let depth = solids.find_depth_m((index, &body.world_from_body), (other_index, &other.world_from_body), 0.0);
            let allowed_m = if free[0] { OVERLAP_M } else { FIXED_OVERLAP_M };
            if let Some(depth_m) = depth.filter(|depth| *depth > allowed_m) {
                findings.push(Finding::Overlap { body: body.name.clone(), other: other.name.clone(), depth_m });
            }
        }
    }
    findings
}

/// Bodies that can move and are elsewhere after coming to rest; `settled` holds the poses of all bodies.
pub fn find_movers(scene: &SceneModel, settled: &[Pose]) -> Vec<Finding> {
    let movable = scene.bodies.iter().zip(settled).filter(|(body, _)| body.motion != BodyMotion::Fixed);
    movable
        .filter_map(|(body, settled)| {
            let motion = body.world_from_body.inv_mul(settled);
            let (distance_m, turn_rad) = (motion.translation.vector.norm(), motion.rotation.angle());
            let moves = distance_m > REST_MOVE_M || turn_rad > REST_TURN_RAD;
            moves.then(|| Finding::Moves { body: body.name.clone(), distance_m, turn_rad })
        })
        .collect()
}

fn find_unlisted(scene: &SceneModel, semantics: &Semantics) -> Vec<Finding> {
    // What moves on a joint belongs to what carries it unless it is listed.
    let things = scene.bodies.iter().skip(1).filter(|body| body.motion != BodyMotion::Jointed);
    let unlisted = things.filter(|body| semantics.find_object(&body.name).is_none());
    unlisted.map(|body| Finding::Unlisted { body: body.name.clone() }).collect()
}

#[cfg(test)]
mod tests;
