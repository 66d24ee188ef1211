//! The robot as a tree of MuJoCo's bodies: links, joints, motors.

use crate::compose::{ROBOT_MEETS, add_pair, geom_name, refused, set_contact, set_pose, wxyz};
use dsm::Pose;
use dsm_sim::physics::{LINK_FRICTION, MovingJoint, PhysicsError, RobotBody, from_urdf_origin};
use dsm_sim::scene::{BodyMotion, SceneModel};
use mujoco_rs::mujoco_c::{mjtBias, mjtEq, mjtGain, mjtJoint, mjtLimited, mjtSleepPolicy, mjtTrn};
use mujoco_rs::prelude::{MjSpec, MjtGeomBase, MjtObjBase, SpecItem};
use mujoco_rs::wrappers::mj_editing::MjsBody;
use nalgebra::Matrix3;
use urdf_rs::{Geometry, Joint, JointType};

/// Joints of the base, x, y and yaw, in this order.
pub(crate) const BASE_JOINTS: [&str; 3] = ["base/x", "base/y", "base/yaw"];
/// The gear between the fingers is stiffer than any contact.
const GEAR_SOLREF: [f64; 2] = [0.01, 1.0];
const GEAR_SOLIMP: [f64; 5] = [0.99, 0.999, 0.001, 0.5, 2.0];

/// Inertia of the drives, as the time in which full effort brings it to top speed, seconds. Real gears weigh that much and
/// more; a jaw of 100 g alone would shoot at 1 m/s within one step of its motor's full force.
const GEAR_S: f64 = 0.005;

/// Name of a link in the model.
pub(crate) fn link_name(link: &str) -> String {
    format!("robot/{link}")
}

/// Adds links, joints, gear and motors. Motors come in the order of the base's joints, then of `joints`.
pub(crate) fn add_robot(spec: &mut MjSpec, robot: &RobotBody, joints: &[MovingJoint]) -> Result<(), PhysicsError> {
    let base = robot.get_link(&robot.base_link)?;
    add_link(spec.world_body_mut(), robot, base, None)?;
    for (a, b) in robot.ignored_links()? {
        let [a, b] = [a, b].map(|link| link_name(&robot.urdf.links[link].name));
        let exclude = spec.add_exclude();
        exclude.set_bodyname1(&a);
        exclude.set_bodyname2(&b);
    }
    let [left, right] = robot.finger_joints(joints)?;
    let gear = spec.add_equality();
    gear.set_type(mjtEq::mjEQ_JOINT);
    gear.set_objtype(MjtObjBase::mjOBJ_JOINT);
    gear.set_name1(&joints[right].name);
    gear.set_name2(&joints[left].name);
    let data = gear.data_mut();
    data.fill(0.0);
    data[1] = 1.0;
    *gear.solref_mut() = GEAR_SOLREF;
    *gear.solimp_mut() = GEAR_SOLIMP;
    for name in BASE_JOINTS.into_iter().chain(joints.iter().map(|joint| joint.name.as_str())) {
        add_motor(spec, name);
    }
    Ok(())
}

/// A motor whose gains and effort bound are set in the compiled model.
fn add_motor(spec: &mut MjSpec, joint: &str) {
    let motor = spec.add_actuator();
    motor.set_target(joint);
    motor.set_trntype(mjtTrn::mjTRN_JOINT);
    motor.set_gaintype(mjtGain::mjGAIN_FIXED);
    motor.set_biastype(mjtBias::mjBIAS_AFFINE);
    motor.gainprm_mut()[0] = 1.0;
    motor.set_forcelimited(mjtLimited::mjLIMITED_TRUE);
    *motor.forcerange_mut() = [-1.0, 1.0];
}

/// Adds the pairs of finger pads and what may lie between them.
pub(crate) fn add_grip_pairs(spec: &mut MjSpec, robot: &RobotBody, scene: &SceneModel) -> Result<(), PhysicsError> {
    let pads: Vec<String> = robot
        .finger_links()?
        .iter()
        .map(|link| &robot.urdf.links[*link])
        .flat_map(|link| (0..link.collision.len()).map(|nth| pad_name(&link.name, nth)))
        .collect();
    for (index, body) in scene.bodies.iter().enumerate().filter(|(_, body)| body.motion == BodyMotion::Free) {
        for (nth, geom) in body.geoms.iter().filter(|geom| geom.collides).enumerate() {
            for pad in &pads {
                add_pair(spec, (pad, robot.fingers.friction), (&geom_name(index, nth), geom.friction));
            }
        }
    }
    Ok(())
}

fn pad_name(link: &str, nth: usize) -> String {
    format!("robot/{link}/{nth}")
}

/// Adds a link and all below it; `joint` is what it hangs on.
fn add_link(parent: &mut MjsBody, robot: &RobotBody, index: usize, joint: Option<&Joint>) -> Result<(), PhysicsError> {
    let link = &robot.urdf.links[index];
    let body = parent.add_body();
    body.set_name(&link_name(&link.name)).map_err(refused)?;
    // Motors hold the robot's own weight; the fingers' bound is then what they press with.
    body.set_gravcomp(1.0);
    match joint {
        None => {
            body.set_sleep(mjtSleepPolicy::mjSLEEP_NEVER);
            add_base_joints(body)?;
        }
        Some(joint) => {
            set_pose(body, &from_urdf_origin(&joint.origin));
            if joint.joint_type != JointType::Fixed {
                add_joint(body, robot, joint)?;
            }
        }
    }
    add_inertia(body, link);
    add_shapes(body, robot, link)?;
    if joint.is_none_or(|joint| joint.joint_type != JointType::Fixed) && mass_below(robot, index) <= 0.0 {
        return Err(PhysicsError::NoMass { name: link.name.clone(), mass_kg: 0.0 });
    }
    for joint in robot.urdf.joints.iter().filter(|joint| joint.parent.link == link.name) {
        add_link(body, robot, robot.get_link(&joint.child.link)?, Some(joint))?;
    }
    Ok(())
}

