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

#[derive(Clone, Debug, PartialEq)]
struct Level {
    width: usize,
    height: usize,
    /// Linear light, row-major; the fourth value is padding that keeps a texel in one cache line.
    texels: Vec<[f32; 4]>,
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
        let texels = rgb.iter().map(|&[r, g, b]| [linear[r as usize], linear[g as usize], linear[b as usize], 0.0]);
        let mut levels = vec![Level { width: columns, height: rows, texels: texels.collect() }];
        while let Some(next) = levels.last().and_then(Level::find_next) {
            levels.push(next);
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

    /// Linear light at (u, v) of a mip level.
    #[inline(always)]
    pub(super) fn sample(&self, level: usize, u: f32, v: f32) -> [f32; 3] {
        let level = &self.levels[level];
        let (x0, x1, fx) = neighbours(u, level.width);
        let (y0, y1, fy) = neighbours(v, level.height);
        let (upper, lower) = (y0 * level.width, y1 * level.width);
        let (a, b) = (&level.texels[upper + x0], &level.texels[upper + x1]);
        let (c, d) = (&level.texels[lower + x0], &level.texels[lower + x1]);
        std::array::from_fn(|i| {
            let top = a[i] + (b[i] - a[i]) * fx;
            let bottom = c[i] + (d[i] - c[i]) * fx;
            top + (bottom - top) * fy
        })
    }
}

impl Level {
    /// The level with half the size, or `None` for a single texel.
    fn find_next(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let (x1, y1) = ((2 * x + 1).min(self.width - 1), (2 * y + 1).min(self.height - 1));
                let at = |x: usize, y: usize| self.texels[y * self.width + x];
                let (a, b, c, d) = (at(2 * x, 2 * y), at(x1, 2 * y), at(2 * x, y1), at(x1, y1));
                texels.push(std::array::from_fn(|i| 0.25 * (a[i] + b[i] + c[i] + d[i])));
            }
        }
        Some(Self { width, height, texels })
    }
}

/// The two texels around a repeating coordinate and the share of the second.
#[inline(always)]
fn neighbours(coordinate: f32, size: usize) -> (usize, usize, f32) {
    // Casts instead of `floor`, which is a call on a baseline x86-64.
    let whole = coordinate as i32 as f32;
    let part = coordinate - whole;
    let part = if part < 0.0 { part + 1.0 } else { part };
    let x = part * size as f32 - 0.5;
    let (first, share) = if x < 0.0 { (size - 1, x + 1.0) } else { (x as usize, x - x as usize as f32) };
    let first = first.min(size - 1);
    let second = if first + 1 == size { 0 } else { first + 1 };
    (first, second, share)
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

    #[test]
    fn texel_centres_give_the_texels_and_the_picture_repeats() {
        let rgb = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [0, 0, 0], [9, 9, 9]];
        let texture = Texture::new(3, 2, &rgb).expect("sound size");
        for (i, color) in rgb.iter().enumerate() {
            let (u, v) = (((i % 3) as f32 + 0.5) / 3.0, ((i / 3) as f32 + 0.5) / 2.0);
            for (du, dv) in [(0.0, 0.0), (2.0, -3.0), (-1.0, 1.0)] {
                let got = texture.sample(0, u + du, v + dv);
                for (g, c) in got.iter().zip(color) {
                    assert!((g - linear_from_srgb(f32::from(*c) / 255.0)).abs() < 1e-4, "{got:?} for {color:?}");
                }
            }
        }
        let between = texture.sample(0, 1.0 / 3.0, 0.25);
        assert!((between[0] - 0.5).abs() < 1e-4 && (between[1] - 0.5).abs() < 1e-4);
    }

    #[test]
    fn far_away_a_checker_is_its_mean() {
        let texture = Texture::checker(4, [255; 3], [0; 3]);
        assert_eq!(texture.level_for(1.0), 0);
        assert_eq!(texture.level_for(4.0), 1);
        assert_eq!(texture.level_for(17.0), 2);
        let last = texture.level_for(1e12);
        assert!((texture.sample(last, 0.3, 0.9)[0] - 0.5).abs() < 1e-5);
    }

    #[test]
    fn makers_paint_what_they_say_and_bad_sizes_are_refused() {
        assert!(Texture::new(2, 2, &[[0; 3]; 3]).is_err());
        assert!(Texture::new(0, 2, &[]).is_err());
        let gradient = Texture::gradient([255; 3], [0; 3]);
        assert!(gradient.sample(0, 0.5, 0.05)[0] > gradient.sample(0, 0.5, 0.9)[0]);
        for texture in [
            Texture::wood(4, [190, 140, 90], [110, 70, 40], 1),
            Texture::speckle([200; 3], [150; 3], 2),
            Texture::bricks(4, 8, [170, 80, 60], [200; 3]),
        ] {
            let values: Vec<f32> =
                (0..64).map(|i| texture.sample(0, i as f32 / 8.0 + 0.03, i as f32 / 64.0)[0]).collect();
            let (low, high) = values.iter().fold((f32::MAX, 0.0_f32), |(l, h), &v| (l.min(v), h.max(v)));
            assert!(high > low + 0.01, "a maker painted one flat colour");
        }
    }
}
