//! Contract: a recording with any byte wrong or any tail missing gives entries and then an end or an error, in bounded memory,
//! and never a panic; whatever it gives before is what was written.

#![cfg(feature = "mcap")]
#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its file fails")]

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::{Detection, Detections, Mask};
use dsm::time::Stamp;
use dsm_robot::recorded::{FrameRead, Period};
use dsm_tasks::mcap_file::{create_run, open_run};
use dsm_tasks::replay::{Entry, Learnt, Noted, Wanted};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::path::Path;

fn frame(number: u64, stamp: Stamp) -> RgbdFrame {
    let model = CameraModel::from_vertical_fov(16, 12, 1.0);
    RgbdFrame {
        id: FrameId(number),
        stamp,
        camera: "head".into(),
        model,
        world_from_camera: Pose::translation(0.1 * number as f64, 1.0 / 3.0, 1.2),
        color: (0..192).map(|i| [i as u8, number as u8, 7]).collect(),
        depth_m: (0..192_u16).map(|i| f32::from(500 + i) / 1000.0).collect(),
    }
}

/// Writes forty periods; gives each entry as text.
fn write(path: &Path) -> Vec<String> {
    let mut file = create_run(path).unwrap();
    let mut told = Vec::new();
    let mut put = |entry: Entry| {
        file.put(&entry).unwrap();
        told.push(format!("{entry:?}"));
        if told.len().is_multiple_of(9) {
            file.flush().unwrap();
        }
    };
    for number in 0..40_u64 {
        let stamp = Stamp(10_000_000 * number as i64);
        let id = FrameId(number);
        if number % 2 == 0 {
            put(Entry::Frame(Box::new(frame(number, stamp))));
        }
        let read = FrameRead { camera: "head".into(), answer: Ok((number % 2 == 0).then_some(id)) };
        put(Entry::Period(Box::new(Period { now: stamp, frames: vec![read], ..Period::default() })));
        if number % 2 == 1 {
            let mask = Mask::from_sorted_pixels(16, [3, 4, 5]);
            let items = vec![Detection { mask, name: "mug".into(), score: 0.7 }];
            let detections = Detections { frame: FrameId(number - 1), items };
            let learnt = Learnt { frame: FrameId(number - 1), stamp, detections, associations: vec![], digest: number };
            put(Entry::Learnt(Box::new(learnt)));
            put(Entry::Noted(Noted { stamp, what: format!("event {number}") }));
        }
    }
    put(Entry::Full(Stamp(400_000_000)));
    file.finish().unwrap();
    told
}

/// Reads as far as it goes: the entries, and whether it ended without an error.
fn read(path: &Path) -> (Vec<String>, bool) {
    let mut source = open_run(path, Wanted::All).unwrap();
    let mut told = Vec::new();
    loop {
        match source.next_entry() {
            Ok(Some(entry)) => told.push(format!("{entry:?}")),
            Ok(None) => return (told, true),
            Err(_) => return (told, false),
        }
        assert!(told.len() < 1000, "it never ends");
    }
}

#[test]
fn damage_is_an_end_or_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let written = write(&path);
    assert_eq!(read(&path), (written.clone(), true));
    let whole = fs::read(&path).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut errors, mut ends) = (0, 0);
    for case in 0..600 {
        let mut bytes = whole.clone();
        if case % 2 == 0 {
            bytes.truncate(rng.random_range(0..whole.len()));
        } else {
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..bytes.len());
                bytes[at] ^= 1 << rng.random_range(0..8);
            }
        }
        fs::write(&path, &bytes).unwrap();
        let (told, ended) = read(&path);
        assert!(told.len() <= written.len());
        // Checksums are there so that nothing else is taken for what was written.
        assert_eq!(told, written[..told.len()], "case {case}");
        *(if ended { &mut ends } else { &mut errors }) += 1;
    }
    assert!(errors > 100 && ends > 100, "{errors} errors, {ends} ends");
}
