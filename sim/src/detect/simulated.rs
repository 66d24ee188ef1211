//! The detector itself.

use super::channel::{LabelImage, LabelReceiver};
use super::names::Names;
use super::noise::{DetectorNoise, Draws, Event};
use super::shape::{disturb_border, split, union};
use crate::scene::{SceneModel, Semantics};
use dsm::frame::RgbdFrame;
use dsm::perceive::{Detection, Detections, Detector, Mask};
use nalgebra::Vector3;
use rand_distr::{Distribution, Normal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Number of view sectors around an object: 30 degrees each.
const SECTORS: f64 = 12.0;
/// Masks smaller than this are not reported by any preset, pixels.
const LEAST_AREA_PX: usize = 25;
/// Two masks can merge only when their border is at least this long, pixels.
const LEAST_COMMON_BORDER_PX: usize = 10;
/// ... and their mean depths differ by no more than this, metres.
const MERGE_DEPTH_M: f64 = 0.4;

/// How good the detector is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DetectorPreset {
    /// Errors as of a good open-vocabulary detector (the default).
    #[default]
    Noisy,
    /// Perfect masks and names, for comparison.
    Oracle,
}

/// Says what a frame of a simulated camera shows.
pub struct SimDetector {
    labels: LabelReceiver,
    /// Category of each scene body; `None` for what is no object.
    categories: Vec<Option<String>>,
    names: Names,
    /// `None` for the oracle.
    noise: Option<DetectorNoise>,
    seed: u64,
}

/// One object in one frame on its way to a detection.
struct Candidate {
    mask: Mask,
    draws: Draws,
    /// Category that the name is drawn for: of the larger thing when two merged.
    category_of: usize,
    doubtful: bool,
}

impl SimDetector {
    /// A detector at the end of a label channel.
    pub(crate) fn new(
        labels: LabelReceiver,
        scene: &SceneModel,
        semantics: &Semantics,
        preset: DetectorPreset,
        seed: u64,
    ) -> Self {
        let category = |name: &str| semantics.find_object(name).map(|object| object.category.clone());
        Self {
            labels,
            categories: scene.bodies.iter().map(|body| category(&body.name)).collect(),
            names: Names::embedded(),
            noise: match preset {
                DetectorPreset::Noisy => Some(DetectorNoise::default()),
                DetectorPreset::Oracle => None,
            },
            seed,
        }
    }

    /// The visible pixels of every object, by place in the scene.
    fn collect_masks(&self, image: &LabelImage) -> BTreeMap<usize, Mask> {
        let mut masks: BTreeMap<usize, Mask> = BTreeMap::new();
        for run in &image.runs {
            let Some(body) = image.find_body(run.label) else { continue };
            if self.categories.get(body).is_some_and(Option::is_some) {
                let mask = masks.entry(body).or_insert_with(|| Mask { image_width: image.width, runs: Vec::new() });
                mask.runs.push(dsm::perceive::Run { start: run.start, length: run.length });
            }
        }
        masks.retain(|_, mask| mask.area() >= LEAST_AREA_PX);
        masks
    }

    fn category(&self, body: usize) -> &str {
        self.categories.get(body).and_then(Option::as_deref).unwrap_or_default()
    }

    fn draw_name(&self, candidate: &Candidate, noise: &DetectorNoise) -> (String, bool) {
        let category = self.category(candidate.category_of);
        let confused = candidate.draws.find_event(Event::Confusion, noise.confusion_rate);
        if let Some(other) = confused.and_then(|mut stream| self.names.find_lookalike(category, &mut stream)) {
            return (other.to_owned(), true);
        }
        let reworded = candidate.draws.find_event(Event::Synonym, noise.synonym_rate);
        let word = reworded.and_then(|mut stream| self.names.find_synonym(category, &mut stream));
        (word.unwrap_or(category).to_owned(), false)
    }

    /// What the noisy detector makes of the true masks.
    fn disturb(
        &self,
        masks: BTreeMap<usize, Mask>,
        image: &LabelImage,
        frame: &RgbdFrame,
        noise: &DetectorNoise,
    ) -> Vec<Detection> {
        let mut items = Vec::new();
        let dark = noise.miss_in_dark(brightness(frame));
        for candidate in self.merge(masks, image, frame, noise) {
            let miss = noise.miss_probability(candidate.mask.area()).max(dark);
            if candidate.draws.find_event(Event::Miss, miss).is_some() {
                continue;
            }
            let (name, confused) = self.draw_name(&candidate, noise);
            let halves = candidate.draws.find_event(Event::Split, noise.split_rate);
            let doubtful = confused || candidate.doubtful || halves.is_some();
            let parts = match halves {
                Some(mut stream) => split(&candidate.mask, &mut stream).to_vec(),
                None => vec![candidate.mask],
            };
            let mut border = candidate.draws.either(Event::Border);
            let mut scores = candidate.draws.in_frame(Event::Score);
            for part in parts {
                let mask = disturb_border(&part, image.height, noise.border_px, &mut border);
                let area = mask.area();
                if area < LEAST_AREA_PX {
                    continue;
                }
                // Small and doubtful masks score lower, with a spread that lets scores overlap.
                let spread: f64 = Normal::new(0.0, 0.06).map_or(0.0, |normal| normal.sample(&mut scores));
                let small = 0.25 * (-(area as f64) / 600.0).exp();
                let doubt = if doubtful { 0.15 } else { 0.0 };
                let score = (0.9 - small - doubt + spread).clamp(0.05, 0.99) as f32;
                items.push(Detection { mask, name: name.clone(), score });
            }
        }
        items
    }

