//! Texture of a surface: how much its brightness varies over a few pixels beyond what noise and shading make.

use super::ObjectView;

/// Distances over which brightness is compared, pixels. The first is below what most textures show: it measures the noise.
/// Over longer ones small things bend.
const LAGS: [usize; 2] = [1, 2];
/// Difference of depth up to which two pixels show one surface, metres per metre of distance.
const SAME_SURFACE: f32 = 0.02;

/// Steps over two pixels, over those over one, from which a surface has grain, and from which two colours or mirrored lights
/// make it.
const GRAINED: f32 = 1.3;
const CONTRASTED: f32 = 1.8;
/// Second difference between neighbouring pixels that the noise of a cheap camera makes, in the middle, in steps of 255:
/// in the dark, and what each step of brightness adds.
const NOISE: (f32, f32) = (1.8, 0.01);
/// Steps between neighbours over those of the noise from which a surface is woven.
const WOVEN: f32 = 2.2;
/// Darker surfaces are not looked at for a weave.
const WOVEN_BRIGHTNESS: f32 = 25.0;

/// Brightness steps of a view, as shares of its brightness.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Texture {
    /// Median size of the second difference of brightness at each distance; noise alone gives the same at all of them. The
    /// larger of those along rows and columns.
    steps: [f32; LAGS.len()],
    /// Mean brightness, 0 to 255.
    brightness: f32,
}

impl Texture {
    /// Measures a view. Second differences leave out even shading, medians leave out edges.
    pub(super) fn measure(view: &ObjectView) -> Self {
        let (width, frame) = (view.frame.model.width as usize, view.frame);
        let luma = |pixel: usize| {
            let [r, g, b] = frame.color[pixel].map(f32::from);
            0.299 * r + 0.587 * g + 0.114 * b
        };
        let mean = view.pixels.iter().map(|p| luma(*p as usize)).sum::<f32>() / view.pixels.len().max(1) as f32;
        let mut values = Vec::with_capacity(view.pixels.len());
        let steps = LAGS.map(|lag| {
            let across = [lag, lag * width].map(|step| {
                values.clear();
                for &pixel in view.pixels {
                    let pixel = pixel as usize;
                    let (Some(before), after) = (pixel.checked_sub(step), pixel + step) else { continue };
                    let inside = step >= width || (before / width == pixel / width && after / width == pixel / width);
                    if !inside || after >= frame.depth_m.len() {
                        continue;
                    }
                    let depth = frame.depth_m[pixel];
                    let same = |other: usize| (frame.depth_m[other] - depth).abs() < SAME_SURFACE * (depth + 1.0);
                    if same(before) && same(after) {
                        values.push((luma(before) + luma(after) - 2.0 * luma(pixel)).abs());
                    }
                }
                let middle = values.len() / 2;
                if middle < 8 { 0.0 } else { *values.select_nth_unstable_by(middle, f32::total_cmp).1 }
            });
            across[0].max(across[1]) / mean.max(8.0)
        });
        Self { steps, brightness: mean }
    }

    /// Whether brightness varies over two pixels more than noise does: fine lines, as of wood.
    pub(super) fn is_grained(&self) -> bool {
        self.steps[1] > GRAINED * self.steps[0] && !self.is_contrasted()
    }

    /// Whether it varies much more: a print, or lights that a polished surface mirrors.
    pub(super) fn is_contrasted(&self) -> bool {
        self.steps[1] > CONTRASTED * self.steps[0]
    }

    /// Whether neighbouring pixels differ as those of a weave.
    pub(super) fn is_woven(&self) -> bool {
        self.steps[0] * self.brightness > WOVEN * (NOISE.0 + NOISE.1 * self.brightness)
            && self.brightness > WOVEN_BRIGHTNESS
    }
}

#[cfg(test)]
mod tests {
    //! Contract: noise and shading are no texture, fine lines are grain, and steps between all neighbours are a weave.
    use super::*;
    use crate::camera::CameraModel;
    use crate::frame::{FrameId, RgbdFrame};
    use crate::time::Stamp;
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn measure(brightness: impl Fn(f32, f32) -> f32) -> Texture {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut noise = || (0..12).map(|_| random.random::<f32>() - 0.5).sum::<f32>() * 2.5;
        let color = (0..64 * 48).map(|i| {
            let value = brightness((i % 64) as f32, (i / 64) as f32);
            [value + noise(), value + noise(), value + noise()].map(|c| c.clamp(0.0, 255.0) as u8)
        });
        let frame = RgbdFrame {
            id: FrameId(0),
            stamp: Stamp::default(),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(64, 48, 0.9),
            world_from_camera: crate::Pose::identity(),
            color: color.collect(),
            depth_m: vec![1.5; 64 * 48],
        };
        let pixels: Vec<u32> = (0..64 * 48).collect();
        Texture::measure(&ObjectView { frame: &frame, pixels: &pixels, name: "x", extent_m: Vector3::repeat(0.5) })
    }

    #[test]
    fn noise_grain_and_weave_are_told_apart() {
        let plain = measure(|x, _| 100.0 + x);
        assert!(!plain.is_grained() && !plain.is_contrasted() && !plain.is_woven(), "{plain:?}");
        let wood = measure(|_, y| 100.0 * (0.93 + 0.025 * (0.8 * y).sin()));
        assert!(wood.is_grained() && !wood.is_woven(), "{wood:?}");
        let stripes = measure(|_, y| if (y / 6.0) as i32 % 2 == 0 { 60.0 } else { 200.0 });
        assert!(stripes.is_contrasted() && !stripes.is_grained(), "{stripes:?}");
        let weave = measure(|x, y| if (x as i32 / 2 + y as i32 / 2) % 2 == 0 { 100.0 } else { 75.0 });
        assert!(weave.is_woven(), "{weave:?}");
    }
}
