//! A world of boxes seen by ray casting: frames with true masks, for tests and benchmarks of map construction.
#![allow(dead_code, unreachable_pub, missing_docs)]

use dsm::Pose;
use dsm::build::{BuildConfig, Carrier, MapBuilder};
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::geometry::Aabb;
use dsm::knowledge::Knowledge;
use dsm::map::{Map, MapObject, ObjectId};
use dsm::perceive::{Detection, Detections, Mask};
use dsm::time::Stamp;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// A box; a name makes it an object, none structure.
#[derive(Clone, Debug)]
pub struct Block {
    pub name: Option<&'static str>,
    pub bounds: Aabb,
    pub color: [u8; 3],
}

/// All blocks over a floor at z = 0.
#[derive(Clone, Debug, Default)]
pub struct World {
    pub blocks: Vec<Block>,
}

/// How a frame is disturbed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Noise {
    /// Error of the reported position, metres.
    pub position_m: f64,
    /// Error of the reported attitude, radians; with it the position error is one that wanders over 10 s.
    pub attitude_rad: f64,
    /// Redwood-like depth noise.
    pub depth: bool,
    /// Missed, split, merged and misnamed detections, at the rates of the preset `noisy`.
    pub detector: bool,
    pub seed: u64,
}

pub fn camera_model() -> CameraModel {
    CameraModel::from_vertical_fov(320, 240, 0.9)
}

/// A camera at `eye` that looks at `target`.
pub fn look_at(eye: [f64; 3], target: [f64; 3]) -> Pose {
    let (eye, target) = (Point3::from(eye), Point3::from(target));
    let z = (target - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let y = z.cross(&x);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    Isometry3::from_parts(Translation3::from(eye.coords), UnitQuaternion::from_rotation_matrix(&rotation))
}

impl World {
    pub fn with(mut self, name: &'static str, center: [f64; 3], size: [f64; 3], color: [u8; 3]) -> Self {
        self.add(Some(name), center, size, color);
        self
    }

    pub fn with_wall(mut self, center: [f64; 3], size: [f64; 3]) -> Self {
        self.add(None, center, size, [225, 222, 215]);
        self
    }

    /// Four walls 2.5 m high around a rectangle.
    pub fn with_room(self, low: [f64; 2], high: [f64; 2]) -> Self {
        let (cx, cy) = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]));
        let (sx, sy) = (high[0] - low[0], high[1] - low[1]);
        self.with_wall([low[0] - 0.05, cy, 1.25], [0.1, sy + 0.2, 2.5])
            .with_wall([high[0] + 0.05, cy, 1.25], [0.1, sy + 0.2, 2.5])
            .with_wall([cx, low[1] - 0.05, 1.25], [sx, 0.1, 2.5])
            .with_wall([cx, high[1] + 0.05, 1.25], [sx, 0.1, 2.5])
    }

    fn add(&mut self, name: Option<&'static str>, center: [f64; 3], size: [f64; 3], color: [u8; 3]) {
        let (center, half) = (Point3::from(center), Vector3::from(size) * 0.5);
        self.blocks.push(Block { name, bounds: Aabb { min: center - half, max: center + half }, color });
    }

    /// What a camera sees, with a mask for each object of at least 60 pixels.
    pub fn render(
        &self,
        model: CameraModel,
        id: u64,
        stamp_s: f64,
        pose: Pose,
        noise: Noise,
    ) -> (RgbdFrame, Detections) {
        let mut random = ChaCha8Rng::seed_from_u64(noise.seed ^ id.wrapping_mul(0x9E37_79B9));
        let count = model.pixel_count();
        let (mut color, mut depth_m, mut labels) =
            (vec![[90, 60, 40]; count], vec![0.0f32; count], vec![usize::MAX; count]);
        let eye = pose.translation.vector;
        for pixel in 0..count {
            let (column, row) = (pixel as u32 % model.width, pixel as u32 / model.width);
            let ray = pose.rotation * model.back_project(column, row, 1.0).coords;
            let mut best = if ray.z < -1e-6 { -eye.z / ray.z } else { f64::INFINITY };
            for (label, block) in self.blocks.iter().enumerate() {
                if let Some((t, axis)) = hit(&block.bounds, &eye, &ray).filter(|(t, _)| *t < best) {
                    best = t;
                    let side = [0.85, 0.75, 1.0][axis];
                    labels[pixel] = label;
                    color[pixel] = block.color.map(|c| (f64::from(c) * side) as u8);
                }
            }
            if best < 10.0 {
                let mut depth = best;
                if noise.depth {
                    let jitter =
                        0.0278 * (random.random::<f64>() + random.random::<f64>() + random.random::<f64>() - 1.5) * 2.0;
                    depth = 35.130 * 8.0 / (8.0 * (35.130 / depth + jitter)).round();
                }
                depth_m[pixel] = depth as f32;
            }
        }
        let items: Vec<Detection> = self
            .blocks
            .iter()
            .enumerate()
            .filter_map(|(label, block)| {
                let pixels = (0..count as u32).filter(|p| labels[*p as usize] == label);
                let mask = Mask::from_sorted_pixels(model.width, pixels);
                (mask.area() >= 60).then_some(Detection { mask, name: block.name?.to_owned(), score: 0.9 })
            })
            .collect();
        let items = if noise.detector { disturb(items, model.width, &mut random) } else { items };
        let mut wander = || (random.random::<f64>() * 2.0 - 1.0) * noise.position_m;
        let mut error = Isometry3::translation(wander(), wander(), 0.3 * wander());
        let mut turn = UnitQuaternion::identity();
        if noise.attitude_rad > 0.0 {
            // Smooth curves with periods around 10 s.
            let wave = |k: f64| (stamp_s * std::f64::consts::TAU / (8.0 + k) + k * k + noise.seed as f64).sin();
            error = Isometry3::translation(
                noise.position_m * wave(1.0),
                noise.position_m * wave(2.7),
                0.3 * noise.position_m * wave(4.1),
            );
            turn = UnitQuaternion::from_scaled_axis(
                Vector3::new(0.5 * wave(0.4), 0.5 * wave(3.2), wave(5.3)) * noise.attitude_rad,
            );
        }
        let error = error * Isometry3::from_parts(pose.translation, turn) * pose.translation.inverse();
        let frame = RgbdFrame {
            id: FrameId(id),
            stamp: Stamp::from_s(stamp_s),
            camera: "head".into(),
            model,
            world_from_camera: error * pose,
            color,
            depth_m,
        };
        (frame, Detections { frame: FrameId(id), items })
    }
}

