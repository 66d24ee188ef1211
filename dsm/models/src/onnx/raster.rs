//! Pictures as networks were trained with them: resized by the same filters as Pillow, padded, centred, as planes.

use fast_image_resize::images::{Image, ImageRef};
use fast_image_resize::{FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer};

/// A picture in sRGB, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width * height` pixels.
    pub color: Vec<[u8; 3]>,
}

/// How a picture was put into a square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Letterbox {
    /// Pixels of the square per pixel of the picture.
    pub scale: f64,
    /// Columns of the square left of the picture.
    pub left: u32,
    /// Rows of the square above the picture.
    pub top: u32,
}

/// Filters by their names in Pillow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// A tent; what is made smaller is averaged.
    Bilinear,
    /// Catmull-Rom; what is made smaller is averaged.
    Bicubic,
}

/// Mean and deviation of red, green and blue, of values from 0 to 1.
pub(super) const IMAGENET: ([f32; 3], [f32; 3]) = ([0.485, 0.456, 0.406], [0.229, 0.224, 0.225]);
/// From -1 to 1.
pub(super) const HALF: ([f32; 3], [f32; 3]) = ([0.5; 3], [0.5; 3]);
/// From 0 to 1.
pub(super) const UNIT: ([f32; 3], [f32; 3]) = ([0.0; 3], [1.0; 3]);
/// Grey that squares are filled up with.
const PADDING: [u8; 3] = [114; 3];

/// The picture in another size. A picture without pixels becomes black.
pub fn resize(picture: &Rgb, width: u32, height: u32, filter: Filter) -> Rgb {
    // Across first, then down, as Pillow does: in between, what swings below 0 or above 255 is cut off.
    let across = resize_once(picture, width, picture.height, filter);
    resize_once(&across, width, height, filter)
}

fn resize_once(picture: &Rgb, width: u32, height: u32, filter: Filter) -> Rgb {
    let black = || Rgb { width, height, color: vec![[0; 3]; width as usize * height as usize] };
    if (picture.width, picture.height) == (width, height) {
        return picture.clone();
    }
    let filter = match filter {
        Filter::Bilinear => FilterType::Bilinear,
        Filter::Bicubic => FilterType::CatmullRom,
    };
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(filter)).use_alpha(false);
    let bytes = picture.color.as_flattened();
    let Ok(source) = ImageRef::new(picture.width, picture.height, bytes, PixelType::U8x3) else { return black() };
    let mut target = Image::new(width, height, PixelType::U8x3);
    if Resizer::new().resize(&source, &mut target, &options).is_err() {
        return black();
    }
    Rgb { width, height, color: target.buffer().chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect() }
}

/// One plane per colour, `3 * width * height` values, each less the mean and over the deviation.
pub fn planes(picture: &Rgb, (mean, deviation): ([f32; 3], [f32; 3])) -> Vec<f32> {
    let plane = |k: usize| picture.color.iter().map(move |p| (f32::from(p[k]) / 255.0 - mean[k]) / deviation[k]);
    (0..3).flat_map(plane).collect()
}

impl Letterbox {
    /// The picture as large as it fits into the middle of a grey square.
    pub fn of(picture: &Rgb, side: u32) -> (Self, Rgb) {
        let (width, height) = (f64::from(picture.width.max(1)), f64::from(picture.height.max(1)));
        let scale = (f64::from(side) / width).min(f64::from(side) / height);
        let fit = |length: f64| ((length * scale).round() as u32).clamp(1, side);
        let small = resize(picture, fit(width), fit(height), Filter::Bilinear);
        let (left, top) = ((side - small.width) / 2, (side - small.height) / 2);
        let mut color = vec![PADDING; side as usize * side as usize];
        for (row, line) in small.color.chunks_exact(small.width as usize).enumerate() {
            let start = (top as usize + row) * side as usize + left as usize;
            color[start..start + line.len()].copy_from_slice(line);
        }
        (Self { scale, left, top }, Rgb { width: side, height: side, color })
    }

    /// A box of the square (left, top, right, bottom) in the picture, cut off at its border.
    pub fn undo(&self, corners: [f32; 4], picture: (u32, u32)) -> [f32; 4] {
        let undo = |value: f32, offset: u32, most: u32| {
            ((f64::from(value) - f64::from(offset)) / self.scale).clamp(0.0, f64::from(most)) as f32
        };
        let [left, top, right, bottom] = corners;
        [
            undo(left, self.left, picture.0),
            undo(top, self.top, picture.1),
            undo(right, self.left, picture.0),
            undo(bottom, self.top, picture.1),
        ]
    }
}

/// The square around a box (first column, first row, last column, last row), longer than the box by `margin`; what lies
/// outside of the picture is grey.
pub fn square_view(color: &[[u8; 3]], (width, height): (u32, u32), bounds: (u32, u32, u32, u32), margin: f64) -> Rgb {
    let (c0, r0, c1, r1) = bounds;
    let longest = (c1 + 1).saturating_sub(c0).max((r1 + 1).saturating_sub(r0)).max(1);
    let side = ((f64::from(longest) * margin).ceil() as u32).max(1);
    let start = |first: u32, last: u32| (i64::from(first) + i64::from(last) + 1 - i64::from(side)).div_euclid(2);
    let (left, top) = (start(c0, c1), start(r0, r1));
    let pixel = |index: u32| {
        let (column, row) = (left + i64::from(index % side), top + i64::from(index / side));
        let inside = (0..i64::from(width)).contains(&column) && (0..i64::from(height)).contains(&row);
        let place = row * i64::from(width) + column;
        if inside { color.get(place as usize).copied().unwrap_or(PADDING) } else { PADDING }
    };
    Rgb { width: side, height: side, color: (0..side * side).map(pixel).collect() }
}
