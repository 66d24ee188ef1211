//! A scene as MuJoCo's model: bodies, shapes, contact parameters.

use crate::MujocoConfig;
use dsm::Pose;
use dsm_sim::physics::{GRAVITY_M_PER_S2, PhysicsError, SLAB_M, body_inertia};
use dsm_sim::scene::{BodyMotion, JointMotion, SceneBody, SceneGeom, SceneJoint, SceneModel, SceneShape, SceneTie};
use mujoco_rs::mujoco_c::{
    mjtCone, mjtDisableBit, mjtEnableBit, mjtEq, mjtInertiaFromGeom, mjtIntegrator, mjtJoint, mjtLimited,
    mjtMeshInertia,
};
use mujoco_rs::prelude::{MjSpec, MjtGeomBase, MjtObjBase, SpecItem};
use mujoco_rs::wrappers::mj_editing::{MjsBody, MjsGeom};
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// Time constant and damping ratio of contacts: the stiffest that a step of 5 ms bears. With the impedance below, a grip
/// of 40 N sinks less than 1 mm into what it holds.
const CONTACT_SOLREF: [f64; 2] = [0.01, 1.0];
/// Impedance of contacts: at the surface, from a depth of 1 mm on, that depth, and the shape in between.
const CONTACT_SOLIMP: [f64; 5] = [0.95, 0.99, 0.001, 0.5, 2.0];
/// Impedance of dry friction in joints: as hard as MuJoCo has it, so that what friction holds against its weight creeps by
/// micrometres a second and falls asleep; at that of contacts a sash sinks by 2.5 mm/s.
const FRICTION_SOLIMP: [f64; 5] = [0.9999, 0.9999, 0.001, 0.5, 2.0];
/// Friction about the contact's normal and against rolling, metres: a pad touches over a few millimetres.
pub(crate) const SPIN_FRICTION_M: f64 = 0.005;
pub(crate) const ROLL_FRICTION_M: f64 = 0.0001;
/// Kind of all geoms of a scene: what touches it, touches everything.
pub(crate) const ROBOT_MEETS: u32 = 1 << 30;
/// Room for contacts and their constraints, bytes.
const MEMORY: i64 = 256 << 20;

/// What MuJoCo says when it refuses.
pub(crate) fn refused(reason: impl ToString) -> PhysicsError {
    PhysicsError::Refused { engine: "mujoco", reason: reason.to_string() }
}

/// Name of a scene body in the model: scenes may use any name, `world` too.
pub(crate) fn body_name(index: usize) -> String {
    format!("scene/{index}")
}

/// Name of the n-th colliding geom of a scene body.
pub(crate) fn geom_name(body: usize, nth: usize) -> String {
    format!("scene/{body}/{nth}")
}

/// Name of the joint that moves a scene body.
pub(crate) fn joint_name(body: usize) -> String {
    format!("scene/{body}/joint")
}

/// An empty model with our options.
pub(crate) fn new_spec(config: &MujocoConfig) -> MjSpec {
    let mut spec = MjSpec::new();
    let compiler = spec.compiler_mut();
    compiler.set_degree(false);
    compiler.set_usethread(false);
    compiler.set_inertiafromgeom(mjtInertiaFromGeom::mjINERTIAFROMGEOM_FALSE);
    // Principal moments rounded to single precision may miss the triangle inequality by a hair.
    compiler.set_balanceinertia(true);
    spec.set_memory(MEMORY);
    let option = spec.option_mut();
    option.timestep = config.step.as_s();
    option.gravity = [0.0, 0.0, -GRAVITY_M_PER_S2];
    // Motors are stiff: their damping has to be implicit.
    option.integrator = mjtIntegrator::mjINT_IMPLICITFAST as i32;
    option.cone = mjtCone::mjCONE_ELLIPTIC as i32;
    option.impratio = config.friction_stiffness;
    // Which links may overlap is said by robot.toml alone, and a world that diverges must not start anew unseen.
    option.disableflags |= mjtDisableBit::mjDSBL_FILTERPARENT as i32 | mjtDisableBit::mjDSBL_AUTORESET as i32;
    if config.sleep_below_m_per_s > 0.0 {
        option.enableflags |= mjtEnableBit::mjENBL_SLEEP as i32;
        option.sleep_tolerance = config.sleep_below_m_per_s;
    }
    spec
}

