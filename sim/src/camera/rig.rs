//! The scene and the robot as a camera sees them.

use super::light::{LightDraw, dimmed, find_main};
use super::shapes;
use super::visual::{RobotVisual, as_solid};
use crate::scene::{SceneMaterial, SceneMesh, SceneModel, SceneShape, TextureSpan};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::raster::{
    Image, Instance, Light, Material, MaterialIndex, MeshError, MeshIndex, RenderOptions, Renderer, Scene, Texture,
    TextureError, TextureIndex,
};
use dsm_robot::model::shapes::{Geometry, Mesh as PartMesh};
use nalgebra::Point3;
use std::sync::Arc;
use thiserror::Error;

/// Colour, depth and labels without any noise.
pub type TrueImage = Image;

/// Label of every robot link.
pub const ROBOT_LABEL: u32 = u32::MAX;

/// Index of the world in `SceneModel::bodies`.
const WORLD: usize = 0;

/// Label of a scene body by its index in `SceneModel::bodies`; 0 is the background.
pub fn label_of_body(body: usize) -> u32 {
    body as u32 + 1
}

/// Why a scene cannot be drawn.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// A mesh is broken.
    #[error("mesh `{name}`: {source}")]
    Mesh {
        /// Its name.
        name: String,
        /// What is wrong.
        source: MeshError,
    },
    /// A texture is broken.
    #[error("texture `{name}`: {source}")]
    Texture {
        /// Its name.
        name: String,
        /// What is wrong.
        source: TextureError,
    },
    /// Something refers to a thing that does not exist.
    #[error("{owner} refers to {kind} {index}, but there are {count}")]
    Missing {
        /// What refers to it.
        owner: String,
        /// What kind of thing.
        kind: &'static str,
        /// Its index.
        index: usize,
        /// How many there are.
        count: usize,
    },
}

/// What an instance moves with.
#[derive(Clone, Copy, Debug)]
enum Carrier {
    Body(usize),
    Link(usize),
}

/// Draws the scene and the robot. Geometry is prepared once; each image only moves it.
#[derive(Debug)]
pub struct CameraRig {
    scene: Scene,
    /// For each instance: what it moves with, and its pose there.
    carried: Vec<(Carrier, Pose)>,
    /// For each body the one that it is seen as, and where it is in that one at the start.
    wholes: Vec<(usize, Pose)>,
    /// The light that throws shadows.
    main_light: Option<usize>,
    /// All light there is: of each of the scene's, and from everywhere.
    full_light: (Vec<Light>, [f32; 3]),
    renderer: Renderer,
    options: RenderOptions,
}

impl CameraRig {
    /// Prepares the geometry of a scene and a robot, with the lights that the seed draws.
    pub fn new(model: &SceneModel, visuals: &[RobotVisual], light: &LightDraw) -> Result<Self, CameraError> {
        let mut builder = Builder::new(model)?;
        for (index, body) in model.bodies.iter().enumerate() {
            for geom in body.geoms.iter().filter(|geom| geom.visible) {
                let material = get(&model.materials, geom.material, &body.name, "material")?;
                if material.rgba[3] >= VISIBLE_ALPHA {
                    let look = builder.add_material(material, &body.name)?;
                    let mesh =
                        builder.find_or_add_mesh(&model.meshes, &geom.shape, material.texture_span, &body.name)?;
                    builder.place(mesh, look, label_of_body(index), Carrier::Body(index), geom.body_from_geom);
                }
            }
        }
        for visual in visuals.iter().filter(|visual| visual.rgba[3] >= VISIBLE_ALPHA) {
            let [red, green, blue, _] = visual.rgba;
            let material = Material { color: [red, green, blue], specular: 0.15, ..Material::default() };
            let look = builder.scene.add_material(material);
            let mesh = builder.find_or_add_part(&visual.geometry)?;
            builder.place(mesh, look, ROBOT_LABEL, Carrier::Link(visual.link), visual.link_from_shape);
        }
        let Builder { mut scene, carried, .. } = builder;
        let full_light = light.apply(&model.lights);
        (scene.lights, scene.ambient) = full_light.clone();
        let main_light = find_main(&model.lights);
        let wholes = (0..model.bodies.len()).map(|body| (body, Pose::identity())).collect();
        let (renderer, options) = (Renderer::default(), RenderOptions::default());
        Ok(Self { scene, carried, wholes, main_light, full_light, renderer, options })
    }

