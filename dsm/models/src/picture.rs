//! Pictures for a model: made smaller, as PNG, named by what they show.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsm::frame::RgbdFrame;
use dsm::raster::Image;
use std::sync::Arc;

/// An image in colour, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// sRGB, `width * height`.
    pub color: Vec<[u8; 3]>,
    /// Pixels of the source along each side of one pixel here.
    pub step: u32,
}

/// A picture as it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    data_url: Arc<str>,
}

impl Canvas {
    /// A frame whose longer side is at most `longest_px`: every n-th pixel, so that marks hit what they mean.
    pub fn of_frame(frame: &RgbdFrame, longest_px: u32) -> Self {
        Self::of_pixels(&frame.color, frame.model.width, frame.model.height, longest_px)
    }

    /// A rendered view as it is.
    pub fn of_view(view: &Image) -> Self {
        Self::of_pixels(&view.color, view.width, view.height, u32::MAX)
    }

    fn of_pixels(color: &[[u8; 3]], width: u32, height: u32, longest_px: u32) -> Self {
        let step = width.max(height).div_ceil(longest_px.max(1)).max(1);
        let (small_width, small_height) = (width / step, height / step);
        let pixel = |row: u32, column: u32| {
            let index = row as usize * step as usize * width as usize + column as usize * step as usize;
            color.get(index).copied().unwrap_or([0; 3])
        };
        let rows = (0..small_height).flat_map(|row| (0..small_width).map(move |column| (row, column)));
        let color = rows.map(|(row, column)| pixel(row, column)).collect();
        Self { width: small_width, height: small_height, color, step }
    }

    /// Sets a pixel; outside of the picture nothing happens.
    pub(crate) fn set(&mut self, column: i64, row: i64, color: [u8; 3]) {
        if (0..i64::from(self.width)).contains(&column) && (0..i64::from(self.height)).contains(&row) {
            self.color[row as usize * self.width as usize + column as usize] = color;
        }
    }

    /// As PNG; `None` when there is no pixel.
    pub fn encode(&self) -> Option<Picture> {
        if self.color.is_empty() {
            return None;
        }
        let mut bytes = Vec::new();
        let mut png = png::Encoder::new(&mut bytes, self.width, self.height);
        png.set_color(png::ColorType::Rgb);
        png.set_compression(png::Compression::Fast);
        let data: Vec<u8> = self.color.iter().flatten().copied().collect();
        png.write_header().and_then(|mut writer| writer.write_image_data(&data)).ok()?;
        Some(Picture { data_url: format!("data:image/png;base64,{}", STANDARD.encode(&bytes)).into() })
    }
}

impl Picture {
    /// The picture as an address that holds it.
    pub fn data_url(&self) -> &str {
        &self.data_url
    }
}
