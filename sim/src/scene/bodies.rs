//! Bodies: nesting resolved to world poses, masses; what is rigidly attached to a body that moves, or held fast at another
//! body, merged into it.

use super::defaults::is_default;
use super::error::{Place, SceneError};
use super::geom::{shape_of, volume_m3};
use super::joints::SceneJoint;
use super::live::{find_live_joints, joint_of};
use super::model::{BodyMotion, MassSpread, SceneBody, SceneGeom, SceneMesh, SceneShape};
use super::source::Source;
use super::surface::Materials;
use dsm::Pose;
use mjcf_rs::body::{Body, Geom, InertiaSpec, Inertial, JointType};
use mjcf_rs::compiler::InertiaFromGeom;
use mjcf_rs::glam::{DQuat, DVec3};
use nalgebra::{Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};

/// Geoms of MuJoCo's groups above this are not drawn.
const LAST_VISIBLE_GROUP: i32 = 2;

/// Index of the world's own body.
const WORLD: usize = 0;

/// Bodies of a scene, and what became of those of the file.
pub(super) struct Bodies {
    /// All bodies; index 0 is `world`. Those on joints come last.
    pub bodies: Vec<SceneBody>,
    /// Joints between them, in the order of the bodies that they move.
    pub joints: Vec<SceneJoint>,
    /// Parsed bodies that move on a joint.
    pub live: Vec<usize>,
    /// For each parsed body the index of the one that it became a part of.
    pub owner: Vec<usize>,
    /// Parsed bodies with a free joint that touch nothing and so are held where they stand.
    pub untouchable: Vec<usize>,
    /// World poses of the parsed bodies.
    pub world_from: Vec<Pose>,
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
    /// The whole document.
    pub document: &'a Document<'a>,
    /// Geom elements in document order.
    geoms: Vec<Node<'a, 'a>>,
    /// Groups of geoms that add to the mass of their body.
    weighing_groups: std::ops::RangeInclusive<i32>,
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
        let nodes = elements().filter(|n| n.has_tag_name("body")).collect();
        let geoms = elements().filter(|n| n.has_tag_name("geom") && !is_default(n)).collect();
        // The parser leaves this attribute out.
        let range = elements().filter_map(|n| n.attribute("inertiagrouprange")).next_back().unwrap_or_default();
        let bounds: Vec<i32> = range.split_ascii_whitespace().flat_map(str::parse).collect();
        let weighing_groups = if let [low, high] = bounds[..] { low..=high } else { i32::MIN..=i32::MAX };
        Self { model, meshes, source, nodes, document, geoms, weighing_groups }
    }

    /// The element of a parsed body.
    pub(super) fn node(&self, id: usize) -> Option<Node<'a, 'a>> {
        id.checked_sub(1).and_then(|i| self.nodes.get(i)).copied()
    }

    /// Mass of a geom as far as it adds to that of its body, kilograms.
    fn mass_of_geom(&self, geom: &Geom, shape: &SceneShape) -> f64 {
        let by_volume = || geom.density.unwrap_or(self.model.compiler.inertia_density) * volume_m3(shape, self.meshes);
        if self.weighing_groups.contains(&geom.group) { geom.mass.unwrap_or_else(by_volume) } else { 0.0 }
    }

    /// The inertia that is written for a body, where it counts.
    fn written_inertia(&self, id: usize) -> Option<&Inertial> {
        let counts = self.model.compiler.inertia_from_geom != InertiaFromGeom::True;
        self.model.bodies[id].body.inertial.as_ref().filter(|_| counts)
    }

    /// Mass of a parsed body without what hangs on it, kilograms. Geoms that are no shapes weigh nothing here.
    pub(super) fn mass_of_body(&self, id: usize) -> f64 {
        let of_geom =
            |geom: &Geom| shape_of(geom, self.meshes).map_or(0.0, |(_, shape)| self.mass_of_geom(geom, &shape));
        let by_geoms = || self.model.bodies[id].body.geoms.iter().map(of_geom).sum();
        self.written_inertia(id).map_or_else(by_geoms, |inertial| inertial.mass)
    }

    fn place_of_body(&self, id: usize) -> Place {
        self.source.place(self.node(id).map_or(0, |node| node.range().start))
    }

    /// Where the `index`-th geom of a body stands; the body's own place when that is not known.
    fn place_of_geom(&self, id: usize, index: usize) -> Place {
        let wanted = self.node(id);
        let mut own = self.geoms.iter().filter(|geom| owner_of(**geom) == wanted);
        own.nth(index).map_or_else(|| self.place_of_body(id), |node| self.source.place(node.range().start))
    }
}

