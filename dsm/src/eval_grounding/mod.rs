//! Measures grounding on referring expressions over known boxes (Nr3D, Sr3D, ScanRefer in one line-based format).
//!
//! A scene's boxes are imported as a map and grounded by the code that serves the robot. Only the utterance and the
//! scene's boxes reach it; truth is read by [`evaluate`] alone, after the answer.

mod classes;
mod csv;
mod data;
mod evaluate;
mod fit;
mod published;

pub use classes::{Failure, list_failures};
pub use csv::CsvError;
pub use data::{BoxObject, DataError, QueryLine, SceneLine, TargetBox, read_queries, read_scenes};
pub use evaluate::{Prediction, Rate, Report, TimeUs, evaluate, find_contradiction};
pub use fit::{cross_validate, fit_all, fold_of, write_weights};
pub use published::{PublishedError, read_referit3d, read_scanrefer};
