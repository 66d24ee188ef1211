//! Doors in the doorways of a home: a board on hinges at one jamb, a bar handle on both faces, no latch.
//!
//! They draw from a stream of their own and are added to a home that is complete: all else is the same with and without.
//! A leaf lies nearly flush with the wall of the room into which it opens, and deep in the doorway seen from the other side,
//! as it is with real frames; so one who looks knows whether to pull or to push.

use super::articulate::{BAR_LENGTH_M, BAR_THICK_M, POST_M, USUAL_M_PER_S, VISCOUS_SHARE, between};
use super::draft::{Body, Feel, Geoms, Joint, Meaning, Part, Rect, turned};
use super::finish::{Color, Finish, Material, Pattern};
use super::furnish::Placed;
use super::plan::{DOOR_HEIGHT_M, Door, HALF_WALL_M, Plan};
use super::{Draws, draws};
use rand::RngExt;
use std::f64::consts::{FRAC_PI_2, PI};

/// Stream of these draws among all of a home.
const STREAM: u64 = 0x646f_6f72;
/// Thickness of a leaf and the gaps around it, metres.
const THICK_M: f64 = 0.04;
const GAP_M: f64 = 0.01;
/// So far behind the wall's face it lies on the side to which it opens: casings stand out of walls.
const RECESS_M: f64 = 0.015;
/// It opens by this much, radians.
const OPEN_RAD: f64 = 1.5;
/// Height of the middle of its handles, and their distance from the free edge, metres.
const HANDLE_M: (f64, f64) = (0.95, 1.05);
const FROM_EDGE_M: f64 = 0.07;
/// Gap between a bar and the leaf, metres: that of doors is wider than that of cupboards.
const BAR_GAP_M: (f64, f64) = (0.038, 0.045);
/// Force at the handle that moves it, newtons.
const DOOR_N: (f64, f64) = (5.0, 20.0);
/// A leaf with a hollow core, all in all, kg/m^3.
const LEAF_KG_PER_M3: f64 = 300.0;
/// Free of everything around the quarter disc that the leaf sweeps, metres.
const SPARE_M: f64 = 0.06;
/// What ends below this is passed over, metres.
const UNDER_M: f64 = 0.008;
/// The passage before and behind a doorway that no other leaf may stand in, metres.
const PASSAGE_M: f64 = 0.45;

/// One way to hang a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hanging {
    /// The axis of its hinges, metres.
    pivot: [f64; 2],
    /// Heading of the frame whose -y points to where it opens.
    yaw_rad: f64,
    /// 1 when the leaf lies along +x of that frame, -1 along -x.
    inward: f64,
    length_m: f64,
    /// The room into which it opens.
    room: usize,
}

impl Hanging {
    /// The way to hang a leaf that opens into a room of a doorway (0 or 1), hinged at one jamb (-1 or 1).
    fn of(plan: &Plan, door: &Door, side: usize, jamb: f64) -> Self {
        let room = door.rooms[side];
        let into = if plan.rooms[room].inside.center()[door.through] > door.at[door.through] { 1.0 } else { -1.0 };
        let yaw_rad = match (door.through, into > 0.0) {
            (0, true) => FRAC_PI_2,
            (0, false) => -FRAC_PI_2,
            (_, true) => PI,
            (_, false) => 0.0,
        };
        let (inward, half_m) = (-jamb, door.half_width_m - GAP_M);
        let pivot = turned(door.at, yaw_rad, [jamb * half_m, RECESS_M - HALF_WALL_M]);
        Self { pivot, yaw_rad, inward, length_m: 2.0 * half_m, room }
    }

    /// The square around the quarter disc that it sweeps.
    fn square(&self) -> Rect {
        let far = turned(self.pivot, self.yaw_rad, [self.inward * self.length_m, -self.length_m]);
        Rect { min: [0, 1].map(|i| self.pivot[i].min(far[i])), max: [0, 1].map(|i| self.pivot[i].max(far[i])) }
            .grown(SPARE_M)
    }

    fn sweeps(&self, footprint: &Rect) -> bool {
        self.square().overlaps(footprint) && footprint.distance_m(self.pivot) < self.length_m + SPARE_M
    }

