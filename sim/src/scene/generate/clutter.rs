//! Lays things to be grasped on furniture, several of a kind, where a robot can take them.

use super::catalog::find_category;
use super::draft::{Rect, turned};
use super::furnish::{Item, Placed, SIDES};
use super::piece::Top;
use super::plan::Plan;
use super::things::build_graspable;
use super::{Draws, draw_of};
use rand::RngExt;

/// Heights between which things can be taken, metres.
const TAKE_HEIGHT_M: (f64, f64) = (0.3, 1.25);
/// The middle of a thing lies at most this far from an edge that can be reached, metres.
const REACH_M: f64 = 0.42;
/// Free space between things, for the fingers, metres.
const FINGER_GAP_M: f64 = 0.055;
/// Free height above a thing, metres.
const ABOVE_M: f64 = 0.12;
/// A thing keeps this far from the edge of what carries it, metres.
const EDGE_M: f64 = 0.02;
/// Things lie this far above their support and settle, metres.
pub(super) const LIFT_M: f64 = 0.0005;
/// How many of a kind there are.
const PER_KIND: &[usize] = &[1, 2, 3, 3, 4, 5];
/// How much likelier a thing lies where it usually does.
const USUAL_WEIGHT: f64 = 8.0;
/// Draws for one thing before it is left out.
const TRIES: usize = 40;

/// A level that can be reached.
struct Level {
    host: usize,
    top: Top,
    open_sides: [bool; 4],
}

/// Adds up to `count` things.
pub(super) fn lay_things(plan: &Plan, placed: &mut Vec<Placed>, count: usize, rng: &mut Draws) {
    let levels = find_levels(placed);
    if levels.is_empty() {
        return;
    }
    let mut kinds: Vec<&'static str> = plan.rooms.iter().flat_map(|room| room.kind.usual_things()).copied().collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut left = count;
    while left > 0 && !kinds.is_empty() {
        let kind = kinds.swap_remove(rng.random_range(0..kinds.len()));
        for _ in 0..draw_of(PER_KIND, rng).min(left) {
            left -= usize::from(lay_one(kind, plan, &levels, placed, rng));
        }
        if kinds.is_empty() && left > 0 {
            // All kinds are there: more of the usual ones, while there is room.
            let before = left;
            for kind in plan.rooms.iter().flat_map(|room| room.kind.usual_things()) {
                left -= usize::from(left > 0 && lay_one(kind, plan, &levels, placed, rng));
            }
            if left < before {
                kinds.extend(plan.rooms.iter().flat_map(|room| room.kind.usual_things()).copied());
            }
        }
    }
}

fn find_levels(placed: &[Placed]) -> Vec<Level> {
    let mut levels = Vec::new();
    for (host, thing) in placed.iter().enumerate() {
        let Item::Piece(piece) = &thing.item else { continue };
        for top in &piece.tops {
            let mut open_sides = thing.open_sides;
            if !top.open_around {
                open_sides[1..].fill(false);
            }
            let in_reach = (TAKE_HEIGHT_M.0..=TAKE_HEIGHT_M.1).contains(&top.z_m);
            if in_reach && open_sides.contains(&true) {
                levels.push(Level { host, top: *top, open_sides });
            }
        }
    }
    levels
}

fn lay_one(kind: &str, plan: &Plan, levels: &[Level], placed: &mut Vec<Placed>, rng: &mut Draws) -> bool {
    let Some(category) = find_category(kind) else { return false };
    // Several of a kind differ in colour or material as far as that goes.
    let twin = |finish| placed.iter().any(|p| p.category == kind && p.make.finish == finish);
    let mut make = category.draw(rng);
    for _ in 0..4 {
        if twin(make.finish) {
            make = category.draw(rng);
        }
    }
    let Some(thing) = build_graspable(kind, make.finish, rng) else { return false };
    let weight = |level: &Level| {
        let usual = plan.rooms[placed[level.host].room].kind.usual_things().contains(&kind);
        let area = 4.0 * level.top.half[0] * level.top.half[1];
        area.sqrt() * if usual { USUAL_WEIGHT } else { 1.0 }
    };
    let total: f64 = levels.iter().map(weight).sum();
    for _ in 0..TRIES {
        let mut pick = rng.random::<f64>() * total;
        let level = levels.iter().find(|level| {
            pick -= weight(level);
            pick <= 0.0
        });
        let Some(level) = level else { continue };
        let radius =
            if thing.any_heading { thing.half[0].max(thing.half[1]) } else { thing.half[0].hypot(thing.half[1]) };
        let inner = level.top.half.map(|half| half - radius - EDGE_M);
        if inner[0] < 0.0 || inner[1] < 0.0 || level.top.headroom_m < thing.height_m + ABOVE_M {
            continue;
        }
        let local = inner.map(|half| half * (2.0 * rng.random::<f64>() - 1.0));
        if find_edge_distance_m(level, local) > REACH_M {
            continue;
        }
        let host = &placed[level.host];
        let in_host = [0, 1].map(|i| level.top.center[i] + local[i]);
        let at = turned(host.at, host.yaw_rad, in_host);
        let base_m = level.top.z_m + LIFT_M;
        let clear = placed.iter().all(|other| {
            let same_level = (other.base_m - base_m).abs() < 0.01 && other.room == host.room;
            !same_level || other.footprint.distance_m(at) >= radius + FINGER_GAP_M
        });
        if !clear {
            continue;
        }
        let spread = if thing.any_heading { std::f64::consts::PI } else { 0.4 };
        let yaw_rad = host.yaw_rad + spread * (2.0 * rng.random::<f64>() - 1.0);
        let room = host.room;
        placed.push(Placed {
            category: category.name,
            room,
            at,
            base_m,
            yaw_rad,
            item: Item::Thing(thing),
            make,
            free: true,
            footprint: Rect::around(at, [radius; 2]),
            open_sides: [false; 4],
        });
        return true;
    }
    false
}

/// From a place on a level to the nearest edge at which the robot can stand, metres.
fn find_edge_distance_m(level: &Level, local: [f64; 2]) -> f64 {
    let open = SIDES.iter().zip(level.open_sides).filter(|(_, open)| *open);
    open.map(|(side, _)| (0..2).map(|i| side[i].abs() * (level.top.half[i] - side[i] * local[i])).sum())
        .fold(f64::INFINITY, f64::min)
}
