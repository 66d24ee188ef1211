//! MCAP with Foxglove's schemas (as JSON) of what a run sees and does. Where Foxglove has no schema the name begins with
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
use mcap::Writer;
use mcap::records::MessageHeader;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// An MCAP file that is being written.
pub struct McapFile {
    path: PathBuf,
    writer: Writer<BufWriter<WholeFile>>,
    channels: BTreeMap<String, u16>,
    sequence: u32,
}

/// Creates a file.
///
/// # Errors
/// [`TaskError::Store`]: it cannot be written.
pub fn create(path: &Path) -> Result<McapFile, TaskError> {
    let writer = Writer::new(BufWriter::new(WholeFile::create(path)?));
    let writer = writer.map_err(|error| failed(path, error))?;
    Ok(McapFile { path: path.to_owned(), writer, channels: BTreeMap::new(), sequence: 0 })
}

fn failed(path: &Path, error: impl std::error::Error + Send + Sync + 'static) -> StoreError {
    StoreError::Io { path: path.to_owned(), source: std::io::Error::other(error) }
}

impl McapFile {
    fn write(&mut self, topic: &str, schema: &str, stamp: Stamp, message: &Value) -> Result<(), StoreError> {
        self.try_write(topic, schema, stamp, message).map_err(|error| failed(&self.path, error))
    }

    fn try_write(&mut self, topic: &str, schema: &str, stamp: Stamp, message: &Value) -> mcap::McapResult<()> {
        let channel_id = match self.channels.get(topic) {
            Some(id) => *id,
            None => {
                let described = schema_of(schema, message).to_string();
                let schema = self.writer.add_schema(schema, "jsonschema", described.as_bytes())?;
                let id = self.writer.add_channel(schema, topic, "json", &BTreeMap::new())?;
                self.channels.insert(topic.to_owned(), id);
                id
            }
        };
        let time = stamp.0.max(0) as u64;
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence += 1;
        self.writer.write_to_known_channel(&header, message.to_string().as_bytes())
    }
}

