//! Scenes: MJCF geometry and `semantics.toml`.

mod bodies;
mod check;
mod defaults;
mod doorways;
mod error;
mod generate;
mod geom;
mod grammar;
mod joints;
mod lint;
mod live;
mod load;
mod mesh;
mod model;
mod msh;
mod names;
mod notes;
mod reach;
mod semantics;
mod source;
mod surface;
mod survey;
mod ties;

pub use check::{CheckedScene, Finding, Located, RobotSize, check_scene, find_movers};
pub use error::{Place, SceneError};
pub use generate::{
    Doorways, Furniture, GenerateError, GeneratedScene, HomeConfig, ImportError, generate_home, import_ithor,
};
pub use joints::{JointMotion, SceneJoint};
pub use load::scene_file;
pub use model::{
    BodyMotion, LightKind, MassSpread, SceneBody, SceneGeom, SceneLight, SceneMaterial, SceneMesh, SceneModel,
    SceneShape, SceneTexture, SceneTie, TextureSpan,
};
pub(crate) use names::name_of_part;
pub use notes::{Effect, SceneNote, summarise_notes};
pub use semantics::{
    ObjectSemantics, Placement, RoomSemantics, SEMANTICS_FILE, Semantics, SemanticsError, StartArea, StartAreas,
    WeightClass,
};
pub use survey::{Frame, Outcome, Stage, SurveyedScene, survey_scene};
