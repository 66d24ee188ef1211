//! Multi view mapping: which observation shows which known object.
//!
//! S = s_v + s_g + s_c (paper, Multi View Mapping). A score below its own threshold adds 0 and vetoes nothing by itself;
//! candidates are gated by place first, because look and name alone cannot tell two equal mugs apart.

use super::config::BuildConfig;
use super::observation::Observation;
use crate::geometry::Aabb;
use crate::map::MapObject;
use crate::perceive::{UNNAMED, cosine};
use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;

/// Least common extent of two boxes along each axis in which both are long, as a share of the shorter one's ...
const LEAST_ALONG: f64 = 0.4;
/// ... and what is long, metres: several pose errors.
const LONG_M: f64 = 0.25;
/// s_c of things of which one has no name.
const UNNAMED_TEXT: f32 = 0.5;

/// The total score S; `None` when the place rules the pair out.
pub(super) fn find_score(
    config: &BuildConfig,
    observation: &Observation,
    object: &MapObject,
    aabb: &Aabb,
) -> Option<f64> {
    let geometric = find_geometric_score(config, &observation.bounds, aabb, observation.distance_m)?;
    let visual = cosine(&observation.visual_feature, &object.visual_feature);
    // Two things without names agree in nothing: neither for nor against.
    let unnamed = observation.name == UNNAMED || object.name() == UNNAMED;
    let text = if unnamed { UNNAMED_TEXT } else { cosine(&observation.text_feature, &object.text_feature) };
    let counted = |score: f64, threshold: f64| if score >= threshold { score } else { 0.0 };
    Some(
        counted(f64::from(visual), f64::from(config.visual_threshold))
            + counted(geometric, config.geometric_threshold)
            + counted(f64::from(text), if unnamed { 0.0 } else { f64::from(config.text_threshold) }),
    )
}

/// s_g of two boxes grown by the pose tolerance on every side, and the gate by place:
/// - the common volume must be a fifth of the smaller one's, else `None`;
/// - if both are small, their centres must be closer than half their mean width plus 2 cm plus 6 mm per metre of
///   distance (attitude error), but not more than that width, else `None`, and s_g is at
///   least `1 - d / (that distance + mean width)`: the IoU of mugs drops to nothing at 3 cm of pose error;
/// - s_g0 when one box lies inside the other (95 % of its volume), if that is more than the IoU;
/// - the IoU otherwise.
fn find_geometric_score(config: &BuildConfig, first: &Aabb, second: &Aabb, distance_m: f64) -> Option<f64> {
    let (a, b) = (first.grown(config.pose_tolerance_m), second.grown(config.pose_tolerance_m));
    let common = a.find_intersection(&b)?.volume_m3();
    let share = common / a.volume_m3().min(b.volume_m3()).max(1e-12);
    if share < 0.2 {
        return None;
    }
    // What stands in a row touches its neighbours: their boxes share a margin of their length, not half of it.
    let is_beside = |axis: usize| {
        let shorter = (a.max[axis] - a.min[axis]).min(b.max[axis] - b.min[axis]);
        shorter > LONG_M && a.max[axis].min(b.max[axis]) - a.min[axis].max(b.min[axis]) < LEAST_ALONG * shorter
    };
    if (0..3).any(is_beside) {
        return None;
    }
    let mut score = common / (a.volume_m3() + b.volume_m3() - common);
    if share >= 0.95 {
        score = score.max(config.containment_score);
    }
    let (sides, other_sides) = (first.size(), second.size());
    if sides.max() < config.small_object_m && other_sides.max() < config.small_object_m {
        let width = 0.25 * (sides.x + sides.y + other_sides.x + other_sides.y);
        let reach = (0.5 * width + 0.02 + 0.006 * distance_m).min(width.max(0.05));
        let distance = (first.center() - second.center()).norm();
        if (first.center() - second.center()).xy().norm() > reach {
            return None;
        }
        score = score.max(1.0 - distance / (reach + width));
    }
    Some(score)
}

/// One optimal one-to-one assignment (Kuhn-Munkres). `scores` holds (observation, candidate, S) for pairs above the
/// total threshold. Returns for each observation its candidate, if any.
pub(super) fn assign(observations: usize, candidates: usize, scores: &[(usize, usize, f64)]) -> Vec<Option<usize>> {
    if observations == 0 || candidates == 0 {
        return vec![None; observations];
    }
    // One extra column per observation stands for "new"; it weighs nothing.
    let mut weights = Matrix::new(observations, candidates + observations, 0i64);
    for &(observation, candidate, score) in scores {
        weights[(observation, candidate)] = (score * 1e6).round() as i64;
    }
    let (_, columns) = kuhn_munkres(&weights);
    columns
        .into_iter()
        .enumerate()
        .map(|(row, column)| (column < candidates && weights[(row, column)] > 0).then_some(column))
        .collect()
}

#[cfg(test)]
mod tests {
    //! Contract: no object is given to two observations, the total score is the largest possible, and the place decides
    //! between equal things.
    use super::*;
    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;

    fn cube(x: f64, side: f64) -> Aabb {
        let center = Point3::new(x, 0.0, 0.5);
        Aabb { min: center - Vector3::repeat(side / 2.0), max: center + Vector3::repeat(side / 2.0) }
    }

    #[test]
    fn optimal_beats_greedy() {
        // Greedy gives the first observation its best (1.9) and the second nothing that passes.
        let scores = [(0, 0, 1.9), (0, 1, 1.8), (1, 0, 1.85)];
        assert_eq!(assign(2, 2, &scores), vec![Some(1), Some(0)]);
    }

    #[test]
    fn place_rules_out_the_neighbour_but_not_a_shifted_view() {
        let config = BuildConfig::default();
        assert!(find_geometric_score(&config, &cube(0.0, 0.08), &cube(0.10, 0.08), 2.0).is_none());
        let shifted = find_geometric_score(&config, &cube(0.0, 0.08), &cube(0.03, 0.08), 2.0).unwrap();
        assert!(shifted > 0.5, "{shifted}");
        assert!(find_geometric_score(&config, &cube(0.0, 0.6), &cube(0.62, 0.6), 2.0).is_none());
    }

    #[test]
    fn a_neighbour_in_a_row_is_not_the_thing_itself_but_half_of_it_is() {
        let config = BuildConfig::default();
        let drawer = |x: f64, width: f64| Aabb {
            min: Point3::new(x - 0.5 * width, 0.0, 0.3),
            max: Point3::new(x + 0.5 * width, 0.4, 0.5),
        };
        // Flush neighbours whose places are 6 cm wrong share a quarter of their grown length.
        assert!(find_geometric_score(&config, &drawer(0.0, 0.4), &drawer(0.34, 0.4), 2.0).is_none());
        assert!(find_geometric_score(&config, &drawer(0.0, 0.4), &drawer(0.1, 0.2), 2.0).is_some());
    }

    proptest! {
        #[test]
        fn assignment_is_one_to_one(scores in proptest::collection::vec((0usize..6, 0usize..5, 1.5f64..3.0), 0..20)) {
            let assigned = assign(6, 5, &scores);
            let mut taken: Vec<usize> = assigned.iter().flatten().copied().collect();
            let count = taken.len();
            taken.sort_unstable();
            taken.dedup();
            prop_assert_eq!(taken.len(), count);
            for (observation, candidate) in assigned.iter().enumerate().filter_map(|(o, c)| Some((o, (*c)?))) {
                prop_assert!(scores.iter().any(|s| s.0 == observation && s.1 == candidate));
            }
        }
    }
}
