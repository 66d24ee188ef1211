//! A world in motion on MuJoCo.

use crate::MujocoConfig;
use crate::compose::{add_scene, new_spec, refused};
use crate::messages::route_messages;
use crate::places::{Places, damp, find_places, find_scene_bodies, pose};
use crate::robot::{BASE_JOINTS, add_grip_pairs, add_robot, link_name};
use dsm::Pose;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Twist;
use dsm_robot::joints::{JointNames, JointPositions, JointVelocities};
use dsm_sim::physics::{
    BodyVelocity, Contact, ContactParty, JointTarget, Motors, Physics, PhysicsError, RobotBody, RobotStart, Setpoint,
};
use dsm_sim::scene::SceneModel;
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase};
use nalgebra::{Point3, Translation3, UnitQuaternion};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Contacts with a force, by pair of parties: sum of forces, depth, point.
type Touching = BTreeMap<(ContactParty, ContactParty), (f64, f64, Point3<f64>)>;

/// Where a joint's state lies.
#[derive(Clone, Copy, Debug)]
struct JointPlace {
    position: usize,
    velocity: usize,
}

/// The world on MuJoCo, double precision, deterministic.
pub struct MujocoPhysics {
    data: MjData<Box<MjModel>>,
    /// A twin of the model: effort bounds are changed in it, then the two change places.
    twin: Option<Box<MjModel>>,
    /// The effort bounds in force.
    bounds: Vec<f64>,
    motors: Motors,
    bodies: Places,
    base: [JointPlace; 3],
    joints: Vec<JointPlace>,
    joint_names: JointNames,
    links: Vec<usize>,
    link_names: Vec<String>,
    finger_links: [usize; 2],
    /// What each geom belongs to.
    parties: Vec<Option<ContactParty>>,
    /// The tree of joints that each scene body is; `None` for fixed ones.
    trees: Vec<Option<usize>>,
    /// Which trees sleep, and what touches among them: MuJoCo forgets it.
    asleep: Vec<bool>,
    resting: Touching,
    step: Span,
    steps: i64,
}

impl MujocoPhysics {
    /// Puts the scene and the robot into the engine.
    ///
    /// # Errors
    /// [`PhysicsError`] for shapes without volume, free bodies without mass, unknown links or joints, values out of
    /// range, and what MuJoCo itself refuses.
    pub fn new(
        scene: &SceneModel,
        robot: &RobotBody,
        start: &RobotStart,
        config: MujocoConfig,
    ) -> Result<Self, PhysicsError> {
        route_messages();
        config.check()?;
        robot.check()?;
        let joints = robot.moving_joints()?;
        let positions = robot.start_positions(&joints, start)?;
        let base = [start.x_m, start.y_m, start.yaw_rad];
        let fingers = (robot.finger_joints(&joints)?, robot.fingers.max_force_n);
        let motors = Motors::new(&joints, fingers, robot.drive, base, &positions);

        let mut spec = new_spec(&config);
        add_scene(&mut spec, scene)?;
        add_robot(&mut spec, robot, &joints)?;
        add_grip_pairs(&mut spec, robot, scene)?;
        let mut model = Box::new(spec.compile().map_err(refused)?);

        let link_names: Vec<String> = robot.kinematics.links.iter().map(|link| link.name.clone()).collect();
        let find_link = |name: &String| {
            model.name_to_id(MjtObjBase::mjOBJ_BODY, &link_name(name)).ok_or_else(|| PhysicsError::NoLink {
                name: robot.base_link.clone(),
                known: vec![format!("{name} (the tree's root lies above the base link)")],
            })
        };
        let links = link_names.iter().map(find_link).collect::<Result<Vec<_>, _>>()?;
        let scene_bodies = find_scene_bodies(&model, scene)?;
        let bodies = find_places(&model, scene, &scene_bodies)?;
        let of_geom = |body: &i32| {
            let body = *body as usize;
            let scene_body = scene_bodies.iter().position(|id| *id == body).map(ContactParty::Body);
            scene_body.or_else(|| links.iter().position(|id| *id == body).map(ContactParty::Link))
        };
        let parties = model.geom_bodyid().iter().map(of_geom).collect();
        let trees = scene_bodies.iter().map(|id| usize::try_from(model.body_treeid()[*id]).ok()).collect();
        let place = |name: &str| find_joint(&model, name);
        let [x, y, yaw] = BASE_JOINTS.map(place);
        let base_places = [x?, y?, yaw?];
        let joint_places = joints.iter().map(|joint| place(&joint.name)).collect::<Result<Vec<_>, _>>()?;
        let names: Vec<Arc<str>> = joints.iter().map(|joint| joint.name.as_str().into()).collect();

        damp(&mut model, &bodies, &scene_bodies);
        let mut physics = Self {
            twin: Some(model.clone()),
            data: MjData::new(model),
            bounds: vec![0.0; BASE_JOINTS.len() + joints.len()],
            motors,
            bodies,
            base: base_places,
            joints: joint_places,
            joint_names: names.into(),
            links,
            link_names,
            finger_links: robot.finger_links()?,
            parties,
            trees,
            asleep: Vec::new(),
            resting: Touching::new(),
            step: config.step,
            steps: 0,
        };
        physics.set_gains();
        physics.bodies.place_joints(scene, physics.data.qpos_mut());
        physics.place(base, &positions);
        Ok(physics)
    }

