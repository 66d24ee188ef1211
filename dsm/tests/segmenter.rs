//! Contract of the embedded segmenter: things that stand apart get a mask each, floor and walls none; the same image gives
//! the same masks for any number of threads; broken images give no panic. It sees neither labels nor names.

mod world;

use dsm::camera::CameraModel;
use dsm::frame::RgbdFrame;
use dsm::perceive::{Detection, Detections, Detector, Mask, PixelSegmenter, UNNAMED};
use std::collections::BTreeSet;
use world::{Noise, Session, World, look_at};

fn kitchen() -> World {
    World::default()
        .with_room([-2.5, -2.5], [2.5, 2.5])
        .with("dining table", [0.0, 0.0, 0.375], [1.4, 0.8, 0.75], [160, 110, 70])
        .with("mug", [-0.4, -0.1, 0.80], [0.09, 0.09, 0.10], [200, 40, 40])
        .with("bowl", [0.0, 0.0, 0.79], [0.16, 0.16, 0.08], [230, 200, 40])
        .with("bottle", [0.4, 0.1, 0.88], [0.08, 0.08, 0.26], [30, 140, 60])
        .with("cabinet", [-1.4, 1.9, 0.45], [0.8, 0.5, 0.9], [60, 80, 150])
}

fn frame(id: u64, angle: f64, noise: bool) -> (RgbdFrame, Detections) {
    let pose = look_at([1.9 * angle.cos(), 1.9 * angle.sin(), 1.35], [0.0, 0.1, 0.6]);
    let noise = Noise { depth: noise, seed: 5, ..Noise::default() };
    kitchen().render(CameraModel::from_vertical_fov(640, 480, 0.9), id, id as f64 * 0.2, pose, noise)
}

fn iou(a: &Mask, b: &Mask) -> f64 {
    let (a, b): (BTreeSet<usize>, BTreeSet<usize>) = (a.pixels().collect(), b.pixels().collect());
    a.intersection(&b).count() as f64 / a.union(&b).count() as f64
}

/// Names of the true things that a mask shows, and how many masks show none.
fn compare(found: &[Detection], truth: &Detections) -> (Vec<String>, usize) {
    let shows = |mask: &Detection, thing: &Detection| iou(&mask.mask, &thing.mask) >= 0.5;
    let known = truth.items.iter().filter(|thing| found.iter().any(|mask| shows(mask, thing)));
    let wrong = found.iter().filter(|mask| !truth.items.iter().any(|thing| shows(mask, thing))).count();
    (known.map(|thing| thing.name.clone()).collect(), wrong)
}

#[test]
fn things_get_a_mask_each_and_walls_none() {
    for noise in [false, true] {
        let (frame, truth) = frame(0, -1.2, noise);
        let found = PixelSegmenter.detect(&frame);
        assert_eq!(found.frame, frame.id);
        let (names, wrong) = compare(&found.items, &truth);
        assert_eq!(names, ["dining table", "mug", "bowl", "bottle", "cabinet"], "noise {noise}");
        assert!(wrong <= 1, "noise {noise}: {wrong} of {} masks show no thing", found.items.len());
        assert!(found.items.iter().all(|item| item.name == UNNAMED && (0.0..=1.0).contains(&item.score)));
        // No pixel belongs to two.
        let all: usize = found.items.iter().map(|item| item.mask.area()).sum();
        let set: BTreeSet<usize> = found.items.iter().flat_map(|item| item.mask.pixels()).collect();
        assert_eq!(all, set.len());
    }
}

#[test]
fn threads_change_nothing() {
    let (frame, _) = frame(3, 0.4, true);
    let many = PixelSegmenter.detect(&frame);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(many, one.install(|| PixelSegmenter.detect(&frame)));
}

#[test]
fn broken_images_show_little_and_do_not_panic() {
    let (good, _) = frame(0, -1.2, true);
    let mut holes = good.clone();
    holes.depth_m.iter_mut().step_by(3).for_each(|depth| *depth = f32::NAN);
    holes.depth_m.iter_mut().skip(1).step_by(3).for_each(|depth| *depth = f32::INFINITY);
    PixelSegmenter.detect(&holes);
    let mut blind = good.clone();
    blind.depth_m.fill(0.0);
    assert!(PixelSegmenter.detect(&blind).items.is_empty());
    let mut cut = good.clone();
    cut.depth_m.pop();
    assert!(PixelSegmenter.detect(&cut).items.is_empty());
    let mut tiny = good;
    tiny.model = CameraModel::from_vertical_fov(3, 2, 0.9);
    (tiny.color, tiny.depth_m) = (vec![[9; 3]; 6], vec![1.0; 6]);
    assert!(PixelSegmenter.detect(&tiny).items.is_empty());
}

#[test]
fn a_map_grows_from_pixels_alone() {
    let mut session = Session::new(Noise::default());
    for i in 0..14 {
        let (frame, _) = frame(i, -1.9 + 0.1 * i as f64, true);
        let found = PixelSegmenter.detect(&frame);
        let update = session.builder.observe(&session.map, &frame, &found, &Default::default());
        session.map.apply(update);
    }
    let world = kitchen();
    for block in world.blocks.iter().filter(|block| block.name.is_some_and(|name| name != "cabinet")) {
        let truth = block.bounds.into();
        let best = session.map.stable_objects().map(|object| object.bounds.iou(&truth)).fold(0.0, f64::max);
        assert!(best > 0.25, "{:?}: {best:.2}", block.name);
    }
    let count = session.map.stable_objects().count();
    assert!(count <= 9, "{count} objects of 5");
}
