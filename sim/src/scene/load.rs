//! From a scene file to a [`SceneModel`].

use super::bodies::{Context, build_bodies, to_pose};
use super::defaults::Defaults;
use super::error::{Place, SceneError};
use super::lint::check_document;
use super::mesh::load_meshes;
use super::model::SceneModel;
use super::notes::{Effect, Notes, SceneNote};
use super::source::Source;
use super::surface::{Materials, load_lights, load_textures};
use super::ties::{find_excluded, find_ties};
use dsm::Pose;
use roxmltree::{Document, Node};
use std::path::{Path, PathBuf};

/// The file of a scene: `path` itself, or `scene.xml` in that folder.
pub fn scene_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("scene.xml") } else { path.to_owned() }
}

impl SceneModel {
    /// Loads an MJCF scene from its file or the folder that holds `scene.xml`.
    ///
    /// What the file says and this simulator does otherwise is left out; [`Self::load_with_notes`] lists it.
    ///
    /// # Errors
    /// Whatever is wrong with the scene, with file, line and what was expected.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Ok(Self::load_with_notes(path)?.0)
    }

    /// Loads a scene, and lists what in it is not done as the file says, such as ball joints, which are held fast.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with_notes(path: &Path) -> Result<(Self, Vec<SceneNote>), SceneError> {
        let file = scene_file(path);
        let folder = file.parent().unwrap_or(Path::new("")).to_owned();
        let source = Source::read(&file)?;
        let document = Document::parse(&source.text).map_err(|error| SceneError::Xml {
            place: Place { file: file.clone(), line: None },
            reason: error.to_string(),
        })?;
        check_document(&document, &source)?;
        let model = mjcf_rs::Model::from_str(&without_shaped_sites(&source.text, &document), &folder)
            .map_err(|error| SceneError::Mjcf { file: file.clone(), reason: error.to_string() })?;
        let defaults = Defaults::new(&document);
        let textures = load_textures(&model, &document, &source, &folder)?;
        let meshes = load_meshes(&model, &document, &source, &folder)?;
        let mut materials = Materials::new(&model, &document, &defaults, &textures);
        let context = Context::new(&model, &meshes, &source, &document);
        let bodies = build_bodies(&context, &mut materials)?;
        let mut notes = Notes::new(&source);
        let live: Vec<_> = bodies.live.iter().filter_map(|id| context.node(*id)).collect();
        notes.walk(&document, &defaults, &live);
        bodies.untouchable.iter().filter_map(|id| context.node(*id)).for_each(|n| notes.add(n, Effect::TouchesNothing));
        let ties = find_ties(&model, &document, &bodies, &mut notes);
        let excluded = find_excluded(&model, &bodies);
        let lights = load_lights(&document, &defaults, |light| pose_of_owner(light, &model));
        let stem = folder.file_name().or(file.file_stem()).map(|s| s.to_string_lossy().into_owned());
        let scene = Self {
            name: model.name.clone().or(stem).unwrap_or_default(),
            bodies: bodies.bodies,
            joints: bodies.joints,
            materials: materials.list,
            textures,
            meshes,
            lights,
            ties,
            excluded,
        };
        Ok((scene, notes.list))
    }
}

/// The text with blanks where a site has a shape that the parser does not know: sites are marks, nothing uses their shape.
fn without_shaped_sites(text: &str, document: &Document<'_>) -> String {
    let mut text = text.to_owned();
    for site in document.descendants().filter(|node| node.has_tag_name("site")) {
        let kind =
            site.attribute_node("type").filter(|kind| matches!(kind.value(), "mesh" | "plane" | "hfield" | "sdf"));
        if let Some(kind) = kind {
            text.replace_range(kind.range(), &" ".repeat(kind.range().len()));
        }
    }
    text
}

/// World pose of the named body around a node; the identity in the world body.
fn pose_of_owner(node: Node<'_, '_>, model: &mjcf_rs::Model) -> Pose {
    let name = node.ancestors().find(|a| a.has_tag_name("body")).and_then(|body| body.attribute("name"));
    let mut pose = Pose::identity();
    let mut next = name.and_then(|name| model.body_id_by_name(name));
    while let Some(id) = next {
        pose = to_pose(&model.bodies[id].body.pose) * pose;
        next = model.bodies[id].parent;
    }
    pose
}
