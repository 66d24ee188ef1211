//! Labelled surface against truth: the paper's protocol for Replica.
//!
//! Every object of the map gets one label of the truth: the one whose words mean most the same ([`super::labeller`]).
//! Every true surface point takes the label of the nearest map point within 25 cm, or none. Points weigh by the area that
//! they stand for. Only classes that the truth holds count, so an object whose label the truth does not hold is
//! wrong where it covers others and nowhere else.
//!
//! - mAcc: mean over the classes of the share of their surface with the right label.
//! - F-mIoU: mean over the classes of intersection over union. Background (walls, floors, doors; what a class file
//!   excludes) is no class, its points are left out and no object can be one: the F stands for foreground.

use super::class_file::LabelClasses;
use super::labelled_cloud::{LabelledCloud, LabelledPoint};
use super::labeller::{EmbeddedLabeller, Labeller, LabellerError, describe};
use super::nearest::PointGrid;
use super::scene::TrueScene;
use crate::knowledge::Knowledge;
use crate::map::{Map, MapObject, ObjectId};
use nalgebra::Point3;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Farthest map point whose label a true point takes, metres.
const REACH_M: f32 = 0.25;
/// Every n-th surface point of a scene is looked at.
const STRIDE: usize = 3;

/// Means over the classes, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Segmentation {
    /// Mean over the classes of the share of their surface with the right label.
    pub(super) mean_accuracy: f64,
    /// Mean over the classes of intersection over union.
    pub(super) mean_iou: f64,
    /// The same, weighted by each class's true surface.
    pub(super) weighted_iou: f64,
    /// Number of classes.
    pub(super) classes: usize,
}

/// Surface of one class, in the unit of the points' areas.
#[derive(Clone, Copy, Default)]
struct Class {
    truth: f64,
    said: f64,
    right: f64,
    points: usize,
}

/// What was counted over all points.
#[derive(Default)]
struct Tally {
    /// By place among the labels.
    classes: BTreeMap<usize, Class>,
    /// Points with no map point in reach.
    unreached: usize,
}

/// The score of one class.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassScore {
    /// Its name.
    pub name: String,
    /// Points of the truth.
    pub points: usize,
    /// Share of its surface with the right label.
    pub accuracy: f64,
    /// Intersection over union.
    pub iou: f64,
}

/// The class of an object of the map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LabelledObject {
    /// The object.
    pub object_id: ObjectId,
    /// Its name in the map.
    pub name: String,
    /// The class that it was given.
    pub class: String,
}

/// A map scored against a labelled cloud.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CloudScore {
    /// What gave the objects their classes: `embedded` or `answers`.
    pub labeller: String,
    /// mAcc, 0 to 1.
    pub mean_accuracy: f64,
    /// F-mIoU, 0 to 1.
    pub mean_iou: f64,
    /// Intersection over union, weighted by each class's true surface.
    pub weighted_iou: f64,
    /// Every class that the truth holds, in alphabetical order.
    pub classes: Vec<ClassScore>,
    /// Classes of the file that the truth does not hold; they do not count.
    pub absent: Vec<String>,
    /// Classes that the file excludes.
    pub excluded: Vec<String>,
    /// Points that count.
    pub points: usize,
    /// Points of them with no map point within 25 cm: wrong, whatever their class.
    pub unreached_points: usize,
    /// Points of excluded classes.
    pub excluded_points: usize,
    /// Points whose label the class file does not list; left out.
    pub unlisted_points: usize,
    /// Stable objects of the map with their classes.
    pub objects: Vec<LabelledObject>,
}

pub(super) fn segment(map: &Map, truth: &TrueScene, knowledge: &Arc<Knowledge>) -> Segmentation {
    let labels = truth.categories();
    let objects: Vec<&MapObject> = map.stable_objects().collect();
    let mut labeller = EmbeddedLabeller::new(knowledge.clone());
    let label_of: Vec<usize> = objects.iter().map(|object| labeller.find_closest(object, &labels)).collect();
    let points = truth.objects.iter().filter_map(|thing| {
        let own = labels.binary_search(&thing.category.as_str()).ok()?;
        Some(thing.points.iter().filter(|p| p.seen).step_by(STRIDE).map(move |p| (p.position, p.area_m2, own)))
    });
    let tally = Tally::new(&objects, &label_of, points.flatten());
    let counted = tally.counted().count();
    let (mean_accuracy, mean_iou, weighted_iou) = tally.means();
    Segmentation { mean_accuracy, mean_iou, weighted_iou, classes: counted }
}

