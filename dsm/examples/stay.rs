//! Memory of a map of 100 m2 with 150 things, while the camera goes around and then stays in place for a simulated hour.
//!
//! `cargo run --release -p dsm --example stay [FRAMES]` prints the bytes that map and builder count, and what the system
//! says of the process (Linux).
#![allow(clippy::print_stdout, reason = "a program that measures")]

#[path = "../tests/world/mod.rs"]
mod world;

use dsm::build::{BuildConfig, Carrier, MapBuilder};
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::knowledge::Knowledge;
use dsm::map::Map;
use dsm::perceive::Detections;
use dsm::time::Stamp;
use std::sync::Arc;
use world::{Noise, World, look_at};

/// An hour at 5 Hz.
const HOUR: u64 = 18_000;
/// Different frames of the stay.
const STAY: u64 = 30;

fn hall() -> World {
    let names = ["mug", "bottle", "bowl", "plate", "book", "vase"];
    let mut world = World::default().with_room([-5.0, -5.0], [5.0, 5.0]);
    for table in 0..25 {
        let (x, y) = (-4.0 + 2.0 * f64::from(table % 5), -4.0 + 2.0 * f64::from(table / 5));
        world = world.with("dining table", [x, y, 0.36], [0.9, 0.6, 0.72], [160, 110, 70]);
        for thing in 0..5 {
            let place = [x - 0.3 + 0.15 * f64::from(thing), y + 0.1 * f64::from(thing % 2), 0.79];
            let color = [40 + 40 * thing as u8, 200 - 7 * table as u8, 60];
            world = world.with(names[(table + thing) as usize % names.len()], place, [0.09, 0.09, 0.14], color);
        }
    }
    world
}

fn main() {
    let frames: u64 = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(HOUR);
    let world = hall();
    let model = CameraModel::from_vertical_fov(320, 240, 0.9);
    let noise = Noise { position_m: 0.01, attitude_rad: 0.003, depth: true, detector: true, seed: 1 };
    let knowledge = Arc::new(Knowledge::embedded().expect("the embedded table is whole"));
    let (mut map, mut builder) = (Map::new(0.05), MapBuilder::new(BuildConfig::default(), knowledge));
    let mut number = 0;
    let mut see = |frame: &RgbdFrame, detections: &Detections, map: &mut Map, builder: &mut MapBuilder| {
        let (id, stamp) = (FrameId(number), Stamp::from_s(number as f64 * 0.2));
        number += 1;
        let frame = RgbdFrame { id, stamp, ..frame.clone() };
        let detections = Detections { frame: id, items: detections.items.clone() };
        let update = builder.observe(map, &frame, &detections, &Carrier::default());
        map.apply(update);
    };
    // From sixteen places all around, each direction for a second.
    for (place, turn) in (0..16).flat_map(|place| (0..10).map(move |turn| (place, turn))) {
        let (x, y) = (-3.0 + 2.0 * f64::from(place % 4), -3.0 + 2.0 * f64::from(place / 4));
        let angle = f64::from(turn) * 0.1 * std::f64::consts::TAU;
        let pose = look_at([x, y, 1.3], [x + angle.cos(), y + angle.sin(), 0.8]);
        for _ in 0..5 {
            let (frame, detections) = world.render(model, u64::from(place as u32 * 10 + turn as u32), 0.0, pose, noise);
            see(&frame, &detections, &mut map, &mut builder);
        }
    }
    print("after a round", &map, &builder);
    let render = |i: u64| {
        let turn = (i as f64 / STAY as f64 * std::f64::consts::TAU).sin();
        let pose = look_at([1.0, -1.0, 1.3], [0.5 * turn, 1.0, 0.7]);
        world.render(model, i, i as f64 * 0.2, pose, noise)
    };
    let seen: Vec<_> = (0..STAY).map(render).collect();
    for i in 0..frames {
        let (frame, detections) = &seen[(i % STAY) as usize];
        see(frame, detections, &mut map, &mut builder);
        if (i + 1) % (frames / 6).max(1) == 0 {
            print(&format!("{:>5.0} s in place", (i + 1) as f64 * 0.2), &map, &builder);
        }
    }
}

fn print(when: &str, map: &Map, builder: &MapBuilder) {
    let points: usize = map.objects.values().map(|object| object.points.len()).sum();
    let (map_mb, builder_mb) = (map.held_bytes() as f64 * 1e-6, builder.held_bytes() as f64 * 1e-6);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = |name: &str| status.lines().find(|line| line.starts_with(name)).unwrap_or_default().to_owned();
    println!(
        "{when:>16}: {} objects, {points} points, {} relations, map {map_mb:.1} MB, builder {builder_mb:.1} MB  {}  {}",
        map.objects.len(),
        map.relations.len(),
        line("VmRSS"),
        line("VmHWM")
    );
}
