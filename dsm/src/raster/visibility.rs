//! Second stage: the nearest surface of each pixel.

use super::setup::{Disc, Prepared, Triangle, pixel_from};

/// What a pixel of the visibility buffer holds when nothing covers it.
pub(super) const NOTHING: u32 = u32::MAX;

/// A band of rows of the visibility buffer.
pub(super) struct Band<'a> {
    pub width: u32,
    pub first_row: u32,
    pub end_row: u32,
    /// 1/m; starts at the far plane.
    pub inverse_z: &'a mut [f32],
    /// Number of the triangle or disc, or [`NOTHING`].
    pub numbers: &'a mut [u32],
}

impl Band<'_> {
    /// Draws everything that touches the band. Only what is truly nearer replaces what came before.
    #[inline(always)]
    pub(super) fn fill(&mut self, prepared: &Prepared, touching: &[u32], far_m: f32) {
        self.inverse_z.fill(1.0 / far_m);
        self.numbers.fill(NOTHING);
        for &number in touching {
            match prepared.triangles.get(number as usize) {
                Some(triangle) => self.fill_triangle(triangle, number),
                None => self.fill_disc(&prepared.discs[number as usize - prepared.triangles.len()], number),
            }
        }
    }

    #[inline(always)]
    fn fill_triangle(&mut self, triangle: &Triangle, number: u32) {
        let [top, middle, bottom] = triangle.corners;
        let long = Edge::new(top, bottom);
        let split = pixel_from(middle[1], self.end_row);
        let first = triangle.first_row.max(self.first_row);
        let end = triangle.end_row.min(self.end_row);
        let halves = [(first, end.min(split), top, middle), (first.max(split), end, middle, bottom)];
        for (from_row, to_row, start, stop) in halves {
            if from_row >= to_row {
                continue;
            }
            let short = Edge::new(start, stop);
            let (left, right) = if triangle.middle_is_left { (&short, &long) } else { (&long, &short) };
            for row in from_row..to_row {
                let height = f64::from(row) + 0.5;
                self.fill_span(triangle, number, row, left.at(height), right.at(height));
            }
        }
    }

    #[inline(always)]
    fn fill_span(&mut self, triangle: &Triangle, number: u32, row: u32, left: f32, right: f32) {
        let (from, to) = (pixel_from(left, self.width), pixel_from(right, self.width));
        if from >= to {
            return;
        }
        let line = (row - self.first_row) as usize * self.width as usize;
        let span = line + from as usize..line + to as usize;
        let plane = &triangle.inverse_z;
        let start = plane.at((from as i32 - triangle.origin[0]) as f32, (row as i32 - triangle.origin[1]) as f32);
        let (min, max, step) = (triangle.inverse_z_min, triangle.inverse_z_max, plane.per_column);
        let pixels = self.inverse_z[span.clone()].iter_mut().zip(&mut self.numbers[span]);
        // The count is a whole number: one kept as a float would tie each pixel to the one before.
        for (column, (nearest, seen)) in pixels.enumerate() {
            let column = column as i32 as f32;
            // Slivers have steep planes: rounding must not push them out of their own range.
            let value = start + column * step;
            let value = if value < min { min } else { value };
            let value = if value > max { max } else { value };
            let nearer = value > *nearest;
            *nearest = if nearer { value } else { *nearest };
            *seen = if nearer { number } else { *seen };
        }
    }

    #[inline(always)]
    fn fill_disc(&mut self, disc: &Disc, number: u32) {
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
                    self.numbers[pixel] = number;
                }
            }
        }
    }
}

/// An edge that runs down the image. Both triangles at it compute the same columns from the same two corners.
struct Edge {
    x: f64,
    y: f64,
    slope: f64,
}

impl Edge {
    #[inline(always)]
    fn new(from: [f32; 2], to: [f32; 2]) -> Self {
        let (x, y) = (f64::from(from[0]), f64::from(from[1]));
        // A level edge crosses no row, so its slope is never used.
        Self { x, y, slope: (f64::from(to[0]) - x) / (f64::from(to[1]) - y) }
    }

    #[inline(always)]
    fn at(&self, height: f64) -> f32 {
        (self.x + (height - self.y) * self.slope) as f32
    }
}
