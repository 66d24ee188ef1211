//! The embedded visual encoder: a colour histogram and a coarse shape.

use super::{ColorTable, ObjectView, VisualEncoder, normalize};

const HUES: usize = 12;
const GRAYS: usize = 5;
const SHAPES: usize = 3;
/// Chroma above which a pixel counts with its hue rather than with its lightness.
const COLORFUL: f32 = 12.0;
/// Weight of the shape beside the colour in the squared feature.
const SHAPE_SHARE: f32 = 0.25;

/// Soft histogram over hue (12) and lightness of what has no hue (5), square-rooted so that the cosine is the
/// Bhattacharyya coefficient, followed by the extents (3, normalized). Lightness of coloured pixels is left out: it
/// changes with exposure and shading.
#[derive(Clone, Debug, Default)]
pub struct ColorShapeEncoder {
    colors: ColorTable,
}

impl VisualEncoder for ColorShapeEncoder {
    fn encode(&self, view: &ObjectView) -> Vec<f32> {
        let mut bins = [0.0f32; HUES + GRAYS];
        for &pixel in view.pixels {
            let color = self.colors.find(view.frame.color[pixel as usize]);
            let chroma = color.a.hypot(color.b);
            // Soft borders: noise that moves a pixel over a border moves only a part of its weight.
            let colorful = ((chroma - 0.5 * COLORFUL) / COLORFUL).clamp(0.0, 1.0);
            let hue = (color.b.atan2(color.a) / std::f32::consts::TAU).rem_euclid(1.0) * HUES as f32;
            let (low, part) = (hue as usize % HUES, hue.fract());
            bins[low] += colorful * (1.0 - part);
            bins[(low + 1) % HUES] += colorful * part;
            let gray = (color.lightness / 100.0 * (GRAYS - 1) as f32).clamp(0.0, (GRAYS - 1) as f32);
            let (low, part) = ((gray as usize).min(GRAYS - 2), gray - (gray as usize).min(GRAYS - 2) as f32);
            bins[HUES + low] += (1.0 - colorful) * (1.0 - part);
            bins[HUES + low + 1] += (1.0 - colorful) * part;
        }
        let total: f32 = bins.iter().sum::<f32>().max(1e-6);
        let mut feature: Vec<f32> = bins.iter().map(|b| (b / total * (1.0 - SHAPE_SHARE)).sqrt()).collect();
        let mut sides =
            [view.extent_m.x.hypot(view.extent_m.y) as f32, view.extent_m.z as f32, view.extent_m.norm() as f32];
        sides[2] = sides[2].clamp(0.05, 3.0);
        let norm = sides.iter().map(|s| s * s).sum::<f32>().sqrt().max(1e-6);
        feature.extend(sides.iter().map(|s| s / norm * SHAPE_SHARE.sqrt()));
        debug_assert_eq!(feature.len(), HUES + GRAYS + SHAPES);
        normalize(feature)
    }
}
