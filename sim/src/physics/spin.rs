//! Friction of the pads against spinning. A pad is soft: it touches a patch, which holds a thing against turning about the
//! contact's normal. The engine's contacts are hard points, and a round thing between two flat pads has one on each side,
//! about which it swings freely. MJCF states the patch as the second number of `friction` (`condim` 4); MuJoCo has it
//! built in.
//!
//! Dahl's model: a spring against the angle turned since the patch last let go, which gives way at the friction's limit.

use super::convert::{from_vector, to_vector};
use super::robot_body::{BuiltRobot, find_link_of_tag};
use rapier3d::prelude::*;
use std::collections::BTreeMap;

/// Torque that a patch holds for each newton of normal force, metres: MuJoCo's default for `condim` 4.
const PATCH_M: f64 = 0.005;
/// Stiffness and damping in units of inertia and step, for each of two pads: stable for an explicit step, and soft enough
/// not to shake the contacts. A thing of 0.4 kg held 2 cm off its balance turns by about two degrees before it is held.
const STIFFNESS: f64 = 0.02;
const DAMPING: f64 = 0.05;

/// A finger's link and the tag of what it touches.
type Pair = (usize, u128);

/// What the pads hold.
#[derive(Clone, Debug, Default)]
pub(super) struct PadSpin {
    /// The body of each contact, and the angle that the patch holds, radians.
    held: BTreeMap<Pair, (RigidBodyHandle, f64)>,
}

struct PadContact {
    body: RigidBodyHandle,
    force_n: f64,
    impulse: Vector,
}

impl PadSpin {
    /// Sets the torques for the next step from the contacts of the last one.
    pub(super) fn apply(&mut self, robot: &BuiltRobot, world: &mut PhysicsWorld, step_s: f64) {
        let mut touching: BTreeMap<Pair, PadContact> = BTreeMap::new();
        for pair in world.contact_pairs() {
            let Some((finger, tag, body)) = find_pad_contact(robot, world, pair) else { continue };
            let none = PadContact { body, force_n: 0.0, impulse: Vector::ZERO };
            let contact = touching.entry((finger, tag)).or_insert(none);
            contact.force_n += f64::from(pair.total_impulse_magnitude()) / step_s;
            contact.impulse += pair.total_impulse();
        }
        for (body, _) in self.held.values() {
            world.bodies[*body].reset_torques(false);
        }
        for finger in robot.finger_links {
            world.bodies[robot.links[finger].body].reset_torques(false);
        }
        self.held.retain(|pair, _| touching.contains_key(pair));
        for ((finger, tag), PadContact { body, force_n, impulse }) in touching {
            let finger_body = robot.links[finger].body;
            let Some(normal) = from_vector(impulse).try_normalize(0.0) else { continue };
            let thing = &world.bodies[body];
            let about = thing.mass_properties().effective_world_inv_inertia * to_vector(&normal);
            let inverse_inertia = from_vector(about).dot(&normal);
            if inverse_inertia <= 0.0 {
                continue;
            }
            let spin = thing.angvel() - world.bodies[finger_body].angvel();
            let spin_rad_per_s = from_vector(spin).dot(&normal);
            let stiffness = STIFFNESS / (inverse_inertia * step_s * step_s);
            let damping = DAMPING / (inverse_inertia * step_s);
            let limit_nm = PATCH_M * force_n;
            let (_, turned) = self.held.entry((finger, tag)).or_insert((body, 0.0));
            let most_rad = limit_nm / stiffness;
            *turned = (*turned + spin_rad_per_s * step_s).clamp(-most_rad, most_rad);
            let torque_nm = (-stiffness * *turned - damping * spin_rad_per_s).clamp(-limit_nm, limit_nm);
            let torque = to_vector(&(normal * torque_nm));
            world.bodies[body].add_torque(torque, true);
            world.bodies[finger_body].add_torque(-torque, true);
        }
    }
}

/// The finger, and the tag and body of the free thing that it touches.
fn find_pad_contact(
    robot: &BuiltRobot,
    world: &PhysicsWorld,
    pair: &ContactPair,
) -> Option<(usize, u128, RigidBodyHandle)> {
    let (first, second) = (world.colliders.get(pair.collider1)?, world.colliders.get(pair.collider2)?);
    let finger_of =
        |collider: &Collider| find_link_of_tag(collider.user_data).filter(|link| robot.finger_links.contains(link));
    let (finger, other) = match (finger_of(first), finger_of(second)) {
        (Some(finger), None) => (finger, second),
        (None, Some(finger)) => (finger, first),
        _ => return None,
    };
    let body = other.parent()?;
    let is_thing = find_link_of_tag(other.user_data).is_none() && world.bodies.get(body)?.is_dynamic();
    (is_thing && pair.total_impulse() != Vector::ZERO).then_some((finger, other.user_data, body))
}
