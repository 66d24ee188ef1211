//! Furniture that opens as real furniture does: bar handles that a hand can hold, joints with weight and friction, and
//! things inside.
//!
//! It draws from a stream of its own and adds to a draft that is complete: the home around it is the same with and without.

use super::catalog::{Category, find_category};
use super::draft::{Body, Draft, Feel, Joint, Meaning, Part, Shape, turned};
use super::things::build_graspable;
use super::{Draws, draw_of, draws};
use rand::RngExt;

/// Stream of these draws among all of a home.
const STREAM: u64 = 0x6472_6177_6572;
/// Length and thickness of a bar handle and the gap behind it for fingers, metres: what furniture shops sell.
pub(super) const BAR_LENGTH_M: (f64, f64) = (0.10, 0.16);
pub(super) const BAR_THICK_M: (f64, f64) = (0.012, 0.018);
const BAR_GAP_M: (f64, f64) = (0.03, 0.04);
/// Half side of the posts of a handle, metres.
pub(super) const POST_M: f64 = 0.005;
/// Force that moves a drawer on its runners, newtons.
const DRAWER_N: (f64, f64) = (5.0, 20.0);
/// Force at the handle that moves a door on its hinges, newtons.
const DOOR_N: (f64, f64) = (5.0, 15.0);
/// Share of that force that grows with speed, at the speed below; the rest is dry friction.
pub(super) const VISCOUS_SHARE: f64 = 0.1;
/// A drawer comes out, and a handle swings, at about this speed, metres per second.
pub(super) const USUAL_M_PER_S: f64 = 0.2;
/// A drawer comes out by this share of its depth.
const EXTENSION: f64 = 0.75;
/// Particle board, kg/m^3; fronts of sheet metal and hollow handles weigh about as much.
const BOARD_KG_PER_M3: f64 = 650.0;
/// Share of the drawers with something in them.
const FILLED_SHARE: f64 = 0.5;
/// Things in such a drawer.
const PER_DRAWER: &[usize] = &[1, 1, 2];
/// Room between things in a drawer, to its walls and above, for fingers, metres.
const ROOM_M: f64 = 0.03;
/// Draws for one thing before it is left out.
const TRIES: usize = 12;

pub(super) fn between(rng: &mut Draws, (low, high): (f64, f64)) -> f64 {
    rng.random_range(low..=high)
}

