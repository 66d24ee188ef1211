//! `vision_msgs`, `visualization_msgs`.

use super::geometry::{Point, Pose, PoseWithCovariance, Vector3};
use super::standard::{ColorRGBA, Duration, Header};
use serde::{Deserialize, Serialize};

/// What something may be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesis {
    /// The class.
    pub class_id: String,
    /// How sure, 0 to 1.
    pub score: f64,
}

/// What something may be, and where it would be then.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesisWithPose {
    /// What.
    pub hypothesis: ObjectHypothesis,
    /// Where.
    pub pose: PoseWithCovariance,
}

/// A point of a picture in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point2D {
    /// Column.
    pub x: f64,
    /// Row.
    pub y: f64,
}

/// A point of a picture and a turn about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose2D {
    /// The point.
    pub position: Point2D,
    /// Radians.
    pub theta: f64,
}

/// A rectangle of a picture, pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox2D {
    /// Its middle.
    pub center: Pose2D,
    /// Its width.
    pub size_x: f64,
    /// Its height.
    pub size_y: f64,
}

/// Something seen in a picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection2D {
    /// When, and in which frame.
    pub header: Header,
    /// What it may be.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// Where in the picture.
    pub bbox: BoundingBox2D,
    /// Says which it is among those of one picture.
    pub id: String,
}

/// All that is seen in a picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection2DArray {
    /// When, and in which frame.
    pub header: Header,
    /// The things.
    pub detections: Vec<Detection2D>,
}

/// A box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox3D {
    /// Its middle and axes.
    pub center: Pose,
    /// Its sides along these axes, metres.
    pub size: Vector3,
}

/// Something in space.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3D {
    /// When, and in which frame.
    pub header: Header,
    /// What it may be.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// Where.
    pub bbox: BoundingBox3D,
    /// Its id.
    pub id: String,
}

/// Things in space: a map's objects.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3DArray {
    /// When, and in which frame.
    pub header: Header,
    /// The things.
    pub detections: Vec<Detection3D>,
}

/// A point of a marker's picture, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UVCoordinate {
    /// Along the width.
    pub u: f32,
    /// Along the height.
    pub v: f32,
}

/// A picture as a file in bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// When, and in which frame.
    pub header: Header,
    /// `png`, `jpeg`.
    pub format: String,
    /// The file.
    pub data: Vec<u8>,
}

/// A mesh as a file in bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshFile {
    /// Its name.
    pub filename: String,
    /// The file.
    pub data: Vec<u8>,
}

/// Something that a viewer draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// When, and in which frame.
    pub header: Header,
    /// With the id it says which marker this is.
    pub ns: String,
    /// With `ns` it says which marker this is.
    pub id: i32,
    /// 1 a cube, 5 lines, 9 a text.
    #[serde(rename = "type")]
    pub kind: i32,
    /// 0 put, 2 remove, 3 remove all.
    pub action: i32,
    /// Where.
    pub pose: Pose,
    /// How large; the height of letters is `z`, the width of lines `x`.
    pub scale: Vector3,
    /// Its colour.
    pub color: ColorRGBA,
    /// How long it stays; 0 for ever.
    pub lifetime: Duration,
    /// Whether it moves with its frame.
    pub frame_locked: bool,
    /// Ends of lines.
    pub points: Vec<Point>,
    /// Colours of the points.
    pub colors: Vec<ColorRGBA>,
    /// Name of a picture.
    pub texture_resource: String,
    /// The picture.
    pub texture: CompressedImage,
    /// Where the points are in the picture.
    pub uv_coordinates: Vec<UVCoordinate>,
    /// The text.
    pub text: String,
    /// Name of a mesh.
    pub mesh_resource: String,
    /// The mesh.
    pub mesh_file: MeshFile,
    /// Whether the mesh brings its own colours.
    pub mesh_use_embedded_materials: bool,
}

/// Markers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// The markers.
    pub markers: Vec<Marker>,
}

super::named!("sensor_msgs": CompressedImage);
super::named!("vision_msgs": Detection2DArray, Detection3DArray);
super::named!("visualization_msgs": MarkerArray);