/// 5 % missed (all below 100 pixels), 3 % split, 5 % misnamed, one in five a synonym, borders off by 1 pixel.
fn disturb(items: Vec<Detection>, width: u32, random: &mut ChaCha8Rng) -> Vec<Detection> {
    let mut seen = Vec::new();
    for mut item in items {
        if random.random::<f64>() < 0.05 || item.mask.area() < 100 {
            continue;
        }
        item.name = match (item.name.as_str(), random.random::<f64>()) {
            ("mug", x) if x < 0.05 => "bowl".into(),
            ("bowl", x) if x < 0.05 => "mug".into(),
            ("cabinet", x) if x < 0.05 => "wardrobe".into(),
            ("bottle", x) if x < 0.05 => "vase".into(),
            ("sofa", x) if x < 0.05 => "armchair".into(),
            ("sofa", x) if x > 0.8 => "couch".into(),
            ("fridge", x) if x > 0.8 => "refrigerator".into(),
            ("mug", x) if x > 0.8 => "coffee mug".into(),
            (name, _) => name.into(),
        };
        // A mask that reaches one pixel too far to the right, over whatever is behind.
        item.mask.runs.iter_mut().for_each(|run| run.length += u32::from(run.start % width + run.length < width));
        if random.random::<f64>() < 0.03 && item.mask.area() > 400 {
            let runs = item.mask.runs.split_off(item.mask.runs.len() / 2);
            let mut half = item.clone();
            half.mask.runs = runs;
            seen.push(half);
        }
        seen.push(item);
    }
    seen
}

/// Ray parameter and axis of the face where a ray enters a box.
fn hit(bounds: &Aabb, eye: &Vector3<f64>, ray: &Vector3<f64>) -> Option<(f64, usize)> {
    let (mut near, mut far, mut axis) = (1e-3, f64::INFINITY, 0);
    for i in 0..3 {
        let (a, b) = ((bounds.min[i] - eye[i]) / ray[i], (bounds.max[i] - eye[i]) / ray[i]);
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        if low > near {
            (near, axis) = (low, i);
        }
        far = far.min(high);
    }
    (near < far && near > 1e-3).then_some((near, axis))
}

/// A map under construction.
pub struct Session {
    pub map: Map,
    pub builder: MapBuilder,
    pub frames: u64,
    pub noise: Noise,
    /// What the next frame's carrier says that it moved.
    pub moved: Vec<(ObjectId, Vector3<f64>)>,
}

impl Session {
    pub fn new(noise: Noise) -> Self {
        let knowledge = Arc::new(Knowledge::embedded().expect("embedded table"));
        let builder = MapBuilder::new(BuildConfig::default(), knowledge);
        Self { map: Map::new(0.05), builder, frames: 0, noise, moved: Vec::new() }
    }

    /// Observes the world from one place; frames come at 5 Hz.
    pub fn see(&mut self, world: &World, eye: [f64; 3], target: [f64; 3]) {
        let pose = look_at(eye, target);
        let (frame, detections) = world.render(camera_model(), self.frames, self.frames as f64 * 0.2, pose, self.noise);
        self.frames += 1;
        let carrier = Carrier { moved: std::mem::take(&mut self.moved), ..Carrier::default() };
        let update = self.builder.observe(&self.map, &frame, &detections, &carrier);
        self.map.apply(update);
    }

    /// Goes once around `target` at a distance in `count` views.
    pub fn circle(&mut self, world: &World, target: [f64; 3], radius_m: f64, height_m: f64, count: usize) {
        for i in 0..count {
            let angle = std::f64::consts::TAU * i as f64 / count as f64;
            self.see(world, [target[0] + radius_m * angle.cos(), target[1] + radius_m * angle.sin(), height_m], target);
        }
    }

    pub fn named(&self, name: &str) -> Vec<&MapObject> {
        self.map.stable_objects().filter(|object| object.name() == name).collect()
    }
}