    /// A copy of the state with its model, for comparisons with MuJoCo's own step.
    pub fn copy_of_data(&self) -> MjData<Box<MjModel>> {
        self.data.clone()
    }

    /// Stiffness and damping of the motors never change.
    fn set_gains(&mut self) {
        let setpoints = self.plan();
        let Some(mut twin) = self.twin.take() else { return };
        for (index, setpoint) in setpoints.iter().enumerate() {
            let bias = &mut twin.actuator_biasprm_mut()[index];
            (bias[1], bias[2]) = (-setpoint.stiffness, -setpoint.damping);
        }
        let mut other = self.data.swap_model(twin);
        other.actuator_biasprm_mut().copy_from_slice(self.data.model().actuator_biasprm());
        self.twin = Some(other);
    }

    fn place(&mut self, base: [f64; 3], positions: &[f64]) {
        let values = base.iter().chain(positions);
        let places: Vec<usize> = self.base.iter().chain(&self.joints).map(|place| place.position).collect();
        for (place, value) in places.into_iter().zip(values) {
            self.data.qpos_mut()[place] = *value;
        }
        self.data.kinematics();
    }

    /// Set points of all motors for the next step.
    fn plan(&mut self) -> Vec<Setpoint> {
        let dt_s = self.step.as_s();
        let position = self.base.map(|place| self.data.qpos()[place.position]);
        let mut setpoints = self.motors.plan_base(position, dt_s).to_vec();
        setpoints.extend((0..self.joints.len()).map(|joint| self.motors.plan_joint(joint, dt_s)));
        setpoints
    }

    /// Hands the set points to the motors.
    fn drive(&mut self) {
        let setpoints = self.plan();
        for (control, setpoint) in self.data.ctrl_mut().iter_mut().zip(&setpoints) {
            *control = setpoint.stiffness * setpoint.position + setpoint.damping * setpoint.velocity;
        }
        // What carries the robot comes beside the actuators here: they give only what is beyond it.
        let bounds: Vec<f64> =
            setpoints.iter().map(|setpoint| setpoint.max_effort.min(setpoint.spare_effort)).collect();
        if bounds == self.bounds {
            return;
        }
        let Some(mut twin) = self.twin.take() else { return };
        for (range, bound) in twin.actuator_forcerange_mut().iter_mut().zip(&bounds) {
            *range = [-bound, *bound];
        }
        self.twin = Some(self.data.swap_model(twin));
        self.bounds = bounds;
    }

    fn measure(&mut self) {
        for (index, place) in self.joints.iter().enumerate() {
            let position = self.data.qpos()[place.position];
            let velocity = self.data.qvel()[place.velocity];
            let effort = self.data.qfrc_actuator()[place.velocity];
            self.motors.measure(index, position, velocity, effort);
        }
    }

    /// Whether a party is at rest for good: fixed, or asleep.
    fn rests(&self, party: ContactParty) -> bool {
        match party {
            ContactParty::Body(body) => self.trees[body].is_none_or(|tree| self.asleep[tree]),
            ContactParty::Link(_) => false,
        }
    }

    /// Keeps what touched when bodies fell asleep until they wake.
    fn follow_sleep(&mut self) {
        let asleep = self.data.tree_asleep().iter().map(|state| *state >= 0);
        if asleep.clone().eq(self.asleep.iter().copied()) {
            return;
        }
        self.asleep = asleep.collect();
        let mut resting = self.touching();
        resting.retain(|(a, b), _| self.rests(*a) && self.rests(*b));
        self.resting = resting;
    }

