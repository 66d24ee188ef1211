//! DINOv2 as a visual encoder: the class token of the last layer.

use super::minilm::unit;
use super::network::{Axis, Network, NetworkError, Port};
use super::raster::{Filter, IMAGENET, Rgb, planes, resize, square_view};
use crate::networks::NetworkFile;
use dsm::perceive::{ObjectView, VisualEncoder};
use rten::DataType;
use rten_tensor::Tensor;

/// Side of the middle part that the network sees, and of the picture around it, pixels.
const SIDE: u32 = 224;
const AROUND: u32 = 256;
/// Patches along a side, and the class token.
const TOKENS: usize = 257;
/// So a thing fills the middle part.
const MARGIN: f64 = AROUND as f64 / SIDE as f64;
const INPUTS: &[Port] =
    &[Port::new(&["pixel_values"], DataType::Float, &[Axis::Any, Axis::Is(3), Axis::Any, Axis::Any])];
const OUTPUTS: &[Port] =
    &[Port::new(&["last_hidden_state"], DataType::Float, &[Axis::Any, Axis::Is(TOKENS), Axis::Any])];

/// DINOv2, of any size: features of 384, 768, 1024 or 1536 values.
pub struct Dinov2 {
    network: Network,
    length: usize,
}

impl Dinov2 {
    /// Opens the network, and runs it once: its width shows only then.
    ///
    /// # Errors
    /// [`NetworkError`].
    pub fn open(network: &NetworkFile) -> Result<Self, NetworkError> {
        let mut encoder = Self { network: Network::open(network, INPUTS, OUTPUTS)?, length: 0 };
        let grey = Rgb { width: AROUND, height: AROUND, color: vec![[114; 3]; (AROUND * AROUND) as usize] };
        encoder.length = encoder.feature(&grey)?.len();
        Ok(encoder)
    }

    /// What the network is given for a picture: the shorter side 256 pixels, of that the middle, `3 x 224 x 224`.
    pub fn prepare(picture: &Rgb) -> Vec<f32> {
        let shorter = picture.width.min(picture.height).max(1);
        let scaled = |length: u32| (u64::from(length) * u64::from(AROUND) / u64::from(shorter)) as u32;
        let around = resize(picture, scaled(picture.width), scaled(picture.height), Filter::Bicubic);
        let (left, top) = ((around.width - SIDE) / 2, (around.height - SIDE) / 2);
        let row = |row: u32| {
            let start = ((top + row) * around.width + left) as usize;
            around.color[start..start + SIDE as usize].iter().copied()
        };
        let color = (0..SIDE).flat_map(row).collect();
        planes(&Rgb { width: SIDE, height: SIDE, color }, IMAGENET)
    }

    /// The feature of a picture, of unit length.
    ///
    /// # Errors
    /// [`NetworkError`] when the network does not run.
    pub fn feature(&self, picture: &Rgb) -> Result<Vec<f32>, NetworkError> {
        let side = SIDE as usize;
        let pixels = Tensor::from_data(&[1, 3, side, side], Self::prepare(picture));
        let given = self.network.run_one(vec![(0, pixels.into())])?;
        let length = given.shape[2];
        Ok(unit(given.values[..length].to_vec()))
    }
}

impl VisualEncoder for Dinov2 {
    fn encode(&self, view: &ObjectView) -> Vec<f32> {
        picture_of(view, MARGIN)
            .and_then(|picture| self.feature(&picture).ok())
            .unwrap_or_else(|| vec![0.0; self.length])
    }
}

/// A thing in the middle of a square of its frame.
pub(super) fn picture_of(view: &ObjectView, margin: f64) -> Option<Rgb> {
    let (width, height) = (view.frame.model.width, view.frame.model.height);
    let places = || view.pixels.iter().map(|pixel| (pixel % width.max(1), pixel / width.max(1)));
    let bounds = (
        places().map(|(column, _)| column).min()?,
        places().map(|(_, row)| row).min()?,
        places().map(|(column, _)| column).max()?,
        places().map(|(_, row)| row).max()?,
    );
    Some(square_view(&view.frame.color, (width, height), bounds, margin))
}
