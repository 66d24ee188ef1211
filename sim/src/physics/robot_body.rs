//! The robot as one articulated body: how it is put together.

use super::PhysicsError;
use super::convert::{to_pose, to_vector};
use super::robot_spec::{LINK_FRICTION, MovingJoint, RobotBody};
use super::shapes::link_shape;
use dsm::Pose;
use dsm_robot::joints::JointNames;
use dsm_robot::model::kinematics::{Joint, Link};
use dsm_robot::model::{JointKind, LinkId};
use nalgebra::{UnitQuaternion, Vector3};
use rapier3d::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;

/// A link of the robot: rigidly on a rigid body.
pub(super) struct LinkPlace {
    pub(super) body: RigidBodyHandle,
    pub(super) body_from_link: Pose,
}

/// A movable joint in the engine.
pub(super) struct JointPlace {
    /// The body that the joint moves.
    pub(super) child: RigidBodyHandle,
    pub(super) joint: MultibodyJointHandle,
    /// The free axis in rapier's joint frame.
    pub(super) axis: JointAxis,
    /// Frame of the joint in the parent body, with the joint's axis along x.
    pub(super) parent: RigidBodyHandle,
    pub(super) parent_from_axis: Pose,
    pub(super) prismatic: bool,
    /// Indices of the bodies (into [`BuiltRobot::bodies`]) that the joint carries.
    pub(super) carries: Vec<usize>,
}

/// The robot in the engine.
pub(super) struct BuiltRobot {
    pub(super) base: RigidBodyHandle,
    pub(super) base_joint: MultibodyJointHandle,
    /// The moving bodies with their masses, base first, parents before children.
    pub(super) bodies: Vec<(RigidBodyHandle, f64)>,
    pub(super) joints: Vec<JointPlace>,
    /// The limits of the joints.
    pub(super) moving: Vec<MovingJoint>,
    pub(super) joint_names: JointNames,
    pub(super) link_names: Vec<String>,
    pub(super) links: Vec<LinkPlace>,
    pub(super) finger_joints: [usize; 2],
    pub(super) finger_links: [usize; 2],
    /// Pairs of link indices (lesser first) that never collide.
    pub(super) ignored: BTreeSet<(usize, usize)>,
}

struct Builder<'a> {
    robot: &'a RobotBody,
    world: &'a mut PhysicsWorld,
    links: Vec<Option<LinkPlace>>,
    bodies: Vec<(RigidBodyHandle, f64)>,
    parents: Vec<Option<usize>>,
    joints: Vec<Option<JointPlace>>,
}

/// Builds the robot at the origin with all joints at 0 (or at the limit nearest to 0).
pub(super) fn build_robot(robot: &RobotBody, world: &mut PhysicsWorld) -> Result<BuiltRobot, PhysicsError> {
    robot.check()?;
    let base_index = robot.get_link(&robot.base_link)?;
    let mut builder = Builder {
        robot,
        links: robot.kinematics.links.iter().map(|_| None).collect(),
        joints: robot.kinematics.joints.iter().map(|_| None).collect(),
        bodies: Vec::new(),
        parents: Vec::new(),
        world,
    };
    let root = builder.world.insert_body(RigidBodyBuilder::fixed());
    let base = builder.add_body(base_index, None)?;
    let locked = JointAxesMask::LIN_Z | JointAxesMask::ANG_X | JointAxesMask::ANG_Y;
    let base_joint = insert_joint(builder.world, root, base, GenericJointBuilder::new(locked).build());
    builder.add_children(base_index)?;
    builder.finish(base, base_joint)
}

fn insert_joint(
    world: &mut PhysicsWorld,
    parent: RigidBodyHandle,
    child: RigidBodyHandle,
    joint: GenericJoint,
) -> MultibodyJointHandle {
    world
        .multibody_joints
        .insert(parent, child, joint, true)
        .expect("a URDF is a tree: a freshly made body has no other parent")
}

