//! What a referring expression says, as a tree.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A parsed referring expression.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Query {
    /// What is meant, with all that is said about it.
    pub target: Entity,
    /// Where the viewer is said to stand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viewpoint: Option<Viewpoint>,
}

/// Where the viewer is said to stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Viewpoint {
    /// The thing that the viewer faces or comes in by.
    pub at: Entity,
    /// Whether the viewer stands there and looks into the scene; else the viewer faces it.
    pub entering: bool,
}

/// Something that is talked about: the target or an anchor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Entity {
    /// What kind of thing it is.
    pub noun: Noun,
    /// Whether any one will do.
    pub article: Article,
    /// What it is like.
    pub attributes: Vec<AttributeTerm>,
    /// Where it is.
    pub relations: Vec<RelationTerm>,
    /// Which one of several it is.
    pub selections: Vec<Selection>,
}

/// The kind of thing, as said.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind", content = "word")]
pub enum Noun {
    /// A thing by name or by the kind it belongs to.
    Thing(String),
    /// "something", "the one", "object".
    Anything,
    /// A room by canonical name; `room` for any.
    Room(String),
}

/// Whether one certain thing is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Article {
    /// "the", "this", or nothing: one certain thing.
    Definite,
    /// "a", "some", "any": whichever fits.
    Indefinite,
}

/// What an attribute word speaks about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AttributeWord {
    /// Colour.
    Color,
    /// Material.
    Material,
    /// Size compared with others of its kind.
    Size,
    /// Shape of its box.
    Shape,
    /// Surface pattern.
    Pattern,
    /// Heavy or light.
    Weight,
    /// What it is for.
    Purpose,
}

/// One attribute, by canonical word.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct AttributeTerm {
    /// What it speaks about.
    pub kind: AttributeWord,
    /// The canonical word.
    pub word: String,
    /// Whether it must not hold.
    pub negated: bool,
}

/// A relation word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RelationWord {
    /// Rests on it or hangs on it.
    On,
    /// Inside it; for rooms: stands in it.
    In,
    /// Under it.
    Under,
    /// Above it.
    Above,
    /// Below it.
    Below,
    /// Beside it.
    NextTo,
    /// Not far from it.
    Near,
    /// Far from it.
    Far,
    /// Touching it from the side.
    Against,
    /// Has it: next to it, carrying it, holding it, or with it as a part.
    With,
    /// Left of it, for a viewer who faces it.
    LeftOf,
    /// Right of it, for a viewer who faces it.
    RightOf,
    /// Between it and the viewer.
    InFrontOf,
    /// Hidden by it from the viewer.
    Behind,
    /// Between two anchors.
    Between,
    /// Closer to it than any other candidate.
    Closest,
    /// Farther from it than any other candidate.
    Farthest,
}

/// A relation to one anchor, or to two for `between`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RelationTerm {
    /// The relation.
    pub word: RelationWord,
    /// Whether it must not hold.
    pub negated: bool,
    /// The anchors; never empty.
    pub anchors: Vec<Entity>,
}

/// By what candidates are put in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Nearest to the viewer first.
    Nearest,
    /// Farthest from the viewer first.
    Farthest,
    /// Largest volume first.
    Largest,
    /// Smallest volume first.
    Smallest,
    /// Highest box first.
    Tallest,
    /// Least high box first.
    Shortest,
    /// Highest place first.
    Highest,
    /// Lowest place first.
    Lowest,
    /// Longest side first.
    Longest,
    /// Leftmost for the viewer first.
    Leftmost,
    /// Rightmost for the viewer first.
    Rightmost,
    /// Closest to the middle of the candidates first.
    Middle,
    /// Closest to the middle of the map first.
    Central,
    /// Closest to a corner of the map first.
    Corner,
}

/// Which one of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Selection {
    /// By what they are put in order.
    pub order: Order,
    /// Place in that order, from 1.
    pub rank: u32,
}

impl Entity {
    /// An entity of which only the noun is known.
    pub fn named(noun: Noun) -> Self {
        Self { noun, article: Article::Definite, attributes: Vec::new(), relations: Vec::new(), selections: Vec::new() }
    }

    /// Number of entities in the tree.
    pub fn count(&self) -> usize {
        1 + self.relations.iter().flat_map(|relation| &relation.anchors).map(Self::count).sum::<usize>()
    }

    /// The words that name it, for reasons.
    pub fn phrase(&self) -> String {
        let mut words: Vec<&str> = self.attributes.iter().filter(|a| !a.negated).map(|a| a.word.as_str()).collect();
        words.push(match &self.noun {
            Noun::Thing(name) | Noun::Room(name) => name,
            Noun::Anything => "thing",
        });
        words.join(" ")
    }
}

impl RelationWord {
    /// The words of the relation.
    pub fn phrase(self) -> &'static str {
        match self {
            Self::On => "on",
            Self::In => "in",
            Self::Under => "under",
            Self::Above => "above",
            Self::Below => "below",
            Self::NextTo => "next to",
            Self::Near => "near",
            Self::Far => "far from",
            Self::Against => "against",
            Self::With => "with",
            Self::LeftOf => "left of",
            Self::RightOf => "right of",
            Self::InFrontOf => "in front of",
            Self::Behind => "behind",
            Self::Between => "between",
            Self::Closest => "closest to",
            Self::Farthest => "farthest from",
        }
    }

    /// Whether its meaning depends on where the viewer stands.
    pub fn needs_viewer(self) -> bool {
        matches!(self, Self::LeftOf | Self::RightOf | Self::InFrontOf | Self::Behind)
    }
}