    /// The same with the label of the body that each body is seen as: `wholes` says which.
    pub fn showing(mut self, model: &SceneModel, wholes: &[usize]) -> Self {
        for (instance, (carrier, _)) in self.scene.instances.iter_mut().zip(&self.carried) {
            if let Carrier::Body(body) = *carrier {
                instance.label = label_of_body(wholes[body]);
            }
        }
        let pose = |body: usize| model.bodies[body].world_from_body;
        let within = |(body, whole): (usize, &usize)| (*whole, pose(*whole).inv_mul(&pose(body)));
        self.wholes = wholes.iter().enumerate().map(within).collect();
        self
    }

    /// Sets the share of the light that is there from the next image on, 0 to 1.
    pub fn set_light(&mut self, share: f32) {
        let (lights, ambient) = &self.full_light;
        self.scene.lights = lights.iter().map(|light| dimmed(*light, share)).collect();
        self.scene.ambient = ambient.map(|light| light * share);
        // What lies beyond the walls is not lit by what is inside, but a window is no lamp either.
        let gamma = share.powf(1.0 / 2.2);
        self.options.background = RenderOptions::default().background.map(|c| (f32::from(c) * gamma).round() as u8);
    }

    /// The true image of one camera. `body_poses` (world from body) follow `SceneModel::bodies`, `link_poses` (world from
    /// link) the link numbers of the visuals; what has no pose is not drawn.
    pub fn render(
        &mut self,
        body_poses: &[Pose],
        link_poses: &[Pose],
        model: &CameraModel,
        world_from_camera: &Pose,
    ) -> TrueImage {
        let mut image = TrueImage::default();
        self.render_into(body_poses, link_poses, model, world_from_camera, &mut image);
        image
    }

    /// As [`CameraRig::render`], into buffers that are used again.
    pub fn render_into(
        &mut self,
        body_poses: &[Pose],
        link_poses: &[Pose],
        model: &CameraModel,
        world_from_camera: &Pose,
        image: &mut TrueImage,
    ) {
        for (instance, (carrier, carrier_from_shape)) in self.scene.instances.iter_mut().zip(&self.carried) {
            let carrier_pose = match *carrier {
                Carrier::Body(body) => body_poses.get(body),
                Carrier::Link(link) => link_poses.get(link),
            };
            // A shape without a pose goes far behind every far plane.
            let nowhere = Pose::translation(0.0, 0.0, -1e6);
            instance.world_from_mesh = carrier_pose.map_or(nowhere, |pose| pose * carrier_from_shape);
        }
        if let Some(light) = self.main_light {
            self.scene.cast_shadows(light);
        }
        self.renderer.render_into(&self.scene, model, world_from_camera, &self.options, image);
    }

    /// Calls `visit` with the index of a scene body and a triangle of it, in the body's frame, for all that is drawn. What is
    /// seen as a part of another body is a part of that one, as it is at the start.
    pub(crate) fn visit_triangles(&self, mut visit: impl FnMut(usize, [Point3<f64>; 3])) {
        for (instance, (carrier, part_from_shape)) in self.scene.instances.iter().zip(&self.carried) {
            let Carrier::Body(part) = *carrier else { continue };
            let (body, body_from_part) = self.wholes[part];
            let body_from_shape = if body == part { *part_from_shape } else { body_from_part * part_from_shape };
            let mesh = self.scene.mesh(instance.mesh);
            let corner = |vertex: u32| body_from_shape * mesh.positions()[vertex as usize].cast::<f64>();
            mesh.indices().iter().for_each(|triangle| visit(body, triangle.map(corner)));
        }
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.scene.triangle_count()
    }
}

/// What is more transparent than this is not drawn; all else is opaque.
pub const VISIBLE_ALPHA: f32 = 0.05;
/// MuJoCo's default strength of highlights in its lights.
const LIGHT_SPECULAR: f32 = 0.3;
/// MuJoCo's shininess 1 is this exponent.
const SHININESS_MAX: f32 = 128.0;

