//! What is drawn: meshes, materials, textures, lights and points.

use super::mesh::Mesh;
use super::shadow::ShadowMap;
use super::texture::Texture;
use crate::Pose;
use nalgebra::{Point3, Vector3};

/// A mesh of a scene, as [`Scene::add_mesh`] returned it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MeshIndex(pub(super) u32);

/// A material of a scene, as [`Scene::add_material`] returned it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MaterialIndex(pub(super) u32);

/// A texture of a scene, as [`Scene::add_texture`] returned it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TextureIndex(pub(super) u32);

/// How a surface looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Colour, sRGB, 0 to 1; multiplied with the texture.
    pub color: [f32; 3],
    /// Texture, if any.
    pub texture: Option<TextureIndex>,
    /// How often the texture repeats over texture coordinates 0 to 1, along u and v.
    pub texture_repeat: [f32; 2],
    /// Strength of highlights, 0 (matt) to 1.
    pub specular: f32,
    /// Sharpness of highlights: the exponent of Blinn and Phong, 1 (wide) to 200 (small).
    pub shininess: f32,
    /// How far it is a metal, 0 to 1: metals scatter little light and mirror their surroundings in their own colour.
    pub metallic: f32,
    /// Light that the surface gives off by itself, as a share of its colour, 0 to 1.
    pub emission: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            color: [0.5; 3],
            texture: None,
            texture_repeat: [1.0; 2],
            specular: 0.1,
            shininess: 20.0,
            metallic: 0.0,
            emission: 0.0,
        }
    }
}

/// A mesh at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Its shape.
    pub mesh: MeshIndex,
    /// Its look.
    pub material: MaterialIndex,
    /// Pose of the mesh frame in the world frame.
    pub world_from_mesh: Pose,
    /// What the label image holds where it is seen; 0 is the background.
    pub label: u32,
    /// Whether it throws a shadow; only closed meshes do.
    pub casts_shadow: bool,
}

/// A source of light. `color` is linear light that falls on a surface straight below, 1 per channel is full white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Parallel light, as from the sun.
    Directional {
        /// The direction in which it shines, world frame; any length but zero.
        direction_in_world: Vector3<f32>,
        /// Linear light.
        color: [f32; 3],
    },
    /// Light from a point, which falls to half at `range_m`.
    Point {
        /// Its place in the world frame.
        position_in_world: Point3<f32>,
        /// Linear light close to it.
        color: [f32; 3],
        /// Distance in metres at which the light is half as strong; above 0.
        range_m: f32,
    },
}

/// Points drawn as small discs in their own colours, unlit: how a map is drawn from what was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Points in the world frame, metres.
    pub points_in_world: Vec<Point3<f32>>,
    /// Colour of each point, sRGB.
    pub colors: Vec<[u8; 3]>,
    /// Radius of the discs in metres; a disc covers at least one pixel.
    pub radius_m: f32,
    /// What the label image holds where they are seen; 0 is the background.
    pub label: u32,
}

/// Everything that is drawn.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    meshes: Vec<Mesh>,
    textures: Vec<Texture>,
    materials: Vec<Material>,
    /// What stands where. The indices come from this scene's `add_*`.
    pub instances: Vec<Instance>,
    /// Points.
    pub splats: Vec<Splats>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Linear light from everywhere, 0 to 1. Surfaces that face down get half of it.
    pub ambient: [f32; 3],
    shadow: Option<ShadowMap>,
}

impl Scene {
    /// Throws the shadows of one of the lights, by its index, with the instances where they stand now. To be called again
    /// after instances moved; it costs little when few did. A light that is not directional throws none.
    ///
    /// The shadows follow from where the instances stand, not from how they got there. Only what lies around the
    /// instances of the first call is in reach.
    pub fn cast_shadows(&mut self, light: usize) {
        let known = self.shadow.take().filter(|shadow| shadow.is_of(self, light));
        self.shadow = known.or_else(|| ShadowMap::find(self, light));
        if let Some(mut shadow) = self.shadow.take() {
            shadow.update(self);
            self.shadow = Some(shadow);
        }
    }

    pub(super) fn shadow(&self) -> Option<&ShadowMap> {
        self.shadow.as_ref()
    }

    /// Adds a shape that instances can share.
    pub fn add_mesh(&mut self, mesh: Mesh) -> MeshIndex {
        self.meshes.push(mesh);
        MeshIndex(self.meshes.len() as u32 - 1)
    }

    /// Adds a texture that materials can share.
    pub fn add_texture(&mut self, texture: Texture) -> TextureIndex {
        self.textures.push(texture);
        TextureIndex(self.textures.len() as u32 - 1)
    }

    /// Adds a look that instances can share.
    pub fn add_material(&mut self, material: Material) -> MaterialIndex {
        self.materials.push(material);
        MaterialIndex(self.materials.len() as u32 - 1)
    }

    /// A mesh of this scene.
    pub fn mesh(&self, index: MeshIndex) -> &Mesh {
        &self.meshes[index.0 as usize]
    }

    /// A texture of this scene.
    pub fn texture(&self, index: TextureIndex) -> &Texture {
        &self.textures[index.0 as usize]
    }

    /// A material of this scene.
    pub fn material(&self, index: MaterialIndex) -> &Material {
        &self.materials[index.0 as usize]
    }

    pub(super) fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Number of triangles of all instances.
    pub fn triangle_count(&self) -> usize {
        self.instances.iter().map(|instance| self.mesh(instance.mesh).indices().len()).sum()
    }
}
