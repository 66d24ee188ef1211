//! Contract: for an apple on tables and on shelf boards within the porter's range, planning, placement and inverse
//! kinematics together find a base place from which pregrasp, grasp and lift can be reached without touching furniture.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use dsm::map::{CellState, FreeSpace};
use dsm_robot::control::{IkRequest, find_ik};
use dsm_robot::grasp::{
    Approach, ApproachFrom, GraspConfig, GraspScene, HandConfig, PlacementConfig, find_placements, plan_grasps,
};
use dsm_robot::model::{Obstacle, RobotModel};
use dsm_robot::nav::{Costmap, CostmapConfig, Field};
use nalgebra::{Isometry3, Point2, Point3, Translation3, Vector3};
use std::path::Path;

/// A box of furniture: centre and size, world frame, metres.
struct Piece(Point3<f64>, Vector3<f64>);

fn surface(piece: &Piece) -> Vec<Point3<f64>> {
    let steps = |length: f64| (length / 0.01).ceil() as usize;
    let mut points = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for sign in [-0.5, 0.5] {
            for i in 0..=steps(piece.1[u]) {
                for j in 0..=steps(piece.1[v]) {
                    let mut p = piece.0;
                    p[axis] += sign * piece.1[axis];
                    p[u] += (i as f64 / steps(piece.1[u]) as f64 - 0.5) * piece.1[u];
                    p[v] += (j as f64 / steps(piece.1[v]) as f64 - 0.5) * piece.1[v];
                    points.push(p);
                }
            }
        }
    }
    points
}

/// Best placement's approach, its number of grasps and the number of placements.
fn solve(furniture: &[Piece], apple: Point3<f64>) -> Option<(Approach, usize, usize)> {
    let model = RobotModel::load(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/models/porter"))).unwrap();
    let config = GraspConfig { hand: HandConfig::from_settings(&model.settings.gripper), ..GraspConfig::default() };
    let mut floor = FreeSpace::new(0.05);
    for column in -40..40 {
        for row in -40..40 {
            let at = floor.center_of([column, row]);
            let inside = |piece: &Piece| (0..2).all(|i| (at[i] - piece.0[i]).abs() < 0.5 * piece.1[i]);
            let state = if furniture.iter().any(inside) { CellState::Occupied } else { CellState::Free };
            floor.set([column, row], state);
        }
    }
    let costmap = Costmap::from_free_space(&floor, &CostmapConfig::default());
    let field = Field::from_start(&costmap, &Point2::new(-1.5, 0.0));
    let ball: Vec<_> = (0..600)
        .map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 600.0;
            let (sin, cos) = (2.399_963_2 * f64::from(i)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            apple + Vector3::new(r * cos, r * sin, z) * 0.036
        })
        .collect();
    let obstacles: Vec<_> = furniture.iter().flat_map(surface).collect();
    let scene = GraspScene::from_points(&ball, &obstacles, ApproachFrom::Anywhere).unwrap();
    let plan = plan_grasps(&scene, &config, &|_| Some(1.0));
    let mut start = model.with_gripper_width(model.kinematics.zero(), config.hand.max_aperture_m);
    let seeds: Vec<_> = ["ready_down", "ready_front"].iter().filter_map(|n| model.find_posture(n)).collect();
    start.apply(&seeds[0]);
    let reach = |world_from_base: &Isometry3<f64>, world_from_tool: &Isometry3<f64>| {
        let base_from_world = world_from_base.inverse();
        let boxes: Vec<Obstacle> = furniture
            .iter()
            .map(|piece| Obstacle::still_box(base_from_world * Translation3::from(piece.0.coords), piece.1 * 0.5))
            .collect();
        let base_from_tool = base_from_world * world_from_tool;
        let mut found = seeds.clone();
        for pose in [
            base_from_tool,
            base_from_tool * Translation3::new(0.0, 0.0, -config.pregrasp_m),
            Translation3::new(0.0, 0.0, 0.1) * base_from_tool,
        ] {
            let request =
                IkRequest { obstacles: &boxes, seeds: &found, restarts: 1, margin_m: 0.002, ..IkRequest::new(&start) };
            let values = find_ik(&model, &pose, &request)?;
            found.insert(0, values);
        }
        Some(1.0)
    };
    let placement = PlacementConfig { max_places: 12, ..PlacementConfig::default() };
    let places = find_placements(&plan.candidates, &costmap, &field, &reach, &placement);
    let best = places.first()?;
    Some((plan.candidates[best.grasps[0].0].approach, best.grasps.len(), places.len()))
}

#[test]
fn apples_on_tables_are_reached() {
    for height in [0.45, 0.6, 0.75, 0.9] {
        let table = Piece(Point3::new(0.0, 0.0, height - 0.02), Vector3::new(0.8, 1.2, 0.04));
        let found = solve(&[table], Point3::new(-0.2, 0.1, height + 0.036));
        assert!(found.is_some_and(|(_, grasps, places)| grasps >= 2 && places >= 3), "table of {height} m: {found:?}");
    }
}

#[test]
fn apples_on_shelf_boards_are_reached() {
    for height in [0.45, 0.8, 1.1] {
        let piece = |z: f64| Piece(Point3::new(0.0, 0.0, z), Vector3::new(0.32, 0.9, 0.02));
        let back = Piece(Point3::new(0.17, 0.0, 0.8), Vector3::new(0.02, 0.9, 1.6));
        let side = |y: f64| Piece(Point3::new(0.0, y, 0.8), Vector3::new(0.32, 0.02, 1.6));
        let shelf = [piece(height - 0.01), piece(height + 0.34), back, side(-0.46), side(0.46)];
        let found = solve(&shelf, Point3::new(-0.06, 0.0, height + 0.036));
        assert!(matches!(found, Some((Approach::Frontal | Approach::Angled, ..))), "board at {height} m: {found:?}");
    }
}
