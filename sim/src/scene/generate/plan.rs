//! The floor plan: rooms from a rectangle that is split again and again, walls between them, and doorways.

use super::draft::{Geom, Rect, Shape};
use super::finish::{Color, Finish, Material, Pattern};
use super::rooms::RoomKind;
use super::{Draws, draw_of};
use rand::RngExt;

/// Half the thickness of a wall, metres.
pub(super) const HALF_WALL_M: f64 = 0.05;
/// Height of the walls, metres.
pub(super) const WALL_HEIGHT_M: f64 = 2.4;
/// Height of a doorway, metres.
pub(super) const DOOR_HEIGHT_M: f64 = 2.05;
/// Thickness of the floor, metres.
const FLOOR_HALF_M: f64 = 0.05;
/// A doorway keeps this far from the ends of the wall that two rooms share, metres.
const DOOR_MARGIN_M: f64 = 0.3;
/// Shortest side of a room between the middles of its walls, metres.
const SHORTEST_SIDE_M: f64 = 2.75;
/// Floor area per room, smallest and largest, square metres.
const AREA_PER_ROOM_M2: (f64, f64) = (12.5, 16.0);
/// Share of the walls that get a doorway although the rooms are connected already.
const SECOND_WAY_SHARE: f64 = 0.2;

/// One room.
#[derive(Clone, Debug)]
pub(super) struct PlannedRoom {
    pub kind: RoomKind,
    pub name: String,
    /// Inside of its walls.
    pub inside: Rect,
    /// Indices into the plan's doors.
    pub doors: Vec<usize>,
    outline: Rect,
}

/// A doorway in the middle of a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Door {
    pub at: [f64; 2],
    pub half_width_m: f64,
    /// 0 when one walks through it along x, 1 along y.
    pub through: usize,
    pub rooms: [usize; 2],
}

/// All rooms and doors of a home.
pub(super) struct Plan {
    pub rooms: Vec<PlannedRoom>,
    pub doors: Vec<Door>,
    outer: Rect,
}

/// The rectangle that two rooms' outlines share along one axis.
struct Shared {
    rooms: [usize; 2],
    through: usize,
    line: f64,
    from: f64,
    to: f64,
}

/// Plans a home of so many rooms.
pub(super) fn plan_home(rooms: usize, rng: &mut Draws) -> Plan {
    let mut best: Option<(f64, Vec<Rect>, Rect)> = None;
    for _ in 0..200 {
        let per_room = rng.random_range(AREA_PER_ROOM_M2.0..AREA_PER_ROOM_M2.1);
        let aspect = rng.random_range(1.0..1.5);
        let area = per_room * rooms as f64;
        let (long, short) = ((area * aspect).sqrt(), (area / aspect).sqrt());
        let half = if rng.random::<bool>() { [0.5 * long, 0.5 * short] } else { [0.5 * short, 0.5 * long] };
        let outer = Rect::around([0.0, 0.0], half.map(|h| (20.0 * h).round() / 20.0));
        let mut cut = Vec::new();
        split(outer, rooms, rng, &mut cut);
        let shortest = cut.iter().flat_map(|r| r.size()).fold(f64::INFINITY, f64::min);
        let better = best.as_ref().is_none_or(|(known, _, _)| shortest > *known);
        if better {
            best = Some((shortest, cut, outer));
        }
        if shortest >= SHORTEST_SIDE_M {
            break;
        }
    }
    let (_, outlines, outer) = best.unwrap_or((0.0, Vec::new(), Rect::around([0.0; 2], [2.0; 2])));
    let mut rooms = name_rooms(outlines, rng);
    let doors = place_doors(&rooms, rng);
    for (index, door) in doors.iter().enumerate() {
        for room in door.rooms {
            rooms[room].doors.push(index);
        }
    }
    Plan { rooms, doors, outer }
}

