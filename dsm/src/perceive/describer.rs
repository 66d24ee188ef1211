//! The embedded describer: appearance from pixels, physical properties from geometry and prior, affordances from the
//! knowledge table.

use super::texture::Texture;
use super::tone::Light;
use super::{AttributeVote, ColorName, ColorTable, Describer, ObjectView};
use crate::knowledge::{Category, Knowledge};
use crate::map::AttributeKind::{self, Affordance, Appearance, Physical};
use std::sync::Arc;

/// Share of the pixels from which a second colour makes the pattern multicolored.
const SECOND_COLOR: f32 = 0.25;
/// Mean lightness step between neighbouring pixels (CIELAB) from which a surface looks rough.
const ROUGH: f32 = 4.5;
/// Distance in the plane of hue and chroma, or in lightness (CIELAB), from which two colours are two.
const DISTINCT_HUE: f32 = 22.0;
const DISTINCT_LIGHTNESS: f32 = 35.0;
/// Mean lightness step (CIELAB) between neighbours of the same colour from which a surface mirrors in streaks.
const STREAKED_STEP: f32 = 2.3;
/// Share of the pixels from which a second colour makes a print of contrasts.
const PRINT_SHARE: f32 = 0.08;
/// Weight of a material that the pixels show, beside 1 for the likeliest of the prior.
const SHOWN_WEIGHT: f32 = 1.6;
/// Density assumed for things of unknown mass, kilograms per cubic metre of their box (hollow household things).
const BOX_DENSITY_KG_PER_M3: f64 = 150.0;

/// Describes views without a model.
#[derive(Clone, Debug)]
pub struct KnowledgeDescriber {
    knowledge: Arc<Knowledge>,
    colors: ColorTable,
}

/// What the pixels of one view say.
struct PixelStatistics {
    shares: [f32; ColorName::ALL.len()],
    /// Mean CIELAB values of the pixels of each name.
    means: [[f32; 3]; ColorName::ALL.len()],
    roughness: f32,
    /// Mean lightness step between neighbours of the same colour.
    streaks: f32,
    highlights: f32,
}

impl KnowledgeDescriber {
    /// A describer over a knowledge table.
    pub fn new(knowledge: Arc<Knowledge>) -> Self {
        Self { knowledge, colors: ColorTable::new() }
    }

    fn measure(&self, view: &ObjectView) -> PixelStatistics {
        let (mut shares, mut steps, mut highlights) = ([0.0f32; ColorName::ALL.len()], 0.0, 0.0);
        let mut same = (0.0_f32, 0.0_f32);
        let mut means = [[0.0f32; 3]; ColorName::ALL.len()];
        for &pixel in view.pixels {
            let pixel = pixel as usize;
            let color = self.colors.find(view.frame.color[pixel]);
            shares[color.name as usize] += 1.0;
            let mean = &mut means[color.name as usize];
            *mean = [mean[0] + color.lightness, mean[1] + color.a, mean[2] + color.b];
            if color.lightness > 95.0 {
                highlights += 1.0;
            }
            let next = self.colors.find(*view.frame.color.get(pixel + 1).unwrap_or(&view.frame.color[pixel]));
            steps += (next.lightness - color.lightness).abs();
            if next.name == color.name {
                same.0 += (next.lightness - color.lightness).abs();
                same.1 += 1.0;
            }
        }
        let count = view.pixels.len().max(1) as f32;
        for (mean, share) in means.iter_mut().zip(&shares) {
            *mean = mean.map(|sum| sum / share.max(1.0));
        }
        shares.iter_mut().for_each(|share| *share /= count);
        self.settle_tone(view, &mut shares);
        PixelStatistics {
            shares,
            means,
            roughness: steps / count,
            streaks: same.0 / same.1.max(1.0),
            highlights: highlights / count,
        }
    }

    /// Gives what is white or gray of a view to one of the two.
    fn settle_tone(&self, view: &ObjectView, shares: &mut [f32]) {
        let (white, gray) = (ColorName::White as usize, ColorName::Gray as usize);
        let both = shares[white] + shares[gray];
        if both == 0.0 {
            return;
        }
        let is_tone = |pixel: &&u32| {
            let name = self.colors.find(view.frame.color[**pixel as usize]).name;
            matches!(name, ColorName::White | ColorName::Gray)
        };
        let pixels: Vec<u32> = view.pixels.iter().filter(is_tone).copied().collect();
        let is_white = Light::measure(view, &self.colors).is_white(view, &self.colors, &pixels);
        (shares[white], shares[gray]) = if is_white { (both, 0.0) } else { (0.0, both) };
    }
}

