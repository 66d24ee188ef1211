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
//!
//! The last five are written when the run has ended, by their own stamps: what two threads note is in one order.

use crate::error::TaskError;
use crate::journal::{Journal, SentCommands};
use crate::perception::{Tape, Taped};
use crate::picture::{color_png, depth_mm_png};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsm::Pose;
use dsm::map::{Map, MapChange, MapObject, ObjectId, ObjectState};
use dsm::store::StoreError;
use dsm::time::Stamp;
use dsm_robot::joints::JointVelocities;
use mcap::Writer;
use mcap::records::MessageHeader;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};

/// An MCAP file that is being written.
struct McapFile {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<String, u16>,
    sequence: u32,
}

/// Records what mapping does.
pub struct McapTape {
    file: McapFile,
    ended: Sender<McapFile>,
}

/// What remains to be written of a file when its tape has ended.
pub struct McapRest(Receiver<McapFile>);

/// Creates a file.
///
/// # Errors
/// [`TaskError::Store`]: it cannot be written.
pub fn create(path: &Path) -> Result<(McapTape, McapRest), TaskError> {
    let io = |source| StoreError::Io { path: path.to_owned(), source };
    let file = File::create(path).map_err(io)?;
    let writer = Writer::new(BufWriter::new(file)).map_err(|error| io(std::io::Error::other(error)))?;
    let file = McapFile { path: path.to_owned(), writer, channels: BTreeMap::new(), sequence: 0 };
    let (ended, rest) = channel();
    Ok((McapTape { file, ended }, McapRest(rest)))
}