    /// Joins masks that the detector takes for one thing; the rest pass in the order of the scene.
    fn merge(
        &self,
        masks: BTreeMap<usize, Mask>,
        image: &LabelImage,
        frame: &RgbdFrame,
        noise: &DetectorNoise,
    ) -> Vec<Candidate> {
        let mut candidates: BTreeMap<usize, Candidate> = BTreeMap::new();
        for (body, mask) in masks {
            let sector = view_sector(&mask, frame);
            let draws = Draws { seed: self.seed, frame: frame.id.0, body: body as u64, sector };
            candidates.insert(body, Candidate { mask, draws, category_of: body, doubtful: false });
        }
        let greedy: Vec<usize> = candidates
            .iter()
            .filter(|(_, candidate)| candidate.draws.find_event(Event::Merge, noise.merge_rate).is_some())
            .map(|(body, _)| *body)
            .collect();
        let grid = if greedy.is_empty() { Vec::new() } else { body_grid(image) };
        for body in greedy {
            // Swallowed by an earlier one.
            let Some(mut candidate) = candidates.remove(&body) else { continue };
            let neighbour = find_neighbour(&candidate.mask, &candidates, &grid, frame);
            if let Some((neighbour, other)) = neighbour.and_then(|n| Some((n, candidates.remove(&n)?))) {
                if other.mask.area() > candidate.mask.area() {
                    candidate.category_of = neighbour;
                }
                candidate.mask = union(&candidate.mask, &other.mask);
                candidate.doubtful = true;
            }
            candidates.insert(body, candidate);
        }
        candidates.into_values().collect()
    }
}

impl Detector for SimDetector {
    fn name(&self) -> &str {
        "simulated"
    }

    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        let Some(image) = self.labels.take(frame.id) else {
            return Detections { frame: frame.id, items: Vec::new() };
        };
        let masks = self.collect_masks(&image);
        let mut items = match self.noise {
            Some(noise) => self.disturb(masks, &image, frame, &noise),
            None => masks
                .into_iter()
                .map(|(body, mask)| Detection { mask, name: self.category(body).to_owned(), score: 1.0 })
                .collect(),
        };
        // An order that tells nothing about which body is which.
        items.sort_by_key(|item| (item.mask.runs.first().map(|run| run.start), item.mask.area()));
        Detections { frame: frame.id, items }
    }
}

/// How bright the brightest twentieth of a picture is at least, 0 to 255: whether there is light, whatever it falls on. A
/// frame without colours counts as lit.
fn brightness(frame: &RgbdFrame) -> u8 {
    const EVERY: usize = 61;
    const SHARE: usize = 20;
    let mut greens: Vec<u8> = frame.color.iter().step_by(EVERY).map(|[_, green, _]| *green).collect();
    let rank = greens.len() - greens.len().div_ceil(SHARE);
    if greens.is_empty() { u8::MAX } else { *greens.select_nth_unstable(rank).1 }
}

/// From which of twelve directions in the floor plane the camera looks at the mask.
fn view_sector(mask: &Mask, frame: &RgbdFrame) -> u64 {
    let width = mask.image_width as usize;
    let count = mask.area().max(1) as f64;
    let (x, y) = mask.pixels().fold((0.0, 0.0), |(x, y), p| (x + (p % width) as f64, y + (p / width) as f64));
    let ray = frame.model.back_project((x / count) as u32, (y / count) as u32, 1.0).coords;
    let to_camera: Vector3<f64> = -(frame.world_from_camera.rotation * ray);
    let turn = to_camera.y.atan2(to_camera.x) / (2.0 * PI) + 0.5;
    ((turn * SECTORS) as u64).min(SECTORS as u64 - 1)
}

/// Scene body + 1 of every pixel; 0 for what is no body.
fn body_grid(image: &LabelImage) -> Vec<u32> {
    let mut grid = vec![0; (image.width * image.height) as usize];
    for run in &image.runs {
        if let Some(body) = image.find_body(run.label) {
            grid[run.start as usize..(run.start + run.length) as usize].fill(body as u32 + 1);
        }
    }
    grid
}