impl Describer for KnowledgeDescriber {
    fn name(&self) -> &str {
        "knowledge"
    }

    fn describe(&self, view: &ObjectView) -> Vec<AttributeVote> {
        let mut votes = Vec::new();
        let mut vote = |kind: AttributeKind, key: &'static str, word: &str, weight: f32| {
            votes.push(AttributeVote { kind, key, word: word.to_owned(), weight });
        };
        let category = self.knowledge.find(view.name);
        if !view.pixels.is_empty() {
            let statistics = self.measure(view);
            let texture = Texture::measure(view);
            let mut ranked: Vec<_> = ColorName::ALL.into_iter().map(|n| (statistics.shares[n as usize], n)).collect();
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            ranked.iter().take(3).filter(|(share, _)| *share > 0.1).for_each(|(share, name)| {
                vote(Appearance, "color", name.word(), *share);
            });
            let (main, second) = (ranked[0].1, ranked[1]);
            let differ = statistics.differ(main, second.1);
            let is_print = texture.is_contrasted() && second.0 > PRINT_SHARE && differ;
            let look = Look {
                color: main,
                is_grained: texture.is_grained() && is_wood_colored(main),
                is_woven: texture.is_woven() && is_wood_colored(main) && !texture.is_contrasted(),
                // Metal mirrors lights and windows as streaks of its own colour.
                is_streaked: texture.is_contrasted() && statistics.streaks > STREAKED_STEP && !is_print,
                roughness: statistics.roughness,
                highlights: statistics.highlights,
            };
            let pattern = match () {
                () if second.0 > SECOND_COLOR && differ => "multicolored",
                () if is_print || look.is_grained || look.is_woven => "patterned",
                () => "plain",
            };
            vote(Appearance, "pattern", pattern, 1.0);
            vote(Appearance, "texture", if statistics.roughness > ROUGH { "rough" } else { "smooth" }, 1.0);
            for (material, weight) in material_votes(category, &look) {
                vote(Physical, "material", &material, weight);
                if let Some(smoothness) = smoothness_of(&material) {
                    vote(Physical, "smoothness", smoothness, weight);
                }
            }
        }
        let largest = view.extent_m.max();
        vote(
            Physical,
            "size",
            if largest < 0.2 {
                "small"
            } else if largest < 0.8 {
                "medium"
            } else {
                "large"
            },
            1.0,
        );
        let mass_kg = category
            .and_then(|c| c.mass_kg)
            .unwrap_or(BOX_DENSITY_KG_PER_M3 * view.extent_m.x * view.extent_m.y * view.extent_m.z);
        vote(
            Physical,
            "weight",
            if mass_kg < 0.7 {
                "light"
            } else if mass_kg < 5.0 {
                "medium"
            } else {
                "heavy"
            },
            1.0,
        );
        if let Some(category) = category {
            category.uses.iter().for_each(|word| vote(Affordance, "use", word, 1.0));
            category.operate.iter().for_each(|word| vote(Affordance, "operate", word, 1.0));
        }
        votes
    }
}

impl PixelStatistics {
    /// Whether two names are of two colours, not of one that lies between both.
    fn differ(&self, first: ColorName, second: ColorName) -> bool {
        let [one, two] = [first, second].map(|name| self.means[name as usize]);
        let hue_apart = (one[1] - two[1]).hypot(one[2] - two[2]) > DISTINCT_HUE;
        (hue_apart || (one[0] - two[0]).abs() > DISTINCT_LIGHTNESS) && !is_shade(first, second)
    }
}

/// Whether one name is what shading makes of the other; then both together are no pattern.
fn is_shade(first: ColorName, second: ColorName) -> bool {
    use ColorName::{Beige, Black, Brown, Gray, Orange, Pink, Red, White, Yellow};
    let pair = if first < second { (first, second) } else { (second, first) };
    matches!(
        pair,
        (White, Gray)
            | (Black, Gray)
            | (Orange, Brown)
            | (Brown, Yellow)
            | (Red, Brown)
            | (Red, Pink)
            | (Red, Orange)
            | (Orange, Yellow)
            | (Black, Brown)
            | (Brown, Beige)
            | (Yellow, Beige)
            | (White, Beige)
            | (Gray, Beige)
    )
}

/// What a view shows of a material.
struct Look {
    color: ColorName,
    is_grained: bool,
    is_woven: bool,
    is_streaked: bool,
    roughness: f32,
    highlights: f32,
}

