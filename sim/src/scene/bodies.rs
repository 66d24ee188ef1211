//! Bodies: nesting resolved to world poses, masses; what is rigidly attached to a free body, or held fast at another
//! body, merged into it.

use super::error::{Place, SceneError};
use super::mesh::{find_mesh, mesh_volume_m3};
use super::model::{BodyMotion, SceneBody, SceneGeom, SceneMesh, SceneShape};
use super::source::Source;
use super::surface::Materials;
use dsm::Pose;
use mjcf_rs::body::{Geom, GeomType, Joint, JointType};
use mjcf_rs::glam::{DQuat, DVec3};
use nalgebra::{Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};

/// Geoms of MuJoCo's groups above this are not drawn.
const LAST_VISIBLE_GROUP: i32 = 2;

/// Index of the world's own body.
const WORLD: usize = 0;

/// A joint that is held fast because articulated scenes come later.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldJoint {
    /// Name of the joint, or of its body when it has none.
    pub joint: String,
    /// The body that it would move.
    pub body: String,
    /// `hinge`, `slide` or `ball`.
    pub kind: &'static str,
}

/// Bodies, and the joints that are held fast.
pub(super) struct Bodies {
    /// All bodies; index 0 is `world`.
    pub bodies: Vec<SceneBody>,
    /// Joints that are held fast.
    pub held: Vec<HeldJoint>,
}

/// A pose of the MJCF parser as ours.
pub(super) fn to_pose(pose: &mjcf_rs::Pose) -> Pose {
    let (q, t): (DQuat, DVec3) = (pose.rotation, pose.translation);
    Pose::from_parts(
        Translation3::new(t.x, t.y, t.z),
        UnitQuaternion::new_normalize(Quaternion::new(q.w, q.x, q.y, q.z)),
    )
}

/// What building a body needs besides the body.
pub(super) struct Context<'a> {
    pub model: &'a mjcf_rs::Model,
    pub meshes: &'a [SceneMesh],
    pub source: &'a Source,
    /// Body elements in document order; the parser keeps that order, the world first.
    nodes: Vec<Node<'a, 'a>>,
    /// Geom elements in document order.
    geoms: Vec<Node<'a, 'a>>,
}

fn owner_of<'a>(geom: Node<'a, 'a>) -> Option<Node<'a, 'a>> {
    geom.ancestors().find(|ancestor| ancestor.has_tag_name("body"))
}

impl<'a> Context<'a> {
    /// Lists the body elements of the document.
    pub(super) fn new(
        model: &'a mjcf_rs::Model,
        meshes: &'a [SceneMesh],
        source: &'a Source,
        document: &'a Document<'a>,
    ) -> Self {
        let elements = || document.root_element().descendants();
        let in_defaults = |n: &Node<'_, '_>| n.ancestors().any(|a| a.has_tag_name("default"));
        let nodes = elements().filter(|n| n.has_tag_name("body")).collect();
        let geoms = elements().filter(|n| n.has_tag_name("geom") && !in_defaults(n)).collect();
        Self { model, meshes, source, nodes, geoms }
    }

    fn place_of_body(&self, id: usize) -> Place {
        let offset = id.checked_sub(1).and_then(|i| self.nodes.get(i)).map_or(0, |node| node.range().start);
        self.source.place(offset)
    }

    /// Where the `index`-th geom of a body stands; the body's own place when that is not known.
    fn place_of_geom(&self, id: usize, index: usize) -> Place {
        let wanted = id.checked_sub(1).and_then(|i| self.nodes.get(i)).copied();
        let mut own = self.geoms.iter().filter(|geom| owner_of(**geom) == wanted);
        own.nth(index).map_or_else(|| self.place_of_body(id), |node| self.source.place(node.range().start))
    }
}

/// Builds all bodies.
pub(super) fn build_bodies(context: &Context<'_>, materials: &mut Materials) -> Result<Bodies, SceneError> {
    let entries = &context.model.bodies;
    let mut world_from: Vec<Pose> = Vec::with_capacity(entries.len());
    // Index into `bodies` of the rigid body that each parsed body became part of.
    let mut owner: Vec<usize> = Vec::with_capacity(entries.len());
    let mut out = Bodies { bodies: Vec::new(), held: Vec::new() };
    for (id, entry) in entries.iter().enumerate() {
        let parent = entry.parent;
        let pose = parent.map_or_else(Pose::identity, |p| world_from[p] * to_pose(&entry.body.pose));
        world_from.push(pose);
        let name = match id {
            0 => "world".to_owned(),
            _ => entry.body.name.clone().unwrap_or_else(|| format!("body_{id}")),
        };
        let free = entry.body.joints.iter().any(|joint| joint.type_ == JointType::Free);
        if free && parent != Some(0) {
            return Err(SceneError::Unsupported {
                place: context.place_of_body(id),
                what: format!("the free joint of the nested body `{name}`"),
                hint: "free bodies stand directly in <worldbody>".to_owned(),
            });
        }
        let held_before = out.held.len();
        out.held.extend(entry.body.joints.iter().filter_map(|joint| held(joint, &name)));
        // A door that is held fast is a part of its cupboard, not a thing of its own.
        let is_part = out.held.len() > held_before;
        let parent_owner = parent.map(|p| owner[p]);
        let merged = parent_owner.filter(|p| out.bodies[*p].motion == BodyMotion::Free || (is_part && *p != WORLD));
        let index = merged.unwrap_or(out.bodies.len());
        owner.push(index);
        if merged.is_none() {
            let motion = if free { BodyMotion::Free } else { BodyMotion::Fixed };
            out.bodies.push(SceneBody { name, world_from_body: pose, motion, mass_kg: 0.0, geoms: Vec::new() });
        }
        let body_from_part = out.bodies[index].world_from_body.inv_mul(&pose);
        let mut geom_mass_kg = 0.0;
        for (number, geom) in entry.body.geoms.iter().enumerate() {
            let shape = shape_of(geom, context).map_err(|misfit| SceneError::BadValue {
                place: context.place_of_geom(id, number),
                what: format!("`size` of a {:?} geom", geom.type_).to_lowercase(),
                value: format!("{} {} {}", geom.size[0], geom.size[1], geom.size[2]),
                expected: misfit,
            })?;
            let Some((geom_pose, shape)) = shape else { continue };
            geom_mass_kg += geom.mass.unwrap_or_else(|| {
                geom.density.unwrap_or(context.model.compiler.inertia_density) * volume_m3(&shape, context.meshes)
            });
            let material = materials.index_of(geom.material.as_deref(), geom.rgba);
            out.bodies[index].geoms.push(SceneGeom {
                name: geom.name.clone(),
                body_from_geom: body_from_part * geom_pose,
                shape,
                friction: geom.friction[0],
                collides: geom.contype != 0 || geom.conaffinity != 0,
                visible: geom.group <= LAST_VISIBLE_GROUP && materials.list[material].rgba[3] > 0.0,
                material,
            });
        }
        if out.bodies[index].motion == BodyMotion::Free {
            out.bodies[index].mass_kg += entry.body.inertial.as_ref().map_or(geom_mass_kg, |inertial| inertial.mass);
        }
    }
    for (id, &index) in owner.iter().enumerate() {
        let body = &out.bodies[index];
        if body.motion == BodyMotion::Free && !(body.mass_kg > 0.0 && body.mass_kg.is_finite()) {
            return Err(SceneError::NoMass { place: context.place_of_body(id), body: body.name.clone() });
        }
    }
    Ok(out)
}

