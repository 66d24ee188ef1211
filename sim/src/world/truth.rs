//! The truth about the world, sampled for the judge. It only reads physics and never changes it.

use super::solids::{Column, Solids};
use crate::detect::LabelImage;
use crate::disturb::Happening;
use crate::physics::{Contact, ContactParty, Physics};
use crate::scene::{BodyMotion, JointMotion, SceneJoint, SceneModel, SceneShape, Semantics, name_of_part};
use dsm::Pose;
use dsm::eval::{TrueContact, TrueEvent, TrueJoint, TrueObject, TruePart, Truth};
use dsm::geometry::{Aabb, OrientedBox};
use dsm::time::{Span, Stamp};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender};

/// Time between samples: 20 Hz.
const PERIOD: Span = Span(50_000_000);
/// A body is in view from this many label pixels.
const IN_VIEW_PX: usize = 150;
/// Clearance is measured up to this far, metres.
const CLEARANCE_REACH_M: f64 = 1.0;
/// What rises no higher than this is floor: thresholds and rugs, metres.
pub(crate) const FLOOR_TOP_M: f64 = 0.03;
/// The camera whose view counts.
pub(super) const WATCHED_CAMERA: &str = "head";

/// Between two touching parties since the last sample.
#[derive(Clone, Copy, Debug)]
struct Touch {
    force_n: f64,
    approach_speed_m_per_s: f64,
}

/// Samples the truth 20 times a second.
pub(crate) struct TruthSampler {
    sender: Sender<Truth>,
    views: Receiver<Vec<usize>>,
    happenings: Receiver<Happening>,
    solids: Solids,
    objects: Vec<ObjectShape>,
    parts: Vec<PartOnJoint>,
    body_names: Vec<String>,
    free: Vec<bool>,
    radius_m: f64,
    height_m: f64,
    last: Stamp,
    next: Stamp,
    /// Poses of bodies and links one and two observations ago.
    before: [Option<Poses>; 2],
    touching: BTreeMap<(ContactParty, ContactParty), Touch>,
    since_sample: BTreeMap<(ContactParty, ContactParty), Touch>,
    in_view: Vec<String>,
}

#[derive(Clone)]
struct Poses {
    bodies: Vec<Pose>,
    links: Vec<Pose>,
}

/// What moves on a joint, and where the joint was in the last sample.
struct PartOnJoint {
    shape: ObjectShape,
    joint: SceneJoint,
    last: Option<(Stamp, f64)>,
}

/// An object and the box around its visible geometry, in its own frame.
struct ObjectShape {
    body: usize,
    category: String,
    bounds_in_body: Aabb,
}

impl TruthSampler {
    /// A sampler for a run that begins at time 0, with the robot's footprint radius and height. `views` brings the
    /// bodies that the watched camera sees, see [`find_in_view`], `happenings` what disturbs the world.
    pub(crate) fn new(
        sender: Sender<Truth>,
        (views, happenings): (Receiver<Vec<usize>>, Receiver<Happening>),
        scene: &SceneModel,
        semantics: &Semantics,
        solids: Solids,
        (radius_m, height_m): (f64, f64),
    ) -> Self {
        let wholes = semantics.find_wholes(scene);
        let object = |(index, body): (usize, &crate::scene::SceneBody)| {
            let category = semantics.find_object(&body.name)?.category.clone();
            let members: Vec<usize> = (0..wholes.len()).filter(|member| wholes[*member] == index).collect();
            Some(ObjectShape { body: index, category, bounds_in_body: visible_bounds(scene, index, &members) })
        };
        let part = |joint: &SceneJoint| {
            let body = joint.part;
            let name = &scene.bodies[body].name;
            let listed = semantics.find_object(name).map(|object| object.category.clone());
            let category = listed.unwrap_or_else(|| name_of_part(name, joint.motion));
            let shape = ObjectShape { body, category, bounds_in_body: visible_bounds(scene, body, &[body]) };
            PartOnJoint { shape, joint: joint.clone(), last: None }
        };
        Self {
            sender,
            views,
            happenings,
            solids,
            objects: scene.bodies.iter().enumerate().skip(1).filter_map(object).collect(),
            parts: scene.joints.iter().map(part).collect(),
            body_names: scene.bodies.iter().map(|body| body.name.clone()).collect(),
            free: scene.bodies.iter().map(|body| body.motion == BodyMotion::Free).collect(),
            radius_m,
            height_m,
            last: Stamp::default(),
            next: Stamp::default(),
            before: [None, None],
            touching: BTreeMap::new(),
            since_sample: BTreeMap::new(),
            in_view: Vec::new(),
        }
    }

