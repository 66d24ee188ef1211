//! Meshes of simple solids, centred on the mesh frame with their axis along z.

use super::mesh::Mesh;
use nalgebra::{Point2, Point3, Vector2, Vector3};
use std::f32::consts::{FRAC_PI_2, TAU};

/// A point of the outline that is turned around z: `x` is the distance from the axis, `y` the height.
struct OutlinePoint {
    place: Point2<f32>,
    normal: Vector2<f32>,
    /// Texture coordinate v.
    v: f32,
}

impl Mesh {
    /// A box with half side lengths `half_m` in metres; each face carries the whole texture.
    pub fn cuboid(half_m: Vector3<f32>) -> Self {
        let (mut positions, mut normals, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        // Outward normal, direction to the right and direction down, as one looks at the face from outside.
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        for (normal, right, down) in [(x, y, -z), (-x, -y, -z), (y, -x, -z), (-y, x, -z), (z, x, -y), (-z, x, y)] {
            let first = positions.len() as u32;
            for (u, v) in [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)] {
                let corner: Vector3<f32> = normal + right * (2.0 * u - 1.0) + down * (2.0 * v - 1.0);
                positions.push(Point3::from(corner.component_mul(&half_m)));
                normals.push(normal);
                uvs.push([u, v]);
            }
            indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        built(positions, normals, uvs, indices)
    }

    /// A rectangle in the xy plane with half side lengths in metres that faces +z, cut into `cells` along each side.
    pub fn plane(half_x_m: f32, half_y_m: f32, cells: u32) -> Self {
        let cells = cells.max(1);
        let (mut positions, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..=cells {
            for column in 0..=cells {
                let (u, v) = (column as f32 / cells as f32, row as f32 / cells as f32);
                positions.push(Point3::new((2.0 * u - 1.0) * half_x_m, (1.0 - 2.0 * v) * half_y_m, 0.0));
                uvs.push([u, v]);
            }
        }
        for row in 0..cells {
            for column in 0..cells {
                let upper = row * (cells + 1) + column;
                let lower = upper + cells + 1;
                indices.extend([[lower, lower + 1, upper + 1], [lower, upper + 1, upper]]);
            }
        }
        built(positions.clone(), vec![Vector3::z(); positions.len()], uvs, indices)
    }

    /// A sphere with `segments` (at least 4) around its axis and half as many from pole to pole.
    pub fn sphere(radius_m: f32, segments: u32) -> Self {
        Self::ellipsoid(Vector3::repeat(radius_m), segments)
    }

    /// An ellipsoid with half axes `half_m` in metres.
    pub fn ellipsoid(half_m: Vector3<f32>, segments: u32) -> Self {
        let rings = (segments / 2).max(2);
        let outline = arc(Point2::origin(), 1.0, -FRAC_PI_2, FRAC_PI_2, rings, (1.0, 0.0));
        let unit = turn(&[outline], segments);
        let positions = unit.positions().iter().map(|p| Point3::from(p.coords.component_mul(&half_m))).collect();
        // The gradient of the quadric; a flat ellipsoid has no other.
        let normals = unit.normals().iter().map(|n| n.component_div(&half_m).normalize()).collect();
        built(positions, normals, unit.uvs().to_vec(), unit.indices().to_vec())
    }

    /// A cylinder along z; the wall and each cap carry the texture.
    pub fn cylinder(radius_m: f32, half_height_m: f32, segments: u32) -> Self {
        let (r, h) = (radius_m, half_height_m);
        let line = |from: (f32, f32), to: (f32, f32), normal: Vector2<f32>| {
            vec![
                OutlinePoint { place: Point2::new(from.0, from.1), normal, v: 1.0 },
                OutlinePoint { place: Point2::new(to.0, to.1), normal, v: 0.0 },
            ]
        };
        let bottom = line((0.0, -h), (r, -h), -Vector2::y());
        let wall = line((r, -h), (r, h), Vector2::x());
        let top = line((r, h), (0.0, h), Vector2::y());
        turn(&[bottom, wall, top], segments)
    }

    /// A capsule along z; `half_length_m` is half the length of its straight part in metres.
    pub fn capsule(radius_m: f32, half_length_m: f32, segments: u32) -> Self {
        let rings = (segments / 4).max(2);
        // v follows the length of the outline.
        let cap = radius_m * FRAC_PI_2;
        let share = cap / (2.0 * (cap + half_length_m));
        let low = arc(Point2::new(0.0, -half_length_m), radius_m, -FRAC_PI_2, 0.0, rings, (1.0, 1.0 - share));
        let high = arc(Point2::new(0.0, half_length_m), radius_m, 0.0, FRAC_PI_2, rings, (share, 0.0));
        turn(&[low.into_iter().chain(high).collect()], segments)
    }
}

fn built(positions: Vec<Point3<f32>>, normals: Vec<Vector3<f32>>, uvs: Vec<[f32; 2]>, indices: Vec<[u32; 3]>) -> Mesh {
    match Mesh::new(positions, normals, uvs, indices) {
        Ok(mesh) => mesh,
        // Sizes that are not finite numbers leave nothing to draw.
        Err(_) => Mesh::new(Vec::new(), Vec::new(), Vec::new(), Vec::new())
            .unwrap_or_else(|_| unreachable!("an empty mesh is sound")),
    }
}

/// Part of a circle as an outline, from angle `from_rad` to `to_rad` above the xy plane.
fn arc(center: Point2<f32>, radius_m: f32, from_rad: f32, to_rad: f32, steps: u32, v: (f32, f32)) -> Vec<OutlinePoint> {
    (0..=steps)
        .map(|step| {
            let share = step as f32 / steps as f32;
            let (sin, cos) = (from_rad + (to_rad - from_rad) * share).sin_cos();
            // The poles lie exactly on the axis: the cosine of a rounded right angle is not 0.
            let normal = Vector2::new(if cos.abs() < 1e-6 { 0.0 } else { cos }, sin);
            OutlinePoint { place: center + normal * radius_m, normal, v: v.0 + (v.1 - v.0) * share }
        })
        .collect()
}

/// Turns outlines, each from bottom to top as seen from outside, around the z axis.
fn turn(outlines: &[Vec<OutlinePoint>], segments: u32) -> Mesh {
    let segments = segments.max(4);
    let (mut positions, mut normals, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for outline in outlines {
        let first = positions.len() as u32;
        for point in outline {
            for column in 0..=segments {
                // The last column repeats the first, with the other end of the texture.
                let (sin, cos) = ((column % segments) as f32 / segments as f32 * TAU).sin_cos();
                positions.push(Point3::new(point.place.x * cos, point.place.x * sin, point.place.y));
                normals.push(Vector3::new(point.normal.x * cos, point.normal.x * sin, point.normal.y));
                uvs.push([column as f32 / segments as f32, point.v]);
            }
        }
        for (ring, pair) in outline.windows(2).enumerate() {
            for column in 0..segments {
                let lower = first + ring as u32 * (segments + 1) + column;
                let upper = lower + segments + 1;
                // A ring on the axis is a point: one of the two triangles vanishes.
                if pair[0].place.x > 0.0 {
                    indices.push([lower, lower + 1, upper + 1]);
                }
                if pair[1].place.x > 0.0 {
                    indices.push([lower, upper + 1, upper]);
                }
            }
        }
    }
    built(positions, normals, uvs, indices)
}

#[cfg(test)]
mod tests {
    //! Contract: every solid is closed, faces outward, has unit normals that agree with its winding, and has the
    //! volume of the solid.
    use super::*;
    use std::f32::consts::PI;

    fn volume(mesh: &Mesh) -> f32 {
        let at = |i: u32| mesh.positions()[i as usize].coords;
        mesh.indices().iter().map(|t| at(t[0]).dot(&at(t[1]).cross(&at(t[2])))).sum::<f32>() / 6.0
    }

    #[test]
    fn solids_are_closed_and_face_outward() {
        let (r, h) = (0.3_f32, 0.5_f32);
        let ball = 4.0 / 3.0 * PI * r.powi(3);
        let solids = [
            ("cuboid", Mesh::cuboid(Vector3::new(0.1, 0.2, 0.3)), 8.0 * 0.006),
            ("sphere", Mesh::sphere(r, 48), ball),
            ("ellipsoid", Mesh::ellipsoid(Vector3::new(0.1, 0.2, 0.3), 48), 4.0 / 3.0 * PI * 0.006),
            ("cylinder", Mesh::cylinder(r, h, 48), PI * r * r * 2.0 * h),
            ("capsule", Mesh::capsule(r, h, 48), PI * r * r * 2.0 * h + ball),
        ];
        for (name, mesh, expected) in solids {
            assert!(mesh.is_closed(), "{name}");
            assert!((volume(&mesh) / expected - 1.0).abs() < 0.02, "{name}: {} for {expected}", volume(&mesh));
            for triangle in mesh.indices() {
                let [a, b, c] = triangle.map(|i| mesh.positions()[i as usize]);
                let face = (b - a).cross(&(c - a)).normalize();
                assert!(face.dot(&(nalgebra::center(&a, &b).coords + c.coords)) > 0.0, "{name} faces inward");
                for i in triangle {
                    let normal = mesh.normals()[*i as usize];
                    assert!((normal.norm() - 1.0).abs() < 1e-5, "{name}");
                    assert!(face.dot(&normal) > 0.8, "{name}: normal against winding");
                }
            }
            assert!(mesh.uvs().iter().flatten().all(|c| (0.0..=1.0).contains(c)), "{name}");
            let (center, radius) = mesh.bounding_sphere();
            assert!(mesh.positions().iter().all(|p| (p - center).norm() <= radius * 1.0001), "{name}");
        }
    }

    #[test]
    fn a_plane_is_open_and_faces_up() {
        let mesh = Mesh::plane(1.0, 2.0, 3);
        assert!(!mesh.is_closed());
        assert_eq!(mesh.indices().len(), 18);
        for triangle in mesh.indices() {
            let [a, b, c] = triangle.map(|i| mesh.positions()[i as usize]);
            assert!((b - a).cross(&(c - a)).z > 0.0);
        }
    }
}
