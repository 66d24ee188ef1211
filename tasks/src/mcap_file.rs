//! MCAP files: for viewers, and recordings of runs (`run_file`, `read`), which viewers open, too.
//!
//! A file for viewers holds Foxglove's schemas (as JSON) of what a run sees and does. Where Foxglove has no schema the name begins with
//! `dsm.`; viewers plot and list these as any message.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/camera/NAME/color`, `/camera/NAME/depth` | `foxglove.CompressedImage` | PNG; depth in millimetres, 16 bits |
//! | `/camera/NAME/calibration` | `foxglove.CameraCalibration` | intrinsics |
//! | `/camera/NAME/detections` | `foxglove.ImageAnnotations` | bounds, names and scores |
//! | `/camera/NAME/associations` | `dsm.Associations` | which detection was taken for which object |
//! | `/tf` | `foxglove.FrameTransform` | camera in `world` |
//! | `/map` | `foxglove.SceneUpdate` | objects that a frame added, changed or removed |
//! | `/base` | `foxglove.PoseInFrame` | where the base stood when a frame was taken |
//! | `/path` | `foxglove.PosesInFrame` | the whole way of the base |
//! | `/command/base`, `/command/gripper` | `dsm.BaseCommand`, `dsm.GripperCommand` | what was sent, when it changed |
//! | `/command/arm`, `/command/head` | `foxglove.JointStates` | velocities sent, when they changed |
//! | `/margins` | `dsm.Margins` | clearance, speed, and how the arm's controller stands; ten times a second |
//! | `/log` | `foxglove.Log` | events |

#[cfg(feature = "ros2")]
mod bag_file;
mod image;
mod read;
mod run_file;

#[cfg(feature = "ros2")]
pub use bag_file::write_bag;
pub use read::open_run;
pub use run_file::create_run;

use crate::error::TaskError;
use crate::journal::Sample;
use crate::picture::{color_png, depth_mm_png};
use crate::recording::{Association, RecordingFile, mean_color, opacity};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::map::{MapObject, ObjectId};
use dsm::perceive::Detections;
use dsm::store::{StoreError, WholeFile};
use dsm::time::Stamp;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

/// An MCAP file for viewers that is being written.
pub struct McapFile(Messages<BufWriter<WholeFile>>);

/// Messages on their way into a file.
struct Messages<W: Write + Seek> {
    path: PathBuf,
    writer: Writer<W>,
    channels: BTreeMap<String, u16>,
    sequence: u32,
}

/// Creates a file.
///
/// # Errors
/// [`TaskError::Store`]: it cannot be written.
pub fn create(path: &Path) -> Result<McapFile, TaskError> {
    Ok(McapFile(Messages::create(path, BufWriter::new(WholeFile::create(path)?), WriteOptions::new())?))
}

fn failed(path: &Path, error: impl std::error::Error + Send + Sync + 'static) -> StoreError {
    StoreError::Io { path: path.to_owned(), source: std::io::Error::other(error) }
}

/// What a message is written in: the encoding of the message, and name, encoding and text of its schema, if it has one.
struct Form {
    encoding: &'static str,
    schema: Option<(String, &'static str, String)>,
}

impl<W: Write + Seek> Messages<W> {
    fn create(path: &Path, file: W, options: WriteOptions) -> Result<Self, StoreError> {
        // Pictures do not become smaller by packing them once more.
        let writer = options.compression(None).create(file).map_err(|error| failed(path, error))?;
        Ok(Self { path: path.to_owned(), writer, channels: BTreeMap::new(), sequence: 0 })
    }

    /// Writes JSON.
    fn write(&mut self, topic: &str, schema: &str, stamp: Stamp, message: &Value) -> Result<(), StoreError> {
        let form = || Form {
            encoding: "json",
            schema: Some((schema.to_owned(), "jsonschema", schema_of(schema, message).to_string())),
        };
        self.write_bytes(topic, &form, stamp, message.to_string().as_bytes())
    }

    /// Writes a message in any form; `form` is asked once for a topic.
    fn write_bytes(
        &mut self,
        topic: &str,
        form: &dyn Fn() -> Form,
        stamp: Stamp,
        bytes: &[u8],
    ) -> Result<(), StoreError> {
        self.try_write(topic, form, stamp, bytes).map_err(|error| failed(&self.path, error))
    }

