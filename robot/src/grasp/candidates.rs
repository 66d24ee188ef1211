//! Grasps proposed, tested and ranked.

use super::antipodal::propose_pairs;
use super::cloud::{normals, quantile};
use super::config::GraspConfig;
use super::contact::{find_clearance, measure_contact, put_down};
use super::hand::SweptHand;
use super::scene::{ApproachFrom, GraspScene};
use super::shape::Shape;
use dsm::Pose;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// The kind of an approach, by how steeply it points down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Approach {
    /// More than 64 degrees below the horizontal.
    TopDown,
    /// Between.
    Angled,
    /// Less than 14 degrees below the horizontal.
    Frontal,
}

/// Why a candidate scores as it does; every factor is between 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspScores {
    /// How squarely the pads meet the surface.
    pub antipodality: f64,
    /// Distance of the swept hand from everything else, metres, at most 0.05.
    pub clearance_m: f64,
    /// Share of the two contact sides that was seen: 0, 0.5 or 1.
    pub observed_share: f64,
    /// How near to the object's middle the pads hold it.
    pub centering: f64,
    /// What the reachability test said.
    pub reach: f64,
}

/// A grasp that passed all tests. World frame, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspCandidate {
    /// Pose of the tool when the fingers close: +z approach, +y closing direction.
    pub world_from_tool: Pose,
    /// Width of the object between the pads.
    pub width_m: f64,
    /// Distance between the pads during the approach.
    pub opening_m: f64,
    /// Distance from the tool's origin back to the face that is met first.
    pub front_m: f64,
    /// Kind of approach.
    pub approach: Approach,
    /// Rank, 0 to 1, higher is better.
    pub score: f64,
    /// What the rank is made of.
    pub scores: GraspScores,
}

impl GraspCandidate {
    /// The pose from which the tool moves straight to the grasp.
    pub fn world_from_pregrasp(&self, config: &GraspConfig) -> Pose {
        self.world_from_tool * Translation3::new(0.0, 0.0, -config.pregrasp_m)
    }

    /// The pose to which it lifts.
    pub fn world_from_lift(&self, config: &GraspConfig) -> Pose {
        Translation3::new(0.0, 0.0, config.lift_m) * self.world_from_tool
    }
}

/// Why a proposal was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RejectReason {
    /// Too few points to tell a shape.
    TooFewPoints,
    /// Wider than the hand opens.
    TooWide,
    /// Thinner than the map resolves.
    TooThin,
    /// The fingers can only hold it too far from its middle, because of the support or the palm.
    OffCentre,
    /// An opened finger or the palm would hit the target itself.
    HitsTarget,
    /// The fingers would hit something else.
    FingersCollide,
    /// Palm, wrist or camera would hit something else on the way in.
    PalmCollides,
    /// The arm cannot reach it.
    Unreachable,
}

/// Grasps of a target, best first, and what became of the other proposals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GraspPlan {
    /// Grasps, best first.
    pub candidates: Vec<GraspCandidate>,
    /// How many proposals were dropped for which reason.
    pub rejected: BTreeMap<RejectReason, usize>,
    /// What the target was taken for.
    pub shape: Option<Shape>,
}

/// A grasp before its tests.
pub(crate) struct Proposal {
    pub(crate) world_from_tool: Pose,
    /// Half the width of the shape along the closing direction, metres.
    pub(crate) half_width_m: f64,
    pub(crate) surface_cosine: f64,
    pub(crate) centering: f64,
    pub(crate) preference: f64,
}

