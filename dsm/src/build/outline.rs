//! The outline of a set of cells.

use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};

/// Largest distance between the outline and its simplification, metres.
const TOLERANCE_M: f64 = 0.08;

/// The outer border of the largest part of the cells, counter-clockwise, metres; holes are left out.
pub(super) fn outline(cells: &[[i32; 2]], cell_m: f64) -> Vec<Point2<f64>> {
    let inside: BTreeSet<[i32; 2]> = cells.iter().copied().collect();
    let mut next: BTreeMap<[i32; 2], Vec<[i32; 2]>> = BTreeMap::new();
    for &[x, y] in &inside {
        // Each side without a neighbour, walked with the cell on the left.
        let sides = [
            ([x, y - 1], [x, y], [x + 1, y]),
            ([x + 1, y], [x + 1, y], [x + 1, y + 1]),
            ([x, y + 1], [x + 1, y + 1], [x, y + 1]),
            ([x - 1, y], [x, y + 1], [x, y]),
        ];
        for (_, from, to) in sides.into_iter().filter(|(beside, _, _)| !inside.contains(beside)) {
            next.entry(from).or_default().push(to);
        }
    }
    let mut best: (f64, Vec<Point2<f64>>) = (0.0, Vec::new());
    while let Some(start) = next.keys().next().copied() {
        let mut corners = Vec::new();
        let mut at = start;
        while let Some(ways) = next.get_mut(&at) {
            corners.push(Point2::new(f64::from(at[0]) * cell_m, f64::from(at[1]) * cell_m));
            let to = ways.pop();
            if ways.is_empty() {
                next.remove(&at);
            }
            let Some(to) = to else { break };
            at = to;
            if at == start {
                break;
            }
        }
        let area = 0.5
            * (0..corners.len())
                .map(|i| {
                    let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                    a.x * b.y - a.y * b.x
                })
                .sum::<f64>();
        if area > best.0 {
            best = (area, corners);
        }
    }
    simplify(best.1)
}

/// Douglas-Peucker on a closed line, split at the corner farthest from the first.
fn simplify(corners: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
    let Some(first) = corners.first().copied() else { return corners };
    let far = (0..corners.len())
        .fold(0, |best, i| if (corners[i] - first).norm() > (corners[best] - first).norm() { i } else { best });
    let mut back: Vec<_> = corners[far..].to_vec();
    back.push(first);
    let mut line = keep_corners(&corners[..=far]);
    line.pop();
    line.extend(keep_corners(&back));
    line.pop();
    line
}

fn keep_corners(line: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut kept = vec![false; line.len()];
    let mut open = vec![(0, line.len() - 1)];
    kept[0] = true;
    kept[line.len() - 1] = true;
    while let Some((from, to)) = open.pop() {
        let axis = line[to] - line[from];
        let distance = |p: &Point2<f64>| {
            let d = p - line[from];
            if axis.norm() < 1e-9 { d.norm() } else { (axis.x * d.y - axis.y * d.x).abs() / axis.norm() }
        };
        let far =
            (from + 1..to).fold(from, |best, i| if distance(&line[i]) > distance(&line[best]) { i } else { best });
        if far > from && distance(&line[far]) > TOLERANCE_M {
            kept[far] = true;
            open.push((from, far));
            open.push((far, to));
        }
    }
    line.iter().zip(kept).filter(|(_, kept)| *kept).map(|(p, _)| *p).collect()
}

#[cfg(test)]
mod tests {
    //! Contract: a rectangle of cells gives its four corners, counter-clockwise.
    use super::*;

    #[test]
    fn rectangle_has_four_corners() {
        let cells: Vec<[i32; 2]> = (0..40).flat_map(|x| (0..20).map(move |y| [x, y])).collect();
        let corners = outline(&cells, 0.05);
        assert_eq!(corners.len(), 4, "{corners:?}");
        let area: f64 =
            (0..4).map(|i| corners[i].x * corners[(i + 1) % 4].y - corners[i].y * corners[(i + 1) % 4].x).sum();
        assert!((0.5 * area - 2.0).abs() < 1e-9);
    }
}
