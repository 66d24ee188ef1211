//! Which one of several: superlatives and ordinals.

use super::answer::ReferenceFrame;
use super::query::{Order, Selection};
use super::scene::Scene;
use nalgebra::{Point2, Vector2};

/// Score of the neighbour of the chosen rank; farther ones get less. Below `GroundConfig::violated_below` the choice
/// alone would refuse them, so it stays above.
const NEXT_RANK: f32 = 0.35;
/// Score of what takes no part in the comparison, and of all when there are fewer candidates than the rank asks for.
const OUTSIDE: f32 = 0.1;

/// Scores by place in a falling order of fitness `keys` (smallest first) among the candidates whose `total` reaches
/// `compared_share` of the best. Keys closer than `tolerance` to the chosen one are nearly as good.
pub(super) fn rank_scores(keys: &[f64], total: &[f32], rank: u32, compared_share: f32, tolerance: f64) -> Vec<f32> {
    let best = total.iter().copied().fold(0.0, f32::max);
    let takes_part = |i: &usize| total[*i] > 0.0 && total[*i] >= compared_share * best && keys[*i].is_finite();
    let mut order: Vec<usize> = (0..keys.len()).filter(takes_part).collect();
    order.sort_by(|a, b| keys[*a].total_cmp(&keys[*b]).then(a.cmp(b)));
    let mut scores = vec![OUTSIDE; keys.len()];
    let wanted = rank.max(1) as usize - 1;
    let Some(&chosen) = order.get(wanted) else { return scores };
    for (place, &i) in order.iter().enumerate() {
        scores[i] = match place.abs_diff(wanted) {
            0 => 1.0,
            _ if (keys[i] - keys[chosen]).abs() <= tolerance => 0.92,
            1 => NEXT_RANK,
            steps => (NEXT_RANK / steps as f32).max(OUTSIDE),
        };
    }
    scores
}

/// Leftmost and rightmost for one who looks across the row in which the candidates stand, from the middle of the scene;
/// `None` for other orders and where the words tell where the viewer looks.
pub(super) fn scores_facing_the_row(
    scene: &Scene<'_>,
    selection: &Selection,
    total: &[f32],
    compared_share: f32,
) -> Option<Vec<f32>> {
    let sign = match selection.order {
        Order::Leftmost => -1.0,
        Order::Rightmost => 1.0,
        _ => return None,
    };
    if scene.is_told() {
        return None;
    }
    let best = total.iter().copied().fold(0.0, f32::max);
    let peers: Vec<Point2<f64>> = (scene.items.iter().zip(total))
        .filter(|(_, score)| **score > 0.0 && **score >= compared_share * best)
        .map(|(item, _)| item.bounds.center().xy())
        .collect();
    let left = left_of_row(scene, &peers)?;
    let keys: Vec<f64> = scene.items.iter().map(|item| sign * item.bounds.center().xy().coords.dot(&left)).collect();
    Some(rank_scores(&keys, total, selection.rank, compared_share, 0.01))
}

/// The left of one who looks from the middle of the scene across the row of these places.
pub(super) fn left_of_row(scene: &Scene<'_>, peers: &[Point2<f64>]) -> Option<Vector2<f64>> {
    if peers.len() < 2 {
        return None;
    }
    let middle = peers.iter().map(|p| p.coords).sum::<Vector2<f64>>() / peers.len() as f64;
    let spread = peers.iter().map(|p| (p.coords - middle).map(|c| c * c)).sum::<Vector2<f64>>();
    let away = middle - scene.center.coords;
    let forward = if spread.x > spread.y {
        Vector2::y() * if away.y < 0.0 { -1.0 } else { 1.0 }
    } else {
        Vector2::x() * if away.x < 0.0 { -1.0 } else { 1.0 }
    };
    Some(Vector2::new(-forward.y, forward.x))
}

