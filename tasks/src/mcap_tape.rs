//! MCAP with Foxglove's schemas (as JSON) of what mapping sees and does.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/camera/NAME/color`, `/camera/NAME/depth` | `foxglove.CompressedImage` | PNG; depth in millimetres, 16 bits |
//! | `/camera/NAME/calibration` | `foxglove.CameraCalibration` | intrinsics |
//! | `/camera/NAME/detections` | `foxglove.ImageAnnotations` | bounds, names and scores |
//! | `/tf` | `foxglove.FrameTransform` | camera in `world` |
//! | `/base` | `foxglove.PoseInFrame` | where the base stands |
//! | `/map` | `foxglove.SceneUpdate` | objects that a frame added, changed or removed |

use crate::error::TaskError;
use crate::perception::{Tape, Taped};
use crate::picture::{color_png, depth_mm_png};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsm::Pose;
use dsm::map::{Map, MapChange, MapObject, ObjectState};
use dsm::store::StoreError;
use dsm::time::Stamp;
use mcap::Writer;
use mcap::records::MessageHeader;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Records into an MCAP file.
pub struct McapTape {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<String, u16>,
    sequence: u32,
}

impl McapTape {
    /// Creates the file.
    ///
    /// # Errors
    /// [`TaskError::Store`]: it cannot be written.
    pub fn create(path: &Path) -> Result<Self, TaskError> {
        let io = |source| StoreError::Io { path: path.to_owned(), source };
        let file = File::create(path).map_err(io)?;
        let writer = Writer::new(BufWriter::new(file)).map_err(|error| io(std::io::Error::other(error)))?;
        Ok(Self { path: path.to_owned(), writer, channels: BTreeMap::new(), sequence: 0 })
    }

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
        let Taped { frame, detections, carrier, update, map } = taped;
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
        self.write(&topic("detections"), "foxglove.ImageAnnotations", stamp, &annotations)?;
        let Pose { translation, rotation } = frame.world_from_camera;
        let transform = json!({"timestamp": timestamp, "parent_frame_id": "world", "child_frame_id": camera,
            "translation": vector(translation.vector.into()), "rotation": quaternion(rotation.coords.into())});
        self.write("/tf", "foxglove.FrameTransform", stamp, &transform)?;
        if let Some((place, _)) = carrier.footprint {
            let pose =
                json!({"position": vector([place.x, place.y, 0.0]), "orientation": quaternion([0.0, 0.0, 0.0, 1.0])});
            let base = json!({"timestamp": timestamp, "frame_id": "world", "pose": pose});
            self.write("/base", "foxglove.PoseInFrame", stamp, &base)?;
        }
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
        self.write("/map", "foxglove.SceneUpdate", stamp, &json!({"deletions": deletions, "entities": entities}))
    }

    fn finish(mut self: Box<Self>, _: &Map) -> Result<(), StoreError> {
        let finished = self.writer.finish();
        finished.map(drop).map_err(|error| StoreError::Io { path: self.path, source: std::io::Error::other(error) })
    }
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
