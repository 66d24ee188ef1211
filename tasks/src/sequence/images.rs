//! Images of a sequence, PNG or JPEG.

use crate::error::TaskError;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// A side longer than this is no camera image.
const LONGEST_PX: u32 = 8192;

/// Rows of pixels.
pub(super) struct Pixels<T> {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) values: Vec<T>,
}

fn wrong(path: &Path, why: impl std::fmt::Display) -> TaskError {
    TaskError::Usage(format!("{}: {why}", path.display()))
}

/// A colour image; grey ones get three equal channels, transparency is dropped.
pub(super) fn read_color(path: &Path) -> Result<Pixels<[u8; 3]>, TaskError> {
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("jpg" | "jpeg" | "JPG" | "JPEG") => read_jpeg(path),
        _ => read_png(path, false).map(|(width, height, channels, bytes)| {
            let pixel = |p: &[u8]| if channels >= 3 { [p[0], p[1], p[2]] } else { [p[0]; 3] };
            Pixels { width, height, values: bytes.chunks_exact(channels).map(pixel).collect() }
        }),
    }
}

fn read_jpeg(path: &Path) -> Result<Pixels<[u8; 3]>, TaskError> {
    let bytes = std::fs::read(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::RGB)
        .set_max_width(LONGEST_PX as usize)
        .set_max_height(LONGEST_PX as usize);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&bytes), options);
    let pixels = decoder.decode().map_err(|error| wrong(path, error))?;
    let (width, height) = decoder.dimensions().ok_or_else(|| wrong(path, "it has no size"))?;
    let values = pixels.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    Ok(Pixels { width: width as u32, height: height as u32, values })
}

/// A 16-bit grey image.
pub(super) fn read_depth(path: &Path) -> Result<Pixels<u16>, TaskError> {
    let (width, height, channels, bytes) = read_png(path, true)?;
    if channels != 1 {
        return Err(wrong(path, "a depth image has one channel of 16 bits"));
    }
    let values = bytes.chunks_exact(2).map(|p| u16::from_be_bytes([p[0], p[1]])).collect();
    Ok(Pixels { width, height, values })
}

/// Width, height, channels and bytes.
fn read_png(path: &Path, deep: bool) -> Result<(u32, u32, usize, Vec<u8>), TaskError> {
    let file = File::open(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    if !deep {
        decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    }
    let mut reader = decoder.read_info().map_err(|error| wrong(path, error))?;
    let (width, height) = reader.info().size();
    if width > LONGEST_PX || height > LONGEST_PX {
        return Err(wrong(path, format!("{width} x {height} pixels, expected at most {LONGEST_PX} a side")));
    }
    let (color, depth) = reader.output_color_type();
    if (depth == png::BitDepth::Sixteen) != deep {
        return Err(wrong(path, if deep { "a depth image has 16 bits" } else { "a colour image has 8 bits" }));
    }
    let size = reader.output_buffer_size().ok_or_else(|| wrong(path, "it is too large"))?;
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(|error| wrong(path, error))?;
    bytes.truncate(info.buffer_size());
    Ok((width, height, color.samples(), bytes))
}
