//! Errors of masks: borders that are off, masks that fall in two.

use dsm::perceive::Mask;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// A cut-out of the image around one mask.
struct Patch {
    left: i32,
    top: i32,
    width: i32,
    height: i32,
    inside: Vec<bool>,
}

impl Patch {
    /// The mask's bounds grown by `margin`, clipped to the image.
    fn new(mask: &Mask, image_height: u32, margin: i32) -> Option<Self> {
        let (c0, r0, c1, r1) = mask.find_bounds()?;
        let left = (c0 as i32 - margin).max(0);
        let top = (r0 as i32 - margin).max(0);
        let right = (c1 as i32 + margin).min(mask.image_width as i32 - 1);
        let bottom = (r1 as i32 + margin).min(image_height as i32 - 1);
        let (width, height) = (right - left + 1, bottom - top + 1);
        let mut inside = vec![false; (width * height) as usize];
        for run in &mask.runs {
            let (column, row) = ((run.start % mask.image_width) as i32, (run.start / mask.image_width) as i32);
            let first = ((row - top) * width + column - left) as usize;
            inside[first..first + run.length as usize].fill(true);
        }
        Some(Self { left, top, width, height, inside })
    }

    fn get(&self, column: i32, row: i32) -> Option<bool> {
        let fits = (0..self.width).contains(&column) && (0..self.height).contains(&row);
        fits.then(|| self.inside[(row * self.width + column) as usize])
    }

    fn to_mask(&self, inside: &[bool], image_width: u32) -> Mask {
        let pixel =
            |index: i32| (self.top + index / self.width) as u32 * image_width + (self.left + index % self.width) as u32;
        let kept = (0..self.width * self.height).filter(|index| inside[*index as usize]);
        Mask::from_sorted_pixels(image_width, kept.map(pixel))
    }
}

/// Grows or shrinks a mask by 1 to `most_px` pixels, unevenly along its border. Small masks err by less.
pub(super) fn disturb_border(mask: &Mask, image_height: u32, most_px: i32, stream: &mut ChaCha8Rng) -> Mask {
    let size_px = (mask.area() as f64).sqrt();
    let most = most_px.min((size_px / 8.0) as i32).max(1);
    let grows: bool = stream.random();
    let mean = stream.random_range(1.0..=f64::from(most));
    let (waves, phase) = (f64::from(stream.random_range(1..=4)), stream.random_range(0.0..TAU));
    let Some(patch) = Patch::new(mask, image_height, most) else { return mask.clone() };
    let mut changed = patch.inside.clone();
    let middle = (f64::from(patch.width - 1) / 2.0, f64::from(patch.height - 1) / 2.0);
    for row in 0..patch.height {
        for column in 0..patch.width {
            let is_edge = patch.get(column, row) == Some(true)
                && [(1, 0), (-1, 0), (0, 1), (0, -1)].iter().any(|(dc, dr)| {
                    // The border of the image is no border of the thing.
                    patch.get(column + dc, row + dr) == Some(false)
                });
            if !is_edge {
                continue;
            }
            let angle = (f64::from(row) - middle.1).atan2(f64::from(column) - middle.0);
            let reach = (mean + 0.8 * (waves * angle + phase).sin()).round().clamp(1.0, f64::from(most)) as i32;
            // Shrinking by one takes the edge pixel itself, growing by one its outer neighbours.
            let radius = if grows { reach } else { reach - 1 };
            for dr in -radius..=radius {
                for dc in -radius..=radius {
                    let near = dr * dr + dc * dc <= radius * radius;
                    if near && patch.get(column + dc, row + dr).is_some_and(|inside| inside != grows) {
                        changed[((row + dr) * patch.width + column + dc) as usize] = grows;
                    }
                }
            }
        }
    }
    patch.to_mask(&changed, mask.image_width)
}

/// Cuts a mask across its longer axis into two that cover it.
pub(super) fn split(mask: &Mask, stream: &mut ChaCha8Rng) -> [Mask; 2] {
    let width = mask.image_width;
    let at = |pixel: usize| ((pixel as u32 % width) as f64, (pixel as u32 / width) as f64);
    let count = mask.area().max(1) as f64;
    let (sx, sy) = mask.pixels().map(at).fold((0.0, 0.0), |(sx, sy), (x, y)| (sx + x, sy + y));
    let (mx, my) = (sx / count, sy / count);
    let (xx, xy, yy) = mask.pixels().map(at).fold((0.0, 0.0, 0.0), |(xx, xy, yy), (x, y)| {
        let (dx, dy) = (x - mx, y - my);
        (xx + dx * dx, xy + dx * dy, yy + dy * dy)
    });
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    let (cos, sin) = (angle.cos(), angle.sin());
    let along = |pixel: usize| {
        let (x, y) = at(pixel);
        (x - mx) * cos + (y - my) * sin
    };
    let (low, high) =
        mask.pixels().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let cut = low + (high - low) * stream.random_range(0.3..0.7);
    let part = |first: bool| {
        Mask::from_sorted_pixels(width, mask.pixels().filter(|p| (along(*p) < cut) == first).map(|p| p as u32))
    };
    [part(true), part(false)]
}

/// All pixels of both masks.
pub(super) fn union(a: &Mask, b: &Mask) -> Mask {
    let mut pixels: Vec<u32> = a.pixels().chain(b.pixels()).map(|p| p as u32).collect();
    pixels.sort_unstable();
    pixels.dedup();
    Mask::from_sorted_pixels(a.image_width, pixels)
}

#[cfg(test)]
mod tests {
    //! Contract: borders move by 1 to 3 pixels in one direction, halves cover the whole.
    use super::*;
    use rand::SeedableRng;

    fn square(side: u32) -> Mask {
        let pixels = (20..20 + side).flat_map(|row| (30..30 + side).map(move |column| row * 100 + column));
        Mask::from_sorted_pixels(100, pixels)
    }

    #[test]
    fn a_border_moves_by_one_to_three_pixels() {
        let mask = square(40);
        for seed in 0..40 {
            let moved = disturb_border(&mask, 100, 3, &mut ChaCha8Rng::seed_from_u64(seed));
            let (c0, r0, c1, r1) = moved.find_bounds().expect("not empty");
            for shift in [30 - c0 as i32, 20 - r0 as i32, c1 as i32 - 69, r1 as i32 - 59] {
                assert!((1..=3).contains(&shift.abs()), "seed {seed}: {shift}");
            }
        }
    }

    #[test]
    fn halves_cover_the_mask_without_overlap() {
        let mask = union(&square(10), &square(30));
        assert_eq!(mask.area(), 900);
        let [a, b] = split(&mask, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!(union(&a, &b), mask);
        assert_eq!(a.area() + b.area(), mask.area());
        assert!(a.area() > 200 && b.area() > 200);
    }
}
