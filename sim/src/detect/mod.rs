//! The simulated detector: what a good open-vocabulary detector would say, with its errors.
//!
//! ```text
//! cameras ──labels by frame (private)──▶ masks ──merge, miss, split, borders, names, scores──▶ Detections
//! ```
//!
//! The label image never leaves this crate, and detections carry no identity: neither what they say nor their order
//! depends on label ids or body names.

mod channel;
mod names;
mod noise;
mod shape;
mod simulated;

pub use channel::LabelIds;
pub(crate) use channel::{LabelImage, LabelSender, label_channel};
pub use noise::DetectorNoise;
pub use simulated::{DetectorPreset, SimDetector};
