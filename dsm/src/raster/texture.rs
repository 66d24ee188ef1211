//! Textures with mip levels.

use super::image::linear_from_srgb;
use thiserror::Error;

/// Why a texture cannot be built.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TextureError {
    /// The number of texels does not match the size, or the size is zero or too large.
    #[error("a texture of {width} x {height} texels (1 to 8192 each way) cannot be built from {texels} values")]
    Size {
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
        /// Number of values given.
        texels: usize,
    },
}

/// Steps of a channel of a stored texel.
const STEPS: f32 = 1023.0;
/// A stored texel of full light.
pub(super) const WHITE: u32 = (1 << 30) - 1;

/// One size of a picture, with a border that repeats it: every 2 x 2 block that filtering reads is a block in memory.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    width: usize,
    height: usize,
    /// Rows of `width + 2`, `height + 2` of them: 10 bits for the square root of each channel's light, red lowest. Four
    /// bytes instead of four floats keep a texture in the second-level cache, and the root spends its steps as sRGB does.
    texels: Vec<u32>,
}

/// A picture that repeats in both directions, with mip levels down to one texel, filtered bilinearly.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    levels: Vec<Level>,
}

impl Texture {
    /// A texture from row-major sRGB values, first row at the top.
    pub fn new(width: u32, height: u32, rgb: &[[u8; 3]]) -> Result<Self, TextureError> {
        let (columns, rows) = (width as usize, height as usize);
        let sound = (1..=8192).contains(&width) && (1..=8192).contains(&height) && rgb.len() == columns * rows;
        if !sound {
            return Err(TextureError::Size { width, height, texels: rgb.len() });
        }
        let linear: [f32; 256] = std::array::from_fn(|value| linear_from_srgb(value as f32 / 255.0));
        let light = rgb.iter().map(|&[r, g, b]| [linear[r as usize], linear[g as usize], linear[b as usize]]);
        let mut picture = Picture { width: columns, height: rows, light: light.collect() };
        let mut levels = vec![Level::pack(&picture)];
        while let Some(next) = picture.find_next() {
            levels.push(Level::pack(&next));
            picture = next;
        }
        Ok(Self { levels })
    }

    /// One colour.
    pub fn flat(color: [u8; 3]) -> Self {
        Self::paint(1, |_, _| color)
    }

    /// `cells` x `cells` squares of two colours in turn.
    pub fn checker(cells: u32, first: [u8; 3], second: [u8; 3]) -> Self {
        let cells = cells.clamp(1, 64);
        Self::paint(cells * 16, |x, y| if (x / 16 + y / 16) % 2 == 0 { first } else { second })
    }

    /// From one colour at the top to another at the bottom.
    pub fn gradient(top: [u8; 3], bottom: [u8; 3]) -> Self {
        Self::paint(64, |_, y| mix(top, bottom, y as f32 / 63.0))
    }

    /// Rows of bricks or tiles with joints: `columns` x `rows` stones, every other row shifted by half a stone.
    pub fn bricks(columns: u32, rows: u32, stone: [u8; 3], joint: [u8; 3]) -> Self {
        let (columns, rows) = (columns.clamp(1, 16), rows.clamp(1, 16));
        let size = 256;
        Self::paint(size, |x, y| {
            let row = y * rows / size;
            let shifted = x * columns + if row % 2 == 1 { size / 2 } else { 0 };
            let at_joint = y * rows % size < size / 16 || shifted % size < size / 20;
            let shade = 0.12 * (hash_unit(shifted / size % columns, row, 17) - 0.5);
            if at_joint { joint } else { brighten(stone, shade) }
        })
    }