fn held(joint: &Joint, body: &str) -> Option<HeldJoint> {
    let kind = match joint.type_ {
        JointType::Free => return None,
        JointType::Hinge => "hinge",
        JointType::Slide => "slide",
        JointType::Ball => "ball",
    };
    let name = joint.name.clone().unwrap_or_else(|| body.to_owned());
    Some(HeldJoint { joint: name, body: body.to_owned(), kind })
}

/// Pose in the body and shape of a geom; `None` when it has neither extent nor mesh. The error says what was expected.
fn shape_of(geom: &Geom, context: &Context<'_>) -> Result<Option<(Pose, SceneShape)>, String> {
    let mut size = geom.size;
    let mut pose = to_pose(&geom.pose);
    if let Some([x1, y1, z1, x2, y2, z2]) = geom.fromto {
        let (from, to) = (Point3::new(x1, y1, z1), Point3::new(x2, y2, z2));
        let axis = to - from;
        // MuJoCo points the local z axis from the first to the second point.
        let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        pose = Pose::from_parts(Translation3::from(nalgebra::center(&from, &to).coords), rotation);
        let half = 0.5 * axis.norm();
        match geom.type_ {
            GeomType::Capsule | GeomType::Cylinder => size[1] = half,
            GeomType::Box | GeomType::Ellipsoid => {
                size[1] = size[0];
                size[2] = half;
            }
            _ => return Err("`fromto` only on a capsule, cylinder, box or ellipsoid".to_owned()),
        }
    }
    let needed = match geom.type_ {
        GeomType::Sphere => 1,
        GeomType::Capsule | GeomType::Cylinder => 2,
        GeomType::Box | GeomType::Ellipsoid => 3,
        _ => 0,
    };
    if size[..needed].iter().any(|value| *value <= 0.0) {
        return Err(format!("{needed} positive numbers"));
    }
    let shape = match geom.type_ {
        GeomType::Plane => SceneShape::Plane { half_m: [size[0], size[1]] },
        GeomType::Sphere => SceneShape::Sphere { radius_m: size[0] },
        GeomType::Capsule => SceneShape::Capsule { radius_m: size[0], half_length_m: size[1] },
        GeomType::Cylinder => SceneShape::Cylinder { radius_m: size[0], half_length_m: size[1] },
        GeomType::Ellipsoid => SceneShape::Ellipsoid { radii_m: Vector3::from(size) },
        GeomType::Box => SceneShape::Box { half_m: Vector3::from(size) },
        GeomType::Mesh => match geom.mesh.as_deref().and_then(|name| find_mesh(context.meshes, name)) {
            Some(mesh) => SceneShape::Mesh { mesh },
            None => return Err("a `mesh` of the asset block".to_owned()),
        },
        GeomType::Hfield | GeomType::Sdf => return Err("a shape other than hfield or sdf".to_owned()),
    };
    Ok(Some((pose, shape)))
}

/// Volume of a shape in cubic metres; 0 for a plane.
pub(super) fn volume_m3(shape: &SceneShape, meshes: &[SceneMesh]) -> f64 {
    use std::f64::consts::PI;
    match shape {
        SceneShape::Plane { .. } => 0.0,
        SceneShape::Box { half_m } => 8.0 * half_m.product(),
        SceneShape::Sphere { radius_m } => 4.0 / 3.0 * PI * radius_m.powi(3),
        SceneShape::Cylinder { radius_m, half_length_m } => 2.0 * PI * radius_m.powi(2) * half_length_m,
        SceneShape::Capsule { radius_m, half_length_m } => {
            PI * radius_m.powi(2) * (4.0 / 3.0 * radius_m + 2.0 * half_length_m)
        }
        SceneShape::Ellipsoid { radii_m } => 4.0 / 3.0 * PI * radii_m.product(),
        SceneShape::Mesh { mesh } => mesh_volume_m3(&meshes[*mesh]),
    }
}