/// Builds all bodies.
pub(super) fn build_bodies(context: &Context<'_>, materials: &mut Materials) -> Result<Bodies, SceneError> {
    let entries = &context.model.bodies;
    let count = entries.len();
    let (mut world_from, mut owner) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut out: Vec<SceneBody> = Vec::new();
    let mut untouchable = Vec::new();
    let live = find_live_joints(context);
    let mut joints: Vec<SceneJoint> = Vec::new();
    // Mass and its spread by parsed body, in the frame of the owner.
    let mut parts: Vec<(f64, Option<MassSpread>)> = Vec::with_capacity(count);
    for (id, entry) in entries.iter().enumerate() {
        let parent = entry.parent;
        let pose = parent.map_or_else(Pose::identity, |p: usize| world_from[p] * to_pose(&entry.body.pose));
        world_from.push(pose);
        let name = match id {
            0 => "world".to_owned(),
            _ => entry.body.name.clone().unwrap_or_else(|| format!("body_{id}")),
        };
        let mut free = entry.body.joints.iter().any(|joint| joint.type_ == JointType::Free);
        if free && parent != Some(0) {
            return Err(SceneError::Unsupported {
                place: context.place_of_body(id),
                what: format!("the free joint of the nested body `{name}`"),
                hint: "free bodies stand directly in <worldbody>".to_owned(),
            });
        }
        if free && touches_nothing(context.model, id) {
            free = false;
            untouchable.push(id);
        }
        // A door that is held fast is a part of its cupboard, not a thing of its own.
        let is_part = entry.body.joints.iter().any(|joint| joint.type_ != JointType::Free);
        let parent_owner: Option<usize> = parent.map(|p| owner[p]);
        let joint = live[id].zip(parent_owner);
        let merged = parent_owner
            .filter(|p| joint.is_none() && (out[*p].motion != BodyMotion::Fixed || (is_part && *p != WORLD)));
        let index = merged.unwrap_or(out.len());
        owner.push(index);
        if let Some((joint, carrier)) = joint {
            let carrier_from_part = out[carrier].world_from_body.inv_mul(&pose);
            let autolimits = context.model.compiler.autolimits;
            joints.push(joint_of(joint, autolimits, &name, (index, carrier), &carrier_from_part));
        }
        if merged.is_none() {
            let motion = match joint {
                Some(_) => BodyMotion::Jointed,
                None if free => BodyMotion::Free,
                None => BodyMotion::Fixed,
            };
            let body = SceneBody { name, world_from_body: pose, motion, mass_kg: 0.0, spread: None, geoms: Vec::new() };
            out.push(body);
        }
        let body_from_part = out[index].world_from_body.inv_mul(&pose);
        let geom_mass_kg = add_geoms(context, materials, id, &body_from_part, &mut out[index])?;
        parts.push(match context.written_inertia(id) {
            Some(inertial) => (inertial.mass, spread_of(inertial, &body_from_part)),
            None => (geom_mass_kg, None),
        });
    }
    weigh(&mut out, &owner, &parts);
    out.iter_mut().enumerate().for_each(|(index, body)| hide_stand_ins(index == WORLD, body, materials));
    for (id, &index) in owner.iter().enumerate() {
        let body = &out[index];
        if body.motion != BodyMotion::Fixed && !(body.mass_kg > 0.0 && body.mass_kg.is_finite()) {
            return Err(SceneError::NoMass { place: context.place_of_body(id), body: body.name.clone() });
        }
    }
    let live = (0..count).filter(|id| live[*id].is_some()).collect();
    let mut bodies = Bodies { bodies: out, joints, live, owner, untouchable, world_from };
    bodies.put_jointed_last();
    Ok(bodies)
}

impl Bodies {
    /// Moves bodies on joints behind all others: the numbers of the others, and what is drawn by them, are the same whether
    /// joints move or not.
    fn put_jointed_last(&mut self) {
        let mut order: Vec<usize> = (0..self.bodies.len()).collect();
        order.sort_by_key(|index| self.bodies[*index].motion == BodyMotion::Jointed);
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(new, old)| place[*old] = new);
        self.bodies.sort_by_key(|body| body.motion == BodyMotion::Jointed);
        self.owner.iter_mut().for_each(|owner| *owner = place[*owner]);
        for joint in &mut self.joints {
            (joint.part, joint.carrier) = (place[joint.part], place[joint.carrier]);
        }
    }
}