    /// Wood: planks along u with grain, drawn from `seed`.
    pub fn wood(planks: u32, light: [u8; 3], dark: [u8; 3], seed: u32) -> Self {
        let planks = planks.clamp(1, 32);
        let size = 256;
        Self::paint(size, |x, y| {
            let plank = y * planks / size;
            // The grain is long along the plank and fine across it.
            let grain = 0.6 * smooth_noise(x, y, 64, 4, size, seed.wrapping_add(plank))
                + 0.4 * smooth_noise(x, y, 32, 2, size, seed.wrapping_add(1000));
            let tone = 0.25 * hash_unit(plank, seed, 3);
            let joint = if planks > 1 && y * planks % size < planks { 0.35 } else { 0.0 };
            mix(light, dark, (0.75 * grain + tone + joint).min(1.0))
        })
    }

    /// Soft irregular spots between two colours (cloth, stone, plaster), drawn from `seed`.
    pub fn speckle(first: [u8; 3], second: [u8; 3], seed: u32) -> Self {
        let size = 128;
        Self::paint(size, |x, y| {
            let share = 0.4 * smooth_noise(x, y, 32, 32, size, seed)
                + 0.3 * smooth_noise(x, y, 8, 8, size, seed.wrapping_add(1))
                + 0.3 * hash_unit(x, y, seed.wrapping_add(2));
            mix(first, second, share)
        })
    }

    /// A square texture from a colour per (column, row).
    fn paint(size: u32, color: impl Fn(u32, u32) -> [u8; 3]) -> Self {
        let rgb: Vec<[u8; 3]> = (0..size * size).map(|i| color(i % size, i / size)).collect();
        Self::new(size, size, &rgb).unwrap_or_else(|_| unreachable!("the makers ask for sound sizes"))
    }

    /// Width in texels.
    pub fn width(&self) -> u32 {
        self.levels[0].width as u32
    }

    /// Height in texels.
    pub fn height(&self) -> u32 {
        self.levels[0].height as u32
    }

    /// The mip level for a texture area of `texels_per_pixel` (texels squared per pixel squared).
    #[inline(always)]
    pub(super) fn level_for(&self, texels_per_pixel: f32) -> usize {
        // floor(log2) from the exponent bits; level k serves 2^(2k-1) to 2^(2k+1) texels.
        let exponent = (texels_per_pixel.to_bits() >> 23) as i32 - 127;
        (((exponent + 1).max(0) / 2) as usize).min(self.levels.len() - 1)
    }

    /// A mip level, as [`Texture::level_for`] counts them.
    #[inline(always)]
    pub(super) fn level(&self, level: usize) -> &Level {
        &self.levels[level]
    }
}

impl Level {
    /// Stores a picture with its border.
    fn pack(picture: &Picture) -> Self {
        let (width, height) = (picture.width, picture.height);
        // The column (or row) before the first is the last one, and the one after the last is the first.
        let inner = |i: usize, count: usize| (i + count - 1) % count;
        let mut texels = Vec::with_capacity((width + 2) * (height + 2));
        for y in 0..height + 2 {
            for x in 0..width + 2 {
                let light = picture.light[inner(y, height) * width + inner(x, width)];
                let [r, g, b] = light.map(|light| (light.sqrt() * STEPS).round() as u32);
                texels.push(r | g << 10 | b << 20);
            }
        }
        Self { width, height, texels }
    }

    /// Width and height in texels, as sampling counts them.
    #[inline(always)]
    pub(super) fn size(&self) -> [f32; 2] {
        [self.width as f32, self.height as f32]
    }

    /// The 2 x 2 block whose upper left texel stands at (column, row) of the stored rows: upper left, upper right, lower
    /// left, lower right.
    #[inline(always)]
    pub(super) fn block(&self, column: u32, row: u32) -> [u32; 4] {
        let stride = self.width + 2;
        // `find_block` never asks for more; the limits spare the check of each texel.
        let first = (row as usize).min(self.height) * stride + (column as usize).min(self.width);
        let (upper, lower) = (&self.texels[first..first + 2], &self.texels[first + stride..first + stride + 2]);
        [upper[0], upper[1], lower[0], lower[1]]
    }
}

