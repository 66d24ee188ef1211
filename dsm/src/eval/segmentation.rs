//! Labelled surface against truth: the paper's protocol for Replica.
//!
//! Every object of the map gets one label of the truth: the one whose words mean most the same. The template sentence of
//! the paper is [`describe`], for a language backend; the embedded one compares the tag alone, by [`Knowledge`] text features. Every true
//! surface point that a frame showed takes the label of the nearest map point within 25 cm, or none. Points weigh by the
//! area that they stand for. Classes are the categories of things of which something was seen; structure (walls, floors,
//! doors) is no class and its points are left out.

use super::nearest::PointGrid;
use super::scene::TrueScene;
use crate::knowledge::Knowledge;
use crate::map::{AttributeKind, Map, MapObject};
use crate::perceive::{KnowledgeTextEncoder, TextEncoder, cosine};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Farthest map point whose label a true point takes, metres.
const REACH_M: f32 = 0.25;

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

/// Surface of one class, square metres.
#[derive(Clone, Copy, Default)]
struct Class {
    truth: f64,
    said: f64,
    right: f64,
}

/// The template sentence: "This is o_tag, its appearance attributes include a_a, its physical attributes are a_p, and its affordance attributes
/// are a_o."
pub fn describe(object: &MapObject) -> String {
    let list = |kind: AttributeKind| {
        let words = object.attributes.iter().filter(|(k, _, _)| *k == kind);
        let words: Vec<&str> = words.filter_map(|(_, _, votes)| Some(votes.find_winner()?.0)).collect();
        words.join(", ")
    };
    format!(
        "This is {}, its appearance attributes include {}, its physical attributes are {}, and its affordance attributes \
         are {}.",
        object.name(),
        list(AttributeKind::Appearance),
        list(AttributeKind::Physical),
        list(AttributeKind::Affordance)
    )
}

pub(super) fn segment(map: &Map, truth: &TrueScene, knowledge: &Arc<Knowledge>) -> Segmentation {
    let encoder = KnowledgeTextEncoder::new(knowledge.clone());
    let mut labels: Vec<&str> = truth.objects.iter().map(|thing| thing.category.as_str()).collect();
    labels.sort_unstable();
    labels.dedup();
    let features: Vec<Vec<f32>> = labels.iter().map(|label| encoder.encode(label)).collect();
    let objects: Vec<&MapObject> = map.stable_objects().collect();
    let label_of: Vec<usize> = objects
        .iter()
        .map(|object| {
            let tag = encoder.encode(object.name());
            let likeness = features.iter().map(|feature| cosine(feature, &tag));
            likeness.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(label, _)| label)
        })
        .collect();
    let points = objects.iter().zip(0u32..).flat_map(|(o, index)| o.points.iter().map(move |p| (p.position, index)));
    let grid = PointGrid::new(0.05, points);
    let mut classes: BTreeMap<usize, Class> = BTreeMap::new();
    for thing in &truth.objects {
        let Ok(own) = labels.binary_search(&thing.category.as_str()) else { continue };
        for point in thing.points.iter().filter(|p| p.seen).step_by(3) {
            let area = f64::from(point.area_m2);
            let said = grid.find(&point.position, REACH_M).map(|(object, _)| label_of[object as usize]);
            classes.entry(own).or_default().truth += area;
            if let Some(said) = said {
                classes.entry(said).or_default().said += area;
            }
            if said == Some(own) {
                classes.entry(own).or_default().right += area;
            }
        }
    }
    let counted: Vec<Class> = classes.into_values().filter(|class| class.truth > 0.0).collect();
    let n = counted.len().max(1) as f64;
    let iou = |class: &Class| class.right / (class.truth + class.said - class.right);
    let all: f64 = counted.iter().map(|class| class.truth).sum();
    Segmentation {
        mean_accuracy: counted.iter().map(|class| class.right / class.truth).sum::<f64>() / n,
        mean_iou: counted.iter().map(iou).sum::<f64>() / n,
        weighted_iou: counted.iter().map(|class| iou(class) * class.truth).sum::<f64>() / all.max(1e-12),
        classes: counted.len(),
    }
}
