//! Time to ground one expression in a map of 500 objects, without and with views.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::Pose;
use dsm::ground::{GroundConfig, Grounder};
use dsm::knowledge::Knowledge;
use dsm::map::Map;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::sync::Arc;

#[path = "../src/ground/tests/hostile.rs"]
mod hostile_texts;
#[path = "large_map/mod.rs"]
mod large_map;

fn bench(c: &mut Criterion) {
    let knowledge = Arc::new(Knowledge::embedded().unwrap());
    let map = large_map::flat(&knowledge);
    let viewer = Pose::translation(1.0, 2.0, 1.2);
    let queries = [
        ("nested", "the apple on the white shelf with white cabinet"),
        ("wildcards", "something next to something between the thing near the object and the item"),
        ("unknown", "the flurb left of the second zork from the right"),
    ];
    for (verify, suffix) in [(false, "without_views"), (true, "with_views")] {
        let config = GroundConfig { verify, ..GroundConfig::default() };
        let grounder = Grounder::new(config, Arc::clone(&knowledge)).unwrap();
        percentiles(&grounder, &map, &knowledge, suffix);
        hostile(&grounder, &map, suffix);
        for (name, text) in queries {
            c.bench_function(&format!("ground_{name}_{suffix}"), |b| {
                b.iter(|| black_box(grounder.ground(&map, text, Some(&viewer))));
            });
        }
    }
}

/// Ways to speak of things, filled with the names of the map.
const PATTERNS: [&str; 10] = [
    "the {a}",
    "the red {a} on the {b}",
    "the {a} next to the {b}",
    "the {a} to the left of the {b} with the {c}",
    "the second {a} from the left",
    "the {a} between the {b} and the {c}",
    "the {a} closest to the {b} that is not white",
    "something to sit on near the {a}",
    "something next to something between the thing near the object and the item",
    "the largest thing behind the {a} and under the {b}",
];

/// Not a rate but a distribution: 300 different queries, one at a time on one thread.
fn percentiles(grounder: &Grounder, map: &Map, knowledge: &Knowledge, label: &str) {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let viewer = Pose::translation(1.0, 2.0, 1.2);
    let mut times_us: Vec<u128> = (0..300)
        .map(|i| {
            let mut name = || knowledge.categories()[rng.random_range(0..knowledge.categories().len())].name.clone();
            let text =
                PATTERNS[i % PATTERNS.len()].replace("{a}", &name()).replace("{b}", &name()).replace("{c}", &name());
            #[allow(clippy::disallowed_methods)]
            let start = std::time::Instant::now();
            black_box(grounder.ground(map, &text, Some(&viewer)));
            start.elapsed().as_micros()
        })
        .collect();
    times_us.sort_unstable();
    let at = |share: usize| times_us[(times_us.len() - 1) * share / 100];
    println!("ground_500_objects_{label}: us p50 {} p95 {} max {}", at(50), at(95), at(100));
}

/// Slowest of 200 texts that nobody should send.
fn hostile(grounder: &Grounder, map: &Map, label: &str) {
    let texts = hostile_texts::hostile();
    let slowest = texts.iter().map(|text| {
        #[allow(clippy::disallowed_methods)]
        let start = std::time::Instant::now();
        black_box(grounder.ground(map, text, None));
        start.elapsed().as_micros()
    });
    println!("ground_500_objects_hostile_{label}: {} texts, us max {}", texts.len(), slowest.max().unwrap());
}

criterion_group! { name = benches; config = Criterion::default().sample_size(20); targets = bench }
criterion_main!(benches);
