//! The sensor model: what a cheap RGB-D camera makes of the true image.

use super::depth_noise::{DepthNoise, whole_millimetres};
use super::normal_table::NormalTable;
use super::rig::TrueImage;
use dsm::camera::CameraModel;
use pulp::{Arch, NullaryFnOnce};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use thiserror::Error;

/// What keys the noise of an image: the same key gives the same noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoiseKey {
    /// Seed of the run.
    pub seed: u64,
    /// Which of the things that draw noise; each camera has its own.
    pub stream: u64,
    /// Number of the frame.
    pub frame: u64,
}

impl NoiseKey {
    /// The generator for one part (a row, say) of what the key stands for.
    pub(super) fn rng(&self, part: u64) -> ChaCha8Rng {
        let mut seed = [0; 32];
        for (bytes, word) in seed.chunks_exact_mut(8).zip([self.seed, self.stream, self.frame, part]) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        ChaCha8Rng::from_seed(seed)
    }
}

/// Parameters of the sensor model. The defaults are those of the preset `noisy`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseParameters {
    /// Deviation of the pixel at which depth is read, pixels; default 0.25, range 0 to 0.25.
    pub depth_jitter_sigma_px: f32,
    /// Disparity at 1 m in the sensor's units; default 35.130, range 1 to 1000. Steps are an eighth of a unit.
    pub disparity_of_1_m: f32,
    /// Deviation of the disparity in the same units; default 0.0278, range 0 to 1.
    pub disparity_sigma: f32,
    /// No return below this depth, metres; default 0.2, range 0 to 2.
    pub min_range_m: f32,
    /// No return beyond this depth, metres; default 10, range above `min_range_m` to 100.
    pub max_range_m: f32,
    /// No return where ray and surface normal differ by more, radians; default 1.4 (80 degrees), range 0.5 to 1.57.
    pub grazing_limit_rad: f32,
    /// Deviation of each colour channel, sRGB steps of 255, in the dark; default 1.5, range 0 to 30.
    pub color_sigma: f32,
    /// Added deviation at full brightness; default 2, range 0 to 30.
    pub color_sigma_bright: f32,
    /// Largest relative change of exposure from frame to frame; default 0.12, range 0 to 0.9.
    pub exposure_max: f32,
    /// Largest relative change of red and of blue from frame to frame; default 0.02, range 0 to 0.5.
    pub white_balance_max: f32,
}

impl Default for NoiseParameters {
    fn default() -> Self {
        Self {
            depth_jitter_sigma_px: 0.25,
            disparity_of_1_m: 35.130,
            disparity_sigma: 0.0278,
            min_range_m: 0.2,
            max_range_m: 10.0,
            grazing_limit_rad: 1.4,
            color_sigma: 1.5,
            color_sigma_bright: 2.0,
            exposure_max: 0.12,
            white_balance_max: 0.02,
        }
    }
}

/// A parameter out of its range.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{name} = {value} is out of range: {low} to {high}")]
pub struct NoiseError {
    /// Which parameter.
    pub name: &'static str,
    /// Its value.
    pub value: f32,
    /// Lowest value allowed.
    pub low: f32,
    /// Highest value allowed.
    pub high: f32,
}

impl NoiseParameters {
    /// Checks every parameter against its range.
    pub fn check(&self) -> Result<(), NoiseError> {
        let ranges = [
            ("depth_jitter_sigma_px", self.depth_jitter_sigma_px, 0.0, 0.25),
            ("disparity_of_1_m", self.disparity_of_1_m, 1.0, 1000.0),
            ("disparity_sigma", self.disparity_sigma, 0.0, 1.0),
            ("min_range_m", self.min_range_m, 0.0, 2.0),
            ("max_range_m", self.max_range_m, self.min_range_m + 0.01, 100.0),
            ("grazing_limit_rad", self.grazing_limit_rad, 0.5, 1.57),
            ("color_sigma", self.color_sigma, 0.0, 30.0),
            ("color_sigma_bright", self.color_sigma_bright, 0.0, 30.0),
            ("exposure_max", self.exposure_max, 0.0, 0.9),
            ("white_balance_max", self.white_balance_max, 0.0, 0.5),
        ];
        match ranges.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => Err(NoiseError { name, value, low, high }),
            None => Ok(()),
        }
    }
}

/// Colour and depth as a sensor gives them: the image part of an `RgbdFrame`. There are no labels in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensedImage {
    /// Colour, sRGB, row-major.
    pub color: Vec<[u8; 3]>,
    /// Depth along z in metres, whole millimetres, row-major; 0 means no return.
    pub depth_m: Vec<f32>,
}

/// Turns true images into sensed ones.
#[derive(Clone, Debug)]
pub struct SensorModel {
    noise: Option<Noise>,
}

#[derive(Clone, Debug)]
struct Noise {
    parameters: NoiseParameters,
    normal: NormalTable<4096>,
    /// For colour fewer steps do.
    coarse_normal: NormalTable<1024>,
    /// The instructions of this machine.
    arch: Arch,
}

impl SensorModel {
    /// The preset `oracle`: the sensed image is the true one, its depth in whole millimetres.
    pub fn oracle() -> Self {
        Self { noise: None }
    }

