//! What generated homes hold: categories with their usual and unusual materials, masses and uses.
//!
//! These are the truth of generated scenes, written apart from the common knowledge of the map.

use super::finish::{Color, Finish, Material};
use super::{Draws, draw_of};
use Color::*;
use Material::*;
use rand::RngExt;

/// Share of things that are made of something unusual, where their category has such a thing.
const UNUSUAL_SHARE: f64 = 0.37;
/// Share of the things that can bear a print that have one.
const PRINTED_SHARE: f64 = 0.16;

/// One category.
pub(super) struct Category {
    pub name: &'static str,
    usual: &'static [Material],
    unusual: &'static [Material],
    /// Typical mass; a thing has 0.8 to 1.2 of it.
    mass_kg: f64,
    pub affordances: &'static [&'static str],
    /// Colours of the usual material; empty = whatever the material comes in.
    pub colors: &'static [Color],
}

const fn row(
    name: &'static str,
    usual: &'static [Material],
    unusual: &'static [Material],
    mass_kg: f64,
    affordances: &'static [&'static str],
    colors: &'static [Color],
) -> Category {
    Category { name, usual, unusual, mass_kg, affordances, colors }
}

#[rustfmt::skip]
const CATEGORIES: &[Category] = &[
    // Furniture.
    row("sofa", &[Fabric, Leather], &[Wicker], 45.0, &["sit", "lie"], &[]),
    row("armchair", &[Fabric, Leather], &[Wicker], 22.0, &["sit"], &[]),
    row("ottoman", &[Fabric, Leather], &[Wicker], 7.0, &["sit"], &[]),
    row("chair", &[Wood, Fabric], &[Wicker, Leather], 6.0, &["sit", "move"], &[]),
    row("office chair", &[Plastic, Fabric], &[Leather], 14.0, &["sit", "move"], &[Black, Gray, Blue, Red]),
    row("stool", &[Wood, Metal], &[Leather, Stone], 4.0, &["sit", "move"], &[]),
    row("bench", &[Wood], &[Stone, Leather], 14.0, &["sit"], &[]),
    row("bed", &[Wood], &[Metal, Leather], 60.0, &["sleep", "lie", "sit"], &[]),
    row("table", &[Wood], &[Stone, Plastic], 22.0, &["support", "work"], &[]),
    row("dining table", &[Wood], &[Stone, Plastic], 35.0, &["support", "eat"], &[]),
    row("coffee table", &[Wood, Glass], &[Stone, Leather], 16.0, &["support"], &[]),
    row("side table", &[Wood, Metal], &[Plastic, Stone], 7.0, &["support"], &[]),
    row("desk", &[Wood], &[Stone, Plastic], 30.0, &["support", "work", "write"], &[]),
    row("nightstand", &[Wood], &[Plastic, Leather], 10.0, &["store", "open", "support"], &[]),
    row("dresser", &[Wood], &[Plastic, Leather], 40.0, &["store", "open", "support"], &[]),
    row("cabinet", &[Wood], &[Plastic, Glass], 35.0, &["store", "open", "support"], &[White, Brown, Beige, Black, Blue, Green]),
    row("wardrobe", &[Wood], &[Plastic, Fabric], 70.0, &["store", "open"], &[White, Brown, Beige, Black]),
    row("tv stand", &[Wood], &[Glass, Plastic], 25.0, &["store", "support"], &[]),
    row("shelf", &[Wood, Metal], &[Plastic, Glass], 18.0, &["store", "support"], &[White, Brown, Beige, Black, Red, Blue]),
    row("bookshelf", &[Wood], &[Plastic, Cardboard], 30.0, &["store", "support"], &[]),
    row("coat rack", &[Wood, Metal], &[Plastic], 5.0, &["store"], &[]),
    row("rug", &[Fabric], &[Plastic, Wicker], 6.0, &["cover"], &[]),
    // Kitchen and bathroom.
    row("fridge", &[Metal], &[Wood, Glass], 70.0, &["cool", "store", "open"], &[White, Gray, Gray, Black, Red]),
    row("stove", &[Metal], &[Glass, Ceramic], 30.0, &["cook"], &[White, Gray, Black]),
    row("countertop", &[Stone, Wood], &[Metal, Plastic], 80.0, &["support", "cook"], &[]),
    row("sink", &[Metal, Ceramic], &[Stone, Plastic], 12.0, &["wash"], &[White, Gray]),
    row("microwave", &[Metal, Plastic], &[Glass], 12.0, &["cook", "open"], &[Black, White, Gray]),
    row("toaster", &[Metal, Plastic], &[Ceramic], 1.8, &["cook"], &[Gray, Red, Black, White]),
    row("coffee machine", &[Plastic, Metal], &[Ceramic], 4.0, &["drink"], &[Black, Gray, Red]),
    row("kettle", &[Metal, Plastic], &[Glass], 1.0, &["cook", "fill", "pour"], &[Gray, White, Red, Black]),
    row("pot", &[Metal], &[Ceramic, Glass], 1.2, &["cook"], &[Gray, Black, Red]),
    row("toilet", &[Ceramic], &[Plastic, Wood], 30.0, &["sit"], &[White]),
    row("bathtub", &[Ceramic], &[Plastic, Metal], 60.0, &["wash"], &[White, Beige]),
    row("washing machine", &[Metal], &[Plastic], 65.0, &["wash", "open"], &[White, Gray]),
    row("trash can", &[Metal, Plastic], &[Wicker, Wood], 1.5, &["contain"], &[]),
    row("laundry basket", &[Plastic], &[Wicker, Fabric], 1.2, &["contain"], &[]),
    row("box", &[Cardboard], &[Plastic, Wood, Metal], 0.8, &["contain", "store"], &[]),
    row("basket", &[Wicker], &[Plastic, Metal], 0.8, &["contain", "store"], &[]),
    // Devices and decoration.
    row("tv", &[Plastic], &[Wood, Metal], 14.0, &["watch"], &[Black, Gray]),
    row("monitor", &[Plastic], &[Metal, Wood], 5.0, &["watch", "work"], &[Black, Gray, White]),
    row("keyboard", &[Plastic], &[Metal, Wood], 0.7, &["type"], &[Black, White, Gray]),
    row("laptop", &[Plastic, Metal], &[Wood], 1.8, &["work", "type"], &[Gray, Black, White]),
    row("printer", &[Plastic], &[Metal], 9.0, &["print"], &[White, Black, Gray]),
    row("lamp", &[Metal, Ceramic], &[Wood, Paper], 2.5, &["light"], &[]),
    row("floor lamp", &[Metal], &[Wood, Paper], 5.0, &["light"], &[]),
    row("clock", &[Plastic], &[Metal, Ceramic], 0.6, &["measure"], &[]),
    row("picture", &[Wood], &[Metal, Plastic], 1.0, &["decorate"], &[]),
    row("mirror", &[Glass], &[Metal], 6.0, &["see"], &[Cyan]),
    row("plant", &[Organic], &[Plastic, Fabric], 3.0, &["decorate"], &[Green]),
    row("pillow", &[Fabric], &[Leather, Foam], 0.6, &["sleep", "pick up"], &[]),
    // Things to be grasped.
    row("apple", &[Organic], &[Wax, Plastic, Wood], 0.18, &["eat", "pick up"], &[Red, Red, Green, Yellow]),
    row("orange", &[Organic], &[Wax, Plastic], 0.18, &["eat", "pick up"], &[Orange]),
    row("lemon", &[Organic], &[Wax, Plastic], 0.1, &["eat", "pick up"], &[Yellow]),
    row("tomato", &[Organic], &[Wax, Plastic], 0.12, &["eat", "pick up"], &[Red]),
    row("mug", &[Ceramic], &[Plastic, Wood], 0.32, &["drink", "fill", "pick up"], &[]),
    row("cup", &[Ceramic, Plastic], &[Metal, Wood], 0.2, &["drink", "fill", "pick up"], &[]),
    row("glass", &[Glass], &[Plastic, Metal], 0.25, &["drink", "fill", "pick up"], &[]),
    row("bowl", &[Ceramic], &[Wood, Plastic], 0.3, &["eat", "contain", "pick up"], &[]),
    row("plate", &[Ceramic], &[Wood, Plastic], 0.4, &["eat", "pick up"], &[]),
    row("bottle", &[Plastic, Glass], &[Ceramic, Metal], 0.5, &["drink", "pour", "open", "pick up"], &[]),
    row("wine bottle", &[Glass], &[Ceramic, Plastic], 0.9, &["drink", "pour", "open", "pick up"], &[Green, Brown, Blue]),
    row("can", &[Metal], &[Plastic, Cardboard], 0.35, &["eat", "open", "pick up"], &[Red, Green, Blue, Yellow, Gray, Orange]),
    row("milk carton", &[Cardboard], &[Plastic, Glass], 0.9, &["drink", "pour", "open", "pick up"], &[White, Blue, Green, Red]),
    row("cereal box", &[Cardboard], &[Plastic, Metal], 0.4, &["eat", "open", "pick up"], &[Yellow, Red, Blue, Orange, Green, Purple]),
    row("jar", &[Glass], &[Metal, Plastic], 0.4, &["contain", "open", "pick up"], &[]),
    row("thermos", &[Metal], &[Plastic, Ceramic], 0.4, &["drink", "pour", "pick up"], &[Gray, Red, Blue, Green, Black]),
    row("book", &[Paper], &[Leather, Plastic], 0.4, &["read", "open", "pick up"], &[Red, Blue, Green, Yellow, Orange, Purple, White, Brown, Black, Pink]),
    row("vase", &[Ceramic, Glass], &[Metal, Wood], 0.6, &["decorate", "pick up"], &[]),
    row("candle", &[Wax], &[Plastic, Glass], 0.3, &["light", "decorate", "pick up"], &[]),
    row("toy block", &[Wood, Plastic], &[Foam, Stone], 0.12, &["play", "pick up"], &[Red, Blue, Green, Yellow, Orange, Purple]),
    row("ball", &[Rubber, Plastic], &[Wood, Fabric], 0.2, &["play", "pick up"], &[]),
    row("toy car", &[Plastic], &[Wood, Metal], 0.15, &["play", "pick up"], &[Red, Blue, Green, Yellow, Orange]),
    row("teddy bear", &[Fabric], &[Plastic, Foam], 0.3, &["play", "pick up"], &[Brown, Beige, White, Pink]),
    row("alarm clock", &[Plastic], &[Wood, Metal], 0.3, &["measure", "pick up"], &[]),
    row("tissue box", &[Cardboard], &[Wood, Plastic], 0.2, &["clean", "pick up"], &[]),
    row("soap dispenser", &[Plastic], &[Ceramic, Glass], 0.4, &["wash", "pick up"], &[]),
    row("shampoo", &[Plastic], &[Glass, Metal], 0.4, &["wash", "pick up"], &[]),
    row("sponge", &[Foam], &[Metal, Fabric], 0.05, &["clean", "pick up"], &[Yellow, Green, Blue, Pink]),
    row("toilet paper", &[Paper], &[Fabric], 0.12, &["clean", "pick up"], &[White]),
    row("flower pot", &[Ceramic], &[Metal, Wood], 0.7, &["contain", "decorate", "pick up"], &[Brown, White, Blue, Orange]),
    row("pen holder", &[Plastic, Metal], &[Leather, Ceramic], 0.2, &["store", "pick up"], &[]),
];

