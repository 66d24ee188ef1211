//! Re-centring a chosen grasp on a fresh cloud, just before the fingers move in.

use super::candidates::GraspCandidate;
use super::cloud::{find_clusters, mean, quantile, thin};
use super::config::GraspConfig;
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};

/// What a fresh look says about a grasp.
#[derive(Clone, Debug, PartialEq)]
pub enum Refinement {
    /// The grasp on the fresh cloud.
    Refined {
        /// The moved grasp.
        grasp: GraspCandidate,
        /// How far it moved, metres.
        shift_m: f64,
    },
    /// Nothing of fitting size is there.
    NotSeen,
    /// What is there lies farther off than a re-centring may bridge: plan anew.
    Moved {
        /// How far, metres.
        shift_m: f64,
    },
    /// It is wider than the hand opens.
    TooWide {
        /// Width along the closing direction, metres.
        width_m: f64,
    },
}

/// Re-centres `grasp` on `points_in_world`, the fresh points of the wrist camera around the target (support and neighbours
/// may be among them). Along the closing direction and the tool's x the middle of the cluster counts, along the approach
/// its front face, because only that is seen.
pub fn refine_grasp(
    grasp: &GraspCandidate,
    points_in_world: &[Point3<f64>],
    support_z_m: f64,
    config: &GraspConfig,
) -> Refinement {
    const SUPPORT_NOISE_M: f64 = 0.010;
    const SEARCH_M: f64 = 0.08;
    let around = 0.5 * grasp.width_m + SEARCH_M;
    let tool_from_world = grasp.world_from_tool.inverse();
    let support_z_m = find_support_z_m(points_in_world, support_z_m);
    let near: Vec<Point3<f64>> = points_in_world
        .iter()
        .filter(|p| p.z > support_z_m + SUPPORT_NOISE_M)
        .map(|p| tool_from_world * p)
        .filter(|p| p.x.abs() < around && p.y.abs() < around && p.z.abs() < around + config.hand.palm_behind_tool_m)
        .collect();
    let near = thin(&near, 0.004);
    let first = refine_joined(grasp, &near, &JOINS[0], config);
    if !matches!(first, Refinement::TooWide { .. }) {
        return first;
    }
    // Too much was taken for one thing: the side of a shelf stands a finger's width from the cup in it.
    let mut strictly = JOINS[1..].iter().map(|join| refine_joined(grasp, &near, join, config));
    strictly.find(|refined| matches!(refined, Refinement::Refined { .. })).unwrap_or(first)
}

/// What counts as one thing in a fresh cloud.
struct Join {
    /// Largest step between its points, metres.
    step_m: f64,
    /// What a step along the line of sight counts: sides that run along it are not seen, and steps along it join what is
    /// one thing.
    along_sight: f64,
}

/// From generous to strict; points are 4 mm apart.
const JOINS: [Join; 3] = [
    Join { step_m: 0.009, along_sight: 0.35 },
    Join { step_m: 0.009, along_sight: 1.0 },
    Join { step_m: 0.0065, along_sight: 1.0 },
];

/// Re-centres on the cluster of `near` (tool frame, without the support) that lies where the pads will be.
fn refine_joined(grasp: &GraspCandidate, near: &[Point3<f64>], join: &Join, config: &GraspConfig) -> Refinement {
    const MIN_POINTS: usize = 12;
    const MAX_SHIFT_M: f64 = 0.08;
    let tool_from_world = grasp.world_from_tool.inverse();
    // The cluster whose middle lies nearest to where the pads will be.
    let flat: Vec<Point3<f64>> = near.iter().map(|p| Point3::new(p.x, p.y, join.along_sight * p.z)).collect();
    let chosen = find_clusters(&flat, join.step_m)
        .into_iter()
        .filter(|cluster| cluster.len() >= MIN_POINTS)
        .map(|cluster| cluster.into_iter().map(|i| near[i]).collect::<Vec<_>>())
        .filter_map(|members| Some((mean(&members)?.coords.xy().norm(), members)))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, members)) = chosen else { return Refinement::NotSeen };
    let up_in_tool = tool_from_world.rotation * Vector3::z();
    // From above, turning the hand costs nothing: around a handle, or square to a box.
    let turns: &[f64] = if up_in_tool.z.abs() > 0.95 { &TURNS_RAD } else { &TURNS_RAD[..1] };
    let fits = turns.iter().filter_map(|&turn_rad| Some((turn_rad, fit(&members, turn_rad, config)?)));
    let narrowest = fits.min_by(|a, b| {
        let cost = |fit: &(f64, Fit)| fit.1.width_m + TURN_COST_M_PER_RAD * fit.0.abs();
        cost(a).total_cmp(&cost(b))
    });
    let Some((turn_rad, fit)) = narrowest else { return Refinement::NotSeen };
    let front = fit.front_m.unwrap_or(grasp.front_m);
    let tool_from_turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn_rad);
    // Upright things keep their height: the support hides how far down they reach.
    let mut shift = tool_from_turned * Vector3::new(fit.middle_x_m, fit.middle_y_m, grasp.front_m - front);
    shift -= up_in_tool * shift.dot(&up_in_tool);
    let shift_m = shift.norm();
    if shift_m > MAX_SHIFT_M {
        return Refinement::Moved { shift_m };
    }
    let width_m = fit.width_m;
    if width_m + config.aperture_margin_m > config.hand.max_aperture_m {
        return Refinement::TooWide { width_m };
    }
    let mut refined = grasp.clone();
    refined.world_from_tool = grasp.world_from_tool * Translation3::from(shift) * tool_from_turned;
    refined.width_m = width_m;
    refined.opening_m = (width_m + config.opening_margin_m).max(grasp.opening_m).min(config.hand.max_aperture_m);
    refined.front_m = front + shift.z;
    Refinement::Refined { grasp: refined, shift_m }
}

