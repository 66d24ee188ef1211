//! Contract: a map comes back as it was written; a log cut anywhere opens up to its last whole record; a damaged
//! file is an error or a reported loss, never a panic.
use super::super::{decode, load_map};
use super::*;
use crate::frame::FrameId;
use crate::geometry::OrientedBox;
use crate::map::{Attributes, MapPoint, ObjectState, Provenance, Relation, RelationKind, VoteSubject, Votes};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Length of magic, version and cell size. The record behind it, which says that a log begins, comes with it.
const HEADER: usize = 20;

fn object(id: u64, x: f64) -> MapObject {
    let mut names = Votes::default();
    names.add("apple", 3.0);
    MapObject {
        id: ObjectId(id),
        state: ObjectState::Stable,
        names,
        points: vec![MapPoint { position: Point3::new(x as f32, 0.0, 1.0), color: [200, 10, 10] }; 20],
        bounds: OrientedBox {
            center: Point3::new(x, 0.0, 1.0),
            size: Vector3::new(0.1, 0.2, 0.3),
            rotation: UnitQuaternion::from_euler_angles(0.0, 0.0, 0.3),
        },
        attributes: Attributes::default(),
        visual_feature: vec![1.0, 0.0],
        provenance: provenance(x),
        text_feature: vec![0.0, 1.0],
        room: None,
        observations: 4,
        first_seen: Stamp(1),
        last_seen: Stamp(2),
    }
}

/// As many votes as tenths of a metre.
fn provenance(x: f64) -> Provenance {
    let mut provenance = Provenance::default();
    for frame in 0..=(10.0 * x) as u64 {
        provenance.add(VoteSubject::Name, "apple", "simulated", 0.5, FrameId(frame));
    }
    provenance
}

/// A file whose record of votes is damaged still has its objects; one that a reader does not know it skips.
#[test]
fn who_gave_votes_is_kept_in_records_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.dsm");
    let map = applied(&history());
    save_map(&path, &map).unwrap();
    let loaded = load_map(&path).unwrap();
    let credit = loaded.map.find_object(ObjectId(1)).unwrap().provenance.credits()[0].clone();
    assert_eq!((credit.source.as_str(), credit.votes, credit.last), ("simulated", 6, FrameId(5)));
    let mut bytes = std::fs::read(&path).unwrap();
    let first = bytes.windows(5).position(|five| five == [0xD5, b'R', b'E', b'C', 3]).unwrap();
    // A kind that nobody knows, with its checksum: as a reader of version 1.1 sees the record.
    let length = u32::from_le_bytes(bytes[first + 5..first + 9].try_into().unwrap()) as usize;
    bytes[first + 4] = 77;
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[first + 4..first + 9]);
    hasher.update(&bytes[first + 13..first + 13 + length]);
    bytes[first + 9..first + 13].copy_from_slice(&hasher.finalize().to_le_bytes());
    let skipped = decode(&bytes, &path).unwrap();
    assert_eq!((skipped.unknown_records, skipped.loss.as_deref()), (1, None));
    bytes[first + 20] ^= 1;
    let damaged = decode(&bytes, &path).unwrap();
    assert!(damaged.lost_bytes > 0 && damaged.missing_records == 0, "{:?}", damaged.loss);
    for read in [skipped, damaged] {
        assert!(read.map.find_object(ObjectId(1)).unwrap().provenance.is_empty());
        assert_eq!(read.map.find_object(ObjectId(2)), map.find_object(ObjectId(2)));
    }
}

fn update(second: i64, changes: Vec<MapChange>) -> MapUpdate {
    MapUpdate { stamp: Stamp(second * 1_000_000_000), changes }
}

fn put(id: u64, x: f64) -> MapChange {
    MapChange::Put(Box::new(object(id, x)))
}

fn history() -> Vec<MapUpdate> {
    let on = Relation { from: ObjectId(1), to: ObjectId(2), kind: RelationKind::On, confidence: 0.9 };
    vec![
        update(1, vec![put(1, 0.0), put(2, 1.0), MapChange::Cells(vec![([3, -4], CellState::Free)])]),
        update(2, vec![MapChange::Relate { about: vec![ObjectId(1)], relations: vec![on] }, put(3, 2.0)]),
        update(3, vec![MapChange::Remove(ObjectId(3), RemovalReason::Unconfirmed), put(1, 0.5)]),
    ]
}

fn applied(updates: &[MapUpdate]) -> Map {
    let mut map = Map::new(0.05);
    updates.iter().cloned().for_each(|u| {
        map.apply(u);
    });
    map
}

fn log_bytes(folder: &Path) -> Vec<u8> {
    let path = folder.join("log.dsm");
    write_log(&path, usize::MAX);
    std::fs::read(path).unwrap()
}

