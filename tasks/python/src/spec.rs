//! What a run is made with, from what Python gives.

use crate::episode::choice;
use crate::error::InputError;
use crate::plain::from_python;
use dsm_tasks::cli::{PerceptionChoice, PhysicsChoice, WorldArgs, prepare};
use dsm_tasks::episode::{Episode, Expectation, Start};
use dsm_tasks::error::TaskError;
use dsm_tasks::language::find_language;
use dsm_tasks::run::RunSpec;
use dsm_tasks::settings::Settings;
use pyo3::prelude::*;
use std::path::PathBuf;

/// What a world or a session is asked to be made with.
pub(crate) struct Asked {
    path: PathBuf,
    world: WorldArgs,
    start: Option<Start>,
    expectations: Option<Vec<Expectation>>,
}

impl Asked {
    /// Checks what can be checked without a scene.
    pub(crate) fn new(
        path: PathBuf,
        seed: Option<u64>,
        robot: Option<String>,
        physics: Option<&str>,
        perception: Option<&str>,
        start: Option<(f64, f64, f64)>,
        expect: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let world = WorldArgs {
            seed,
            robot,
            physics: physics.map(|name| choice::<PhysicsChoice>("physics", name)).transpose()?,
            perception: perception.map(|name| choice::<PerceptionChoice>("perception", name)).transpose()?,
            ..WorldArgs::default()
        };
        let start = start.map(|(x_m, y_m, yaw_rad)| Start { x_m, y_m, yaw_rad });
        if start.is_some_and(|s| ![s.x_m, s.y_m, s.yaw_rad].iter().all(|v| v.is_finite())) {
            return Err(InputError::new_err("start: expected finite x_m, y_m and yaw_rad"));
        }
        Ok(Self { path, world, start, expectations: expect.map(expectations_of).transpose()? })
    }

    /// As many simulated seconds at most, and who reads words and describes.
    pub(crate) fn within(mut self, time_limit_s: Option<f64>, backend: Option<String>) -> Self {
        (self.world.time_limit_s, self.world.backend) = (time_limit_s, backend);
        self
    }
}

/// Expectations as in episode files, as dictionaries.
fn expectations_of(expect: &Bound<'_, PyAny>) -> PyResult<Vec<Expectation>> {
    let expectations: Vec<Expectation> = from_python(expect, "expect")?;
    for (i, expectation) in expectations.iter().enumerate() {
        if let Some(flaw) = expectation.find_flaw() {
            return Err(InputError::new_err(format!("expect[{i}]: expected {flaw}")));
        }
    }
    Ok(expectations)
}

/// The run that is asked for: of an episode file, or of a scene alone.
pub(crate) fn spec_of(asked: Asked) -> Result<RunSpec, TaskError> {
    let Asked { path, world, start, expectations } = asked;
    let mut spec = if path.extension().is_some_and(|extension| extension == "toml") {
        prepare(&path, &world)?.0
    } else {
        of_scene(path, &world)?
    };
    if start.is_some() {
        spec.episode.start = start;
    }
    if let Some(expectations) = expectations {
        spec.episode.expectations = expectations;
    }
    Ok(spec)
}

fn of_scene(path: PathBuf, world: &WorldArgs) -> Result<RunSpec, TaskError> {
    let settings = Settings::resolve(world, None, &|_| false)?;
    let folder = if path.is_dir() { path.as_path() } else { path.parent().unwrap_or(&path) };
    let name = folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(RunSpec {
        robot: settings.robot.value,
        physics: settings.physics.value,
        perception: settings.perception.value,
        language: find_language(&settings.backend.value)?,
        seed: settings.seed.value,
        time_limit_s: settings.time_limit_s.value,
        ..RunSpec::new(name, Episode::new(path))
    })
}
