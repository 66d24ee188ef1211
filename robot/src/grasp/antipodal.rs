//! Grasps from pairs of opposite surface points, for things that are no simple shape.

use super::candidates::{Proposal, Standing, side_directions, tool_rotation};
use super::config::GraspConfig;
use super::scene::{ApproachFrom, GraspScene};
use super::shape::Shape;
use dsm::Pose;
use nalgebra::{Translation3, Vector3};

/// Pairs of points whose normals oppose each other within the friction cone, with the approaches that suit them best.
pub(crate) fn propose_pairs(
    scene: &GraspScene,
    shape: &Shape,
    normals: &[Option<Vector3<f64>>],
    config: &GraspConfig,
) -> Vec<Proposal> {
    const FIRST_POINTS: usize = 60;
    const MAX_PAIRS: usize = 12;
    const APART_M: f64 = 0.02;
    let cone = config.friction_cone_rad.cos();
    let stride = (scene.target.len() / FIRST_POINTS).max(1);
    let reach = config.hand.max_aperture_m - config.aperture_margin_m;
    let mut pairs = Vec::new();
    for (i, first) in scene.target.iter().enumerate().step_by(stride) {
        let Some(normal) = normals[i] else { continue };
        let opposite = scene.target.iter().zip(normals).filter_map(|(second, other)| {
            let between = second - first;
            let width = between.norm();
            let closing = between / width.max(1e-9);
            let square = (-normal.dot(&closing)).min((*other)?.dot(&closing));
            (width > 0.01 && width < reach && square > cone).then_some((square, closing, width, second))
        });
        if let Some((square, closing, width, second)) = opposite.max_by(|a, b| a.0.total_cmp(&b.0)) {
            pairs.push((square, closing, width, nalgebra::center(first, second)));
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<(f64, Vector3<f64>, f64, nalgebra::Point3<f64>)> = Vec::new();
    for pair in pairs {
        let new = |other: &(f64, Vector3<f64>, f64, nalgebra::Point3<f64>)| {
            (other.3 - pair.3).norm() > APART_M || other.1.dot(&pair.1).abs() < 0.9
        };
        if kept.len() < MAX_PAIRS && kept.iter().all(new) {
            kept.push(pair);
        }
    }
    let standing = Standing::of(scene, shape);
    let mut proposals = Vec::new();
    for (square, closing, width, middle) in kept {
        for (wanted, preference) in approaches(scene, shape, config) {
            // The nearest approach that is perpendicular to the pair.
            let approach = wanted - closing * wanted.dot(&closing);
            if approach.norm() < 0.85 {
                continue;
            }
            let approach = approach.normalize();
            // The camera side, the tool's -x, belongs up.
            let closing = if closing.cross(&approach).z > 1e-6 { -closing } else { closing };
            let lowest = middle.z + config.hand.tip_beyond_tool_m * approach.z.min(0.0);
            if lowest < scene.support_z_m + config.support_clearance_m {
                continue;
            }
            let world_from_tool =
                Pose::from_parts(Translation3::from(middle.coords), tool_rotation(&approach, &closing));
            let off = (middle - standing.middle).norm() / shape.half_extent_m(&Vector3::z()).max(0.02);
            proposals.push(Proposal {
                world_from_tool,
                half_width_m: 0.5 * width,
                surface_cosine: square,
                centering: (1.0 - 0.4 * off).clamp(0.2, 1.0) * standing.balance(middle.z),
                preference: 0.95 * preference,
            });
        }
    }
    proposals
}

fn approaches(scene: &GraspScene, shape: &Shape, config: &GraspConfig) -> Vec<(Vector3<f64>, f64)> {
    let mut wanted = vec![(-Vector3::z(), 1.0)];
    if let ApproachFrom::Base(base) = scene.from {
        let to = shape.center().xy() - base;
        let heading = to.y.atan2(to.x);
        wanted.extend(config.frontal_pitches_rad.iter().map(|&pitch| (side_directions(heading, pitch).0, 0.96)));
    }
    wanted
}

#[cfg(test)]
mod tests {
    //! Contract: pairs lie on opposite sides of a box and are perpendicular to the approach.
    use super::*;
    use crate::grasp::candidates::tests::block;
    use crate::grasp::cloud::normals;
    use nalgebra::Point3;

    #[test]
    fn pairs_oppose_each_other() {
        let center = Point3::new(1.0, 0.0, 0.8);
        let target = block(center, Vector3::new(0.06, 0.16, 0.2), 0.3, 0.002, 4000, 2);
        let scene = GraspScene::from_points(&target, &[], ApproachFrom::Anywhere).unwrap();
        let shape = Shape::fit(&scene.target, scene.support_z_m).unwrap();
        let normals = normals(&scene.target, 0.016);
        let proposals = propose_pairs(&scene, &shape, &normals, &GraspConfig::default());
        assert!(!proposals.is_empty());
        let short = Vector3::new(0.3_f64.cos(), 0.3_f64.sin(), 0.0);
        for proposal in proposals {
            assert!((proposal.world_from_tool.rotation * Vector3::y()).dot(&short).abs() > 0.93);
            assert!((proposal.half_width_m - 0.03).abs() < 0.008);
        }
    }
}
