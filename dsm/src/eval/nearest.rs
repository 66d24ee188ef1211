//! The nearest of many points.

use nalgebra::Point3;

/// Points sorted into cells.
pub(super) struct PointGrid {
    cell_m: f32,
    /// Sorted; with the range of its points.
    cells: Vec<([i32; 3], usize, usize)>,
    points: Vec<(Point3<f32>, u32)>,
}

impl PointGrid {
    /// A grid over points, each with a number of the caller's.
    pub(super) fn new(cell_m: f32, points: impl Iterator<Item = (Point3<f32>, u32)>) -> Self {
        let mut keyed: Vec<_> = points.map(|p| (key(&p.0, cell_m), p)).collect();
        keyed.sort_by_key(|(key, (_, number))| (*key, *number));
        let mut cells: Vec<([i32; 3], usize, usize)> = Vec::new();
        for (index, (key, _)) in keyed.iter().enumerate() {
            match cells.last_mut() {
                Some(cell) if cell.0 == *key => cell.2 = index + 1,
                _ => cells.push((*key, index, index + 1)),
            }
        }
        Self { cell_m, cells, points: keyed.into_iter().map(|(_, point)| point).collect() }
    }

    /// Number and distance of the nearest point within `reach_m`.
    pub(super) fn find(&self, place: &Point3<f32>, reach_m: f32) -> Option<(u32, f32)> {
        let center = key(place, self.cell_m);
        let rings = (reach_m / self.cell_m).ceil() as i32;
        let mut best: Option<(f32, u32)> = None;
        for ring in 0..=rings {
            // All cells beyond this ring are at least this far away.
            let safe = (ring - 1).max(0) as f32 * self.cell_m;
            if best.is_some_and(|(square, _)| square <= safe * safe) {
                break;
            }
            for dx in -ring..=ring {
                for dy in -ring..=ring {
                    let shell = dx.abs() == ring || dy.abs() == ring;
                    let step = if shell { 1 } else { (2 * ring).max(1) as usize };
                    for dz in (-ring..=ring).step_by(step) {
                        self.look(place, [center[0] + dx, center[1] + dy, center[2] + dz], &mut best);
                    }
                }
            }
        }
        best.map(|(square, number)| (number, square.sqrt())).filter(|(_, distance)| *distance <= reach_m)
    }

    fn look(&self, place: &Point3<f32>, cell: [i32; 3], best: &mut Option<(f32, u32)>) {
        let Ok(index) = self.cells.binary_search_by_key(&cell, |c| c.0) else { return };
        let (_, from, to) = self.cells[index];
        for (point, number) in &self.points[from..to] {
            let square = (point - place).norm_squared();
            if best.is_none_or(|b| (square, *number) < b) {
                *best = Some((square, *number));
            }
        }
    }
}

fn key(point: &Point3<f32>, cell_m: f32) -> [i32; 3] {
    [point.x, point.y, point.z].map(|c| (c / cell_m).floor() as i32)
}

#[cfg(test)]
mod tests {
    //! Contract: the grid finds what a search over all points finds.
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_is_the_nearest(
            points in proptest::collection::vec((-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0), 1..60),
            place in (-1.2f32..1.2, -1.2f32..1.2, -1.2f32..1.2),
        ) {
            let points: Vec<Point3<f32>> = points.into_iter().map(|(x, y, z)| Point3::new(x, y, z)).collect();
            let place = Point3::new(place.0, place.1, place.2);
            let grid = PointGrid::new(0.2, points.iter().copied().zip(0..));
            let least = points.iter().map(|p| (p - place).norm()).fold(f32::INFINITY, f32::min);
            let found = grid.find(&place, 0.5);
            prop_assert_eq!(found.is_some(), least <= 0.5);
            if let Some((_, distance)) = found {
                prop_assert!((distance - least).abs() < 1e-6);
            }
        }
    }
}
