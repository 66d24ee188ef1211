//! Real floor plans from a layout file (AI2-THOR as `objects` with oriented boxes) as scenes: one room, nothing movable.
//!
//! The layout has boxes and names only. Receptacles that hold things are hollowed so that what they hold can be seen;
//! colours come from the seed; floor and walls are put around everything.

use super::catalog::find_category;
use super::draft::{Body, Draft, Geom, Meaning, Rect, RoomOutline, Shape};
use super::finish::{Color, Finish, Material, Pattern};
use super::ithor_shape::build_shape;
use super::plan::{HALF_WALL_M, WALL_HEIGHT_M};
use super::walkable::Walkable;
use super::write::write_scene;
use super::{Draws, GeneratedScene, draws};
use rand::RngExt;
use serde::Deserialize;
use std::collections::BTreeMap;
use thiserror::Error;

/// Categories that are the inside of another object or a part of the shell.
const LEFT_OUT: &[&str] = &["Floor", "SinkBasin", "BathtubBasin"];
/// Smallest side of a body, metres: thinner things are made this thick.
const THINNEST_M: f64 = 0.006;
/// A box is placed by its yaw when its most vertical edge is at least this steep (cosine), else by its upright box.
const STEEP: f64 = 0.9;
/// Flat things that carry others.
const SLAB: &str = "counter top";
/// The box of a thing on a slab may begin this far below the slab, metres.
const SUNK_M: f64 = 0.015;
/// Half the width of the robot for start places, metres.
const START_RADIUS_M: f64 = 0.33;
/// Below this and above that, things do not stand in the robot's way, metres.
const IN_THE_WAY_M: (f64, f64) = (0.04, 1.35);

/// Why a layout cannot be imported.
#[derive(Debug, Error)]
pub enum ImportError {
    /// The text is not a layout.
    #[error("line {line}: {reason}")]
    Format {
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// A number of an object makes no sense.
    #[error("object `{object}`: {what} is {value}; expected {expected}")]
    BadValue {
        /// Its id.
        object: String,
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What was expected.
        expected: &'static str,
    },
    /// A layout without objects.
    #[error("the layout has no objects")]
    Empty,
}

#[derive(Deserialize)]
struct Layout {
    scene_id: String,
    objects: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    id: String,
    category: String,
    center: [f64; 3],
    size: [f64; 3],
    #[serde(default)]
    oriented_corners: Option<Vec<[f64; 3]>>,
    #[serde(default)]
    mass: f64,
    #[serde(default)]
    materials: Option<Vec<String>>,
    #[serde(default)]
    affordances: Vec<String>,
}

/// An object as an upright box with a heading. Metres.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub category: String,
    /// Middle of its underside.
    pub at: [f64; 3],
    /// Half sides in its own frame.
    pub half: [f64; 2],
    pub height_m: f64,
    pub yaw_rad: f64,
}

impl Block {
    /// Its rectangle on the floor along the axes.
    pub(super) fn footprint(&self) -> Rect {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let half = [
            (cos * self.half[0]).abs() + (sin * self.half[1]).abs(),
            (sin * self.half[0]).abs() + (cos * self.half[1]).abs(),
        ];
        Rect::around([self.at[0], self.at[1]], half)
    }

    /// A point of the world in its frame, the underside at 0.
    pub(super) fn find_local(&self, point: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let [x, y] = [point[0] - self.at[0], point[1] - self.at[1]];
        [cos * x + sin * y, cos * y - sin * x, point[2] - self.at[2]]
    }
}