    fn try_write(&mut self, topic: &str, form: &dyn Fn() -> Form, stamp: Stamp, bytes: &[u8]) -> mcap::McapResult<()> {
        let channel_id = match self.channels.get(topic) {
            Some(id) => *id,
            None => {
                let Form { encoding, schema } = form();
                // Schema 0 is none.
                let schema = match schema {
                    Some((name, encoding, text)) => self.writer.add_schema(&name, encoding, text.as_bytes())?,
                    None => 0,
                };
                let id = self.writer.add_channel(schema, topic, encoding, &BTreeMap::new())?;
                self.channels.insert(topic.to_owned(), id);
                id
            }
        };
        let time = stamp.0.max(0) as u64;
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence = self.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, bytes)
    }

    /// Calibration of a frame's camera and its pose in the world.
    fn view(&mut self, frame: &RgbdFrame) -> Result<(), StoreError> {
        let (stamp, camera) = (frame.stamp, optical_frame(frame));
        self.write(&topic(frame, "calibration"), "foxglove.CameraCalibration", stamp, &calibration(frame))?;
        let Pose { translation, rotation } = frame.world_from_camera;
        let transform = json!({"timestamp": time(stamp), "parent_frame_id": "world", "child_frame_id": camera,
            "translation": vector(translation.vector.into()), "rotation": quaternion(rotation.coords.into())});
        self.write("/tf", "foxglove.FrameTransform", stamp, &transform)
    }
}

/// The topic of something about a frame's camera.
fn topic(frame: &RgbdFrame, what: &str) -> String {
    format!("/camera/{}/{what}", frame.camera)
}

/// The frame in which viewers see a camera's images.
fn optical_frame(frame: &RgbdFrame) -> String {
    format!("{}_camera", frame.camera)
}