/// The colours of bare wood and of wickerwork.
fn is_wood_colored(color: ColorName) -> bool {
    matches!(color, ColorName::Brown | ColorName::Beige | ColorName::Orange | ColorName::Yellow)
}

/// The prior's materials, the likeliest first, moved by what the pixels show, and those that the pixels show by themselves:
/// a bowl may be of wood though bowls are ceramic as a rule.
fn material_votes(category: Option<&Category>, look: &Look) -> Vec<(String, f32)> {
    let listed = category.map_or(&[] as &[String], |category| &category.materials);
    let shown = [("wood", look.is_grained), ("wicker", look.is_woven), ("metal", look.is_streaked)];
    let unlisted = shown.iter().filter(|(word, is_shown)| *is_shown && !listed.iter().any(|m| m == word));
    let unlisted: Vec<(String, f32)> = unlisted.map(|(word, _)| ((*word).to_owned(), SHOWN_WEIGHT)).collect();
    let bright = {
        use ColorName::{Blue, Cyan, Green, Pink, Purple, Red, Yellow};
        matches!(look.color, Red | Blue | Green | Yellow | Purple | Pink | Cyan)
    };
    let bare = is_wood_colored(look.color) && !look.is_grained;
    let votes = listed.iter().enumerate().map(|(rank, material)| {
        let prior = 1.0 / (1.0 + rank as f32);
        let seen = match material.as_str() {
            "metal" if look.is_streaked => SHOWN_WEIGHT,
            "wood" if look.is_grained => SHOWN_WEIGHT,
            "wicker" if look.is_woven => SHOWN_WEIGHT,
            "ceramic" | "plastic" | "glass" if look.is_streaked => -0.4,
            "metal" if look.color != ColorName::Gray => -0.4,
            "metal" => 0.6,
            // Wood in its own colour shows its grain, if it is near enough.
            "wood" if bare => -0.6,
            "wood" if bright => -0.3,
            "wood" if look.color == ColorName::Gray => -0.3,
            "glass" if look.highlights > 0.03 => 0.3,
            "ceramic" if look.color == ColorName::White => 0.4,
            "fabric" if look.roughness > ROUGH => 0.5,
            "plastic" | "fabric" if bright => 0.3,
            _ => 0.0,
        };
        (material.clone(), (prior + seen).max(0.05))
    });
    votes.chain(unlisted).collect()
}

fn smoothness_of(material: &str) -> Option<&'static str> {
    match material {
        "metal" | "steel" | "stainless steel" | "glass" | "ceramic" | "porcelain" | "plastic" => Some("smooth"),
        "wood" | "paper" | "cardboard" | "stone" => Some("even"),
        "fabric" | "cloth" | "cotton" | "wool" | "wicker" | "foam" => Some("soft"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    //! Contract: white things are white in dim light too, gray things are not, also when they fill half of the view.
    use super::*;
    use crate::camera::CameraModel;
    use crate::frame::{FrameId, RgbdFrame};
    use crate::time::Stamp;
    use nalgebra::Vector3;

    /// A thing of one colour that covers the left half, with a side in the shade, before a wall.
    fn name(thing: u8, wall: u8, light: f32) -> String {
        let shade = |value: u8, share: f32| [(f32::from(value) * share * light) as u8; 3];
        let color = (0..64 * 48).map(|pixel| match pixel % 64 {
            0..10 => shade(thing, 1.0),
            10..32 => shade(thing, 0.75),
            _ => shade(wall, 1.0),
        });
        let frame = RgbdFrame {
            id: FrameId(0),
            stamp: Stamp::default(),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(64, 48, 0.9),
            world_from_camera: crate::Pose::identity(),
            color: color.collect(),
            depth_m: vec![1.0; 64 * 48],
        };
        let pixels: Vec<u32> = (0..64 * 48).filter(|pixel| pixel % 64 < 32).collect();
        let view = ObjectView { frame: &frame, pixels: &pixels, name: "box", extent_m: Vector3::repeat(0.2) };
        let describer = KnowledgeDescriber::new(Arc::new(Knowledge::embedded().unwrap()));
        let votes = describer.describe(&view);
        let colors = votes.iter().filter(|vote| vote.key == "color");
        colors.max_by(|a, b| a.weight.total_cmp(&b.weight)).unwrap().word.clone()
    }

    #[test]
    fn dim_light_turns_no_white_thing_gray() {
        for light in [1.0, 0.8, 0.7] {
            assert_eq!(name(240, 205, light), "white", "light {light}");
            assert_eq!(name(125, 205, light), "gray", "light {light}");
            assert_eq!(name(160, 235, light), "gray", "light {light}");
        }
    }
}
