//! Pose noise of a chosen size: an error that wanders slowly, the same path at every size.

use dsm::Pose;
use dsm::time::Stamp;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Correlation time, seconds.
const TIME_S: f64 = 10.0;
/// Attitude error that goes with a metre of position error, radians: 0.2 degrees per centimetre.
const RAD_PER_M: f64 = 0.2 / 180.0 * std::f64::consts::PI / 0.01;
/// Stream of the wander among all that a seed draws.
const STREAM: u64 = 0x7761_6e64_6572;

/// An Ornstein-Uhlenbeck path in six numbers of deviation 1, with a correlation time of 10 s: position and attitude error
/// along the world's axes, before they are given a size.
#[derive(Clone, Debug)]
pub struct PoseWander {
    rng: ChaCha8Rng,
    last: Option<Stamp>,
    value: [f64; 6],
}

impl PoseWander {
    /// The path of a seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(STREAM);
        Self { rng, last: None, value: [0.0; 6] }
    }

    /// Goes on to a later moment.
    pub fn advance(&mut self, stamp: Stamp) {
        let kept = self.last.map_or(0.0, |last| (-(stamp - last).as_s().max(0.0) / TIME_S).exp());
        self.last = Some(stamp);
        for value in &mut self.value {
            let normal: f64 = StandardNormal.sample(&mut self.rng);
            *value = kept * *value + (1.0 - kept * kept).sqrt() * normal;
        }
    }

    /// The error `believed_from_true` at this moment for a camera at a true pose. `sigma_m` is the deviation of the position
    /// along each axis; attitude about each axis deviates by 0.2 degrees per centimetre of it, about the camera.
    pub fn error(&self, sigma_m: f64, world_from_camera: &Pose) -> Pose {
        let [x, y, z, roll, pitch, yaw] = self.value;
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(roll, pitch, yaw) * (sigma_m * RAD_PER_M));
        let eye = world_from_camera.translation;
        let shift = Translation3::from(Vector3::new(x, y, z) * sigma_m);
        shift * eye * turn * eye.inverse()
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the error has the deviation asked for, is correlated over ten seconds, and scales with its size.
    use super::*;

    #[test]
    fn deviation_and_correlation_are_as_said() {
        let mut wander = PoseWander::new(4);
        let camera = Pose::translation(3.0, 2.0, 1.2);
        let errors: Vec<Pose> = (0..20_000)
            .map(|i| {
                wander.advance(Stamp::from_s(f64::from(i) * 0.2));
                wander.error(0.02, &camera)
            })
            .collect();
        let shifts: Vec<f64> = errors.iter().map(|e| (e * camera).translation.x - 3.0).collect();
        let product = |lag: usize| {
            shifts.iter().zip(&shifts[lag..]).map(|(a, b)| a * b).sum::<f64>() / (shifts.len() - lag) as f64
        };
        assert!((product(0).sqrt() - 0.02).abs() < 0.003, "{}", product(0).sqrt());
        let after_10_s = product(50) / product(0);
        assert!((0.2..0.55).contains(&after_10_s), "{after_10_s}");
        let turn = errors.iter().map(|e| e.rotation.angle().powi(2)).sum::<f64>() / errors.len() as f64;
        let per_axis_deg = (turn / 3.0).sqrt().to_degrees();
        assert!((per_axis_deg - 0.4).abs() < 0.06, "{per_axis_deg}");
        assert_eq!(wander.error(0.0, &camera), Pose::identity());
    }
}
