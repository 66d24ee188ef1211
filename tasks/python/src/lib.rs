//! The Python package `dsm`: scenes, maps, grounding, skills and whole episodes for Python programs.
//!
//! ```text
//! Python ──arguments──▶ tasks ──▶ summary, map ──plain data──▶ Python
//!            ▲                └── frames as numpy arrays, moved and not copied
//!            └── detectors, language and drivers written in Python, called back
//! ```
//!
//! Invariants: nothing is decided here, every call hands on to the crates to the left; long calls release the interpreter
//! lock, and Ctrl-C ends them as it ends the command line; errors carry the same text as in Rust. Must not know: what a
//! scene truly holds, but by the judge's verdict.

mod builder;
mod detector;
mod driver;
mod episode;
mod error;
mod frame;
mod interrupt;
mod map;
mod plain;
mod plugged;
mod process;
#[cfg(feature = "mcap")]
mod recording;
mod senses;
mod session;
mod spec;
mod world;

use pyo3::prelude::*;

/// The compiled half of the package.
#[pymodule]
mod _dsm {
    #[pymodule_export]
    use super::builder::MapBuilder;
    #[pymodule_export]
    use super::detector::Detection;
    #[pymodule_export]
    use super::episode::{main, run_episode};
    #[pymodule_export]
    use super::error::{Error, InputError, RunError};
    #[pymodule_export]
    use super::frame::Frame;
    #[pymodule_export]
    use super::map::Map;
    #[cfg(feature = "mcap")]
    #[pymodule_export]
    use super::recording::{RecordedFrames, Recording};
    #[pymodule_export]
    use super::session::Session;
    #[pymodule_export]
    use super::world::World;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Robots that ship with the program are found from the same place.
        module.add("CHECKOUT", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
