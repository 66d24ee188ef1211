//! The CPU rasteriser: colour, depth and labels of a scene of triangles and points, from one pass.
//!
//! ```text
//! Scene ──setup──▶ triangles in pixels ──visibility──▶ nearest surface per pixel ──shade──▶ Image
//! ```
//!
//! The visibility stage keeps the inverse depth and the number of the nearest triangle of each pixel; only what is seen is
//! shaded. Bands of rows own their pixels and handle triangles in order, and of two surfaces at the same depth the one
//! that stands first in the scene wins, so the image is the same for any number of threads.
//!
//! One directional light may throw shadows ([`Scene::cast_shadows`]): they are read from a map along the light that is
//! kept from image to image.
//!
//! Neighbouring triangles share an edge exactly: no pixel between them is lost or drawn twice.
//!
//! ```
//! use dsm::camera::CameraModel;
//! use dsm::raster::{Instance, Light, Material, Mesh, RenderOptions, Scene, render};
//! use nalgebra::Vector3;
//!
//! let mut scene = Scene::default();
//! let mesh = scene.add_mesh(Mesh::cuboid(Vector3::new(0.5, 0.5, 0.5)));
//! let material = scene.add_material(Material::default());
//! let world_from_mesh = dsm::Pose::translation(0.0, 0.0, 3.0);
//! scene.instances.push(Instance { mesh, material, world_from_mesh, label: 7, casts_shadow: true });
//! let camera = CameraModel::from_vertical_fov(64, 48, 1.0);
//! // The camera stands at the origin and looks along world z.
//! let image = render(&scene, &camera, &dsm::Pose::identity(), &RenderOptions::default());
//! let centre = 24 * 64 + 32;
//! assert_eq!(image.labels[centre], 7);
//! assert!((image.depth_m[centre] - 2.5).abs() < 1e-5);
//! ```

mod image;
mod lighting;
mod mesh;
mod primitives;
mod renderer;
mod scene;
mod setup;
mod shade;
mod shadow;
mod texture;
mod triangle;
mod visibility;

pub use image::{Image, linear_from_srgb, srgb_from_linear};
pub use mesh::{Mesh, MeshError};
pub use renderer::{RenderOptions, Renderer, look_at, render};
pub use scene::{Instance, Light, Material, MaterialIndex, MeshIndex, Scene, Splats, TextureIndex};
pub use texture::{Texture, TextureError};
