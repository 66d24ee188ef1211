//! Homes to measure on, made from a seed: a floor plan, furniture that leaves paths free, and things on it.
//!
//! A scene is made as a draft of simple shapes and then written as the two texts that every scene consists of. The same
//! seed gives the same bytes. Nothing here touches a file: the caller writes what it gets.

mod articulate;
mod catalog;
mod clutter;
mod doors;
mod draft;
mod finish;
mod furnish;
mod furniture;
mod home;
mod ithor;
mod ithor_shape;
mod piece;
mod plan;
mod rooms;
mod texture;
mod things;
mod walkable;
mod write;

pub use home::{Doorways, Furniture, HomeConfig, generate_home};
pub use ithor::{ImportError, import_ithor};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

/// The generator of all draws of a scene.
type Draws = ChaCha8Rng;

/// A scene as files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GeneratedScene {
    /// Name of the scene.
    pub name: String,
    /// Path within the scene's folder, with `/`, and content; `scene.xml` and `semantics.toml` first.
    pub files: Vec<(String, Vec<u8>)>,
    /// Rooms.
    pub rooms: usize,
    /// Objects.
    pub objects: usize,
    /// Categories of objects.
    pub categories: usize,
}

/// Why no scene was made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum GenerateError {
    /// A number out of range.
    #[error("{name} is {value}; expected {low} to {high}")]
    OutOfRange {
        /// What.
        name: &'static str,
        /// Its value.
        value: u32,
        /// Smallest.
        low: u32,
        /// Largest.
        high: u32,
    },
    /// No draw gave a home that holds all that was asked for.
    #[error("{rooms} rooms hold {objects} objects at most with seed {seed}; ask for fewer objects or more rooms")]
    Full {
        /// Rooms asked for.
        rooms: usize,
        /// Objects that found a place.
        objects: usize,
        /// The seed.
        seed: u64,
    },
}

/// Independent draws for one part of a scene.
fn draws(seed: u64, part: u64) -> Draws {
    /// Keeps these apart from all other draws of a seed.
    const STREAM: u64 = 0x6765_6e65_7261_7465;
    let mut key = [0; 32];
    for (bytes, word) in key.chunks_exact_mut(8).zip([seed, STREAM, part, 0]) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

/// One of a list that is not empty.
fn draw_of<T: Copy>(list: &[T], rng: &mut Draws) -> T {
    list[rng.random_range(0..list.len())]
}
