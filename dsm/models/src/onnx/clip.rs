//! CLIP's text encoder, as YOLO-World is told names.

use super::minilm::unit;
use super::network::{Axis, Network, NetworkError, Port};
use super::words::Words;
use crate::networks::NetworkFile;
use rten::DataType;
use rten_tensor::Tensor;

/// Tokens of a text, by which the model was trained.
const TOKENS: usize = 77;
/// What ends a text, and fills it up.
const END: &str = "<|endoftext|>";
const INPUTS: &[Port] = &[
    Port::new(&["input_ids", "input"], DataType::Int32, &[Axis::Any, Axis::Any]),
    Port::new(&["attention_mask"], DataType::Int32, &[Axis::Any, Axis::Any]).or_none(),
];
const OUTPUTS: &[Port] =
    &[Port::new(&["text_embeds", "output"], DataType::Float, &[Axis::Any, Axis::Is(ClipText::LENGTH)])];

/// CLIP ViT-B/32's text encoder: features of 512 values.
pub struct ClipText {
    network: Network,
    words: Words,
    end: i32,
}

impl ClipText {
    /// Length of a feature.
    pub const LENGTH: usize = 512;

    /// Opens network and tokenizer.
    ///
    /// # Errors
    /// [`NetworkError`]; a tokenizer without the word that ends a text.
    pub fn open(network: &NetworkFile, tokenizer: &NetworkFile) -> Result<Self, NetworkError> {
        let words = Words::open(tokenizer, TOKENS)?;
        let end = words.find(END).ok_or_else(|| NetworkError::Tokenizer {
            file: tokenizer.file.clone(),
            reason: format!("it does not know {END}"),
        })?;
        Ok(Self { network: Network::open(network, INPUTS, OUTPUTS)?, words, end })
    }

    /// The feature of a text, of unit length.
    ///
    /// # Errors
    /// [`NetworkError`] when the network does not run.
    pub fn feature(&self, text: &str) -> Result<Vec<f32>, NetworkError> {
        let length = self.words.encode(text).len();
        let ids = self.words.encode_padded(text, self.end);
        let mask: Vec<i32> = (0..TOKENS).map(|place| i32::from(place < length)).collect();
        let shape = [1, TOKENS];
        let given = self
            .network
            .run_one(vec![(0, Tensor::from_data(&shape, ids).into()), (1, Tensor::from_data(&shape, mask).into())])?;
        Ok(unit(given.values))
    }
}