impl McapFile {
    fn write(&mut self, topic: &str, schema: &str, stamp: Stamp, message: &Value) -> Result<(), StoreError> {
        self.try_write(topic, schema, stamp, message)
            .map_err(|error| StoreError::Io { path: self.path.clone(), source: std::io::Error::other(error) })
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

impl Tape for McapTape {
    fn record(&mut self, taped: &Taped<'_>) -> Result<(), StoreError> {
        let Taped { frame, detections, associations, update, map, .. } = taped;
        let file = &mut self.file;
        let (stamp, model) = (frame.stamp, &frame.model);
        let (camera, timestamp) = (format!("{}_camera", frame.camera), time(stamp));
        let topic = |what: &str| format!("/camera/{}/{what}", frame.camera);
        let image = |png: Vec<u8>| json!({"timestamp": timestamp, "frame_id": camera, "format": "png", "data": STANDARD.encode(png)});
        file.write(&topic("color"), "foxglove.CompressedImage", stamp, &image(color_png(frame)))?;
        file.write(&topic("depth"), "foxglove.CompressedImage", stamp, &image(depth_mm_png(frame)))?;
        // Foxglove counts pixels from the middle of the first.
        let (cx, cy) = (model.cx - 0.5, model.cy - 0.5);
        let calibration = json!({
            "timestamp": timestamp, "frame_id": camera, "width": model.width, "height": model.height,
            "distortion_model": "plumb_bob", "D": [0.0, 0.0, 0.0, 0.0, 0.0],
            "K": [model.fx, 0.0, cx, 0.0, model.fy, cy, 0.0, 0.0, 1.0],
            "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            "P": [model.fx, 0.0, cx, 0.0, 0.0, model.fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        });
        file.write(&topic("calibration"), "foxglove.CameraCalibration", stamp, &calibration)?;
        let (mut rectangles, mut texts) = (Vec::new(), Vec::new());
        for item in &detections.items {
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
        file.write(&topic("detections"), "foxglove.ImageAnnotations", stamp, &annotations)?;
        let Pose { translation, rotation } = frame.world_from_camera;
        let transform = json!({"timestamp": timestamp, "parent_frame_id": "world", "child_frame_id": camera,
            "translation": vector(translation.vector.into()), "rotation": quaternion(rotation.coords.into())});
        file.write("/tf", "foxglove.FrameTransform", stamp, &transform)?;
        let named = |(place, object): &(usize, ObjectId)| {
            let name = detections.items.get(*place).map_or("", |item| item.name.as_str());
            json!({"detection": place, "name": name, "object": object.0})
        };
        let items: Vec<Value> = associations.iter().map(named).collect();
        let taken = json!({"timestamp": timestamp, "frame_id": camera, "items": items});
        file.write(&topic("associations"), "dsm.Associations", stamp, &taken)?;
        let (mut entities, mut deletions) = (BTreeMap::new(), Vec::new());
        for change in &update.changes {
            match change {
                MapChange::Put(object) if map.objects.contains_key(&object.id) => {
                    entities.insert(object.id, entity(object, &timestamp));
                }
                MapChange::Remove(id, _) => {
                    deletions.push(json!({"timestamp": timestamp, "type": 0, "id": id.0.to_string()}));
                }
                _ => {}
            }
        }
        if entities.is_empty() && deletions.is_empty() {
            return Ok(());
        }
        let entities: Vec<Value> = entities.into_values().collect();
        file.write("/map", "foxglove.SceneUpdate", stamp, &json!({"deletions": deletions, "entities": entities}))
    }

    fn finish(self: Box<Self>, _: &Map) -> Result<(), StoreError> {
        // Nobody waits for it when the run failed.
        let _ = self.ended.send(self.file);
        Ok(())
    }
}

impl McapRest {
    /// Writes what the robot noted, and closes the file.
    ///
    /// # Errors
    /// [`TaskError`]: it cannot be written, or its tape did not end.
    pub fn write(self, journal: &Journal) -> Result<(), TaskError> {
        let mut file = self.0.recv().map_err(|_| TaskError::Internal("the recording broke off".into()))?;
        let pose = |pose: &Pose| json!({"position": vector(pose.translation.vector.into()), "orientation": quaternion(pose.rotation.coords.into())});
        for (stamp, base) in &journal.bases {
            let message = json!({"timestamp": time(*stamp), "frame_id": "world", "pose": pose(base)});
            file.write("/base", "foxglove.PoseInFrame", *stamp, &message)?;
        }
        if let Some((stamp, _)) = journal.bases.last() {
            let poses: Vec<Value> = journal.bases.iter().map(|(_, base)| pose(base)).collect();
            let message = json!({"timestamp": time(*stamp), "frame_id": "world", "poses": poses});
            file.write("/path", "foxglove.PosesInFrame", *stamp, &message)?;
        }
        write_commands(&mut file, journal.commands.as_deref().unwrap_or_default())?;
        for sample in &journal.samples {
            let control = sample.control;
            let message = json!({"timestamp": time(sample.stamp), "clearance_m": sample.clearance_m,
                "speed_m_per_s": sample.speed_m_per_s, "control_error": control.map(|c| c.error),
                "control_distance_m": control.and_then(|c| c.distance_m),
                "active_rows": control.map(|c| c.active_rows)});
            file.write("/margins", "dsm.Margins", sample.stamp, &message)?;
        }
        for event in &journal.events {
            const INFO: u8 = 2;
            let stamp = Stamp::from_s(event.at_s);
            let message = json!({"timestamp": time(stamp), "level": INFO, "message": event.what, "name": "dsm",
                "file": "", "line": 0});
            file.write("/log", "foxglove.Log", stamp, &message)?;
        }
        let finished = file.writer.finish().map(drop);
        finished.map_err(|error| StoreError::Io { path: file.path, source: std::io::Error::other(error) }.into())
    }
}

/// What was sent to each part, when it changed.
fn write_commands(file: &mut McapFile, commands: &[SentCommands]) -> Result<(), StoreError> {
    let joints = |sent: &SentCommands, velocities: &JointVelocities| {
        let joints: Vec<Value> =
            velocities.iter().map(|(name, velocity)| json!({"name": name, "velocity": velocity})).collect();
        json!({"timestamp": time(sent.stamp), "joints": joints})
    };
    for (index, sent) in commands.iter().enumerate() {
        let before = index.checked_sub(1).map(|before| &commands[before]);
        if before.is_none_or(|before| before.base != sent.base) {
            let message = json!({"timestamp": time(sent.stamp), "forward_m_per_s": sent.base.forward_m_per_s,
                "turn_rad_per_s": sent.base.turn_rad_per_s});
            file.write("/command/base", "dsm.BaseCommand", sent.stamp, &message)?;
        }
        if before.is_none_or(|before| before.arm != sent.arm) {
            file.write("/command/arm", "foxglove.JointStates", sent.stamp, &joints(sent, &sent.arm))?;
        }
        if before.is_none_or(|before| before.head != sent.head) {
            file.write("/command/head", "foxglove.JointStates", sent.stamp, &joints(sent, &sent.head))?;
        }
        if let Some((width_m, force_n)) = sent.gripper
            && before.is_none_or(|before| before.gripper != sent.gripper)
        {
            let message = json!({"timestamp": time(sent.stamp), "width_m": width_m, "force_n": force_n});
            file.write("/command/gripper", "dsm.GripperCommand", sent.stamp, &message)?;
        }
    }
    Ok(())
}

fn entity(object: &MapObject, timestamp: &Value) -> Value {
    let b = &object.bounds;
    let count = object.points.len().max(1) as f64;
    let mean = |k: usize| object.points.iter().map(|point| f64::from(point.color[k])).sum::<f64>() / count / 255.0;
    // What is not confirmed yet is fainter.
    let alpha = if object.state == ObjectState::Stable { 0.6 } else { 0.2 };
    let pose = json!({"position": vector(b.center.coords.into()), "orientation": quaternion(b.rotation.coords.into())});
    let cube = json!({"pose": pose, "size": vector(b.size.into()),
        "color": {"r": mean(0), "g": mean(1), "b": mean(2), "a": alpha}});
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
