//! Which kind of evidence a constraint of a query is.

use super::query::{AttributeWord, Order, RelationTerm, RelationWord};
use super::referring::Kind;
use super::scene::Scene;

/// The kind of an attribute.
pub(super) fn kind_of_attribute(word: AttributeWord, negated: bool) -> Kind {
    match word {
        _ if negated => Kind::Negated,
        AttributeWord::Color => Kind::Color,
        AttributeWord::Material => Kind::Material,
        AttributeWord::Size => Kind::Size,
        AttributeWord::Shape => Kind::Shape,
        AttributeWord::Pattern => Kind::Pattern,
        AttributeWord::Weight => Kind::Weight,
        AttributeWord::Purpose => Kind::Purpose,
    }
}

/// The kind of an order.
pub(super) fn kind_of_order(scene: &Scene<'_>, order: Order) -> Kind {
    match order {
        Order::Nearest => Kind::Nearest,
        Order::Farthest => Kind::Farther,
        Order::Largest | Order::Smallest => Kind::Extreme,
        Order::Tallest | Order::Shortest | Order::Longest => Kind::Length,
        Order::Highest | Order::Lowest => Kind::Height,
        Order::Leftmost | Order::Rightmost if scene.is_told() => Kind::RowTold,
        Order::Leftmost | Order::Rightmost => Kind::RowCenter,
        Order::Middle => Kind::Middle,
        Order::Central => Kind::Central,
        Order::Corner => Kind::Corner,
    }
}

/// The kind of a relation; `anchor` is the likeliest anchor.
pub(super) fn kind_of_relation(scene: &Scene<'_>, term: &RelationTerm, anchor: Option<usize>) -> Kind {
    let front = anchor.is_some_and(|anchor| scene.fronts.contains_key(&scene.items[anchor].object.id));
    let frame = |told, front_known, center| match (scene.is_told(), front) {
        (true, _) => told,
        (false, true) => front_known,
        (false, false) => center,
    };
    match term.word {
        _ if term.negated => Kind::Negated,
        RelationWord::On => Kind::On,
        RelationWord::In => Kind::In,
        RelationWord::Under => Kind::Under,
        RelationWord::Above => Kind::Above,
        RelationWord::Below => Kind::Below,
        RelationWord::NextTo => Kind::NextTo,
        RelationWord::Near => Kind::Near,
        RelationWord::Far => Kind::Far,
        RelationWord::Against => Kind::Against,
        RelationWord::With => Kind::With,
        RelationWord::LeftOf | RelationWord::RightOf => frame(Kind::SideTold, Kind::SideFront, Kind::SideCenter),
        RelationWord::InFrontOf | RelationWord::Behind => frame(Kind::DepthTold, Kind::DepthFront, Kind::DepthCenter),
        RelationWord::Between => Kind::Between,
        RelationWord::Closest => Kind::Closest,
        RelationWord::Farthest => Kind::Farthest,
    }
}
