//! Physics on rapier.

use super::GRAVITY_M_PER_S2;
use super::convert::{from_point, from_pose, from_vector};
use super::drive::{after_step, before_step};
use super::motors::Motors;
use super::robot_body::{BuiltRobot, build_robot, find_link_of_tag};
use super::robot_spec::{RobotBody, RobotStart};
use super::scene_body::{IgnoredPairs, insert_scene};
use super::scene_joint::{StandingPart, find_standing, pose_of};
use super::settle::settle_scene;
use super::spin::PadSpin;
use super::{BodyVelocity, Contact, ContactParty, Engine, Hands, JointTarget, Physics, PhysicsConfig, PhysicsError};
use crate::scene::SceneModel;
use dsm::Pose;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::{JointNames, JointPositions, JointVelocities};
use nalgebra::{Point3, Vector3};
use rapier3d::prelude::*;
use std::collections::BTreeMap;

/// Natural frequency of contacts, Hz.
const CONTACT_HZ: f32 = 100.0;

/// Rapier as the engine of a world.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rapier(pub PhysicsConfig);

impl Engine for Rapier {
    fn build(
        &self,
        scene: &SceneModel,
        robot: &RobotBody,
        start: &RobotStart,
    ) -> Result<Box<dyn Physics>, PhysicsError> {
        Ok(Box::new(RapierPhysics::new(scene, robot, start, self.0)?))
    }

    fn settle(&self, scene: &SceneModel, span: Span) -> Result<Vec<Pose>, PhysicsError> {
        check(&self.0)?;
        settle_scene(scene, span, self.0)
    }
}

/// The world on rapier, single precision, deterministic on one thread.
pub struct RapierPhysics {
    pub(super) world: PhysicsWorld,
    pub(super) scene_bodies: Vec<RigidBodyHandle>,
    /// Friction of the colliders of bodies that were made slippery, as the scene says.
    pub(super) own_friction: BTreeMap<usize, Vec<f32>>,
    standing: Vec<Option<StandingPart>>,
    robot: BuiltRobot,
    motors: Motors,
    spin: PadSpin,
    filter: IgnoredPairs,
    step: Span,
    steps: i64,
}

impl RapierPhysics {
    /// Puts the scene and the robot into the engine.
    ///
    /// # Errors
    /// [`PhysicsError`] for shapes without volume, free bodies without mass, unknown links or joints, values out of
    /// range.
    pub fn new(
        scene: &SceneModel,
        robot: &RobotBody,
        start: &RobotStart,
        config: PhysicsConfig,
    ) -> Result<Self, PhysicsError> {
        check(&config)?;
        let mut world = new_world(config);
        let scene_bodies = insert_scene(&mut world, scene)?;
        let standing = find_standing(scene, &world, &scene_bodies);
        let built = build_robot(robot, &mut world)?;
        let positions = robot.start_positions(&built.moving, start)?;
        place_robot(&mut world, &built, start, &positions);
        let fingers = (built.finger_joints, robot.fingers.max_force_n);
        let base = [start.x_m, start.y_m, start.yaw_rad];
        let motors = Motors::new(&built.moving, fingers, robot.drive, base, &positions);
        let filter = IgnoredPairs::new(scene, built.ignored.clone());
        Ok(Self {
            world,
            scene_bodies,
            standing,
            own_friction: BTreeMap::new(),
            robot: built,
            motors,
            spin: PadSpin::default(),
            filter,
            step: config.step,
            steps: 0,
        })
    }

    fn find_party(&self, collider: ColliderHandle) -> Option<ContactParty> {
        let tag = self.world.colliders.get(collider)?.user_data;
        Some(find_link_of_tag(tag).map_or(ContactParty::Body(tag as usize), ContactParty::Link))
    }

    /// Contacts with a force, by pair of parties: sum of forces, depth, point.
    fn touching(&self) -> BTreeMap<(ContactParty, ContactParty), (f64, f64, Point3<f64>)> {
        let mut touching = BTreeMap::new();
        for pair in self.world.contact_pairs() {
            let force = f64::from(pair.total_impulse_magnitude()) / self.step.as_s();
            if force <= 0.0 {
                continue;
            }
            let (Some(a), Some(b)) = (self.find_party(pair.collider1), self.find_party(pair.collider2)) else {
                continue;
            };
            let (depth, point) = self.deepest(pair);
            let entry = touching.entry((a.min(b), a.max(b))).or_insert((0.0, f64::NEG_INFINITY, point));
            entry.0 += force;
            if depth > entry.1 {
                (entry.1, entry.2) = (depth, point);
            }
        }
        touching
    }

