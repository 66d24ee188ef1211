//! White, gray or black: how much of the light that falls on a surface it gives back.
//!
//! The same gray looks white in the sun and black in the shade, so a surface is compared with the lightest ones around that
//! face the same way: a table with other level surfaces, a cupboard with the walls beside it. Indoors something white or
//! nearly white is almost always in view.

use super::{ColorTable, ObjectView};
use nalgebra::Vector3;

/// Pixels of a frame that are looked at, about.
const REFERENCE_PIXELS: usize = 1500;
/// Distance of the pixels between which the slope of a surface is measured.
const SLOPE_PX: usize = 6;
/// Level surfaces, and sectors of directions in which upright ones face.
const FACINGS: usize = 1 + SECTORS;
const SECTORS: usize = 6;
/// Vertical part of the normal from which a surface is level.
const LEVEL: f64 = 0.75;
/// Share of the pixels that are darker than what counts as the lightest.
const LIGHTEST_SHARE: f32 = 0.9;
/// The same over all facings together, and the share of its light that every facing gets at least.
const BRIGHT_SHARE: f32 = 0.95;
const LEAST_LIGHT: f32 = 0.5;
/// Pixels that a facing needs.
const LEAST_PIXELS: usize = 12;
/// Light given back, over that of the lightest, from which a surface is white.
const WHITE: f32 = 0.6;

/// Light given back by the lightest surfaces of a frame that face each way.
#[derive(Clone, Debug)]
pub(super) struct Light {
    of_facing: [f32; FACINGS],
    /// For surfaces whose facing is not known.
    anywhere: f32,
}

/// Linear luminance, 0 to 1, of a CIELAB lightness.
fn luminance(lightness: f32) -> f32 {
    let f = (lightness + 16.0) / 116.0;
    if lightness > 8.0 { f * f * f } else { lightness / 903.3 }
}

/// Which way the surface at a pixel faces.
fn find_facing(view: &ObjectView, pixel: usize) -> Option<usize> {
    let (frame, width) = (view.frame, view.frame.model.width as usize);
    let at = |pixel: usize| frame.find_point_in_camera(pixel);
    let (left, up) = (pixel.checked_sub(SLOPE_PX)?, pixel.checked_sub(SLOPE_PX * width)?);
    let (right, down) = (at(pixel + SLOPE_PX)?, at(pixel + SLOPE_PX * width)?);
    let (across, along): (Vector3<f64>, Vector3<f64>) = (right - at(left)?, down - at(up)?);
    // An edge lies between.
    if across.z.abs().max(along.z.abs()) > 0.3 {
        return None;
    }
    let normal = frame.world_from_camera.rotation * along.cross(&across).try_normalize(1e-9)?;
    if normal.z.abs() > LEVEL {
        return Some(0);
    }
    let turn = normal.y.atan2(normal.x) / std::f64::consts::TAU + 0.5;
    Some(1 + ((turn * SECTORS as f64) as usize).min(SECTORS - 1))
}

fn find_quantile(values: &mut [f32], share: f32) -> f32 {
    let index = (share * values.len() as f32) as usize;
    if index < values.len() { *values.select_nth_unstable_by(index, f32::total_cmp).1 } else { 0.0 }
}

impl Light {
    /// Measures the frame of a view, without the thing itself.
    pub(super) fn measure(view: &ObjectView, colors: &ColorTable) -> Self {
        let step = view.frame.color.len().div_ceil(REFERENCE_PIXELS).max(1);
        let (first, last) = (view.pixels.first().copied(), view.pixels.last().copied());
        let mut by_facing: [Vec<f32>; FACINGS] = Default::default();
        let mut all = Vec::with_capacity(REFERENCE_PIXELS);
        for pixel in (0..view.frame.color.len()).step_by(step) {
            // The thing's own rows and pixels: what lies close to a pixel of it is it.
            let within = first.is_some_and(|f| pixel as u32 >= f) && last.is_some_and(|l| pixel as u32 <= l);
            let own = within && {
                let next = view.pixels.partition_point(|p| (*p as usize) < pixel);
                [next.checked_sub(1), Some(next)]
                    .into_iter()
                    .flatten()
                    .any(|i| view.pixels.get(i).is_some_and(|p| (*p as usize).abs_diff(pixel) <= 8))
            };
            let light = luminance(colors.find(view.frame.color[pixel]).lightness);
            all.push(light);
            if !own && let Some(facing) = find_facing(view, pixel) {
                by_facing[facing].push(light);
            }
        }
        let anywhere = find_quantile(&mut all, BRIGHT_SHARE);
        let of_facing = by_facing.map(|mut values| {
            let own = if values.len() < LEAST_PIXELS { 0.0 } else { find_quantile(&mut values, LIGHTEST_SHARE) };
            own.max(LEAST_LIGHT * anywhere)
        });
        Self { of_facing, anywhere }
    }

    /// Whether a surface without hue is white rather than gray: what its pixels give back, in the middle, beside the
    /// lightest.
    pub(super) fn is_white(&self, view: &ObjectView, colors: &ColorTable, pixels: &[u32]) -> bool {
        let share = |pixel: &u32| {
            let pixel = *pixel as usize;
            let light = find_facing(view, pixel).map_or(self.anywhere, |facing| self.of_facing[facing]);
            luminance(colors.find(view.frame.color[pixel]).lightness) / light.max(1e-3)
        };
        let mut shares: Vec<f32> = pixels.iter().map(share).collect();
        find_quantile(&mut shares, 0.6) > WHITE
    }
}
