//! What a scene file says and this simulator does otherwise or not at all: nothing is dropped unsaid.

use super::defaults::{Defaults, is_default};
use super::source::Source;
use roxmltree::{Document, Node};
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// What becomes of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// A joint: what hangs on it is rigidly attached. So are ball joints, several joints of one body, joints that something
    /// acts on, and those of parts without mass or without anything that collides.
    HeldFast,
    /// It acts on joints, which are held fast for that.
    NoJoints,
    /// It constrains something that is not simulated.
    NotConstrained,
    /// It is not read.
    NotRead,
    /// It is at rest: only other programs would move it.
    StandsStill,
    /// It collides with nothing and would fall for ever, so it stays where it stands.
    TouchesNothing,
    /// Another value counts here.
    OtherValue,
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::HeldFast => "held fast: what hangs on it does not move",
            Self::NoJoints => "without effect: the joints that it acts on are held fast",
            Self::NotConstrained => "not simulated: it holds nothing",
            Self::NotRead => "not read",
            Self::StandsStill => "at rest: nothing here moves it",
            Self::TouchesNothing => "held in place: it collides with nothing and would fall for ever",
            Self::OtherValue => "not followed: every world has gravity of 9.80665 m/s2 downwards and no wind",
        })
    }
}

/// An element of a scene file that is not done as the file says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SceneNote {
    /// The file.
    pub file: PathBuf,
    /// The line, from 1.
    pub line: Option<u32>,
    /// The element with the block that it stands in, such as `joint` or `equality/connect`.
    pub element: String,
    /// Its name, or that of its body.
    pub name: Option<String>,
    /// What becomes of it.
    pub effect: Effect,
}

impl fmt::Display for SceneNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        self.line.map_or(Ok(()), |line| write!(f, ":{line}"))?;
        let name = self.name.as_ref().map(|name| format!(" `{name}`")).unwrap_or_default();
        write!(f, ": <{}>{name} is {}", self.element, self.effect)
    }
}

/// One line for all notes of the same kind of element and effect, by the first one and their number.
pub fn summarise_notes(notes: &[SceneNote]) -> Vec<String> {
    let mut groups: Vec<(&SceneNote, usize)> = Vec::new();
    for note in notes {
        let known = groups.iter_mut().find(|(first, _)| first.element == note.element && first.effect == note.effect);
        match known {
            Some((_, count)) => *count += 1,
            None => groups.push((note, 1)),
        }
    }
    let line = |(first, count): (&SceneNote, usize)| match count {
        1 => first.to_string(),
        _ => format!("{first} (and {} more of the kind)", count - 1),
    };
    groups.into_iter().map(line).collect()
}

/// Collects notes from the document.
pub(super) struct Notes<'a> {
    source: &'a Source,
    pub list: Vec<SceneNote>,
}

impl<'a> Notes<'a> {
    pub(super) fn new(source: &'a Source) -> Self {
        Self { source, list: Vec::new() }
    }

    /// Notes an element.
    pub(super) fn add(&mut self, node: Node<'_, '_>, effect: Effect) {
        let tag = node.tag_name().name();
        let block = node.parent().map(|parent| parent.tag_name().name()).filter(|block| {
            matches!(*block, "equality" | "tendon" | "actuator" | "sensor" | "keyframe" | "contact" | "custom")
        });
        let place = self.source.place(node.range().start);
        let holder = || node.ancestors().skip(1).find_map(|a| a.has_tag_name("body").then(|| a.attribute("name")));
        self.list.push(SceneNote {
            file: place.file,
            line: place.line,
            element: block.map_or_else(|| tag.to_owned(), |block| format!("{block}/{tag}")),
            name: node.attribute("name").or_else(|| holder().flatten()).map(str::to_owned),
            effect,
        });
    }

    /// Notes all that the document tells; `live` are the bodies whose joints move.
    pub(super) fn walk<'d>(&mut self, document: &'d Document<'d>, defaults: &Defaults<'d>, live: &[Node<'d, 'd>]) {
        let moves = |joint: Node<'d, 'd>| {
            let body = joint.ancestors().find(|ancestor| ancestor.has_tag_name("body"));
            body.is_some_and(|body| live.contains(&body))
        };
        let elements = document.root_element().descendants().filter(Node::is_element);
        for node in elements.filter(|node| !is_default(node) && !node.has_tag_name("default")) {
            let block = node.parent().map(|parent| parent.tag_name().name()).unwrap_or_default();
            let effect = match (block, node.tag_name().name()) {
                ("body" | "frame", "joint") if moves(node) => continue,
                ("body" | "frame", "joint") if defaults.find(node, "type") != Some("free") => Effect::HeldFast,
                ("body" | "frame" | "worldbody", "body") if node.attribute("mocap") == Some("true") => {
                    Effect::StandsStill
                }
                ("equality", "joint" | "tendon") | ("actuator", _) | ("tendon", "fixed") => Effect::NoJoints,
                ("equality", "connect" | "weld") => continue,
                ("equality", _) | ("tendon", _) => Effect::NotConstrained,
                ("sensor" | "custom" | "keyframe", _) | ("contact", "pair") => Effect::NotRead,
                ("mujoco", "option") if !is_usual_option(node) => Effect::OtherValue,
                ("option", "flag") if switches_off_forces(node) => Effect::OtherValue,
                ("mujoco", "compiler") if has_total_mass(node) => Effect::NotRead,
                (_, "light") if defaults.find(node, "mode").is_some_and(|mode| mode != "fixed") => Effect::StandsStill,
                ("asset", "texture") if is_folded(node) => Effect::NotRead,
                _ => continue,
            };
            self.add(node, effect);
        }
    }
}

fn numbers(node: Node<'_, '_>, attribute: &str) -> Option<Vec<f64>> {
    Some(node.attribute(attribute)?.split_ascii_whitespace().flat_map(str::parse).collect())
}

/// Gravity as everywhere on earth, and nothing that blows.
fn is_usual_option(option: Node<'_, '_>) -> bool {
    /// Gravity differs by less from pole to equator, m/s^2.
    const SPREAD: f64 = 0.06;
    let earthly = |g: Vec<f64>| g.len() == 3 && g[0].abs().max(g[1].abs()) < SPREAD && (g[2] + 9.80665).abs() < SPREAD;
    let none = |attribute| numbers(option, attribute).is_none_or(|values| values.iter().all(|v| *v == 0.0));
    numbers(option, "gravity").is_none_or(earthly) && none("wind") && none("density") && none("viscosity")
}

fn switches_off_forces(flag: Node<'_, '_>) -> bool {
    ["contact", "gravity", "constraint", "equality"].iter().any(|name| flag.attribute(*name) == Some("disable"))
}

fn has_total_mass(compiler: Node<'_, '_>) -> bool {
    numbers(compiler, "settotalmass").is_some_and(|mass| mass.first().is_some_and(|mass| *mass > 0.0))
}

/// Whether a cube has several pictures; all its sides show one here. A skybox is not drawn at all.
fn is_folded(texture: Node<'_, '_>) -> bool {
    let sides = ["fileright", "fileleft", "fileup", "filedown", "filefront", "fileback", "gridlayout"];
    texture.attribute("type") != Some("skybox") && sides.iter().any(|side| texture.has_attribute(*side))
}