impl RecordingFile for McapFile {
    fn frame(&mut self, frame: &RgbdFrame, found: &Detections, taken: &[Association<'_>]) -> Result<(), StoreError> {
        let (stamp, model) = (frame.stamp, &frame.model);
        let (camera, timestamp) = (format!("{}_camera", frame.camera), time(stamp));
        let topic = |what: &str| format!("/camera/{}/{what}", frame.camera);
        let image = |png: Vec<u8>| json!({"timestamp": timestamp, "frame_id": camera, "format": "png", "data": STANDARD.encode(png)});
        self.write(&topic("color"), "foxglove.CompressedImage", stamp, &image(color_png(frame)))?;
        self.write(&topic("depth"), "foxglove.CompressedImage", stamp, &image(depth_mm_png(frame)))?;
        // Foxglove counts pixels from the middle of the first.
        let (cx, cy) = (model.cx - 0.5, model.cy - 0.5);
        let calibration = json!({
            "timestamp": timestamp, "frame_id": camera, "width": model.width, "height": model.height,
            "distortion_model": "plumb_bob", "D": [0.0, 0.0, 0.0, 0.0, 0.0],
            "K": [model.fx, 0.0, cx, 0.0, model.fy, cy, 0.0, 0.0, 1.0],
            "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            "P": [model.fx, 0.0, cx, 0.0, 0.0, model.fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        });
        self.write(&topic("calibration"), "foxglove.CameraCalibration", stamp, &calibration)?;
        let (mut rectangles, mut texts) = (Vec::new(), Vec::new());
        for item in &found.items {
            let Some((left, top, right, bottom)) = item.mask.find_bounds() else { continue };
            let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
            let points: Vec<Value> = corners.iter().map(|(x, y)| json!({"x": x, "y": y})).collect();
            rectangles.push(json!({"timestamp": timestamp, "type": 2, "points": points, "outline_color": green(),
                "outline_colors": [], "fill_color": clear(), "thickness": 2.0}));
            let text = format!("{} {:.2}", item.name, item.score);
            texts.push(
                json!({"timestamp": timestamp, "position": {"x": left, "y": top}, "text": text, "font_size": 12.0,
                "text_color": green(), "background_color": clear()}),
            );
        }
        let annotations = json!({"circles": [], "points": rectangles, "texts": texts});
        self.write(&topic("detections"), "foxglove.ImageAnnotations", stamp, &annotations)?;
        let Pose { translation, rotation } = frame.world_from_camera;
        let transform = json!({"timestamp": timestamp, "parent_frame_id": "world", "child_frame_id": camera,
            "translation": vector(translation.vector.into()), "rotation": quaternion(rotation.coords.into())});
        self.write("/tf", "foxglove.FrameTransform", stamp, &transform)?;
        let named =
            |item: &Association<'_>| json!({"detection": item.detection, "name": item.name, "object": item.object.0});
        let items: Vec<Value> = taken.iter().map(named).collect();
        let message = json!({"timestamp": timestamp, "frame_id": camera, "items": items});
        self.write(&topic("associations"), "dsm.Associations", stamp, &message)
    }

    fn map(&mut self, stamp: Stamp, put: &[&MapObject], removed: &[ObjectId]) -> Result<(), StoreError> {
        let timestamp = time(stamp);
        let entities: Vec<Value> = put.iter().map(|object| entity(object, &timestamp)).collect();
        let deletion = |id: &ObjectId| json!({"timestamp": timestamp, "type": 0, "id": id.0.to_string()});
        let deletions: Vec<Value> = removed.iter().map(deletion).collect();
        self.write("/map", "foxglove.SceneUpdate", stamp, &json!({"deletions": deletions, "entities": entities}))
    }

    fn base(&mut self, stamp: Stamp, world_from_base: &Pose) -> Result<(), StoreError> {
        let message = json!({"timestamp": time(stamp), "frame_id": "world", "pose": pose(world_from_base)});
        self.write("/base", "foxglove.PoseInFrame", stamp, &message)
    }

    fn path(&mut self, stamp: Stamp, bases: &[(Stamp, Pose)]) -> Result<(), StoreError> {
        let poses: Vec<Value> = bases.iter().map(|(_, base)| pose(base)).collect();
        let message = json!({"timestamp": time(stamp), "frame_id": "world", "poses": poses});
        self.write("/path", "foxglove.PosesInFrame", stamp, &message)
    }

    fn base_command(&mut self, stamp: Stamp, twist: Twist) -> Result<(), StoreError> {
        let message = json!({"timestamp": time(stamp), "forward_m_per_s": twist.forward_m_per_s,
            "turn_rad_per_s": twist.turn_rad_per_s});
        self.write("/command/base", "dsm.BaseCommand", stamp, &message)
    }

    fn joint_command(&mut self, stamp: Stamp, part: &str, velocities: &JointVelocities) -> Result<(), StoreError> {
        let joint = |(name, velocity)| json!({"name": name, "velocity": velocity});
        let joints: Vec<Value> = velocities.iter().map(joint).collect();
        let message = json!({"timestamp": time(stamp), "joints": joints});
        self.write(&format!("/command/{part}"), "foxglove.JointStates", stamp, &message)
    }

    fn gripper_command(&mut self, stamp: Stamp, width_m: f64, force_n: f64) -> Result<(), StoreError> {
        let message = json!({"timestamp": time(stamp), "width_m": width_m, "force_n": force_n});
        self.write("/command/gripper", "dsm.GripperCommand", stamp, &message)
    }

    fn margins(&mut self, sample: &Sample) -> Result<(), StoreError> {
        let control = sample.control;
        let message = json!({"timestamp": time(sample.stamp), "clearance_m": sample.clearance_m,
            "speed_m_per_s": sample.speed_m_per_s, "control_error": control.map(|c| c.error),
            "control_distance_m": control.and_then(|c| c.distance_m),
            "active_rows": control.map(|c| c.active_rows)});
        self.write("/margins", "dsm.Margins", sample.stamp, &message)
    }

    fn event(&mut self, stamp: Stamp, what: &str) -> Result<(), StoreError> {
        const INFO: u8 = 2;
        let message = json!({"timestamp": time(stamp), "level": INFO, "message": what, "name": "dsm",
            "file": "", "line": 0});
        self.write("/log", "foxglove.Log", stamp, &message)
    }

    fn finish(mut self: Box<Self>) -> Result<(), StoreError> {
        self.writer.finish().map_err(|error| failed(&self.path, error))?;
        let file = self.writer.into_inner().into_inner().map_err(|error| failed(&self.path, error.into_error()))?;
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
