//! A home from a seed.

use super::articulate::articulate;
use super::catalog::find_category;
use super::clutter::lay_things;
use super::doors::hang_doors;
use super::draft::{Body, Draft, Meaning, Moves, RoomOutline};
use super::furnish::{Item, Placed, find_starts, furnish};
use super::plan::{Plan, plan_home};
use super::write::write_scene;
use super::{GenerateError, GeneratedScene, draws};
use std::collections::BTreeMap;

/// Rooms that a home may have.
const ROOMS: (u32, u32) = (1, 12);
/// Objects that a home may have.
const OBJECTS: (u32, u32) = (10, 600);
/// Share of the objects that is furniture at most, unless rooms need more to be what they are.
const FURNITURE_SHARE: f64 = 0.5;
/// Floor plans that are tried for a home.
const PLANS: u64 = 8;

/// How doors and drawers are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Furniture {
    /// For the eye: blocks as handles, loose joints, nothing inside. The default.
    #[default]
    Plain,
    /// To be opened: bar handles, weight and friction as in real furniture, things in some drawers. All else is the same.
    Articulated,
}

/// What is in the doorways of a home.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Doorways {
    /// Nothing. The default.
    #[default]
    Open,
    /// Doors where a bedroom, bathroom, office or the like begins, closed. All else is the same.
    Doors,
}

/// What to generate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HomeConfig {
    /// Seed of all draws.
    pub seed: u64,
    /// Rooms, 1 to 12.
    pub rooms: u32,
    /// Objects, 10 to 600: furniture and things together.
    pub objects: u32,
    /// How doors and drawers are made.
    pub furniture: Furniture,
    /// What is in its doorways.
    pub doorways: Doorways,
}

/// Makes a home.
///
/// # Errors
/// [`GenerateError`] when a number is out of range or the rooms cannot hold the objects.
pub fn generate_home(config: &HomeConfig) -> Result<GeneratedScene, GenerateError> {
    for (name, value, (low, high)) in [("rooms", config.rooms, ROOMS), ("objects", config.objects, OBJECTS)] {
        if !(low..=high).contains(&value) {
            return Err(GenerateError::OutOfRange { name, value, low, high });
        }
    }
    let wanted = config.objects as usize;
    let mut most = 0;
    for attempt in 0..PLANS {
        let mut rng = draws(config.seed, attempt);
        let plan = plan_home(config.rooms as usize, &mut rng);
        if !plan.is_connected() {
            continue;
        }
        let mut placed = furnish(&plan, (FURNITURE_SHARE * wanted as f64) as usize, &mut rng);
        let left = wanted.saturating_sub(placed.len());
        lay_things(&plan, &mut placed, left, &mut rng);
        most = most.max(placed.len());
        if placed.len() >= wanted {
            let shell = plan.build_shell(&mut rng);
            let doors = match config.doorways {
                Doorways::Open => Vec::new(),
                Doorways::Doors => hang_doors(&plan, &placed, config.seed),
            };
            let mut draft = draft(config, &plan, shell, placed);
            if config.furniture == Furniture::Articulated {
                let mut kinds: Vec<_> = plan.rooms.iter().flat_map(|room| room.kind.usual_things()).copied().collect();
                kinds.sort_unstable();
                kinds.dedup();
                articulate(&mut draft, config.seed, &kinds);
            }
            draft.bodies.extend(doors);
            return Ok(write_scene(&draft));
        }
    }
    Err(GenerateError::Full { rooms: config.rooms as usize, objects: most, seed: config.seed })
}

fn draft(config: &HomeConfig, plan: &Plan, shell: Vec<(String, super::draft::Geom)>, placed: Vec<Placed>) -> Draft {
    let starts = find_starts(plan, &placed);
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut bodies = Vec::new();
    for thing in placed {
        let count = counts.entry(thing.category).or_default();
        *count += 1;
        bodies.push(body(thing, *count));
    }
    let room = |room: &super::plan::PlannedRoom| RoomOutline { name: room.name.clone(), outline: room.inside };
    Draft {
        name: format!("home_{}", config.seed),
        origin: format!(
            "Generated: dsm scene generate --seed {} --rooms {} --objects {}{}{}",
            config.seed,
            config.rooms,
            config.objects,
            if config.furniture == Furniture::Articulated { " --articulated" } else { "" },
            if config.doorways == Doorways::Doors { " --doors" } else { "" }
        ),
        shell,
        bodies,
        rooms: plan.rooms.iter().map(room).collect(),
        starts,
    }
}

fn body(thing: Placed, number: usize) -> Body {
    let moves = match (&thing.item, thing.category) {
        (Item::Piece(_), "chair" | "stool") => Some(Moves { x_m: 0.02, y_m: 0.02, yaw_rad: 0.1 }),
        (Item::Thing(kind), _) if thing.free => {
            let yaw_rad = if kind.any_heading { std::f64::consts::PI } else { 0.2 };
            Some(Moves { x_m: 0.03, y_m: 0.03, yaw_rad })
        }
        _ => None,
    };
    let affordances = find_category(thing.category).map_or(&[][..], |category| category.affordances);
    let (geoms, parts) = match thing.item {
        Item::Piece(piece) => (piece.geoms, piece.parts),
        Item::Thing(thing) => (thing.geoms, Vec::new()),
    };
    Body {
        name: format!("{}_{number}", thing.category.replace(' ', "_")),
        at_m: [thing.at[0], thing.at[1], thing.base_m],
        yaw_rad: thing.yaw_rad,
        free: thing.free,
        geoms,
        parts,
        meaning: Meaning {
            category: thing.category.to_owned(),
            finish: thing.make.finish,
            material_known: true,
            mass_kg: Some(thing.make.mass_kg),
            affordances: affordances.iter().map(|a| (*a).to_owned()).collect(),
            moves,
            unusual: thing.make.unusual,
        },
    }
}
