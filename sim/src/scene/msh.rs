//! MuJoCo's binary mesh format (`.msh`).
//!
//! Little endian: the counts of vertices, normals, texture coordinates and faces as `i32`, then the vertices and normals
//! (three `f32` each), the texture coordinates (two `f32`) and the faces (three `i32`).

use super::model::SceneMesh;
use nalgebra::{Point3, Vector3};

/// Reads a mesh.
///
/// # Errors
/// What is wrong with the bytes.
pub(super) fn read_msh(bytes: &[u8]) -> Result<SceneMesh, String> {
    let mut rest = bytes;
    let mut counts = [0_usize; 4];
    for count in &mut counts {
        let value = i32::from_le_bytes(take(&mut rest)?);
        *count = usize::try_from(value).map_err(|_| format!("a count is {value}"))?;
    }
    let [vertices, normals, texcoords, faces] = counts;
    // In 64 bits, so that counts of garbage do not overflow.
    let needed = 12 * (vertices as u64 + normals as u64 + faces as u64) + 8 * texcoords as u64;
    if needed != rest.len() as u64 {
        return Err(format!("its counts ask for {needed} bytes after the first 16, it has {}", rest.len()));
    }
    let of_vertices = |count: usize| count == 0 || count == vertices;
    if !of_vertices(normals) || !of_vertices(texcoords) {
        return Err(format!("{vertices} vertices have {normals} normals and {texcoords} texture coordinates"));
    }
    let mut mesh = SceneMesh { name: String::new(), positions: vec![], normals: vec![], uvs: vec![], indices: vec![] };
    for _ in 0..vertices {
        mesh.positions.push(Point3::from(floats::<3>(&mut rest)?));
    }
    for _ in 0..normals {
        mesh.normals.push(Vector3::from(floats::<3>(&mut rest)?));
    }
    for _ in 0..texcoords {
        mesh.uvs.push(floats::<2>(&mut rest)?);
    }
    for _ in 0..faces {
        let mut face = [0_u32; 3];
        for vertex in &mut face {
            let index = i32::from_le_bytes(take(&mut rest)?);
            *vertex = u32::try_from(index).map_err(|_| format!("a face names vertex {index}"))?;
        }
        mesh.indices.push(face);
    }
    Ok(mesh)
}

fn take(rest: &mut &[u8]) -> Result<[u8; 4], String> {
    let (first, others) = rest.split_first_chunk::<4>().ok_or("it ends too early")?;
    *rest = others;
    Ok(*first)
}

fn floats<const N: usize>(rest: &mut &[u8]) -> Result<[f32; N], String> {
    let mut values = [0.0; N];
    for value in &mut values {
        *value = f32::from_le_bytes(take(rest)?);
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    //! Contract: a sound file gives its mesh; no broken one does more than be refused.
    use super::*;

    fn triangle() -> Vec<u8> {
        let mut bytes: Vec<u8> = [3_i32, 0, 3, 1].iter().flat_map(|v| v.to_le_bytes()).collect();
        let numbers = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25];
        bytes.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0_i32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
        bytes
    }

    #[test]
    fn a_triangle_is_read() {
        let mesh = read_msh(&triangle()).expect("sound");
        assert_eq!((mesh.positions.len(), mesh.indices.as_slice()), (3, [[0, 1, 2]].as_slice()));
        assert_eq!(mesh.uvs[2], [0.0, 0.25]);
    }

    #[test]
    fn broken_bytes_are_refused() {
        let sound = triangle();
        for length in 0..sound.len() {
            assert!(read_msh(&sound[..length]).is_err(), "{length} bytes");
        }
        let with = |at: usize, value: i32| {
            let mut bytes = sound.clone();
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            read_msh(&bytes).expect_err("broken")
        };
        assert!(with(0, -1).contains("a count is -1"));
        assert!(with(0, i32::MAX).contains("bytes after the first 16"));
        assert!(with(sound.len() - 4, -2).contains("a face names vertex -2"));
    }
}
