//! Puts furniture into the rooms of a plan so that a robot can still walk to all of it.

use super::catalog::{Make, find_category};
use super::draft::{Rect, turned};
use super::furniture::build_piece;
use super::piece::Piece;
use super::plan::Plan;
use super::rooms::{Spot, Wish};
use super::things::{Thing, build_fixture};
use super::walkable::Walkable;
use super::{Draws, draw_of};
use rand::RngExt;
use std::f64::consts::{FRAC_PI_2, PI};

/// Half the width of the paths that are kept free, metres.
pub(super) const PATH_RADIUS_M: f64 = 0.375;
/// Furniture cuts off less than the rest of the free floor.
const REACHED_SHARE: f64 = 0.8;
/// Draws for one piece before a room does without it.
const TRIES: usize = 60;
/// Free space between furniture and wall, metres.
const WALL_GAP_M: f64 = 0.01;
/// Free space between pieces, metres.
const PIECE_GAP_M: f64 = 0.04;
/// How far handles stand out, metres.
const HANDLE_M: f64 = 0.045;
/// Free floor on both sides of a doorway, metres: depth, and beyond the door's width.
const DOOR_ZONE_M: (f64, f64) = (0.85, 0.06);

/// What is put somewhere.
#[derive(Clone, Debug)]
pub(super) enum Item {
    /// Furniture on the floor.
    Piece(Piece),
    /// A thing on furniture or on a wall.
    Thing(Thing),
}

/// Something in its place.
pub(super) struct Placed {
    pub category: &'static str,
    pub room: usize,
    pub at: [f64; 2],
    pub base_m: f64,
    pub yaw_rad: f64,
    pub item: Item,
    pub make: Make,
    /// Whether it can be moved.
    pub free: bool,
    /// Footprint in the world.
    pub footprint: Rect,
    /// Which of its sides a robot can stand at: front, right, back, left.
    pub open_sides: [bool; 4],
}

/// Directions of a piece's front, right, back and left in its own frame, and the half side towards each.
pub(super) const SIDES: [[f64; 2]; 4] = [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];

/// A room while it fills up.
struct RoomState {
    inside: Rect,
    gates: Vec<[f64; 2]>,
    keep_free: Vec<Rect>,
    /// Indices into the placed list of what stands on the floor.
    standing: Vec<usize>,
}

/// Fills the rooms of a plan, piece by piece in turn, until `most` things stand there.
pub(super) fn furnish(plan: &Plan, most: usize, rng: &mut Draws) -> Vec<Placed> {
    let mut placed: Vec<Placed> = Vec::new();
    let mut rooms: Vec<RoomState> = (0..plan.rooms.len()).map(|room| RoomState::new(plan, room)).collect();
    let longest = plan.rooms.iter().map(|room| room.kind.wishes().len()).max().unwrap_or(0);
    for turn in 0..longest {
        for (index, room) in plan.rooms.iter().enumerate() {
            let Some(wish) = room.kind.wishes().get(turn) else { continue };
            // The first wishes make a room what it is; the others wait for the budget.
            if rng.random::<f64>() < wish.chance && (placed.len() < most || turn < 2) {
                place(wish, index, &mut rooms[index], &mut placed, rng);
            }
        }
    }
    for (index, room) in rooms.iter().enumerate() {
        let walkable = room.flood(&placed, None);
        for thing in placed.iter_mut().filter(|thing| thing.room == index) {
            thing.open_sides = find_open_sides(thing, &walkable);
        }
    }
    placed
}

/// Places for the robot to start: the widest free place of each room, with half the side of the square around it.
pub(super) fn find_starts(plan: &Plan, placed: &[Placed]) -> Vec<([f64; 2], f64)> {
    let widest = |index: usize| {
        let mut room = RoomState::new(plan, index);
        room.standing = (0..placed.len()).filter(|i| placed[*i].room == index && placed[*i].stands()).collect();
        let walkable = room.flood(placed, None);
        let obstacles: Vec<Rect> = room.standing.iter().map(|i| placed[*i].footprint).collect();
        let (at, clear_m) = walkable.find_widest(&room.inside, &obstacles)?;
        // A square fits into the free disc around the place; the robot needs its own radius and a margin.
        Some((at, ((clear_m - 0.4) / 1.5).clamp(0.0, 0.5)))
    };
    (0..plan.rooms.len()).filter_map(widest).collect()
}