/// Height of the support in the fresh points: where most of them lie, near the height known from afar. A support that is
/// taken too low joins the target with all that stands around it.
fn find_support_z_m(points_in_world: &[Point3<f64>], known_z_m: f64) -> f64 {
    const REACH_M: f64 = 0.03;
    const BIN_M: f64 = 0.004;
    const BINS: usize = 16;
    const MIN_POINTS: usize = 60;
    let mut counts = [0_usize; BINS];
    for point in points_in_world {
        let bin = ((point.z - known_z_m + REACH_M) / BIN_M).floor();
        if (0.0..BINS as f64).contains(&bin) {
            counts[bin as usize] += 1;
        }
    }
    let fullest = (0..BINS).max_by_key(|&bin| (counts[bin], bin)).filter(|&bin| counts[bin] >= MIN_POINTS);
    fullest.map_or(known_z_m, |bin| known_z_m - REACH_M + (bin as f64 + 0.5) * BIN_M)
}

/// Turns of the hand that are tried from above, radians.
const TURNS_RAD: [f64; 9] = [0.0, 0.26, -0.26, 0.52, -0.52, 0.79, -0.79, 1.05, -1.05];
/// A turn must make the grasp narrower by so much, metres per radian.
const TURN_COST_M_PER_RAD: f64 = 0.012;

/// A cluster as the turned hand would hold it, in the turned tool frame.
struct Fit {
    middle_x_m: f64,
    middle_y_m: f64,
    width_m: f64,
    front_m: Option<f64>,
}

fn fit(members: &[Point3<f64>], turn_rad: f64, config: &GraspConfig) -> Option<Fit> {
    let (sin, cos) = turn_rad.sin_cos();
    let turned: Vec<Point3<f64>> =
        members.iter().map(|p| Point3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z)).collect();
    let range = |values: Vec<f64>| Some((quantile(values.iter().copied(), 0.015)?, quantile(values, 0.985)?));
    let half_slab = 0.5 * config.hand.finger_width_m + 0.005;
    let (x_low, x_high) = range(turned.iter().map(|p| p.x).collect())?;
    let middle_x_m = 0.5 * (x_low + x_high);
    let slab: Vec<&Point3<f64>> = turned.iter().filter(|p| (p.x - middle_x_m).abs() < half_slab).collect();
    let (y_low, y_high) = range(slab.iter().map(|p| p.y).collect())?;
    Some(Fit {
        middle_x_m,
        middle_y_m: 0.5 * (y_low + y_high),
        width_m: y_high - y_low,
        front_m: quantile(slab.iter().map(|p| -p.z), 0.95),
    })
}

#[cfg(test)]
mod tests {
    //! Contract: a grasp planned 2 cm off is brought within 8 mm of the truth; neighbours and the support do not pull it;
    //! an empty place and a far thing are told apart.
    use super::*;
    use crate::grasp::candidates::tests::{block, seen_from, sphere};
    use crate::grasp::{ApproachFrom, GraspScene, plan_grasps};
    use nalgebra::Point2;

    fn planned(center: Point3<f64>) -> Vec<GraspCandidate> {
        let points = sphere(center, 0.036, 0.003, 1500, 1);
        let from = ApproachFrom::Base(Point2::new(0.3, 0.0));
        let scene = GraspScene::from_points(&points, &[], from).unwrap();
        plan_grasps(&scene, &GraspConfig::default(), &|_| Some(1.0)).candidates
    }

