//! SAM 2 with boxes as prompts: the mask of what lies in a box.

use super::network::{Axis, Given, Network, NetworkError, Port};
use super::raster::{Filter, IMAGENET, Rgb, planes, resize};
use crate::networks::SegmenterSettings;
use dsm::perceive::Mask;
use rten::DataType;
use rten_tensor::Tensor;

const IMAGE: &[Port] = &[Port::new(&["image"], DataType::Float, &[Axis::Any, Axis::Is(3), Axis::Any, Axis::Any])];
const FEATURES: &[Port] = &[
    Port::new(&["high_res_feats_0"], DataType::Float, &[Axis::Any, Axis::Is(32), Axis::Any, Axis::Any]),
    Port::new(&["high_res_feats_1"], DataType::Float, &[Axis::Any, Axis::Is(64), Axis::Any, Axis::Any]),
    Port::new(&["image_embed"], DataType::Float, &[Axis::Any, Axis::Is(256), Axis::Any, Axis::Any]),
];
const PROMPT: &[Port] = &[
    Port::new(&["high_res_feats_0"], DataType::Float, &[Axis::Any, Axis::Is(32), Axis::Any, Axis::Any]),
    Port::new(&["high_res_feats_1"], DataType::Float, &[Axis::Any, Axis::Is(64), Axis::Any, Axis::Any]),
    Port::new(&["image_embed"], DataType::Float, &[Axis::Any, Axis::Is(256), Axis::Any, Axis::Any]),
    Port::new(&["point_coords"], DataType::Float, &[Axis::Any, Axis::Any, Axis::Is(2)]),
    Port::new(&["point_labels"], DataType::Float, &[Axis::Any, Axis::Any]),
    Port::new(&["mask_input"], DataType::Float, &[Axis::Any, Axis::Is(1), Axis::Any, Axis::Any]),
    Port::new(&["has_mask_input"], DataType::Float, &[Axis::Any]),
];
const MASKS: &[Port] = &[
    Port::new(&["masks"], DataType::Float, &[Axis::Any, Axis::Any, Axis::Any, Axis::Any]),
    Port::new(&["iou_predictions"], DataType::Float, &[Axis::Any, Axis::Any]),
];
/// Side of the picture where the network does not fix it, pixels.
const SIDE: usize = 1024;
/// What the corners of a box are called among prompts.
const CORNERS: [f32; 2] = [2.0, 3.0];

/// SAM 2: image encoder and mask decoder.
pub struct Sam2 {
    encoder: Network,
    decoder: Network,
    side: usize,
}

/// A picture as the decoder needs it.
pub struct Embedded {
    features: [Given; 3],
    picture: (u32, u32),
}

impl Sam2 {
    /// Opens encoder and decoder.
    ///
    /// # Errors
    /// [`NetworkError`].
    pub fn open(settings: &SegmenterSettings) -> Result<Self, NetworkError> {
        let encoder = Network::open(&settings.encoder, IMAGE, FEATURES)?;
        let side = encoder.find_length(0, 3).unwrap_or(SIDE);
        if side == 0 || side % 16 != 0 || side > 4096 || encoder.find_length(0, 2).unwrap_or(side) != side {
            return Err(NetworkError::Shape {
                file: settings.encoder.file.clone(),
                port: "input image".into(),
                expected: "a square whose side is a multiple of 16, at most 4096 pixels".into(),
                found: format!("{:?} rows of {side}", encoder.find_length(0, 2)),
            });
        }
        Ok(Self { encoder, decoder: Network::open(&settings.decoder, PROMPT, MASKS)?, side })
    }

    /// Side of the picture that it sees, pixels.
    pub fn side(&self) -> u32 {
        self.side as u32
    }

    /// What the encoder is given for a picture: `3 x side x side`, stretched.
    pub fn prepare(picture: &Rgb, side: u32) -> Vec<f32> {
        planes(&resize(picture, side, side, Filter::Bilinear), IMAGENET)
    }

    /// A box in pixels of the picture as the decoder is told it: two points of the square.
    pub fn prompt(corners: [f32; 4], picture: (u32, u32), side: u32) -> [f32; 4] {
        let scale = [picture.0, picture.1, picture.0, picture.1].map(|length| side as f32 / length.max(1) as f32);
        [0, 1, 2, 3].map(|k| corners[k] * scale[k])
    }