/// Makes a scene from a layout's text.
///
/// # Errors
/// [`ImportError`] with the line or object that is wrong.
pub fn import_ithor(text: &str, seed: u64) -> Result<GeneratedScene, ImportError> {
    let layout: Layout = serde_json::from_str(text)
        .map_err(|error| ImportError::Format { line: error.line(), reason: error.to_string() })?;
    let entries: Vec<&Entry> =
        layout.objects.iter().filter(|entry| !LEFT_OUT.contains(&entry.category.as_str())).collect();
    if entries.is_empty() {
        return Err(ImportError::Empty);
    }
    entries.iter().try_for_each(|entry| check(entry))?;
    let mut blocks: Vec<Block> = entries.iter().map(|entry| block(entry)).collect();
    raise_onto_slabs(&mut blocks);
    let room = find_room(&blocks);
    let mut rng = draws(seed, 0);
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let bodies: Vec<Body> = (0..blocks.len())
        .map(|index| {
            let category = blocks[index].category.clone();
            let count = counts.entry(category.clone()).or_default();
            *count += 1;
            let name = format!("{}_{count}", category.replace(' ', "_"));
            let meaning = meaning(entries[index], &category, &mut rng);
            let (shape_from, geoms) = build_shape(index, &blocks, &room, meaning.finish, &mut rng);
            Body {
                name,
                at_m: shape_from.at,
                yaw_rad: shape_from.yaw_rad,
                free: false,
                geoms,
                parts: Vec::new(),
                meaning,
            }
        })
        .collect();
    let name = layout.scene_id.replace(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '-', "_");
    Ok(write_scene(&Draft {
        origin: format!("Imported: floor plan {name}, colours by seed {seed}"),
        rooms: vec![RoomOutline { name: name_room(&blocks).to_owned(), outline: room }],
        starts: find_starts(&room, &blocks),
        shell: build_shell(&room, &mut rng),
        name,
        bodies,
    }))
}

fn check(entry: &Entry) -> Result<(), ImportError> {
    let bad = |what, value, expected| ImportError::BadValue { object: entry.id.clone(), what, value, expected };
    for value in entry.center {
        if !value.is_finite() || value.abs() > 100.0 {
            return Err(bad("center", value, "-100 to 100 m"));
        }
    }
    for value in entry.size {
        if !(0.0..=50.0).contains(&value) {
            return Err(bad("size", value, "0 to 50 m"));
        }
    }
    if !(0.0..=5000.0).contains(&entry.mass) {
        return Err(bad("mass", entry.mass, "0 to 5000 kg"));
    }
    Ok(())
}

/// The category in words: `GarbageCan` becomes `garbage can`.
fn words(category: &str) -> String {
    let mut text = String::new();
    let mut before = ' ';
    for c in category.chars() {
        if c.is_uppercase() && before.is_lowercase() {
            text.push(' ');
        }
        text.extend(c.to_lowercase());
        before = c;
    }
    text
}

/// An upright box with a heading from oriented corners where there are some that stand upright.
fn block(entry: &Entry) -> Block {
    let low_m = (entry.center[2] - 0.5 * entry.size[2]).max(0.0);
    let height_m = (entry.center[2] + 0.5 * entry.size[2] - low_m).max(THINNEST_M);
    let upright = |half: [f64; 2], yaw_rad: f64| Block {
        category: words(&entry.category),
        at: [entry.center[0], entry.center[1], low_m],
        half: half.map(|h| h.max(0.5 * THINNEST_M)),
        height_m,
        yaw_rad,
    };
    let oriented = entry.oriented_corners.as_ref().filter(|corners| corners.len() == 8).and_then(|corners| {
        // Three edges meet at the first corner.
        let edge = |to: usize| [0, 1, 2].map(|i| corners[to][i] - corners[0][i]);
        let edges = [edge(1), edge(3), edge(4)];
        let length = |e: &[f64; 3]| e.iter().map(|v| v * v).sum::<f64>().sqrt();
        let steep = |e: &[f64; 3]| e[2].abs() / length(e).max(1e-9);
        let vertical = (0..3).max_by(|a, b| steep(&edges[*a]).total_cmp(&steep(&edges[*b])))?;
        let mut flat: Vec<&[f64; 3]> = (0..3).filter(|i| *i != vertical).map(|i| &edges[i]).collect();
        flat.sort_by(|a, b| length(b).total_cmp(&length(a)));
        let upright_enough = steep(&edges[vertical]) >= STEEP;
        upright_enough.then(|| ([0.5 * length(flat[0]), 0.5 * length(flat[1])], flat[0][1].atan2(flat[0][0])))
    });
    match oriented {
        Some((half, yaw_rad)) => upright(half, yaw_rad),
        None => upright([0.5 * entry.size[0], 0.5 * entry.size[1]], 0.0),
    }
}

