//! Whether the networks of a file load, run and give something, and how long they take: for `dsm models check`.

use super::open::{open_detector, open_text, open_visual};
use crate::settings::ModelSettings;
use crate::wall::{SystemWall, Wall};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::knowledge::Knowledge;
use dsm::perceive::{Detector, ObjectView, cosine};
use dsm::time::Stamp;
use nalgebra::Vector3;
use serde::Serialize;
use std::sync::Arc;

/// What became of one part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// The part: `detector`, `segmenter`, `visual`, `text`.
    pub part: &'static str,
    /// Whether it loaded and ran.
    pub passed: bool,
    /// What it gave, or why not.
    pub found: String,
    /// Seconds to load it.
    pub load_s: f64,
    /// Seconds to run it once, after a first time.
    pub run_s: f64,
}

/// Loads and runs every part that a file asks for, on a picture of a red disc before a grey wall.
pub fn probe(settings: &ModelSettings, knowledge: &Arc<Knowledge>) -> Vec<Probe> {
    let mut probes = Vec::new();
    let frame = disc();
    if settings.segmenter.is_some() {
        let part = if settings.detector.is_some() { "detector" } else { "segmenter" };
        probes.push(tried(
            part,
            || open_detector(settings, None, knowledge),
            |detector| {
                let found = detector.detect(&frame);
                let named = found.items.iter().map(|item| format!("{} {:.2}", item.name, item.score));
                match detector.failure() {
                    Some(error) => Err(error.to_string()),
                    None => {
                        Ok(format!("it sees {} things: {}", found.items.len(), named.collect::<Vec<_>>().join(", ")))
                    }
                }
            },
        ));
    }
    if settings.visual.is_some() {
        let middle: Vec<u32> = (180..300).flat_map(|row| (260..380).map(move |column| row * 640 + column)).collect();
        let view = ObjectView { frame: &frame, pixels: &middle, name: "disc", extent_m: Vector3::repeat(0.1) };
        probes.push(tried("visual", || open_visual(settings), |encoder| sound(&encoder.encode(&view))));
    }
    if settings.text.is_some() {
        probes.push(tried(
            "text",
            || open_text(settings),
            |encoder| {
                let [cup, mug, wardrobe] = ["cup", "mug", "wardrobe"].map(|word| encoder.encode(word));
                let likeness = |other: &[f32]| cosine(&cup, other);
                sound(&cup).map(|text| {
                    format!("{text}; cup and mug {:.2}, cup and wardrobe {:.2}", likeness(&mug), likeness(&wardrobe))
                })
            },
        ));
    }
    probes
}

fn tried<T, E: std::fmt::Display>(
    part: &'static str,
    open: impl FnOnce() -> Result<Option<T>, E>,
    mut run: impl FnMut(&mut T) -> Result<String, String>,
) -> Probe {
    let wall = SystemWall::new();
    let opened = open();
    let load_s = wall.now_s();
    let failed = |found: String| Probe { part, passed: false, found, load_s, run_s: 0.0 };
    let mut opened = match opened {
        Ok(Some(opened)) => opened,
        Ok(None) => return failed("the file does not ask for it".to_owned()),
        Err(error) => return failed(error.to_string()),
    };
    // The first run fills buffers.
    if let Err(error) = run(&mut opened) {
        return failed(error);
    }
    let start_s = wall.now_s();
    match run(&mut opened) {
        Ok(found) => Probe { part, passed: true, found, load_s, run_s: wall.now_s() - start_s },
        Err(error) => failed(error),
    }
}

/// A feature must have a length.
fn sound(feature: &[f32]) -> Result<String, String> {
    let is_unit = (cosine(feature, feature) - 1.0).abs() < 1e-3;
    if is_unit { Ok(format!("features of {} values", feature.len())) } else { Err("the feature has no length".into()) }
}

fn disc() -> RgbdFrame {
    let (width, height) = (640_i64, 480_i64);
    let is_disc = |index: i64| (index % width - 320).pow(2) + (index / width - 240).pow(2) < 3600;
    RgbdFrame {
        id: FrameId(0),
        stamp: Stamp::default(),
        camera: "probe".into(),
        model: CameraModel::from_vertical_fov(640, 480, 0.9),
        world_from_camera: Pose::identity(),
        color: (0..width * height).map(|i| if is_disc(i) { [200, 30, 30] } else { [190, 190, 185] }).collect(),
        depth_m: (0..width * height).map(|i| if is_disc(i) { 1.0 } else { 2.0 }).collect(),
    }
}
