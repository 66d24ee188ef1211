//! Images of a sequence, PNG or JPEG.

use crate::error::TaskError;
use std::fs::File;
#[cfg(any(test, feature = "mcap"))]
use std::io::Cursor;
use std::io::{BufRead, BufReader, Seek};
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

/// The colours of a PNG image of `size`, width and height; what is wrong with it otherwise.
#[cfg(any(test, feature = "mcap"))]
pub(crate) fn decode_color(png: &[u8], size: (u32, u32)) -> Result<Vec<[u8; 3]>, String> {
    let (width, height, channels, bytes) = decode_png(Cursor::new(png), false)?;
    if (width, height) != size || channels != 3 {
        return Err(format!("a colour image of {width} x {height} pixels with {channels} channels"));
    }
    Ok(bytes.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
}

/// The depths in metres of a PNG image of `size`, width and height, in whole millimetres; what is wrong with it otherwise.
#[cfg(any(test, feature = "mcap"))]
pub(crate) fn decode_depth(png: &[u8], size: (u32, u32)) -> Result<Vec<f32>, String> {
    let (width, height, channels, bytes) = decode_png(Cursor::new(png), true)?;
    if (width, height) != size || channels != 1 {
        return Err(format!("a depth image of {width} x {height} pixels with {channels} channels"));
    }
    let depth_m = |p: &[u8]| metres(u16::from_be_bytes([p[0], p[1]]), 1.0);
    Ok(bytes.chunks_exact(2).map(depth_m).collect())
}

/// Depth in metres of units so many millimetres long.
pub(super) fn metres(units: u16, unit_mm: f64) -> f32 {
    (f64::from(units) * unit_mm * 1e-3) as f32
}

/// Width, height, channels and bytes.
fn read_png(path: &Path, deep: bool) -> Result<(u32, u32, usize, Vec<u8>), TaskError> {
    let file = File::open(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
    decode_png(BufReader::new(file), deep).map_err(|why| wrong(path, why))
}

fn decode_png(file: impl BufRead + Seek, deep: bool) -> Result<(u32, u32, usize, Vec<u8>), String> {
    let mut decoder = png::Decoder::new(file);
    if !deep {
        decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    }
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let (width, height) = reader.info().size();
    if width > LONGEST_PX || height > LONGEST_PX {
        return Err(format!("{width} x {height} pixels, expected at most {LONGEST_PX} a side"));
    }
    let (color, depth) = reader.output_color_type();
    if (depth == png::BitDepth::Sixteen) != deep {
        return Err(if deep { "a depth image has 16 bits" } else { "a colour image has 8 bits" }.into());
    }
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(|error| error.to_string())?;
    bytes.truncate(info.buffer_size());
    Ok((width, height, color.samples(), bytes))
}

#[cfg(test)]
mod tests {
    //! Contract: every depth that a camera hands out comes back from 16 bits of millimetres as it was.
    use super::*;
    use crate::picture::{color_png, depth_mm_png};
    use dsm::Pose;
    use dsm::camera::CameraModel;
    use dsm::frame::{FrameId, RgbdFrame};
    use dsm::time::Stamp;

    #[test]
    fn whole_millimetres_come_back() {
        let frame = RgbdFrame {
            id: FrameId(0),
            stamp: Stamp(0),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(256, 256, 1.0),
            world_from_camera: Pose::identity(),
            color: (0..65_536_u32).map(|i| [i as u8, (i >> 8) as u8, (i >> 3) as u8]).collect(),
            // As the simulated sensor has them.
            depth_m: (0..=u16::MAX).map(|mm| f32::from(mm) / 1000.0).collect(),
        };
        assert_eq!(decode_depth(&depth_mm_png(&frame), (256, 256)), Ok(frame.depth_m.clone()));
        assert_eq!(decode_color(&color_png(&frame), (256, 256)), Ok(frame.color.clone()));
        assert!(decode_depth(&depth_mm_png(&frame), (128, 512)).is_err());
        assert!(decode_depth(&color_png(&frame), (256, 256)).is_err());
        assert!(decode_color(&color_png(&frame)[..100], (256, 256)).is_err());
    }
}
