//! `semantics.toml`: what the bodies of a scene are, where the robot may start, and what the seed moves.
//!
//! The category is what the simulated detector calls a thing. Everything else about an object is for evaluation alone.

use super::error::{Place, SceneError};
use super::model::SceneModel;
use super::names::find_category;
use dsm::config::{ConfigError, find_nearest, parse_toml};
use dsm::knowledge::Knowledge;
use nalgebra::Point2;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Name of the file beside `scene.xml`.
pub const SEMANTICS_FILE: &str = "semantics.toml";

/// What is wrong with `semantics.toml`.
#[derive(Debug, Error, PartialEq)]
pub enum SemanticsError {
    /// The file itself.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// It does not fit the scene.
    #[error(transparent)]
    Scene(Box<SceneError>),
}

impl From<SceneError> for SemanticsError {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}

/// What a scene's bodies are.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Semantics {
    /// Version of this format; 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Name of the scene.
    pub name: String,
    /// Where the robot may start.
    #[serde(default)]
    pub start: StartAreas,
    /// Every body that counts as an object. Walls, floors and doors are not listed.
    #[serde(default, rename = "object")]
    pub objects: Vec<ObjectSemantics>,
    /// Rooms, for evaluation.
    #[serde(default, rename = "room")]
    pub rooms: Vec<RoomSemantics>,
}

/// Where the robot may start: the seed picks one area, a position in it and any heading.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartAreas {
    /// Rectangles along the world's axes.
    #[serde(default)]
    pub areas: Vec<StartArea>,
}

/// A rectangle along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartArea {
    /// Middle along x in metres, world frame.
    pub x_m: f64,
    /// Middle along y in metres, world frame.
    pub y_m: f64,
    /// Half side along x in metres; default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub half_x_m: f64,
    /// Half side along y in metres; default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub half_y_m: f64,
}

/// How heavy a thing is, for evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WeightClass {
    /// Below about 0.5 kg.
    Light,
    /// Up to about 5 kg.
    Medium,
    /// More.
    Heavy,
}

/// What one body is.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectSemantics {
    /// Name of the body in `scene.xml`.
    pub body: String,
    /// What it is, lower case, as a detector would call it.
    #[schemars(length(min = 1))]
    pub category: String,
    /// True colour in words; for evaluation.
    #[serde(default)]
    pub color: Option<String>,
    /// True material; for evaluation.
    #[serde(default)]
    pub material: Option<String>,
    /// True pattern of its surface; for evaluation.
    #[serde(default)]
    pub pattern: Option<String>,
    /// How heavy it is; for evaluation.
    #[serde(default)]
    pub weight_class: Option<WeightClass>,
    /// What it can be used for; for evaluation.
    #[serde(default)]
    pub affordances: Vec<String>,
    /// How far the seed may move it; absent = it stays.
    #[serde(default)]
    pub placement: Option<Placement>,
}

/// Half ranges by which the seed moves a body, and what it carries, from its pose in the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Along the world's x in metres; default 0, 0 to 5.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub x_m: f64,
    /// Along the world's y in metres; default 0, 0 to 5.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub y_m: f64,
    /// About the vertical through the body's origin in radians; default 0, 0 to 3.15.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 3.15))]
    pub yaw_rad: f64,
}

/// A room.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoomSemantics {
    /// Its name.
    pub name: String,
    /// Corners in the world frame, metres, in order.
    #[schemars(length(min = 3))]
    pub polygon: Vec<[f64; 2]>,
}

impl RoomSemantics {
    /// Whether the point (metres, world frame) lies inside.
    pub fn contains(&self, point: Point2<f64>) -> bool {
        let corners = &self.polygon;
        let crosses = (0..corners.len()).filter(|&i| {
            let ([x1, y1], [x2, y2]) = (corners[i], corners[(i + 1) % corners.len()]);
            (y1 > point.y) != (y2 > point.y) && point.x < (x2 - x1) * (point.y - y1) / (y2 - y1) + x1
        });
        crosses.count() % 2 == 1
    }
}

