//! `sensor_msgs`.

use super::standard::Header;
use serde::{Deserialize, Serialize};

/// Positions, velocities and efforts of joints. A list is as long as `name`, or empty when it is not known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// When.
    pub header: Header,
    /// The joints.
    pub name: Vec<String>,
    /// Radians or metres.
    pub position: Vec<f64>,
    /// Radians or metres per second.
    pub velocity: Vec<f64>,
    /// Newton metres or newtons.
    pub effort: Vec<f64>,
}

/// A picture without compression.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image {
    /// When, and the camera's optical frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// `rgb8`, `bgr8`, `16UC1` (depth in millimetres), `32FC1` (depth in metres).
    pub encoding: String,
    /// 1 when numbers of several bytes begin with the highest.
    pub is_bigendian: u8,
    /// Bytes of a row.
    pub step: u32,
    /// The rows.
    #[serde(with = "bytes")]
    pub data: Vec<u8>,
}

/// A part of a picture that a camera sends; all of it when width and height are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Whether the picture was rectified with the region in mind.
    pub do_rectify: bool,
}

/// What a camera is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// When, and the camera's optical frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// `plumb_bob`, for example.
    pub distortion_model: String,
    /// Parameters of the distortion.
    pub d: Vec<f64>,
    /// fx, 0, cx, 0, fy, cy, 0, 0, 1 in pixels; (0, 0) is the middle of the first pixel.
    pub k: [f64; 9],
    /// Rectification.
    pub r: [f64; 9],
    /// Projection after rectification.
    pub p: [f64; 12],
    /// Columns that were put together.
    pub binning_x: u32,
    /// Rows that were put together.
    pub binning_y: u32,
    /// Which part is sent.
    pub roi: RegionOfInterest,
}

super::named!("sensor_msgs": JointState, Image, CameraInfo);

/// A sequence of bytes is written in one piece: one by one, an image of a megabyte costs milliseconds.
mod bytes {
    use serde::de::{Deserializer, Error, Visitor};
    use serde::ser::Serializer;
    use std::fmt;

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(bytes)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        struct Bytes;
        impl Visitor<'_> for Bytes {
            type Value = Vec<u8>;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("bytes")
            }

            fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Vec<u8>, E> {
                Ok(bytes.to_vec())
            }

            fn visit_byte_buf<E: Error>(self, bytes: Vec<u8>) -> Result<Vec<u8>, E> {
                Ok(bytes)
            }
        }
        deserializer.deserialize_byte_buf(Bytes)
    }
}
