//! Surfaces: what a thing is made of, its colour and its pattern, and how MJCF draws that.

use super::Draws;
use rand::RngExt;

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub(super) enum $name { $($variant),+ }

        impl $name {
            /// The word for it in semantics.toml.
            pub(super) fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }
        }
    };
}

words!(
    /// What a thing is made of.
    Material {
        Wood = "wood", Metal = "metal", Plastic = "plastic", Glass = "glass", Ceramic = "ceramic", Fabric = "fabric",
        Leather = "leather", Paper = "paper", Cardboard = "cardboard", Stone = "stone", Rubber = "rubber", Foam = "foam",
        Wicker = "wicker", Organic = "organic", Wax = "wax", Plaster = "plaster",
    }
);
words!(
    /// Its main colour.
    Color {
        Red = "red", Orange = "orange", Yellow = "yellow", Green = "green", Cyan = "cyan", Blue = "blue", Purple = "purple",
        Pink = "pink", Brown = "brown", Beige = "beige", White = "white", Gray = "gray", Black = "black",
    }
);
words!(
    /// What is drawn on it.
    Pattern {
        Plain = "plain", Striped = "striped", Checkered = "checkered", Dotted = "dotted", Grain = "wood grain",
        Woven = "woven", Tiles = "tiles", Planks = "planks",
    }
);

use Color::*;
use Material::*;

/// Colours that people paint, dye or mould things in.
const BRIGHT: &[Color] = &[Red, Orange, Yellow, Green, Cyan, Blue, Purple, Pink, White, Gray, Black, Brown, Beige];

/// A surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Finish {
    pub material: Material,
    pub color: Color,
    pub pattern: Pattern,
    /// Which of four shades of the colour.
    pub shade: u8,
}

impl Finish {
    pub(super) const fn plain(material: Material, color: Color) -> Self {
        Self { material, color, pattern: Pattern::Plain, shade: 0 }
    }

    /// A finish of a material in one of `colors`, or in what the material usually comes in when none is given.
    pub(super) fn draw(material: Material, colors: &[Color], rng: &mut Draws) -> Self {
        let colors = if colors.is_empty() { material.colors() } else { colors };
        let color = colors[rng.random_range(0..colors.len())];
        let grained = material == Wood && matches!(color, Brown | Beige);
        let pattern = match material {
            Wood if grained => Pattern::Grain,
            Wicker => Pattern::Woven,
            _ => Pattern::Plain,
        };
        Self { material, color, pattern, shade: rng.random_range(0..4) }
    }

    /// Puts stripes, checks or dots on what can bear them.
    pub(super) fn printed(mut self, rng: &mut Draws) -> Self {
        if self.pattern == Pattern::Plain && !matches!(self.material, Metal | Glass | Organic | Stone | Wood) {
            self.pattern = [Pattern::Striped, Pattern::Checkered, Pattern::Dotted][rng.random_range(0..3)];
        }
        self
    }

    /// The name of its MJCF material.
    pub(super) fn name(&self) -> String {
        let (material, color) = (self.material.word(), self.color.word());
        let pattern = match self.pattern {
            Pattern::Plain => String::new(),
            pattern => format!("_{}", pattern.word().replace(' ', "_")),
        };
        format!("{material}_{color}{pattern}_{}", self.shade)
    }

    /// Its texture, if it has one: the name of the file without its ending.
    pub(super) fn texture(&self) -> Option<String> {
        let two_colored = matches!(self.pattern, Pattern::Striped | Pattern::Checkered | Pattern::Dotted);
        match self.pattern {
            Pattern::Plain => None,
            _ if two_colored => Some(self.name()),
            pattern => Some(pattern.word().replace(' ', "_")),
        }
    }

    /// Its colour, sRGB 0 to 1.
    pub(super) fn rgb(&self) -> [f64; 3] {
        // Glass lets light through: drawn opaque, it looks lighter.
        let light = if self.material == Glass { 0.12 } else { 0.0 };
        let factor = [1.0, 0.9, 1.08, 0.96][usize::from(self.shade % 4)];
        self.color.rgb().map(|c| (c * factor + light).clamp(0.02, 0.97))
    }

    /// The second colour of its pattern, sRGB 0 to 1.
    pub(super) fn second_rgb(&self) -> [f64; 3] {
        let dark = matches!(self.color, White | Yellow | Beige | Cyan | Pink | Orange);
        if dark { [0.16, 0.2, 0.34] } else { [0.93, 0.92, 0.88] }
    }

    /// Specularity and shininess.
    pub(super) fn gloss(&self) -> f64 {
        if matches!(self.material, Metal | Glass | Ceramic) { 0.6 } else { 0.1 }
    }
}

impl Material {
    /// Sliding friction of a thing made of it, .3 to .8.
    pub(super) fn friction(self) -> f64 {
        match self {
            Glass | Ceramic | Metal => 0.45,
            Plastic | Wax | Stone => 0.5,
            Fabric | Rubber | Foam => 0.8,
            Leather | Wicker => 0.7,
            Wood | Paper | Cardboard | Organic | Plaster => 0.6,
        }
    }

    /// The colours it usually comes in.
    fn colors(self) -> &'static [Color] {
        match self {
            Wood => &[Brown, Brown, Brown, Beige, Beige, White, Black],
            Metal => &[Gray, Gray, Gray, Black, White, Red, Blue, Green],
            Glass => &[Cyan, Green, Blue, Brown],
            Leather => &[Brown, Black, White, Red],
            Cardboard | Wicker => &[Brown, Beige],
            Stone => &[Gray, White, Black],
            Wax => &[White, Red, Yellow, Green],
            Plaster => &[White, Beige],
            Organic => &[Green, Red, Yellow],
            Ceramic => &[White, White, White, Red, Blue, Green, Yellow, Black, Orange, Purple],
            Plastic | Fabric | Paper | Rubber | Foam => BRIGHT,
        }
    }
}

impl Color {
    fn rgb(self) -> [f64; 3] {
        match self {
            Red => [0.76, 0.12, 0.12],
            Orange => [0.92, 0.48, 0.1],
            Yellow => [0.9, 0.78, 0.16],
            Green => [0.18, 0.54, 0.24],
            Cyan => [0.2, 0.74, 0.8],
            Blue => [0.14, 0.28, 0.72],
            Purple => [0.47, 0.18, 0.6],
            Pink => [0.9, 0.5, 0.64],
            Brown => [0.45, 0.28, 0.15],
            Beige => [0.82, 0.73, 0.58],
            White => [0.92, 0.92, 0.9],
            Gray => [0.55, 0.56, 0.58],
            Black => [0.09, 0.09, 0.1],
        }
    }
}