/// Adds the geoms of a parsed body to the one that it is a part of; gives their mass in kilograms.
fn add_geoms(
    context: &Context<'_>,
    materials: &mut Materials,
    id: usize,
    body_from_part: &Pose,
    body: &mut SceneBody,
) -> Result<f64, SceneError> {
    let source: &Body = &context.model.bodies[id].body;
    let mut mass_kg = 0.0;
    for (number, geom) in source.geoms.iter().enumerate() {
        let (geom_pose, shape) = shape_of(geom, context.meshes).map_err(|misfit| SceneError::BadValue {
            place: context.place_of_geom(id, number),
            what: format!("`size` of a {:?} geom", geom.type_).to_lowercase(),
            value: format!("{} {} {}", geom.size[0], geom.size[1], geom.size[2]),
            expected: misfit,
        })?;
        mass_kg += context.mass_of_geom(geom, &shape);
        let material = materials.index_of(geom.material.as_deref(), geom.rgba);
        body.geoms.push(SceneGeom {
            name: geom.name.clone(),
            body_from_geom: body_from_part * geom_pose,
            shape,
            friction: geom.friction[0],
            collides: geom.contype != 0 || geom.conaffinity != 0,
            kinds: geom.contype,
            touches: geom.conaffinity,
            visible: geom.group <= LAST_VISIBLE_GROUP && materials.list[material].rgba[3] > 0.0,
            material,
        });
    }
    Ok(mass_kg)
}

/// Hides what collides in place of something else that is seen, in a body with geoms for the eye alone: their twins, and
/// colliding geoms without a material that are see-through or have no colour. Authors look through them or switch their
/// group off; our renderer knows only opaque and draws the groups that MuJoCo's viewer does.
fn hide_stand_ins(is_world: bool, body: &mut SceneBody, materials: &Materials) {
    let for_the_eye = |geom: &SceneGeom| geom.visible && !geom.collides;
    let shown: Vec<(SceneShape, Pose)> =
        body.geoms.iter().filter(|g| for_the_eye(g)).map(|g| (g.shape.clone(), g.body_from_geom)).collect();
    for geom in body.geoms.iter_mut().filter(|geom| geom.collides && !shown.is_empty()) {
        let twin = shown.iter().any(|(shape, pose)| *shape == geom.shape && *pose == geom.body_from_geom);
        // The world's own geoms are not one thing.
        let plain = !is_world && materials.is_plain(geom.material);
        geom.visible &= !twin && !plain;
    }
}

/// Whether a parsed body with what is on it has substance, but nothing that collides.
fn touches_nothing(model: &mjcf_rs::Model, root: usize) -> bool {
    let is_below = |mut id: usize| loop {
        match model.bodies[id].parent {
            _ if id == root => break true,
            Some(parent) => id = parent,
            None => break false,
        }
    };
    let below = || (root..model.bodies.len()).filter(|id| is_below(*id)).map(|id| &model.bodies[id].body);
    let collides = |body: &Body| body.geoms.iter().any(|geom| geom.contype != 0 || geom.conaffinity != 0);
    below().any(|body| body.inertial.is_some() || !body.geoms.is_empty()) && !below().any(collides)
}

/// Centre and tensor of a written inertia in the frame of the body that it is a part of.
fn spread_of(inertial: &Inertial, body_from_part: &Pose) -> Option<MassSpread> {
    let pose = body_from_part * to_pose(&inertial.pose);
    let tensor = match inertial.inertia {
        InertiaSpec::Diagonal(moments) => Matrix3::from_diagonal(&Vector3::from(moments)),
        InertiaSpec::Full([xx, yy, zz, xy, xz, yz]) => Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    };
    let rotation = pose.rotation.to_rotation_matrix();
    let inertia_kg_m2 = rotation.matrix() * tensor * rotation.matrix().transpose();
    let spread = MassSpread { center_in_body: Point3::from(pose.translation.vector), inertia_kg_m2 };
    (tensor.trace() > 0.0).then_some(spread)
}

/// Sums up the parts of bodies that move. The spread is known when every part that weighs something has a written one.
fn weigh(bodies: &mut [SceneBody], owner: &[usize], parts: &[(f64, Option<MassSpread>)]) {
    for (index, body) in bodies.iter_mut().enumerate().filter(|(_, body)| body.motion != BodyMotion::Fixed) {
        let own = || owner.iter().zip(parts).filter(|(owner, _)| **owner == index).map(|(_, part)| part);
        body.mass_kg = own().map(|(mass, _)| mass).sum();
        let weighty: Option<Vec<(f64, MassSpread)>> =
            own().filter(|(mass, _)| *mass > 0.0).map(|(mass, spread)| spread.map(|spread| (*mass, spread))).collect();
        let Some(weighty) = weighty.filter(|parts| !parts.is_empty()) else { continue };
        let sum: Vector3<f64> = weighty.iter().map(|(mass, spread)| spread.center_in_body.coords * *mass).sum();
        let center = Point3::from(sum / body.mass_kg);
        let about_center = |(mass, spread): &(f64, MassSpread)| {
            let arm = spread.center_in_body - center;
            spread.inertia_kg_m2 + (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * *mass
        };
        let inertia_kg_m2 = weighty.iter().map(about_center).sum();
        body.spread = Some(MassSpread { center_in_body: center, inertia_kg_m2 });
    }
}
