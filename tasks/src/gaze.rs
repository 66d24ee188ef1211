//! Where the head looks, and the velocities that turn it there.

use dsm::Pose;
use dsm::time::Stamp;
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::{Configuration, RobotModel};
use nalgebra::{DMatrix, DVector, Point3, Vector3};

/// Where the head is to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gaze {
    /// Pan and tilt of the head, radians; positive pan looks to the left, positive tilt down.
    Angles {
        /// Pan.
        pan_rad: f64,
        /// Tilt.
        tilt_rad: f64,
    },
    /// From side to side, so that a drive sees more than what lies ahead.
    Sweep {
        /// Farthest pan to either side, radians.
        half_rad: f64,
        /// Tilt, radians.
        tilt_rad: f64,
    },
    /// A point in the world.
    Point(Point3<f64>),
}

impl Gaze {
    /// Ahead and down to what stands close before the base, for driving.
    pub const AHEAD: Self = Self::Angles { pan_rad: 0.0, tilt_rad: 0.6 };
    /// From side to side and a little down, for driving through the unknown.
    pub const AROUND: Self = Self::Sweep { half_rad: 0.9, tilt_rad: 0.42 };

    /// Velocities towards it: proportional to the joint error, or for a point to the angle between the optical axis z and
    /// the direction d, by least squares over J_w qdot = k (z x d).
    pub(crate) fn velocities(&self, view: &View<'_>, gain_per_s: f64) -> JointVelocities {
        let group = &view.model.head;
        let towards = |pan_rad: f64, tilt_rad: f64| -> Vec<f64> {
            let signs = view.model.head_signs();
            [signs[0] * pan_rad, signs[1] * tilt_rad]
                .iter()
                .zip(view.head)
                .map(|(goal, now)| gain_per_s * (goal - now))
                .collect()
        };
        let velocities = match *self {
            Self::Angles { pan_rad, tilt_rad } => towards(pan_rad, tilt_rad),
            Self::Sweep { half_rad, tilt_rad } => {
                // A triangle wave of about one radian per second.
                let phase = (view.now.as_s() / (4.0 * half_rad)).fract();
                towards(half_rad * (4.0 * (phase - 0.5).abs() - 1.0), tilt_rad)
            }
            Self::Point(point) => {
                let Some((_, camera)) = view.model.find_camera("head") else {
                    return JointVelocities::zeros(&group.joints);
                };
                let poses = view.model.kinematics.root_from_links(view.configuration);
                let base_from_camera = *poses.get(camera);
                let point_in_base = view.world_from_base.inverse_transform_point(&point);
                let axis = base_from_camera * Vector3::z();
                let direction = (point_in_base - Point3::from(base_from_camera.translation.vector)).normalize();
                let turn = axis.cross(&direction) * gain_per_s;
                let jacobian = view.model.kinematics.jacobian(&poses, camera, &Point3::origin(), group);
                let angular: DMatrix<f64> = jacobian.rows(3, 3).into_owned();
                // Damping keeps the answer small near the pan axis.
                let normal = angular.transpose() * &angular + DMatrix::identity(group.len(), group.len()) * 1e-2;
                let rhs: DVector<f64> = angular.transpose() * turn;
                normal.cholesky().map_or_else(|| vec![0.0; group.len()], |c| c.solve(&rhs).as_slice().to_vec())
            }
        };
        let mut command = JointVelocities::zeros(&group.joints);
        for ((value, wanted), limit) in command.values_mut().iter_mut().zip(velocities).zip(&group.limits) {
            *value = wanted.clamp(-limit.velocity, limit.velocity);
        }
        command
    }
}

/// What turning the head needs to know of the robot.
pub(crate) struct View<'a> {
    /// The model.
    pub model: &'a RobotModel,
    /// All joints.
    pub configuration: &'a Configuration,
    /// Where the robot believes to be.
    pub world_from_base: &'a Pose,
    /// Measured pan and tilt, radians.
    pub head: &'a [f64],
    /// The present moment.
    pub now: Stamp,
}