    /// Looks at the world after a control tick; sends a sample when one is due.
    pub(crate) fn observe(&mut self, physics: &dyn Physics) {
        if let Some(bodies) = self.views.try_iter().last() {
            self.in_view = bodies.into_iter().map(|body| self.body_names[body].clone()).collect();
        }
        let now = Poses {
            bodies: (0..self.body_names.len()).map(|body| physics.world_from_body(body)).collect(),
            links: (0..physics.link_names().len()).map(|link| physics.world_from_link(link)).collect(),
        };
        let elapsed = physics.now() - self.last;
        self.last = physics.now();
        self.follow_contacts(&physics.contacts(), elapsed);
        if physics.now() >= self.next {
            self.next = physics.now() + PERIOD;
            let truth = self.sample(physics, &now);
            // Nobody judges any more: then nobody needs the truth.
            let _ = self.sender.send(truth);
        }
        self.before.swap(0, 1);
        self.before[1] = Some(now);
    }

    fn follow_contacts(&mut self, contacts: &[Contact], elapsed: Span) {
        let mut touching = BTreeMap::new();
        for contact in contacts {
            let parties = (contact.first, contact.second);
            if !self.matters(parties) {
                continue;
            }
            let approach = match self.touching.get(&parties) {
                Some(touch) => touch.approach_speed_m_per_s,
                None => self.approach_speed_m_per_s(contact, elapsed),
            };
            let touch = Touch { force_n: contact.force_n, approach_speed_m_per_s: approach };
            touching.insert(parties, touch);
            // Short blows between two samples must not be lost: the greatest force and speed count.
            let kept = self.since_sample.entry(parties).or_insert(touch);
            kept.force_n = kept.force_n.max(touch.force_n);
            kept.approach_speed_m_per_s = kept.approach_speed_m_per_s.max(approach);
        }
        self.touching = touching;
    }

    /// Contacts of the robot with the world, and of free bodies.
    fn matters(&self, (first, second): (ContactParty, ContactParty)) -> bool {
        let is_free = |party| matches!(party, ContactParty::Body(body) if self.free[body]);
        match (first, second) {
            (ContactParty::Link(_), ContactParty::Link(_)) => false,
            (ContactParty::Link(_), _) | (_, ContactParty::Link(_)) => true,
            (a, b) => is_free(a) || is_free(b),
        }
    }

    /// Speed of the one against the other at the contact point just before they met.
    fn approach_speed_m_per_s(&self, contact: &Contact, elapsed: Span) -> f64 {
        let [Some(earlier), Some(later)] = &self.before else { return 0.0 };
        let pose = |poses: &Poses, party| match party {
            ContactParty::Body(body) => poses.bodies.get(body).copied(),
            ContactParty::Link(link) => poses.links.get(link).copied(),
        };
        let velocity = |party| -> Option<Vector3<f64>> {
            let (from, to) = (pose(earlier, party)?, pose(later, party)?);
            let point = to.inverse_transform_point(&contact.point_in_world);
            Some((to * point - from * point) / elapsed.as_s())
        };
        let relative = velocity(contact.first).zip(velocity(contact.second)).map(|(a, b)| a - b);
        relative.map_or(0.0, |velocity| velocity.norm())
    }

    fn sample(&mut self, physics: &dyn Physics, poses: &Poses) -> Truth {
        let party = |party| match party {
            ContactParty::Body(body) => self.body_names[body].clone(),
            ContactParty::Link(link) => format!("robot/{}", physics.link_names()[link]),
        };
        let contacts = std::mem::take(&mut self.since_sample).into_iter().map(|((first, second), touch)| TrueContact {
            first: party(first),
            second: party(second),
            force_n: touch.force_n,
            approach_speed_m_per_s: touch.approach_speed_m_per_s,
        });
        let contacts = contacts.collect();
        let event = |happening: Happening| TrueEvent {
            stamp: happening.stamp,
            what: happening.what,
            moved: happening.moved.into_iter().map(|body| self.body_names[body].clone()).collect(),
        };
        let events = self.happenings.try_iter().map(event).collect();
        let (positions, velocities) = (physics.joint_positions(), physics.joint_velocities());
        let joints = positions.iter().zip(velocities.values()).map(|((name, position), velocity)| TrueJoint {
            name: name.to_owned(),
            position,
            velocity: *velocity,
        });
        let world_from_base = physics.world_from_base();
        let parts = self.true_parts(physics.now(), poses);
        Truth {
            stamp: physics.now(),
            objects: self.objects.iter().map(|object| self.true_object(object, &poses.bodies[object.body])).collect(),
            world_from_base,
            contacts,
            clearance_m: self.find_clearance_m(&world_from_base, poses),
            in_view: self.in_view.clone(),
            joints: joints.collect(),
            parts,
            events,
        }
    }