impl Placed {
    /// Height of its upper end, metres.
    pub(super) fn top_m(&self) -> f64 {
        self.base_m + self.height_m()
    }

    fn stands(&self) -> bool {
        matches!(&self.item, Item::Piece(piece) if piece.height_m > 0.05)
    }

    /// Half sides in its own frame.
    pub(super) fn half(&self) -> [f64; 2] {
        match &self.item {
            Item::Piece(piece) => piece.half,
            Item::Thing(thing) => thing.half,
        }
    }
}

impl RoomState {
    fn new(plan: &Plan, index: usize) -> Self {
        let room = &plan.rooms[index];
        let mut state = Self { inside: room.inside, gates: vec![], keep_free: vec![], standing: vec![] };
        for door in room.doors.iter().map(|door| &plan.doors[*door]) {
            let into = if room.inside.center()[door.through] > door.at[door.through] { 1.0 } else { -1.0 };
            let (mut gate, mut half) = (door.at, [0.0; 2]);
            gate[door.through] += into * (PATH_RADIUS_M + 0.1);
            half[door.through] = DOOR_ZONE_M.0;
            half[1 - door.through] = door.half_width_m + DOOR_ZONE_M.1;
            state.gates.push(gate);
            state.keep_free.push(Rect::around(door.at, half));
        }
        state
    }

    fn flood(&self, placed: &[Placed], more: Option<Rect>) -> Walkable {
        let obstacles: Vec<Rect> = self.standing.iter().map(|i| placed[*i].footprint).chain(more).collect();
        Walkable::flood(&self.inside, &obstacles, PATH_RADIUS_M, &self.gates)
    }
}

/// The rectangle that a thing covers when it stands there with a heading along the axes.
fn footprint(at: [f64; 2], yaw_rad: f64, half: [f64; 2], front_m: f64) -> Rect {
    let corners = [[-half[0], -half[1] - front_m], [half[0], half[1]]].map(|corner| turned(at, yaw_rad, corner));
    Rect {
        min: [corners[0][0].min(corners[1][0]), corners[0][1].min(corners[1][1])],
        max: [corners[0][0].max(corners[1][0]), corners[0][1].max(corners[1][1])],
    }
}

/// Heading with the back towards the wall: 0 north, 1 west, 2 south, 3 east.
fn heading(wall: usize) -> f64 {
    [0.0, FRAC_PI_2, PI, -FRAC_PI_2][wall % 4]
}

/// Where a thing stands with its back to a wall, `along` 0 to 1 from one end to the other.
fn at_wall(room: &Rect, wall: usize, half: [f64; 2], along: f64) -> [f64; 2] {
    let span = |axis: usize| {
        let (low, high) = (room.min[axis] + half[0] + WALL_GAP_M, room.max[axis] - half[0] - WALL_GAP_M);
        low + along * (high - low)
    };
    let away = half[1] + WALL_GAP_M;
    match wall % 4 {
        0 => [span(0), room.max[1] - away],
        1 => [room.min[0] + away, span(1)],
        2 => [span(0), room.min[1] + away],
        _ => [room.max[0] - away, span(1)],
    }
}

fn place(wish: &Wish, index: usize, room: &mut RoomState, placed: &mut Vec<Placed>, rng: &mut Draws) {
    let Some(category) = find_category(wish.category) else { return };
    let make = category.draw(rng);
    let item = match build_piece(wish.category, make.finish, rng) {
        Some(piece) => Item::Piece(piece),
        None => match build_fixture(wish.category, make.finish, rng) {
            Some(thing) => Item::Thing(thing),
            None => return,
        },
    };
    let mut thing = Placed {
        category: category.name,
        room: index,
        at: [0.0; 2],
        base_m: 0.0,
        yaw_rad: 0.0,
        item,
        make,
        free: category.name == "pillow",
        footprint: Rect::around([0.0; 2], [0.0; 2]),
        open_sides: [false; 4],
    };
    let front_m = if thing.has_front() { HANDLE_M } else { 0.0 };
    for _ in 0..TRIES {
        let Some((at, yaw_rad, base_m)) = draw_pose(wish.spot, &thing, index, room, placed, rng) else { return };
        (thing.at, thing.yaw_rad, thing.base_m) = (at, yaw_rad, base_m);
        thing.footprint = footprint(at, yaw_rad, thing.half(), front_m);
        let fits = match wish.spot {
            Spot::On(_) => fits_on_top(&thing, placed),
            Spot::Hung(_) => fits_on_wall(&thing, room, placed),
            Spot::Floor => room.inside.holds(&thing.footprint),
            _ => fits_on_floor(&thing, room, placed),
        };
        if fits {
            if thing.stands() {
                room.standing.push(placed.len());
            }
            placed.push(thing);
            return;
        }
    }
}

