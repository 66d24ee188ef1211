//! Messages of ROS 2 (Jazzy), field by field as their definitions state them. Their bytes on the wire are CDR: fields in
//! order, aligned to their own size.
//!
//! `tests/cdr.rs` holds each against bytes made by another implementation.

mod control;
mod definitions;
mod geometry;
mod lockstep;
mod sensor;
mod standard;
mod tasks;
mod vision;

pub use control::*;
pub use definitions::find_definition;
pub use geometry::*;
pub use lockstep::*;
pub use sensor::*;
pub use standard::*;
pub use tasks::*;
pub use vision::*;

/// A message with its name in ROS 2.
pub trait RosMessage: serde::Serialize + serde::de::DeserializeOwned + Clone + Send + 'static {
    /// The package that defines it.
    const PACKAGE: &'static str;
    /// Its name in that package.
    const NAME: &'static str;
}

/// Names messages by their package.
macro_rules! named {
    ($package:literal: $($message:ident),+ $(,)?) => {
        $(impl crate::messages::RosMessage for $message {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = stringify!($message);
        })+
    };
}
use named;
