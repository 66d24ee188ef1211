//! Floor, ceiling and walls of one image: what carries and encloses things.

use super::surface::{Surface, noise_m};
use nalgebra::{Point2, Vector2};

/// Height up to which a point is floor, metres, and what it grows by per metre of distance (the camera's attitude errs).
const FLOOR_M: (f32, f32) = (0.03, 0.012);
/// Height from which a point is ceiling, metres.
const CEILING_M: f32 = 2.25;
/// Directions in which walls are looked for, over half a turn.
const TURNS: usize = 36;
/// Width of a wall in the search, metres.
const BIN_M: f32 = 0.06;
/// Every n-th pixel in both directions is looked at.
const STRIDE: usize = 3;
/// Largest slope of a wall's normal.
const UPRIGHT: f32 = 0.25;
/// Cosine between the normals of a wall and of its points.
const PARALLEL: f32 = 0.9;
/// Fewest points of a wall, as a share of the points looked at.
const LEAST_SHARE: f32 = 0.02;
/// Share of the points beside a wall's normal that may lie behind it: windows and doors let look through.
const BEHIND_SHARE: f32 = 0.03;
/// Length of a wall, metres, or height up to which it is seen.
const LEAST_LENGTH_M: f32 = 1.0;
const LEAST_TOP_M: f32 = 1.5;
/// Most walls.
const MOST_WALLS: usize = 6;

/// A plane that stands upright: normal towards the room, and offset along it.
#[derive(Clone, Copy, Debug)]
struct Wall {
    normal: Vector2<f32>,
    offset_m: f32,
}

/// A point of an upright surface.
struct Upright {
    place: Point2<f32>,
    normal: Vector2<f32>,
    height_m: f32,
    depth_m: f32,
}

/// Pixels of floor, ceiling and walls.
pub(super) fn find_structure(surface: &Surface) -> Vec<bool> {
    let level: Vec<bool> = (0..surface.points.len())
        .map(|i| {
            let height = surface.points[i].z;
            let floor = FLOOR_M.0 + FLOOR_M.1 * surface.depth_m[i];
            surface.is_measured(i) && (height < floor || height > CEILING_M)
        })
        .collect();
    let walls = find_walls(surface, &level);
    let on_wall = |i: usize| {
        let (point, normal) = (surface.points[i].xy(), surface.normals[i]);
        let reach = 0.02 + 2.0 * noise_m(surface.depth_m[i]);
        surface.is_measured(i)
            && walls.iter().any(|wall| {
                (wall.normal.dot(&point.coords) - wall.offset_m).abs() < reach
                    && (normal == nalgebra::Vector3::zeros() || normal.xy().dot(&wall.normal) > 0.7)
            })
    };
    (0..surface.points.len()).map(|i| level[i] || on_wall(i)).collect()
}

/// Upright planes behind which nothing is seen, the largest first.
fn find_walls(surface: &Surface, level: &[bool]) -> Vec<Wall> {
    let mut upright = Vec::new();
    let mut seen = 0;
    for row in (0..surface.rows).step_by(STRIDE) {
        for column in (0..surface.columns).step_by(STRIDE) {
            let i = row * surface.columns + column;
            if !surface.is_measured(i) || level[i] {
                continue;
            }
            seen += 1;
            let normal = surface.normals[i];
            if normal != nalgebra::Vector3::zeros() && normal.z.abs() < UPRIGHT {
                let (place, depth_m) = (surface.points[i].xy(), surface.depth_m[i]);
                upright.push(Upright { place, normal: normal.xy(), height_m: surface.points[i].z, depth_m });
            }
        }
    }
    let least = (LEAST_SHARE * seen as f32).max(40.0) as usize;
    let mut walls = Vec::new();
    while walls.len() < MOST_WALLS && upright.len() >= least {
        let Some((wall, count)) = find_fullest(&upright, &surface.eye.xy()) else { break };
        if count < least {
            break;
        }
        let on = |point: &Upright| {
            (wall.normal.dot(&point.place.coords) - wall.offset_m).abs() < 0.5 * BIN_M + noise_m(point.depth_m)
                && point.normal.dot(&wall.normal) > PARALLEL
        };
        if encloses(&wall, &upright, &on) {
            walls.push(wall);
        }
        let before = upright.len();
        upright.retain(|point| !on(point));
        // Too few belong to the plane that they agreed on: there is none to be found.
        if before - upright.len() < least / 2 {
            break;
        }
    }
    walls
}

/// The plane with most points: a vote over directions and offsets, then the mean of those that voted for it.
fn find_fullest(upright: &[Upright], eye: &Point2<f32>) -> Option<(Wall, usize)> {
    let reach = upright.iter().map(|p| (p.place - eye).norm()).fold(0.0, f32::max);
    let bins = 2 * ((reach / BIN_M) as usize + 2);
    let mut votes = vec![0u32; TURNS * bins];
    let key = |turn: usize, point: &Upright| {
        let (sin, cos) = (turn as f32 / TURNS as f32 * std::f32::consts::PI).sin_cos();
        let along = Vector2::new(cos, sin).dot(&(point.place - eye)) / BIN_M;
        turn * bins + (along + 0.5 * bins as f32) as usize
    };
    for point in upright {
        // The turn of its own normal, and the two beside it.
        let own = (point.normal.y.atan2(point.normal.x) / std::f32::consts::PI * TURNS as f32).round() as isize;
        for turn in own - 1..=own + 1 {
            votes[key(turn.rem_euclid(TURNS as isize) as usize, point)] += 1;
        }
    }
    let fullest = (0..votes.len()).fold(0, |best, i| if votes[i] > votes[best] { i } else { best });
    let turn = fullest / bins;
    let (sin, cos) = (turn as f32 / TURNS as f32 * std::f32::consts::PI).sin_cos();
    let rough = Vector2::new(cos, sin);
    let members = || upright.iter().filter(|p| key(turn, p) == fullest && p.normal.dot(&rough).abs() > PARALLEL);
    let count = members().count();
    if count == 0 {
        return None;
    }
    let facing = |p: &Upright| if p.normal.dot(&rough) < 0.0 { -p.normal } else { p.normal };
    let normal = members().map(facing).sum::<Vector2<f32>>().try_normalize(1e-6)?;
    let offset_m = members().map(|p| normal.dot(&p.place.coords)).sum::<f32>() / count as f32;
    // Towards the viewer.
    let sign = if normal.dot(&eye.coords) < offset_m { -1.0 } else { 1.0 };
    Some((Wall { normal: normal * sign, offset_m: offset_m * sign }, votes[fullest] as usize))
}

/// Whether a plane is large and nothing stands behind it.
fn encloses(wall: &Wall, upright: &[Upright], on: &impl Fn(&Upright) -> bool) -> bool {
    let along = Vector2::new(-wall.normal.y, wall.normal.x);
    let (mut low, mut high, mut top, mut count) = (f32::INFINITY, f32::NEG_INFINITY, 0.0f32, 0usize);
    for point in upright.iter().filter(|p| on(p)) {
        let at = along.dot(&point.place.coords);
        (low, high, top, count) = (low.min(at), high.max(at), top.max(point.height_m), count + 1);
    }
    if high - low < LEAST_LENGTH_M && top < LEAST_TOP_M {
        return false;
    }
    let behind = upright.iter().filter(|p| {
        let depth = wall.offset_m - wall.normal.dot(&p.place.coords);
        depth > 0.12 + 3.0 * noise_m(p.depth_m) && (low..high).contains(&along.dot(&p.place.coords))
    });
    behind.count() as f32 <= BEHIND_SHARE * count as f32 + 2.0
}