/// Proposes grasps from the fitted shape and from pairs of opposite points, drops those that do not fit, collide or are
/// out of reach (`reach` gives 0 to 1 for a tool pose, or `None`), and ranks the rest.
pub fn plan_grasps(scene: &GraspScene, config: &GraspConfig, reach: &dyn Fn(&Pose) -> Option<f32>) -> GraspPlan {
    let mut plan = GraspPlan::default();
    let Some(shape) = Shape::fit(&scene.target, scene.support_z_m) else {
        plan.rejected.insert(RejectReason::TooFewPoints, 1);
        return plan;
    };
    plan.shape = Some(shape);
    let target_normals = normals(&scene.target, 0.016);
    let mut tested = Vec::new();
    let mut reject = |reason| *plan.rejected.entry(reason).or_insert(0) += 1;
    let proposals = propose_from_shape(scene, &shape, config).into_iter();
    for proposal in proposals.chain(propose_pairs(scene, &shape, &target_normals, config).into_iter().map(Ok)) {
        match proposal.and_then(|p| test(scene, &target_normals, p, config)) {
            Ok(candidate) => tested.push(candidate),
            Err(reason) => reject(reason),
        }
    }
    tested.sort_by(|a, b| b.score.total_cmp(&a.score));
    for mut candidate in tested.into_iter().take(config.max_reach_tests) {
        match reach(&candidate.world_from_tool) {
            Some(share) => {
                candidate.scores.reach = f64::from(share).clamp(0.0, 1.0);
                candidate.score *= candidate.scores.reach;
                plan.candidates.push(candidate);
            }
            None => reject(RejectReason::Unreachable),
        }
    }
    plan.candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
    plan.candidates.truncate(config.max_candidates);
    plan
}

/// The tool's rotation from its approach and closing directions (unit, perpendicular).
pub(crate) fn tool_rotation(approach: &Vector3<f64>, closing: &Vector3<f64>) -> UnitQuaternion<f64> {
    let columns = Matrix3::from_columns(&[closing.cross(approach), *closing, *approach]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(columns))
}

/// Approach from the side with a heading and a pitch below the horizontal, and its closing direction: the tool's -x, where
/// the camera sits, points up.
pub(crate) fn side_directions(heading_rad: f64, pitch_rad: f64) -> (Vector3<f64>, Vector3<f64>) {
    let (sin, cos) = heading_rad.sin_cos();
    let flat = pitch_rad.cos();
    (Vector3::new(flat * cos, flat * sin, -pitch_rad.sin()), Vector3::new(-sin, cos, 0.0))
}

/// Headings of side approaches with how much each is liked.
fn headings(scene: &GraspScene, shape: &Shape) -> Vec<(f64, f64)> {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    let wrap = crate::nav::wrap_angle;
    let center = shape.center();
    let own: Vec<f64> = match (shape, scene.from) {
        (Shape::Block { yaw_rad, .. }, _) => (0..4).map(|i| yaw_rad + f64::from(i) * FRAC_PI_2).collect(),
        (_, ApproachFrom::Anywhere) => (0..8).map(|i| f64::from(i) * FRAC_PI_4).collect(),
        (_, ApproachFrom::Base(base)) => {
            let ahead = (center.y - base.y).atan2(center.x - base.x);
            [0.0, 0.4, -0.4, 0.8, -0.8].map(|offset| ahead + offset).to_vec()
        }
    };
    own.into_iter()
        .filter_map(|heading| match scene.from {
            ApproachFrom::Anywhere => Some((heading, 1.0)),
            ApproachFrom::Base(base) => {
                let off = wrap(heading - (center.y - base.y).atan2(center.x - base.x)).abs();
                (off < 1.1).then_some((heading, 1.0 - 0.1 * off))
            }
        })
        .collect()
}

/// How far below their middle tall things are held as well, metres: what tapers to its top slips out there.
const LOWERED_M: f64 = -0.035;
/// Off its balance by this much a hold is worth nothing, metres: two pads hold against sliding but hardly against turning,
/// and what has turned on the way is put down aslant. Sides that let go are worse, so it never counts for all.
const TURNS_M: f64 = 0.0875;
const LEAST_BALANCE: f64 = 0.3;
/// Half the height from which a thing is tall, metres.
const HALF_TALL_M: f64 = 0.06;

