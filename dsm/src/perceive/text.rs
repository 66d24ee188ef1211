//! The embedded text encoder: meaning from the knowledge table.

use super::{TextEncoder, normalize};
use crate::knowledge::Knowledge;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Values of a text feature. Directions of unrelated words then have cosines within about 0.09 (one sigma).
const DIMENSIONS: usize = 128;
/// Weight of each broader term beside the word itself: two words that share three broader terms reach about 0.4,
/// below the text threshold of 0.8, so that "related" is told from "same".
const BROADER: f32 = 0.45;
/// Weight of each modifier of a name that the table does not know, beside its head noun.
const MODIFIER: f32 = 0.35;

/// Synonyms give the same vector, words that share broader terms a middle cosine, unrelated words about 0. Each word
/// stands for a fixed random direction; a name is the normalized sum of its own direction and those of its hypernyms.
#[derive(Clone, Debug)]
pub struct KnowledgeTextEncoder {
    knowledge: Arc<Knowledge>,
}

impl KnowledgeTextEncoder {
    /// An encoder over a knowledge table.
    pub fn new(knowledge: Arc<Knowledge>) -> Self {
        Self { knowledge }
    }

    fn add_name(&self, sum: &mut [f32], name: &str, weight: f32) -> bool {
        let Some(category) = self.knowledge.find(name) else { return false };
        add_direction(sum, &category.name, weight);
        for broader in category.hypernyms.iter().take(3) {
            add_direction(sum, broader, weight * BROADER);
        }
        true
    }
}

/// Adds the fixed unit direction of a word: ChaCha keyed by its FNV-1a hash.
fn add_direction(sum: &mut [f32], word: &str, weight: f32) {
    let hash = word.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    let mut random = ChaCha8Rng::seed_from_u64(hash);
    let scale = weight / (DIMENSIONS as f32).sqrt();
    for value in sum {
        *value += if random.random::<bool>() { scale } else { -scale };
    }
}

impl TextEncoder for KnowledgeTextEncoder {
    fn encode(&self, text: &str) -> Vec<f32> {
        let mut sum = vec![0.0; DIMENSIONS];
        let text = text.trim().to_lowercase();
        if !self.add_name(&mut sum, &text, 1.0) {
            let words: Vec<&str> = text.split_whitespace().collect();
            if let Some((head, modifiers)) = words.split_last() {
                if !self.add_name(&mut sum, head, 1.0) {
                    add_direction(&mut sum, head, 1.0);
                }
                modifiers.iter().for_each(|word| add_direction(&mut sum, word, MODIFIER));
            }
        }
        normalize(sum)
    }
}
