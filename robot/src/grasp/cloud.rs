//! Small clouds of points: thinning, neighbours, normals, clusters.

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};
use std::collections::BTreeMap;

/// Points in cubic cells for queries by radius.
pub(crate) struct Cells<'a> {
    points: &'a [Point3<f64>],
    side_m: f64,
    cells: BTreeMap<[i32; 3], Vec<u32>>,
}

fn cell_of(point: &Point3<f64>, side_m: f64) -> [i32; 3] {
    [0, 1, 2].map(|i| (point[i] / side_m).floor() as i32)
}

impl<'a> Cells<'a> {
    /// Cells whose side is the radius of later queries.
    pub(crate) fn new(points: &'a [Point3<f64>], side_m: f64) -> Self {
        let mut cells: BTreeMap<[i32; 3], Vec<u32>> = BTreeMap::new();
        for (i, point) in points.iter().enumerate() {
            cells.entry(cell_of(point, side_m)).or_default().push(i as u32);
        }
        Self { points, side_m, cells }
    }

    /// Indices of the points within one side of `point`.
    pub(crate) fn near(&self, point: &Point3<f64>) -> Vec<usize> {
        let [x, y, z] = cell_of(point, self.side_m);
        let mut found = Vec::new();
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    let Some(cell) = self.cells.get(&[x + dx, y + dy, z + dz]) else { continue };
                    let within = |i: &&u32| (self.points[**i as usize] - point).norm_squared() <= self.side_m.powi(2);
                    found.extend(cell.iter().filter(within).map(|i| *i as usize));
                }
            }
        }
        found
    }
}

/// One mean point per cubic cell, in order of the cells.
pub(crate) fn thin(points: &[Point3<f64>], side_m: f64) -> Vec<Point3<f64>> {
    let cells = Cells::new(points, side_m);
    let mean = |members: &Vec<u32>| {
        let sum: Vector3<f64> = members.iter().map(|i| points[*i as usize].coords).sum();
        Point3::from(sum / members.len() as f64)
    };
    cells.cells.values().map(mean).collect()
}

/// Groups of points that are joined by steps of at most `step_m`, the largest first.
pub(crate) fn find_clusters(points: &[Point3<f64>], step_m: f64) -> Vec<Vec<usize>> {
    let cells = Cells::new(points, step_m);
    let mut visited = vec![false; points.len()];
    let mut clusters = Vec::new();
    for seed in 0..points.len() {
        if visited[seed] {
            continue;
        }
        visited[seed] = true;
        let mut cluster = vec![seed];
        let mut next = 0;
        while next < cluster.len() {
            for neighbour in cells.near(&points[cluster[next]]) {
                if !visited[neighbour] {
                    visited[neighbour] = true;
                    cluster.push(neighbour);
                }
            }
            next += 1;
        }
        clusters.push(cluster);
    }
    clusters.sort_by_key(|cluster| std::cmp::Reverse(cluster.len()));
    clusters
}

/// The largest cluster of a cloud; drops stray points. Falls back to all points when the cloud is too thin to join.
pub(crate) fn main_part(points: &[Point3<f64>], step_m: f64) -> Vec<Point3<f64>> {
    match find_clusters(points, step_m).first() {
        Some(cluster) if 2 * cluster.len() > points.len() => cluster.iter().map(|&i| points[i]).collect(),
        _ => points.to_vec(),
    }
}

/// Outward normals by the plane through the neighbours within `radius_m`; `None` with fewer than five of them. Outward
/// means away from the mean of the cloud, which holds for convex things.
pub(crate) fn normals(points: &[Point3<f64>], radius_m: f64) -> Vec<Option<Vector3<f64>>> {
    let cells = Cells::new(points, radius_m);
    let Some(center) = mean(points) else { return Vec::new() };
    points
        .iter()
        .map(|point| {
            let near = cells.near(point);
            if near.len() < 5 {
                return None;
            }
            let members: Vec<Point3<f64>> = near.into_iter().map(|i| points[i]).collect();
            let middle = mean(&members)?;
            let spread: Matrix3<f64> = members.iter().map(|p| (p - middle) * (p - middle).transpose()).sum();
            let eigen = SymmetricEigen::new(spread);
            let normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
            Some(if normal.dot(&(point - center)) < 0.0 { -normal } else { normal })
        })
        .collect()
}

/// The mean of the points; `None` for none.
pub(crate) fn mean(points: &[Point3<f64>]) -> Option<Point3<f64>> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    (!points.is_empty()).then(|| Point3::from(sum / points.len() as f64))
}

/// The value below which the given share of the values lies; `None` for none.
pub(crate) fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(index).copied()
}

#[cfg(test)]
mod tests {
    //! Contract: thinning keeps one point per cell, clusters part at gaps, normals of a sphere point outward.
    use super::*;
    use crate::grasp::candidates::tests::sphere;

    #[test]
    fn normals_of_a_sphere_point_outward() {
        let center = Point3::new(0.3, -0.2, 0.8);
        let points = thin(&sphere(center, 0.04, 0.002, 3000, 1), 0.005);
        let normals = normals(&points, 0.015);
        let good =
            points.iter().zip(&normals).filter(|(p, n)| n.is_some_and(|n| n.dot(&(*p - center).normalize()) > 0.9));
        assert!(good.count() as f64 > 0.9 * points.len() as f64);
    }

    #[test]
    fn clusters_part_at_gaps() {
        let mut points = sphere(Point3::new(0.0, 0.0, 0.0), 0.03, 0.0, 400, 1);
        points.extend(sphere(Point3::new(0.1, 0.0, 0.0), 0.03, 0.0, 900, 2));
        let clusters = find_clusters(&points, 0.015);
        assert_eq!(clusters.iter().map(Vec::len).collect::<Vec<_>>(), [900, 400]);
        assert_eq!(main_part(&points, 0.015).len(), 900);
        assert!(thin(&points, 0.01).len() < 300);
        assert_eq!(quantile([3.0, 1.0, 2.0], 0.5), Some(2.0));
    }
}
