//! Networks in ONNX files: what they are given, what they give, and what becomes of it (feature `onnx`).
//!
//! ```text
//! frame ──raster──▶ pixels as trained with ──Network──▶ numbers ──▶ boxes (yolo_world) ──▶ masks (sam2) ──▶ Detections
//! view  ──raster──▶                                              ──▶ feature (dinov2, siglip)
//! words ──words───▶ tokens                                       ──▶ feature (minilm, siglip, clip)
//! ```
//!
//! Invariants:
//! - A file is held to its checksum before it is read, and a network to the inputs and outputs that it must have before
//!   it runs; shapes that only show when it runs are checked then. What is wrong is told with file, port and shape.
//! - A network's numbers are data: what is not finite, out of the picture or of no known class becomes nothing.
//! - Equal frames and files give equal results.

mod clip;
mod detector;
mod dinov2;
mod minilm;
mod network;
mod open;
mod probe;
mod prompts;
mod raster;
mod sam2;
mod siglip;
mod vocabulary;
mod words;
mod yolo_world;

pub use clip::ClipText;
pub use detector::NetworkDetector;
pub use dinov2::Dinov2;
pub use minilm::MiniLm;
pub use network::{Axis, Given, Network, NetworkError, Port};
pub use open::{open_detector, open_text, open_visual};
pub use probe::{Probe, probe};
pub use raster::{Filter, Letterbox, Rgb, planes, resize, square_view};
pub use sam2::{Embedded, Sam2, mask_of};
pub use siglip::{SiglipImage, SiglipText, canonical};
pub use words::Words;
pub use yolo_world::{BoxFound, YoloWorld, keep_best};