impl Semantics {
    /// Loads the `semantics.toml` beside a scene file and holds it against the scene. Without the file, every body
    /// that is not the world is an object and its name tells its category; see [`Self::from_body_names`].
    ///
    /// # Errors
    /// A misspelt key, a value out of range, a body that the scene does not have or that is listed twice.
    pub fn load(scene_file: &Path, scene: &SceneModel) -> Result<Self, SemanticsError> {
        let file = scene_file.with_file_name(SEMANTICS_FILE);
        if !file.exists() {
            let stem = scene_file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
            return Ok(Self::from_names(scene, &stem.unwrap_or_default()));
        }
        let text = std::fs::read_to_string(&file).map_err(|error| SceneError::Unreadable {
            file: file.clone(),
            reason: error.to_string(),
            expected: "a semantics file (TOML)".to_owned(),
        })?;
        let semantics: Self = parse_toml(&text, &file)?;
        semantics.check_bodies(scene, &text, &file)?;
        Ok(semantics)
    }

    /// Categories from body names, by what is commonly known: `akita_black_bowl_1` is a `bowl`. Bodies that nobody sees and
    /// parts of the building (floors, walls, doors) are no objects.
    pub fn from_body_names(scene: &SceneModel) -> Self {
        Self::from_names(scene, "")
    }

    /// As [`Self::from_body_names`]; what no name of a body tells, the stem of the file or the model's name may tell.
    fn from_names(scene: &SceneModel, stem: &str) -> Self {
        let knowledge = Knowledge::embedded().ok();
        let shown = |index: usize| scene.bodies[index].geoms.iter().any(|geom| geom.visible);
        // A door is seen as a part of its cupboard; the cupboard may show nothing but its doors.
        let is_part = |index: usize| scene.joints.iter().any(|joint| joint.part == index && joint.carrier != 0);
        let has_parts = |index: usize| scene.joints.iter().any(|j| scene.hangs_on(j.part, index) && shown(j.part));
        let things = (1..scene.bodies.len()).filter(|index| !is_part(*index) && (shown(*index) || has_parts(*index)));
        let shown = things.map(|index| &scene.bodies[index]);
        let objects = shown.filter_map(|body| {
            let category = find_category(knowledge.as_ref(), &body.name, &[stem, &scene.name])?;
            Some(ObjectSemantics { body: body.name.clone(), category, ..ObjectSemantics::default() })
        });
        Self { version: 1, name: scene.name.clone(), objects: objects.collect(), ..Self::default() }
    }

    /// For each body of the scene the one that it is seen as: itself, but what moves on a joint is a part of what carries it
    /// unless it is listed.
    pub fn find_wholes(&self, scene: &SceneModel) -> Vec<usize> {
        let mut wholes: Vec<usize> = (0..scene.bodies.len()).collect();
        // Carriers come before what they carry.
        for joint in &scene.joints {
            if self.find_object(&scene.bodies[joint.part].name).is_none() {
                wholes[joint.part] = wholes[joint.carrier];
            }
        }
        wholes
    }

    /// What a body is, if it is an object.
    pub fn find_object(&self, body: &str) -> Option<&ObjectSemantics> {
        self.objects.iter().find(|object| object.body == body)
    }

    /// The room that a point (metres, world frame) lies in.
    pub fn find_room(&self, point: Point2<f64>) -> Option<&RoomSemantics> {
        self.rooms.iter().find(|room| room.contains(point))
    }

    fn check_bodies(&self, scene: &SceneModel, text: &str, file: &Path) -> Result<(), SceneError> {
        let names = || scene.bodies.iter().skip(1).map(|body| body.name.as_str());
        for (index, object) in self.objects.iter().enumerate() {
            let place = |nth| find_place(text, file, &object.body, nth);
            if !names().any(|name| name == object.body) {
                return Err(SceneError::UnknownReference {
                    place: place(0),
                    kind: "body",
                    name: object.body.clone(),
                    nearest: find_nearest(&object.body, names()).map(str::to_owned),
                    known: names().map(str::to_owned).collect(),
                });
            }
            if self.objects[..index].iter().any(|earlier| earlier.body == object.body) {
                return Err(SceneError::Duplicate {
                    place: place(1),
                    kind: "object of body",
                    name: object.body.clone(),
                    first: place(0),
                });
            }
        }
        Ok(())
    }
}

