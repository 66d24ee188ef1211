//! Triangle meshes.

use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use thiserror::Error;

/// Why a mesh cannot be built.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// Normals or texture coordinates do not match the positions one to one.
    #[error("mesh has {positions} positions, but {normals} normals and {uvs} texture coordinates")]
    Counts {
        /// Number of positions.
        positions: usize,
        /// Number of normals.
        normals: usize,
        /// Number of texture coordinates.
        uvs: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but the mesh has {count} vertices")]
    Index {
        /// Number of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of vertices.
        count: usize,
    },
    /// A position is not a finite number.
    #[error("position of vertex {vertex} is not finite")]
    NotFinite {
        /// Number of the vertex.
        vertex: usize,
    },
}

/// Triangles in the mesh frame, metres. Seen from outside, the vertices of a triangle run counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    positions: Vec<Point3<f32>>,
    normals: Vec<Vector3<f32>>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<[u32; 3]>,
    center: Point3<f32>,
    radius_m: f32,
    closed: bool,
}

impl Mesh {
    /// A mesh from positions, unit normals and texture coordinates (one each per vertex) and triangles.
    ///
    /// Texture coordinate (0, 0) is the corner of the texture's first texel; u runs right, v runs down.
    pub fn new(
        positions: Vec<Point3<f32>>,
        normals: Vec<Vector3<f32>>,
        uvs: Vec<[f32; 2]>,
        indices: Vec<[u32; 3]>,
    ) -> Result<Self, MeshError> {
        let count = positions.len();
        if normals.len() != count || uvs.len() != count {
            return Err(MeshError::Counts { positions: count, normals: normals.len(), uvs: uvs.len() });
        }
        check_triangles(&positions, &indices)?;
        let (center, radius_m) = bounding_sphere(&positions);
        let closed = is_closed(&positions, &indices);
        Ok(Self { positions, normals, uvs, indices, center, radius_m, closed })
    }

    /// A mesh from bare triangles, such as an STL file holds. Normals are smoothed over edges that bend by less than
    /// `crease_rad` (0 to pi, 0.6 is usual); texture coordinates are metres along the two axes across the face.
    pub fn from_triangles(
        positions: &[Point3<f32>],
        triangles: &[[u32; 3]],
        crease_rad: f32,
    ) -> Result<Self, MeshError> {
        check_triangles(positions, triangles)?;
        let corner = |triangle: &[u32; 3], i: usize| positions[triangle[i] as usize];
        // Twice the area times the normal, so that large faces weigh more.
        let faces: Vec<Vector3<f32>> =
            triangles.iter().map(|t| (corner(t, 1) - corner(t, 0)).cross(&(corner(t, 2) - corner(t, 0)))).collect();
        let mut around: BTreeMap<[u32; 3], Vec<usize>> = BTreeMap::new();
        for (face, triangle) in triangles.iter().enumerate() {
            for i in 0..3 {
                around.entry(position_key(&corner(triangle, i))).or_default().push(face);
            }
        }
        let cos_crease = crease_rad.cos();
        let (mut points, mut normals, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (triangle, face) in triangles.iter().zip(&faces) {
            let Some(flat) = face.try_normalize(1e-20) else { continue };
            let first = points.len() as u32;
            for i in 0..3 {
                let point = corner(triangle, i);
                let sum: Vector3<f32> = around[&position_key(&point)]
                    .iter()
                    .map(|&other| faces[other])
                    .filter(|other| other.dot(&flat) >= cos_crease * other.norm())
                    .sum();
                normals.push(sum.try_normalize(1e-20).unwrap_or(flat));
                uvs.push(project_along_largest_axis(&point, &flat));
                points.push(point);
            }
            indices.push([first, first + 1, first + 2]);
        }
        Self::new(points, normals, uvs, indices)
    }

    /// Positions of the vertices in the mesh frame, metres.
    pub fn positions(&self) -> &[Point3<f32>] {
        &self.positions
    }

    /// Unit normals of the vertices, outward.
    pub fn normals(&self) -> &[Vector3<f32>] {
        &self.normals
    }

    /// Texture coordinates of the vertices.
    pub fn uvs(&self) -> &[[f32; 2]] {
        &self.uvs
    }

    /// Vertices of each triangle.
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices
    }

    /// Whether the triangles enclose a volume and face outward: only then can those that face away be left out.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Centre (mesh frame) and radius in metres of a sphere around all vertices.
    pub fn bounding_sphere(&self) -> (Point3<f32>, f32) {
        (self.center, self.radius_m)
    }
}

