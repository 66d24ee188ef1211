//! What is true of a scene and what a drive has seen of it.

use super::TrueRoom;
use super::class_file::{LabelClass, LabelClasses};
use super::labelled_cloud::{LabelledCloud, LabelledPoint};
use crate::geometry::OrientedBox;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Frames in which an object must show well before it counts as seen.
const SEEN_FRAMES: u32 = 3;

/// A point of a true surface, world frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfacePoint {
    /// Where, metres.
    pub position: Point3<f32>,
    /// Outward, unit length.
    pub normal: Vector3<f32>,
    /// Surface that it stands for, square metres.
    pub area_m2: f32,
    /// Whether a frame showed it within range.
    pub seen: bool,
}

/// What an object is like, in the words of the scene's author; absent where the author said nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrueAttributes {
    /// Colour.
    pub color: Option<String>,
    /// Material.
    pub material: Option<String>,
    /// Pattern of the surface; absent for plain ones.
    pub pattern: Option<String>,
    /// `light`, `medium` or `heavy`.
    pub weight: Option<String>,
    /// What it can be used for.
    pub affordances: Vec<String>,
}

/// One object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueThing {
    /// What it is.
    pub category: String,
    /// What it is like.
    pub attributes: TrueAttributes,
    /// Upright box around all of its visible geometry, also of sides that no frame showed.
    pub bounds: OrientedBox,
    /// Points spread evenly over its surface.
    pub points: Vec<SurfacePoint>,
    /// Frames with at least 150 of its pixels and 30 % of the surface that faces the camera.
    pub frames_seen: u32,
}

/// A scene at the end of a drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueScene {
    /// Its name.
    pub name: String,
    /// Its rooms.
    pub rooms: Vec<TrueRoom>,
    /// Its objects. Walls, floors and doors are none.
    pub objects: Vec<TrueThing>,
}

impl TrueScene {
    /// What its things are, in alphabetical order.
    pub(super) fn categories(&self) -> Vec<&str> {
        let mut categories: Vec<&str> = self.objects.iter().map(|thing| thing.category.as_str()).collect();
        categories.sort_unstable();
        categories.dedup();
        categories
    }

    /// The surface that was seen as a labelled cloud, and what its labels mean: one class per category, numbered from 1 in
    /// alphabetical order.
    pub fn to_labelled(&self) -> (LabelledCloud, LabelClasses) {
        let categories = self.categories();
        let mut points = Vec::new();
        for thing in &self.objects {
            let Ok(place) = categories.binary_search(&thing.category.as_str()) else { continue };
            let label = place as i64 + 1;
            let seen = thing.points.iter().filter(|point| point.seen);
            points.extend(seen.map(|p| LabelledPoint { position: p.position, label, area_m2: p.area_m2 }));
        }
        let class = |(name, label): (&&str, i64)| LabelClass { label, name: (*name).to_owned(), exclude: false };
        (LabelledCloud { points }, LabelClasses::new(categories.iter().zip(1..).map(class).collect()))
    }
}

impl TrueThing {
    /// Whether it counts as seen: it showed well in three frames.
    pub fn is_seen(&self) -> bool {
        self.frames_seen >= SEEN_FRAMES
    }
}