/// Gives all doors and drawers of a draft handles, weight and friction, and puts things into some drawers. `kinds` are what
/// may lie there.
pub(super) fn articulate(draft: &mut Draft, seed: u64, kinds: &[&'static str]) {
    let mut rng = draws(seed, STREAM);
    let mut inside = Vec::new();
    for body in &mut draft.bodies {
        for index in 0..body.parts.len() {
            give_handle(&mut body.parts[index], &mut rng);
            if matches!(body.parts[index].joint, Joint::Slide { .. }) && rng.random::<f64>() < FILLED_SHARE {
                fill(body, index, kinds, &mut inside, &mut rng);
            }
        }
    }
    for (category, mut body) in inside {
        let number = 1 + draft.bodies.iter().filter(|other| other.meaning.category == category.name).count();
        body.name = format!("{}_{number}", category.name.replace(' ', "_"));
        draft.bodies.push(body);
    }
}

/// A bar on two posts before the front instead of the block that plain furniture has, and what it takes to move the part.
fn give_handle(part: &mut Part, rng: &mut Draws) {
    let [front, block] = [0, 1].map(|index| part.geoms.0[index].clone());
    let Shape::Box([wide, thick, high]) = front.shape else { return };
    let (length, bar, gap) = (between(rng, BAR_LENGTH_M), between(rng, BAR_THICK_M), between(rng, BAR_GAP_M));
    let upright = matches!(part.joint, Joint::Hinge { .. });
    // Along the front, no longer than it.
    let half = 0.5 * length.min(1.6 * if upright { high } else { wide });
    let along = |by: f64, y: f64| {
        let [x, _, z] = block.at_m;
        if upright { [x, y, z + by] } else { [x + by, y, z] }
    };
    let bar_half = if upright { [0.5 * bar, 0.5 * bar, half] } else { [half, 0.5 * bar, 0.5 * bar] };
    part.geoms.0.remove(1);
    part.geoms.cuboid(along(0.0, -thick - gap - 0.5 * bar), bar_half, block.finish);
    for side in [-1.0, 1.0] {
        let at = along(side * (half - 2.0 * POST_M), -thick - 0.5 * gap);
        part.geoms.cuboid(at, [POST_M, 0.5 * gap, POST_M], block.finish);
    }
    let (effort, arm_m) = match &mut part.joint {
        Joint::Slide { open_m } => {
            // The builder lets it out by 0.6 of its depth.
            *open_m *= EXTENSION / 0.6;
            (between(rng, DRAWER_N), 1.0)
        }
        Joint::Hinge { .. } => {
            let arm_m = block.at_m[0].abs();
            (between(rng, DOOR_N) * arm_m, arm_m)
        }
    };
    let speed = USUAL_M_PER_S / arm_m;
    part.feel = Some(Feel {
        friction: (1.0 - VISCOUS_SHARE) * effort,
        damping: VISCOUS_SHARE * effort / speed,
        kg_per_m3: BOARD_KG_PER_M3,
    });
}

/// Lays things into a drawer.
fn fill(
    body: &Body,
    part: usize,
    kinds: &[&'static str],
    inside: &mut Vec<(&'static Category, Body)>,
    rng: &mut Draws,
) {
    let drawer = &body.parts[part];
    // The builder's drawer: front, bottom, two sides, back; the handle comes last now.
    let (bottom, side) = (&drawer.geoms.0[1], &drawer.geoms.0[2]);
    let (Shape::Box([half_x, half_y, half_z]), Shape::Box([_, _, wall])) = (bottom.shape, side.shape) else { return };
    let floor_m = bottom.at_m[2] + half_z;
    // Things must be lower than the front, and lie where an open drawer shows them.
    let Shape::Box([_, _, front]) = drawer.geoms.0[0].shape else { return };
    let headroom_m = (front - floor_m - ROOM_M).max(2.0 * wall);
    let reach_m = 2.0 * half_y * EXTENSION;
    let mut taken: Vec<([f64; 2], f64)> = Vec::new();
    for _ in 0..draw_of(PER_DRAWER, rng) {
        for _ in 0..TRIES {
            let Some(category) = find_category(draw_of(kinds, rng)) else { continue };
            let make = category.draw(rng);
            let Some(thing) = build_graspable(category.name, make.finish, rng) else { continue };
            let radius = thing.half[0].hypot(thing.half[1]);
            let low_y = bottom.at_m[1] - half_y;
            let (x, y) = (half_x - radius - ROOM_M, (low_y + radius + ROOM_M, low_y + reach_m - radius - ROOM_M));
            if x < 0.0 || y.1 < y.0 || thing.height_m > headroom_m {
                continue;
            }
            let at = [between(rng, (-x, x)), between(rng, y)];
            let apart =
                |(other, size): &([f64; 2], f64)| (at[0] - other[0]).hypot(at[1] - other[1]) >= radius + size + ROOM_M;
            if !taken.iter().all(apart) {
                continue;
            }
            taken.push((at, radius));
            let in_body = [drawer.at_m[0] + at[0], drawer.at_m[1] + at[1]];
            let [x, y] = turned([body.at_m[0], body.at_m[1]], body.yaw_rad, in_body);
            let z = body.at_m[2] + drawer.at_m[2] + floor_m + super::clutter::LIFT_M;
            let meaning = Meaning {
                category: category.name.to_owned(),
                finish: make.finish,
                material_known: true,
                mass_kg: Some(make.mass_kg),
                affordances: category.affordances.iter().map(|a| (*a).to_owned()).collect(),
                moves: None,
                unusual: make.unusual,
            };
            let yaw_rad = body.yaw_rad + between(rng, (-0.4, 0.4));
            let (name, geoms, parts) = (String::new(), thing.geoms, Vec::new());
            inside.push((category, Body { name, at_m: [x, y, z], yaw_rad, free: true, geoms, parts, meaning }));
            break;
        }
    }
}
