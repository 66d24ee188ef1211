//! Pictures and their depth, put together by their stamps.

use crate::messages::Image;
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::time::{Span, Stamp};
use std::collections::VecDeque;

/// Halves that wait for their other half; the oldest is forgotten when there are more.
const MAX_WAITING: usize = 8;

/// Colour and depth of one moment, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The moment of the colour.
    pub stamp: Stamp,
    /// sRGB.
    pub color: Vec<[u8; 3]>,
    /// Metres along z; 0 means no return.
    pub depth_m: Vec<f32>,
    /// Where the camera was, when that came with it.
    pub world_from_camera: Option<Pose>,
}

/// Why an image is none that is understood.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an image of {width} x {height}, encoding `{encoding}`, {bytes} bytes in rows of {step}: expected {expected}")]
pub struct BadImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Its encoding.
    pub encoding: String,
    /// Its bytes.
    pub bytes: usize,
    /// Bytes of a row.
    pub step: u32,
    /// What is understood.
    pub expected: String,
}

/// The pixels of an image, `bytes` each, when it has the size of the camera and is as long as it says.
fn pixels<'a>(image: &'a Image, camera: &CameraModel, bytes: usize) -> Option<impl Iterator<Item = &'a [u8]>> {
    let (width, height, step) = (image.width as usize, image.height as usize, image.step as usize);
    let fits = image.width == camera.width
        && image.height == camera.height
        && step >= width.checked_mul(bytes)?
        && image.data.len() >= height.checked_mul(step)?;
    fits.then(|| {
        image.data.chunks_exact(step).take(height).flat_map(move |row| row[..width * bytes].chunks_exact(bytes))
    })
}

fn bad(image: &Image, camera: &CameraModel, encodings: &str) -> BadImage {
    BadImage {
        width: image.width,
        height: image.height,
        encoding: image.encoding.clone(),
        bytes: image.data.len(),
        step: image.step,
        expected: format!("{} x {}, {encodings}", camera.width, camera.height),
    }
}

/// The colours of an image.
///
/// # Errors
/// [`BadImage`]: another size than the camera's, or neither `rgb8` nor `bgr8`.
pub fn colors_of(image: &Image, camera: &CameraModel) -> Result<Vec<[u8; 3]>, BadImage> {
    let error = || bad(image, camera, "rgb8 or bgr8");
    let pixels = pixels(image, camera, 3).ok_or_else(error)?;
    match image.encoding.as_str() {
        "rgb8" => Ok(pixels.map(|p| [p[0], p[1], p[2]]).collect()),
        "bgr8" => Ok(pixels.map(|p| [p[2], p[1], p[0]]).collect()),
        _ => Err(error()),
    }
}

/// The depths of an image in metres; what is not finite or not above 0 is no return.
///
/// # Errors
/// [`BadImage`]: another size than the camera's, or neither `16UC1` nor `32FC1`.
pub fn depths_of(image: &Image, camera: &CameraModel) -> Result<Vec<f32>, BadImage> {
    let error = || bad(image, camera, "16UC1 (millimetres) or 32FC1 (metres)");
    let big = image.is_bigendian != 0;
    match image.encoding.as_str() {
        "16UC1" | "mono16" => {
            let metres = |p: &[u8]| {
                let pair = [p[0], p[1]];
                f32::from(if big { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }) / 1000.0
            };
            Ok(pixels(image, camera, 2).ok_or_else(error)?.map(metres).collect())
        }
        "32FC1" => {
            let metres = |p: &[u8]| {
                let four = [p[0], p[1], p[2], p[3]];
                let depth = if big { f32::from_be_bytes(four) } else { f32::from_le_bytes(four) };
                if depth.is_finite() && depth > 0.0 { depth } else { 0.0 }
            };
            Ok(pixels(image, camera, 4).ok_or_else(error)?.map(metres).collect())
        }
        _ => Err(error()),
    }
}

/// Puts the halves of one camera's pictures together.
#[derive(Debug)]
pub struct PictureBuffer {
    tolerance: Span,
    needs_pose: bool,
    colors: VecDeque<(Stamp, Vec<[u8; 3]>)>,
    depths: VecDeque<(Stamp, Vec<f32>)>,
    poses: VecDeque<(Stamp, Pose)>,
    /// Stamp of the last whole picture: what is older comes too late.
    last: Option<Stamp>,
}

fn keep<T>(waiting: &mut VecDeque<(Stamp, T)>, stamp: Stamp, half: T) {
    // Messages may overtake each other: kept in the order of their stamps.
    let place = waiting.iter().rposition(|(other, _)| *other <= stamp).map_or(0, |index| index + 1);
    waiting.insert(place, (stamp, half));
    while waiting.len() > MAX_WAITING {
        waiting.pop_front();
    }
}

/// The place of the half nearest to `stamp`, within the tolerance.
fn find_near<T>(waiting: &VecDeque<(Stamp, T)>, stamp: Stamp, tolerance: Span) -> Option<usize> {
    let gap = |index: &usize| (waiting[*index].0.0 - stamp.0).abs();
    (0..waiting.len()).min_by_key(gap).filter(|index| gap(index) <= tolerance.0)
}

impl PictureBuffer {
    /// Halves whose stamps differ by at most `tolerance` belong together. With `needs_pose` a picture is whole when the
    /// camera's pose has come, too.
    pub fn new(tolerance: Span, needs_pose: bool) -> Self {
        let (colors, depths, poses) = (VecDeque::new(), VecDeque::new(), VecDeque::new());
        Self { tolerance, needs_pose, colors, depths, poses, last: None }
    }

    /// Takes in colours.
    pub fn add_color(&mut self, stamp: Stamp, color: Vec<[u8; 3]>) {
        keep(&mut self.colors, stamp, color);
    }

