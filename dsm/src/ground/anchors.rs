//! The best anchor of each target. Most pairs of a large map are never weighed: the gap between their boxes tells that
//! they cannot win.

use rayon::prelude::*;

/// The best anchor of a target and the score with it; ties go to the likelier anchor.
///
/// `anchors` are sorted by weight, so that the search ends where no further one can win. `holds` tells how well the
/// relation holds between target and anchor, and `most` the most that it can be, for less work.
pub(super) fn best_anchor(
    anchors: &[(usize, f32)],
    target: usize,
    most: impl Fn(usize, usize) -> f32,
    holds: impl Fn(usize, usize) -> f32,
) -> (f32, Option<usize>) {
    let mut best = (0.0, None);
    for (anchor, weight) in anchors.iter().filter(|(anchor, _)| *anchor != target) {
        if *weight <= best.0 {
            break;
        }
        if weight * most(target, *anchor) <= best.0 {
            continue;
        }
        let score = weight * holds(target, *anchor);
        if score > best.0 {
            best = (score, Some(*anchor));
        }
    }
    best
}

/// For each target that still counts, the best anchor and its score.
///
/// Targets are independent, so large maps are worked on by all threads; the answer is the same for any number of them.
pub(super) fn best_anchors(
    total: &[f32],
    best_of: impl Fn(usize) -> (f32, Option<usize>) + Sync,
) -> (Vec<f32>, Vec<Option<usize>>) {
    /// Fewer targets than this are not worth a thread.
    const LEAST_TARGETS: usize = 1000;
    let best = |target: usize| if total[target] < 1e-4 { (0.0, None) } else { best_of(target) };
    (0..total.len()).into_par_iter().with_min_len(LEAST_TARGETS).map(best).unzip()
}

#[cfg(test)]
mod tests {
    //! Contract: no relation holds better than the gap between boxes allows unless one is stored, and leaving out what
    //! cannot win changes no winner.
    use super::*;
    use crate::ground::RelationWord;
    use crate::ground::relate::{most, relation_score};
    use crate::ground::scene::Scene;
    use crate::ground::tests::house::{map_of, thing};
    use crate::knowledge::Knowledge;
    use crate::map::{MapChange, MapUpdate, ObjectId, Relation, RelationKind};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const WORDS: [RelationWord; 15] = [
        RelationWord::On,
        RelationWord::In,
        RelationWord::Under,
        RelationWord::Above,
        RelationWord::Below,
        RelationWord::NextTo,
        RelationWord::Near,
        RelationWord::Far,
        RelationWord::Against,
        RelationWord::With,
        RelationWord::LeftOf,
        RelationWord::Behind,
        RelationWord::InFrontOf,
        RelationWord::Closest,
        RelationWord::Farthest,
    ];

    #[test]
    fn what_cannot_win_is_left_out_and_nothing_else() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let count = 120_u64;
        let mut map = map_of((0..count).map(|id| {
            // Also boxes that touch, stand on each other and lie within each other.
            let mut at = |high: f64| (rng.random_range(0.0..high) * 4.0).round() / 4.0;
            let center = [at(8.0), at(3.0), at(1.5)];
            thing(id, "box", center, [0.25 + at(1.0), 0.25 + at(0.5), 0.25 + at(0.75)])
        }));
        let relations: Vec<Relation> = (0..count)
            .map(|id| {
                let kind = [RelationKind::NextTo, RelationKind::Near, RelationKind::On][id as usize % 3];
                Relation { from: ObjectId(id), to: ObjectId(id * 7 % count), kind, confidence: 0.9 }
            })
            .collect();
        let about = relations.iter().map(|relation| relation.from).collect();
        map.apply(MapUpdate { stamp: map.stamp, changes: vec![MapChange::Relate { about, relations }] });
        let knowledge = Knowledge::embedded().unwrap();
        let scene = Scene::new(&map, &knowledge, None);
        let anchors: Vec<(usize, f32)> = (0..40).map(|i| (i * 3 % 120, 1.0 - (i / 10) as f32 * 0.1)).collect();
        let linked = scene.linked_to(anchors.iter().map(|anchor| anchor.0));
        assert!(linked.iter().any(|l| *l) && linked.iter().any(|l| !*l));
        let mut left_out = 0;
        for word in WORDS {
            let holds = |target: usize, anchor: usize| relation_score(&scene, word, target, anchor);
            let limit =
                |target: usize, anchor: usize| most(word, &scene.items[target].bounds, &scene.items[anchor].bounds);
            for target in 0..count as usize {
                for (anchor, _) in anchors.iter().filter(|(anchor, _)| !linked[target] && *anchor != target) {
                    let (score, limit) = (holds(target, *anchor), limit(target, *anchor));
                    assert!(score <= limit, "{word:?}: {score} is more than {limit}");
                    left_out += usize::from(limit == 0.0);
                }
                let bound = |target, anchor| if linked[target] { f32::INFINITY } else { limit(target, anchor) };
                let all = best_anchor(&anchors, target, |_, _| f32::INFINITY, holds);
                assert_eq!(best_anchor(&anchors, target, bound, holds), all, "{word:?} of {target}");
            }
        }
        assert!(left_out > 5_000, "{left_out}");
    }
}
