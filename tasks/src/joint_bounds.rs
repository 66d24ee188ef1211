//! Whether joints kept their limits, from truth.

use crate::summary::LimitViolation;
use dsm::eval::Truth;

/// Limits of one joint, for counting violations.
#[derive(Clone, Debug)]
pub struct JointBounds {
    /// Name in the URDF.
    pub name: String,
    /// Lowest and highest position, radians or metres.
    pub position: (f64, f64),
    /// Highest speed, radians or metres per second.
    pub speed: f64,
}

/// Contact and motor lag leave a little beyond what was commanded: 5 mm or mrad of position ...
const SLACK: f64 = 0.005;
/// ... and a tenth of the speed and a centimetre or centiradian per second.
const SPEED_SHARE: f64 = 1.1;
const SPEED_SLACK: f64 = 0.01;

/// The joints of a sample that are outside their bounds.
pub fn find_violations(bounds: &[JointBounds], truth: &Truth) -> Vec<LimitViolation> {
    let joints = truth.joints.iter();
    joints
        .filter(|joint| {
            bounds.iter().any(|b| {
                b.name == joint.name
                    && (joint.position < b.position.0 - SLACK
                        || joint.position > b.position.1 + SLACK
                        || joint.velocity.abs() > b.speed * SPEED_SHARE + SPEED_SLACK)
            })
        })
        .map(|joint| LimitViolation {
            joint: joint.name.clone(),
            stamp_s: truth.stamp.as_s(),
            position: joint.position,
            velocity: joint.velocity,
        })
        .collect()
}