impl Placed {
    /// Whether it has doors or drawers.
    fn has_front(&self) -> bool {
        matches!(&self.item, Item::Piece(piece) if !piece.parts.is_empty())
    }
}

/// Position, heading and height of the underside.
fn draw_pose(
    spot: Spot,
    thing: &Placed,
    index: usize,
    room: &RoomState,
    placed: &[Placed],
    rng: &mut Draws,
) -> Option<([f64; 2], f64, f64)> {
    let half = thing.half();
    let host = |name: &str, rng: &mut Draws| {
        let hosts: Vec<&Placed> = placed.iter().filter(|p| p.room == index && p.category == name).collect();
        (!hosts.is_empty()).then(|| *draw_of(&hosts.iter().collect::<Vec<_>>(), rng))
    };
    let wall = rng.random_range(0..4);
    Some(match spot {
        Spot::Wall => (at_wall(&room.inside, wall, half, rng.random()), heading(wall), 0.0),
        Spot::Corner => {
            let end = f64::from(u8::from(rng.random::<bool>()));
            (at_wall(&room.inside, wall, half, end), heading(wall), 0.0)
        }
        Spot::Open | Spot::Floor => {
            let center = room.inside.center();
            let size = room.inside.size();
            let spread = if spot == Spot::Floor { 0.15 } else { 0.3 };
            let at = [0, 1].map(|i| center[i] + spread * size[i] * (2.0 * rng.random::<f64>() - 1.0));
            let longer_y = f64::from(u8::from(size[1] > size[0]));
            let turn = if spot == Spot::Floor { longer_y } else { f64::from(rng.random_range(0..2)) };
            (at, turn * FRAC_PI_2, 0.0)
        }
        Spot::Before(name, gap_cm) => {
            let host = host(name, rng)?;
            let away = host.half()[1] + f64::from(gap_cm) / 100.0 + half[1];
            let aside = 0.25 * host.half()[0] * (2.0 * rng.random::<f64>() - 1.0);
            (turned(host.at, host.yaw_rad, [aside, -away]), host.yaw_rad + PI, 0.0)
        }
        Spot::Beside(name) => {
            let host = host(name, rng)?;
            // The row of pieces that begins at the host may be continued.
            let row: f64 = 2.0 * f64::from(rng.random_range(0..2)) - 1.0;
            let further = if rng.random::<bool>() { 0.0 } else { 0.6 + PIECE_GAP_M };
            let aside = row * (host.half()[0] + PIECE_GAP_M + half[0] + further);
            (turned(host.at, host.yaw_rad, [aside, host.half()[1] - half[1]]), host.yaw_rad, 0.0)
        }
        Spot::Around(name) => {
            let host = host(name, rng)?;
            // The front stays free: there the robot stands to reach onto the table.
            let side = rng.random_range(1..4);
            let [sx, sy] = SIDES[side];
            let [hx, hy] = host.half();
            let slide = 2.0 * rng.random::<f64>() - 1.0;
            let away = half[1] + 0.06;
            let at = if sx == 0.0 {
                [slide * (hx - half[0]).max(0.0), sy * (hy + away)]
            } else {
                [sx * (hx + away), 0.5 * slide * (hy - half[0]).max(0.0)]
            };
            let back_out = sy.atan2(sx) - FRAC_PI_2;
            (turned(host.at, host.yaw_rad, at), host.yaw_rad + back_out, 0.0)
        }
        Spot::On(name) => {
            let host = host(name, rng)?;
            let Item::Piece(piece) = &host.item else { return None };
            let top = piece.tops.last()?;
            let room_m = [0, 1].map(|i| (top.half[i] - half[i] - 0.01).max(0.0));
            // Screens and lamps stand at the back, in the middle or aside; keyboards would lie in front.
            let slide = if thing.category == "tv" { 0.0 } else { 2.0 * rng.random::<f64>() - 1.0 };
            let local = [top.center[0] + slide * room_m[0], top.center[1] + room_m[1] - 0.02_f64.min(room_m[1])];
            (turned(host.at, host.yaw_rad, local), host.yaw_rad, top.z_m)
        }
        Spot::Hung(height_cm) => {
            let at = at_wall(&room.inside, wall, half, rng.random());
            // Right on the wall.
            let at = turned(at, heading(wall), [0.0, WALL_GAP_M - 0.002]);
            (at, heading(wall), f64::from(height_cm) / 100.0)
        }
    })
}