/// Scores of a selection by item, and the frame it was read in.
pub(super) fn selection_scores(
    scene: &Scene<'_>,
    selection: &Selection,
    total: &[f32],
    compared_share: f32,
) -> (Vec<f32>, ReferenceFrame) {
    let best = total.iter().copied().fold(0.0, f32::max);
    let peers: Vec<Point2<f64>> = (scene.items.iter().zip(total))
        .filter(|(_, score)| **score > 0.0 && **score >= compared_share * best)
        .map(|(item, _)| item.bounds.center().xy())
        .collect();
    let middle = match peers.len() {
        0 => scene.center,
        count => Point2::from(peers.iter().map(|p| p.coords).sum::<Vector2<f64>>() / count as f64),
    };
    let extent = scene.extent;
    let (eye, eye_frame) = scene.standpoint();
    let view = scene.view_to(middle);
    let key = |item: &super::scene::Item<'_>| {
        let center = item.bounds.center();
        let size = item.object.bounds.size;
        match selection.order {
            Order::Nearest => (center.xy() - eye).norm(),
            Order::Farthest => -(center.xy() - eye).norm(),
            Order::Largest => -item.object.bounds.volume_m3().cbrt(),
            Order::Smallest => item.object.bounds.volume_m3().cbrt(),
            Order::Tallest => -size.z,
            Order::Shortest => size.z,
            Order::Highest => -center.z,
            Order::Lowest => center.z,
            Order::Longest => -size.max(),
            Order::Leftmost => -(center.xy() - middle).dot(&view.left),
            Order::Rightmost => (center.xy() - middle).dot(&view.left),
            Order::Middle => (center.xy() - middle).norm(),
            Order::Central => (center.xy() - scene.center).norm(),
            Order::Corner => {
                let to = |a: f64, low: f64, high: f64| (a - low).min(high - a).max(0.0);
                to(center.x, extent.min.x, extent.max.x).hypot(to(center.y, extent.min.y, extent.max.y))
            }
        }
    };
    let keys: Vec<f64> = scene.items.iter().map(key).collect();
    let frame = match selection.order {
        Order::Nearest | Order::Farthest => eye_frame,
        Order::Leftmost | Order::Rightmost => view.frame,
        _ => ReferenceFrame::None,
    };
    if matches!(selection.order, Order::Corner) {
        // More than one may stand in a corner.
        let nearest = (keys.iter().zip(total)).filter(|(_, t)| **t >= compared_share * best).map(|(k, _)| *k);
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        let score = |key: &f64| ((nearest - key).min(0.0).exp() as f32).max(NEXT_RANK);
        return (keys.iter().map(score).collect(), frame);
    }
    (rank_scores(&keys, total, selection.rank, compared_share, 0.01), frame)
}

/// The selection in words.
pub(super) fn phrase(selection: &Selection) -> String {
    let order = match selection.order {
        Order::Nearest => "nearest",
        Order::Farthest => "farthest",
        Order::Largest => "largest",
        Order::Smallest => "smallest",
        Order::Tallest => "tallest",
        Order::Shortest => "shortest",
        Order::Highest => "highest",
        Order::Lowest => "lowest",
        Order::Longest => "longest",
        Order::Leftmost => "leftmost",
        Order::Rightmost => "rightmost",
        Order::Middle => "middle",
        Order::Central => "central",
        Order::Corner => "cornermost",
    };
    match selection.rank {
        0 | 1 => format!("the {order} one"),
        rank => format!("number {rank} counted from the {order} one"),
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the chosen rank wins, candidates out of the comparison do not count, a rank beyond the last refuses all.
    use super::*;

    #[test]
    fn ranks_count_only_candidates_that_fit() {
        let keys = [3.0, 1.0, 2.0, 0.0];
        let total = [1.0, 1.0, 1.0, 0.1];
        assert_eq!(rank_scores(&keys, &total, 1, 0.4, 0.01), [NEXT_RANK / 2.0, 1.0, NEXT_RANK, OUTSIDE]);
        assert_eq!(rank_scores(&keys, &total, 2, 0.4, 0.01)[2], 1.0);
        assert!(rank_scores(&keys, &total, 4, 0.4, 0.01).iter().all(|score| *score == OUTSIDE));
    }
}
