//! glTF 2.0, binary: one node for each stable object, its points as a mesh of points with colours.

use super::show_map;
use crate::map::Map;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;

const POINTS: u32 = 0;
const LINES: u32 = 1;
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Edges of a box between its corners, whose bits 0, 1 and 2 say which end of x, y and z.
const EDGES: [u16; 24] = [0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 1, 3, 4, 6, 5, 7, 0, 4, 1, 5, 2, 6, 3, 7];

/// The file. glTF has y up and ours z: the root node turns. `extras` of a node hold what `dsm map show --json` tells.
pub(super) fn glb(map: &Map) -> Vec<u8> {
    let mut file = File::default();
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -FRAC_PI_2);
    let edges = file.view(&EDGES.map(u16::to_le_bytes).concat(), ELEMENT_ARRAY_BUFFER);
    let edges =
        file.accessor(json!({"bufferView": edges, "componentType": UNSIGNED_SHORT, "count": 24, "type": "SCALAR"}));
    let mut nodes = vec![Value::Null];
    let shown = show_map(map);
    for (object, shown) in map.stable_objects().zip(&shown.objects) {
        let b = &object.bounds;
        let object_from_world = b.world_from_box().inverse();
        let points: Vec<Point3<f32>> =
            object.points.iter().map(|p| (object_from_world * p.position.cast::<f64>()).cast::<f32>()).collect();
        let mut primitives = Vec::new();
        if !points.is_empty() {
            let position = file.positions(&points);
            let colors: Vec<u8> =
                object.points.iter().flat_map(|p| linear(p.color)).flat_map(u16::to_le_bytes).collect();
            let view = file.view(&colors, ARRAY_BUFFER);
            let color = file.accessor(json!({"bufferView": view, "componentType": UNSIGNED_SHORT, "normalized": true,
                "count": points.len(), "type": "VEC4"}));
            primitives.push(json!({"mode": POINTS, "attributes": {"POSITION": position, "COLOR_0": color}}));
        }
        let corner = |k: usize| {
            Point3::from(Vector3::from_fn(|axis, _| {
                (if k >> axis & 1 == 1 { 0.5 } else { -0.5 } * b.size[axis]) as f32
            }))
        };
        let corners = file.positions(&std::array::from_fn::<_, 8, _>(corner));
        primitives.push(json!({"mode": LINES, "attributes": {"POSITION": corners}, "indices": edges}));
        file.meshes.push(json!({"name": shown.name, "primitives": primitives}));
        let q = b.rotation.coords;
        nodes.push(json!({
            "name": shown.name, "mesh": file.meshes.len() - 1, "translation": shown.center,
            "rotation": [q.x, q.y, q.z, q.w], "extras": shown,
        }));
    }
    let q = turn.coords;
    let children: Vec<usize> = (1..nodes.len()).collect();
    nodes[0] = json!({"name": "map", "rotation": [q.x, q.y, q.z, q.w],
        "extras": {"relations": shown.relations, "rooms": shown.rooms}});
    if !children.is_empty() {
        nodes[0]["children"] = json!(children);
    }
    file.into_bytes(&nodes)
}

/// Colours of vertices are linear in glTF; ours are sRGB.
fn linear(srgb: [u8; 3]) -> [u16; 4] {
    let channel = |k: usize| {
        let c = f64::from(srgb[k]) / 255.0;
        let light = if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        (light * 65535.0).round() as u16
    };
    [channel(0), channel(1), channel(2), u16::MAX]
}

#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
}

impl File {
    fn view(&mut self, bytes: &[u8], target: u32) -> usize {
        self.views
            .push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target}));
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Positions with their bounds, which the format asks for.
    fn positions(&mut self, points: &[Point3<f32>]) -> usize {
        let bytes: Vec<u8> = points.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f32::to_le_bytes).collect();
        let view = self.view(&bytes, ARRAY_BUFFER);
        let bound = |pick: fn(f32, f32) -> f32, start: f32| -> [f32; 3] {
            std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
        };
        let (min, max) = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
        self.accessor(json!({"bufferView": view, "componentType": FLOAT, "count": points.len(), "type": "VEC3",
            "min": min, "max": max}))
    }

    fn into_bytes(self, nodes: &[Value]) -> Vec<u8> {
        let mut document = json!({
            "asset": {"version": "2.0", "generator": "dsm"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
            "buffers": [{"byteLength": self.bytes.len()}], "bufferViews": self.views, "accessors": self.accessors,
        });
        if !self.meshes.is_empty() {
            document["meshes"] = json!(self.meshes);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.bytes.len();
        let mut file = b"glTF".to_vec();
        for number in [2, total as u32, text.len() as u32] {
            file.extend(number.to_le_bytes());
        }
        file.extend(b"JSON");
        file.extend(text);
        file.extend((self.bytes.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(self.bytes);
        file
    }
}