/// The object with the longest common border in the image at about the same depth; ties go to the first in the scene.
fn find_neighbour(mask: &Mask, others: &BTreeMap<usize, Candidate>, grid: &[u32], frame: &RgbdFrame) -> Option<usize> {
    let width = mask.image_width as usize;
    let mut borders: BTreeMap<usize, usize> = BTreeMap::new();
    for pixel in mask.pixels() {
        let own = grid[pixel];
        let column = pixel % width;
        let beside = [
            (column + 1 < width).then(|| pixel + 1),
            column.checked_sub(1).map(|_| pixel - 1),
            Some(pixel + width),
            pixel.checked_sub(width),
        ];
        for other in beside.into_iter().flatten().filter_map(|p| grid.get(p)).filter(|o| **o != 0 && **o != own) {
            *borders.entry(*other as usize - 1).or_insert(0) += 1;
        }
    }
    let depth = find_mean_depth_m(mask, frame)?;
    let fits = |body: usize| {
        let other = others.get(&body).and_then(|other| find_mean_depth_m(&other.mask, frame));
        other.is_some_and(|other| (other - depth).abs() <= MERGE_DEPTH_M)
    };
    let long = borders.into_iter().filter(|(body, length)| *length >= LEAST_COMMON_BORDER_PX && fits(*body));
    long.max_by_key(|(body, length)| (*length, std::cmp::Reverse(*body))).map(|(body, _)| body)
}