    /// Everything that touches, asleep or not.
    fn touching(&self) -> Touching {
        let mut touching = self.resting.clone();
        touching.extend(self.touching_awake());
        touching
    }

    /// What the last step's solver pushed apart.
    fn touching_awake(&self) -> Touching {
        let mut touching = Touching::new();
        for (index, contact) in self.data.contact().iter().enumerate() {
            // Near, but not within the solver's reach.
            if contact.efc_address < 0 {
                continue;
            }
            let [Some(a), Some(b)] = contact.geom.map(|geom| self.parties.get(geom as usize).copied().flatten()) else {
                continue;
            };
            let force = self.data.contact_force(index)[0];
            if force <= 0.0 {
                continue;
            }
            let (depth, point) = (-contact.dist, Point3::from(contact.pos));
            let entry = touching.entry((a.min(b), a.max(b))).or_insert((0.0, f64::NEG_INFINITY, point));
            entry.0 += force;
            if depth > entry.1 {
                (entry.1, entry.2) = (depth, point);
            }
        }
        touching
    }
}

fn find_joint(model: &MjModel, name: &str) -> Result<JointPlace, PhysicsError> {
    let joint = model.name_to_id(MjtObjBase::mjOBJ_JOINT, name);
    let joint = joint.ok_or_else(|| refused(format!("lost joint `{name}`")))?;
    Ok(JointPlace { position: model.jnt_qposadr()[joint] as usize, velocity: model.jnt_dofadr()[joint] as usize })
}

impl Physics for MujocoPhysics {
    fn now(&self) -> Stamp {
        Stamp(self.steps * self.step.0)
    }

    fn step_length(&self) -> Span {
        self.step
    }

    fn step(&mut self) {
        self.drive();
        self.data.step();
        // MuJoCo leaves links where they were before the step; contacts and forces stay those of the step.
        self.data.kinematics();
        self.measure();
        self.follow_sleep();
        self.steps += 1;
    }

    fn body_count(&self) -> usize {
        self.bodies.len()
    }

    fn world_from_body(&self, body: usize) -> Pose {
        self.bodies.pose(body, self.data.qpos())
    }

    fn body_velocity(&self, body: usize) -> BodyVelocity {
        let positions = self.data.qpos();
        let center = self.bodies.center(body, positions);
        let (linear, angular) = self.bodies.velocity_at(body, &center, (positions, self.data.qvel()));
        BodyVelocity { linear_m_per_s: linear, angular_rad_per_s: angular }
    }

    fn link_names(&self) -> &[String] {
        &self.link_names
    }

    fn world_from_link(&self, link: usize) -> Pose {
        let id = self.links[link];
        pose(&self.data.xpos()[id], &self.data.xquat()[id])
    }

    fn world_from_base(&self) -> Pose {
        let [x, y, yaw] = self.base.map(|place| self.data.qpos()[place.position]);
        Pose::from_parts(Translation3::new(x, y, 0.0), UnitQuaternion::from_euler_angles(0.0, 0.0, yaw))
    }

    fn base_velocity(&self) -> Twist {
        let [x, y, turn] = self.base.map(|place| self.data.qvel()[place.velocity]);
        let (sin, cos) = self.data.qpos()[self.base[2].position].sin_cos();
        Twist { forward_m_per_s: x * cos + y * sin, turn_rad_per_s: turn }
    }

    fn command_base(&mut self, twist: Twist) {
        self.motors.command_base(twist);
    }

    fn joint_names(&self) -> &JointNames {
        &self.joint_names
    }

    fn joint_positions(&self) -> JointPositions {
        let mut positions = JointPositions::zeros(&self.joint_names);
        positions.values_mut().iter_mut().zip(self.motors.positions()).for_each(|(value, position)| *value = position);
        positions
    }

    fn joint_velocities(&self) -> JointVelocities {
        let mut velocities = JointVelocities::zeros(&self.joint_names);
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
        let touching = self.touching();
        let on_finger = |finger: usize| {
            let finger = ContactParty::Link(self.finger_links[finger]);
            let with_bodies = touching.iter().filter(|((a, b), _)| *b == finger && matches!(a, ContactParty::Body(_)));
            with_bodies.map(|(_, (force, _, _))| force).sum::<f64>()
        };
        on_finger(0).min(on_finger(1))
    }
}
