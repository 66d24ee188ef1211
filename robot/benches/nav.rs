//! Times of navigation and grasp planning on a flat of 12 x 10 m at 5 cm.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench; criterion's macros make undocumented functions")]

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
    targets = navigation, grasping
}
criterion_main!(benches);
