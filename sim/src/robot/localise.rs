//! Where the robot believes it is: the truth with a bounded wander, and odometry that drifts.

use super::delay::Delay;
use dsm::Pose;
use dsm::time::Stamp;
use dsm_robot::drivers::{DriverError, Localisation, StampedPose};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// How good localisation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocalisationNoise {
    /// Bounded wander and odometry drift, as preset `noisy` says.
    Noisy,
    /// The truth, as preset `oracle` says.
    None,
}

/// Parameters of the simulated localisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalisationConfig {
    /// Seed of the run.
    pub seed: u64,
    /// Preset.
    pub noise: LocalisationNoise,
}

/// Bound of the wander of the position, metres.
const WANDER_M: f64 = 0.03;
/// Bound of the wander of the heading, radians (0.5 deg).
const WANDER_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Correlation time of the wander, seconds.
const WANDER_TIME_S: f64 = 10.0;
/// The wander is smoothed over this time: what localises a robot corrects itself gradually.
const SMOOTH_TIME_S: f64 = 1.0;
/// Standard deviation of the wander as a share of its bound.
const WANDER_SHARE: f64 = 0.4;
/// Odometry's largest scale error of path and heading.
const DRIFT: f64 = 0.02;
/// Random stream of the localisation.
const STREAM: u64 = 0x6c6f_6361;

/// One wandering number: an Ornstein-Uhlenbeck process, smoothed.
#[derive(Clone, Copy, Debug, Default)]
struct Wander {
    raw: f64,
    smooth: f64,
}

impl Wander {
    fn advance(&mut self, dt_s: f64, bound: f64, rng: &mut ChaCha8Rng) {
        let normal: f64 = StandardNormal.sample(rng);
        let step = (2.0 * dt_s / WANDER_TIME_S).sqrt() * WANDER_SHARE * bound;
        self.raw = (self.raw * (1.0 - dt_s / WANDER_TIME_S) + step * normal).clamp(-bound, bound);
        self.smooth += (self.raw - self.smooth) * (dt_s / SMOOTH_TIME_S).min(1.0);
    }
}

/// The simulated localisation.
pub(super) struct SimLocalisation {
    config: LocalisationConfig,
    rng: ChaCha8Rng,
    stamp: Stamp,
    truth: Pose,
    odom_from_base: Pose,
    wander: [Wander; 3],
    /// Scale of odometry's path and turn.
    path_scale: f64,
    turn_scale: f64,
    /// What is added to the believed pose: x, y and yaw.
    jump: [f64; 3],
    /// `world_from_base` and `odom_from_base` as they are heard of.
    heard: Delay<[StampedPose; 2]>,
}

impl SimLocalisation {
    pub(super) fn new(config: LocalisationConfig, stamp: Stamp, truth: Pose) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
        rng.set_stream(STREAM);
        let mut draw = |limit: f64| -> f64 {
            let normal: f64 = StandardNormal.sample(&mut rng);
            (0.5 * limit * normal).clamp(-limit, limit)
        };
        let noisy = config.noise == LocalisationNoise::Noisy;
        let (path_scale, turn_scale) = if noisy { (1.0 + draw(DRIFT), 1.0 + draw(DRIFT)) } else { (1.0, 1.0) };
        let wander = if noisy {
            // Per axis a smaller bound, so that the distance stays within 3 cm.
            [WANDER_AXIS_M, WANDER_AXIS_M, WANDER_RAD].map(|bound| {
                let value = draw(WANDER_SHARE * 2.0 * bound).clamp(-bound, bound);
                Wander { raw: value, smooth: value }
            })
        } else {
            [Wander::default(); 3]
        };
        let first = [StampedPose { stamp, pose: Pose::identity() }; 2];
        let mut localisation = Self {
            config,
            rng,
            stamp,
            truth,
            odom_from_base: Pose::identity(),
            wander,
            path_scale,
            turn_scale,
            jump: [0.0; 3],
            heard: Delay::new(0.0, stamp, first),
        };
        localisation.heard = Delay::new(0.0, stamp, localisation.measured());
        localisation
    }

    /// Lets all that it measures be heard of so much later.
    pub(super) fn heard_after(mut self, latency_s: f64) -> Self {
        self.heard = Delay::new(latency_s, self.stamp, self.measured());
        self
    }

    /// What holds at the last tick.
    fn measured(&self) -> [StampedPose; 2] {
        [self.world_from_base_now(), self.odom_from_base].map(|pose| StampedPose { stamp: self.stamp, pose })
    }

    /// Sets what is wrong with the believed pose from now on: shift in metres, turn in radians.
    pub(super) fn set_jump(&mut self, jump: [f64; 3]) {
        self.jump = jump;
        self.heard.measure(self.stamp, self.measured());
    }

    /// Follows the base to its true pose at `now`, while its wheels have the share `grip` of their hold on the floor.
    pub(super) fn tick(&mut self, now: Stamp, world_from_base: &Pose, grip: f64) {
        let dt_s = (now - self.stamp).as_s();
        let moved = self.truth.inv_mul(world_from_base);
        let (_, _, turned) = moved.rotation.euler_angles();
        // Odometry counts the turns of the wheels.
        let step = Translation3::from(moved.translation.vector * (self.path_scale / grip));
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turned * self.turn_scale / grip);
        self.odom_from_base *= Pose::from_parts(step, turn);
        if self.config.noise == LocalisationNoise::Noisy {
            for (wander, bound) in self.wander.iter_mut().zip([WANDER_AXIS_M, WANDER_AXIS_M, WANDER_RAD]) {
                wander.advance(dt_s, bound, &mut self.rng);
            }
        }
        self.stamp = now;
        self.truth = *world_from_base;
        self.heard.measure(now, self.measured());
    }

    /// The believed pose at the last tick.
    pub(super) fn world_from_base_now(&self) -> Pose {
        let [x, y, yaw]: [f64; 3] = std::array::from_fn(|axis| self.wander[axis].smooth + self.jump[axis]);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        // The heading wanders about the robot, not about the world's origin.
        let shifted = Translation3::from(self.truth.translation.vector + Vector3::new(x, y, 0.0));
        Pose::from_parts(shifted, turn * self.truth.rotation)
    }
}

