//! A tree of links and joints: forward kinematics, Jacobians, joint limits and mimic joints.
//!
//! The state of the tree is a [`Configuration`]: one value for every independent joint (mimic joints follow theirs).
//! Poses are expressed in the root link's frame.

use super::shapes::{CollisionShape, VisualShape};
use crate::joints::{JointNames, JointPositions};
use dsm::Pose;
use nalgebra::{DMatrix, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

/// Index of a link in [`Kinematics::links`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LinkId(pub usize);

/// Mass and inertia of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Where the centre of mass and the axes of `inertia_kg_m2` are.
    pub link_from_inertial: Pose,
    /// Mass in kilograms; 0 for pure frames.
    pub mass_kg: f64,
    /// Inertia about the centre of mass in kg m^2.
    pub inertia_kg_m2: Matrix3<f64>,
}

/// A rigid part of the robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name in the URDF.
    pub name: String,
    /// Index in [`Kinematics::joints`] of the joint that carries it; `None` for the root.
    pub parent_joint: Option<usize>,
    /// Mass and inertia.
    pub inertial: Inertial,
    /// What collides.
    pub collisions: Vec<CollisionShape>,
    /// What is seen.
    pub visuals: Vec<VisualShape>,
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// It does not.
    Fixed,
    /// It turns about its axis, within limits.
    Revolute,
    /// It turns about its axis without end.
    Continuous,
    /// It slides along its axis, within limits.
    Prismatic,
}

/// Limits of a joint, in m or rad; infinite where the URDF sets none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Least position.
    pub lower: f64,
    /// Greatest position.
    pub upper: f64,
    /// Greatest speed, per second.
    pub velocity: f64,
    /// Greatest force (N) or torque (Nm).
    pub effort: f64,
}

/// What sets a joint's position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Nothing: it is fixed.
    Fixed,
    /// `position = multiplier * configuration[variable] + offset`; 1 and 0 unless it mimics another joint.
    Variable {
        /// Index in the configuration.
        variable: usize,
        /// Factor.
        multiplier: f64,
        /// Summand in m or rad.
        offset: f64,
    },
}

/// A joint between two links.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in the URDF.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// The link that carries it.
    pub parent: LinkId,
    /// The link it carries.
    pub child: LinkId,
    /// Where the child frame is at position 0.
    pub parent_from_joint: Pose,
    /// The axis in the joint's frame.
    pub axis: Unit<Vector3<f64>>,
    /// Limits of this joint.
    pub limits: JointLimits,
    /// What sets its position.
    pub drive: Drive,
    /// Viscous damping in N s/m or Nm s/rad; 0 where the URDF sets none.
    pub damping: f64,
}

impl Joint {
    /// Where the child frame is at `position`.
    pub fn parent_from_child(&self, position: f64) -> Pose {
        let motion = match self.kind {
            JointKind::Fixed => return self.parent_from_joint,
            JointKind::Prismatic => {
                Pose::from_parts(Translation3::from(self.axis.into_inner() * position), UnitQuaternion::identity())
            }
            JointKind::Revolute | JointKind::Continuous => {
                Pose::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&self.axis, position))
            }
        };
        self.parent_from_joint * motion
    }
}

/// One value for every independent joint, in the order of [`Kinematics::variables`].
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    positions: JointPositions,
}

impl Configuration {
    /// Names and values.
    pub fn positions(&self) -> &JointPositions {
        &self.positions
    }

    /// Value of one variable.
    pub fn value(&self, variable: usize) -> f64 {
        self.positions.values()[variable]
    }

    /// Changes one variable.
    pub fn set(&mut self, variable: usize, value: f64) {
        self.positions.values_mut()[variable] = value;
    }

    /// Takes over the joints that `positions` names; names that the robot does not have are returned.
    pub fn apply(&mut self, positions: &JointPositions) -> Vec<String> {
        let names = self.positions.names().clone();
        let mut unknown = Vec::new();
        for (name, value) in positions.iter() {
            match names.iter().position(|own| &**own == name) {
                Some(variable) => self.set(variable, value),
                None => unknown.push(name.to_owned()),
            }
        }
        unknown
    }

    /// Takes over the values of a group.
    pub fn apply_group(&mut self, group: &Group, values: &[f64]) {
        for (variable, value) in group.variables.iter().zip(values) {
            self.set(*variable, *value);
        }
    }
}

/// Poses of all links in the root frame, by [`LinkId`].
#[derive(Clone, Debug, PartialEq)]
pub struct LinkPoses {
    poses: Vec<Pose>,
}

impl LinkPoses {
    /// `root_from_link`.
    pub fn get(&self, link: LinkId) -> &Pose {
        &self.poses[link.0]
    }

    /// The same poses in another frame.
    pub fn seen_from(&self, other_from_root: &Pose) -> Self {
        Self { poses: self.poses.iter().map(|pose| other_from_root * pose).collect() }
    }

    /// All poses in the order of the links.
    pub fn as_slice(&self) -> &[Pose] {
        &self.poses
    }
}

/// Joints commanded as one.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name of the group.
    pub name: String,
    /// Names of its joints, in the order of commands.
    pub joints: JointNames,
    /// Index of each joint in the configuration.
    pub variables: Vec<usize>,
    /// Limits of each joint.
    pub limits: Vec<JointLimits>,
    /// Greatest acceleration of each joint in m/s^2 or rad/s^2.
    pub max_accelerations: Vec<f64>,
}

impl Group {
    /// Number of joints.
    pub fn len(&self) -> usize {
        self.variables.len()
    }

