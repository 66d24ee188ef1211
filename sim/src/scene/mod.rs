//! Scenes: MJCF geometry and `semantics.toml`.

mod model;

pub use model::{
    BodyMotion, LightKind, SceneBody, SceneGeom, SceneLight, SceneMaterial, SceneMesh, SceneModel, SceneShape,
    SceneTexture,
};