/// The row of a category that this crate builds.
pub(super) fn find_category(name: &str) -> Option<&'static Category> {
    CATEGORIES.iter().find(|row| row.name == name)
}

/// What one thing of a category is made of.
pub(super) struct Make {
    pub finish: Finish,
    pub unusual: bool,
    pub mass_kg: f64,
}

impl Category {
    /// Draws material, colour, print and mass.
    pub(super) fn draw(&self, rng: &mut Draws) -> Make {
        let unusual = !self.unusual.is_empty() && rng.random::<f64>() < UNUSUAL_SHARE;
        let material = draw_of(if unusual { self.unusual } else { self.usual }, rng);
        // A category's colours are those of its kind: an apple of wax is still red or green.
        let free_choice = matches!(material, Wicker | Stone | Glass | Cardboard | Leather) && unusual;
        let mut finish = Finish::draw(material, if free_choice { &[] } else { self.colors }, rng);
        let printable = !matches!(self.name, "apple" | "orange" | "lemon" | "tomato" | "book" | "toilet" | "sponge");
        if printable && rng.random::<f64>() < PRINTED_SHARE {
            finish = finish.printed(rng);
        }
        Make { finish, unusual, mass_kg: self.mass_kg * (0.8 + 0.4 * rng.random::<f64>()) }
    }
}