    /// Whether there are no joints (never, for a loaded robot).
    pub fn is_empty(&self) -> bool {
        self.variables.is_empty()
    }

    /// The group's values within a configuration.
    pub fn values_of(&self, configuration: &Configuration) -> Vec<f64> {
        self.variables.iter().map(|variable| configuration.value(*variable)).collect()
    }
}

/// The kinematic tree of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Kinematics {
    /// Name of the robot in its URDF.
    pub name: String,
    /// Links in the URDF's order.
    pub links: Vec<Link>,
    /// Joints, parents before children.
    pub joints: Vec<Joint>,
    /// The one link without a parent.
    pub root: LinkId,
    /// Names of the independent joints, in the order of `joints`.
    pub variables: JointNames,
}

impl Kinematics {
    /// The configuration with 0 for every variable, or the nearest value within its limits.
    pub fn zero(&self) -> Configuration {
        let mut zero = Configuration { positions: JointPositions::zeros(&self.variables) };
        for joint in &self.joints {
            if let Drive::Variable { variable, .. } = joint.drive
                && *self.variables[variable] == *joint.name
            {
                zero.set(variable, 0.0_f64.max(joint.limits.lower).min(joint.limits.upper));
            }
        }
        zero
    }

    /// A link by name.
    pub fn find_link(&self, name: &str) -> Option<LinkId> {
        self.links.iter().position(|link| link.name == name).map(LinkId)
    }

    /// A joint by name, mimic and fixed joints included.
    pub fn find_joint(&self, name: &str) -> Option<&Joint> {
        self.joints.iter().find(|joint| joint.name == name)
    }

    /// Poses of all links in the root frame.
    pub fn root_from_links(&self, configuration: &Configuration) -> LinkPoses {
        let mut poses = vec![Pose::identity(); self.links.len()];
        for joint in &self.joints {
            let position = match joint.drive {
                Drive::Fixed => 0.0,
                Drive::Variable { variable, multiplier, offset } => multiplier * configuration.value(variable) + offset,
            };
            poses[joint.child.0] = poses[joint.parent.0] * joint.parent_from_child(position);
        }
        LinkPoses { poses }
    }

    /// Pose of one link in the root frame.
    pub fn root_from_link(&self, configuration: &Configuration, link: LinkId) -> Pose {
        let mut root_from_link = Pose::identity();
        let mut current = link;
        while let Some(index) = self.links[current.0].parent_joint {
            let joint = &self.joints[index];
            let position = match joint.drive {
                Drive::Fixed => 0.0,
                Drive::Variable { variable, multiplier, offset } => multiplier * configuration.value(variable) + offset,
            };
            root_from_link = joint.parent_from_child(position) * root_from_link;
            current = joint.parent;
        }
        root_from_link
    }

    /// Geometric Jacobian, 6 x group: rows are the linear (m/s) then the angular (rad/s) velocity, in the root frame,
    /// of a point fixed to `link`; columns are the group's joints. Joints outside the group count as still.
    pub fn jacobian(
        &self,
        poses: &LinkPoses,
        link: LinkId,
        point_in_root: &Point3<f64>,
        group: &Group,
    ) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(6, group.len());
        let mut current = link;
        while let Some(index) = self.links[current.0].parent_joint {
            let joint = &self.joints[index];
            current = joint.parent;
            let Drive::Variable { variable, multiplier, .. } = joint.drive else { continue };
            let Some(column) = group.variables.iter().position(|v| *v == variable) else { continue };
            // The child frame shares origin and axis with the joint frame for a turning joint; a sliding joint only
            // needs the axis, which sliding does not turn.
            let root_from_child = poses.get(joint.child);
            let axis = root_from_child.rotation * joint.axis.into_inner() * multiplier;
            match joint.kind {
                JointKind::Fixed => {}
                JointKind::Prismatic => {
                    for row in 0..3 {
                        jacobian[(row, column)] += axis[row];
                    }
                }
                JointKind::Revolute | JointKind::Continuous => {
                    let arm = point_in_root.coords - root_from_child.translation.vector;
                    let linear = axis.cross(&arm);
                    for row in 0..3 {
                        jacobian[(row, column)] += linear[row];
                        jacobian[(row + 3, column)] += axis[row];
                    }
                }
            }
        }
        jacobian
    }

    /// The joints whose motion moves `link`, from the root outwards.
    pub fn joints_to(&self, link: LinkId) -> Vec<usize> {
        let mut chain = Vec::new();
        let mut current = link;
        while let Some(index) = self.links[current.0].parent_joint {
            chain.push(index);
            current = self.joints[index].parent;
        }
        chain.reverse();
        chain
    }

    /// For each link the first link of the rigid body it belongs to: links joined by fixed joints are one body.
    pub fn rigid_bodies(&self) -> Vec<LinkId> {
        let mut bodies: Vec<LinkId> = (0..self.links.len()).map(LinkId).collect();
        for joint in self.joints.iter().filter(|joint| joint.kind == JointKind::Fixed) {
            bodies[joint.child.0] = bodies[joint.parent.0];
        }
        bodies
    }

    /// The links that move when a joint of the group does, in the order of the links.
    pub fn links_moved_by(&self, group: &Group) -> Vec<LinkId> {
        let drives = |joint: &usize| match self.joints[*joint].drive {
            Drive::Fixed => false,
            Drive::Variable { variable, .. } => group.variables.contains(&variable),
        };
        (0..self.links.len()).map(LinkId).filter(|link| self.joints_to(*link).iter().any(drives)).collect()
    }
}
