//! Names of colours from sRGB pixels.

/// The eleven basic colour terms of English, beige and cyan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ColorName {
    /// Dark without hue.
    Black,
    /// Bright without hue.
    White,
    /// Between black and white.
    Gray,
    /// Hue around 25 degrees (CIELAB).
    Red,
    /// Between red and yellow, bright.
    Orange,
    /// Between red and yellow, dark or dull.
    Brown,
    /// Hue around 95 degrees.
    Yellow,
    /// Hue around 150 degrees.
    Green,
    /// Hue around 270 degrees.
    Blue,
    /// Hue around 315 degrees.
    Purple,
    /// Red or magenta, bright and pale.
    Pink,
    /// Between white and brown.
    Beige,
    /// Between green and blue, bright.
    Cyan,
}

impl ColorName {
    /// All names.
    pub const ALL: [Self; 13] = [
        Self::Black,
        Self::White,
        Self::Gray,
        Self::Red,
        Self::Orange,
        Self::Brown,
        Self::Yellow,
        Self::Green,
        Self::Blue,
        Self::Purple,
        Self::Pink,
        Self::Beige,
        Self::Cyan,
    ];

    /// The English word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Black => "black",
            Self::White => "white",
            Self::Gray => "gray",
            Self::Red => "red",
            Self::Orange => "orange",
            Self::Brown => "brown",
            Self::Yellow => "yellow",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Purple => "purple",
            Self::Pink => "pink",
            Self::Beige => "beige",
            Self::Cyan => "cyan",
        }
    }
}

/// One entry of the table: a pixel in CIELAB (D65) and what it is called.
#[derive(Clone, Copy, Debug)]
pub struct Color {
    /// Lightness L*, 0 to 100.
    pub lightness: f32,
    /// a*: green to red.
    pub a: f32,
    /// b*: blue to yellow.
    pub b: f32,
    /// The basic colour term.
    pub name: ColorName,
}

/// CIELAB values and names of all colours at 5 bits a channel. Looking up replaces powers and roots per pixel.
#[derive(Clone, Debug)]
pub struct ColorTable {
    entries: Vec<Color>,
}

impl Default for ColorTable {
    fn default() -> Self {
        Self::new()
    }
}

impl ColorTable {
    /// Computes the table.
    pub fn new() -> Self {
        let channel = |bits: usize| (bits as f32 * 8.0 + 4.0) / 255.0;
        let entries = (0..1 << 15)
            .map(|i| {
                let [l, a, b] = lab_from_srgb([channel(i >> 10), channel(i >> 5 & 31), channel(i & 31)]);
                Color { lightness: l, a, b, name: name_of(l, a, b) }
            })
            .collect();
        Self { entries }
    }

    /// The entry of an sRGB pixel.
    pub fn find(&self, srgb: [u8; 3]) -> &Color {
        let [r, g, b] = srgb.map(|c| usize::from(c >> 3));
        &self.entries[r << 10 | g << 5 | b]
    }
}

fn lab_from_srgb(srgb: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = srgb.map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) });
    let x = (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505;
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let z = (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089;
    let f = |t: f32| if t > 0.008856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    [116.0 * f(y) - 16.0, 500.0 * (f(x) - f(y)), 200.0 * (f(y) - f(z))]
}

/// Borders in hue and chroma were set by hand around the sRGB prototypes of each term. Chroma is judged against
/// lightness, because shading scales both: a dark red stays red instead of turning black.
fn name_of(l: f32, a: f32, b: f32) -> ColorName {
    let chroma = a.hypot(b);
    let hue_deg = b.atan2(a).to_degrees().rem_euclid(360.0);
    if l < 14.0 && chroma < 14.0 {
        return ColorName::Black;
    }
    if chroma < 5.0 + 0.05 * l {
        return match l {
            _ if l < 24.0 => ColorName::Black,
            _ if l > 76.0 => ColorName::White,
            _ => ColorName::Gray,
        };
    }
    // What dim light leaves of a colour keeps its chroma over its lightness.
    let saturation = chroma / l.max(1.0);
    match hue_deg {
        // Paler than any wood, for its lightness.
        h if (70.0..112.0).contains(&h) && l > 30.0 && saturation < 0.45 => ColorName::Beige,
        h if (55.0..70.0).contains(&h) && l > 50.0 && saturation < 0.36 => ColorName::Beige,
        h if (185.0..200.0).contains(&h) && l > 48.0 && chroma > 14.0 => ColorName::Cyan,
        h if (200.0..218.0).contains(&h) && l > 30.0 && chroma > 10.0 => ColorName::Cyan,
        h if !(20.0..338.0).contains(&h) && l > 30.0 && saturation < 1.05 => ColorName::Pink,
        h if !(8.0..345.0).contains(&h) => {
            if l > 50.0 {
                ColorName::Pink
            } else if h > 180.0 {
                ColorName::Purple
            } else {
                ColorName::Red
            }
        }
        h if h < 44.0 && l > 62.0 => ColorName::Pink,
        h if h < 44.0 && chroma < 26.0 && chroma < 0.75 * l => ColorName::Brown,
        h if h < 44.0 => ColorName::Red,
        h if h < 82.0 => {
            if l > 28.0 && saturation > 1.45 - 0.009 * l {
                ColorName::Orange
            } else {
                ColorName::Brown
            }
        }
        h if h < 112.0 => {
            if l < 50.0 && saturation < 0.75 {
                ColorName::Brown
            } else {
                ColorName::Yellow
            }
        }
        h if h < 200.0 => ColorName::Green,
        // The blue primary of sRGB itself lies at 306 degrees, purple things from 315 on.
        h if h < 309.0 => ColorName::Blue,
        h if h < 330.0 => ColorName::Purple,
        _ => {
            if l > 62.0 {
                ColorName::Pink
            } else {
                ColorName::Purple
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: common sRGB colours get the name people give them, and keep it at two thirds of the brightness.
    use super::*;

    #[test]
    fn names_of_prototypes_survive_dimming() {
        let table = ColorTable::new();
        let cases = [
            ([200, 30, 30], ColorName::Red),
            ([240, 240, 240], ColorName::White),
            ([15, 15, 15], ColorName::Black),
            ([128, 128, 128], ColorName::Gray),
            ([40, 160, 60], ColorName::Green),
            ([40, 80, 200], ColorName::Blue),
            ([20, 50, 200], ColorName::Blue),
            ([0, 0, 255], ColorName::Blue),
            ([240, 220, 40], ColorName::Yellow),
            ([240, 140, 30], ColorName::Orange),
            ([120, 75, 40], ColorName::Brown),
            ([160, 110, 70], ColorName::Brown),
            ([130, 50, 160], ColorName::Purple),
            ([245, 160, 190], ColorName::Pink),
            ([210, 190, 155], ColorName::Beige),
            ([60, 190, 200], ColorName::Cyan),
            ([20, 120, 120], ColorName::Green),
            ([173, 219, 235], ColorName::Blue),
        ];
        for (srgb, name) in cases {
            assert_eq!(table.find(srgb).name, name, "{srgb:?}");
        }
        for (srgb, name) in cases
            .into_iter()
            .filter(|(_, n)| matches!(n, ColorName::Red | ColorName::Green | ColorName::Blue | ColorName::Brown))
        {
            let dim = srgb.map(|c| (f32::from(c) * 0.66) as u8);
            assert_eq!(table.find(dim).name, name, "dimmed {dim:?} {:?}", table.find(dim));
        }
    }
}
