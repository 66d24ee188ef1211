//! Masks of a detector against those of the true image, which stays in this crate: whatever they are called.

use crate::camera::{ROBOT_LABEL, TrueImage, label_of_body};
use crate::scene::{SceneModel, Semantics};
use dsm::eval::Share;
use dsm::perceive::Detection;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Intersection over union from which a mask shows a thing; no two masks can reach it for one thing.
const SAME: f64 = 0.5;
/// Fewest pixels of a thing that should be found.
const LEAST_PX: usize = 400;
/// Greatest mean depth of such a thing, metres.
const FARTHEST_M: f64 = 5.0;

/// Counts over frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MaskScore {
    /// Things with 400 pixels or more within 5 m, and those of them that a mask shows with an IoU of a half or more.
    pub recall: Share,
    /// Masks, and those of them that show a thing so. What lies on the robot itself does not count.
    pub precision: Share,
}

/// Which labels are things.
pub(super) struct ThingLabels {
    is_thing: Vec<bool>,
}

impl ThingLabels {
    pub(super) fn new(scene: &SceneModel, semantics: &Semantics) -> Self {
        let count = label_of_body(scene.bodies.len()) as usize;
        let mut is_thing = vec![false; count];
        for (body, known) in scene.bodies.iter().enumerate() {
            is_thing[label_of_body(body) as usize] = semantics.find_object(&known.name).is_some();
        }
        Self { is_thing }
    }

    fn holds(&self, label: u32) -> bool {
        self.is_thing.get(label as usize).copied().unwrap_or(false)
    }

    /// Counts the masks of one image in.
    pub(super) fn count(&self, image: &TrueImage, masks: &[Detection], score: &mut MaskScore) {
        // Pixels and sum of depths of each thing.
        let mut things: BTreeMap<u32, (usize, f64)> = BTreeMap::new();
        for (label, depth) in image.labels.iter().zip(&image.depth_m).filter(|(label, _)| self.holds(**label)) {
            let thing = things.entry(*label).or_default();
            *thing = (thing.0 + 1, thing.1 + f64::from(*depth));
        }
        let mut shown: BTreeMap<u32, bool> = BTreeMap::new();
        for mask in masks {
            let mut common: BTreeMap<u32, usize> = BTreeMap::new();
            for label in mask.mask.pixels().filter_map(|pixel| image.labels.get(pixel)) {
                *common.entry(*label).or_default() += 1;
            }
            let area = mask.mask.area();
            if 2 * common.get(&ROBOT_LABEL).copied().unwrap_or(0) > area {
                continue;
            }
            let same = |(label, count): (&u32, &usize)| {
                let (pixels, _) = things.get(label)?;
                (*count as f64 >= SAME * (pixels + area - count) as f64).then_some(*label)
            };
            let thing = common.iter().find_map(same);
            score.precision.add(thing.is_some());
            shown.extend(thing.map(|label| (label, true)));
        }
        for (label, (pixels, depth)) in &things {
            if *pixels >= LEAST_PX && *depth <= FARTHEST_M * *pixels as f64 {
                score.recall.add(shown.contains_key(label));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a mask counts for the thing that it shares half of both with; the robot and the far do not count.
    use super::*;
    use dsm::perceive::Mask;

    #[test]
    fn masks_count_by_their_overlap() {
        const WIDTH: u32 = 100;
        // Columns 0..30 thing 2, 30..60 thing 3, 60..80 structure, the rest robot; 100 rows.
        let label = |column: u32| [2, 2, 2, 3, 3, 3, 1, 1, ROBOT_LABEL, ROBOT_LABEL][column as usize / 10];
        let labels: Vec<u32> = (0..WIDTH * 100).map(|pixel| label(pixel % WIDTH)).collect();
        let mut image = TrueImage { width: 100, height: 100, depth_m: vec![2.0; labels.len()], ..TrueImage::default() };
        image.labels = labels;
        let known = ThingLabels { is_thing: vec![false, false, true, true] };
        let mask = |from: u32, to: u32| {
            let pixels = (0..WIDTH * 100).filter(|pixel| (from..to).contains(&(pixel % WIDTH)));
            Detection { mask: Mask::from_sorted_pixels(WIDTH, pixels), name: "object".into(), score: 1.0 }
        };
        let count = |image: &TrueImage, masks: &[Detection]| {
            let mut score = MaskScore::default();
            known.count(image, masks, &mut score);
            [score.recall.hits, score.recall.count, score.precision.hits, score.precision.count]
        };
        assert_eq!(count(&image, &[mask(0, 30), mask(30, 70)]), [2, 2, 2, 2]);
        assert_eq!(count(&image, &[mask(0, 60), mask(60, 80)]), [1, 2, 1, 2], "one mask for both shows half of each");
        assert_eq!(count(&image, &[mask(0, 14), mask(14, 30), mask(80, 100)]), [1, 2, 1, 2]);
        image.depth_m.fill(6.0);
        assert_eq!(count(&image, &[mask(0, 30)]), [0, 0, 1, 1]);
    }
}
