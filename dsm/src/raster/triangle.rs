//! A triangle in the image: where it lies, and its functions that are linear over the image.

/// A function that is linear over the image: value at the triangle's origin pixel and slopes per pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Plane {
    pub at_origin: f32,
    pub per_column: f32,
    pub per_row: f32,
}

impl Plane {
    #[inline(always)]
    pub(super) fn at(&self, column: f32, row: f32) -> f32 {
        self.at_origin + column * self.per_column + row * self.per_row
    }
}

/// A corner in the image.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Corner {
    /// Pixels; meaningful only in front of the near plane.
    pub x: f32,
    pub y: f32,
    /// What decides which surface is seen, the largest one: the inverse depth in 1/m.
    pub nearness: f32,
}

/// Which side of a triangle is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Culling {
    /// None.
    Nothing,
    /// The side that looks inward.
    Back,
    /// The side that looks outward.
    Front,
}

/// A triangle ready to be filled. The planes count columns and rows from the origin pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Corners in pixels from the topmost to the lowest.
    pub corners: [[f32; 2]; 3],
    /// Whether the middle corner lies left of the edge from the topmost to the lowest.
    pub middle_is_left: bool,
    /// Whether the side that looks inward is seen.
    pub back: bool,
    pub origin: [i32; 2],
    pub first_row: u32,
    pub end_row: u32,
    pub nearness: Plane,
    pub nearness_min: f32,
    pub nearness_max: f32,
}

/// How the corners of a triangle share its pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    /// Barycentric coordinates of the second and third corner, divided by z.
    pub second: Plane,
    pub third: Plane,
    /// Inverse area in the image, 1 / (2 pixels squared).
    pub inverse_area: f32,
}

/// The outline of a triangle that covers pixels, before its planes are known.
pub(super) struct Outline<'a> {
    corners: [&'a Corner; 3],
    first_row: u32,
    end_row: u32,
    first_column: u32,
    /// Second and third corner seen from the first, in pixels. In f64: a triangle cut at the near plane may reach far
    /// outside the image.
    second: [f64; 2],
    third: [f64; 2],
    area: f64,
}

