//! The limits that joints must keep.

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

impl JointBounds {
    /// Whether a position and a speed are outside.
    pub fn are_broken_by(&self, position: f64, velocity: f64) -> bool {
        position < self.position.0 - SLACK
            || position > self.position.1 + SLACK
            || velocity.abs() > self.speed * SPEED_SHARE + SPEED_SLACK
    }
}