/// Adds the scene's bodies with the meshes that collide, and what it says about pairs of bodies.
pub(crate) fn add_scene(spec: &mut MjSpec, scene: &SceneModel) -> Result<(), PhysicsError> {
    // What is only seen needs no hull.
    add_scene_meshes(spec, scene, |geom| geom.collides)?;
    for (index, body) in scene.bodies.iter().enumerate() {
        add_body(spec, scene, index, body)?;
    }
    for [a, b] in &scene.excluded {
        let exclude = spec.add_exclude();
        exclude.set_bodyname1(&body_name(*a));
        exclude.set_bodyname2(&body_name(*b));
    }
    scene.ties.iter().for_each(|tie| add_tie(spec, tie));
    Ok(())
}

/// Adds the meshes of the geoms that are kept.
pub(crate) fn add_scene_meshes(
    spec: &mut MjSpec,
    scene: &SceneModel,
    keeps: impl Fn(&SceneGeom) -> bool,
) -> Result<(), PhysicsError> {
    let kept = scene.bodies.iter().flat_map(|body| &body.geoms).filter(|geom| keeps(geom));
    let used: BTreeSet<usize> = kept
        .filter_map(|geom| match geom.shape {
            SceneShape::Mesh { mesh } => Some(mesh),
            _ => None,
        })
        .collect();
    for (index, mesh) in scene.meshes.iter().enumerate().filter(|(index, _)| used.contains(index)) {
        let vertices: Vec<f32> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        add_mesh(spec, &mesh_name(index), &vertices, &mesh.indices)?;
    }
    Ok(())
}

/// Adds a mesh; `vertices` are coordinates one after the other.
pub(crate) fn add_mesh(
    spec: &mut MjSpec,
    name: &str,
    vertices: &[f32],
    triangles: &[[u32; 3]],
) -> Result<(), PhysicsError> {
    let faces: Vec<i32> = triangles.iter().flatten().map(|i| *i as i32).collect();
    let asset = spec.add_mesh();
    asset.set_name(name).map_err(refused)?;
    asset.set_uservert(vertices);
    asset.set_userface(&faces);
    asset.set_inertia(mjtMeshInertia::mjMESH_INERTIA_CONVEX);
    Ok(())
}

/// MuJoCo's weld and connection: the frame in the first body lies on the one in the second.
fn add_tie(spec: &mut MjSpec, tie: &SceneTie) {
    let [in_first, in_second] = tie.body_from_tie;
    let [first, second] = tie.bodies.map(body_name);
    let added = spec.add_equality();
    added.set_objtype(MjtObjBase::mjOBJ_BODY);
    added.set_name1(&first);
    added.set_name2(&second);
    let data = added.data_mut();
    data.fill(0.0);
    if tie.rigid {
        // The point in the second body, then in the first, the rotation of the second in the first, how stiff turning is.
        data[..3].copy_from_slice(in_second.translation.vector.as_slice());
        data[3..6].copy_from_slice(in_first.translation.vector.as_slice());
        data[6..10].copy_from_slice(&wxyz(&(in_first.rotation * in_second.rotation.inverse())));
        data[10] = 1.0;
        added.set_type(mjtEq::mjEQ_WELD);
    } else {
        data[..3].copy_from_slice(in_first.translation.vector.as_slice());
        added.set_type(mjtEq::mjEQ_CONNECT);
    }
    *added.solref_mut() = CONTACT_SOLREF;
    *added.solimp_mut() = CONTACT_SOLIMP;
}

fn mesh_name(index: usize) -> String {
    format!("mesh/{index}")
}