/// Scores a map against a labelled cloud.
///
/// # Errors
/// What the labeller cannot answer, and a truth without a point of a class that counts.
pub fn score_cloud(
    map: &Map,
    truth: &LabelledCloud,
    classes: &LabelClasses,
    labeller: &mut dyn Labeller,
) -> Result<CloudScore, LabellerError> {
    let names = |exclude: bool| {
        let mut names: Vec<&str> =
            classes.classes.iter().filter(|c| c.exclude == exclude).map(|c| c.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        names
    };
    let (labels, excluded) = (names(false), names(true));
    // `None` for what is excluded.
    let place_of: BTreeMap<i64, Option<usize>> =
        classes.classes.iter().map(|class| (class.label, labels.binary_search(&class.name.as_str()).ok())).collect();
    let (mut excluded_points, mut unlisted_points) = (0, 0);
    let counts = |point: &LabelledPoint| match place_of.get(&point.label) {
        Some(Some(place)) => Some((point.position, point.area_m2, *place)),
        Some(None) => {
            excluded_points += 1;
            None
        }
        None => {
            unlisted_points += 1;
            None
        }
    };
    let points: Vec<(Point3<f32>, f32, usize)> = truth.points.iter().filter_map(counts).collect();
    if points.is_empty() {
        return Err(LabellerError::NoPoint { classes: labels.iter().map(|&label| label.to_owned()).collect() });
    }
    let objects: Vec<&MapObject> = map.stable_objects().collect();
    let choose = |object: &&MapObject| labeller.choose(object, &describe(object), &labels);
    let label_of = objects.iter().map(choose).collect::<Result<Vec<usize>, LabellerError>>()?;
    let tally = Tally::new(&objects, &label_of, points.iter().copied());
    let (mean_accuracy, mean_iou, weighted_iou) = tally.means();
    let score = |(place, class): (usize, &Class)| ClassScore {
        name: labels[place].to_owned(),
        points: class.points,
        accuracy: class.right / class.truth,
        iou: class.iou(),
    };
    let scores: Vec<ClassScore> = tally.counted().map(score).collect();
    let is_absent = |label: &&&str| !scores.iter().any(|score| score.name == **label);
    let absent = labels.iter().filter(is_absent).map(|&label| label.to_owned()).collect();
    let labelled = |(object, label): (&&MapObject, &usize)| LabelledObject {
        object_id: object.id,
        name: object.name().to_owned(),
        class: labels[*label].to_owned(),
    };
    Ok(CloudScore {
        labeller: labeller.name().to_owned(),
        mean_accuracy,
        mean_iou,
        weighted_iou,
        absent,
        classes: scores,
        excluded: excluded.into_iter().map(str::to_owned).collect(),
        points: points.len(),
        unreached_points: tally.unreached,
        excluded_points,
        unlisted_points,
        objects: objects.iter().zip(&label_of).map(labelled).collect(),
    })
}

impl Class {
    fn iou(&self) -> f64 {
        self.right / (self.truth + self.said - self.right)
    }
}

impl Tally {
    /// Gives each true point the label of the nearest point of the objects.
    fn new(objects: &[&MapObject], label_of: &[usize], truth: impl Iterator<Item = (Point3<f32>, f32, usize)>) -> Self {
        let points =
            objects.iter().zip(0u32..).flat_map(|(o, index)| o.points.iter().map(move |p| (p.position, index)));
        let grid = PointGrid::new(0.05, points);
        let mut tally = Self::default();
        for (position, area, own) in truth {
            let area = f64::from(area);
            let said = grid.find(&position, REACH_M).map(|(object, _)| label_of[object as usize]);
            let class = tally.classes.entry(own).or_default();
            class.truth += area;
            class.points += 1;
            match said {
                Some(said) => tally.classes.entry(said).or_default().said += area,
                None => tally.unreached += 1,
            }
            if said == Some(own) {
                tally.classes.entry(own).or_default().right += area;
            }
        }
        tally
    }

    /// Classes that the truth holds.
    fn counted(&self) -> impl Iterator<Item = (usize, &Class)> {
        self.classes.iter().filter(|(_, class)| class.truth > 0.0).map(|(place, class)| (*place, class))
    }

    /// Mean accuracy, mean IoU and IoU weighted by surface.
    fn means(&self) -> (f64, f64, f64) {
        let n = self.counted().count().max(1) as f64;
        let all: f64 = self.counted().map(|(_, class)| class.truth).sum();
        let accuracy = self.counted().map(|(_, class)| class.right / class.truth).sum::<f64>() / n;
        let iou = self.counted().map(|(_, class)| class.iou()).sum::<f64>() / n;
        let weighted = self.counted().map(|(_, class)| class.iou() * class.truth).sum::<f64>();
        (accuracy, iou, weighted / all.max(1e-12))
    }
}
