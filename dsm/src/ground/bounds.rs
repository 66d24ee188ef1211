//! Walls, floors and ceilings as anchors.

use super::filter::Context;
use super::query::{Entity, Noun, RelationTerm, RelationWord};
use super::scene::Item;

/// Distance over which "at the wall" falls to 1/e, metres.
const WALL_M: f64 = 0.5;
/// Categories that bound the map without being objects of it.
const BOUNDS: [&str; 3] = ["wall", "floor", "ceiling"];

/// Walls, floors and ceilings bound the map but are no objects of it.
pub(super) fn is_structure(context: Context<'_, '_>, entity: &Entity) -> bool {
    let bounds = |name: &str| context.knowledge.find(name).is_some_and(|c| BOUNDS.contains(&c.name.as_str()));
    matches!(&entity.noun, Noun::Thing(name) if bounds(name))
}

/// "on the floor" asks for a low lower end (world z = 0 is the floor); walls and ceilings are judged only where the thing
/// that is meant is known to be there: by the sides and the top of all that is known.
pub(super) fn structure_scores(context: Context<'_, '_>, term: &RelationTerm) -> Vec<f32> {
    let bound = |name: &str| context.knowledge.find(name).map_or("", |category| category.name.as_str());
    let bound = match &term.anchors[0].noun {
        Noun::Thing(name) => bound(name),
        _ => "",
    };
    let close = matches!(
        term.word,
        RelationWord::On | RelationWord::Near | RelationWord::Against | RelationWord::NextTo | RelationWord::In
    );
    let extent = context.scene.extent;
    let wall_gap_m = |item: &Item<'_>| {
        let (low, high) = (item.bounds.min - extent.min, extent.max - item.bounds.max);
        low.x.min(low.y).min(high.x).min(high.y).max(0.0)
    };
    let score = |item: &Item<'_>| match bound {
        "floor" if close => {
            let gap_m = (item.bounds.min.z - 0.12).max(0.0);
            (1.0 - gap_m / 0.2).clamp(0.0, 1.0) as f32
        }
        "wall" if close && context.config.presume_present => (-wall_gap_m(item) / WALL_M).exp() as f32,
        "ceiling" if close && context.config.presume_present => {
            (-(extent.max.z - item.bounds.max.z).max(0.0) / WALL_M).exp() as f32
        }
        _ if term.negated => 0.3,
        _ => 0.7,
    };
    context.scene.items.iter().map(score).collect()
}