/// The stored column (or row) of the first of two texels around a repeating coordinate, and the share of the second.
#[inline(always)]
pub(super) fn find_block(coordinate: f32, size: f32) -> (u32, f32) {
    // From -0.5 to size - 0.5; stored columns count from -1.
    let place = (coordinate - coordinate.floor()) * size + 0.5;
    let first = place.floor();
    (whole_number(first), place - first)
}

/// A whole number from 0 to 2^22 out of its float; anything for other floats. Casting would take several instructions
/// for values that do not occur.
#[inline(always)]
pub(super) fn whole_number(value: f32) -> u32 {
    (value + 8_388_608.0).to_bits() & 0x3f_ffff
}

/// Linear light of a channel of a stored texel; its bits begin at `shift`: 0 is red, 10 green, 20 blue.
#[inline(always)]
pub(super) fn light_of(texel: u32, shift: u32) -> f32 {
    const SCALE: f32 = 1.0 / (STEPS * STEPS);
    // Through i32: there is an instruction for that.
    let root = ((texel >> shift) & 1023) as i32 as f32;
    root * root * SCALE
}

/// A picture in linear light.
struct Picture {
    width: usize,
    height: usize,
    light: Vec<[f32; 3]>,
}

impl Picture {
    /// The picture with half the size, or `None` for a single texel.
    fn find_next(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut light = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let (x1, y1) = ((2 * x + 1).min(self.width - 1), (2 * y + 1).min(self.height - 1));
                let at = |x: usize, y: usize| self.light[y * self.width + x];
                let (a, b, c, d) = (at(2 * x, 2 * y), at(x1, 2 * y), at(2 * x, y1), at(x1, y1));
                light.push(std::array::from_fn(|i| 0.25 * (a[i] + b[i] + c[i] + d[i])));
            }
        }
        Some(Self { width, height, light })
    }
}

fn mix(a: [u8; 3], b: [u8; 3], share: f32) -> [u8; 3] {
    std::array::from_fn(|i| (f32::from(a[i]) + (f32::from(b[i]) - f32::from(a[i])) * share).round() as u8)
}

fn brighten(color: [u8; 3], share: f32) -> [u8; 3] {
    color.map(|c| (f32::from(c) * (1.0 + share)).round() as u8)
}

/// A well-mixed value from 0 to 1 for a grid point (the finaliser of MurmurHash3).
fn hash_unit(x: u32, y: u32, seed: u32) -> f32 {
    let mut h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ seed.wrapping_mul(0xC2B2_AE3D);
    h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
    h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
    ((h ^ (h >> 16)) >> 8) as f32 / (1 << 24) as f32
}

/// Smooth noise from 0 to 1 on a grid of `cell_x` x `cell_y` texels that repeats after `size`.
fn smooth_noise(x: u32, y: u32, cell_x: u32, cell_y: u32, size: u32, seed: u32) -> f32 {
    let (nx, ny) = (size / cell_x, size / cell_y);
    let (cx, cy) = (x / cell_x % nx, y / cell_y % ny);
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    let (fx, fy) = (ease((x % cell_x) as f32 / cell_x as f32), ease((y % cell_y) as f32 / cell_y as f32));
    let at = |i: u32, j: u32| hash_unit(i % nx, j % ny, seed);
    let top = at(cx, cy) + (at(cx + 1, cy) - at(cx, cy)) * fx;
    let bottom = at(cx, cy + 1) + (at(cx + 1, cy + 1) - at(cx, cy + 1)) * fx;
    top + (bottom - top) * fy
}

#[cfg(test)]
mod tests {
    //! Contract: sampling returns the texels at their centres, repeats, and mip levels keep the mean light.
    use super::*;

