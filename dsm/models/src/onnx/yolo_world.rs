//! YOLO-World: boxes of things by their names.

use super::clip::ClipText;
use super::network::{Axis, Given, Network, NetworkError, Port};
use super::raster::{Letterbox, Rgb, UNIT, planes};
use super::vocabulary::Remembered;
use crate::networks::DetectorSettings;
use rten::DataType;
use rten_tensor::{AsView, Tensor};

const INPUTS: &[Port] = &[
    Port::new(&["images"], DataType::Float, &[Axis::Any, Axis::Is(3), Axis::Any, Axis::Any]),
    Port::new(
        &["text_features", "txt_feats", "text_feats"],
        DataType::Float,
        &[Axis::Any, Axis::Any, Axis::Is(ClipText::LENGTH)],
    ),
];
/// Two ways of exporting: scores and corners apart, or centre, size and scores of each place in one column.
const OUTPUTS: &[Port] = &[
    Port::new(&["scores"], DataType::Float, &[Axis::Any, Axis::Any, Axis::Any]).or_none(),
    Port::new(&["boxes", "bboxes"], DataType::Float, &[Axis::Any, Axis::Any, Axis::Is(4)]).or_none(),
    Port::new(&["output0"], DataType::Float, &[Axis::Any, Axis::Any, Axis::Any]).or_none(),
];
/// Side of the picture where the network does not fix it, pixels.
const SIDE: usize = 640;
/// Prompts in one run where the network does not fix it.
const PROMPTS: usize = 256;
/// What the places of a network are filled with that no name needs.
const NO_NAME: &str = " ";
/// Boxes among which the best are chosen.
const MOST_CANDIDATES: usize = 1000;

/// A box with its name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxFound {
    /// Left, top, right, bottom in pixels of the picture.
    pub corners: [f32; 4],
    /// 0 to 1.
    pub score: f32,
    /// Place of the name in the list.
    pub name: usize,
}

/// YOLO-World with its text encoder.
pub struct YoloWorld {
    network: Network,
    text: ClipText,
    known: Remembered,
    side: u32,
    prompts: Option<usize>,
    least_score: f32,
    overlap: f32,
    most: usize,
}

impl YoloWorld {
    /// Opens detector, text encoder and tokenizer.
    ///
    /// # Errors
    /// [`NetworkError`].
    pub fn open(settings: &DetectorSettings) -> Result<Self, NetworkError> {
        let network = Network::open(&settings.network, INPUTS, OUTPUTS)?;
        let apart = network.has_output(0) && network.has_output(1);
        if !apart && !network.has_output(2) {
            return Err(NetworkError::NoPort {
                file: settings.network.file.clone(),
                what: "output",
                expected: vec!["scores and boxes".into(), "output0".into()],
                found: vec!["only one of scores and boxes, or neither".into()],
            });
        }
        let side = network.find_length(0, 3).unwrap_or(SIDE);
        if network.find_length(0, 2).unwrap_or(side) != side || side == 0 || side > 4096 {
            return Err(NetworkError::Shape {
                file: settings.network.file.clone(),
                port: "input images".into(),
                expected: "a square of at most 4096 pixels".into(),
                found: format!("{:?} rows of {side}", network.find_length(0, 2)),
            });
        }
        let prompts = network.find_length(1, 1);
        Ok(Self {
            text: ClipText::open(&settings.text, &settings.tokenizer)?,
            network,
            known: Remembered::default(),
            side: side as u32,
            prompts,
            least_score: settings.least_score,
            overlap: settings.overlap,
            most: settings.most as usize,
        })
    }