fn split(area: Rect, rooms: usize, rng: &mut Draws, out: &mut Vec<Rect>) {
    if rooms <= 1 {
        out.push(area);
        return;
    }
    let first = if rooms.is_multiple_of(2) { rooms / 2 } else { rooms / 2 + usize::from(rng.random::<bool>()) };
    let along = usize::from(area.size()[1] > area.size()[0]);
    let share = first as f64 / rooms as f64 * rng.random_range(0.88..1.12);
    let at = area.min[along] + share.clamp(0.2, 0.8) * area.size()[along];
    let at = (20.0 * at).round() / 20.0;
    let (mut low, mut high) = (area, area);
    low.max[along] = at;
    high.min[along] = at;
    split(low, first, rng, out);
    split(high, rooms - first, rng, out);
}

/// The largest room is the living room, the smallest the bathroom, the rest as it falls.
fn name_rooms(outlines: Vec<Rect>, rng: &mut Draws) -> Vec<PlannedRoom> {
    let count = outlines.len();
    let mut by_area: Vec<usize> = (0..count).collect();
    by_area.sort_by(|a, b| outlines[*b].area_m2().total_cmp(&outlines[*a].area_m2()));
    let mut kinds = RoomKind::for_home(count, rng);
    // What is left of the order of areas goes to the kinds between the first and the last.
    let last = kinds.iter().position(|kind| *kind == RoomKind::Bathroom);
    if let Some(last) = last {
        let bathroom = kinds.remove(last);
        kinds.push(bathroom);
    }
    let mut named: Vec<Option<PlannedRoom>> = vec![None; count];
    let mut used: Vec<RoomKind> = Vec::new();
    for (kind, index) in kinds.into_iter().zip(by_area) {
        let earlier = used.iter().filter(|k| **k == kind).count();
        used.push(kind);
        let name = if earlier == 0 { kind.name().to_owned() } else { format!("{} {}", kind.name(), earlier + 1) };
        let outline = outlines[index];
        named[index] =
            Some(PlannedRoom { kind, name, inside: outline.grown(-HALF_WALL_M), doors: Vec::new(), outline });
    }
    named.into_iter().flatten().collect()
}

fn find_shared(rooms: &[PlannedRoom]) -> Vec<Shared> {
    let mut shared = Vec::new();
    for a in 0..rooms.len() {
        for b in 0..rooms.len() {
            for through in 0..2 {
                let (one, two, along) = (&rooms[a].outline, &rooms[b].outline, 1 - through);
                if (one.max[through] - two.min[through]).abs() > 1e-6 {
                    continue;
                }
                let (from, to) = (one.min[along].max(two.min[along]), one.max[along].min(two.max[along]));
                if to - from >= 2.0 * DOOR_MARGIN_M + 0.9 {
                    shared.push(Shared { rooms: [a, b], through, line: one.max[through], from, to });
                }
            }
        }
    }
    shared
}

/// Enough doorways to reach every room, through living rooms and hallways where that can be, and a few more.
fn place_doors(rooms: &[PlannedRoom], rng: &mut Draws) -> Vec<Door> {
    let mut shared: Vec<(f64, Shared)> = find_shared(rooms)
        .into_iter()
        .map(|s| {
            let passage = s.rooms.iter().map(|room| rooms[*room].kind.passage_cost()).sum::<f64>();
            (passage + rng.random::<f64>(), s)
        })
        .collect();
    shared.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut group: Vec<usize> = (0..rooms.len()).collect();
    let mut doors = Vec::new();
    for (cost, shared) in shared {
        let [a, b] = shared.rooms.map(|room| group[room]);
        let private = cost > 4.0;
        if a == b && (private || rng.random::<f64>() >= SECOND_WAY_SHARE) {
            continue;
        }
        group.iter_mut().filter(|g| **g == b).for_each(|g| *g = a);
        let half = draw_of(&[0.40, 0.42, 0.44, 0.45], rng);
        let at = rng.random_range(shared.from + DOOR_MARGIN_M + half..=shared.to - DOOR_MARGIN_M - half);
        let at = (100.0 * at).round() / 100.0;
        let at = if shared.through == 0 { [shared.line, at] } else { [at, shared.line] };
        doors.push(Door { at, half_width_m: half, through: shared.through, rooms: shared.rooms });
    }
    doors
}

impl Plan {
    /// Whether one can walk from every room to every other.
    pub(super) fn is_connected(&self) -> bool {
        let mut reached = vec![false; self.rooms.len()];
        let mut open = vec![0];
        while let Some(room) = open.pop() {
            if !std::mem::replace(&mut reached[room], true) {
                open.extend(self.rooms[room].doors.iter().flat_map(|door| self.doors[*door].rooms));
            }
        }
        reached.into_iter().all(|r| r)
    }

