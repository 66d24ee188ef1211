//! Velocity dampers, shared by the limits of distances between links and to obstacles.
//!
//! ```text
//! closing speed <= min(xi D, braking(D), D / (dt + T/2)),   D = d - d_s - c
//! ```
//!
//! NEO's damper `xi D` alone can ask for more deceleration than there is. `braking(D)` is the bound from which a stop
//! with the configured deceleration fits into `D`. `T` is the time in which the slowest of the row's variables stops at
//! its own acceleration limit: joints falling together to zero within `T` (and the base within its own) close `T/2` times
//! the present speed, whatever the joints' leverage. `c` is the way by which the straight line of one step may be wrong
//! for links that turn. Closer than `d_s` the bound is negative: retreat at a bounded speed.
//!
//! No row asks for more than a stop within `D` takes: from the present closing speed `s`, `s - dt s^2 / (2 D)`. Where rows
//! contradict each other they are eased to what that common brake gives; then it satisfies all of them.
//!
//! Links turn while they brake, and what is closest then may be another corner. So poses on the way of that brake,
//! `q + delta` with `delta = s qdot_before T_before / 2` for shares `s` up to 1, have rows of their own, with their own
//! closest points:
//!
//! ```text
//! sum of c_k w_k qdot_k <= d - d_s + c' delta,   w_k = s (dt + T_k / 2)
//! ```

use super::config::ControllerConfig;
use super::joint_limit::braking_bound;
use super::qp::{Row, greatest_in_box, least_in_box};
use nalgebra::DVector;

/// The moment for which dampers are computed.
pub struct Moment<'a> {
    /// Length of the step in s.
    pub dt_s: f64,
    /// Least allowed velocities.
    pub lower: &'a DVector<f64>,
    /// Greatest allowed velocities.
    pub upper: &'a DVector<f64>,
    /// Present velocities.
    pub velocities: &'a DVector<f64>,
    /// Velocities of a brake that lets the joints come to rest together, and so the base; within the box.
    pub braked: &'a DVector<f64>,
    /// Time which that brake takes at most from the box, by variable, in s.
    pub braking_times_s: &'a [f64],
}

impl Moment<'_> {
    /// Time in which the slowest variable of a row comes to rest, in s.
    fn braking_time_s(&self, coefficients: &DVector<f64>) -> f64 {
        let times = coefficients.iter().zip(self.braking_times_s).filter(|(c, _)| c.abs() > 1e-9);
        times.map(|(_, time)| *time).fold(0.0, f64::max)
    }

    /// The same of all variables, in s.
    pub fn longest_braking_time_s(&self) -> f64 {
        self.braking_times_s.iter().copied().fold(0.0, f64::max)
    }
}

/// Two sides that must not come nearer.
pub struct Approach {
    /// Closing speed for a unit of each variable.
    pub coefficients: DVector<f64>,
    /// Distance in m.
    pub distance_m: f64,
    /// Distance at which approach ends in m.
    pub stop_m: f64,
    /// Way by which the closing of one step may exceed the linear one in m.
    pub curvature_m: f64,
    /// Speed at which the other side goes away by itself in m/s; negative when it comes.
    pub receding_m_per_s: f64,
    /// Whether the other side moves by itself.
    pub moving: bool,
}

/// The greatest closing speed in m/s with `spare_m` left.
pub fn closing_speed_bound(config: &ControllerConfig, spare_m: f64, braking_time_s: f64, dt_s: f64) -> f64 {
    if spare_m < 0.0 {
        return (config.damper_per_s * spare_m).max(-config.retreat_m_per_s);
    }
    let together = spare_m / (dt_s + 0.5 * braking_time_s);
    (config.damper_per_s * spare_m).min(braking_bound(spare_m, config.braking_m_per_s2, dt_s)).min(together)
}

/// The spare distance from which a closing speed is not slowed: the inverse of [`closing_speed_bound`].
pub fn influence_m(config: &ControllerConfig, closing_m_per_s: f64, braking_time_s: f64, dt_s: f64) -> f64 {
    let braking = closing_m_per_s * (dt_s + closing_m_per_s / (2.0 * config.braking_m_per_s2));
    braking.max(closing_m_per_s / config.damper_per_s).max(closing_m_per_s * (dt_s + 0.5 * braking_time_s))
}

/// A row, and the bound that it may be eased to when rows contradict each other: retreat is a wish, braking is not.
pub struct Damper {
    /// The row.
    pub row: Row,
    /// At least the row's bound.
    pub eased: f64,
    /// Whether the two sides are too near already: these rows give way first.
    pub retreats: bool,
}

/// The row of an approach; `None` when no velocity of the box can violate it. What the box cannot reach is not asked
/// for, nor more than a stop in time takes from a side that stands.
pub fn find_damper(config: &ControllerConfig, approach: Approach, moment: &Moment<'_>) -> Option<Damper> {
    let Approach { coefficients, distance_m, stop_m, curvature_m, receding_m_per_s, moving } = approach;
    // The curvature slows an approach; it does not turn it into retreat.
    let spare_m = distance_m - stop_m;
    let spare_m = if spare_m > 0.0 { (spare_m - curvature_m).max(0.0) } else { spare_m };
    let time_s = moment.braking_time_s(&coefficients);
    let wanted = closing_speed_bound(config, spare_m, time_s, moment.dt_s) + receding_m_per_s;
    if greatest_in_box(&coefficients, moment.lower, moment.upper) <= wanted {
        return None;
    }
    let least = least_in_box(&coefficients, moment.lower, moment.upper);
    let braked = coefficients.dot(moment.braked);
    let mut bound = wanted.max(least);
    if spare_m > 0.0 && !moving {
        let closing = coefficients.dot(moment.velocities);
        let stopping = closing - moment.dt_s * closing * closing / (2.0 * spare_m);
        bound = bound.max(stopping.min(braked));
    }
    let eased = if moving { bound } else { bound.max(braked) };
    Some(Damper { row: Row { coefficients, bound }, eased, retreats: spare_m <= 0.0 })
}

/// The row of two sides in a pose on the way of the brake, `delta` and a share of the way off: it must still be
/// admissible. `None` when no velocity of the box can violate it.
pub fn find_damper_ahead(
    mut coefficients: DVector<f64>,
    spare_m: f64,
    (delta, share): (&DVector<f64>, f64),
    moment: &Moment<'_>,
) -> Option<Damper> {
    let mut wanted = spare_m + coefficients.dot(delta);
    // In the unit of the slowest variable's speed.
    let longest_s = moment.dt_s + 0.5 * moment.braking_time_s(&coefficients);
    wanted /= share * longest_s;
    for (coefficient, time_s) in coefficients.iter_mut().zip(moment.braking_times_s) {
        *coefficient *= (moment.dt_s + 0.5 * time_s) / longest_s;
    }
    if greatest_in_box(&coefficients, moment.lower, moment.upper) <= wanted {
        return None;
    }
    let bound = wanted.max(least_in_box(&coefficients, moment.lower, moment.upper));
    let eased = bound.max(coefficients.dot(moment.braked));
    Some(Damper { row: Row { coefficients, bound: eased }, eased, retreats: false })
}