    fn true_parts(&mut self, now: Stamp, poses: &Poses) -> Vec<TruePart> {
        let mut parts = std::mem::take(&mut self.parts);
        let truth = parts.iter_mut().map(|part| {
            let joint = &part.joint;
            let position = joint.find_position(&poses.bodies[joint.carrier], &poses.bodies[joint.part]);
            let before = part.last.replace((now, position));
            TruePart {
                object: self.true_object(&part.shape, &poses.bodies[joint.part]),
                part_of: self.body_names[joint.carrier].clone(),
                joint: joint.name.clone(),
                slides: joint.motion == JointMotion::Slide,
                position,
                velocity: before.map_or(0.0, |(stamp, before)| (position - before) / (now - stamp).as_s()),
                range: joint.range,
            }
        });
        let truth = truth.collect();
        self.parts = parts;
        truth
    }

    fn true_object(&self, object: &ObjectShape, world_from_body: &Pose) -> TrueObject {
        let bounds = &object.bounds_in_body;
        TrueObject {
            body: self.body_names[object.body].clone(),
            category: object.category.clone(),
            world_from_body: *world_from_body,
            bounds: OrientedBox {
                center: world_from_body * bounds.center(),
                size: bounds.size(),
                rotation: world_from_body.rotation,
            },
            free: self.free[object.body],
        }
    }

    fn find_clearance_m(&self, world_from_base: &Pose, poses: &Poses) -> Option<f64> {
        let at = world_from_base.translation.vector;
        let column =
            Column { x_m: at.x, y_m: at.y, radius_m: self.radius_m, bottom_m: FLOOR_TOP_M, top_m: self.height_m };
        let distances = self.solids.iter().filter_map(|solid| {
            let pose = &poses.bodies[solid.body];
            if solid.is_far_from_column(pose, &column, CLEARANCE_REACH_M) {
                return None;
            }
            let is_floor = solid.bounds(pose).max.z <= FLOOR_TOP_M;
            if is_floor { None } else { solid.find_distance_to_column_m(pose, &column, CLEARANCE_REACH_M) }
        });
        distances.min_by(f64::total_cmp)
    }
}

/// The bodies with enough pixels in an image.
pub(super) fn find_in_view(image: &LabelImage, body_count: usize) -> Vec<usize> {
    let mut areas = vec![0; body_count];
    for run in &image.runs {
        if let Some(area) = image.find_body(run.label).and_then(|body| areas.get_mut(body)) {
            *area += run.length as usize;
        }
    }
    (1..body_count).filter(|body| areas[*body] >= IN_VIEW_PX).collect()
}

/// The box around the visible geoms of a body and others that are seen as it, in its own frame, as they are at the start; a
/// point at its origin when there are none.
fn visible_bounds(scene: &SceneModel, body: usize, members: &[usize]) -> Aabb {
    let mut corners: Vec<Point3<f64>> = Vec::new();
    let pose = |body: usize| scene.bodies[body].world_from_body;
    let placed = members.iter().flat_map(|member| {
        let body_from_member = if *member == body { Pose::identity() } else { pose(body).inv_mul(&pose(*member)) };
        let shown = scene.bodies[*member].geoms.iter().filter(|geom| geom.visible);
        shown.map(move |geom| (geom, body_from_member * geom.body_from_geom))
    });
    for (geom, body_from_geom) in placed {
        let half: Vector3<f64> = match &geom.shape {
            SceneShape::Plane { half_m: [x, y] } => Vector3::new(*x, *y, 0.0),
            SceneShape::Box { half_m } => *half_m,
            SceneShape::Sphere { radius_m } => Vector3::repeat(*radius_m),
            SceneShape::Ellipsoid { radii_m } => *radii_m,
            SceneShape::Cylinder { radius_m, half_length_m } => Vector3::new(*radius_m, *radius_m, *half_length_m),
            SceneShape::Capsule { radius_m, half_length_m } => {
                Vector3::new(*radius_m, *radius_m, half_length_m + radius_m)
            }
            SceneShape::Mesh { mesh } => {
                let positions = &scene.meshes[*mesh].positions;
                corners.extend(positions.iter().map(|p| body_from_geom * p.cast::<f64>()));
                continue;
            }
        };
        let symmetric = OrientedBox {
            center: Point3::from(body_from_geom.translation.vector),
            size: 2.0 * half,
            rotation: body_from_geom.rotation,
        };
        // Round shapes turned in their body would get too large a box from corners: their own extent is exact.
        match &geom.shape {
            SceneShape::Sphere { .. } => corners.extend([symmetric.center - half, symmetric.center + half]),
            SceneShape::Ellipsoid { radii_m } => {
                let turn = body_from_geom.rotation.to_rotation_matrix();
                let reach = Vector3::from_fn(|row, _| {
                    (0..3).map(|i| (turn[(row, i)] * radii_m[i]).powi(2)).sum::<f64>().sqrt()
                });
                corners.extend([symmetric.center - reach, symmetric.center + reach]);
            }
            _ => corners.extend(symmetric.corners()),
        }
    }
    Aabb::from_points(&corners).unwrap_or(Aabb { min: Point3::origin(), max: Point3::origin() })
}