fn add_body(spec: &mut MjSpec, scene: &SceneModel, index: usize, body: &SceneBody) -> Result<(), PhysicsError> {
    let joint = scene.find_joint(index);
    let added = match joint {
        // What hangs on a body that moves hangs below it; all else below the world. MuJoCo's bodies stand where their
        // joints are at the reference.
        Some(joint) => {
            let carrier = &scene.bodies[joint.carrier];
            let carrier_from_part = joint.carrier_from_part(joint.reference);
            let world = spec.world_body_mut();
            let (parent, pose) = match carrier.motion {
                BodyMotion::Fixed => (world, carrier.world_from_body * carrier_from_part),
                _ => {
                    let name = body_name(joint.carrier);
                    let parent = world.child_mut(&name).ok_or_else(|| refused(format!("lost body `{name}`")))?;
                    (parent, carrier_from_part)
                }
            };
            let added = parent.add_body();
            set_pose(added, &pose);
            added
        }
        None => {
            let added = spec.world_body_mut().add_body();
            set_pose(added, &body.world_from_body);
            added
        }
    };
    added.set_name(&body_name(index)).map_err(refused)?;
    if body.motion != BodyMotion::Fixed {
        let inertia = body_inertia(scene, body)?;
        added.set_mass(inertia.mass_kg);
        added.set_explicitinertial(true);
        *added.ipos_mut() = inertia.center_in_body.coords.into();
        *added.iquat_mut() = wxyz(&inertia.body_from_principal);
        *added.inertia_mut() = inertia.moments_kg_m2.into();
    }
    match joint {
        Some(joint) => add_joint(added, joint)?,
        None if body.motion == BodyMotion::Free => {
            added.add_free_joint();
        }
        None => {}
    }
    for (nth, geom) in body.geoms.iter().filter(|geom| geom.collides).enumerate() {
        add_geom(added, &body.name, geom, &geom_name(index, nth))?;
    }
    Ok(())
}

/// The joint between a part and what carries it; its limits are as stiff as contacts.
fn add_joint(body: &mut MjsBody, joint: &SceneJoint) -> Result<(), PhysicsError> {
    let added = body.add_joint();
    added.set_name(&joint_name(joint.part)).map_err(refused)?;
    added.set_type(match joint.motion {
        JointMotion::Hinge => mjtJoint::mjJNT_HINGE,
        JointMotion::Slide => mjtJoint::mjJNT_SLIDE,
    });
    let frame = &joint.part_from_joint;
    *added.pos_mut() = frame.translation.vector.into();
    *added.axis_mut() = (frame.rotation * Vector3::z()).into();
    *added.ref_mut() = joint.reference;
    added.set_limited(mjtLimited::mjLIMITED_FALSE);
    if let Some(range) = joint.range {
        added.set_limited(mjtLimited::mjLIMITED_TRUE);
        *added.range_mut() = range;
    }
    added.damping_mut()[0] = joint.damping;
    added.set_frictionloss(joint.friction);
    added.stiffness_mut()[0] = joint.stiffness;
    added.set_springref(joint.spring_reference);
    added.set_armature(joint.armature);
    *added.solref_limit_mut() = CONTACT_SOLREF;
    *added.solimp_limit_mut() = CONTACT_SOLIMP;
    *added.solref_friction_mut() = CONTACT_SOLREF;
    *added.solimp_friction_mut() = FRICTION_SOLIMP;
    Ok(())
}

fn add_geom(body: &mut MjsBody, owner: &str, geom: &SceneGeom, name: &str) -> Result<(), PhysicsError> {
    let added = body.add_geom();
    added.set_name(name).map_err(refused)?;
    set_shape(added, owner, &geom.shape, geom.body_from_geom)?;
    set_contact(added, geom.friction);
    // The highest bits meet nobody but the robot, which meets everything.
    let low = |bits: u32| (bits & (ROBOT_MEETS - 1)) as i32;
    added.set_contype(low(geom.kinds) | ROBOT_MEETS as i32);
    added.set_conaffinity(low(geom.touches));
    Ok(())
}

