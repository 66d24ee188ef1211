//! Contract: map files of every minor version that was ever written are read, and a file that was damaged or made up is an
//! error or a reported loss: never a panic, and never more memory than a machine has to spare.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its files fails")]

use dsm::store::{decode, load_map, save_map};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Files that are tried.
const FUZZED: usize = 10_000;
/// Set for the process that tries them within little memory.
const CHILD: &str = "DSM_FUZZ_MAPS_CHILD";
/// Length of magic, version and cell size.
const HEADER: usize = 20;

fn kept(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/kept_maps").join(name)
}

/// One file for each minor version and form, written by the program of its time in a room with a table and an apple.
#[test]
fn kept_old_files_are_read() {
    // The old logs end before the apple was seen often enough. Objects, relations and rooms.
    let (table, both) = (&["table"][..], &["table", "apple"][..]);
    for (name, minor, finished, records, wanted, counts) in [
        ("1.0-whole.dsm", 0, true, 1, both, [2, 2, 2]),
        ("1.0-log.dsm", 0, true, 4, table, [2, 0, 1]),
        ("1.1-whole.dsm", 1, true, 5, both, [2, 2, 2]),
        ("1.1-log.dsm", 1, false, 6, table, [2, 0, 1]),
        ("1.2-whole.dsm", 2, true, 5, both, [2, 2, 1]),
        ("1.2-log.dsm", 2, false, 1, both, [2, 2, 2]),
    ] {
        let loaded = load_map(&kept(name)).unwrap();
        assert_eq!((loaded.minor_version, loaded.finished, loaded.records), (minor, finished, records), "{name}");
        assert_eq!((loaded.lost_bytes, loaded.loss.as_deref()), (0, None), "{name}");
        let map = &loaded.map;
        let names: Vec<&str> = map.stable_objects().map(|object| object.name()).collect();
        assert_eq!(names, wanted, "{name}");
        assert_eq!([map.objects.len(), map.relations.len(), map.rooms.len()], counts, "{name}");
        let table = map.stable_objects().next().unwrap();
        assert!((table.bounds.center.x - 1.5).abs() < 0.03 && table.points.len() > 500, "{name}: {:?}", table.bounds);
        assert!(map.free_space.known_cells().count() > 500, "{name}");
        // Since 1.2 it says who gave its votes.
        let credits = table.provenance.credits();
        let namer = credits.iter().find(|credit| credit.word == "table").map(|credit| credit.source.as_str());
        let color = credits.iter().find(|credit| credit.word == "brown").map(|credit| credit.source.as_str());
        let since = (minor >= 2).then_some(("simulated", "knowledge"));
        assert_eq!(namer.zip(color), since, "{name}");
        assert_eq!(credits.is_empty(), minor < 2, "{name}");
        // Written again it is the newest version, and the same map.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.dsm");
        save_map(&path, &loaded.map).unwrap();
        let again = load_map(&path).unwrap();
        assert_eq!((again.minor_version, again.map == loaded.map), (dsm::store::MINOR_VERSION, true), "{name}");
    }
}

/// Cuts a file, flips its bits, or puts hostile numbers anywhere; in half of the cases checksums are made right again, so
/// that what stands inside gets past them.
fn damage(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    let spans = spans(bytes);
    match rng.random_range(0..4) {
        0 => bytes.truncate(rng.random_range(0..bytes.len())),
        1 => {
            for _ in 0..rng.random_range(1..20) {
                let at = rng.random_range(0..bytes.len());
                bytes[at] ^= 1 << rng.random_range(0..8);
            }
        }
        2 => {
            let at = rng.random_range(HEADER..bytes.len() - 10);
            let length = rng.random_range(1..10);
            bytes[at..at + length].fill([0xff, 0x80, 0x7f, 0x00][rng.random_range(0..4)]);
        }
        _ => {
            let at = rng.random_range(0..bytes.len());
            let mut noise = vec![0; rng.random_range(1..60)];
            rng.fill_bytes(&mut noise);
            bytes.splice(at..at, noise);
        }
    }
    if rng.random() {
        let length = bytes.len();
        for (from, to) in spans.into_iter().filter(|(_, to)| *to <= length) {
            let mut hasher = crc32fast::Hasher::new();
            hasher.update(&bytes[from + 4..from + 9]);
            hasher.update(&bytes[from + 13..to]);
            let crc = hasher.finalize().to_le_bytes();
            bytes[from + 9..from + 13].copy_from_slice(&crc);
        }
    }
}

/// First byte of each record and the one after its last.
fn spans(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut spans = Vec::new();
    let mut at = HEADER;
    while at < bytes.len() {
        let length = u32::from_le_bytes(bytes[at + 5..at + 9].try_into().unwrap()) as usize;
        spans.push((at, at + 13 + length));
        at += 13 + length;
    }
    spans
}

fn fuzz() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let originals = ["1.2-whole.dsm", "1.2-log.dsm"].map(|name| std::fs::read(kept(name)).unwrap());
    let (mut opened, mut refused, mut whole) = (0, 0, 0);
    for number in 0..FUZZED {
        let mut bytes = originals[number % 2].clone();
        damage(&mut bytes, &mut rng);
        match decode(&bytes, Path::new("fuzzed")) {
            Ok(loaded) if loaded.loss.is_none() => whole += 1,
            Ok(_) => opened += 1,
            Err(_) => refused += 1,
        }
    }
    assert!(
        opened > FUZZED / 4 && refused > 50 && whole > 50,
        "{opened} with a loss, {refused} refused, {whole} whole"
    );
}

/// In a process of its own that gets one gigabyte of addresses: asking for more ends it.
#[test]
fn ten_thousand_damaged_files_neither_panic_nor_take_memory() {
    if std::env::var_os(CHILD).is_some() {
        return fuzz();
    }
    let program = std::env::current_exe().unwrap();
    let script =
        "ulimit -v 1000000; exec \"$0\" --exact --nocapture ten_thousand_damaged_files_neither_panic_nor_take_memory";
    let output = Command::new("sh")
        .args(["-c", script])
        .arg(program)
        .env(CHILD, "1")
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said} {}", String::from_utf8_lossy(&output.stdout));
}
