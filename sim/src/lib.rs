//! The simulated world: scenes, physics, cameras, sensor noise, simulated drivers and the simulated detector.
//!
//! ```text
//! scene.xml + semantics.toml ──load──▶ SceneModel ──▶ Physics ──poses──▶ cameras ──noise──▶ RgbdFrame
//!                                                        ▲                  └─labels (private)──▶ SimDetector
//! commands ──drivers──────────────────────────────────────┘
//! ```
//!
//! Invariants: physics moves things and friction holds them; the label image never leaves this crate; observing never
//! steps physics. The crate does not know what a map or a task is.

pub mod camera;
pub mod detect;
pub mod disturb;
pub mod physics;
pub mod replay;
pub mod robot;
pub mod scene;
pub mod world;