impl<'a> Outline<'a> {
    /// `None` when the triangle covers no pixel of an image of `width` x `height` or shows a side that is left out.
    #[inline]
    pub(super) fn find(corners: [&'a Corner; 3], [width, height]: [u32; 2], culling: Culling) -> Option<Self> {
        let [a, b, c] = corners;
        let (ax, ay) = (f64::from(a.x), f64::from(a.y));
        let (bx, by) = (f64::from(b.x) - ax, f64::from(b.y) - ay);
        let (cx, cy) = (f64::from(c.x) - ax, f64::from(c.y) - ay);
        let area = bx * cy - cx * by;
        // Rows run down, so a counter-clockwise triangle has a negative area.
        let left_out = match culling {
            Culling::Nothing => area == 0.0,
            Culling::Back => area >= 0.0,
            Culling::Front => area <= 0.0,
        };
        if left_out {
            return None;
        }
        let first_row = pixel_from(min3(a.y, b.y, c.y), height);
        let end_row = pixel_from(max3(a.y, b.y, c.y), height);
        let first_column = pixel_from(min3(a.x, b.x, c.x), width);
        let end_column = pixel_from(max3(a.x, b.x, c.x), width);
        // The comparison also drops what is not a number.
        let covers = first_row < end_row && first_column < end_column && area.is_finite();
        covers.then_some(Self { corners, first_row, end_row, first_column, second: [bx, by], third: [cx, cy], area })
    }

    /// The function with these values at the corners.
    #[inline]
    fn plane(&self, at_a: f32, at_b: f32, at_c: f32) -> Plane {
        let [bx, by] = self.second;
        let [cx, cy] = self.third;
        let a = self.corners[0];
        let inverse_area = 1.0 / self.area;
        let dx = f64::from(self.first_column) + 0.5 - f64::from(a.x);
        let dy = f64::from(self.first_row) + 0.5 - f64::from(a.y);
        let (rise_b, rise_c) = (f64::from(at_b) - f64::from(at_a), f64::from(at_c) - f64::from(at_a));
        let per_column = (rise_b * cy - rise_c * by) * inverse_area;
        let per_row = (rise_c * bx - rise_b * cx) * inverse_area;
        let at_origin = f64::from(at_a) + per_column * dx + per_row * dy;
        Plane { at_origin: at_origin as f32, per_column: per_column as f32, per_row: per_row as f32 }
    }

    /// The triangle, ready to be filled.
    #[inline]
    pub(super) fn triangle(&self) -> Triangle {
        let [a, b, c] = self.corners;
        let [top, middle, bottom] = sorted_by_row([[a.x, a.y], [b.x, b.y], [c.x, c.y]]);
        let along = f64::from(middle[1] - top[1]) * f64::from(bottom[0] - top[0]);
        let across = f64::from(middle[0] - top[0]) * f64::from(bottom[1] - top[1]);
        Triangle {
            corners: [top, middle, bottom],
            middle_is_left: across < along,
            back: self.area > 0.0,
            origin: [self.first_column as i32, self.first_row as i32],
            first_row: self.first_row,
            end_row: self.end_row,
            nearness: self.plane(a.nearness, b.nearness, c.nearness),
            nearness_min: min3(a.nearness, b.nearness, c.nearness),
            nearness_max: max3(a.nearness, b.nearness, c.nearness),
        }
    }

    /// How the corners share the pixels.
    #[inline]
    pub(super) fn shares(&self) -> Shares {
        let [_, b, c] = self.corners;
        Shares {
            second: self.plane(0.0, b.nearness, 0.0),
            third: self.plane(0.0, 0.0, c.nearness),
            inverse_area: (1.0 / self.area) as f32,
        }
    }
}

impl Triangle {
    /// Calls `fill(row, first, end)` for each row from `first_row` to before `end_row` with the columns, within `width`,
    /// whose centres lie in the triangle.
    ///
    /// Neighbouring triangles share an edge exactly: no pixel between them is lost or drawn twice.
    #[inline(always)]
    pub(super) fn for_spans(&self, first_row: u32, end_row: u32, width: u32, mut fill: impl FnMut(u32, u32, u32)) {
        let [top, middle, bottom] = self.corners;
        let long = Edge::new(top, bottom);
        let split = pixel_from(middle[1], end_row);
        let first = self.first_row.max(first_row);
        let end = self.end_row.min(end_row);
        let halves = [(first, end.min(split), top, middle), (first.max(split), end, middle, bottom)];
        for (from_row, to_row, start, stop) in halves {
            if from_row >= to_row {
                continue;
            }
            let short = Edge::new(start, stop);
            let (left, right) = if self.middle_is_left { (&short, &long) } else { (&long, &short) };
            for row in from_row..to_row {
                let height = f64::from(row) + 0.5;
                let (from, to) = (pixel_from(left.at(height), width), pixel_from(right.at(height), width));
                if from < to {
                    fill(row, from, to);
                }
            }
        }
    }

    /// Nearness at a column and row, and its slope per column.
    #[inline(always)]
    pub(super) fn nearness_from(&self, column: u32, row: u32) -> (f32, f32) {
        let (column, row) = ((column as i32 - self.origin[0]) as f32, (row as i32 - self.origin[1]) as f32);
        (self.nearness.at(column, row), self.nearness.per_column)
    }

    /// Slivers have steep planes: rounding must not push them out of their own range.
    #[inline(always)]
    pub(super) fn limit(&self, nearness: f32) -> f32 {
        let nearness = if nearness < self.nearness_min { self.nearness_min } else { nearness };
        if nearness > self.nearness_max { self.nearness_max } else { nearness }
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

/// The first pixel whose centre lies at or after the coordinate, within 0 to `limit`.
#[inline(always)]
pub(super) fn pixel_from(coordinate: f32, limit: u32) -> u32 {
    let start = (coordinate - 0.5).max(0.0).min(limit as f32);
    let whole = start as u32;
    whole + u32::from(start > whole as f32)
}

fn sorted_by_row([mut a, mut b, mut c]: [[f32; 2]; 3]) -> [[f32; 2]; 3] {
    if b[1] < a[1] {
        (a, b) = (b, a);
    }
    if c[1] < b[1] {
        (b, c) = (c, b);
        if b[1] < a[1] {
            (a, b) = (b, a);
        }
    }
    [a, b, c]
}

#[inline(always)]
fn min3(a: f32, b: f32, c: f32) -> f32 {
    let least = if b < a { b } else { a };
    if c < least { c } else { least }
}

#[inline(always)]
fn max3(a: f32, b: f32, c: f32) -> f32 {
    let most = if b > a { b } else { a };
    if c > most { c } else { most }
}