fn write_log(path: &Path, compact_from_bytes: usize) {
    let mut log = MapLog::create_compacting(path, 0.05, compact_from_bytes).unwrap();
    let mut map = Map::new(0.05);
    for update in history() {
        map.apply(update.clone());
        log.append(update, &map).unwrap();
    }
    log.flush().unwrap();
}

#[test]
fn log_and_whole_map_come_back_equal() {
    let folder = tempfile::tempdir().unwrap();
    let map = applied(&history());
    let logged = decode(&log_bytes(folder.path()), Path::new("log")).unwrap();
    assert_eq!(logged.map, map);
    assert_eq!((logged.records, logged.lost_bytes), (3, 0));
    let path = folder.path().join("map.dsm");
    save_map(&path, &map).unwrap();
    assert_eq!(load_map(&path).unwrap().map, map);
}

#[test]
fn coalesced_updates_have_the_same_effect() {
    let mut map = Map::new(0.05);
    map.apply(coalesce(history()).unwrap());
    assert_eq!(map, applied(&history()));
}

#[test]
fn a_log_cut_anywhere_keeps_its_whole_records() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = log_bytes(folder.path());
    let mut seen = 0;
    for end in 0..bytes.len() {
        match decode(&bytes[..end], Path::new("cut")) {
            Ok(loaded) => {
                assert!(loaded.records >= seen);
                seen = loaded.records;
            }
            Err(_) => assert!(end < HEADER + 13, "the log does not open at byte {end}"),
        }
    }
    assert_eq!(seen, 2);
}

#[test]
fn a_compacted_log_holds_the_same_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.dsm");
    write_log(&path, 1);
    let loaded = load_map(&path).unwrap();
    assert_eq!((loaded.map, loaded.finished, loaded.loss), (applied(&history()), false, None));
    // Two objects and cells, compacted after the first update; it is not yet long enough to be compacted again.
    assert_eq!(loaded.records, 5);
}

#[test]
fn damage_costs_no_more_than_it_hits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.dsm");
    let map = applied(&history());
    save_map(&path, &map).unwrap();
    let whole = std::fs::read(&path).unwrap();
    // The update that puts the second object.
    let updates = whole.windows(5).enumerate().filter(|(_, five)| *five == [0xD5, b'R', b'E', b'C', 0]);
    let second = updates.map(|(at, _)| at).nth(1).unwrap();
    for (at, reason) in [(20, "a checksum is wrong"), (5, "a record is cut off"), (1, "no record begins here")] {
        let mut bytes = whole.clone();
        bytes[second + at] ^= 0x40;
        let loaded = decode(&bytes, &path).unwrap();
        assert_eq!(loaded.map.objects.keys().copied().collect::<Vec<_>>(), [ObjectId(1)], "{reason}");
        assert_eq!(loaded.map.free_space, map.free_space);
        assert_eq!((loaded.missing_records, loaded.lost.len()), (1, 1));
        assert!(loaded.loss.unwrap().contains(reason));
    }
    // Cut between two records: nothing is torn, and yet something is missing.
    let loaded = decode(&whole[..second], &path).unwrap();
    assert_eq!((loaded.lost_bytes, loaded.missing_records, loaded.records), (0, 3, 1));
    assert_eq!(loaded.loss.as_deref(), Some("3 records of the finished map are missing"));
}

#[test]
fn records_of_a_later_minor_version_are_skipped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.dsm");
    let map = applied(&history());
    save_map(&path, &map).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[10] = 7;
    bytes.extend(encode(Kind::Unknown, &"something new"));
    let loaded = decode(&bytes, &path).unwrap();
    assert_eq!((loaded.map, loaded.minor_version, loaded.unknown_records, loaded.loss), (map, 7, 1, None));
}

#[test]
fn a_map_opens_while_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.dsm");
    let log = MapLog::create_compacting(&path, 0.05, 20_000).unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut log = log;
            let mut map = Map::new(0.05);
            for second in 1..200 {
                let update = update(second, vec![put(second as u64 % 40, second as f64)]);
                map.apply(update.clone());
                log.append(update, &map).unwrap();
            }
            done.store(true, Ordering::Relaxed);
        });
        let read = || {
            let mut last = Stamp::default();
            while !done.load(Ordering::Relaxed) {
                let stamp = load_map(&path).unwrap().map.stamp;
                assert!(stamp >= last, "a reader fell back from {last:?} to {stamp:?}");
                last = stamp;
            }
        };
        scope.spawn(read);
        scope.spawn(read);
    });
    assert_eq!(load_map(&path).unwrap().map.stamp, Stamp(199_000_000_000));
}

proptest! {
    #[test]
    fn flipped_bytes_never_panic(position in 0_usize..4000, value: u8) {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = log_bytes(folder.path());
        let position = position % bytes.len();
        bytes[position] = value;
        if let Ok(loaded) = decode(&bytes, Path::new("flipped")) {
            prop_assert!(loaded.records <= 3);
        }
    }
}