fn check_triangles(positions: &[Point3<f32>], indices: &[[u32; 3]]) -> Result<(), MeshError> {
    let count = positions.len();
    if let Some(vertex) = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(MeshError::NotFinite { vertex });
    }
    for (triangle, vertices) in indices.iter().enumerate() {
        if let Some(&vertex) = vertices.iter().find(|&&vertex| vertex as usize >= count) {
            return Err(MeshError::Index { triangle, vertex, count });
        }
    }
    Ok(())
}

fn bounding_sphere(positions: &[Point3<f32>]) -> (Point3<f32>, f32) {
    let Some(&first) = positions.first() else { return (Point3::origin(), 0.0) };
    let (min, max) = positions.iter().fold((first, first), |(min, max), p| (min.inf(p), max.sup(p)));
    let center = nalgebra::center(&min, &max);
    let radius = positions.iter().map(|p| (p - center).norm()).fold(0.0, f32::max);
    (center, radius)
}

/// Vertices at the same place are one corner, whatever their normals are. Adding 0 makes -0 the same as 0.
fn position_key(point: &Point3<f32>) -> [u32; 3] {
    std::array::from_fn(|i| (point[i] + 0.0).to_bits())
}

/// Closed: every edge is passed as often in one direction as in the other, and the enclosed volume is positive.
fn is_closed(positions: &[Point3<f32>], indices: &[[u32; 3]]) -> bool {
    let keys: Vec<[u32; 3]> = positions.iter().map(position_key).collect();
    let mut balance: BTreeMap<([u32; 3], [u32; 3]), i32> = BTreeMap::new();
    let mut volume = 0.0_f64;
    for triangle in indices {
        let [a, b, c] = triangle.map(|i| positions[i as usize].coords.cast::<f64>());
        volume += a.dot(&b.cross(&c));
        for i in 0..3 {
            let (from, to) = (keys[triangle[i] as usize], keys[triangle[(i + 1) % 3] as usize]);
            if from < to {
                *balance.entry((from, to)).or_default() += 1;
            } else if to < from {
                *balance.entry((to, from)).or_default() -= 1;
            }
        }
    }
    volume > 0.0 && balance.values().all(|&sum| sum == 0)
}

fn project_along_largest_axis(point: &Point3<f32>, normal: &Vector3<f32>) -> [f32; 2] {
    let size = normal.abs();
    if size.z >= size.x && size.z >= size.y {
        [point.x, -point.y]
    } else if size.x >= size.y {
        [point.y, -point.z]
    } else {
        [point.x, -point.z]
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a mesh refuses what it cannot draw, and tells closed from open.
    use super::*;

    fn tetrahedron() -> (Vec<Point3<f32>>, Vec<[u32; 3]>) {
        let points =
            vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0), Point3::new(0.0, 0.0, 1.0)];
        (points, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    }

    #[test]
    fn bare_triangles_give_flat_normals_and_a_closed_mesh() {
        let (points, triangles) = tetrahedron();
        let mesh = Mesh::from_triangles(&points, &triangles, 0.5).expect("sound triangles");
        assert!(mesh.is_closed());
        assert_eq!(mesh.normals()[0], Vector3::new(0.0, 0.0, -1.0));
        let open = Mesh::from_triangles(&points, &triangles[..3], 0.5).expect("sound triangles");
        assert!(!open.is_closed());
        let inside_out: Vec<[u32; 3]> = triangles.iter().map(|t| [t[0], t[2], t[1]]).collect();
        assert!(!Mesh::from_triangles(&points, &inside_out, 0.5).expect("sound triangles").is_closed());
    }

    #[test]
    fn broken_meshes_are_refused() {
        let (mut points, mut triangles) = tetrahedron();
        triangles[1][2] = 4;
        assert_eq!(
            Mesh::from_triangles(&points, &triangles, 0.5),
            Err(MeshError::Index { triangle: 1, vertex: 4, count: 4 })
        );
        triangles[1][2] = 3;
        points[2].y = f32::NAN;
        assert_eq!(Mesh::from_triangles(&points, &triangles, 0.5), Err(MeshError::NotFinite { vertex: 2 }));
        assert_eq!(
            Mesh::new(vec![Point3::origin()], vec![], vec![], vec![]),
            Err(MeshError::Counts { positions: 1, normals: 0, uvs: 0 })
        );
    }
}
