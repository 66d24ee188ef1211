//! Scenes and queries, one JSON object a line.

use crate::geometry::{Aabb, OrientedBox};
use crate::map::{Map, MapChange, MapObject, MapPoint, MapUpdate, ObjectId, Votes};
use crate::time::Stamp;
use nalgebra::{Point3, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;
use thiserror::Error;

/// A line that cannot be read.
#[derive(Debug, Error)]
#[error("line {line}: {source}")]
pub struct DataError {
    /// Number of the line, from 1.
    pub line: usize,
    /// What is wrong.
    pub source: serde_json::Error,
}

/// One box of a scene. Metres, z up, right-handed.
#[derive(Clone, Debug, Deserialize)]
pub struct BoxObject {
    /// Identity in the scene's own type.
    pub id: serde_json::Value,
    /// Name.
    pub label: String,
    /// Centre.
    pub center: [f64; 3],
    /// Side lengths along the axes.
    pub size: [f64; 3],
    /// Mean colour, sRGB, 0 to 255.
    pub mean_rgb: Option<[f64; 3]>,
    /// Where its front points, unit, when known.
    #[serde(default)]
    pub front: Option<[f64; 3]>,
    /// Score of a detection, 0 to 1.
    #[serde(default)]
    pub score: Option<f32>,
}

/// One scene.
#[derive(Clone, Debug, Deserialize)]
pub struct SceneLine {
    /// Identity; `#det` at the end marks detected boxes.
    pub scene_id: String,
    /// Its boxes.
    pub objects: Vec<BoxObject>,
}

/// A true box.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct TargetBox {
    /// Centre, metres.
    pub center: [f64; 3],
    /// Side lengths along the axes, metres.
    pub size: [f64; 3],
}

/// One query. Every field of truth may be absent.
#[derive(Clone, Debug, Deserialize)]
pub struct QueryLine {
    /// Data set: `nr3d`, `sr3d`, `scanrefer_gt`, `scanrefer_det`.
    pub dataset: String,
    /// Identity.
    pub query_id: String,
    /// The scene it speaks of.
    pub scene_id: String,
    /// What was said.
    pub utterance: String,
    /// Truth: identity of the target.
    #[serde(default)]
    pub target_id: Option<serde_json::Value>,
    /// Truth: box of the target, for detected scenes.
    #[serde(default)]
    pub target_box: Option<TargetBox>,
    /// More than two objects of the class.
    #[serde(default)]
    pub hard: Option<bool>,
    /// The only object of the class.
    #[serde(default)]
    pub unique: Option<bool>,
    /// Its words depend on a viewer.
    #[serde(default)]
    pub view_dependent: Option<bool>,
    /// Relation type (Sr3D).
    #[serde(default)]
    pub reference_type: Option<String>,
}

fn read_lines<T: serde::de::DeserializeOwned>(text: &str) -> Result<Vec<T>, DataError> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(i, line)| serde_json::from_str(line).map_err(|source| DataError { line: i + 1, source })).collect()
}

/// Scenes by identity.
///
/// # Errors
/// The first line that is no scene.
pub fn read_scenes(text: &str) -> Result<BTreeMap<String, SceneLine>, DataError> {
    Ok(read_lines(text)?.into_iter().map(|scene: SceneLine| (scene.scene_id.clone(), scene)).collect())
}

/// Queries in order.
///
/// # Errors
/// The first line that is no query.
pub fn read_queries(text: &str) -> Result<Vec<QueryLine>, DataError> {
    read_lines(text)
}

impl TargetBox {
    /// As a box.
    pub fn aabb(&self) -> Aabb {
        let half = Vector3::from(self.size) * 0.5;
        let center = Point3::from(self.center);
        Aabb { min: center - half, max: center + half }
    }
}

impl SceneLine {
    /// The known fronts in the floor plane, by [`ObjectId`].
    pub fn fronts(&self) -> BTreeMap<ObjectId, [f64; 2]> {
        let fronts = self.objects.iter().enumerate();
        fronts.filter_map(|(i, object)| Some((ObjectId(i as u64), object.front.map(|[x, y, _]| [x, y])?))).collect()
    }

    /// The boxes as a map. [`ObjectId`]s are positions in `objects`; colours become one point at the centre.
    pub fn import(&self) -> Map {
        let mut map = Map::new(0.05);
        let put = |(i, object): (usize, &BoxObject)| {
            let mut names = Votes::default();
            names.add(&object.label, object.score.unwrap_or(1.0).clamp(1e-3, 1.0));
            let bounds = TargetBox { center: object.center, size: object.size }.aabb();
            let point = |rgb: [f64; 3]| MapPoint {
                position: bounds.center().cast(),
                color: rgb.map(|channel| channel.clamp(0.0, 255.0) as u8),
            };
            let points = object.mean_rgb.map(point).into_iter().collect();
            let given = MapObject::given(ObjectId(i as u64), names, OrientedBox::from(bounds));
            MapChange::Put(Box::new(MapObject { points, ..given }))
        };
        let changes = self.objects.iter().enumerate().map(put).collect();
        map.apply(MapUpdate { stamp: Stamp::default(), changes });
        map
    }
}