    /// Light at (u, v) of a mip level.
    fn sample(texture: &Texture, level: usize, u: f32, v: f32) -> [f32; 3] {
        let level = texture.level(level);
        let [width, height] = level.size();
        let ((column, right), (row, low)) = (find_block(u, width), find_block(v, height));
        let block = level.block(column, row);
        [0, 10, 20].map(|shift| {
            let [a, b, c, d] = block.map(|texel| light_of(texel, shift));
            (a + (b - a) * right) * (1.0 - low) + (c + (d - c) * right) * low
        })
    }

    #[test]
    fn texel_centres_give_the_texels_and_the_picture_repeats() {
        let rgb = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [0, 0, 0], [9, 9, 9]];
        let texture = Texture::new(3, 2, &rgb).expect("sound size");
        for (i, color) in rgb.iter().enumerate() {
            let (u, v) = (((i % 3) as f32 + 0.5) / 3.0, ((i / 3) as f32 + 0.5) / 2.0);
            for (du, dv) in [(0.0, 0.0), (2.0, -3.0), (-1.0, 1.0)] {
                let got = sample(&texture, 0, u + du, v + dv);
                for (g, c) in got.iter().zip(color) {
                    // Stored in 10 bits: within a fifth of an 8-bit step.
                    let step = 255.0 * crate::raster::srgb_from_linear(*g) - f32::from(*c);
                    assert!(step.abs() < 0.2, "{got:?} for {color:?}");
                }
            }
        }
        let between = sample(&texture, 0, 1.0 / 3.0, 0.25);
        assert!((between[0] - 0.5).abs() < 1e-4 && (between[1] - 0.5).abs() < 1e-4);
    }

    #[test]
    fn any_coordinate_is_answered() {
        let texture = Texture::new(2, 1, &[[255; 3], [0; 3]]).expect("sound size");
        for coordinate in [-1e-9, 1e30, -1e30, f32::NAN, f32::INFINITY] {
            let _ = sample(&texture, 0, coordinate, coordinate);
        }
        assert!((sample(&texture, 0, -1e-9, 0.5)[0] - 0.5).abs() < 1e-3);
    }

    #[test]
    fn every_8_bit_value_survives_storage() {
        for value in 0..=255_u8 {
            let light = sample(&Texture::flat([value; 3]), 0, 0.5, 0.5)[1];
            assert_eq!((255.0 * crate::raster::srgb_from_linear(light)).round() as u8, value);
        }
    }

    #[test]
    fn far_away_a_checker_is_its_mean() {
        let texture = Texture::checker(4, [255; 3], [0; 3]);
        assert_eq!(texture.level_for(1.0), 0);
        assert_eq!(texture.level_for(4.0), 1);
        assert_eq!(texture.level_for(17.0), 2);
        let last = texture.level_for(1e12);
        assert!((sample(&texture, last, 0.3, 0.9)[0] - 0.5).abs() < 1e-3);
    }

    #[test]
    fn makers_paint_what_they_say_and_bad_sizes_are_refused() {
        assert!(Texture::new(2, 2, &[[0; 3]; 3]).is_err());
        assert!(Texture::new(0, 2, &[]).is_err());
        let gradient = Texture::gradient([255; 3], [0; 3]);
        assert!(sample(&gradient, 0, 0.5, 0.05)[0] > sample(&gradient, 0, 0.5, 0.9)[0]);
        for texture in [
            Texture::wood(4, [190, 140, 90], [110, 70, 40], 1),
            Texture::speckle([200; 3], [150; 3], 2),
            Texture::bricks(4, 8, [170, 80, 60], [200; 3]),
        ] {
            let values: Vec<f32> =
                (0..64).map(|i| sample(&texture, 0, i as f32 / 8.0 + 0.03, i as f32 / 64.0)[0]).collect();
            let (low, high) = values.iter().fold((f32::MAX, 0.0_f32), |(l, h), &v| (l.min(v), h.max(v)));
            assert!(high > low + 0.01, "a maker painted one flat colour");
        }
    }
}