fn fits_on_floor(thing: &Placed, room: &RoomState, placed: &[Placed]) -> bool {
    let own = thing.footprint;
    let inside = room.inside.holds(&own);
    let off_doors = room.keep_free.iter().all(|zone| !zone.overlaps(&own));
    let gap = own.grown(PIECE_GAP_M - 0.01);
    let clear = room.standing.iter().all(|i| !placed[*i].footprint.overlaps(&gap));
    let high = thing.height_m() > 1.1;
    let hides = placed.iter().any(|p| p.room == thing.room && p.hangs() && high && p.footprint.overlaps(&gap));
    if !inside || !off_doors || !clear || hides {
        return false;
    }
    let walkable = room.flood(placed, Some(own));
    let in_one_piece = walkable.reached_share() >= REACHED_SHARE;
    let gates_open = in_one_piece && room.gates.iter().all(|gate| walkable.reaches(*gate));
    let used = |p: &Placed| !p.must_be_reached() || is_usable(p, &find_open_sides(p, &walkable));
    gates_open && used(thing) && room.standing.iter().all(|i| used(&placed[*i]))
}

impl Placed {
    fn height_m(&self) -> f64 {
        match &self.item {
            Item::Piece(piece) => piece.height_m,
            Item::Thing(thing) => thing.height_m,
        }
    }

    fn hangs(&self) -> bool {
        matches!(self.item, Item::Thing(_)) && matches!(self.category, "picture" | "mirror" | "clock")
    }

    fn must_be_reached(&self) -> bool {
        matches!(&self.item, Item::Piece(piece) if !piece.tops.is_empty() || !piece.parts.is_empty())
    }
}

/// Whether what stands on it can be taken and its doors can be opened.
fn is_usable(thing: &Placed, open: &[bool; 4]) -> bool {
    let Item::Piece(piece) = &thing.item else { return true };
    let from_front = !piece.parts.is_empty() || piece.tops.iter().any(|top| !top.open_around);
    if from_front { open[0] } else { open.iter().any(|side| *side) }
}

/// The sides at which the robot can stand.
fn find_open_sides(thing: &Placed, walkable: &Walkable) -> [bool; 4] {
    let half = thing.half();
    SIDES.map(|side| {
        let along = [side[1].abs(), side[0].abs()];
        [-0.5, 0.0, 0.5].iter().any(|slide| {
            [0.4, 0.46].iter().any(|away| {
                let local = [0, 1].map(|i| side[i] * (half[i] + away) + slide * along[i] * half[i]);
                walkable.reaches(turned(thing.at, thing.yaw_rad, local))
            })
        })
    })
}

fn fits_on_top(thing: &Placed, placed: &[Placed]) -> bool {
    let gap = thing.footprint.grown(0.03);
    let beside = placed.iter().filter(|p| p.room == thing.room && (p.base_m - thing.base_m).abs() < 1e-9);
    beside.into_iter().all(|p| p.base_m <= 0.0 || !p.footprint.overlaps(&gap))
}

fn fits_on_wall(thing: &Placed, room: &RoomState, placed: &[Placed]) -> bool {
    let own = thing.footprint.grown(0.1);
    let doors = room.keep_free.iter().all(|zone| !zone.overlaps(&own));
    let others = placed.iter().filter(|p| p.room == thing.room);
    let below_m = thing.base_m - 0.5 * thing.height_m();
    let hidden = |p: &Placed| p.hangs() || p.base_m + p.height_m() > below_m - 0.05;
    doors && others.into_iter().all(|p| !hidden(p) || !p.footprint.overlaps(&own))
}
