//! From a scene file to a [`SceneModel`].

use super::bodies::{Context, HeldJoint, build_bodies, to_pose};
use super::error::{Place, SceneError};
use super::lint::check_document;
use super::mesh::load_meshes;
use super::model::SceneModel;
use super::source::Source;
use super::surface::{Materials, load_lights, load_textures};
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
    /// Hinge, slide and ball joints are held fast; [`Self::load_with_joints`] lists them.
    ///
    /// # Errors
    /// Whatever is wrong with the scene, with file, line and what was expected.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Ok(Self::load_with_joints(path)?.0)
    }

    /// Loads a scene, and lists the joints in it that are held fast.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with_joints(path: &Path) -> Result<(Self, Vec<HeldJoint>), SceneError> {
        let file = scene_file(path);
        let folder = file.parent().unwrap_or(Path::new("")).to_owned();
        let source = Source::read(&file)?;
        let document = Document::parse(&source.text).map_err(|error| SceneError::Xml {
            place: Place { file: file.clone(), line: None },
            reason: error.to_string(),
        })?;
        check_document(&document, &source)?;
        let model = mjcf_rs::Model::from_str(&source.text, &folder)
            .map_err(|error| SceneError::Mjcf { file: file.clone(), reason: error.to_string() })?;
        let textures = load_textures(&model, &document, &source, &folder)?;
        let meshes = load_meshes(&model, &document, &source, &folder)?;
        let mut materials = Materials::new(&model, &document, &textures);
        let bodies = build_bodies(&Context::new(&model, &meshes, &source, &document), &mut materials)?;
        let lights = load_lights(&document, |light| pose_of_owner(light, &model));
        let stem = folder.file_name().or(file.file_stem()).map(|s| s.to_string_lossy().into_owned());
        let scene = Self {
            name: model.name.clone().or(stem).unwrap_or_default(),
            bodies: bodies.bodies,
            materials: materials.list,
            textures,
            meshes,
            lights,
        };
        Ok((scene, bodies.held))
    }
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
