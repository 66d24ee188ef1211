//! Renders a furnished room and writes `<path>` (colour), `<path>.depth.png` and `<path>.labels.png`.
//!
//! `cargo run --release -p dsm --example render_primitives -- /tmp/room.png`

use dsm::camera::CameraModel;
use dsm::raster::{RenderOptions, render};
use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

#[path = "../tests/raster_room/mod.rs"]
mod raster_room;

fn write(path: &str, camera: &CameraModel, rgb: impl Iterator<Item = [u8; 3]>) -> Result<(), Box<dyn Error>> {
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), camera.width, camera.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&rgb.flatten().collect::<Vec<u8>>())?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("give the path of the PNG to write")?;
    let camera = CameraModel::from_vertical_fov(640, 480, 1.0);
    let image = render(&raster_room::room(72), &camera, &raster_room::view(), &RenderOptions::default());
    write(&path, &camera, image.color.into_iter())?;
    let grey = |depth: &f32| [(255.0 * (1.0 - depth / 6.0).clamp(0.0, 1.0)) as u8; 3];
    write(&format!("{path}.depth.png"), &camera, image.depth_m.iter().map(grey))?;
    let tint = |label: &u32| [97_u32, 151, 211].map(|factor| (label * factor % 256) as u8);
    write(&format!("{path}.labels.png"), &camera, image.labels.iter().map(tint))
}
