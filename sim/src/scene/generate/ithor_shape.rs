//! From a layout's boxes to shapes: tables get legs, receptacles are hollow where they hold things, round things are round.

use super::Draws;
use super::draft::{Geoms, Rect, Shape};
use super::finish::{Color, Finish, Material};
use super::ithor::Block;
use rand::RngExt;
use std::f64::consts::{FRAC_PI_2, PI};

/// Thickness of panels and boards, metres.
const BOARD_M: f64 = 0.018;
/// A thing lies in a receptacle when its middle does, with this to spare, metres.
const INSIDE_M: f64 = 0.01;
/// Undersides of things this close stand on one board, metres.
const SAME_BOARD_M: f64 = 0.06;

const TABLES: &[&str] = &["dining table", "coffee table", "side table", "desk", "table", "stool", "chair", "ottoman"];
const SEATS: &[&str] = &["sofa", "arm chair", "bed"];
const OPEN_TOPS: &[&str] = &["sink", "bathtub", "garbage can", "box", "laundry hamper", "basket", "dog bed"];
const VOLUMES: &[&str] = &["shelf"];
const ROUND: &[&str] = &[
    "bowl",
    "mug",
    "cup",
    "bottle",
    "wine bottle",
    "vase",
    "pot",
    "plate",
    "toilet paper",
    "paper towel roll",
    "candle",
    "salt shaker",
    "pepper shaker",
    "soap bottle",
    "spray bottle",
    "stove burner",
    "plunger",
    "scrub brush",
    "statue",
    "kettle",
    "watering can",
    "stove knob",
];
const BALLS: &[&str] = &["apple", "tomato", "potato", "egg", "lettuce", "basket ball", "teddy bear", "bread"];

/// The pose that the shape is given in (as the block's, or turned so that its front is -y) and the shape.
pub(super) fn build_shape(
    index: usize,
    blocks: &[Block],
    room: &Rect,
    finish: Finish,
    rng: &mut Draws,
) -> (Block, Geoms) {
    let own = face_room(&blocks[index], room);
    let mut geoms = Geoms::default();
    let is = |list: &[&str]| list.contains(&own.category.as_str());
    let held = find_held(index, blocks, &own);
    let ([hx, hy], height) = (own.half, own.height_m);
    if is(VOLUMES) {
        // The box is the room above the board.
        geoms.cuboid([0.0, 0.0, 0.5 * BOARD_M], [hx, hy, 0.5 * BOARD_M], finish);
    } else if own.category == "shelving unit" {
        carcass(&mut geoms, &own, &[], finish);
    } else if is(OPEN_TOPS) {
        open_top(&mut geoms, &own, finish);
    } else if is(SEATS) {
        seat(&mut geoms, &own, &held, finish);
    } else if is(TABLES) {
        let boards: Vec<f64> = held.iter().map(|low| low - 0.001).collect();
        table(&mut geoms, &own, &boards, finish);
    } else if own.category == "house plant" {
        plant(&mut geoms, &own, finish, rng);
    } else if is(BALLS) {
        geoms.add(Shape::Ellipsoid([hx, hy, 0.5 * height]), [0.0, 0.0, 0.5 * height], finish);
    } else if is(ROUND) {
        geoms.cylinder([0.0, 0.0, 0.5 * height], hx.min(hy), 0.5 * height, finish);
    } else if held.is_empty() {
        geoms.cuboid([0.0, 0.0, 0.5 * height], [hx, hy, 0.5 * height], finish);
    } else {
        carcass(&mut geoms, &own, &held, finish);
    }
    (own, geoms)
}

/// The block seen with the front that points most to the middle of the room; what stands clear of the walls included.
fn face_room(block: &Block, room: &Rect) -> Block {
    let center = room.center();
    let to_walls = |yaw: f64| {
        // A back close to a wall is a back.
        let back = [-yaw.sin(), yaw.cos()];
        let gap = |axis: usize| {
            let reach =
                if back[axis] >= 0.0 { room.max[axis] - block.at[axis] } else { block.at[axis] - room.min[axis] };
            reach / back[axis].abs().max(1e-3)
        };
        gap(0).min(gap(1))
    };
    let toward = |yaw: f64| {
        let front = [yaw.sin(), -yaw.cos()];
        front[0] * (center[0] - block.at[0]) + front[1] * (center[1] - block.at[1])
    };
    // Cupboards are wider than deep more often than not; equal scores fall to the block's own heading.
    let score = |turn: usize| {
        let yaw = block.yaw_rad + FRAC_PI_2 * turn as f64;
        toward(yaw) - to_walls(yaw)
    };
    let turn = (0..4).fold(0, |best, turn| if score(turn) > score(best) + 1e-9 { turn } else { best });
    let half = if turn % 2 == 0 { block.half } else { [block.half[1], block.half[0]] };
    let yaw_rad = block.yaw_rad + FRAC_PI_2 * turn as f64;
    let yaw_rad = if yaw_rad > PI { yaw_rad - 2.0 * PI } else { yaw_rad };
    Block { half, yaw_rad, ..block.clone() }
}

