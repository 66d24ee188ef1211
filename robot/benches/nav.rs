//! Times of navigation and grasp planning on a flat of 12 x 10 m at 5 cm.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a bench; criterion's macros make undocumented functions"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::map::{CellState, FreeSpace};
use dsm_robot::grasp::{ApproachFrom, GraspConfig, GraspScene, plan_grasps};
use dsm_robot::nav::{
    Costmap, CostmapConfig, Field, FrontierConfig, FrontierMemory, NavConfig, Pose2, SpeedLimits, find_frontiers,
    find_path,
};
use nalgebra::{Point2, Point3};
use std::hint::black_box;

/// Six rooms with doors of 0.8 m and tables; the last room is unknown.
fn flat() -> FreeSpace {
    let mut grid = FreeSpace::new(0.05);
    for column in 0..=240_i32 {
        for row in 0..=200_i32 {
            let border = column == 0 || column == 240 || row == 0 || row == 200;
            let wall = column % 80 == 0 && !(42..58).contains(&(row % 100))
                || row == 100 && !(32..48).contains(&(column % 80));
            let table = (20..40).contains(&(column % 80)) && (66..78).contains(&(row % 100));
            let state = if border || wall || table { CellState::Occupied } else { CellState::Free };
            if column < 165 || row < 105 {
                grid.set([column, row], state);
            }
        }
    }
    grid
}

/// A grid of 2000 x 2000 cells with a fifth of it occupied by squares, as the usual comparison of A* libraries has it: the
/// base is one cell wide.
fn large() -> Costmap {
    const SIDE: i32 = 2000;
    let mut state = 20_260_u64;
    let mut draw = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % below) as i32
    };
    let mut grid = FreeSpace::new(0.05);
    grid.set([0, 0], CellState::Free);
    grid.set([SIDE - 1, SIDE - 1], CellState::Free);
    grid.cells.fill(CellState::Free);
    for _ in 0..2200 {
        let (column, row, side) = (draw(1950) + 10, draw(1950) + 10, draw(25) + 5);
        for x in column..(column + side).min(SIDE - 5) {
            for y in row..(row + side).min(SIDE - 5) {
                grid.set([x, y], CellState::Occupied);
            }
        }
    }
    let config =
        CostmapConfig { footprint_radius_m: 0.05, margin_m: 0.0, inflation_m: 0.0, ..CostmapConfig::default() };
    Costmap::from_free_space(&grid, &config)
}

fn large_grid(criterion: &mut Criterion) {
    let costmap = large();
    let (start, goal) = (Point2::new(0.1, 0.1), Point2::new(99.9, 99.9));
    let field = Field::from_start(&costmap, &start);
    let path = find_path(&costmap, &start, &goal).unwrap();
    // The estimate costs nothing of the optimum: the search without one finds a way of the same length.
    let from_field = field.find_path(&costmap, &goal).unwrap();
    assert!((path.length_m - from_field.length_m).abs() < 0.02 * path.length_m);
    eprintln!("A*: {:.2} m; by Dijkstra's field {:.2} m", path.length_m, from_field.length_m);
    criterion.bench_function("A*, 2000 x 2000", |b| b.iter(|| find_path(&costmap, black_box(&start), &goal)));
    criterion.bench_function("Dijkstra, 2000 x 2000", |b| b.iter(|| Field::from_start(&costmap, black_box(&start))));
}

fn navigation(criterion: &mut Criterion) {
    let floor = flat();
    let config = NavConfig::default();
    let costmap = Costmap::from_free_space(&floor, &config.costmap);
    let (start, goal) = (Point2::new(1.0, 1.0), Point2::new(7.0, 9.0));
    let field = Field::from_start(&costmap, &start);
    criterion.bench_function("costmap", |b| {
        b.iter(|| Costmap::from_free_space(black_box(&floor), &CostmapConfig::default()));
    });
    criterion.bench_function("path", |b| b.iter(|| find_path(&costmap, black_box(&start), &goal)));
    criterion.bench_function("field", |b| b.iter(|| Field::from_start(&costmap, black_box(&start))));
    criterion.bench_function("path from field", |b| b.iter(|| field.find_path(&costmap, black_box(&goal))));
    let memory = FrontierMemory::default();
    criterion.bench_function("frontiers", |b| {
        b.iter(|| find_frontiers(&costmap, &field, &memory, black_box(&FrontierConfig::default())));
    });
    let mut follower = dsm_robot::nav::Follower::new(config.follower, field.find_path(&costmap, &goal).unwrap());
    let pose = Pose2 { position: start, yaw_rad: 0.5 }.to_pose();
    criterion.bench_function("follower tick", |b| {
        b.iter(|| {
            follower.tick(black_box(&pose), dsm_robot::drivers::Twist::default(), &costmap, &SpeedLimits::NONE, 0.01)
        });
    });
}

/// A ball of 7 cm on a board of 1 x 0.5 m, points every 5 mm.
fn grasping(criterion: &mut Criterion) {
    let center = Point3::new(1.0, 0.0, 0.735);
    let golden = 2.399_963_229_728_653;
    let ball: Vec<_> = (0..600)
        .map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 600.0;
            let (sin, cos) = (golden * f64::from(i)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            center + nalgebra::Vector3::new(r * cos, r * sin, z) * 0.035
        })
        .collect();
    let board: Vec<_> = (0..20_000)
        .map(|i| Point3::new(0.75 + f64::from(i % 100) * 0.005, f64::from(i / 100) * 0.005 - 0.5, 0.7))
        .collect();
    let from = ApproachFrom::Base(Point2::new(0.3, 0.0));
    criterion.bench_function("grasp scene", |b| {
        b.iter(|| GraspScene::from_points(black_box(&ball), &board, from));
    });
    let scene = GraspScene::from_points(&ball, &board, from).unwrap();
    criterion.bench_function("grasp plan", |b| {
        b.iter(|| plan_grasps(black_box(&scene), &GraspConfig::default(), &|_| Some(1.0)));
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = navigation, large_grid, grasping
}
criterion_main!(benches);