fn propose_from_shape(scene: &GraspScene, shape: &Shape, config: &GraspConfig) -> Vec<Result<Proposal, RejectReason>> {
    const SLANT_FOR_BOTH_WAYS: f64 = 0.5;
    let standing = Standing::of(scene, shape);
    let mut proposals = Vec::new();
    let down = -Vector3::z();
    for closing in shape.closing_directions() {
        for closing in [closing, -closing] {
            proposals.push(place(&standing, &down, &closing, 0.0, 1.0, config));
        }
    }
    for (heading, liked) in headings(scene, shape) {
        for &pitch in &config.frontal_pitches_rad {
            let (approach, closing) = side_directions(heading, pitch);
            let preference = liked * if pitch < 0.3 { 0.95 } else { 0.97 };
            let tall = shape.half_extent_m(&Vector3::z()) > HALF_TALL_M;
            let raises_m: &[f64] = if tall { &[0.0, 0.01, LOWERED_M] } else { &[0.0, 0.01] };
            for &extra_raise_m in raises_m {
                proposals.push(place(&standing, &approach, &closing, extra_raise_m, preference, config));
            }
            if pitch > SLANT_FOR_BOTH_WAYS {
                proposals.push(place(&standing, &approach, &-closing, 0.0, 0.98 * preference, config));
            }
        }
    }
    proposals
}

/// A shape on what carries it.
pub(crate) struct Standing<'a> {
    shape: &'a Shape,
    /// Where two pads hold it best: at the height of its centre of mass, for they hold against sliding but hardly against
    /// turning. Never nearer to its ends than a quarter of its height.
    pub(crate) middle: Point3<f64>,
    support_z_m: f64,
}

/// Whether two pads let it turn: tall round things, which they touch along a line. Flat sides hold against it.
fn turns(shape: &Shape) -> bool {
    !matches!(shape, Shape::Block { .. }) && shape.half_extent_m(&Vector3::z()) > HALF_TALL_M
}

impl<'a> Standing<'a> {
    pub(crate) fn of(scene: &GraspScene, shape: &'a Shape) -> Self {
        let mut middle = shape.center();
        if turns(shape) {
            let half_m = shape.half_extent_m(&Vector3::z());
            let up_m = scene.support_z_m + scene.balance_m() - middle.z;
            middle.z += up_m.clamp(-0.5 * half_m, 0.5 * half_m);
        }
        Self { shape, middle, support_z_m: scene.support_z_m }
    }

    /// What a hold at this height is worth, from [`LEAST_BALANCE`] to 1. World frame, metres.
    pub(crate) fn balance(&self, z_m: f64) -> f64 {
        if !turns(self.shape) {
            return 1.0;
        }
        (1.0 - (z_m - self.middle.z).abs() / TURNS_M).max(LEAST_BALANCE)
    }
}

/// Puts the tool at the balanced middle of the shape, back far enough for the palm, and up far enough for the fingers to stay off
/// the support.
fn place(
    standing: &Standing<'_>,
    approach: &Vector3<f64>,
    closing: &Vector3<f64>,
    extra_raise_m: f64,
    preference: f64,
    config: &GraspConfig,
) -> Result<Proposal, RejectReason> {
    const PALM_GAP_M: f64 = 0.012;
    const MIN_HOLD_M: f64 = 0.02;
    let &Standing { shape, middle, support_z_m } = standing;
    let half_depth = shape.half_extent_m(approach) + (middle - shape.center()).dot(approach);
    let half_height = shape.half_extent_m(&Vector3::z());
    let back_m = (half_depth - (config.hand.palm_behind_tool_m - PALM_GAP_M)).max(0.0);
    if back_m > 0.0 && back_m > half_depth - MIN_HOLD_M {
        return Err(RejectReason::OffCentre);
    }
    let half_width_m = shape.half_extent_m(closing);
    let at = middle - approach * back_m;
    let pose = Pose::from_parts(Translation3::from(at.coords), tool_rotation(approach, closing));
    let opening = (2.0 * half_width_m + config.opening_margin_m).min(config.hand.max_aperture_m);
    let lowest = SweptHand::new(opening, config).lowest_finger_z_m(&pose, config);
    let needed_m = support_z_m + config.support_clearance_m - lowest;
    let raise_m = if extra_raise_m < 0.0 { needed_m.max(extra_raise_m) } else { needed_m.max(0.0) + extra_raise_m };
    // What the hand does not do along its approach it must do across it.
    let across = Vector3::z() - approach * approach.z;
    let off_m = raise_m.abs() + back_m * approach.z.abs();
    let share_limit = config.max_raise_share * half_height;
    let limit =
        if matches!(shape, Shape::Sphere { .. }) { share_limit } else { share_limit.max(half_height - MIN_HOLD_M) };
    if off_m > limit {
        return Err(RejectReason::OffCentre);
    }
    let world_from_tool = Translation3::new(0.0, 0.0, raise_m) * pose;
    let depth_share = if approach.z.abs() < 0.9 { back_m / half_depth.max(1e-6) } else { 0.0 };
    // Round things slip out when held above their middle.
    let off_axis = off_m * across.norm().max(approach.z.abs());
    let centering = (1.0 - 0.5 * (off_m / half_height.max(0.01)).min(1.0)) * (1.0 - 0.4 * depth_share);
    Ok(Proposal {
        world_from_tool,
        half_width_m,
        surface_cosine: shape.surface_cosine(off_axis),
        centering: centering * standing.balance(world_from_tool.translation.z),
        preference,
    })
}