/// Boxes of a layout reach into the slab that carries them; here they stand on it.
fn raise_onto_slabs(blocks: &mut [Block]) {
    let slabs: Vec<Block> = blocks.iter().filter(|block| block.category == SLAB).cloned().collect();
    for block in blocks.iter_mut().filter(|block| block.category != SLAB) {
        for slab in &slabs {
            let top_m = slab.at[2] + slab.height_m;
            let local = slab.find_local(block.at);
            let over = (0..2).all(|i| local[i].abs() < slab.half[i]);
            let sunk = block.at[2] > slab.at[2] - SUNK_M && block.at[2] < top_m;
            if over && sunk && block.at[2] + block.height_m > top_m + THINNEST_M {
                block.height_m -= top_m - block.at[2];
                block.at[2] = top_m;
            }
        }
    }
}

/// The rectangle around everything that stands lower than the walls, at least 2 m wide.
fn find_room(blocks: &[Block]) -> Rect {
    let mut room = Rect { min: [f64::INFINITY; 2], max: [f64::NEG_INFINITY; 2] };
    for rect in blocks.iter().map(Block::footprint) {
        room.min = [0, 1].map(|i| room.min[i].min(rect.min[i]));
        room.max = [0, 1].map(|i| room.max[i].max(rect.max[i]));
    }
    let grow = [0, 1].map(|i| (0.5 * (2.0 - room.size()[i])).max(0.01));
    Rect { min: [room.min[0] - grow[0], room.min[1] - grow[1]], max: [room.max[0] + grow[0], room.max[1] + grow[1]] }
}

fn name_room(blocks: &[Block]) -> &'static str {
    let has = |name: &str| blocks.iter().any(|block| block.category == name);
    match () {
        () if has("fridge") || has("stove burner") => "kitchen",
        () if has("bed") => "bedroom",
        () if has("toilet") || has("bathtub") || has("shower door") => "bathroom",
        () => "living room",
    }
}

fn find_starts(room: &Rect, blocks: &[Block]) -> Vec<([f64; 2], f64)> {
    let in_the_way = |block: &&Block| block.at[2] < IN_THE_WAY_M.1 && block.at[2] + block.height_m > IN_THE_WAY_M.0;
    let obstacles: Vec<Rect> = blocks.iter().filter(in_the_way).map(Block::footprint).collect();
    let widest = Walkable::all_free(room, &obstacles, START_RADIUS_M).find_widest(room, &obstacles);
    widest.map(|(at, clear_m)| (at, ((clear_m - 0.36) / 1.5).clamp(0.0, 0.5))).into_iter().collect()
}

fn build_shell(room: &Rect, rng: &mut Draws) -> Vec<(String, Geom)> {
    let geom = |half: [f64; 3], at_m: [f64; 3], finish| Geom {
        shape: Shape::Box(half),
        at_m,
        turn_rad: [0.0; 3],
        finish,
        visual: false,
    };
    let ([x, y], [sx, sy]) = (room.center(), room.size());
    let floor = Finish { pattern: Pattern::Planks, ..Finish::draw(Material::Wood, &[Color::Brown, Color::Beige], rng) };
    let paint = Finish { shade: 3, ..Finish::draw(Material::Plaster, &[], rng) };
    let (half_x, half_y, half_z) = (0.5 * sx, 0.5 * sy, 0.5 * WALL_HEIGHT_M);
    let across = [HALF_WALL_M, half_y, half_z];
    let along = [half_x + 2.0 * HALF_WALL_M, HALF_WALL_M, half_z];
    vec![
        ("floor".to_owned(), geom([half_x + 0.1, half_y + 0.1, 0.05], [x, y, -0.05], floor)),
        ("wall_west".to_owned(), geom(across, [room.min[0] - HALF_WALL_M, y, half_z], paint)),
        ("wall_east".to_owned(), geom(across, [room.max[0] + HALF_WALL_M, y, half_z], paint)),
        ("wall_south".to_owned(), geom(along, [x, room.min[1] - HALF_WALL_M, half_z], paint)),
        ("wall_north".to_owned(), geom(along, [x, room.max[1] + HALF_WALL_M, half_z], paint)),
    ]
}

