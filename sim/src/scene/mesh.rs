//! Meshes of a scene: OBJ, STL and MSH files, or vertices written in the asset.

use super::error::SceneError;
use super::model::SceneMesh;
use super::msh::read_msh;
use super::source::Source;
use super::surface::find_node;
use mjcf_rs::assets::Mesh;
use mjcf_rs::glam::DVec3;
use nalgebra::{Point3, Vector3};
use roxmltree::{Document, Node};
use std::path::Path;

/// Index of a mesh by name.
pub(super) fn find_mesh(meshes: &[SceneMesh], name: &str) -> Option<usize> {
    meshes.iter().position(|mesh| mesh.name == name)
}

/// Reads all meshes of the asset block.
pub(super) fn load_meshes(
    model: &mjcf_rs::Model,
    document: &Document<'_>,
    source: &Source,
    folder: &Path,
) -> Result<Vec<SceneMesh>, SceneError> {
    let mut meshes = Vec::new();
    for asset in &model.assets.meshes {
        let name = asset.name.clone().unwrap_or_default();
        let place = source.place(find_node(document, "mesh", &name).map_or(0, |n| n.range().start));
        let mut mesh = match model.resolve_mesh_file(asset, folder) {
            Some(path) if !path.exists() => return Err(SceneError::MissingFile { place, kind: "mesh", path }),
            Some(path) => read_file(&path).map_err(|reason| SceneError::BrokenFile {
                place,
                kind: "mesh",
                path,
                reason,
                expected: "an OBJ, STL or MSH mesh with triangles",
            })?,
            None => inline(asset, find_node(document, "mesh", &name)).ok_or_else(|| SceneError::BadValue {
                place,
                what: format!("mesh `{name}`"),
                value: "neither `file` nor `vertex` with `face`".to_owned(),
                expected: "a file, or 3 numbers a vertex and 3 vertex indices a face".to_owned(),
            })?,
        };
        transform(&mut mesh, asset);
        mesh.name = name;
        meshes.push(mesh);
    }
    Ok(meshes)
}

fn read_file(path: &Path) -> Result<SceneMesh, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ending == "msh" {
        return check(read_msh(&bytes)?);
    }
    if let Some(mesh) = Some(&bytes).filter(|_| ending == "stl").and_then(|bytes| binary_stl(bytes)) {
        return check(mesh);
    }
    let scene = mesh_loader::Loader::default().load(path).map_err(|error| error.to_string())?;
    let mut mesh = empty();
    let textured = scene.meshes.iter().all(|part| part.texcoords[0].len() == part.vertices.len());
    let shaded = scene.meshes.iter().all(|part| part.normals.len() == part.vertices.len());
    for part in &scene.meshes {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(part.vertices.iter().map(|v| Point3::from(*v)));
        if shaded {
            mesh.normals.extend(part.normals.iter().map(|n| Vector3::from(*n)));
        }
        if textured {
            // OBJ counts v from the bottom of the picture, MuJoCo and the renderer from its top.
            mesh.uvs.extend(part.texcoords[0].iter().map(|[u, v]| [*u, 1.0 - v]));
        }
        mesh.indices.extend(part.faces.iter().map(|face| face.map(|vertex| vertex + first)));
    }
    check(mesh)
}

/// A binary STL file, known by its length: some begin with the word that marks those in text.
fn binary_stl(bytes: &[u8]) -> Option<SceneMesh> {
    let (head, faces) = bytes.split_at_checked(84)?;
    let count = u32::from_le_bytes(*head.last_chunk()?);
    if faces.len() as u64 != 50 * u64::from(count) {
        return None;
    }
    let mut mesh = empty();
    for face in faces.chunks_exact(50) {
        let first = mesh.positions.len() as u32;
        let number = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|byte| face[4 * i + byte]));
        // The normal, which many programs leave empty, comes first.
        mesh.positions.extend([3, 6, 9].map(|i| Point3::new(number(i), number(i + 1), number(i + 2))));
        mesh.indices.push([first, first + 1, first + 2]);
    }
    Some(mesh)
}

fn inline(asset: &Mesh, node: Option<Node<'_, '_>>) -> Option<SceneMesh> {
    let (vertices, faces) = (asset.inline_vertices.as_ref()?, asset.inline_faces.as_ref()?);
    let mut mesh = empty();
    let written = |name| node.and_then(|node| node.attribute(name)).unwrap_or_default();
    let numbers = |name| written(name).split_ascii_whitespace().flat_map(str::parse).collect::<Vec<f32>>();
    let per_vertex = |list: &[f32], size: usize| list.len() * 3 == vertices.len() * size;
    let (uvs, normals) = (numbers("texcoord"), numbers("normal"));
    if per_vertex(&uvs, 2) {
        mesh.uvs = uvs.chunks_exact(2).map(|uv| [uv[0], uv[1]]).collect();
    }
    if per_vertex(&normals, 3) {
        mesh.normals = normals.chunks_exact(3).map(|n| Vector3::new(n[0], n[1], n[2])).collect();
    }
    mesh.positions = vertices.chunks_exact(3).map(|v| Point3::new(v[0] as f32, v[1] as f32, v[2] as f32)).collect();
    mesh.indices = faces.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
    check(mesh).ok()
}

fn empty() -> SceneMesh {
    SceneMesh { name: String::new(), positions: vec![], normals: vec![], uvs: vec![], indices: vec![] }
}

fn check(mesh: SceneMesh) -> Result<SceneMesh, String> {
    let count = mesh.positions.len() as u32;
    if mesh.indices.is_empty() {
        return Err("it holds no triangles".to_owned());
    }
    if mesh.indices.iter().flatten().any(|vertex| *vertex >= count) {
        return Err(format!("a face names a vertex beyond the {count} that exist"));
    }
    if mesh.positions.iter().any(|p| !p.coords.iter().all(|v| v.is_finite())) {
        return Err("a vertex is not finite".to_owned());
    }
    Ok(mesh)
}

/// Applies the asset's reference pose and then its scale, as MuJoCo does; a mirroring scale turns the faces round.
fn transform(mesh: &mut SceneMesh, asset: &Mesh) {
    let [sx, sy, sz] = asset.scale;
    let reference = asset.refpose;
    let turn = reference.rotation.inverse();
    for position in &mut mesh.positions {
        let v = DVec3::new(f64::from(position.x), f64::from(position.y), f64::from(position.z));
        let v = turn * (v - reference.translation);
        *position = Point3::new((v.x * sx) as f32, (v.y * sy) as f32, (v.z * sz) as f32);
    }
    for normal in &mut mesh.normals {
        let n = turn * DVec3::new(f64::from(normal.x), f64::from(normal.y), f64::from(normal.z));
        let scaled = Vector3::new((n.x / sx) as f32, (n.y / sy) as f32, (n.z / sz) as f32);
        *normal = scaled.try_normalize(1e-9).unwrap_or(Vector3::z());
    }
    if sx * sy * sz < 0.0 {
        mesh.indices.iter_mut().for_each(|face| face.swap(1, 2));
    }
}

/// Volume enclosed by a closed mesh in cubic metres.
pub(super) fn mesh_volume_m3(mesh: &SceneMesh) -> f64 {
    let corner = |index: u32| mesh.positions[index as usize].coords.cast::<f64>();
    let sixfold: f64 = mesh.indices.iter().map(|[a, b, c]| corner(*a).dot(&corner(*b).cross(&corner(*c)))).sum();
    (sixfold / 6.0).abs()
}