/// Gives a geom its shape and its pose on the body; `owner` is named when it is wrong.
pub(crate) fn set_shape(
    added: &mut MjsGeom,
    owner: &str,
    shape: &SceneShape,
    mut pose: Pose,
) -> Result<(), PhysicsError> {
    let (kind, size) = match shape {
        // A bounded plane ends at its edge; MuJoCo's planes never end.
        SceneShape::Plane { half_m: [x, y] } if *x > 0.0 && *y > 0.0 => {
            pose *= Pose::translation(0.0, 0.0, -0.5 * SLAB_M);
            (MjtGeomBase::mjGEOM_BOX, [*x, *y, 0.5 * SLAB_M])
        }
        SceneShape::Plane { .. } => (MjtGeomBase::mjGEOM_PLANE, [0.0, 0.0, 1.0]),
        SceneShape::Box { half_m } => (MjtGeomBase::mjGEOM_BOX, (*half_m).into()),
        SceneShape::Sphere { radius_m } => (MjtGeomBase::mjGEOM_SPHERE, [*radius_m; 3]),
        SceneShape::Cylinder { radius_m, half_length_m } => {
            (MjtGeomBase::mjGEOM_CYLINDER, [*radius_m, *half_length_m, *half_length_m])
        }
        SceneShape::Capsule { radius_m, half_length_m } => {
            (MjtGeomBase::mjGEOM_CAPSULE, [*radius_m, *half_length_m, *half_length_m])
        }
        SceneShape::Ellipsoid { radii_m } => (MjtGeomBase::mjGEOM_ELLIPSOID, (*radii_m).into()),
        SceneShape::Mesh { mesh } => {
            added.set_meshname(&mesh_name(*mesh));
            (MjtGeomBase::mjGEOM_MESH, [0.0; 3])
        }
    };
    let sized = !matches!(kind, MjtGeomBase::mjGEOM_PLANE | MjtGeomBase::mjGEOM_MESH);
    if sized && !size.iter().all(|value| value.is_finite() && *value > 0.0) {
        let reason = format!("sizes must be above 0, got {size:?}");
        return Err(PhysicsError::BadShape { owner: owner.into(), reason });
    }
    added.set_type(kind);
    *added.size_mut() = size;
    *added.pos_mut() = pose.translation.vector.into();
    *added.quat_mut() = wxyz(&pose.rotation);
    Ok(())
}

/// Contact parameters of a geom; the greater friction of two geoms counts.
pub(crate) fn set_contact(geom: &mut MjsGeom, friction: f64) {
    geom.set_condim(4);
    geom.set_density(0.0);
    *geom.friction_mut() = [friction, SPIN_FRICTION_M, ROLL_FRICTION_M];
    *geom.solref_mut() = CONTACT_SOLREF;
    *geom.solimp_mut() = CONTACT_SOLIMP;
}

/// Makes the friction between two geoms the geometric mean of theirs, as rapier does.
pub(crate) fn add_pair(spec: &mut MjSpec, first: (&str, f64), second: (&str, f64)) {
    let friction = (first.1 * second.1).sqrt();
    let pair = spec.add_pair();
    pair.set_geomname1(first.0);
    pair.set_geomname2(second.0);
    pair.set_condim(4);
    *pair.friction_mut() = [friction, friction, SPIN_FRICTION_M, ROLL_FRICTION_M, ROLL_FRICTION_M];
    *pair.solref_mut() = CONTACT_SOLREF;
    *pair.solimp_mut() = CONTACT_SOLIMP;
}

pub(crate) fn set_pose(body: &mut MjsBody, pose: &Pose) {
    *body.pos_mut() = pose.translation.vector.into();
    *body.quat_mut() = wxyz(&pose.rotation);
}

/// MuJoCo's order of a quaternion.
pub(crate) fn wxyz(rotation: &nalgebra::UnitQuaternion<f64>) -> [f64; 4] {
    [rotation.w, rotation.i, rotation.j, rotation.k]
}