    fn deepest(&self, pair: &ContactPair) -> (f64, Point3<f64>) {
        let found = pair.find_deepest_contact().and_then(|(manifold, contact)| {
            let collider = self.world.colliders.get(pair.collider1)?;
            let on_collider = manifold.subshape_pos1().map_or(contact.local_p1, |pose| pose * contact.local_p1);
            Some((-f64::from(contact.dist), from_point(*collider.position() * on_collider)))
        });
        found.unwrap_or((0.0, Point3::origin()))
    }
}

/// An empty world with our gravity and solver settings.
pub(super) fn new_world(config: PhysicsConfig) -> PhysicsWorld {
    let mut world =
        PhysicsWorld { gravity: Vector::new(0.0, 0.0, -GRAVITY_M_PER_S2 as f32), ..PhysicsWorld::default() };
    world.integration_parameters.dt = config.step.as_s() as f32;
    world.integration_parameters.num_solver_iterations = config.solver_iterations;
    world.integration_parameters.num_internal_pgs_iterations = config.sweeps;
    // Without friction in the biased pass a held object creeps by 2 to 7 mm/s and every grasp is lost in the end.
    world.integration_parameters.friction_in_bias_pass = true;
    // Contact points kept from earlier steps rock what stands on a round foot: cans and balls never come to rest.
    world.integration_parameters.contact_recycling = false;
    // At the engine's 30 Hz a grip of 30 N sinks a finger 13 mm into an apple; at 100 Hz 1 mm.
    world.integration_parameters.contact_softness.natural_frequency = CONTACT_HZ;
    world.integration_parameters.static_contact_softness.natural_frequency = CONTACT_HZ;
    world
}

pub(super) fn check(config: &PhysicsConfig) -> Result<(), PhysicsError> {
    let out = |name: &str, value: f64, expected: &str| {
        Err(PhysicsError::OutOfRange { name: name.into(), value, expected: expected.into() })
    };
    if !(500_000..=5_000_000).contains(&config.step.0) {
        return out("physics step", config.step.as_s(), "0.0005 to 0.005 s");
    }
    if !(1..=32).contains(&config.solver_iterations) {
        return out("solver_iterations", config.solver_iterations as f64, "1 to 32");
    }
    if !(1..=8).contains(&config.sweeps) {
        return out("sweeps", config.sweeps as f64, "1 to 8");
    }
    Ok(())
}

/// Moves base and joints to the start.
fn place_robot(world: &mut PhysicsWorld, robot: &BuiltRobot, start: &RobotStart, positions: &[f64]) {
    let PhysicsWorld { multibody_joints, bodies, .. } = world;
    let index = |multibody: &Multibody, link: usize| multibody.link(link).map_or(0, |l| l.assembly_id());
    let offsets: Vec<Option<(usize, f32)>> = robot
        .joints
        .iter()
        .zip(positions)
        .map(|(place, value)| {
            let (multibody, link) = multibody_joints.get(place.joint)?;
            Some((index(multibody, link), *value as f32))
        })
        .collect();
    if let Some((multibody, base)) = multibody_joints.get_mut(robot.base_joint) {
        let mut displacement = vec![0.0; multibody.ndofs()];
        let at = index(multibody, base);
        displacement[at..at + 3].copy_from_slice(&[start.x_m as f32, start.y_m as f32, start.yaw_rad as f32]);
        for (at, value) in offsets.into_iter().flatten() {
            displacement[at] = value;
        }
        let [left, right] = robot.finger_joints.map(|f| multibody_link(multibody, robot.joints[f].child));
        multibody.add_dof_coupling(MultibodyDofCoupling {
            link1: left,
            dof1: 0,
            axis1: 0,
            link2: right,
            dof2: 0,
            axis2: 0,
            coeff: 1.0,
            offset: 0.0,
        });
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(bodies, true);
        multibody.update_rigid_bodies(bodies, true);
    }
}

