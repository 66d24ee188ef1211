//! Depth as a structured-light camera returns it.
//!
//! The disparity model is that of Redwood (Choi, Zhou, Koltun: Robust Reconstruction of Indoor Scenes, 2015), as
//! habitat-sim uses it: z' = D * 8 / round(8 (D / z + s N)), with D the disparity of 1 m, s the disparity noise and z read
//! at a jittered pixel. There is no return at depth edges and from surfaces seen at a grazing angle; both show as a steep
//! surface between neighbouring pixels.

use super::noise::NoiseParameters;
use super::normal_table::NormalTable;
use dsm::camera::CameraModel;

/// What the noise of one image's depth needs.
pub(super) struct DepthNoise<'a> {
    parameters: &'a NoiseParameters,
    normal: &'a NormalTable<4096>,
    width: usize,
    height: usize,
    /// True depth.
    depth_m: &'a [f32],
    /// True inverse depth, 0 where nothing is seen.
    inverse_m: Vec<f32>,
    focal: [f32; 2],
    /// Ray of each column and row at z = 1.
    columns: Vec<f32>,
    rows: Vec<f32>,
    cos_limit_squared: f32,
    /// Of 4096: how often the jitter moves a pixel by one in a given direction.
    jitter_share: u32,
}

impl<'a> DepthNoise<'a> {
    pub(super) fn new(
        parameters: &'a NoiseParameters,
        normal: &'a NormalTable<4096>,
        model: &CameraModel,
        depth_m: &'a [f32],
    ) -> Self {
        let ray = |i: u32, center: f64, focal: f64| ((f64::from(i) + 0.5 - center) / focal) as f32;
        let cos_limit = parameters.grazing_limit_rad.cos();
        // Jitter beyond half a pixel reads the neighbour; two pixels lie beyond six deviations.
        let beyond = |v: &u32| normal.get(*v) * parameters.depth_jitter_sigma_px > 0.5;
        Self {
            parameters,
            normal,
            width: model.width as usize,
            height: model.height as usize,
            depth_m,
            inverse_m: depth_m.iter().map(|&z| if z > 0.0 { 1.0 / z } else { 0.0 }).collect(),
            focal: [model.fx as f32, model.fy as f32],
            columns: (0..model.width).map(|column| ray(column, model.cx, model.fx)).collect(),
            rows: (0..model.height).map(|row| ray(row, model.cy, model.fy)).collect(),
            cos_limit_squared: cos_limit * cos_limit,
            jitter_share: (0..4096_u32).filter(beyond).count() as u32,
        }
    }

    /// The measured depth of a row; `bits` holds random bits for each pixel, of which the lowest 24 are used.
    pub(super) fn measure_row(&self, row: usize, bits: &[u32], out: &mut [f32]) {
        let line = row * self.width;
        for (column, (out, &bits)) in out.iter_mut().zip(bits).enumerate() {
            *out = if self.returns(row, column) {
                // The jitter of both axes shares 12 bits: the columns take the low, the rows the high half.
                let z = self.depth_m[self.jittered(line, row, column, bits >> 12)];
                self.quantise(z, self.normal.get(bits))
            } else {
                0.0
            };
        }
    }

    /// Whether the surface is within range and not too steep against the ray.
    #[inline]
    fn returns(&self, row: usize, column: usize) -> bool {
        let pixel = row * self.width + column;
        let w = self.inverse_m[pixel];
        let z = self.depth_m[pixel];
        if !(z >= self.parameters.min_range_m && z <= self.parameters.max_range_m) {
            return false;
        }
        let rise_x = steepest(
            w,
            (column > 0).then(|| self.inverse_m[pixel - 1]),
            (column + 1 < self.width).then(|| self.inverse_m[pixel + 1]),
        );
        let rise_y = steepest(
            w,
            (row > 0).then(|| self.inverse_m[pixel - self.width]),
            (row + 1 < self.height).then(|| self.inverse_m[pixel + self.width]),
        );
        // On a plane the inverse depth is w = a + b X + c Y with the ray (X, Y, 1); (b, c, a) is along its normal.
        let (ray_x, ray_y) = (self.columns[column], self.rows[row]);
        let (b, c) = (rise_x * self.focal[0], rise_y * self.focal[1]);
        let a = w - b * ray_x - c * ray_y;
        let ray = ray_x * ray_x + ray_y * ray_y + 1.0;
        w * w > self.cos_limit_squared * (a * a + b * b + c * c) * ray
    }

    #[inline]
    fn jittered(&self, line: usize, row: usize, column: usize, bits: u32) -> usize {
        let direction = |bits: u32| {
            let bits = bits & 4095;
            i32::from(bits < self.jitter_share) - i32::from(bits >= 4096 - self.jitter_share)
        };
        // The rows use the same bits in another order: multiplying by an odd number permutes them.
        let (dx, dy) = (direction(bits), direction(bits.wrapping_mul(2_654_435_761) >> 20));
        if dx == 0 && dy == 0 {
            return line + column;
        }
        let column = (column as i32 + dx).clamp(0, self.width as i32 - 1) as usize;
        let row = (row as i32 + dy).clamp(0, self.height as i32 - 1) as usize;
        row * self.width + column
    }

    #[inline]
    fn quantise(&self, z: f32, noise: f32) -> f32 {
        if z <= 0.0 {
            return 0.0;
        }
        let p = self.parameters;
        let steps = ((p.disparity_of_1_m / z + p.disparity_sigma * noise) * 8.0 + 0.5) as i32;
        if steps < 1 {
            return 0.0;
        }
        let measured = p.disparity_of_1_m * 8.0 / steps as f32;
        if measured <= p.max_range_m { measured } else { 0.0 }
    }
}

/// The rise of the inverse depth per pixel towards the neighbour that differs more.
#[inline]
fn steepest(here: f32, before: Option<f32>, after: Option<f32>) -> f32 {
    let before = before.map_or(0.0, |w| here - w);
    let after = after.map_or(0.0, |w| w - here);
    if before.abs() > after.abs() { before } else { after }
}
