//! The embedded describer: appearance from pixels, physical properties from geometry and prior, affordances from the
//! knowledge table.

use super::{AttributeVote, ColorName, ColorTable, Describer, ObjectView};
use crate::knowledge::{Category, Knowledge};
use crate::map::AttributeKind::{self, Affordance, Appearance, Physical};
use std::sync::Arc;

/// Share of the pixels from which a second colour makes the pattern multicolored.
const SECOND_COLOR: f32 = 0.25;
/// Mean lightness step between neighbouring pixels (CIELAB) from which a surface looks rough.
const ROUGH: f32 = 4.5;
/// Lightness spread (CIELAB, standard deviation) beyond shading from which a single-coloured surface is patterned.
const PATTERNED: f32 = 14.0;
/// Share of an object's pixels that are darker than its lit parts.
const LIT_SHARE: f32 = 0.8;
/// Lightness (CIELAB) of lit parts from which a thing without hue is white.
const WHITE: f32 = 76.0;
/// The same for what is about the lightest in view: dim light.
const DIM_WHITE: f32 = 55.0;
/// Share of the pixels of a frame that are darker than what counts as the lightest in view.
const LIGHTEST_SHARE: f32 = 0.95;
/// Lightness over that of the lightest in view from which a thing is about as light.
const AS_LIGHT: f32 = 0.9;
/// Pixels of a frame that are looked at for the lightest.
const REFERENCE_PIXELS: usize = 600;
/// Mean lightness step between neighbours of the same colour and lightness spread (CIELAB) from which a surface mirrors in
/// streaks.
const STREAKED_STEP: f32 = 2.3;
const STREAKED_SPREAD: f32 = 7.0;
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
    lightness_spread: f32,
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
        let (mut shares, mut sum, mut squares, mut steps, mut highlights) =
            ([0.0f32; ColorName::ALL.len()], 0.0, 0.0, 0.0, 0.0);
        let mut same = (0.0_f32, 0.0_f32);
        for &pixel in view.pixels {
            let pixel = pixel as usize;
            let color = self.colors.find(view.frame.color[pixel]);
            shares[color.name as usize] += 1.0;
            sum += color.lightness;
            squares += color.lightness * color.lightness;
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
        shares.iter_mut().for_each(|share| *share /= count);
        let mean = sum / count;
        self.settle_tone(view, &mut shares);
        PixelStatistics {
            shares,
            lightness_spread: (squares / count - mean * mean).max(0.0).sqrt(),
            roughness: steps / count,
            streaks: same.0 / same.1.max(1.0),
            highlights: highlights / count,
        }
    }

    /// Gives what is white or gray of a view to one of the two. Light only takes lightness away: a thing is as light as its
    /// lit parts, and what is about the lightest in view is white though the light be dim.
    fn settle_tone(&self, view: &ObjectView, shares: &mut [f32]) {
        let (white, gray) = (ColorName::White as usize, ColorName::Gray as usize);
        let both = shares[white] + shares[gray];
        if both == 0.0 {
            return;
        }
        let tones = view.pixels.iter().map(|pixel| self.colors.find(view.frame.color[*pixel as usize]));
        let tones = tones.filter(|color| matches!(color.name, ColorName::White | ColorName::Gray));
        let lit = find_quantile(tones.map(|color| color.lightness).collect(), LIT_SHARE);
        let step = view.frame.color.len().div_ceil(REFERENCE_PIXELS).max(1);
        let all = view.frame.color.iter().step_by(step).map(|pixel| self.colors.find(*pixel).lightness);
        let lightest = find_quantile(all.collect(), LIGHTEST_SHARE);
        let is_white = lit > WHITE || lit > DIM_WHITE && lit > AS_LIGHT * lightest;
        (shares[white], shares[gray]) = if is_white { (both, 0.0) } else { (0.0, both) };
    }
}

/// The value below which a share of the values lies; 0 for none.
fn find_quantile(mut values: Vec<f32>, share: f32) -> f32 {
    let index = (share * values.len() as f32) as usize;
    if index < values.len() { *values.select_nth_unstable_by(index, f32::total_cmp).1 } else { 0.0 }
}

impl Describer for KnowledgeDescriber {
    fn describe(&self, view: &ObjectView) -> Vec<AttributeVote> {
        let mut votes = Vec::new();
        let mut vote = |kind: AttributeKind, key: &'static str, word: &str, weight: f32| {
            votes.push(AttributeVote { kind, key, word: word.to_owned(), weight });
        };
        let category = self.knowledge.find(view.name);
        if !view.pixels.is_empty() {
            let statistics = self.measure(view);
            let mut ranked: Vec<_> = ColorName::ALL.into_iter().map(|n| (statistics.shares[n as usize], n)).collect();
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            ranked.iter().take(3).filter(|(share, _)| *share > 0.1).for_each(|(share, name)| {
                vote(Appearance, "color", name.word(), *share);
            });
            let pattern = match () {
                () if ranked[1].0 > SECOND_COLOR && !is_shade(ranked[0].1, ranked[1].1) => "multicolored",
                () if statistics.lightness_spread > PATTERNED => "patterned",
                () => "plain",
            };
            vote(Appearance, "pattern", pattern, 1.0);
            vote(Appearance, "texture", if statistics.roughness > ROUGH { "rough" } else { "smooth" }, 1.0);
            for (material, weight) in material_votes(category, ranked[0].1, &statistics) {
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

/// The prior's materials, the likeliest first, moved by what the pixels show.
fn material_votes(category: Option<&Category>, color: ColorName, statistics: &PixelStatistics) -> Vec<(String, f32)> {
    let Some(category) = category else { return Vec::new() };
    // Metal mirrors lights and windows as streaks of its own colour.
    let streaked = statistics.streaks > STREAKED_STEP && statistics.lightness_spread > STREAKED_SPREAD;
    category
        .materials
        .iter()
        .enumerate()
        .map(|(rank, material)| {
            let prior = 1.0 / (1.0 + rank as f32);
            let seen = match material.as_str() {
                "metal" | "steel" | "stainless steel" if streaked => 2.0,
                "ceramic" | "porcelain" | "plastic" | "glass" if streaked => -0.4,
                "metal" | "steel" | "stainless steel" if color != ColorName::Gray => -0.4,
                "wood" if matches!(color, ColorName::Brown | ColorName::Orange | ColorName::Beige) => 0.8,
                "wood" if matches!(color, ColorName::Gray) => -0.3,
                "metal" | "steel" | "stainless steel" if color == ColorName::Gray => 0.6,
                "metal" | "glass" if statistics.highlights > 0.03 => 0.3,
                "ceramic" | "porcelain" if color == ColorName::White => 0.4,
                "fabric" | "cloth" | "cotton" | "wool" if statistics.roughness > ROUGH => 0.5,
                "plastic"
                    if matches!(color, ColorName::Red | ColorName::Blue | ColorName::Green | ColorName::Yellow) =>
                {
                    0.3
                }
                _ => 0.0,
            };
            (material.clone(), (prior + seen).max(0.05))
        })
        .collect()
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