/// What the layout says about an object; its colour, and what it does not say, by the seed.
fn meaning(entry: &Entry, category: &str, rng: &mut Draws) -> Meaning {
    let told = entry.materials.iter().flatten().find_map(|name| material(name));
    let row = find_category(category);
    let guessed = || guess_material(category);
    let drawn = row.map(|row| row.draw(rng));
    let mut finish = match (told, &drawn) {
        (Some(material), _) => Finish::draw(material, colors(category), rng),
        (None, Some(make)) if !make.unusual => make.finish,
        _ => Finish::draw(guessed(), colors(category), rng),
    };
    if rng.random::<f64>() < 0.1 {
        finish = finish.printed(rng);
    }
    let affordance = |name: &String| {
        Some(match name.as_str() {
            "pickupable" => "pick up",
            "openable" => "open",
            "receptacle" => "contain",
            "canFillWithLiquid" => "fill",
            "toggleable" => "turn on",
            "sliceable" => "cut",
            "cookable" => "cook",
            "moveable" => "move",
            _ => return None,
        })
    };
    Meaning {
        category: category.to_owned(),
        finish,
        material_known: told.is_some(),
        mass_kg: Some(entry.mass).filter(|mass| *mass > 0.0),
        affordances: entry.affordances.iter().filter_map(affordance).map(str::to_owned).collect(),
        moves: None,
        unusual: false,
    }
}

fn material(name: &str) -> Option<Material> {
    Some(match name {
        "Wood" => Material::Wood,
        "Metal" => Material::Metal,
        "Plastic" => Material::Plastic,
        "Glass" => Material::Glass,
        "Ceramic" => Material::Ceramic,
        "Fabric" => Material::Fabric,
        "Leather" => Material::Leather,
        "Paper" => Material::Paper,
        "Stone" => Material::Stone,
        "Rubber" => Material::Rubber,
        "Sponge" => Material::Foam,
        "Wax" | "Soap" => Material::Wax,
        "Food" | "Organic" => Material::Organic,
        _ => return None,
    })
}

fn guess_material(category: &str) -> Material {
    match category {
        "cabinet" | "drawer" | "shelf" | "shelving unit" | "dresser" | "desk" => Material::Wood,
        "counter top" => Material::Stone,
        "toilet" | "sink" | "bathtub" => Material::Ceramic,
        "window" | "mirror" | "shower door" | "shower glass" => Material::Glass,
        "blinds" | "curtains" | "shower curtain" | "sofa" => Material::Fabric,
        "fridge" | "faucet" | "stove burner" | "stove knob" | "towel holder" | "shower head" => Material::Metal,
        _ => Material::Plastic,
    }
}

/// The colours of things that come in few; empty for the rest.
fn colors(category: &str) -> &'static [Color] {
    match category {
        "apple" => &[Color::Red, Color::Green],
        "tomato" => &[Color::Red],
        "lettuce" | "house plant" => &[Color::Green],
        "potato" | "bread" => &[Color::Brown, Color::Beige],
        "egg" | "toilet paper" | "paper towel roll" | "toilet" | "bathtub" => &[Color::White],
        "window" | "mirror" | "shower glass" | "shower door" => &[Color::Cyan],
        "stove burner" | "television" => &[Color::Black],
        _ => find_category(category).map_or(&[], |row| row.colors),
    }
}
