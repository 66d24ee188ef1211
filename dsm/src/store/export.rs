//! Exports for other tools.

use super::gltf::glb;
use super::spark_dsg::spark_dsg;
use super::{StoreError, show_map, write_atomically};
use crate::map::{CellState, Map};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A foreign format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// Points with colour and object identity, ASCII PLY.
    Ply,
    /// Objects, relations and rooms.
    Json,
    /// One object a line.
    Csv,
    /// glTF 2.0, binary.
    Gltf,
    /// A scene graph as spark_dsg reads it.
    SparkDsg,
    /// Occupancy image and its `.yaml`, as Nav2's map server reads them.
    Nav2,
}

/// Writes the map to `path`; `Nav2` writes an image `.pgm` and a `.yaml` beside it, whichever of the two `path` names.
pub fn export_map(map: &Map, format: ExportFormat, path: &Path) -> Result<(), StoreError> {
    match format {
        ExportFormat::Ply => write_atomically(path, ply(map).as_bytes()),
        ExportFormat::Json => write_atomically(path, json(map).as_bytes()),
        ExportFormat::Csv => write_atomically(path, csv(map).as_bytes()),
        ExportFormat::Gltf => write_atomically(path, &glb(map)),
        ExportFormat::SparkDsg => write_atomically(path, spark_dsg(map).to_string().as_bytes()),
        ExportFormat::Nav2 => {
            let image_path = beside(path, "pgm");
            let (image, yaml) = nav2(map, &image_path);
            write_atomically(&image_path, &image)?;
            write_atomically(&beside(path, "yaml"), yaml.as_bytes())
        }
    }
}

/// The path with another ending; one that belongs to neither file of a Nav2 map is a part of the name.
fn beside(path: &Path, ending: &str) -> PathBuf {
    match path.extension().and_then(|own| own.to_str()) {
        Some("pgm" | "yaml") => path.with_extension(ending),
        _ => {
            let mut name = path.as_os_str().to_owned();
            name.push(".");
            name.push(ending);
            name.into()
        }
    }
}

fn ply(map: &Map) -> String {
    let count: usize = map.stable_objects().map(|o| o.points.len()).sum();
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment world frame, metres, z up\nelement vertex {count}\nproperty float x\nproperty float y\n\
         property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty int instance\nend_header\n"
    );
    for object in map.stable_objects() {
        for point in &object.points {
            let (p, [r, g, b]) = (point.position, point.color);
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{} {} {} {r} {g} {b} {}", p.x, p.y, p.z, object.id.0);
        }
    }
    text
}

fn json(map: &Map) -> String {
    let mut text = serde_json::to_string_pretty(&show_map(map)).unwrap_or_default();
    text.push('\n');
    text
}

fn csv(map: &Map) -> String {
    let mut text =
        String::from("id,name,x_m,y_m,z_m,size_x_m,size_y_m,size_z_m,qw,qx,qy,qz,room,observations,confidence\n");
    for o in show_map(map).objects {
        let ([x, y, z], [sx, sy, sz], [w, i, j, k]) = (o.center, o.size, o.quat_wxyz);
        let quote = |s: &str| format!("\"{}\"", s.replace('"', "\"\""));
        let _ = writeln!(
            text,
            "{},{},{x},{y},{z},{sx},{sy},{sz},{w},{i},{j},{k},{},{},{}",
            o.id,
            quote(&o.name),
            quote(o.room.as_deref().unwrap_or("")),
            o.observations,
            o.confidence
        );
    }
    text
}

fn nav2(map: &Map, path: &Path) -> (Vec<u8>, String) {
    let grid = &map.free_space;
    let mut image = format!("P5\n{} {}\n255\n", grid.columns, grid.rows).into_bytes();
    // Images run from the top, the grid from the lowest y.
    for row in (0..grid.rows).rev() {
        image.extend(grid.cells[row * grid.columns..(row + 1) * grid.columns].iter().map(|cell| match cell {
            CellState::Unknown => 205,
            CellState::Free => 254,
            CellState::Occupied => 0,
        }));
    }
    let r = grid.resolution_m;
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let yaml = format!(
        "image: {name}\nmode: trinary\nresolution: {r}\norigin: [{}, {}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
        f64::from(grid.origin_cell[0]) * r,
        f64::from(grid.origin_cell[1]) * r
    );
    (image, yaml)
}
