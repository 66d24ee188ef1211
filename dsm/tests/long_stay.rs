//! Contract: a camera that stays in one place for long makes no larger map and no larger builder, whatever its noise.

mod world;

use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::Detections;
use dsm::time::Stamp;
use world::{Noise, Session, World, look_at};

/// Frames a second.
const RATE: u64 = 5;
/// Different frames; they come again with new numbers and stamps.
const FRAMES: u64 = 60;

fn kitchen() -> World {
    World::default()
        .with_room([-2.5, -2.5], [2.5, 2.5])
        .with("dining table", [0.0, 0.0, 0.375], [1.4, 0.8, 0.75], [160, 110, 70])
        .with("mug", [-0.3, -0.1, 0.80], [0.08, 0.08, 0.10], [200, 40, 40])
        .with("mug", [-0.1, -0.1, 0.80], [0.08, 0.08, 0.10], [200, 40, 40])
        .with("bowl", [0.2, 0.0, 0.79], [0.16, 0.16, 0.08], [230, 200, 40])
        .with("bottle", [0.45, 0.1, 0.88], [0.08, 0.08, 0.26], [30, 140, 60])
        .with("chair", [0.3, -0.7, 0.42], [0.42, 0.42, 0.84], [150, 60, 40])
        .with("cabinet", [-1.2, 2.1, 0.45], [0.8, 0.5, 0.9], [200, 190, 170])
}

/// What the camera sees while its head turns to and fro.
fn frames() -> Vec<(RgbdFrame, Detections)> {
    let world = kitchen();
    let noise = Noise { position_m: 0.01, attitude_rad: 0.003, depth: true, detector: true, seed: 3 };
    let model = dsm::camera::CameraModel::from_vertical_fov(160, 120, 0.9);
    let render = |i: u64| {
        let turn = (i as f64 * std::f64::consts::TAU / FRAMES as f64).sin();
        let pose = look_at([1.9, -1.3, 1.25], [0.4 * turn, 0.1 + 0.4 * turn, 0.7]);
        world.render(model, i, i as f64 / RATE as f64, pose, noise)
    };
    (0..FRAMES).map(render).collect()
}

/// Points, relations, and bytes of map and builder after each part of the stay.
fn stay(parts: u64, minutes_each: u64) -> Vec<(usize, usize, usize)> {
    let frames = frames();
    let mut session = Session::new(Noise::default());
    let mut number = 0;
    (0..parts)
        .map(|_| {
            for _ in 0..minutes_each * 60 * RATE {
                let (frame, detections) = &frames[(number % FRAMES) as usize];
                let id = FrameId(number);
                let frame = RgbdFrame { id, stamp: Stamp::from_s(number as f64 / RATE as f64), ..frame.clone() };
                let detections = Detections { frame: id, items: detections.items.clone() };
                let update = session.builder.observe(&session.map, &frame, &detections, &Default::default());
                session.map.apply(update);
                number += 1;
            }
            let points = session.map.objects.values().map(|object| object.points.len()).sum();
            (points, session.map.relations.len(), session.map.held_bytes() + session.builder.held_bytes())
        })
        .collect()
}

fn hold_flat(sizes: &[(usize, usize, usize)]) {
    let most = |of: fn(&(usize, usize, usize)) -> usize, part: &[(usize, usize, usize)]| {
        part.iter().map(of).max().unwrap_or(0) as f64
    };
    let (first, last) = sizes.split_at(sizes.len() / 2);
    for (what, of) in
        [("points", (|s| s.0) as fn(&(usize, usize, usize)) -> usize), ("relations", |s| s.1), ("bytes", |s| s.2)]
    {
        assert!(most(of, last) <= 1.1 * most(of, first), "{what} grow: {sizes:?}");
    }
    assert!(most(|s| s.2, sizes) < 12e6, "one corner of a room: {sizes:?}");
}

#[test]
fn minutes_in_place_do_not_grow_the_map() {
    hold_flat(&stay(4, 1));
}

#[test]
#[ignore = "an hour of simulated time takes a minute"]
fn an_hour_in_place_does_not_grow_the_map() {
    hold_flat(&stay(12, 5));
}