struct Builder {
    scene: Scene,
    carried: Vec<(Carrier, Pose)>,
    /// Shapes that are the same share a mesh.
    solids: Vec<(SceneShape, TextureSpan, MeshIndex)>,
    parts: Vec<(Arc<PartMesh>, MeshIndex)>,
    textures: Vec<TextureIndex>,
}

impl Builder {
    fn new(model: &SceneModel) -> Result<Self, CameraError> {
        let mut scene = Scene::default();
        let mut textures = Vec::new();
        for texture in &model.textures {
            let made = Texture::new(texture.width, texture.height, &texture.rgb)
                .map_err(|source| CameraError::Texture { name: texture.name.clone(), source })?;
            textures.push(scene.add_texture(made));
        }
        Ok(Self { scene, carried: Vec::new(), solids: Vec::new(), parts: Vec::new(), textures })
    }

    fn add_material(&mut self, material: &SceneMaterial, body: &str) -> Result<MaterialIndex, CameraError> {
        let texture = match material.texture {
            Some(index) => Some(*get(&self.textures, index, body, "texture")?),
            None => None,
        };
        let [red, green, blue, _] = material.rgba;
        Ok(self.scene.add_material(Material {
            color: [red, green, blue].map(|c| c.clamp(0.0, 1.0)),
            texture,
            texture_repeat: material.texture_repeat,
            specular: material.specular * LIGHT_SPECULAR,
            shininess: (material.shininess * SHININESS_MAX).max(1.0),
            metallic: material.metallic,
            emission: material.emission,
        }))
    }

    fn find_or_add_mesh(
        &mut self,
        meshes: &[SceneMesh],
        shape: &SceneShape,
        span: TextureSpan,
        owner: &str,
    ) -> Result<MeshIndex, CameraError> {
        let known = self.solids.iter().find(|(known, counted, _)| known == shape && *counted == span);
        if let Some((_, _, index)) = known {
            return Ok(*index);
        }
        let made = match shape {
            SceneShape::Mesh { mesh } => {
                let mesh = get(meshes, *mesh, owner, "mesh")?;
                shapes::mesh(mesh, span).map_err(|source| CameraError::Mesh { name: mesh.name.clone(), source })?
            }
            _ => shapes::solid(shape, span).map_err(|source| CameraError::Mesh { name: owner.to_owned(), source })?,
        };
        let index = self.scene.add_mesh(made);
        self.solids.push((shape.clone(), span, index));
        Ok(index)
    }

    /// The mesh of a part of the robot; parts of the same file share it.
    fn find_or_add_part(&mut self, geometry: &Geometry) -> Result<MeshIndex, CameraError> {
        let part = match as_solid(geometry) {
            Ok(solid) => return self.find_or_add_mesh(&[], &solid, TextureSpan::Face, "robot"),
            Err(mesh) => mesh,
        };
        if let Some((_, index)) = self.parts.iter().find(|(known, _)| Arc::ptr_eq(known, part)) {
            return Ok(*index);
        }
        let made =
            shapes::part(part).map_err(|source| CameraError::Mesh { name: part.file.display().to_string(), source })?;
        let index = self.scene.add_mesh(made);
        self.parts.push((part.clone(), index));
        Ok(index)
    }

    fn place(&mut self, mesh: MeshIndex, material: MaterialIndex, label: u32, carrier: Carrier, place: Pose) {
        // The world's own geoms are floors and walls. A scene has no ceilings, so its walls would throw the shadows of a
        // ruin; the main light stands for what comes through windows and from lamps.
        let casts_shadow = !matches!(carrier, Carrier::Body(WORLD));
        self.scene.instances.push(Instance { mesh, material, world_from_mesh: place, label, casts_shadow });
        self.carried.push((carrier, place));
    }
}

fn get<'a, T>(items: &'a [T], index: usize, owner: &str, kind: &'static str) -> Result<&'a T, CameraError> {
    let missing = || CameraError::Missing { owner: owner.to_owned(), kind, index, count: items.len() };
    items.get(index).ok_or_else(missing)
}
