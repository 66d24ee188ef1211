//! A parsed scene, free of any physics engine.

use super::joints::SceneJoint;
use dsm::Pose;
use nalgebra::{Matrix3, Point3, Vector3};

/// How a body may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyMotion {
    /// Welded to the world.
    Fixed,
    /// Six degrees of freedom.
    Free,
    /// One degree of freedom against another body: see [`SceneModel::joints`].
    Jointed,
}

/// A solid shape in its own frame, centred at the origin; axis of revolution along z. Metres.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneShape {
    /// The half space z <= 0; half extents of the drawn rectangle.
    Plane {
        /// Half extents along x and y; 0 means unbounded.
        half_m: [f64; 2],
    },
    /// A box.
    Box {
        /// Half extents.
        half_m: Vector3<f64>,
    },
    /// A sphere.
    Sphere {
        /// Radius.
        radius_m: f64,
    },
    /// A cylinder.
    Cylinder {
        /// Radius.
        radius_m: f64,
        /// Half length.
        half_length_m: f64,
    },
    /// A capsule.
    Capsule {
        /// Radius.
        radius_m: f64,
        /// Half length without the caps.
        half_length_m: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Radii.
        radii_m: Vector3<f64>,
    },
    /// A mesh of [`SceneModel::meshes`].
    Mesh {
        /// Index of the mesh.
        mesh: usize,
    },
}

/// One geom.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneGeom {
    /// Its name, if any.
    pub name: Option<String>,
    /// Pose in its body.
    pub body_from_geom: Pose,
    /// Shape.
    pub shape: SceneShape,
    /// Index into [`SceneModel::materials`].
    pub material: usize,
    /// Sliding friction coefficient.
    pub friction: f64,
    /// Whether it takes part in collisions.
    pub collides: bool,
    /// Kinds that it is of, as bits. Two geoms of a scene touch when one is of a kind that the other touches; 1 unless the
    /// scene says otherwise. The robot touches all that collides.
    pub kinds: u32,
    /// Kinds that it touches, as bits; 1 unless the scene says otherwise.
    pub touches: u32,
    /// Whether it is drawn.
    pub visible: bool,
}

/// One body with all that is rigidly attached to it.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneBody {
    /// Unique name; the world's own geoms belong to body 0, `world`.
    pub name: String,
    /// Initial pose.
    pub world_from_body: Pose,
    /// How it moves.
    pub motion: BodyMotion,
    /// Mass in kilograms; 0 for fixed bodies.
    pub mass_kg: f64,
    /// How the mass is spread, when the scene says so; else by volume over what collides.
    pub spread: Option<MassSpread>,
    /// Geoms.
    pub geoms: Vec<SceneGeom>,
}

/// Centre and tensor of inertia of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassSpread {
    /// Centre of mass in the body's frame, metres.
    pub center_in_body: Point3<f64>,
    /// Tensor about it along the body's axes, kg m^2.
    pub inertia_kg_m2: Matrix3<f64>,
}

/// Two bodies that a scene holds together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneTie {
    /// Indices of the bodies; at least one of them moves.
    pub bodies: [usize; 2],
    /// Frame of the tie in either body: they are held one upon the other.
    pub body_from_tie: [Pose; 2],
    /// Whether turning is held too (MJCF `weld`), or only the place (`connect`).
    pub rigid: bool,
}

/// What the repetitions of a texture count along.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureSpan {
    /// The whole face or the whole turn (MJCF `texuniform="false"`).
    #[default]
    Face,
    /// One metre of surface (MJCF `texuniform="true"`).
    Metre,
    /// Each of the six sides of a cube around the thing, once (MJCF `type="cube"`).
    Cube,
}

/// A surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneMaterial {
    /// Name.
    pub name: String,
    /// Colour, linear multiplier of the texture, 0 to 1, with alpha.
    pub rgba: [f32; 4],
    /// Index into [`SceneModel::textures`].
    pub texture: Option<usize>,
    /// Texture repetitions along u and v, per metre or per face as [`SceneMaterial::texture_span`] says.
    pub texture_repeat: [f32; 2],
    /// What one unit of `texture_repeat` spans.
    pub texture_span: TextureSpan,
    /// Specularity, 0 to 1.
    pub specular: f32,
    /// Shininess, 0 to 1.
    pub shininess: f32,
    /// How far it is a metal, 0 to 1.
    pub metallic: f32,
    /// Emission, 0 to 1.
    pub emission: f32,
}

/// An image for surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneTexture {
    /// Name.
    pub name: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// sRGB, row-major.
    pub rgb: Vec<[u8; 3]>,
}

/// A triangle mesh, metres, outward winding counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneMesh {
    /// Name.
    pub name: String,
    /// Vertices.
    pub positions: Vec<Point3<f32>>,
    /// Vertex normals; empty when they are to be computed.
    pub normals: Vec<Vector3<f32>>,
    /// Texture coordinates; empty when there are none.
    pub uvs: Vec<[f32; 2]>,
    /// Triangles.
    pub indices: Vec<[u32; 3]>,
}

/// Kind of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel rays along a direction (unit, pointing away from the light).
    Directional {
        /// Direction of travel.
        direction: Vector3<f32>,
    },
    /// From a point.
    Point {
        /// Position in the world.
        position: Point3<f32>,
    },
}

/// A light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneLight {
    /// Kind and place.
    pub kind: LightKind,
    /// Diffuse colour, 0 to 1.
    pub diffuse: [f32; 3],
    /// Ambient colour, 0 to 1.
    pub ambient: [f32; 3],
    /// Whether it throws shadows, if it can.
    pub casts_shadow: bool,
}

/// A parsed scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneModel {
    /// Name of the scene.
    pub name: String,
    /// Bodies; index 0 is `world`. Those on joints come last, carriers before what they carry.
    pub bodies: Vec<SceneBody>,
    /// Joints between bodies, in the order of the bodies that they move: one for each jointed body.
    pub joints: Vec<SceneJoint>,
    /// Materials.
    pub materials: Vec<SceneMaterial>,
    /// Textures.
    pub textures: Vec<SceneTexture>,
    /// Meshes.
    pub meshes: Vec<SceneMesh>,
    /// Lights.
    pub lights: Vec<SceneLight>,
    /// Bodies that a scene holds together.
    pub ties: Vec<SceneTie>,
    /// Pairs of bodies that never touch each other, the lesser index first, sorted.
    pub excluded: Vec<[usize; 2]>,
}