    /// Takes in depths.
    pub fn add_depth(&mut self, stamp: Stamp, depth_m: Vec<f32>) {
        keep(&mut self.depths, stamp, depth_m);
    }

    /// Takes in where the camera was.
    pub fn add_pose(&mut self, stamp: Stamp, world_from_camera: Pose) {
        keep(&mut self.poses, stamp, world_from_camera);
    }

    /// The newest whole picture that was not taken yet. Older halves, and halves that come twice, are dropped.
    pub fn take(&mut self) -> Option<Picture> {
        let newest = (0..self.colors.len()).rev().find_map(|index| {
            let stamp = self.colors[index].0;
            let is_new = self.last.is_none_or(|last| stamp > last);
            let depth = find_near(&self.depths, stamp, self.tolerance).filter(|_| is_new)?;
            let pose = find_near(&self.poses, stamp, self.tolerance);
            (pose.is_some() || !self.needs_pose).then_some((index, depth, pose))
        });
        let (color, depth, pose) = newest?;
        let (stamp, color) = self.colors.remove(color)?;
        let (_, depth_m) = self.depths.remove(depth)?;
        let world_from_camera = pose.map(|index| self.poses[index].1);
        self.last = Some(stamp);
        let bound = Stamp(stamp.0 - self.tolerance.0);
        self.colors.retain(|(other, _)| *other > stamp);
        self.depths.retain(|(other, _)| *other > bound);
        self.poses.retain(|(other, _)| *other > bound);
        Some(Picture { stamp, color, depth_m, world_from_camera })
    }
}

#[cfg(test)]
mod tests {
    //! Contract: halves of one moment make one picture, whatever comes late, twice, in another order or never; images that
    //! are not what they say are refused.
    use super::*;

    fn camera() -> CameraModel {
        CameraModel::from_vertical_fov(2, 2, 1.0)
    }

    fn image(encoding: &str, step: u32, data: Vec<u8>) -> Image {
        Image { height: 2, width: 2, encoding: encoding.into(), step, data, ..Image::default() }
    }

    #[test]
    fn images_are_read_by_rows_that_may_be_longer_than_needed() {
        let data = vec![1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0];
        let colors = colors_of(&image("bgr8", 8, data.clone()), &camera()).unwrap();
        assert_eq!(colors, [[3, 2, 1], [6, 5, 4], [9, 8, 7], [12, 11, 10]]);
        let depth = depths_of(&image("16UC1", 4, vec![0xe8, 3, 0, 0, 1, 0, 0xff, 0xff]), &camera()).unwrap();
        assert_eq!(depth, [1.0, 0.0, 0.001, 65.535]);
        let values = [1.5_f32, f32::NAN, -1.0, f32::INFINITY];
        let bytes = values.iter().flat_map(|value| value.to_be_bytes()).collect();
        let depth = depths_of(&Image { is_bigendian: 1, ..image("32FC1", 8, bytes) }, &camera()).unwrap();
        assert_eq!(depth, [1.5, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn images_that_are_not_what_they_say_are_refused() {
        for wrong in [
            image("rgb8", 6, vec![0; 11]),
            image("rgb8", 5, vec![0; 12]),
            image("mono8", 6, vec![0; 12]),
            image("rgb8", u32::MAX, vec![0; 12]),
            Image { width: 3, ..image("rgb8", 9, vec![0; 18]) },
            Image { width: u32::MAX, height: u32::MAX, ..image("rgb8", 6, vec![0; 12]) },
        ] {
            assert!(colors_of(&wrong, &camera()).is_err(), "{wrong:?}");
            assert!(depths_of(&wrong, &camera()).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn halves_meet_whatever_their_order() {
        let mut buffer = PictureBuffer::new(Span(10), false);
        buffer.add_depth(Stamp(205), vec![2.0]);
        buffer.add_depth(Stamp(103), vec![1.0]);
        assert_eq!(buffer.take(), None);
        buffer.add_color(Stamp(100), vec![[1; 3]]);
        let first = buffer.take().unwrap();
        assert_eq!((first.stamp, first.depth_m), (Stamp(100), vec![1.0]));
        assert_eq!(buffer.take(), None, "a picture is taken once");
        buffer.add_color(Stamp(100), vec![[1; 3]]);
        buffer.add_depth(Stamp(100), vec![1.0]);
        assert_eq!(buffer.take(), None, "what comes twice counts once");
        buffer.add_color(Stamp(200), vec![[2; 3]]);
        assert_eq!(buffer.take().unwrap().depth_m, [2.0]);
        buffer.add_color(Stamp(300), vec![[3; 3]]);
        buffer.add_depth(Stamp(311), vec![3.0]);
        assert_eq!(buffer.take(), None, "too far apart");
    }

    #[test]
    fn the_newest_whole_picture_counts_and_what_waits_is_bounded() {
        let mut buffer = PictureBuffer::new(Span(0), true);
        for stamp in 1..100 {
            buffer.add_color(Stamp(stamp), vec![[stamp as u8; 3]]);
            buffer.add_depth(Stamp(stamp), vec![stamp as f32]);
            assert!(buffer.colors.len() <= MAX_WAITING && buffer.depths.len() <= MAX_WAITING);
        }
        assert_eq!(buffer.take(), None, "no pose yet");
        buffer.add_pose(Stamp(97), Pose::translation(1.0, 0.0, 0.0));
        buffer.add_pose(Stamp(98), Pose::translation(2.0, 0.0, 0.0));
        let picture = buffer.take().unwrap();
        assert_eq!((picture.stamp, picture.world_from_camera), (Stamp(98), Some(Pose::translation(2.0, 0.0, 0.0))));
        assert_eq!(buffer.take(), None, "97 is older than what was taken");
    }
}
