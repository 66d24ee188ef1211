//! MiniLM as a text encoder: the mean of the last layer over the words.

use super::network::{Axis, Network, NetworkError, Port};
use super::vocabulary::Remembered;
use super::words::Words;
use crate::networks::NetworkFile;
use dsm::perceive::TextEncoder;
use rten::DataType;
use rten_tensor::Tensor;

const INPUTS: &[Port] = &[
    Port::new(&["input_ids"], DataType::Int32, &[Axis::Any, Axis::Any]),
    Port::new(&["attention_mask"], DataType::Int32, &[Axis::Any, Axis::Any]),
    Port::new(&["token_type_ids"], DataType::Int32, &[Axis::Any, Axis::Any]).or_none(),
];
const OUTPUTS: &[Port] = &[Port::new(
    &["last_hidden_state", "token_embeddings", "hidden_state"],
    DataType::Float,
    &[Axis::Any, Axis::Any, Axis::Is(384)],
)];
/// Longest sentence, tokens: what the model was trained with.
const MOST_TOKENS: usize = 256;
/// Length of a feature.
const LENGTH: usize = 384;

/// all-MiniLM-L6-v2 and its kin: features of 384 values.
pub struct MiniLm {
    network: Network,
    words: Words,
    known: Remembered,
}

impl MiniLm {
    /// Opens network and tokenizer.
    ///
    /// # Errors
    /// [`NetworkError`].
    pub fn open(network: &NetworkFile, tokenizer: &NetworkFile) -> Result<Self, NetworkError> {
        let network = Network::open(network, INPUTS, OUTPUTS)?;
        Ok(Self { network, words: Words::open(tokenizer, MOST_TOKENS)?, known: Remembered::default() })
    }

    /// The feature of a sentence, of unit length.
    ///
    /// # Errors
    /// [`NetworkError`] when the network does not run.
    pub fn feature(&self, text: &str) -> Result<Vec<f32>, NetworkError> {
        let ids = self.words.encode(text);
        let shape = [1, ids.len()];
        let (ones, zeros) = (vec![1_i32; ids.len()], vec![0_i32; ids.len()]);
        let given = self.network.run_one(vec![
            (0, Tensor::from_data(&shape, ids).into()),
            (1, Tensor::from_data(&shape, ones).into()),
            (2, Tensor::from_data(&shape, zeros).into()),
        ])?;
        Ok(unit(mean_over(&given.values, LENGTH)))
    }
}

impl TextEncoder for MiniLm {
    fn encode(&self, text: &str) -> Vec<f32> {
        self.known.find_or(text, || self.feature(text).unwrap_or_else(|_| vec![0.0; LENGTH]))
    }
}

/// Mean of rows of `length` values.
fn mean_over(values: &[f32], length: usize) -> Vec<f32> {
    let mut mean = vec![0.0_f32; length];
    let rows = values.chunks_exact(length);
    let count = rows.len().max(1) as f32;
    rows.for_each(|row| mean.iter_mut().zip(row).for_each(|(sum, value)| *sum += value));
    mean.iter_mut().for_each(|sum| *sum /= count);
    mean
}

/// The vector with length 1; one that has no length or is not finite becomes 0.
pub(super) fn unit(mut vector: Vec<f32>) -> Vec<f32> {
    let norm = vector.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    if !norm.is_finite() || norm <= 1e-12 {
        return vec![0.0; vector.len()];
    }
    vector.iter_mut().for_each(|x| *x = (f64::from(*x) / norm) as f32);
    vector
}
