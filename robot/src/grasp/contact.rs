//! What the clouds say about one proposal: where the fingers meet the target, what the hand would touch, and whether the
//! thing can be put down again.

use super::candidates::{Proposal, RejectReason};
use super::cloud::quantile;
use super::config::GraspConfig;
use super::hand::SweptHand;
use super::scene::GraspScene;
use dsm::Pose;
use nalgebra::{Point3, Vector3};

/// How well the thing can be put down again in this hold, 0 to 1: a palm that is as low as the support lets it down only
/// where it hangs over an edge.
pub(super) fn put_down(world_from_tool: &Pose, support_z_m: f64, config: &GraspConfig) -> f64 {
    /// Distance that the palm keeps from a surface on the way down, and how far surfaces are off, metres.
    const GAP_M: f64 = 0.02;
    const OVER_AN_EDGE: f64 = 0.6;
    let face = |x_m: f64| world_from_tool * Point3::new(x_m, 0.0, -config.hand.palm_behind_tool_m);
    let half_m = 0.5 * config.hand.palm_thickness_m;
    let lowest_m = face(half_m).z.min(face(-half_m).z);
    if lowest_m < support_z_m + GAP_M { OVER_AN_EDGE } else { 1.0 }
}

/// What the cloud says about the slab that the fingers close on.
pub(super) struct Contact {
    pub(super) width_m: f64,
    /// Where the middle between the contact sides lies along the tool's y.
    pub(super) shift_m: f64,
    pub(super) observed_share: f64,
    /// Mean cosine between normals at the contact sides and the closing direction; `None` without normals there.
    pub(super) squareness: Option<f64>,
    /// Mean vertical component of the outward normals there, below the rim; `None` without enough of them.
    lean: Option<f64>,
}

impl Contact {
    /// How well the sides hold against gravity, 0 to 1: sides that lean together towards the top turn the grip into a push
    /// downwards, and at the friction angle the thing slips out below.
    pub(super) fn grip(&self, config: &GraspConfig) -> f64 {
        const WORST: f64 = 0.3;
        let share = self.lean.map_or(0.0, |lean| (lean / config.friction_cone_rad.sin()).clamp(0.0, 1.0));
        1.0 - (1.0 - WORST) * share
    }
}

/// Measures that slab.
pub(super) fn measure_contact(
    scene: &GraspScene,
    target_normals: &[Option<Vector3<f64>>],
    proposal: &Proposal,
    config: &GraspConfig,
) -> Contact {
    const SIDE_M: f64 = 0.010;
    const MAX_SHIFT_M: f64 = 0.015;
    /// Normals near the rim are those of the edge, metres.
    const RIM_M: f64 = 0.015;
    let top_m = scene.target.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    let tool_from_world = proposal.world_from_tool.inverse();
    let half_slab = 0.5 * config.hand.finger_width_m + 0.004;
    let tip = config.hand.tip_beyond_tool_m;
    let slab: Vec<(f64, Option<f64>, Option<f64>)> = scene
        .target
        .iter()
        .zip(target_normals)
        .filter_map(|(point, normal)| {
            let p = tool_from_world * point;
            let inside = p.x.abs() < half_slab && p.z > -0.03 && p.z < tip + 0.005;
            let up = normal.filter(|_| point.z < top_m - RIM_M).map(|n| n.z);
            inside.then(|| (p.y, normal.map(|n| (tool_from_world.rotation * n).y.abs()), up))
        })
        .collect();
    let half = proposal.half_width_m;
    let unseen = Contact { width_m: 2.0 * half, shift_m: 0.0, observed_share: 0.0, squareness: None, lean: None };
    let ys = || slab.iter().map(|(y, ..)| *y);
    let (Some(low), Some(high)) = (quantile(ys(), 0.03), quantile(ys(), 0.97)) else { return unseen };
    if slab.len() < 6 {
        return unseen;
    }
    let (seen_low, seen_high) = (low < -half + SIDE_M, high > half - SIDE_M);
    let observed_share = 0.5 * (f64::from(u8::from(seen_low)) + f64::from(u8::from(seen_high)));
    let both = seen_low && seen_high;
    let shift_m = if both { (0.5 * (low + high)).clamp(-MAX_SHIFT_M, MAX_SHIFT_M) } else { 0.0 };
    let reach = (high - shift_m).max(shift_m - low);
    let width_m = if both { (high - low).max(1.6 * half) } else { 2.0 * half.max(reach) };
    let at_sides = || slab.iter().filter(|(y, ..)| *y < low + 0.008 || *y > high - 0.008);
    let mean_of = |values: Vec<f64>| (values.len() >= 4).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let squareness = mean_of(at_sides().filter_map(|(_, n, _)| *n).collect());
    let lean = mean_of(at_sides().filter_map(|(.., up)| *up).collect());
    Contact { width_m, shift_m, observed_share, squareness, lean }
}

/// Distance of the swept hand from everything else; the support counts for the palm only, since the fingers' height over
/// it was set before.
pub(super) fn find_clearance(
    scene: &GraspScene,
    tool_from_world: &Pose,
    swept: &SweptHand,
    config: &GraspConfig,
) -> Result<f64, RejectReason> {
    const SUPPORT_NOISE_M: f64 = 0.012;
    const MAX_M: f64 = 0.05;
    /// One stray point is no obstacle.
    const MIN_HITS: u32 = 2;
    let mut nearest = MAX_M;
    let (mut finger_hits, mut palm_hits) = (0, 0);
    for point in &scene.obstacles {
        let p = tool_from_world * point;
        let palm = swept.palm_distance_m(&p);
        palm_hits += u32::from(palm < config.clearance_m);
        nearest = nearest.min(palm.max(0.0));
        if point.z > scene.support_z_m + SUPPORT_NOISE_M {
            let finger = swept.finger_distance_m(&p);
            finger_hits += u32::from(finger < config.clearance_m);
            nearest = nearest.min(finger.max(0.0));
        }
    }
    match (finger_hits, palm_hits) {
        (hits, _) if hits >= MIN_HITS => Err(RejectReason::FingersCollide),
        (_, hits) if hits >= MIN_HITS => Err(RejectReason::PalmCollides),
        _ => Ok(nearest),
    }
}