/// The line of the `nth` mention of a body.
fn find_place(text: &str, file: &Path, body: &str, nth: usize) -> Place {
    let quoted = [format!("\"{body}\""), format!("'{body}'")];
    let mentions = |line: &str| {
        let line = line.trim_start();
        line.starts_with("body") && quoted.iter().any(|name| line.contains(name.as_str()))
    };
    let line = text.lines().enumerate().filter(|(_, line)| mentions(line)).nth(nth);
    Place { file: PathBuf::from(file), line: line.map(|(index, _)| index as u32 + 1) }
}

#[cfg(test)]
mod tests {
    //! Contract: a semantics file fits its scene or says with file and line why not.
    use super::*;
    use crate::scene::{BodyMotion, SceneBody, SceneGeom, SceneShape};
    use dsm::Pose;

    fn scene(names: &[&str]) -> SceneModel {
        let body = |name: &&str| SceneBody {
            name: (*name).to_owned(),
            world_from_body: Pose::identity(),
            motion: BodyMotion::Fixed,
            mass_kg: 0.0,
            spread: None,
            geoms: vec![],
        };
        SceneModel {
            name: "test".to_owned(),
            bodies: std::iter::once("world").chain(names.iter().copied()).map(|n| body(&n)).collect(),
            materials: vec![],
            textures: vec![],
            meshes: vec![],
            lights: vec![],
            ..SceneModel::default()
        }
    }

    fn load(text: &str, names: &[&str]) -> Result<Semantics, String> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join(SEMANTICS_FILE), text).expect("written");
        Semantics::load(&folder.path().join("scene.xml"), &scene(names)).map_err(|error| error.to_string())
    }

    #[test]
    fn categories_come_from_the_names_of_bodies_that_are_seen() {
        let mut scene = scene(&["apple_1", "floor_lamp_2", "TV", "wall_3", "hidden"]);
        let geom = SceneGeom {
            name: None,
            body_from_geom: Pose::identity(),
            shape: SceneShape::Sphere { radius_m: 0.1 },
            material: 0,
            friction: 0.5,
            collides: true,
            kinds: 1,
            touches: 1,
            visible: true,
        };
        scene.bodies[1..].iter_mut().for_each(|body| body.geoms.push(geom.clone()));
        scene.bodies[5].geoms[0].visible = false;
        let semantics = Semantics::from_body_names(&scene);
        let categories: Vec<&str> = semantics.objects.iter().map(|o| o.category.as_str()).collect();
        assert_eq!(categories, ["apple", "floor lamp", "tv"]);
    }

    #[test]
    fn an_unknown_body_names_its_line_and_the_nearest_body() {
        let text = "version = 1\nname = \"t\"\n[[object]]\nbody = \"aple_1\"\ncategory = \"apple\"\n";
        let error = load(text, &["apple_1"]).expect_err("there is no such body");
        assert!(error.contains("semantics.toml:4: there is no body `aple_1`; did you mean `apple_1`?"), "{error}");
    }

    #[test]
    fn a_body_listed_twice_names_both_lines() {
        let object = "[[object]]\nbody = \"apple_1\"\ncategory = \"apple\"\n";
        let error = load(&format!("version = 1\nname = \"t\"\n{object}{object}"), &["apple_1"]).expect_err("twice");
        assert!(error.contains("toml:7: object of body `apple_1` exists already"), "{error}");
    }

    #[test]
    fn misspelt_keys_and_values_out_of_range_name_their_line() {
        let head = "version = 1\nname = \"t\"\n[[object]]\nbody = \"apple_1\"\n";
        let error = load(&format!("{head}categry = \"apple\"\n"), &["apple_1"]).expect_err("misspelt");
        assert!(error.contains(":5: unknown key") && error.contains("did you mean `category`?"), "{error}");
        let error = load(&format!("{head}category = \"apple\"\nplacement = {{ x_m = -1.0 }}\n"), &["apple_1"]);
        assert!(error.expect_err("negative").contains(":6: `object[0].placement.x_m` is -1.0; expected >= 0"));
    }

    #[test]
    fn a_room_contains_what_its_polygon_encloses() {
        let room = RoomSemantics {
            name: "l".to_owned(),
            polygon: vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]],
        };
        assert!(room.contains(Point2::new(0.5, 1.5)) && room.contains(Point2::new(1.5, 0.5)));
        assert!(!room.contains(Point2::new(1.5, 1.5)) && !room.contains(Point2::new(-0.1, 0.5)));
    }
}
