//! Time of ten simulated seconds of exploring, everything included: physics, cameras, perception, mapping, planning.
#![allow(missing_docs, reason = "the macros of criterion write undocumented functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use dsm_tasks::episode::Episode;
use dsm_tasks::run::{RunSpec, Silent, run_episode};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const SIMULATED_S: f64 = 10.0;

fn bench(criterion: &mut Criterion) {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment/scene.xml");
    let spec = RunSpec { seed: 1, ..RunSpec::new("bench", Episode::exploration(scene, SIMULATED_S)) };
    let mut group = criterion.benchmark_group("episode");
    group.sample_size(10);
    group.bench_function("explore_10_s", |bencher| {
        bencher.iter(|| run_episode(&spec, None, Arc::new(AtomicBool::new(false)), Box::new(Silent)).expect("it runs"));
    });
    group.finish();
}

criterion_group!(episode, bench);
criterion_main!(episode);
