//! Textures drawn for generated scenes: small PNGs that repeat.

use super::finish::{Finish, Pattern};

/// Side of a texture in pixels.
const SIDE_PX: u32 = 64;

/// The texture of a finish as a PNG; `None` for plain ones. Patterns of one colour are grey and tinted by the material.
pub(super) fn draw_texture(finish: &Finish) -> Option<Vec<u8>> {
    let (one, two) = (finish.rgb(), finish.second_rgb());
    let two_colors = |second: bool| if second { two } else { one };
    let gray = |value: f64| [value; 3];
    let pixel = |x: u32, y: u32| -> [f64; 3] {
        let noise = noise(x, y);
        match finish.pattern {
            Pattern::Plain => one,
            Pattern::Striped => two_colors(y % 16 >= 11),
            Pattern::Checkered => two_colors(x % 16 >= 13 || y % 16 >= 13),
            Pattern::Dotted => {
                let (dx, dy) = (f64::from(x % 16) - 7.5, f64::from((y + 8 * (x / 16 % 2)) % 16) - 7.5);
                two_colors(dx.hypot(dy) < 4.2)
            }
            Pattern::Grain => {
                // Rings cut along the trunk: wavy lines along x, the wave closes at the edge.
                let phase = f64::from(x) / f64::from(SIDE_PX) * std::f64::consts::TAU;
                let line = (f64::from(y) * std::f64::consts::FRAC_PI_4 + 1.6 * phase.sin()).sin();
                gray(0.93 + 0.05 * line + 0.02 * noise)
            }
            Pattern::Woven => {
                let over = (x / 4 + y / 4).is_multiple_of(2);
                gray(if over { 1.0 } else { 0.78 } - 0.1 * f64::from((if over { x } else { y }) % 4 == 0))
            }
            Pattern::Tiles => {
                let joint = x % 32 < 1 || y % 32 < 1;
                gray(if joint { 0.72 } else { 0.97 + 0.02 * noise })
            }
            Pattern::Planks => {
                let shift = if (y / 16).is_multiple_of(2) { 0 } else { 32 };
                let joint = y.is_multiple_of(16) || (x + shift).is_multiple_of(64);
                let plank = 0.94 + 0.04 * self::noise((x + shift) / 64 + 3, y / 16);
                gray(if joint { 0.7 } else { plank + 0.02 * noise })
            }
        }
    };
    if finish.pattern == Pattern::Plain {
        return None;
    }
    let bytes: Vec<u8> = (0..SIDE_PX * SIDE_PX)
        .flat_map(|i| pixel(i % SIDE_PX, i / SIDE_PX).map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8))
        .collect();
    encode(&bytes)
}

fn encode(rgb: &[u8]) -> Option<Vec<u8>> {
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, SIDE_PX, SIDE_PX);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(rgb).ok()?;
    drop(writer);
    Some(png)
}

/// Between -1 and 1, the same for the same pixel.
fn noise(x: u32, y: u32) -> f64 {
    let mut hash = x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2c1b_3c6d);
    hash ^= hash >> 12;
    f64::from(hash % 2001) / 1000.0 - 1.0
}

/// How often a texture repeats, and whether per metre: tiles, grain and planks have a natural size.
pub(super) fn repeats(pattern: Pattern) -> (f64, bool) {
    match pattern {
        Pattern::Tiles => (1.6, true),
        Pattern::Planks => (1.2, true),
        Pattern::Grain => (4.0, true),
        Pattern::Woven => (8.0, true),
        Pattern::Striped | Pattern::Checkered | Pattern::Dotted => (6.0, true),
        Pattern::Plain => (1.0, false),
    }
}
