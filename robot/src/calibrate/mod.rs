//! Where a camera really is on the robot, from what it saw of a scene that stood still while the robot moved it.
//!
//! ```text
//! View (depth image, base_from_mount) ──▶ patches of planes ──▶ pairs seen from two places ──▶ mount_from_camera
//! ```
//!
//! A point p seen in view i lies, in the camera of view j, at `(M_j X)^-1 M_i X p`, where M is the pose of the mount in the
//! frame of the base, from the joints, and X = `mount_from_camera` is what is sought. It has to lie on the plane seen there:
//! r = n . (p' - q). With X <- X exp(v, w), to first order
//!
//! ```text
//! dr/dv = n^T (R - 1),   dr/dw = n^T ([p']x - R [p]x),   R the rotation of (M_j X)^-1 M_i X
//! ```
//!
//! and Gauss-Newton with Huber's weights finds X. Views turned about one axis alone leave the position along that axis and the
//! turn about it open, and so does a scene of too few directions: the information matrix tells, and then nothing is claimed.

mod patches;
mod solve;

pub use patches::{Patch, find_patches};
pub use solve::{CalibrateConfig, Calibration, CalibrationOutcome, View, calibrate};

#[cfg(test)]
mod tests;