    /// Floors, walls and lintels.
    pub(super) fn build_shell(&self, rng: &mut Draws) -> Vec<(String, Geom)> {
        let mut shell = Vec::new();
        let geom = |half: [f64; 3], at_m: [f64; 3], finish| Geom {
            shape: Shape::Box(half),
            at_m,
            turn_rad: [0.0; 3],
            finish,
            visual: false,
        };
        for (index, room) in self.rooms.iter().enumerate() {
            let ([x, y], [sx, sy]) = (room.outline.center(), room.outline.size());
            let half = [0.5 * sx, 0.5 * sy, FLOOR_HALF_M];
            shell.push((format!("floor_{}", index + 1), geom(half, [x, y, -FLOOR_HALF_M], room.kind.draw_floor(rng))));
        }
        let color = draw_of(&[Color::White, Color::Beige, Color::Beige], rng);
        let paint = Finish { material: Material::Plaster, color, pattern: Pattern::Plain, shade: 3 };
        let mut walls: Vec<(usize, f64, f64, f64)> = Vec::new();
        for through in 0..2 {
            let along = 1 - through;
            let (low, high) = (self.outer.min, self.outer.max);
            // The first pair takes the corners.
            for line in [low[through], high[through]] {
                let reach = if through == 0 { HALF_WALL_M } else { -HALF_WALL_M };
                walls.push((through, line, low[along] - reach, high[along] + reach));
            }
            let mut lines: Vec<f64> = self.rooms.iter().map(|r| r.outline.max[through]).collect();
            lines.sort_by(f64::total_cmp);
            lines.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
            for line in lines.into_iter().filter(|line| *line < high[through] - 1e-6) {
                walls.extend(self.spans_on(through, line).into_iter().map(|(from, to)| {
                    // Ends meet the walls across them without reaching into them.
                    (through, line, from + HALF_WALL_M, to - HALF_WALL_M)
                }));
            }
        }
        let mut number = 0;
        for (through, line, from, to) in walls {
            let mut doors: Vec<&Door> = self
                .doors
                .iter()
                .filter(|d| d.through == through && (d.at[through] - line).abs() < 1e-6)
                .filter(|d| (from..to).contains(&d.at[1 - through]))
                .collect();
            doors.sort_by(|a, b| a.at[1 - through].total_cmp(&b.at[1 - through]));
            let mut add = |name: &str, from: f64, to: f64, low: f64, high: f64| {
                number += 1;
                let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
                let (z, half_z) = (0.5 * (low + high), 0.5 * (high - low));
                let (at, half) = if through == 0 {
                    ([line, middle, z], [HALF_WALL_M, half, half_z])
                } else {
                    ([middle, line, z], [half, HALF_WALL_M, half_z])
                };
                shell.push((format!("{name}_{number}"), geom(half, at, paint)));
            };
            let mut begin = from;
            for door in doors {
                let (left, right) =
                    (door.at[1 - through] - door.half_width_m, door.at[1 - through] + door.half_width_m);
                add("wall", begin, left, 0.0, WALL_HEIGHT_M);
                add("lintel", left, right, DOOR_HEIGHT_M, WALL_HEIGHT_M);
                begin = right;
            }
            add("wall", begin, to, 0.0, WALL_HEIGHT_M);
        }
        shell
    }

    /// The stretches of a line that separate rooms, joined where they continue each other.
    fn spans_on(&self, through: usize, line: f64) -> Vec<(f64, f64)> {
        let along = 1 - through;
        let on_line = self.rooms.iter().filter(|r| (r.outline.max[through] - line).abs() < 1e-6);
        let mut spans: Vec<(f64, f64)> = on_line.map(|r| (r.outline.min[along], r.outline.max[along])).collect();
        spans.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut joined: Vec<(f64, f64)> = Vec::new();
        for (from, to) in spans {
            match joined.last_mut() {
                Some(last) if (last.1 - from).abs() < 1e-6 => last.1 = to,
                _ => joined.push((from, to)),
            }
        }
        joined
    }
}
