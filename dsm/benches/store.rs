//! A map of 10 000 objects: time to open and to write it, its size, and the time to ground one expression in it.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::ground::{GroundConfig, Grounder};
use dsm::knowledge::Knowledge;
use dsm::map::copy_beside;
use dsm::store::{decode, load_map, save_map};
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

#[path = "large_map/mod.rs"]
mod large_map;

fn bench(c: &mut Criterion) {
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    // Twenty flats side by side.
    let mut map = large_map::flat(&knowledge);
    let copies = copy_beside(&map, 10_000);
    map.apply(copies);
    let count = map.stable_objects().count();
    let points: usize = map.stable_objects().map(|object| object.points.len()).sum();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.dsm");
    save_map(&path, &map).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    println!(
        "map of {count} objects: {} bytes, {} an object with {} points",
        bytes.len(),
        bytes.len() / count,
        points / count
    );
    c.bench_function("open_10000_objects", |b| b.iter(|| black_box(load_map(&path).unwrap())));
    c.bench_function("decode_10000_objects", |b| b.iter(|| black_box(decode(&bytes, Path::new("map")).unwrap())));
    c.bench_function("save_10000_objects", |b| b.iter(|| save_map(&path, &map).unwrap()));
    let grounder = Grounder::new(GroundConfig::default(), knowledge).unwrap();
    for (name, text) in [
        ("plain", "the red apple"),
        ("related", "the mug on the table next to the lamp"),
        ("nested", "the apple on the white shelf with white cabinet"),
        ("wildcards", "something next to something between the thing near the object and the item"),
    ] {
        c.bench_function(&format!("ground_10000_objects_{name}"), |b| {
            b.iter(|| black_box(grounder.ground(&map, text, None)));
        });
    }
}

criterion_group! { name = benches; config = Criterion::default().sample_size(10); targets = bench }
criterion_main!(benches);
