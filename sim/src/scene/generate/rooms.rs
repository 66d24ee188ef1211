//! Kinds of rooms: what they are called, what stands in them and where.

use super::finish::{Color, Finish, Material, Pattern};
use super::{Draws, draw_of};
use rand::RngExt;
use rand::seq::SliceRandom;

/// Where a piece of furniture goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spot {
    /// Back to a wall.
    Wall,
    /// Into a corner.
    Corner,
    /// Somewhere in the open, along the walls' directions.
    Open,
    /// Before the front of the piece named, at this distance in centimetres, facing it.
    Before(&'static str, i32),
    /// Beside the piece named, with the same back wall.
    Beside(&'static str),
    /// Around the piece named: at its free sides, facing it, pulled out.
    Around(&'static str),
    /// On top of the piece named, at the back, not to be taken.
    On(&'static str),
    /// Hanging on a wall, its middle at this height in centimetres.
    Hung(i32),
    /// Flat on the floor, in the middle.
    Floor,
}

/// One piece that a room may hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wish {
    pub category: &'static str,
    pub spot: Spot,
    /// How likely, 0 to 1.
    pub chance: f64,
}

const fn wish(category: &'static str, spot: Spot, chance: f64) -> Wish {
    Wish { category, spot, chance }
}

use Spot::*;

/// What a room is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RoomKind {
    Living,
    Kitchen,
    Bedroom,
    Bathroom,
    Office,
    Dining,
    Hallway,
    Playroom,
    Laundry,
}

#[rustfmt::skip]
const LIVING: &[Wish] = &[
    wish("sofa", Wall, 1.0), wish("coffee table", Before("sofa", 45), 1.0), wish("tv stand", Wall, 1.0),
    wish("tv", On("tv stand"), 1.0), wish("bookshelf", Wall, 0.8), wish("side table", Beside("sofa"), 0.9),
    wish("armchair", Wall, 0.8), wish("cabinet", Wall, 0.7), wish("lamp", On("side table"), 0.6),
    wish("floor lamp", Corner, 0.7), wish("rug", Floor, 0.7), wish("picture", Hung(155), 0.8), wish("plant", Corner, 0.7),
    wish("clock", Hung(175), 0.4), wish("ottoman", Open, 0.3), wish("shelf", Wall, 0.5), wish("picture", Hung(155), 0.4),
    wish("armchair", Wall, 0.4),
];
#[rustfmt::skip]
const KITCHEN: &[Wish] = &[
    wish("countertop", Wall, 1.0), wish("sink", Beside("countertop"), 1.0), wish("stove", Beside("countertop"), 1.0),
    wish("fridge", Wall, 1.0), wish("countertop", Wall, 0.9), wish("table", Wall, 0.9), wish("chair", Around("table"), 1.0),
    wish("chair", Around("table"), 0.8), wish("microwave", On("countertop"), 0.7), wish("kettle", On("countertop"), 0.6),
    wish("pot", On("stove"), 0.7), wish("cabinet", Wall, 0.7), wish("trash can", Corner, 0.8), wish("clock", Hung(175), 0.6),
    wish("coffee machine", On("countertop"), 0.4), wish("shelf", Wall, 0.5), wish("stool", Wall, 0.3),
    wish("toaster", On("countertop"), 0.4),
];
#[rustfmt::skip]
const BEDROOM: &[Wish] = &[
    wish("bed", Wall, 1.0), wish("nightstand", Beside("bed"), 1.0), wish("dresser", Wall, 1.0), wish("wardrobe", Wall, 0.9),
    wish("nightstand", Beside("bed"), 0.6), wish("pillow", On("bed"), 1.0), wish("lamp", On("nightstand"), 0.7),
    wish("shelf", Wall, 0.6), wish("chair", Wall, 0.6), wish("picture", Hung(155), 0.7), wish("rug", Floor, 0.6),
    wish("mirror", Hung(140), 0.5), wish("laundry basket", Corner, 0.5), wish("plant", Corner, 0.4), wish("bench", Wall, 0.3),
];
#[rustfmt::skip]
const BATHROOM: &[Wish] = &[
    wish("bathtub", Wall, 1.0), wish("toilet", Wall, 1.0), wish("sink", Wall, 1.0), wish("shelf", Wall, 0.9),
    wish("mirror", Hung(140), 0.9), wish("cabinet", Wall, 0.6), wish("laundry basket", Corner, 0.6),
    wish("stool", Wall, 0.5), wish("trash can", Corner, 0.5), wish("rug", Floor, 0.4),
];
#[rustfmt::skip]
const OFFICE: &[Wish] = &[
    wish("desk", Wall, 1.0), wish("office chair", Before("desk", 10), 1.0), wish("monitor", On("desk"), 0.9),
    wish("bookshelf", Wall, 1.0), wish("cabinet", Wall, 0.9), wish("laptop", On("desk"), 0.4), wish("lamp", On("desk"), 0.5),
    wish("table", Wall, 0.6), wish("armchair", Corner, 0.5), wish("picture", Hung(155), 0.7), wish("plant", Corner, 0.6),
    wish("shelf", Wall, 0.5), wish("trash can", Corner, 0.6), wish("printer", On("cabinet"), 0.4), wish("rug", Floor, 0.4),
    wish("clock", Hung(175), 0.4),
];
#[rustfmt::skip]
const DINING: &[Wish] = &[
    wish("dining table", Open, 1.0), wish("chair", Around("dining table"), 1.0), wish("chair", Around("dining table"), 1.0),
    wish("cabinet", Wall, 1.0), wish("chair", Around("dining table"), 0.7), wish("shelf", Wall, 0.7),
    wish("side table", Wall, 0.6), wish("picture", Hung(155), 0.8), wish("plant", Corner, 0.6), wish("floor lamp", Corner, 0.5),
    wish("bench", Wall, 0.4), wish("clock", Hung(175), 0.4),
];
#[rustfmt::skip]
const HALLWAY: &[Wish] = &[
    wish("cabinet", Wall, 1.0), wish("bench", Wall, 0.8), wish("coat rack", Corner, 0.8), wish("shelf", Wall, 0.7),
    wish("mirror", Hung(140), 0.7), wish("side table", Wall, 0.7), wish("plant", Corner, 0.5), wish("rug", Floor, 0.6),
    wish("picture", Hung(155), 0.5),
];
#[rustfmt::skip]
const PLAYROOM: &[Wish] = &[
    wish("shelf", Wall, 1.0), wish("table", Open, 1.0), wish("chair", Around("table"), 0.9), wish("chair", Around("table"), 0.7),
    wish("ottoman", Wall, 0.6), wish("cabinet", Wall, 0.8), wish("dresser", Wall, 0.6), wish("box", Corner, 0.7),
    wish("rug", Floor, 0.8), wish("picture", Hung(155), 0.8), wish("bookshelf", Wall, 0.6), wish("bench", Wall, 0.5),
    wish("floor lamp", Corner, 0.4),
];
#[rustfmt::skip]
const LAUNDRY: &[Wish] = &[
    wish("washing machine", Wall, 1.0), wish("shelf", Wall, 1.0), wish("table", Wall, 0.9), wish("sink", Wall, 0.7),
    wish("laundry basket", Corner, 0.9), wish("cabinet", Wall, 0.8), wish("stool", Wall, 0.5), wish("trash can", Corner, 0.4),
    wish("washing machine", Wall, 0.3), wish("clock", Hung(175), 0.3),
];

impl RoomKind {
    /// The kinds of a home of so many rooms, the living room first.
    pub(super) fn for_home(rooms: usize, rng: &mut Draws) -> Vec<Self> {
        let mut middle = vec![Self::Kitchen, Self::Bedroom];
        let mut more = vec![Self::Office, Self::Dining, Self::Hallway, Self::Playroom, Self::Laundry];
        if rooms >= 4 {
            middle.push(Self::Bathroom);
        }
        more.shuffle(rng);
        middle.extend(more);
        middle.extend([Self::Bedroom, Self::Bathroom, Self::Office, Self::Bedroom]);
        middle.truncate(rooms.saturating_sub(1));
        middle.shuffle(rng);
        std::iter::once(Self::Living).chain(middle).take(rooms).collect()
    }

    /// What the room is called.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Living => "living room",
            Self::Kitchen => "kitchen",
            Self::Bedroom => "bedroom",
            Self::Bathroom => "bathroom",
            Self::Office => "office",
            Self::Dining => "dining room",
            Self::Hallway => "hallway",
            Self::Playroom => "playroom",
            Self::Laundry => "laundry room",
        }
    }

    /// How little one likes to walk through it.
    pub(super) fn passage_cost(self) -> f64 {
        match self {
            Self::Living | Self::Hallway => 0.0,
            Self::Dining | Self::Kitchen => 1.0,
            Self::Office | Self::Playroom => 2.0,
            Self::Laundry => 2.5,
            Self::Bedroom | Self::Bathroom => 3.0,
        }
    }

    /// Whether people close the door behind them there.
    pub(super) fn is_private(self) -> bool {
        matches!(self, Self::Bedroom | Self::Bathroom | Self::Office | Self::Playroom | Self::Laundry)
    }

    /// What may stand in it, the most important first.
    pub(super) fn wishes(self) -> &'static [Wish] {
        match self {
            Self::Living => LIVING,
            Self::Kitchen => KITCHEN,
            Self::Bedroom => BEDROOM,
            Self::Bathroom => BATHROOM,
            Self::Office => OFFICE,
            Self::Dining => DINING,
            Self::Hallway => HALLWAY,
            Self::Playroom => PLAYROOM,
            Self::Laundry => LAUNDRY,
        }
    }

    /// Things that lie about in it.
    #[rustfmt::skip]
    pub(super) fn usual_things(self) -> &'static [&'static str] {
        match self {
            Self::Kitchen | Self::Dining => &[
                "mug", "cup", "glass", "bowl", "plate", "bottle", "wine bottle", "can", "milk carton", "cereal box", "jar",
                "apple", "orange", "lemon", "tomato", "sponge", "vase", "thermos",
            ],
            Self::Living => &[
                "book", "mug", "glass", "vase", "candle", "apple", "bowl", "bottle", "ball", "teddy bear", "flower pot",
                "tissue box", "can", "orange",
            ],
            Self::Bedroom => &["book", "alarm clock", "glass", "candle", "teddy bear", "tissue box", "vase", "cup", "toy block"],
            Self::Bathroom | Self::Laundry => &["soap dispenser", "shampoo", "toilet paper", "sponge", "cup", "candle", "tissue box", "bottle"],
            Self::Office => &["book", "mug", "pen holder", "thermos", "bottle", "tissue box", "flower pot", "alarm clock", "apple", "can"],
            Self::Hallway => &["vase", "flower pot", "candle", "book", "ball", "bottle", "jar", "tissue box"],
            Self::Playroom => &["toy block", "ball", "toy car", "teddy bear", "book", "cup", "apple", "jar"],
        }
    }

    /// What its floor is made of.
    pub(super) fn draw_floor(self, rng: &mut Draws) -> Finish {
        let of = |material, color, pattern, shade| Finish { material, color, pattern, shade };
        let shade = rng.random_range(0..4);
        match self {
            Self::Kitchen | Self::Bathroom | Self::Laundry => {
                of(Material::Ceramic, draw_of(&[Color::White, Color::Gray, Color::Beige], rng), Pattern::Tiles, shade)
            }
            Self::Bedroom | Self::Playroom => {
                let carpet = of(
                    Material::Fabric,
                    draw_of(&[Color::Beige, Color::Gray, Color::Green, Color::Blue], rng),
                    Pattern::Woven,
                    shade,
                );
                let boards = of(Material::Wood, Color::Brown, Pattern::Planks, shade);
                if rng.random::<bool>() { carpet } else { boards }
            }
            _ => of(Material::Wood, draw_of(&[Color::Brown, Color::Beige], rng), Pattern::Planks, shade),
        }
    }
}
