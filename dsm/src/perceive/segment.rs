//! The embedded segmenter: things in one RGB-D image without labels, names or learned weights.
//!
//! ```text
//! depth, colour ──halve, smooth──▶ surface (points, normals, Lab) ──graph──▶ patches ──join──▶ things ──drop supports──▶ masks
//! ```
//!
//! Patches are what edges enclose: steps of depth, creases, steps of colour (graph-based segmentation after Felzenszwalb
//! and Huttenlocher 2004). Patches are joined when their border is no end of a thing: it goes on at the same depth, and
//! bends outwards or looks the same on both sides; things meet each other and what carries them in hollows (local
//! convexity after Stein et al. 2014). Floor, ceiling and walls are left out. All is a function of the image and of the camera's pose.

mod join;
mod patches;
mod structure;
mod surface;

use super::{Detection, Detections, Detector, Mask};
use crate::frame::RgbdFrame;
use join::Joined;
use surface::Surface;

/// Name of a thing of which nothing is known but that it is there.
pub const UNNAMED: &str = "object";

/// Fewest pixels of a thing in the whole image, of 640x480.
const LEAST_PX: usize = 150;
/// Greatest share of the image that a thing fills.
const MOST_SHARE: f64 = 0.6;
/// Score of a whole thing, and of one that the image's border cuts.
const SCORES: [f32; 2] = [0.8, 0.6];
/// Columns below which an image is not halved.
const HALVED_FROM: u32 = 400;

/// Finds things in pixels alone. The same image and pose give the same masks.
#[derive(Clone, Debug, Default)]
pub struct PixelSegmenter;

impl Detector for PixelSegmenter {
    fn name(&self) -> &str {
        "pixels"
    }

    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        let count = frame.model.pixel_count();
        let whole = frame.color.len() == count && frame.depth_m.len() == count && count > 0;
        Detections { frame: frame.id, items: if whole { find_things(frame) } else { Vec::new() } }
    }
}

fn find_things(frame: &RgbdFrame) -> Vec<Detection> {
    let step = if frame.model.width >= HALVED_FROM { 2 } else { 1 };
    let surface = Surface::new(frame, step);
    if surface.columns < 8 || surface.rows < 8 {
        return Vec::new();
    }
    let structure = structure::find_structure(&surface);
    let patches = patches::find_patches(&surface, &structure);
    let joined = join::join(&surface, &patches);
    masks(frame, &surface, &joined, step)
}

/// The masks in the whole image, in the order of their first pixels.
fn masks(frame: &RgbdFrame, surface: &Surface, joined: &Joined, step: usize) -> Vec<Detection> {
    let (width, height) = (frame.model.width as usize, frame.model.height as usize);
    let least = LEAST_PX * width * height / (640 * 480);
    let mut pixels: Vec<Vec<u32>> = vec![Vec::new(); joined.count];
    for row in 0..height {
        let line = (row / step).min(surface.rows - 1) * surface.columns;
        for column in 0..width {
            let thing = joined.thing_of[line + (column / step).min(surface.columns - 1)];
            if thing != join::NOTHING {
                pixels[thing as usize].push((row * width + column) as u32);
            }
        }
    }
    let most = (MOST_SHARE * (width * height) as f64) as usize;
    let kept = pixels.into_iter().filter(|pixels| (least..most).contains(&pixels.len()));
    let mut items: Vec<Detection> = kept
        .map(|pixels| {
            let at_border = |pixel: &u32| {
                let (column, row) = (*pixel as usize % width, *pixel as usize / width);
                column < step || row < step || column + step >= width || row + step >= height
            };
            let cut = pixels.iter().any(at_border);
            let mask = Mask::from_sorted_pixels(width as u32, pixels);
            Detection { mask, name: UNNAMED.to_owned(), score: SCORES[usize::from(cut)] }
        })
        .collect();
    items.sort_by_key(|item| item.mask.runs.first().map(|run| run.start));
    items
}