/// Measures a proposal against the clouds.
fn test(
    scene: &GraspScene,
    target_normals: &[Option<Vector3<f64>>],
    proposal: Proposal,
    config: &GraspConfig,
) -> Result<GraspCandidate, RejectReason> {
    const MIN_WIDTH_M: f64 = 0.006;
    let hand = &config.hand;
    let contact = measure_contact(scene, target_normals, &proposal, config);
    let width_m = contact.width_m;
    if width_m + config.aperture_margin_m > hand.max_aperture_m {
        return Err(RejectReason::TooWide);
    }
    if width_m < MIN_WIDTH_M {
        return Err(RejectReason::TooThin);
    }
    let world_from_tool = proposal.world_from_tool * Translation3::new(0.0, contact.shift_m, 0.0);
    let tool_from_world = world_from_tool.inverse();
    let opening_m = (width_m + config.opening_margin_m).min(hand.max_aperture_m);
    let swept = SweptHand::new(opening_m, config);
    let own: Vec<Point3<f64>> = scene.target.iter().map(|p| tool_from_world * p).collect();
    let hit = own.iter().filter(|p| swept.finger_distance_m(p) < 0.0 || swept.palm_distance_m(p) < 0.0).count();
    if hit >= 3 && hit * 50 > own.len() {
        return Err(RejectReason::HitsTarget);
    }
    let clearance_m = find_clearance(scene, &tool_from_world, &swept, config)?;
    let front_m = quantile(own.iter().filter(|p| p.x.abs() < 0.02).map(|p| -p.z), 0.95).unwrap_or(0.0);
    let approach_z = (world_from_tool.rotation * Vector3::z()).z;
    let approach = match -approach_z {
        steep if steep > 0.9 => Approach::TopDown,
        steep if steep < 0.25 => Approach::Frontal,
        _ => Approach::Angled,
    };
    let antipodality =
        contact.squareness.map_or(proposal.surface_cosine * 0.9, |measured| 0.5 * (measured + proposal.surface_cosine));
    let score = antipodality
        * contact.grip(config)
        * (0.4 + 0.6 * (clearance_m / 0.03).min(1.0))
        * (0.6 + 0.4 * contact.observed_share)
        * proposal.centering
        * proposal.preference
        * put_down(&world_from_tool, scene.support_z_m, config);
    let scores = GraspScores {
        antipodality,
        clearance_m,
        observed_share: contact.observed_share,
        centering: proposal.centering,
        reach: 1.0,
    };
    Ok(GraspCandidate { world_from_tool, width_m, opening_m, front_m, approach, score, scores })
}

#[cfg(test)]
pub(crate) mod tests;