fn multibody_link(multibody: &Multibody, body: RigidBodyHandle) -> usize {
    multibody.links().position(|l| l.rigid_body_handle() == body).unwrap_or(0)
}

impl Physics for RapierPhysics {
    fn now(&self) -> Stamp {
        Stamp(self.steps * self.step.0)
    }

    fn step_length(&self) -> Span {
        self.step
    }

    fn step(&mut self) {
        before_step(&mut self.motors, &self.robot, &mut self.world, self.step.as_s());
        self.spin.apply(&self.robot, &mut self.world, self.step.as_s());
        self.world.step_with_events(&self.filter, &());
        after_step(&mut self.motors, &self.robot, &self.world, self.step.as_s());
        self.steps += 1;
    }

    fn body_count(&self) -> usize {
        self.scene_bodies.len()
    }

    fn world_from_body(&self, body: usize) -> Pose {
        pose_of(body, &self.world, &self.scene_bodies, &self.standing)
    }

    fn body_velocity(&self, body: usize) -> BodyVelocity {
        let body = &self.world.bodies[self.scene_bodies[body]];
        BodyVelocity { linear_m_per_s: from_vector(body.linvel()), angular_rad_per_s: from_vector(body.angvel()) }
    }

    fn link_names(&self) -> &[String] {
        &self.robot.link_names
    }

    fn world_from_link(&self, link: usize) -> Pose {
        let place = &self.robot.links[link];
        from_pose(self.world.bodies[place.body].position()) * place.body_from_link
    }

    fn world_from_base(&self) -> Pose {
        from_pose(self.world.bodies[self.robot.base].position())
    }

    fn base_velocity(&self) -> Twist {
        let body = &self.world.bodies[self.robot.base];
        let world_from_base = from_pose(body.position());
        let angular = from_vector(body.angvel());
        // Rapier gives the velocity of the centre of mass; the base frame lies beside it.
        let arm = world_from_base.translation.vector - from_vector(body.center_of_mass());
        let linear: Vector3<f64> = from_vector(body.linvel()) + angular.cross(&arm);
        Twist { forward_m_per_s: (world_from_base.rotation.inverse() * linear).x, turn_rad_per_s: angular.z }
    }

    fn command_base(&mut self, twist: Twist) {
        self.motors.command_base(twist);
    }

    fn hands(&mut self) -> Option<&mut dyn Hands> {
        Some(self)
    }

    fn joint_names(&self) -> &JointNames {
        &self.robot.joint_names
    }

    fn joint_positions(&self) -> JointPositions {
        let mut positions = JointPositions::zeros(&self.robot.joint_names);
        positions.values_mut().iter_mut().zip(self.motors.positions()).for_each(|(value, position)| *value = position);
        positions
    }

    fn joint_velocities(&self) -> JointVelocities {
        let mut velocities = JointVelocities::zeros(&self.robot.joint_names);
        velocities
            .values_mut()
            .iter_mut()
            .zip(self.motors.velocities())
            .for_each(|(value, velocity)| *value = velocity);
        velocities
    }

    fn joint_effort(&self, joint: usize) -> f64 {
        self.motors.effort(joint)
    }

    fn command_joint(&mut self, joint: usize, target: JointTarget) {
        self.motors.command_joint(joint, target);
    }

    fn contacts(&self) -> Vec<Contact> {
        let contact = |((first, second), (force_n, depth_m, point_in_world))| Contact {
            first,
            second,
            force_n,
            depth_m: f64::max(depth_m, 0.0),
            point_in_world,
        };
        self.touching().into_iter().map(contact).collect()
    }

    fn grip_force_n(&self) -> f64 {
        let on_finger = |finger: usize| {
            let finger = ContactParty::Link(self.robot.finger_links[finger]);
            let with_bodies =
                self.touching().into_iter().filter(|((a, b), _)| *b == finger && matches!(a, ContactParty::Body(_)));
            with_bodies.map(|(_, (force, _, _))| force).sum::<f64>()
        };
        on_finger(0).min(on_finger(1))
    }
}
