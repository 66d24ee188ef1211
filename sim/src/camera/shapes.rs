//! Scene shapes as meshes for the rasteriser.

use crate::scene::{SceneMesh, SceneShape, TextureSpan};
use dsm::raster::{Mesh, MeshError};
use dsm_robot::model::shapes::Mesh as PartMesh;
use nalgebra::{Point3, Vector3};
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
    // A box and a plane have the faces of a cube already.
    let round = !matches!(shape, SceneShape::Plane { .. } | SceneShape::Box { .. });
    match span {
        TextureSpan::Cube if round => around_cube(&mesh),
        _ if unbounded => in_metres(&mesh, shape),
        TextureSpan::Metre => in_metres(&mesh, shape),
        TextureSpan::Face | TextureSpan::Cube => Ok(mesh),
    }
}

/// The same mesh seen from its middle onto a cube that carries the picture on each side. Each triangle lies on one side.
fn around_cube(mesh: &Mesh) -> Result<Mesh, MeshError> {
    let (mut positions, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
    for triangle in mesh.indices() {
        let corners = triangle.map(|vertex| mesh.positions()[vertex as usize]);
        let middle = corners.iter().map(|corner| corner.coords).sum::<Vector3<f32>>();
        let (axis, sign) = (middle.abs().imax(), middle[middle.abs().imax()].signum());
        for (vertex, corner) in triangle.iter().zip(corners) {
            // Directions to the right and down on the side, as one looks at it from outside.
            let (right, down) = match axis {
                0 => (corner.y * sign, -corner.z),
                1 => (-corner.x * sign, -corner.z),
                _ => (corner.x, -corner.y * sign),
            };
            let depth = corner[axis].abs().max(1e-6);
            uvs.push([right, down].map(|along| 0.5 + 0.5 * (along / depth).clamp(-1.0, 1.0)));
            positions.push(corner);
            normals.push(mesh.normals()[*vertex as usize]);
        }
    }
    let indices = (0..mesh.indices().len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh::new(positions, normals, uvs, indices)
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
pub(super) fn mesh(mesh: &SceneMesh, span: TextureSpan) -> Result<Mesh, MeshError> {
    if span == TextureSpan::Cube {
        return around_cube(&mesh_of_file(mesh)?);
    }
    mesh_of_file(mesh)
}

fn mesh_of_file(mesh: &SceneMesh) -> Result<Mesh, MeshError> {
    if mesh.normals.is_empty() {
        let made = Mesh::from_triangles(&mesh.positions, &mesh.indices, CREASE_RAD)?;
        if mesh.uvs.is_empty() || made.indices().len() != mesh.indices.len() {
            return Ok(made);
        }
        // Three vertices a triangle, in the order of the triangles.
        let uvs = mesh.indices.iter().flatten().map(|vertex| mesh.uvs[*vertex as usize]).collect();
        return Mesh::new(made.positions().to_vec(), made.normals().to_vec(), uvs, made.indices().to_vec());
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

    #[test]
    fn a_cube_shows_its_picture_once_on_each_side() {
        let sphere = solid(&SceneShape::Sphere { radius_m: 0.5 }, TextureSpan::Cube).expect("sound");
        let close = |point: [f32; 3], uv: [f32; 2]| {
            let at = Vector3::from(point);
            let near = sphere.positions().iter().zip(sphere.uvs()).filter(|(p, _)| (p.coords - at).norm() < 1e-4);
            near.into_iter().all(|(_, found)| (found[0] - uv[0]).hypot(found[1] - uv[1]) < 1e-3)
        };
        assert!(close([0.5, 0.0, 0.0], [0.5, 0.5]) && close([0.0, 0.0, 0.5], [0.5, 0.5]));
        let is_share = |uv: &[f32; 2]| uv.iter().all(|c| (0.0..=1.0).contains(c));
        assert!(sphere.uvs().iter().all(is_share));
    }
}
