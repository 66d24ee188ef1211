//! SigLIP: pictures and words in one space.

use super::minilm::unit;
use super::network::{Axis, Network, NetworkError, Port};
use super::raster::{Filter, HALF, Rgb, planes, resize};
use super::vocabulary::Remembered;
use super::words::Words;
use crate::networks::NetworkFile;
use dsm::perceive::{ObjectView, TextEncoder, VisualEncoder};
use rten::DataType;
use rten_tensor::Tensor;

/// Side of the picture, pixels.
const SIDE: u32 = 224;
/// Tokens of a text, filled up with the word that ends it.
const TOKENS: usize = 64;
const END: i32 = 1;
/// Length of a feature.
const LENGTH: usize = 768;
/// How much of what is around a thing is shown with it.
const MARGIN: f64 = 1.1;
const IMAGE_INPUTS: &[Port] =
    &[Port::new(&["pixel_values"], DataType::Float, &[Axis::Any, Axis::Is(3), Axis::Is(224), Axis::Is(224)])];
const TEXT_INPUTS: &[Port] = &[Port::new(&["input_ids"], DataType::Int32, &[Axis::Any, Axis::Any])];
const OUTPUTS: &[Port] = &[Port::new(&["pooler_output"], DataType::Float, &[Axis::Any, Axis::Is(LENGTH)])];

/// The image tower of SigLIP base, 224 pixels.
pub struct SiglipImage {
    network: Network,
}

/// The text tower of SigLIP base.
pub struct SiglipText {
    network: Network,
    words: Words,
    known: Remembered,
}

impl SiglipImage {
    /// Opens the network.
    ///
    /// # Errors
    /// [`NetworkError`].
    pub fn open(network: &NetworkFile) -> Result<Self, NetworkError> {
        Ok(Self { network: Network::open(network, IMAGE_INPUTS, OUTPUTS)? })
    }

    /// What the network is given for a picture: `3 x 224 x 224`.
    pub fn prepare(picture: &Rgb) -> Vec<f32> {
        planes(&resize(picture, SIDE, SIDE, Filter::Bicubic), HALF)
    }

    /// The feature of a picture, of unit length.
    ///
    /// # Errors
    /// [`NetworkError`] when the network does not run.
    pub fn feature(&self, picture: &Rgb) -> Result<Vec<f32>, NetworkError> {
        let side = SIDE as usize;
        let pixels = Tensor::from_data(&[1, 3, side, side], Self::prepare(picture));
        Ok(unit(self.network.run_one(vec![(0, pixels.into())])?.values))
    }
}

impl VisualEncoder for SiglipImage {
    fn encode(&self, view: &ObjectView) -> Vec<f32> {
        super::dinov2::picture_of(view, MARGIN)
            .and_then(|picture| self.feature(&picture).ok())
            .unwrap_or_else(|| vec![0.0; LENGTH])
    }
}

impl SiglipText {
    /// Opens network and tokenizer.
    ///
    /// # Errors
    /// [`NetworkError`].
    pub fn open(network: &NetworkFile, tokenizer: &NetworkFile) -> Result<Self, NetworkError> {
        let network = Network::open(network, TEXT_INPUTS, OUTPUTS)?;
        Ok(Self { network, words: Words::open(tokenizer, TOKENS)?, known: Remembered::default() })
    }

    /// The feature of a text, of unit length.
    ///
    /// # Errors
    /// [`NetworkError`] when the network does not run.
    pub fn feature(&self, text: &str) -> Result<Vec<f32>, NetworkError> {
        let ids = self.words.encode_padded(&canonical(text), END);
        let tokens = Tensor::from_data(&[1, TOKENS], ids);
        Ok(unit(self.network.run_one(vec![(0, tokens.into())])?.values))
    }
}

impl TextEncoder for SiglipText {
    fn encode(&self, text: &str) -> Vec<f32> {
        let sentence = format!("This is a photo of {text}.");
        self.known.find_or(text, || self.feature(&sentence).unwrap_or_else(|_| vec![0.0; LENGTH]))
    }
}

/// A text as SigLIP was trained with: lower case, without punctuation, one blank between words.
pub fn canonical(text: &str) -> String {
    let plain: String = text.chars().filter(|c| !c.is_ascii_punctuation()).collect();
    plain.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ")
}
