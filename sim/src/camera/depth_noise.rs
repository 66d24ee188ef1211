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

    /// The measured depth of a row; `bits` holds random bits for each pixel, of which the lowest 24 are used, `places` and
    /// `noise` are room for as many numbers. Inlined into each set of instructions that the caller picks from; the
    /// arithmetic is the same in all of them.
    #[inline(always)]
    pub(super) fn measure_row(&self, row: usize, bits: &[u32], places: &mut [u32], noise: &mut [f32], out: &mut [f32]) {
        let (line, width) = (row * self.width, self.width);
        // 1. Where the surface returns light: 1, else 0.
        let here = &self.inverse_m[line..line + width];
        // At the border of the image a neighbour that is missing counts like the pixel itself: no rise towards it.
        let above = if row > 0 { &self.inverse_m[line - width..line] } else { here };
        let below = if row + 1 < self.height { &self.inverse_m[line + width..line + 2 * width] } else { here };
        let depth = &self.depth_m[line..line + width];
        let ray_y = self.rows[row];
        let grazing = Grazing {
            min_range_m: self.parameters.min_range_m,
            max_range_m: self.parameters.max_range_m,
            focal: self.focal,
            cos_limit_squared: self.cos_limit_squared,
        };
        let at = |column: usize, before: usize, after: usize| {
            let w = [here[column], here[before], here[after], above[column], below[column]];
            grazing.returns(depth[column], w, self.columns[column], ray_y)
        };
        if width < 2 {
            out.iter_mut().enumerate().for_each(|(column, out)| *out = at(column, column, column));
        } else {
            out[0] = at(0, 0, 1);
            let inner = out[1..width - 1].iter_mut().zip(&depth[1..]).zip(&self.columns[1..]);
            let neighbours = here.windows(3).zip(&above[1..]).zip(&below[1..]);
            for (((out, &z), &ray_x), ((w, &above), &below)) in inner.zip(neighbours) {
                *out = grazing.returns(z, [w[1], w[0], w[2], above, below], ray_x, ray_y);
            }
            out[width - 1] = at(width - 1, width - 2, width - 1);
        }
        // 2. What is read there, at the pixel or at a neighbour. The random bits fall evenly: comparing spares a branch.
        self.jitter(row, bits, places);
        for (out, &place) in out.iter_mut().zip(&*places) {
            let read = self.depth_m[place as usize];
            *out = if *out > 0.0 { read } else { 0.0 };
        }
        // 3. Its disparity, noisy and in steps.
        let p = self.parameters;
        let (disparity, sigma, farthest_m) = (p.disparity_of_1_m, p.disparity_sigma, p.max_range_m);
        for (noise, &bits) in noise.iter_mut().zip(bits) {
            *noise = self.normal.get(bits);
        }
        for (out, &noise) in out.iter_mut().zip(&*noise) {
            *out = quantise(*out, noise, disparity, sigma, farthest_m);
        }
    }

    /// The pixel at which the depth of each pixel of a row is read: most often itself, else one of its neighbours.
    #[inline(always)]
    fn jitter(&self, row: usize, bits: &[u32], places: &mut [u32]) {
        let (share, width) = (self.jitter_share, self.width as i32);
        let direction = |bits: u32| i32::from(bits < share) - i32::from(bits >= 4096 - share);
        let (line, last) = ((row * self.width) as i32, width - 1);
        // At the border of the image there is no neighbour on one side.
        let (up, down) = (-i32::from(row > 0), i32::from(row + 1 < self.height));
        for (column, (place, &bits)) in places.iter_mut().zip(bits).enumerate() {
            // Both axes share 12 bits: the rows use the same bits in another order, for multiplying by an odd number
            // permutes them.
            let bits = bits >> 12;
            let (dx, dy) = (direction(bits & 4095), direction(bits.wrapping_mul(2_654_435_761) >> 20));
            let column = (column as i32 + dx).max(0).min(last);
            *place = (line + dy.max(up).min(down) * width + column) as u32;
        }
    }
}

/// What decides whether a surface returns light; copied, so that the loop over a row keeps it in registers.
#[derive(Clone, Copy)]
struct Grazing {
    min_range_m: f32,
    max_range_m: f32,
    focal: [f32; 2],
    cos_limit_squared: f32,
}

impl Grazing {
    /// 1 where the surface is within range and not too steep against the ray, else 0. The inverse depths are those of the
    /// pixel and of its neighbours left, right, above and below.
    #[inline(always)]
    fn returns(&self, z: f32, [w, left, right, above, below]: [f32; 5], ray_x: f32, ray_y: f32) -> f32 {
        let (rise_x, rise_y) = (steepest(w, left, right), steepest(w, above, below));
        // On a plane the inverse depth is w = a + b X + c Y with the ray (X, Y, 1); (b, c, a) is along its normal.
        let (b, c) = (rise_x * self.focal[0], rise_y * self.focal[1]);
        let a = w - b * ray_x - c * ray_y;
        let ray = ray_x * ray_x + ray_y * ray_y + 1.0;
        let flat = w * w > self.cos_limit_squared * (a * a + b * b + c * c) * ray;
        let flat = if flat { 1.0 } else { 0.0 };
        let flat = if z >= self.min_range_m { flat } else { 0.0 };
        if z <= self.max_range_m { flat } else { 0.0 }
    }
}

/// The measured depth of a true one; 0 stays 0.
#[inline(always)]
fn quantise(z: f32, noise: f32, disparity_of_1_m: f32, sigma: f32, max_range_m: f32) -> f32 {
    // Without a return z is 0 and the quotient infinite: the last lines drop it.
    let steps = ((disparity_of_1_m / z + sigma * noise) * 8.0 + 0.5).floor();
    let measured = disparity_of_1_m * 8.0 / steps;
    let measured = if measured <= max_range_m { measured } else { 0.0 };
    let measured = if steps >= 1.0 { measured } else { 0.0 };
    whole_millimetres(if z > 0.0 { measured } else { 0.0 })
}

/// Depth as a camera hands it out: 16 bits of whole millimetres, no return beyond 65.535 m. What is recorded in as many bits
/// is then what the robot saw.
#[inline(always)]
pub(super) fn whole_millimetres(depth_m: f32) -> f32 {
    let mm = (depth_m * 1000.0 + 0.5).floor();
    let mm = if mm <= 65_535.0 { mm } else { 0.0 };
    mm / 1000.0
}

/// The rise of the inverse depth per pixel towards the neighbour that differs more.
#[inline(always)]
fn steepest(here: f32, before: f32, after: f32) -> f32 {
    let (before, after) = (here - before, after - here);
    if before.abs() > after.abs() { before } else { after }
}
