//! Map update at 640x480 with 20 detections on one thread, in maps of 20, 500 and 10 000 objects: the whole update, each of
//! its stages, and the percentiles over many updates.
//!
//! The larger maps are the room in view and as many furnished copies of it beside it, with their floor, rooms and relations:
//! a cost that follows what was ever seen shows.

#[path = "../tests/world/mod.rs"]
mod world;

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::build::{BuildConfig, Carrier, MapBuilder, Stage};
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::knowledge::Knowledge;
use dsm::map::{Map, copy_beside};
use dsm::perceive::Detections;
use dsm::time::Stamp;
use std::sync::Arc;
use std::time::{Duration, Instant};
use world::{Noise, World, look_at};

/// Sizes of the map, objects.
const SIZES: [usize; 3] = [20, 500, 10_000];
/// Updates behind the percentiles: 60 simulated seconds.
const UPDATES: usize = 300;

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

/// Two seconds at 5 Hz, along an arc around the table.
fn frames(world: &World) -> Vec<(RgbdFrame, Detections)> {
    let model = CameraModel::from_vertical_fov(640, 480, 0.9);
    (0..10)
        .map(|i| {
            let angle = -1.9 + 0.08 * i as f64;
            let pose = look_at([2.0 * angle.cos(), 2.0 * angle.sin(), 1.3], [0.0, 0.2, 0.8]);
            let noise = Noise { position_m: 0.01, depth: true, seed: 1, ..Noise::default() };
            world.render(model, i, i as f64 * 0.2, pose, noise)
        })
        .collect()
}

/// A builder with its map while time goes on over the same frames, there and back.
struct Bench<'a> {
    frames: &'a [(RgbdFrame, Detections)],
    map: Map,
    builder: MapBuilder,
    next: u64,
}

impl<'a> Bench<'a> {
    /// The map after all frames, with copies of the room until there are `objects`.
    fn new(frames: &'a [(RgbdFrame, Detections)], objects: usize) -> Self {
        let knowledge = Arc::new(Knowledge::embedded().expect("embedded table"));
        let builder = || MapBuilder::new(BuildConfig::default(), knowledge.clone());
        let mut bench = Self { frames, map: Map::new(0.05), builder: builder(), next: 0 };
        (0..3 * frames.len()).for_each(|_| {
            bench.time();
        });
        bench.map.apply(copy_beside(&bench.map, objects));
        // One that takes up the whole map as it takes up a loaded one.
        bench.builder = builder();
        (0..2 * frames.len()).for_each(|_| {
            bench.time();
        });
        bench
    }

    /// The next frame, with the number and stamp that it has now.
    fn next_frame(&mut self) -> (RgbdFrame, Detections) {
        let count = self.frames.len() as u64;
        // There and back: a camera that jumps would be another case.
        let turn = self.next % (2 * count);
        let (frame, detections) = &self.frames[turn.min(2 * count - 1 - turn) as usize];
        let (id, stamp) = (FrameId(self.next), Stamp::from_s(self.next as f64 * 0.2));
        self.next += 1;
        let frame = RgbdFrame { id, stamp, ..frame.clone() };
        (frame, Detections { frame: id, items: detections.items.clone() })
    }

    /// One update, from the frame to the changed map: its time and that of each stage; applying is the last.
    #[allow(clippy::disallowed_methods)]
    fn time(&mut self) -> (Duration, [Duration; Stage::ALL.len() + 1]) {
        let (frame, detections) = self.next_frame();
        let mut stages = [Duration::ZERO; Stage::ALL.len() + 1];
        let begin = Instant::now();
        let mut last = begin;
        let mut ended = |stage: Stage| {
            let now = Instant::now();
            stages[stage as usize] = now - last;
            last = now;
        };
        let carrier = Carrier::default();
        let update = self.builder.observe_in_stages(&self.map, &frame, &detections, &carrier, &mut ended);
        self.map.apply(update);
        stages[Stage::ALL.len()] = last.elapsed();
        (begin.elapsed(), stages)
    }
}

fn update(criterion: &mut Criterion) {
    let frames = frames(&cluttered_room());
    let count = frames.iter().map(|(_, d)| d.items.len()).sum::<usize>() / frames.len();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    for objects in SIZES {
        let mut bench = pool.install(|| Bench::new(&frames, objects));
        criterion.bench_function(&format!("update/{count}_detections_{objects}_objects"), |bencher| {
            bencher.iter_custom(|times| pool.install(|| (0..times).map(|_| bench.time().0).sum()));
        });
        pool.install(|| percentiles(&mut bench, objects));
    }
    let mut bench = pool.install(|| Bench::new(&frames, 500));
    for stage in Stage::ALL {
        criterion.bench_function(&format!("stage/{}_500_objects", stage.name()), |bencher| {
            let mut time = || bench.time().1[stage as usize];
            bencher.iter_custom(|times| pool.install(|| (0..times).map(|_| time()).sum()));
        });
    }
}

/// Prints the median and the 99th percentile of the whole and of each stage.
#[allow(clippy::print_stderr)]
fn percentiles(bench: &mut Bench<'_>, objects: usize) {
    let times: Vec<_> = (0..UPDATES).map(|_| bench.time()).collect();
    let print = |name: &str, values: Vec<Duration>| {
        let mut ms: Vec<f64> = values.iter().map(|time| time.as_secs_f64() * 1e3).collect();
        ms.sort_by(f64::total_cmp);
        let at = |share: f64| ms[((share * ms.len() as f64) as usize).min(ms.len() - 1)];
        eprintln!("  {objects:>6} objects  {name:<12} median {:7.3} ms  p99 {:7.3} ms", at(0.5), at(0.99));
    };
    print("update", times.iter().map(|(whole, _)| *whole).collect());
    for stage in Stage::ALL {
        print(stage.name(), times.iter().map(|(_, stages)| stages[stage as usize]).collect());
    }
    print("apply", times.iter().map(|(_, stages)| stages[Stage::ALL.len()]).collect());
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(3));
    targets = update
}
criterion_main!(benches);