    #[test]
    fn is_pulled_onto_the_target() {
        let config = GraspConfig::default();
        let planned_at = Point3::new(1.0, 0.0, 0.736);
        let truth = planned_at + Vector3::new(0.012, -0.016, 0.0);
        let mut fresh = sphere(truth, 0.036, 0.002, 2500, 7);
        // The support and a neighbour 4 cm beside it.
        fresh.extend(block(Point3::new(1.0, 0.0, 0.695), Vector3::new(0.6, 0.6, 0.01), 0.0, 0.002, 9000, 8));
        fresh.extend(sphere(truth + Vector3::new(0.0, 0.112, 0.0), 0.036, 0.002, 2500, 9));
        for grasp in planned(planned_at) {
            let approach = grasp.world_from_tool.rotation * Vector3::z();
            let seen = seen_from(&fresh, &truth, -approach, -0.012);
            match refine_grasp(&grasp, &seen, 0.7, &config) {
                Refinement::Refined { grasp: refined, shift_m } => {
                    let off = refined.world_from_tool.inverse_transform_point(&truth);
                    let was = grasp.world_from_tool.inverse_transform_point(&planned_at);
                    assert!(off.y.abs() < 0.008, "{off:?} for {grasp:?}");
                    assert!((off - was).norm() < 0.015 && shift_m < 0.04, "{off:?}, planned {was:?}");
                    assert!((refined.width_m - 0.072).abs() < 0.016);
                }
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn a_support_known_too_low_does_not_join_the_target_with_its_surroundings() {
        let config = GraspConfig::default();
        let planned_at = Point3::new(1.0, 0.0, 0.736);
        let truth = planned_at + Vector3::new(0.0, 0.03, 0.0);
        let mut fresh = sphere(truth, 0.036, 0.002, 2500, 7);
        fresh.extend(block(Point3::new(1.0, 0.0, 0.695), Vector3::new(0.6, 0.6, 0.01), 0.0, 0.002, 9000, 8));
        let down = planned(planned_at).into_iter().find(|g| (g.world_from_tool.rotation * Vector3::z()).z < -0.95);
        let grasp = down.expect("a grasp from above");
        let seen = seen_from(&fresh, &truth, Vector3::z(), -0.012);
        let Refinement::Refined { grasp: refined, .. } = refine_grasp(&grasp, &seen, 0.7 - 0.018, &config) else {
            panic!("not refined")
        };
        let off = refined.world_from_tool.inverse_transform_point(&truth);
        assert!(off.xy().coords.norm() < 0.008, "{off:?}");
    }

    #[test]
    fn the_side_of_a_shelf_is_no_part_of_the_cup() {
        let config = GraspConfig::default();
        let center = Point3::new(1.0, 0.0, 0.736);
        let frontal = planned(center).into_iter().find(|g| (g.world_from_tool.rotation * Vector3::z()).z > -0.8);
        let grasp = frontal.expect("a grasp from the side");
        let approach = grasp.world_from_tool.rotation * Vector3::z();
        // A panel right behind the cup as the camera sees it, wider than the hand opens.
        let yaw = approach.y.atan2(approach.x);
        let behind = center + approach.xy().normalize().push(0.0) * 0.06;
        let mut fresh = sphere(center, 0.036, 0.001, 4000, 7);
        fresh.extend(block(behind, Vector3::new(0.004, 0.6, 0.3), yaw, 0.001, 60000, 8));
        let Refinement::Refined { grasp: refined, .. } = refine_grasp(&grasp, &fresh, 0.7, &config) else {
            panic!("{:?}", refine_grasp(&grasp, &fresh, 0.7, &config))
        };
        assert!((refined.width_m - 0.072).abs() < 0.016, "{}", refined.width_m);
    }

    #[test]
    fn tells_gone_and_moved_apart() {
        let config = GraspConfig::default();
        let center = Point3::new(1.0, 0.0, 0.736);
        let grasp = &planned(center)[0];
        assert_eq!(refine_grasp(grasp, &[], 0.7, &config), Refinement::NotSeen);
        let far = sphere(center + Vector3::new(0.0, 0.11, 0.0), 0.036, 0.002, 2500, 7);
        let far = refine_grasp(grasp, &far, 0.7, &config);
        assert!(matches!(far, Refinement::Moved { .. } | Refinement::NotSeen), "{far:?}");
    }
}
