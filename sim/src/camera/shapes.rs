//! Scene shapes as meshes for the rasteriser.

use crate::scene::{SceneMesh, SceneShape, TextureSpan};
use dsm::raster::{Mesh, MeshError};
use dsm_robot::model::shapes::Mesh as PartMesh;
use nalgebra::Point3;
use std::f32::consts::PI;

/// Half side of an unbounded plane in metres: farther than any indoor camera sees.
const UNBOUNDED_HALF_M: f32 = 30.0;
/// Edges that bend by less are drawn round.
const CREASE_RAD: f32 = 0.6;

/// The mesh of a solid. Its texture coordinates count whole faces or metres. A [`SceneShape::Mesh`] has none of its own:
/// its triangles belong to the scene.
pub(super) fn solid(shape: &SceneShape, span: TextureSpan) -> Result<Mesh, MeshError> {
    // The texture of an unbounded plane always counts metres: its face has no size.
    let unbounded = matches!(shape, SceneShape::Plane { half_m } if half_m.contains(&0.0));
    let mesh = by_faces(shape)?;
    if span == TextureSpan::Metre || unbounded { in_metres(&mesh, shape) } else { Ok(mesh) }
}

fn by_faces(shape: &SceneShape) -> Result<Mesh, MeshError> {
    Ok(match *shape {
        SceneShape::Plane { half_m } => {
            let [x, y] = drawn(half_m);
            Mesh::plane(x, y, 4)
        }
        SceneShape::Box { half_m } => Mesh::cuboid(half_m.cast()),
        SceneShape::Sphere { radius_m } => Mesh::sphere(radius_m as f32, segments(radius_m)),
        SceneShape::Cylinder { radius_m, half_length_m } => {
            Mesh::cylinder(radius_m as f32, half_length_m as f32, segments(radius_m))
        }
        SceneShape::Capsule { radius_m, half_length_m } => {
            Mesh::capsule(radius_m as f32, half_length_m as f32, segments(radius_m))
        }
        SceneShape::Ellipsoid { radii_m } => Mesh::ellipsoid(radii_m.cast(), segments(radii_m.max())),
        SceneShape::Mesh { .. } => Mesh::new(vec![], vec![], vec![], vec![])?,
    })
}

/// Half extents of the drawn part of a plane.
fn drawn(half_m: [f64; 2]) -> [f32; 2] {
    half_m.map(|half| if half > 0.0 { half as f32 } else { UNBOUNDED_HALF_M })
}

/// The same mesh with texture coordinates in metres along the surface instead of shares of the face.
fn in_metres(mesh: &Mesh, shape: &SceneShape) -> Result<Mesh, MeshError> {
    let around = |radius_m: f64, length_m: f64| [2.0 * PI * radius_m as f32, length_m as f32];
    let pi = std::f64::consts::PI;
    let scale = |vertex: usize| match *shape {
        SceneShape::Plane { half_m } => drawn(half_m).map(|half| 2.0 * half),
        SceneShape::Box { half_m } => {
            let size = half_m.cast::<f32>() * 2.0;
            let normal = mesh.normals()[vertex].abs();
            match normal.imax() {
                0 => [size.y, size.z],
                1 => [size.x, size.z],
                _ => [size.x, size.y],
            }
        }
        SceneShape::Sphere { radius_m } => around(radius_m, pi * radius_m),
        SceneShape::Cylinder { radius_m, half_length_m } => around(radius_m, 2.0 * half_length_m),
        SceneShape::Capsule { radius_m, half_length_m } => around(radius_m, pi * radius_m + 2.0 * half_length_m),
        SceneShape::Ellipsoid { radii_m } => around(radii_m.x.max(radii_m.y), pi * radii_m.z),
        SceneShape::Mesh { .. } => [1.0; 2],
    };
    let scaled = mesh.uvs().iter().enumerate().map(|(vertex, uv)| {
        let [u, v] = scale(vertex);
        [uv[0] * u, uv[1] * v]
    });
    let uvs = scaled.collect();
    Mesh::new(mesh.positions().to_vec(), mesh.normals().to_vec(), uvs, mesh.indices().to_vec())
}

/// The mesh of a file.
pub(super) fn mesh(mesh: &SceneMesh) -> Result<Mesh, MeshError> {
    if mesh.normals.is_empty() {
        return Mesh::from_triangles(&mesh.positions, &mesh.indices, CREASE_RAD);
    }
    let uvs = if mesh.uvs.is_empty() { vec![[0.0; 2]; mesh.positions.len()] } else { mesh.uvs.clone() };
    Mesh::new(mesh.positions.clone(), mesh.normals.clone(), uvs, mesh.indices.clone())
}

/// The mesh of a part of the robot.
pub(super) fn part(part: &PartMesh) -> Result<Mesh, MeshError> {
    let positions: Vec<Point3<f32>> = part.vertices.iter().map(|corner| corner.cast()).collect();
    Mesh::from_triangles(&positions, &part.triangles, CREASE_RAD)
}

/// Corners around a round shape: small things need few to look round.
fn segments(radius_m: f64) -> u32 {
    match radius_m {
        radius if radius < 0.03 => 16,
        radius if radius < 0.1 => 24,
        _ => 36,
    }
}

#[cfg(test)]
mod tests {
    //! Contract: solids have the size of their shapes, and textures count faces or metres as asked.
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_box_counts_faces_or_metres() {
        let shape = SceneShape::Box { half_m: Vector3::new(0.5, 1.0, 1.5) };
        let most = |span, axis: usize, i: usize| {
            let mesh = solid(&shape, span).expect("sound");
            let on_face = mesh.normals().iter().zip(mesh.uvs()).filter(|(normal, _)| normal.imax() == axis);
            on_face.map(|(_, uv)| uv[i]).fold(0.0, f32::max)
        };
        assert_eq!((most(TextureSpan::Face, 0, 0), most(TextureSpan::Face, 0, 1)), (1.0, 1.0));
        assert_eq!((most(TextureSpan::Metre, 0, 0), most(TextureSpan::Metre, 0, 1)), (2.0, 3.0));
        assert_eq!((most(TextureSpan::Metre, 2, 0), most(TextureSpan::Metre, 2, 1)), (1.0, 2.0));
    }

    #[test]
    fn an_unbounded_plane_reaches_farther_than_a_flat() {
        let shape = SceneShape::Plane { half_m: [0.0, 0.0] };
        let mesh = solid(&shape, TextureSpan::Face).expect("sound");
        assert!(mesh.bounding_sphere().1 >= 20.0);
        assert_eq!(mesh.uvs().iter().map(|uv| uv[0]).fold(0.0, f32::max), 2.0 * UNBOUNDED_HALF_M);
    }
}
