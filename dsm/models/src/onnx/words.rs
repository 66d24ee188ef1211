//! Words as numbers, by the tokenizer that a text network was trained with.

use super::network::{NetworkError, read};
use crate::networks::NetworkFile;
use tokenizers::{Tokenizer, TruncationParams};

/// A tokenizer that cuts off what is too long.
pub struct Words {
    tokenizer: Tokenizer,
    most: usize,
}

impl Words {
    /// Opens a `tokenizer.json`; texts become at most `most` numbers.
    ///
    /// # Errors
    /// A file that cannot be read, another checksum, no tokenizer.
    pub fn open(file: &NetworkFile, most: usize) -> Result<Self, NetworkError> {
        let wrong = |reason: String| NetworkError::Tokenizer { file: file.file.clone(), reason };
        let mut tokenizer = Tokenizer::from_bytes(read(file)?).map_err(|error| wrong(error.to_string()))?;
        let truncation = TruncationParams { max_length: most, ..TruncationParams::default() };
        tokenizer.with_truncation(Some(truncation)).map_err(|error| wrong(error.to_string()))?;
        tokenizer.with_padding(None);
        Ok(Self { tokenizer, most })
    }

    /// The numbers of a text, with those that begin and end it.
    pub fn encode(&self, text: &str) -> Vec<i32> {
        let encoding = self.tokenizer.encode(text, true);
        encoding.map(|encoding| encoding.get_ids().iter().map(|id| *id as i32).collect()).unwrap_or_default()
    }

    /// The same, filled up with `padding` to the greatest length.
    pub fn encode_padded(&self, text: &str, padding: i32) -> Vec<i32> {
        let mut ids = self.encode(text);
        ids.resize(self.most, padding);
        ids
    }

    /// The number of a word that the tokenizer knows as a whole.
    pub fn find(&self, word: &str) -> Option<i32> {
        self.tokenizer.token_to_id(word).map(|id| id as i32)
    }
}