fn calibration(frame: &RgbdFrame) -> Value {
    let model = &frame.model;
    // Foxglove counts pixels from the middle of the first.
    let (cx, cy) = (model.cx - 0.5, model.cy - 0.5);
    json!({
        "timestamp": time(frame.stamp), "frame_id": optical_frame(frame), "width": model.width, "height": model.height,
        "distortion_model": "plumb_bob", "D": [0.0, 0.0, 0.0, 0.0, 0.0],
        "K": [model.fx, 0.0, cx, 0.0, model.fy, cy, 0.0, 0.0, 1.0],
        "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "P": [model.fx, 0.0, cx, 0.0, 0.0, model.fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    })
}

/// Bounds, names and scores as annotations of an image.
fn annotations(stamp: Stamp, found: &Detections) -> Value {
    let (mut rectangles, mut texts) = (Vec::new(), Vec::new());
    let timestamp = time(stamp);
    for item in &found.items {
        let Some((left, top, right, bottom)) = item.mask.find_bounds() else { continue };
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        let points: Vec<Value> = corners.iter().map(|(x, y)| json!({"x": x, "y": y})).collect();
        rectangles.push(json!({"timestamp": timestamp, "type": 2, "points": points, "outline_color": green(),
            "outline_colors": [], "fill_color": clear(), "thickness": 2.0}));
        let text = format!("{} {:.2}", item.name, item.score);
        texts.push(json!({"timestamp": timestamp, "position": {"x": left, "y": top}, "text": text, "font_size": 12.0,
            "text_color": green(), "background_color": clear()}));
    }
    json!({"circles": [], "points": rectangles, "texts": texts})
}

/// What detections were taken for which objects.
fn associations(stamp: Stamp, camera: &str, taken: &[Association<'_>]) -> Value {
    let named =
        |item: &Association<'_>| json!({"detection": item.detection, "name": item.name, "object": item.object.0});
    let items: Vec<Value> = taken.iter().map(named).collect();
    json!({"timestamp": time(stamp), "frame_id": camera, "items": items})
}

/// Objects that were put or removed.
fn scene_update(stamp: Stamp, put: &[&MapObject], removed: &[ObjectId]) -> Value {
    let timestamp = time(stamp);
    let entities: Vec<Value> = put.iter().map(|object| entity(object, &timestamp)).collect();
    let deletion = |id: &ObjectId| json!({"timestamp": timestamp, "type": 0, "id": id.0.to_string()});
    let deletions: Vec<Value> = removed.iter().map(deletion).collect();
    json!({"deletions": deletions, "entities": entities})
}

fn base_command(stamp: Stamp, twist: Twist) -> Value {
    json!({"timestamp": time(stamp), "forward_m_per_s": twist.forward_m_per_s, "turn_rad_per_s": twist.turn_rad_per_s})
}

fn joint_command(stamp: Stamp, velocities: &JointVelocities) -> Value {
    let joint = |(name, velocity)| json!({"name": name, "velocity": velocity});
    let joints: Vec<Value> = velocities.iter().map(joint).collect();
    json!({"timestamp": time(stamp), "joints": joints})
}

fn gripper_command(stamp: Stamp, width_m: f64, force_n: f64) -> Value {
    json!({"timestamp": time(stamp), "width_m": width_m, "force_n": force_n})
}

fn log(stamp: Stamp, what: &str) -> Value {
    const INFO: u8 = 2;
    json!({"timestamp": time(stamp), "level": INFO, "message": what, "name": "dsm", "file": "", "line": 0})
}

impl RecordingFile for McapFile {
    fn frame(&mut self, frame: &RgbdFrame, found: &Detections, taken: &[Association<'_>]) -> Result<(), StoreError> {
        let (stamp, camera) = (frame.stamp, optical_frame(frame));
        let timestamp = time(stamp);
        let image = |png: Vec<u8>| json!({"timestamp": timestamp, "frame_id": camera, "format": "png", "data": STANDARD.encode(png)});
        self.0.write(&topic(frame, "color"), "foxglove.CompressedImage", stamp, &image(color_png(frame)))?;
        self.0.write(&topic(frame, "depth"), "foxglove.CompressedImage", stamp, &image(depth_mm_png(frame)))?;
        self.0.view(frame)?;
        let found = annotations(stamp, found);
        self.0.write(&topic(frame, "detections"), "foxglove.ImageAnnotations", stamp, &found)?;
        let taken = associations(stamp, &camera, taken);
        self.0.write(&topic(frame, "associations"), "dsm.Associations", stamp, &taken)
    }

    fn map(&mut self, stamp: Stamp, put: &[&MapObject], removed: &[ObjectId]) -> Result<(), StoreError> {
        self.0.write("/map", "foxglove.SceneUpdate", stamp, &scene_update(stamp, put, removed))
    }

    fn base(&mut self, stamp: Stamp, world_from_base: &Pose) -> Result<(), StoreError> {
        let message = json!({"timestamp": time(stamp), "frame_id": "world", "pose": pose(world_from_base)});
        self.0.write("/base", "foxglove.PoseInFrame", stamp, &message)
    }

    fn path(&mut self, stamp: Stamp, bases: &[(Stamp, Pose)]) -> Result<(), StoreError> {
        let poses: Vec<Value> = bases.iter().map(|(_, base)| pose(base)).collect();
        let message = json!({"timestamp": time(stamp), "frame_id": "world", "poses": poses});
        self.0.write("/path", "foxglove.PosesInFrame", stamp, &message)
    }

    fn base_command(&mut self, stamp: Stamp, twist: Twist) -> Result<(), StoreError> {
        self.0.write("/command/base", "dsm.BaseCommand", stamp, &base_command(stamp, twist))
    }

    fn joint_command(&mut self, stamp: Stamp, part: &str, velocities: &JointVelocities) -> Result<(), StoreError> {
        let message = joint_command(stamp, velocities);
        self.0.write(&format!("/command/{part}"), "foxglove.JointStates", stamp, &message)
    }

    fn gripper_command(&mut self, stamp: Stamp, width_m: f64, force_n: f64) -> Result<(), StoreError> {
        self.0.write("/command/gripper", "dsm.GripperCommand", stamp, &gripper_command(stamp, width_m, force_n))
    }

    fn margins(&mut self, sample: &Sample) -> Result<(), StoreError> {
        let control = sample.control;
        let message = json!({"timestamp": time(sample.stamp), "clearance_m": sample.clearance_m,
            "speed_m_per_s": sample.speed_m_per_s, "control_error": control.map(|c| c.error),
            "control_distance_m": control.and_then(|c| c.distance_m),
            "active_rows": control.map(|c| c.active_rows)});
        self.0.write("/margins", "dsm.Margins", sample.stamp, &message)
    }

    fn event(&mut self, stamp: Stamp, what: &str) -> Result<(), StoreError> {
        self.0.write("/log", "foxglove.Log", stamp, &log(stamp, what))
    }

    fn finish(self: Box<Self>) -> Result<(), StoreError> {
        let Messages { path, mut writer, .. } = self.0;
        writer.finish().map_err(|error| failed(&path, error))?;
        let file = writer.into_inner().into_inner().map_err(|error| failed(&path, error.into_error()))?;
        file.finish()
    }
}

fn entity(object: &MapObject, timestamp: &Value) -> Value {
    let b = &object.bounds;
    let [red, green, blue] = mean_color(object);
    let pose = json!({"position": vector(b.center.coords.into()), "orientation": quaternion(b.rotation.coords.into())});
    let cube = json!({"pose": pose, "size": vector(b.size.into()),
        "color": {"r": red, "g": green, "b": blue, "a": opacity(object)}});
    let above = json!({"position": vector([b.center.x, b.center.y, b.top_m() + 0.05]),
        "orientation": quaternion([0.0, 0.0, 0.0, 1.0])});
    let text = json!({"pose": above, "billboard": true, "font_size": 0.05, "scale_invariant": false,
        "color": {"r": 1.0, "g": 1.0, "b": 1.0, "a": 1.0}, "text": object.name()});
    let state = format!("{:?}", object.state).to_lowercase();
    let pair = |key: &str, value: String| json!({"key": key, "value": value});
    json!({"timestamp": timestamp, "frame_id": "world", "id": object.id.0.to_string(), "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": false, "metadata": [pair("name", object.name().into()), pair("state", state),
        pair("observations", object.observations.to_string())], "arrows": [], "cubes": [cube], "spheres": [],
        "cylinders": [], "lines": [], "triangles": [], "texts": [text], "models": []})
}

fn time(stamp: Stamp) -> Value {
    const SECOND: i64 = 1_000_000_000;
    json!({"sec": stamp.0.div_euclid(SECOND), "nsec": stamp.0.rem_euclid(SECOND)})
}

fn pose(pose: &Pose) -> Value {
    json!({"position": vector(pose.translation.vector.into()), "orientation": quaternion(pose.rotation.coords.into())})
}

fn vector([x, y, z]: [f64; 3]) -> Value {
    json!({"x": x, "y": y, "z": z})
}

fn quaternion([x, y, z, w]: [f64; 4]) -> Value {
    json!({"x": x, "y": y, "z": z, "w": w})
}

fn green() -> Value {
    json!({"r": 0.1, "g": 0.9, "b": 0.2, "a": 1.0})
}

fn clear() -> Value {
    json!({"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.0})
}

/// A JSON schema with the types of a message; viewers know the meaning from the schema's name.
fn schema_of(title: &str, message: &Value) -> Value {
    let mut schema = shape(message);
    schema["title"] = json!(title);
    schema
}

fn shape(value: &Value) -> Value {
    match value {
        Value::Object(fields) => {
            let properties: serde_json::Map<String, Value> = fields
                .iter()
                .map(|(name, value)| {
                    let mut field = shape(value);
                    // Bytes are text in JSON.
                    if name == "data" {
                        field["contentEncoding"] = json!("base64");
                    }
                    (name.clone(), field)
                })
                .collect();
            json!({"type": "object", "properties": properties})
        }
        Value::Array(items) => match items.first() {
            Some(first) => json!({"type": "array", "items": shape(first)}),
            None => json!({"type": "array"}),
        },
        Value::String(_) => json!({"type": "string"}),
        Value::Bool(_) => json!({"type": "boolean"}),
        Value::Number(number) if number.is_f64() => json!({"type": "number"}),
        Value::Number(_) => json!({"type": "integer"}),
        Value::Null => json!({}),
    }
}