    fn is_free(&self, plan: &Plan, placed: &[Placed], door: &Door, others: &[Self]) -> bool {
        let stands = |thing: &&Placed| thing.base_m < DOOR_HEIGHT_M && thing.top_m() > UNDER_M;
        let things = placed.iter().filter(|thing| thing.room == self.room).filter(stands);
        let passage = |other: &Door| {
            let mut half = [other.half_width_m; 2];
            half[other.through] = PASSAGE_M;
            Rect::around(other.at, half)
        };
        let mut passages = plan.doors.iter().filter(|other| other.at != door.at).map(passage);
        things.into_iter().all(|thing| !self.sweeps(&thing.footprint))
            && passages.all(|passage| !self.sweeps(&passage))
            && others.iter().all(|other| !other.square().overlaps(&self.square()))
    }

    fn body(&self, name: String, (leaf, handle): (Finish, Finish), rng: &mut Draws) -> Body {
        let (low_m, high_m) = (GAP_M, DOOR_HEIGHT_M - GAP_M);
        let half_m = [0.5 * self.length_m, 0.5 * THICK_M, 0.5 * (high_m - low_m)];
        let middle_m = 0.5 * (low_m + high_m);
        let (x, z) = (self.inward * (self.length_m - FROM_EDGE_M), between(rng, HANDLE_M) - middle_m);
        let (length, bar, gap) = (between(rng, BAR_LENGTH_M), between(rng, BAR_THICK_M), between(rng, BAR_GAP_M));
        let mut geoms = Geoms::default();
        geoms.cuboid([self.inward * half_m[0], half_m[1], 0.0], half_m, leaf);
        for (face, out) in [(0.0, -1.0), (THICK_M, 1.0)] {
            geoms.cuboid([x, face + out * (gap + 0.5 * bar), z], [0.5 * bar, 0.5 * bar, 0.5 * length], handle);
            for end in [-1.0, 1.0] {
                let at = [x, face + out * 0.5 * gap, z + end * (0.5 * length - 2.0 * POST_M)];
                geoms.cuboid(at, [POST_M, 0.5 * gap, POST_M], handle);
            }
        }
        let effort = between(rng, DOOR_N) * x.abs();
        let feel = Feel {
            friction: (1.0 - VISCOUS_SHARE) * effort,
            damping: VISCOUS_SHARE * effort * x.abs() / USUAL_M_PER_S,
            kg_per_m3: LEAF_KG_PER_M3,
        };
        let leaf_part = Part {
            name: "leaf".into(),
            joint: Joint::Hinge { open_rad: -self.inward * OPEN_RAD },
            at_m: [0.0, 0.0, middle_m],
            geoms,
            feel: Some(feel),
        };
        Body {
            name,
            at_m: [self.pivot[0], self.pivot[1], 0.0],
            yaw_rad: self.yaw_rad,
            free: false,
            geoms: Geoms::default(),
            parts: vec![leaf_part],
            meaning: Meaning {
                category: "door".into(),
                finish: leaf,
                material_known: true,
                mass_kg: Some(8.0 * half_m[0] * half_m[1] * half_m[2] * LEAF_KG_PER_M3),
                affordances: vec!["open".into()],
                moves: None,
                unusual: false,
            },
        }
    }
}

/// Closed doors for the doorways between which and the rest of a home one likes to have a door: of bedrooms, bathrooms and
/// where one works. A doorway stays open where nothing can be hung that swings free of furniture and of other leaves.
pub(super) fn hang_doors(plan: &Plan, placed: &[Placed], seed: u64) -> Vec<Body> {
    let mut rng = draws(seed, STREAM);
    let leaf = Finish::draw(Material::Wood, &[Color::White, Color::Brown, Color::Beige], &mut rng);
    let handle = Finish { material: Material::Metal, color: Color::Gray, pattern: Pattern::Plain, shade: 0 };
    let (mut hung, mut bodies): (Vec<Hanging>, Vec<Body>) = (Vec::new(), Vec::new());
    for door in plan.doors.iter().filter(|door| door.rooms.iter().any(|room| plan.rooms[*room].kind.is_private())) {
        let (side, jamb) = (rng.random_range(0..2_usize), if rng.random::<bool>() { 1.0 } else { -1.0 });
        let ways = [(side, jamb), (side, -jamb), (1 - side, jamb), (1 - side, -jamb)];
        let free = ways.into_iter().map(|(side, jamb)| Hanging::of(plan, door, side, jamb));
        let Some(way) = free.into_iter().find(|way| way.is_free(plan, placed, door, &hung)) else { continue };
        bodies.push(way.body(format!("door_{}", hung.len() + 1), (leaf, handle), &mut rng));
        hung.push(way);
    }
    bodies
}
