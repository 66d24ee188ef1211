//! The decision variables: the joints of a group and, behind them, forward speed and turning rate of the base.
//!
//! ```text
//! v_point = sum over joints of (w x (p - o)) qdot  (sliding: axis qdot)  +  x v  +  (z x p) omega
//! ```
//!
//! All of it is in the base frame, which moves with the base: velocities are those against the floor.

use crate::model::{Drive, Group, JointKind, Kinematics, LinkId, LinkPoses};
use dsm::Pose;
use nalgebra::{DMatrix, DVector, Point3, Vector3};

/// Variables of the base.
const BASE_COLUMNS: usize = 2;

/// Which column each joint of a robot has, and whether the base has two.
#[derive(Clone, Debug)]
pub struct Columns {
    /// By joint of the robot: column and transmission.
    joints: Vec<Option<(usize, f64)>>,
    joint_columns: usize,
    with_base: bool,
}

impl Columns {
    /// Columns of the group's joints in their order, then of the base when it moves.
    pub fn new(kinematics: &Kinematics, group: &Group, with_base: bool) -> Self {
        let column = |drive: &Drive| match drive {
            Drive::Fixed => None,
            Drive::Variable { variable, multiplier, .. } => {
                group.variables.iter().position(|v| v == variable).map(|column| (column, *multiplier))
            }
        };
        let joints = kinematics.joints.iter().map(|joint| column(&joint.drive)).collect();
        Self { joints, joint_columns: group.len(), with_base }
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.joint_columns + if self.with_base { BASE_COLUMNS } else { 0 }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Column of the base's forward speed, that of its turning rate being the next; `None` when the base stands.
    pub fn find_base(&self) -> Option<usize> {
        self.with_base.then_some(self.joint_columns)
    }

    /// Calls `each` with the column, kind, axis (transmission included) and origin of every joint that moves `link`.
    fn each_joint(
        &self,
        kinematics: &Kinematics,
        poses: &LinkPoses,
        link: LinkId,
        mut each: impl FnMut(usize, JointKind, Vector3<f64>, &Vector3<f64>),
    ) {
        let mut current = link;
        while let Some(index) = kinematics.links[current.0].parent_joint {
            let joint = &kinematics.joints[index];
            current = joint.parent;
            if let Some((column, multiplier)) = self.joints[index] {
                // The child frame shares origin and axis with the joint frame for a turning joint; a sliding joint
                // only needs the axis, which sliding does not turn.
                let base_from_child = poses.get(joint.child);
                let axis = base_from_child.rotation * joint.axis.into_inner() * multiplier;
                each(column, joint.kind, axis, &base_from_child.translation.vector);
            }
        }
    }

    /// Jacobian of a point fixed to `link`, 6 x variables: linear (m/s), then angular (rad/s) velocity.
    pub fn jacobian(
        &self,
        kinematics: &Kinematics,
        poses: &LinkPoses,
        link: LinkId,
        point: &Point3<f64>,
    ) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(6, self.len());
        self.each_joint(kinematics, poses, link, |column, kind, axis, origin| {
            let mut linear = axis;
            if kind != JointKind::Prismatic {
                linear = axis.cross(&(point.coords - origin));
                for row in 0..3 {
                    jacobian[(row + 3, column)] += axis[row];
                }
            }
            for row in 0..3 {
                jacobian[(row, column)] += linear[row];
            }
        });
        if let Some(base) = self.find_base() {
            jacobian[(0, base)] = 1.0;
            jacobian[(0, base + 1)] = -point.y;
            jacobian[(1, base + 1)] = point.x;
            jacobian[(5, base + 1)] = 1.0;
        }
        jacobian
    }

    /// Adds `scale` times the speed of a point along `direction`, over the joints.
    pub fn add_speed_along(
        &self,
        (kinematics, poses): (&Kinematics, &LinkPoses),
        (link, point): (LinkId, &Point3<f64>),
        direction: &Vector3<f64>,
        scale: f64,
        coefficients: &mut DVector<f64>,
    ) {
        self.each_joint(kinematics, poses, link, |column, kind, axis, origin| {
            let speed = match kind {
                JointKind::Prismatic => axis.dot(direction),
                _ => axis.cross(&(point.coords - origin)).dot(direction),
            };
            coefficients[column] += scale * speed;
        });
    }

    /// Adds the same for the base's variables: every point of the robot moves with the base, which stands at `base`.
    pub fn add_base_speed_along(
        &self,
        base: &Pose,
        point: &Point3<f64>,
        direction: &Vector3<f64>,
        coefficients: &mut DVector<f64>,
    ) {
        if let Some(column) = self.find_base() {
            let arm = point.coords - base.translation.vector;
            coefficients[column] += (base.rotation * Vector3::x()).dot(direction);
            coefficients[column + 1] += arm.x * direction.y - arm.y * direction.x;
        }
    }

    /// How a ball on `link` moves for a unit of each variable.
    pub fn ball_motions(
        &self,
        (kinematics, poses): (&Kinematics, &LinkPoses),
        link: LinkId,
        (center, radius_m): (&Point3<f64>, f64),
        motions: &mut [BallMotion],
    ) {
        motions.fill(BallMotion::default());
        self.each_joint(kinematics, poses, link, |column, kind, axis, origin| {
            let motion = &mut motions[column];
            match kind {
                JointKind::Prismatic => motion.linear += axis,
                _ => {
                    motion.linear += axis.cross(&(center.coords - origin));
                    motion.angular += axis;
                }
            }
            motion.moves = true;
        });
        if let Some(base) = self.find_base() {
            let turning = Vector3::new(-center.y, center.x, 0.0);
            motions[base] = BallMotion { linear: Vector3::x(), moves: true, ..BallMotion::default() };
            motions[base + 1] = BallMotion { linear: turning, angular: Vector3::z(), moves: true, greatest: 0.0 };
        }
        for motion in motions {
            motion.greatest = motion.linear.norm() + radius_m * motion.angular.norm();
        }
    }
}

/// Velocity of a ball for a unit of one variable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BallMotion {
    /// Of its centre, m/s.
    pub linear: Vector3<f64>,
    /// Turning, rad/s.
    pub angular: Vector3<f64>,
    /// Greatest speed of any of its points, m/s.
    pub greatest: f64,
    /// Whether the variable moves it.
    pub moves: bool,
}