/// Mass of a link and all that is fixed to it, kilograms.
fn mass_below(robot: &RobotBody, index: usize) -> f64 {
    let link = &robot.urdf.links[index];
    let fixed =
        robot.urdf.joints.iter().filter(|joint| joint.parent.link == link.name && joint.joint_type == JointType::Fixed);
    let below = fixed.filter_map(|joint| robot.get_link(&joint.child.link).ok());
    link.inertial.mass.value + below.map(|child| mass_below(robot, child)).sum::<f64>()
}

fn add_base_joints(body: &mut MjsBody) -> Result<(), PhysicsError> {
    let axes = [
        (mjtJoint::mjJNT_SLIDE, [1.0, 0.0, 0.0]),
        (mjtJoint::mjJNT_SLIDE, [0.0, 1.0, 0.0]),
        (mjtJoint::mjJNT_HINGE, [0.0, 0.0, 1.0]),
    ];
    for (name, (kind, axis)) in BASE_JOINTS.into_iter().zip(axes) {
        let joint = body.add_joint();
        joint.set_name(name).map_err(refused)?;
        joint.set_type(kind);
        *joint.axis_mut() = axis;
    }
    Ok(())
}

fn add_joint(body: &mut MjsBody, robot: &RobotBody, joint: &Joint) -> Result<(), PhysicsError> {
    let added = body.add_joint();
    added.set_name(&joint.name).map_err(refused)?;
    let prismatic = joint.joint_type == JointType::Prismatic;
    added.set_type(if prismatic { mjtJoint::mjJNT_SLIDE } else { mjtJoint::mjJNT_HINGE });
    *added.axis_mut() = joint.axis.xyz.0;
    if joint.joint_type != JointType::Continuous {
        added.set_limited(mjtLimited::mjLIMITED_TRUE);
        *added.range_mut() = [joint.limit.lower, joint.limit.upper];
    }
    let is_finger = robot.fingers.joints.contains(&joint.name);
    let bound = if is_finger { robot.fingers.max_force_n } else { f64::INFINITY };
    let max_effort = joint.limit.effort.min(bound);
    if joint.limit.velocity > 0.0 {
        added.set_armature(GEAR_S * max_effort / joint.limit.velocity);
    }
    added.set_actgravcomp(true);
    added.set_actfrclimited(mjtLimited::mjLIMITED_TRUE);
    *added.actfrcrange_mut() = [-max_effort, max_effort];
    Ok(())
}

fn add_inertia(body: &mut MjsBody, link: &urdf_rs::Link) {
    let inertial = &link.inertial;
    if inertial.mass.value <= 0.0 {
        return;
    }
    let i = &inertial.inertia;
    let pose = from_urdf_origin(&inertial.origin);
    let inertia = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    let rotation = pose.rotation.to_rotation_matrix();
    let m = rotation.matrix() * inertia * rotation.matrix().transpose();
    body.set_explicitinertial(true);
    body.set_mass(inertial.mass.value);
    *body.ipos_mut() = pose.translation.vector.into();
    *body.fullinertia_mut() = [m[(0, 0)], m[(1, 1)], m[(2, 2)], m[(0, 1)], m[(0, 2)], m[(1, 2)]];
}

fn add_shapes(body: &mut MjsBody, robot: &RobotBody, link: &urdf_rs::Link) -> Result<(), PhysicsError> {
    let is_finger = robot.fingers.links.contains(&link.name);
    let friction = if is_finger { robot.fingers.friction } else { LINK_FRICTION };
    for (nth, part) in link.collision.iter().enumerate() {
        let pose: Pose = from_urdf_origin(&part.origin);
        let (kind, size) = match &part.geometry {
            Geometry::Box { size } => (MjtGeomBase::mjGEOM_BOX, size.0.map(|full| 0.5 * full)),
            Geometry::Cylinder { radius, length } => {
                (MjtGeomBase::mjGEOM_CYLINDER, [*radius, 0.5 * length, 0.5 * length])
            }
            Geometry::Capsule { radius, length } => {
                (MjtGeomBase::mjGEOM_CAPSULE, [*radius, 0.5 * length, 0.5 * length])
            }
            Geometry::Sphere { radius } => (MjtGeomBase::mjGEOM_SPHERE, [*radius; 3]),
            Geometry::Mesh { filename, .. } => {
                let reason = format!("collision mesh `{filename}`: use boxes, cylinders, capsules or spheres");
                return Err(PhysicsError::BadShape { owner: link.name.clone(), reason });
            }
        };
        if !size.iter().all(|value| value.is_finite() && *value > 0.0) {
            let reason = format!("sizes must be above 0, got {size:?}");
            return Err(PhysicsError::BadShape { owner: link.name.clone(), reason });
        }
        let geom = body.add_geom();
        geom.set_name(&pad_name(&link.name, nth)).map_err(refused)?;
        geom.set_type(kind);
        *geom.size_mut() = size;
        *geom.pos_mut() = pose.translation.vector.into();
        *geom.quat_mut() = wxyz(&pose.rotation);
        set_contact(geom, friction);
        geom.set_conaffinity(1 | ROBOT_MEETS as i32);
    }
    Ok(())
}
