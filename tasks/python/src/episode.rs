//! Whole episodes, and the command line.

use crate::error::{InputError, raised};
use crate::interrupt::{Heeding, Interrupt};
use crate::plain::to_python;
use crate::plugged::{Plugs, plugged};
use crate::process::check_process;
use clap::ValueEnum;
use dsm_tasks::cli::{
    OutArgs, PerceptionChoice, PhysicsChoice, WorldArgs, prepare, prepare_folder, run_kept_and_write,
};
use dsm_tasks::error::TaskError;
use dsm_tasks::run::{Finished, RunSpec, run_kept};
use dsm_tasks::session::Keep;
use dsm_tasks::summary::Summary;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Runs the whole command line, as `python -m dsm` does, and gives the process exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| dsm_tasks::cli::start(words))
}

/// Runs one episode as `dsm run` does and gives its summary, as in `summary.json`.
#[pyfunction]
#[pyo3(signature = (path, *, seed=None, out=None, force=false, robot=None, physics=None, perception=None, backend=None, threads=None,
    time_limit_s=None, detector=None, language=None))]
pub(crate) fn run_episode<'py>(
    py: Python<'py>,
    path: PathBuf,
    seed: Option<u64>,
    out: Option<PathBuf>,
    force: bool,
    robot: Option<String>,
    physics: Option<&str>,
    perception: Option<&str>,
    backend: Option<String>,
    threads: Option<u16>,
    time_limit_s: Option<f64>,
    detector: Option<Py<PyAny>>,
    language: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    check_process()?;
    let world = WorldArgs {
        seed,
        robot,
        physics: physics.map(|name| choice::<PhysicsChoice>("physics", name)).transpose()?,
        perception: perception.map(|name| choice::<PerceptionChoice>("perception", name)).transpose()?,
        backend,
        threads,
        time_limit_s,
    };
    let out = out.map(|folder| OutArgs { out: Some(folder), force });
    let (plugs, interrupt) = (Plugs::new(py, detector, language)?, Interrupt::default());
    let ended = py.detach(|| run(&path, &world, out.as_ref(), plugs, &interrupt));
    interrupt.result()?;
    to_python(py, &ended.map_err(raised)?)
}

fn run(
    path: &Path,
    world: &WorldArgs,
    out: Option<&OutArgs>,
    plugs: Plugs,
    interrupt: &Interrupt,
) -> Result<Summary, TaskError> {
    let (mut spec, settings) = prepare(path, world)?;
    spec.language = plugged(spec.language, plugs, interrupt);
    if world.threads.is_some() {
        set_threads(settings.threads.value)?;
    }
    Ok(run_spec(&spec, out, interrupt)?.summary)
}

fn run_spec(spec: &RunSpec, out: Option<&OutArgs>, interrupt: &Interrupt) -> Result<Finished, TaskError> {
    let progress = Box::new(Heeding::new(interrupt.clone()));
    let keep = Keep::default();
    let Some(out) = out else {
        return run_kept(spec, None, keep, interrupt.flag.clone(), progress);
    };
    // Broken input is found before anything is written.
    dsm_tasks::assemble::check(spec)?;
    let folder = prepare_folder(out, Path::new(""))?;
    run_kept_and_write(spec, &folder, keep, interrupt.flag.clone(), progress)
}

/// Sets the number of worker threads, which a process does once.
fn set_threads(threads: u16) -> Result<(), TaskError> {
    let wanted = usize::from(threads);
    match rayon::ThreadPoolBuilder::new().num_threads(wanted).build_global() {
        Err(_) if rayon::current_num_threads() != wanted => Err(TaskError::Usage(format!(
            "threads is {threads}, but this process works with {} since its first run; they are set once",
            rayon::current_num_threads()
        ))),
        _ => Ok(()),
    }
}

/// A choice of the command line by its name.
pub(crate) fn choice<T: ValueEnum>(what: &str, name: &str) -> PyResult<T> {
    T::from_str(name, false).map_err(|_| {
        let known: Vec<String> =
            T::value_variants().iter().filter_map(T::to_possible_value).map(|v| v.get_name().to_owned()).collect();
        InputError::new_err(format!("{what} is `{name}`; expected one of: {}", known.join(", ")))
    })
}