    /// Encodes a picture, once for all its boxes.
    ///
    /// # Errors
    /// [`NetworkError`] when the network does not run.
    pub fn embed(&self, picture: &Rgb) -> Result<Embedded, NetworkError> {
        let side = self.side;
        let pixels = Tensor::from_data(&[1, 3, side, side], Self::prepare(picture, side as u32));
        let mut given = self.encoder.run(vec![(0, pixels.into())])?.into_iter().flatten();
        let failed =
            || NetworkError::Run { file: self.encoder.file().to_owned(), reason: "an output is missing".into() };
        let mut next = |part: usize| -> Result<Given, NetworkError> {
            let given = given.next().ok_or_else(failed)?;
            if given.shape[2..] != [side / part, side / part] {
                return Err(NetworkError::Shape {
                    file: self.encoder.file().to_owned(),
                    port: "an output".into(),
                    expected: format!("[1, any, {0}, {0}]", side / part),
                    found: format!("{:?}", given.shape),
                });
            }
            Ok(given)
        };
        Ok(Embedded { features: [next(4)?, next(8)?, next(16)?], picture: (picture.width, picture.height) })
    }

    /// The mask of what lies in a box of the picture (left, top, right, bottom, pixels), and the overlap with the thing
    /// that the network expects of it, 0 to 1. Of several masks the one with the highest expectation.
    ///
    /// # Errors
    /// [`NetworkError`] when the network does not run.
    pub fn cut_out(&self, embedded: &Embedded, corners: [f32; 4]) -> Result<(Mask, f32), NetworkError> {
        let small = self.side / 4;
        let [high, middle, low] = &embedded.features;
        let tensor = |given: &Given| Tensor::from_data(&given.shape, given.values.clone());
        let points = Self::prompt(corners, embedded.picture, self.side as u32).to_vec();
        let given = self.decoder.run(vec![
            (0, tensor(high).into()),
            (1, tensor(middle).into()),
            (2, tensor(low).into()),
            (3, Tensor::from_data(&[1, 2, 2], points).into()),
            (4, Tensor::from_data(&[1, 2], CORNERS.to_vec()).into()),
            (5, Tensor::from_data(&[1, 1, small, small], vec![0.0_f32; small * small]).into()),
            (6, Tensor::from_data(&[1], vec![0.0_f32]).into()),
        ])?;
        let mut given = given.into_iter().flatten();
        let (Some(masks), Some(expected)) = (given.next(), given.next()) else {
            return Err(NetworkError::Run {
                file: self.decoder.file().to_owned(),
                reason: "an output is missing".into(),
            });
        };
        let count = masks.shape[1];
        if count == 0 || expected.shape != [1, count] || masks.shape[0] != 1 {
            return Err(NetworkError::Shape {
                file: self.decoder.file().to_owned(),
                port: "output iou_predictions".into(),
                expected: format!("[1, {count}], and at least one mask"),
                found: format!("{:?}", expected.shape),
            });
        }
        let sure = |place: &usize| Some(expected.values[*place]).filter(|value| value.is_finite()).unwrap_or(0.0);
        // Of equal expectations the first mask counts.
        let best = (0..count).reduce(|best, next| if sure(&next) > sure(&best) { next } else { best }).unwrap_or(0);
        let (rows, columns) = (masks.shape[2], masks.shape[3]);
        let logits = &masks.values[best * rows * columns..(best + 1) * rows * columns];
        Ok((mask_of(logits, (columns, rows), embedded.picture), sure(&best).clamp(0.0, 1.0)))
    }
}

/// A small picture of logits as a mask of a large one: bilinear between the middles of pixels, above 0.
pub fn mask_of(logits: &[f32], (columns, rows): (usize, usize), (width, height): (u32, u32)) -> Mask {
    if columns == 0 || rows == 0 {
        return Mask { image_width: width, runs: Vec::new() };
    }
    let across: Vec<(usize, usize, f32)> = (0..width).map(|x| between(x, width, columns)).collect();
    let mut inside: Vec<u32> = Vec::new();
    for y in 0..height {
        let (above, below, down) = between(y, height, rows);
        for (x, &(left, right, along)) in across.iter().enumerate() {
            let value = |row: usize, column: usize| logits[row * columns + column];
            let upper = value(above, left) * (1.0 - along) + value(above, right) * along;
            let lower = value(below, left) * (1.0 - along) + value(below, right) * along;
            if upper * (1.0 - down) + lower * down > 0.0 {
                inside.push(y * width + x as u32);
            }
        }
    }
    Mask::from_sorted_pixels(width, inside)
}

/// The two small pixels between whose middles the middle of a large pixel lies, and how far along.
fn between(place: u32, length: u32, small: usize) -> (usize, usize, f32) {
    let at = ((f64::from(place) + 0.5) * small as f64 / f64::from(length) - 0.5).clamp(0.0, (small - 1) as f64);
    let first = at.floor() as usize;
    (first, (first + 1).min(small - 1), (at - first as f64) as f32)
}