/// Bound of each axis: the diagonal of the square is the bound of the distance.
const WANDER_AXIS_M: f64 = WANDER_M * std::f64::consts::FRAC_1_SQRT_2;

impl Localisation for SimLocalisation {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        Ok(self.heard.heard()[0])
    }

    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        Ok(self.heard.heard()[1])
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the believed pose stays within 3 cm and 0.5 deg of the truth, wanders slowly and is reproducible;
    //! odometry drifts by at most 2 %; without noise both are true.
    use super::*;

    fn config(seed: u64, noise: LocalisationNoise) -> LocalisationConfig {
        LocalisationConfig { seed, noise }
    }

    fn pose(x: f64, y: f64, yaw: f64) -> Pose {
        Pose::from_parts(Translation3::new(x, y, 0.0), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw))
    }

    /// Drives a circle for `seconds` and calls `see` with the localisation and the truth at each tick.
    fn circle(mut localisation: SimLocalisation, seconds: f64, mut see: impl FnMut(&mut SimLocalisation, &Pose)) {
        for tick in 1..=(seconds * 100.0) as i64 {
            let angle = tick as f64 * 0.01 * 0.3;
            let truth = pose(angle.sin(), 1.0 - angle.cos(), angle);
            localisation.tick(Stamp(tick * 10_000_000), &truth, 1.0);
            see(&mut localisation, &truth);
        }
    }

    #[test]
    fn the_wander_is_bounded_slow_and_used() {
        for seed in 0..5 {
            let (mut farthest, mut most_turned, mut fastest) = (0.0_f64, 0.0_f64, 0.0_f64);
            let mut last = None;
            let start = SimLocalisation::new(config(seed, LocalisationNoise::Noisy), Stamp(0), Pose::identity());
            circle(start, 300.0, |localisation, truth| {
                let error = localisation.world_from_base_now().translation.vector - truth.translation.vector;
                let turned = localisation.world_from_base_now().rotation.angle_to(&truth.rotation);
                farthest = farthest.max(error.norm());
                most_turned = most_turned.max(turned);
                if let Some(last) = last {
                    fastest = fastest.max((error - last as Vector3<f64>).norm() / 0.01);
                }
                last = Some(error);
            });
            assert!((0.008..=0.03).contains(&farthest), "seed {seed}: {farthest} m");
            assert!((0.002..=WANDER_RAD).contains(&most_turned), "seed {seed}: {most_turned} rad");
            assert!(fastest < 0.03, "seed {seed}: {fastest} m/s");
        }
    }

    #[test]
    fn odometry_drifts_by_two_percent_at_most() {
        for seed in 0..10 {
            let mut localisation =
                SimLocalisation::new(config(seed, LocalisationNoise::Noisy), Stamp(0), Pose::identity());
            for tick in 1..=1000 {
                localisation.tick(Stamp(tick * 10_000_000), &pose(tick as f64 * 0.01, 0.0, 0.0), 1.0);
            }
            let x = localisation.odom_from_base.translation.x;
            assert!((x - 10.0).abs() <= 0.2 && x != 10.0, "seed {seed}: {x} m");
        }
    }

    #[test]
    fn seeds_decide_and_repeat() {
        let trace = |seed| {
            let mut trace = Vec::new();
            let start = SimLocalisation::new(config(seed, LocalisationNoise::Noisy), Stamp(0), Pose::identity());
            circle(start, 5.0, |localisation, _| trace.push(localisation.world_from_base_now()));
            trace
        };
        assert_eq!(trace(1), trace(1));
        assert_ne!(trace(1), trace(2));
    }

    #[test]
    fn without_noise_both_are_true() {
        let start = SimLocalisation::new(config(1, LocalisationNoise::None), Stamp(0), Pose::identity());
        circle(start, 10.0, |localisation, truth| {
            assert_eq!(localisation.world_from_base_now(), *truth);
            let odom = localisation.odom_from_base().unwrap().pose;
            assert!((odom.translation.vector - truth.translation.vector).norm() < 1e-6);
        });
    }
}
