//! Grasp planning on the fused cloud of an object.
//!
//! ```text
//! Map ──▶ GraspScene ──fit shape, antipodal pairs──▶ candidates ──hand, support, reach──▶ GraspPlan ──▶ placements
//!                                                        wrist camera's cloud ──refine──▶ GraspCandidate
//! ```
//!
//! Handles are found by shape alone: [`find_front`] and [`find_handles`] on a fresh cloud.
//!
//! The tool frame lies midway between the finger pads: +z is the approach direction, +y the closing direction.
//! Everything here is a function of its inputs.

mod antipodal;
mod candidates;
mod cloud;
mod config;
mod contact;
mod hand;
mod handle;
mod placement;
mod refine;
mod scene;
mod shape;

pub use candidates::{Approach, GraspCandidate, GraspPlan, GraspScores, RejectReason, plan_grasps};
pub use config::{GraspConfig, HandConfig};
pub use handle::{Front, Handle, find_front, find_handles};
pub use placement::{Placement, PlacementConfig, find_placements};
pub use refine::{Refinement, refine_grasp};
pub use scene::{ApproachFrom, GraspScene};
pub use shape::Shape;