/// Heights above its underside at which things stand in it: each board once, from below.
fn find_held(index: usize, blocks: &[Block], own: &Block) -> Vec<f64> {
    let mut lows: Vec<f64> = Vec::new();
    for (other, block) in blocks.iter().enumerate() {
        let middle = [block.at[0], block.at[1], block.at[2] + 0.5 * block.height_m];
        let local = own.find_local(middle);
        let within = (0..2).all(|i| local[i].abs() < own.half[i] - INSIDE_M);
        let smaller = block.half[0] * block.half[1] < 0.8 * own.half[0] * own.half[1];
        if other != index && within && smaller && local[2] > INSIDE_M && local[2] < own.height_m - INSIDE_M {
            lows.push((block.at[2] - own.at[2]).max(0.0));
        }
    }
    lows.sort_by(f64::total_cmp);
    lows.dedup_by(|a, b| *a - *b < SAME_BOARD_M);
    lows
}

/// Sides, back, bottom, top and a board under each height, open at the front.
fn carcass(geoms: &mut Geoms, own: &Block, boards: &[f64], finish: Finish) {
    let ([hx, hy], height, t) = (own.half, own.height_m, 0.5 * BOARD_M.min(own.height_m / 4.0).min(own.half[0]));
    for side in [-1.0, 1.0] {
        geoms.cuboid([side * (hx - t), 0.0, 0.5 * height], [t, hy, 0.5 * height], finish);
    }
    geoms.cuboid([0.0, hy - t, 0.5 * height], [hx - 2.0 * t, t, 0.5 * height], finish);
    let mut levels = vec![t, height - t];
    levels.extend(boards.iter().map(|low| low - t).filter(|z| (4.0 * t..height - 4.0 * t).contains(z)));
    for z in levels {
        geoms.cuboid([0.0, -t, z], [hx - 2.0 * t, hy - t, t], finish);
    }
}

fn open_top(geoms: &mut Geoms, own: &Block, finish: Finish) {
    let ([hx, hy], height) = (own.half, own.height_m);
    let t = (0.08 * hx.min(hy)).clamp(0.003, 0.02).min(0.4 * height);
    geoms.cuboid([0.0, 0.0, t], [hx, hy, t], finish);
    let wall = 0.5 * (height - 2.0 * t);
    for side in [-1.0, 1.0] {
        geoms.cuboid([side * (hx - t), 0.0, 2.0 * t + wall], [t, hy, wall], finish);
        geoms.cuboid([0.0, side * (hy - t), 2.0 * t + wall], [hx - 2.0 * t, t, wall], finish);
    }
}

/// A block up to where things lie on it, and a back.
fn seat(geoms: &mut Geoms, own: &Block, held: &[f64], finish: Finish) {
    let ([hx, hy], height) = (own.half, own.height_m);
    let level = held.first().copied().unwrap_or(0.5 * height).clamp(0.3 * height, 0.9 * height);
    geoms.cuboid([0.0, 0.0, 0.5 * level], [hx, hy, 0.5 * level], finish);
    let back = (0.12 * hy).max(0.02);
    geoms.cuboid([0.0, hy - back, 0.5 * (level + height)], [hx, back, 0.5 * (height - level)], finish);
}

/// A top on legs at the height where things stand; what rises above it is a back.
fn table(geoms: &mut Geoms, own: &Block, boards: &[f64], finish: Finish) {
    let ([hx, hy], height) = (own.half, own.height_m);
    let lowest = 0.35 * height;
    let fallback = if own.category == "chair" { 0.45 * height } else { height };
    let top = boards.iter().copied().find(|z| *z >= lowest).unwrap_or(fallback).min(height);
    let t = 0.0125_f64.min(0.2 * top);
    geoms.cuboid([0.0, 0.0, top - t], [hx, hy, t], finish);
    let leg = 0.02_f64.min(0.2 * hx).min(0.2 * hy);
    geoms.legs([hx, hy], leg, top - 2.0 * t, finish);
    if height - top > 0.1 {
        geoms.cuboid([0.0, hy - 0.01, 0.5 * (top + height)], [hx, 0.01, 0.5 * (height - top)], finish);
        for level in boards.iter().copied().filter(|z| *z > top + 0.1) {
            geoms.cuboid([0.0, 0.6 * hy, level - t], [hx, 0.4 * hy - 0.02, t], finish);
        }
    }
}

fn plant(geoms: &mut Geoms, own: &Block, finish: Finish, rng: &mut Draws) {
    let (r, height) = (own.half[0].min(own.half[1]), own.height_m);
    let pot = Finish::plain(Material::Ceramic, [Color::Brown, Color::White, Color::Gray][rng.random_range(0..3)]);
    let leaves = Finish { color: Color::Green, material: Material::Organic, ..finish };
    geoms.cylinder([0.0, 0.0, 0.2 * height], 0.55 * r, 0.2 * height, pot);
    geoms.add(Shape::Ellipsoid([own.half[0], own.half[1], 0.32 * height]), [0.0, 0.0, 0.68 * height], leaves);
}