    /// Side of the picture that it sees, pixels.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// Looks for the names in a picture. Each place of the picture has one name, the likeliest; of boxes that overlap the
    /// surest stays, whatever their names, for a map has one thing in one place.
    ///
    /// # Errors
    /// [`NetworkError`] when a network does not run.
    pub fn find(&self, picture: &Rgb, names: &[String]) -> Result<Vec<BoxFound>, NetworkError> {
        if names.is_empty() || picture.color.is_empty() {
            return Ok(Vec::new());
        }
        let (letterbox, square) = Letterbox::of(picture, self.side);
        let side = self.side as usize;
        let pixels = planes(&square, UNIT);
        let images = Tensor::from_data(&[1, 3, side, side], pixels);
        let mut found: Vec<BoxFound> = Vec::new();
        for (part, names) in names.chunks(self.prompts.unwrap_or(PROMPTS).max(1)).enumerate() {
            let places = self.prompts.unwrap_or(names.len());
            let mut features = Vec::with_capacity(places * ClipText::LENGTH);
            for place in 0..places {
                features.extend(self.feature(names.get(place).map_or(NO_NAME, String::as_str))?);
            }
            let features = Tensor::from_data(&[1, places, ClipText::LENGTH], features);
            let given = self.network.run(vec![(0, images.view().into()), (1, features.into())])?;
            let first = part * self.prompts.unwrap_or(PROMPTS);
            let read = self.read(&given, places)?.into_iter().filter(|one| one.name < names.len());
            found.extend(read.map(|one| BoxFound { name: first + one.name, ..one }));
        }
        let size = (picture.width, picture.height);
        for one in &mut found {
            one.corners = letterbox.undo(one.corners, size);
        }
        found.retain(|one| one.corners[2] - one.corners[0] >= 1.0 && one.corners[3] - one.corners[1] >= 1.0);
        Ok(keep_best(found, self.overlap, self.most))
    }

    fn feature(&self, name: &str) -> Result<Vec<f32>, NetworkError> {
        let mut failure = None;
        let feature = self.known.find_or(name, || {
            self.text.feature(name).unwrap_or_else(|error| {
                failure = Some(error);
                vec![0.0; ClipText::LENGTH]
            })
        });
        failure.map_or(Ok(feature), Err)
    }

    /// Boxes of the square whose likeliest name is likely enough.
    fn read(&self, given: &[Option<Given>], names: usize) -> Result<Vec<BoxFound>, NetworkError> {
        let wrong = |port: &str, expected: String, found: &Given| NetworkError::Shape {
            file: self.network.file().to_owned(),
            port: format!("output {port}"),
            expected,
            found: format!("{:?}", found.shape),
        };
        match given {
            [Some(scores), Some(boxes), ..] => {
                let places = boxes.shape[1];
                if scores.shape != [1, places, names] || boxes.shape[0] != 1 {
                    return Err(wrong("scores", format!("[1, {places}, {names}]"), scores));
                }
                let corners = |place: usize| [0, 1, 2, 3].map(|k| boxes.values[4 * place + k]);
                let row = |place: usize| (0..names).map(move |name| scores.values[place * names + name]);
                Ok((0..places).filter_map(|place| self.best(row(place), corners(place))).collect())
            }
            [.., Some(columns)] => {
                let places = columns.shape[2];
                if columns.shape != [1, 4 + names, places] {
                    return Err(wrong("output0", format!("[1, {}, any]", 4 + names), columns));
                }
                let value = |row: usize, place: usize| columns.values[row * places + place];
                let corners = |place: usize| {
                    let [x, y, width, height] = [0, 1, 2, 3].map(|row| value(row, place));
                    [x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0]
                };
                let row = |place: usize| (0..names).map(move |name| value(4 + name, place));
                Ok((0..places).filter_map(|place| self.best(row(place), corners(place))).collect())
            }
            _ => Ok(Vec::new()),
        }
    }

    fn best(&self, scores: impl Iterator<Item = f32>, corners: [f32; 4]) -> Option<BoxFound> {
        let finite = scores.enumerate().filter(|(_, score)| score.is_finite());
        // Of equal scores the first name counts.
        let (name, score) = finite.reduce(|best, next| if next.1 > best.1 { next } else { best })?;
        let sound = corners.iter().all(|value| value.is_finite()) && corners[2] > corners[0] && corners[3] > corners[1];
        (score >= self.least_score && sound).then_some(BoxFound { corners, score: score.min(1.0), name })
    }
}

/// The surest boxes of which none overlaps a surer one by more than `overlap`, at most `most`, the surest first.
pub fn keep_best(mut found: Vec<BoxFound>, overlap: f32, most: usize) -> Vec<BoxFound> {
    // A stable sort: of equal scores the earlier box counts.
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found.truncate(MOST_CANDIDATES);
    let mut kept: Vec<BoxFound> = Vec::new();
    for one in found {
        if kept.len() == most {
            break;
        }
        if kept.iter().all(|surer| intersection_over_union(&surer.corners, &one.corners) <= overlap) {
            kept.push(one);
        }
    }
    kept
}

fn intersection_over_union(a: &[f32; 4], b: &[f32; 4]) -> f32 {
    let area = |c: &[f32; 4]| (c[2] - c[0]).max(0.0) * (c[3] - c[1]).max(0.0);
    let common = [a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])];
    let both = area(&common);
    both / (area(a) + area(b) - both).max(1e-9)
}
