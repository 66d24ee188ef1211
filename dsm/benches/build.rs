//! Map update at 640x480 with 20 detections on one thread, in maps of 20, 500 and 10 000 objects.

#[path = "../tests/world/mod.rs"]
mod world;

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::build::{BuildConfig, Carrier, MapBuilder};
use dsm::camera::CameraModel;
use dsm::frame::RgbdFrame;
use dsm::knowledge::Knowledge;
use dsm::map::{Map, MapChange, MapUpdate, ObjectId};
use dsm::perceive::Detections;
use nalgebra::{Translation3, Vector3};
use std::sync::Arc;
use world::{Noise, World, look_at};

fn cluttered_room() -> World {
    let names = ["mug", "bottle", "bowl", "plate", "book", "apple", "vase", "box", "can"];
    let mut world = World::default()
        .with_room([-3.0, -3.0], [3.0, 3.0])
        .with("dining table", [0.0, 0.0, 0.375], [1.6, 0.9, 0.75], [160, 110, 70])
        .with("shelf", [0.0, 2.7, 0.9], [1.2, 0.4, 1.8], [230, 230, 230]);
    for i in 0..18 {
        let (x, y) = (-0.7 + 0.28 * f64::from(i % 6), -0.3 + 0.3 * f64::from(i / 6));
        let color = [40 + 12 * i as u8, 200 - 9 * i as u8, 60 + 30 * (i as u8 % 5)];
        world = world.with(names[i as usize % names.len()], [x, y, 0.82], [0.09, 0.09, 0.14], color);
    }
    world
}

fn frames(world: &World) -> Vec<(RgbdFrame, Detections)> {
    let model = CameraModel::from_vertical_fov(640, 480, 0.9);
    (0..10)
        .map(|i| {
            let angle = -1.9 + 0.08 * i as f64;
            let pose = look_at([2.0 * angle.cos(), 2.0 * angle.sin(), 1.3], [0.0, 0.2, 0.8]);
            world.render(
                model,
                i,
                i as f64 * 0.2,
                pose,
                Noise { position_m: 0.01, depth: true, seed: 1, ..Noise::default() },
            )
        })
        .collect()
}

/// A builder with its map after all frames, with copies of the objects far away until there are `objects`.
fn grown(frames: &[(RgbdFrame, Detections)], objects: usize) -> (Map, MapBuilder) {
    let knowledge = Arc::new(Knowledge::embedded().expect("embedded table"));
    let mut builder = MapBuilder::new(BuildConfig::default(), knowledge);
    let mut map = Map::new(0.05);
    for (frame, detections) in frames {
        let update = builder.observe(&map, frame, detections, &Carrier::default());
        map.apply(update);
    }
    let originals: Vec<_> = map.stable_objects().cloned().collect();
    let mut changes = Vec::new();
    for copy in originals.len()..objects {
        let mut object = originals[copy % originals.len()].clone();
        let shift = Vector3::new(8.0 + 3.0 * (copy / originals.len()) as f64, 0.0, 0.0);
        object.id = ObjectId(10_000 + copy as u64);
        object.bounds.center = Translation3::from(shift) * object.bounds.center;
        object.points.iter_mut().for_each(|p| p.position = Translation3::from(shift.cast::<f32>()) * p.position);
        changes.push(MapChange::Put(Box::new(object)));
    }
    map.apply(MapUpdate { stamp: map.stamp, changes });
    (map, builder)
}

fn update(criterion: &mut Criterion) {
    let frames = frames(&cluttered_room());
    let count = frames.iter().map(|(_, d)| d.items.len()).sum::<usize>() / frames.len();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    for objects in [20, 500, 10_000] {
        let (mut map, mut builder) = grown(&frames, objects);
        let mut next = 0;
        criterion.bench_function(&format!("observe_640x480_{count}_detections_{objects}_objects"), |bencher| {
            pool.install(|| {
                bencher.iter(|| {
                    let (frame, detections) = &frames[next % frames.len()];
                    let mut frame = frame.clone();
                    next += 1;
                    frame.stamp = dsm::time::Stamp::from_s(2.0 + next as f64 * 0.2);
                    let update = builder.observe(&map, &frame, detections, &Carrier::default());
                    map.apply(update)
                });
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).measurement_time(std::time::Duration::from_secs(5));
    targets = update
}
criterion_main!(benches);