    /// The preset `noisy`, or one with other parameters.
    pub fn noisy(parameters: NoiseParameters) -> Result<Self, NoiseError> {
        parameters.check()?;
        Ok(Self {
            noise: Some(Noise {
                parameters,
                normal: NormalTable::new(),
                coarse_normal: NormalTable::new(),
                arch: Arch::new(),
            }),
        })
    }

    /// What the sensor makes of a true image of a camera. Every row draws from its own stream, so that the number of
    /// threads does not matter.
    pub fn sense(&self, image: &TrueImage, model: &CameraModel, key: NoiseKey) -> SensedImage {
        let Some(noise) = &self.noise else {
            let depth_m = image.depth_m.iter().map(|&depth_m| whole_millimetres(depth_m)).collect();
            return SensedImage { color: image.color.clone(), depth_m };
        };
        let mut sensed = SensedImage { color: image.color.clone(), depth_m: vec![0.0; image.depth_m.len()] };
        let width = model.width as usize;
        if width == 0 {
            return sensed;
        }
        let depth = DepthNoise::new(&noise.parameters, &noise.normal, model, &image.depth_m);
        let curves = ColorCurves::draw(&noise.parameters, key);
        (sensed.color.par_chunks_mut(width).zip(sensed.depth_m.par_chunks_mut(width))).enumerate().for_each_init(
            || (vec![0_u8; 8 * width], vec![0_u32; width], vec![0_u32; width], vec![0.0_f32; 3 * width]),
            |(bytes, bits, places, normals), (row, (color, depth_m))| {
                // Part 0 belongs to the frame as a whole.
                key.rng(row as u64 + 1).fill_bytes(bytes);
                let (for_depth, for_color) = bytes.split_at(4 * width);
                let (depth, curves, normal) = (&depth, &curves, &noise.coarse_normal);
                let random = RowBits { for_depth, for_color, words: bits, places, normals };
                noise.arch.dispatch(RowWork { depth, curves, normal, row, random, color, depth_m });
            },
        );
        sensed
    }
}

/// Random bytes of a row, and room for what is made of them.
struct RowBits<'a> {
    for_depth: &'a [u8],
    for_color: &'a [u8],
    words: &'a mut [u32],
    /// Pixels at which depth is read.
    places: &'a mut [u32],
    /// Normally distributed numbers, one for each channel of each pixel.
    normals: &'a mut [f32],
}

/// One row of depth and colour.
struct RowWork<'a> {
    depth: &'a DepthNoise<'a>,
    curves: &'a ColorCurves,
    normal: &'a NormalTable<1024>,
    row: usize,
    random: RowBits<'a>,
    color: &'a mut [[u8; 3]],
    depth_m: &'a mut [f32],
}

impl NullaryFnOnce for RowWork<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let RowBits { for_depth, for_color, words, places, normals } = self.random;
        read_words(for_depth, words);
        self.depth.measure_row(self.row, words, places, &mut normals[..self.depth_m.len()], self.depth_m);
        read_words(for_color, words);
        for (normals, bits) in normals.as_chunks_mut::<3>().0.iter_mut().zip(words) {
            *normals = [0, 10, 20].map(|shift| self.normal.get(*bits >> shift));
        }
        self.curves.spoil_row(normals, self.color.as_flattened_mut());
    }
}

/// Reads little-endian words: the same on every machine.
#[inline(always)]
fn read_words(bytes: &[u8], words: &mut [u32]) {
    for (word, bytes) in words.iter_mut().zip(bytes.chunks_exact(4)) {
        *word = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    }
}

/// What exposure and white balance make of each channel, and the deviation of its noise in the dark and added in full
/// light.
struct ColorCurves {
    gains: [f32; 3],
    sigma: f32,
    sigma_bright: f32,
}

/// Channels that are spoilt together: a whole number of pixels and of vectors.
const PIECE: usize = 96;

impl ColorCurves {
    fn draw(parameters: &NoiseParameters, key: NoiseKey) -> Self {
        let mut rng = key.rng(0);
        let mut within = |largest: f32| 1.0 + largest * (2.0 * rng.random::<f32>() - 1.0);
        let exposure = within(parameters.exposure_max);
        let gains = [
            exposure * within(parameters.white_balance_max),
            exposure,
            exposure * within(parameters.white_balance_max),
        ];
        // A gain of linear light is a gain of about its 2.2th root in sRGB.
        let gains = gains.map(|gain| gain.powf(1.0 / 2.2));
        Self { gains, sigma: parameters.color_sigma, sigma_bright: parameters.color_sigma_bright }
    }

    /// Spoils the channels of a row, with one normally distributed number for each.
    #[inline(always)]
    fn spoil_row(&self, normals: &[f32], channels: &mut [u8]) {
        let gains: [f32; PIECE] = std::array::from_fn(|i| self.gains[i % 3]);
        for (channels, normals) in channels.chunks_mut(PIECE).zip(normals.chunks(PIECE)) {
            for ((channel, normal), gain) in channels.iter_mut().zip(normals).zip(&gains) {
                let value = f32::from(*channel);
                let sigma = self.sigma + self.sigma_bright * (value / 255.0).sqrt();
                let sensed = value * gain + sigma * normal + 0.5;
                let sensed = if sensed > 0.0 { sensed } else { 0.0 };
                let sensed = if sensed < 255.0 { sensed } else { 255.0 };
                // The lowest bits of the sum are the whole number; casting takes several instructions more.
                *channel = (sensed.floor() + 8_388_608.0).to_bits() as u8;
            }
        }
    }
}