/// Mean of every seventh depth that returned.
fn find_mean_depth_m(mask: &Mask, frame: &RgbdFrame) -> Option<f64> {
    let depths = mask.pixels().step_by(7).filter_map(|p| frame.depth_m.get(p)).filter(|d| **d > 0.0);
    let (sum, count) = depths.fold((0.0, 0), |(sum, count), depth| (sum + f64::from(*depth), count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    //! Contract: the oracle says what is there; the noisy detector errs at its rates; ids and body names change nothing.
    use super::super::channel::{LabelIds, label_channel};
    use super::*;
    use crate::camera::ROBOT_LABEL;
    use crate::scene::{BodyMotion, ObjectSemantics, SceneBody};
    use dsm::Pose;
    use dsm::camera::CameraModel;
    use dsm::frame::FrameId;
    use dsm::time::Stamp;

    const WIDTH: u32 = 320;
    const HEIGHT: u32 = 240;

    /// A world of `count` bodies after the world body; body i is an apple or a book.
    fn world(count: usize, prefix: &str) -> (SceneModel, Semantics) {
        let body = |name: String| SceneBody {
            name,
            world_from_body: Pose::identity(),
            motion: BodyMotion::Fixed,
            mass_kg: 0.0,
            spread: None,
            geoms: vec![],
        };
        let bodies: Vec<SceneBody> = (0..=count).map(|i| body(format!("{prefix}{i}"))).collect();
        let objects = bodies.iter().enumerate().skip(1).map(|(i, b)| ObjectSemantics {
            body: b.name.clone(),
            category: if i % 2 == 0 { "apple" } else { "book" }.to_owned(),
            ..ObjectSemantics::default()
        });
        let semantics = Semantics { version: 1, objects: objects.collect(), ..Semantics::default() };
        let scene = SceneModel {
            name: "t".to_owned(),
            bodies,
            materials: vec![],
            textures: vec![],
            meshes: vec![],
            lights: vec![],
            ..SceneModel::default()
        };
        (scene, semantics)
    }

    /// Squares of 30 pixels in a grid, one per body, with one pixel of wall between; turned by `yaw` about the vertical.
    fn frame(id: u64, yaw_rad: f64, count: usize) -> (RgbdFrame, Vec<u32>) {
        let mut labels = vec![1; (WIDTH * HEIGHT) as usize];
        for body in 1..=count as u32 {
            let (left, top) = ((body - 1) % 10 * 31, (body - 1) / 10 * 31);
            for row in top..top + 30 {
                for column in left..left + 30 {
                    labels[(row * WIDTH + column) as usize] = body + 1;
                }
            }
        }
        labels[(WIDTH * HEIGHT) as usize - 2000..].fill(ROBOT_LABEL);
        let frame = RgbdFrame {
            id: FrameId(id),
            stamp: Stamp::default(),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(WIDTH, HEIGHT, 0.2),
            world_from_camera: Pose::rotation(Vector3::z() * yaw_rad) * Pose::rotation(Vector3::x() * -PI / 2.0),
            color: vec![],
            depth_m: vec![1.0; (WIDTH * HEIGHT) as usize],
        };
        (frame, labels)
    }

    fn detect_all(preset: DetectorPreset, ids: LabelIds, prefix: &str, frames: u64) -> Vec<Detections> {
        let (scene, semantics) = world(60, prefix);
        let (sender, receiver) = label_channel(ids);
        let mut detector = SimDetector::new(receiver, &scene, &semantics, preset, 11);
        let all = (0..frames).map(|id| {
            let (frame, labels) = frame(id, id as f64 * 0.55, 60);
            sender.send(frame.id, LabelImage::encode(WIDTH, &labels));
            detector.detect(&frame)
        });
        all.collect()
    }

    #[test]
    fn the_oracle_reports_every_object_and_neither_walls_nor_robot() {
        let seen = &detect_all(DetectorPreset::Oracle, LabelIds::Stable, "b", 1)[0];
        assert_eq!(seen.items.len(), 60);
        assert!(seen.items.iter().all(|item| item.mask.area() == 900 && item.score == 1.0));
        assert_eq!(seen.items.iter().filter(|item| item.name == "apple").count(), 30);
    }

    #[test]
    fn neither_label_ids_nor_body_names_change_a_detection() {
        let plain = detect_all(DetectorPreset::Noisy, LabelIds::Stable, "b", 8);
        assert_eq!(plain, detect_all(DetectorPreset::Noisy, LabelIds::PermutedPerFrame, "zz_other", 8));
        assert!(plain.iter().all(|seen| seen.items.len() > 40));
    }

    #[test]
    fn the_noisy_detector_errs_at_its_rates() {
        let frames = 48;
        let all = detect_all(DetectorPreset::Noisy, LabelIds::Stable, "b", frames);
        let truth = 60.0 * frames as f64;
        let items = || all.iter().flat_map(|seen| &seen.items);
        // Split masks are half as large, missed ones absent; squares do not touch, so nothing merges.
        let whole = items().filter(|item| item.mask.area() > 500).count() as f64;
        assert!((0.85..=0.95).contains(&(whole / truth)), "{}", whole / truth);
        let known = ["apple", "book", "red delicious apple", "fruit apple", "hardcover book", "volume"];
        let confused = items().filter(|item| !known.contains(&item.name.as_str())).count() as f64;
        assert!((0.025..=0.085).contains(&(confused / truth)), "{}", confused / truth);
        let synonyms = items().filter(|item| known[2..].contains(&item.name.as_str())).count() as f64;
        assert!((0.14..=0.26).contains(&(synonyms / truth)), "{}", synonyms / truth);
        assert!(items().all(|item| item.score >= 0.05 && item.score < 1.0));
    }

    #[test]
    fn nothing_is_found_in_the_dark() {
        let (scene, semantics) = world(60, "b");
        let (sender, receiver) = label_channel(LabelIds::Stable);
        let mut detector = SimDetector::new(receiver, &scene, &semantics, DetectorPreset::Noisy, 11);
        for (id, level, found) in [(0, 200, true), (1, 8, false)] {
            let (mut frame, labels) = frame(id, 0.0, 60);
            frame.color = vec![[level; 3]; labels.len()];
            sender.send(frame.id, LabelImage::encode(WIDTH, &labels));
            assert_eq!(!detector.detect(&frame).items.is_empty(), found, "brightness {level}");
        }
    }

    #[test]
    fn frames_from_elsewhere_show_nothing() {
        let (scene, semantics) = world(3, "b");
        let (_sender, receiver) = label_channel(LabelIds::Stable);
        let mut detector = SimDetector::new(receiver, &scene, &semantics, DetectorPreset::Noisy, 1);
        assert!(detector.detect(&frame(5, 0.0, 3).0).items.is_empty());
    }

    #[test]
    fn touching_things_merge_now_and_then_and_take_the_larger_one_s_name() {
        let (scene, semantics) = world(2, "b");
        let (sender, receiver) = label_channel(LabelIds::Stable);
        let mut detector = SimDetector::new(receiver, &scene, &semantics, DetectorPreset::Noisy, 3);
        let mut merged = 0;
        for id in 0..1000 {
            let (frame, mut labels) = frame(id, id as f64, 0);
            for row in 50..110 {
                labels[(row * WIDTH + 40) as usize..(row * WIDTH + 80) as usize].fill(2);
                labels[(row * WIDTH + 80) as usize..(row * WIDTH + 180) as usize].fill(3);
            }
            sender.send(frame.id, LabelImage::encode(WIDTH, &labels));
            let seen = detector.detect(&frame);
            let joined: Vec<_> = seen.items.iter().filter(|item| item.mask.area() > 7500).collect();
            merged += joined.len();
            assert!(joined.iter().all(|item| !item.name.contains("book") || item.score < 0.9));
        }
        // Either of the two may swallow the other: about 6 % of the frames, half of it bound to a few sectors.
        assert!((15..=150).contains(&merged), "{merged}");
    }
}
