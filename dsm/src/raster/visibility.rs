//! Second stage: the nearest surface of each pixel.

use super::setup::{Disc, Prepared, Seen};
use super::triangle::{Triangle, pixel_from};

/// A band of rows of the visibility buffer.
pub(super) struct Band<'a> {
    /// Its number among all bands.
    pub number: usize,
    pub width: u32,
    pub first_row: u32,
    pub end_row: u32,
    /// 1/m; starts at the far plane.
    pub inverse_z: &'a mut [f32],
    /// What is seen.
    pub seen: &'a mut [Seen],
}

impl Band<'_> {
    /// Draws everything that touches the band. Only what is truly nearer replaces what came before.
    #[inline(always)]
    pub(super) fn fill(&mut self, prepared: &Prepared, far_m: f32) {
        self.inverse_z.fill(1.0 / far_m);
        self.seen.fill(Seen::NOTHING);
        for (number, part) in prepared.parts.iter().enumerate() {
            for &index in &part.bands[self.number] {
                self.fill_triangle(&part.triangles[index as usize], Seen::triangle(number, index as usize));
            }
        }
        for &index in &prepared.disc_bands[self.number] {
            self.fill_disc(&prepared.discs[index as usize], Seen::disc(index as usize));
        }
    }

    #[inline(always)]
    fn fill_triangle(&mut self, triangle: &Triangle, drawn: Seen) {
        let (first_row, width) = (self.first_row, self.width);
        triangle.for_spans(first_row, self.end_row, width, |row, from, to| {
            let line = (row - first_row) as usize * width as usize;
            let span = line + from as usize..line + to as usize;
            let (start, step) = triangle.nearness_from(from, row);
            let pixels = self.inverse_z[span.clone()].iter_mut().zip(&mut self.seen[span]);
            // The count is a whole number: one kept as a float would tie each pixel to the one before.
            for (column, (nearest, seen)) in pixels.enumerate() {
                let value = triangle.limit(start + column as i32 as f32 * step);
                let nearer = value > *nearest;
                *nearest = if nearer { value } else { *nearest };
                *seen = seen.replaced_if(nearer, drawn);
            }
        });
    }

    #[inline(always)]
    fn fill_disc(&mut self, disc: &Disc, drawn: Seen) {
        let first = pixel_from(disc.y - disc.radius, self.end_row).max(self.first_row);
        let end = pixel_from(disc.y + disc.radius, self.end_row);
        for row in first..end {
            let height = row as f32 + 0.5 - disc.y;
            let half = (disc.radius * disc.radius - height * height).max(0.0).sqrt();
            let (from, to) = (pixel_from(disc.x - half, self.width), pixel_from(disc.x + half, self.width));
            let line = (row - self.first_row) as usize * self.width as usize;
            for pixel in line + from as usize..line + to as usize {
                if disc.inverse_z > self.inverse_z[pixel] {
                    self.inverse_z[pixel] = disc.inverse_z;
                    self.seen[pixel] = drawn;
                }
            }
        }
    }
}
