//! Scenes: MJCF geometry and `semantics.toml`.

mod bodies;
mod check;
mod error;
mod generate;
mod grammar;
mod lint;
mod load;
mod mesh;
mod model;
mod reach;
mod semantics;
mod source;
mod surface;

pub use bodies::HeldJoint;
pub use check::{CheckedScene, Finding, Located, RobotSize, check_scene, find_movers};
pub use error::{Place, SceneError};
pub use generate::{GenerateError, GeneratedScene, HomeConfig, ImportError, generate_home, import_ithor};
pub use load::scene_file;
pub use model::{
    BodyMotion, LightKind, SceneBody, SceneGeom, SceneLight, SceneMaterial, SceneMesh, SceneModel, SceneShape,
    SceneTexture, TextureSpan,
};
pub use semantics::{
    ObjectSemantics, Placement, RoomSemantics, SEMANTICS_FILE, Semantics, SemanticsError, StartArea, StartAreas,
    WeightClass,
};