impl Builder<'_> {
    /// A new rigid body that carries the link and all links fixed to it.
    fn add_body(&mut self, link: usize, parent: Option<usize>) -> Result<RigidBodyHandle, PhysicsError> {
        let mut parts = Vec::new();
        self.collect_fixed(link, Pose::identity(), &mut parts);
        let links = &self.robot.kinematics.links;
        let mut mass_properties: MassProperties = nalgebra::zero();
        for (part, body_from_part) in &parts {
            mass_properties += link_mass(&links[*part]).transform_by(&to_pose(body_from_part));
        }
        let mass_kg = f64::from(mass_properties.mass());
        if mass_kg <= 0.0 {
            return Err(PhysicsError::NoMass { name: links[link].name.clone(), mass_kg });
        }
        // The motors do not wake a sleeping link, so links never sleep.
        let body = RigidBodyBuilder::dynamic().additional_mass_properties(mass_properties).can_sleep(false);
        let handle = self.world.insert_body(body);
        for (part, body_from_part) in parts {
            self.add_colliders(part, &body_from_part, handle)?;
            self.links[part] = Some(LinkPlace { body: handle, body_from_link: body_from_part });
        }
        self.bodies.push((handle, mass_kg));
        self.parents.push(parent);
        Ok(handle)
    }

    fn collect_fixed(&self, link: usize, body_from_link: Pose, parts: &mut Vec<(usize, Pose)>) {
        parts.push((link, body_from_link));
        let joints = &self.robot.kinematics.joints;
        for joint in joints.iter().filter(|j| j.parent == LinkId(link) && j.kind == JointKind::Fixed) {
            self.collect_fixed(joint.child.0, body_from_link * joint.parent_from_joint, parts);
        }
    }

    fn add_colliders(&mut self, link: usize, body_from_link: &Pose, body: RigidBodyHandle) -> Result<(), PhysicsError> {
        let Link { name, collisions, .. } = &self.robot.kinematics.links[link];
        let is_finger = self.robot.fingers.links.contains(name);
        let friction = if is_finger { self.robot.fingers.friction } else { LINK_FRICTION };
        for part in collisions {
            let (geometry_from_shape, shape) = link_shape(name, &part.geometry)?;
            let pose = to_pose(&(body_from_link * part.link_from_shape)) * geometry_from_shape;
            let collider = ColliderBuilder::new(shape)
                .position(pose)
                .density(0.0)
                .friction(friction as f32)
                .friction_combine_rule(CoefficientCombineRule::GeometricMean)
                .active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS)
                .user_data(link_tag(link));
            self.world.insert_collider(collider, Some(body));
        }
        Ok(())
    }

    /// Adds the bodies moved by the joints of `link` and of everything fixed to it.
    fn add_children(&mut self, link: usize) -> Result<(), PhysicsError> {
        let robot = self.robot;
        for (index, joint) in robot.kinematics.joints.iter().enumerate().filter(|(_, j)| j.parent == LinkId(link)) {
            let child = joint.child.0;
            if joint.kind != JointKind::Fixed {
                self.add_moving(index, joint, link, child)?;
            }
            self.add_children(child)?;
        }
        Ok(())
    }

    fn add_moving(&mut self, index: usize, joint: &Joint, parent: usize, child: usize) -> Result<(), PhysicsError> {
        let prismatic = joint.kind == JointKind::Prismatic;
        let place = self.links[parent].as_ref().expect("parents are built before their children");
        let (parent_body, body_from_parent) = (place.body, place.body_from_link);
        let parent_index = self.bodies.iter().position(|(b, _)| *b == parent_body);
        let body = self.add_body(child, parent_index)?;

        let axis = joint.axis.into_inner();
        let along_axis = UnitQuaternion::rotation_between(&Vector3::x(), &axis)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI));
        let child_from_axis = Pose::from_parts(Default::default(), along_axis);
        let parent_from_axis = body_from_parent * joint.parent_from_joint * child_from_axis;
        let (free, locked) = if prismatic {
            (JointAxis::LinX, JointAxesMask::LOCKED_PRISMATIC_AXES)
        } else {
            (JointAxis::AngX, JointAxesMask::LOCKED_REVOLUTE_AXES)
        };
        let mut data = GenericJointBuilder::new(locked)
            .local_frame1(to_pose(&parent_from_axis))
            .local_frame2(to_pose(&child_from_axis))
            .motor_model(free, MotorModel::ForceBased);
        if joint.kind != JointKind::Continuous {
            data = data.limits(free, [joint.limits.lower as f32, joint.limits.upper as f32]);
        }
        let handle = insert_joint(self.world, parent_body, body, data.build());
        self.joints[index] = Some(JointPlace {
            child: body,
            joint: handle,
            axis: free,
            parent: parent_body,
            parent_from_axis,
            prismatic,
            carries: Vec::new(),
        });
        Ok(())
    }

    fn finish(self, base: RigidBodyHandle, base_joint: MultibodyJointHandle) -> Result<BuiltRobot, PhysicsError> {
        let link_names: Vec<String> = self.robot.kinematics.links.iter().map(|l| l.name.clone()).collect();
        let mut joints: Vec<JointPlace> = self.joints.into_iter().flatten().collect();
        for joint in &mut joints {
            for index in 0..self.bodies.len() {
                let mut ancestor = Some(index);
                while let Some(at) = ancestor {
                    if self.bodies[at].0 == joint.child {
                        joint.carries.push(index);
                    }
                    ancestor = self.parents[at];
                }
            }
        }
        let mut links = Vec::new();
        for (place, name) in self.links.into_iter().zip(&link_names) {
            // A link that hangs on no joint of the base's tree is not part of the robot.
            links.push(place.ok_or_else(|| PhysicsError::NoLink {
                name: self.robot.base_link.clone(),
                known: vec![format!("{name} (the tree's root lies above the base link)")],
            })?);
        }
        let moving = self.robot.moving_joints()?;
        let names: Vec<Arc<str>> = moving.iter().map(|joint| joint.name.as_str().into()).collect();
        Ok(BuiltRobot {
            base,
            base_joint,
            bodies: self.bodies,
            joints,
            finger_joints: self.robot.finger_joints(&moving)?,
            finger_links: self.robot.finger_links()?,
            ignored: self.robot.ignored_links()?,
            moving,
            joint_names: names.into(),
            link_names,
            links,
        })
    }
}

fn link_mass(link: &Link) -> MassProperties {
    let inertial = &link.inertial;
    if inertial.mass_kg <= 0.0 {
        return nalgebra::zero();
    }
    let (pose, inertia) = (&inertial.link_from_inertial, &inertial.inertia_kg_m2);
    // The inertia is given in the axes of the inertial origin; its eigenvectors are the principal frame.
    let rotation = pose.rotation.to_rotation_matrix();
    let m = rotation.matrix() * inertia * rotation.matrix().transpose();
    let column = |c: usize| to_vector(&Vector3::new(m[(0, c)], m[(1, c)], m[(2, c)]));
    let matrix = Matrix::from_cols(column(0), column(1), column(2));
    MassProperties::with_inertia_matrix(to_vector(&pose.translation.vector), inertial.mass_kg as f32, matrix)
}

const LINK_TAG: u128 = 1 << 64;

/// What a collider of a link carries as user data.
pub(super) fn link_tag(link: usize) -> u128 {
    LINK_TAG | link as u128
}

/// The link whose collider carries this user data.
pub(super) fn find_link_of_tag(tag: u128) -> Option<usize> {
    (tag & LINK_TAG != 0).then_some((tag & u128::from(u64::MAX)) as usize)
}
