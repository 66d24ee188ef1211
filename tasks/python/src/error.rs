//! Errors as Python exceptions with the text that they have in Rust.

use dsm::store::StoreError;
use dsm_tasks::error::TaskError;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(dsm, Error, PyException, "What can go wrong outside a task; base of all errors of `dsm`.");
create_exception!(
    dsm,
    InputError,
    Error,
    "Bad input, or a part that is not built in; the text names file, line and what was expected."
);
create_exception!(
    dsm,
    RunError,
    Error,
    "A driver failed, the emergency stop is latched, or the program contradicts itself."
);

/// The exception for an error: by its exit code bad input, or a run that broke.
pub(crate) fn raised(error: TaskError) -> PyErr {
    match error.exit_code() {
        2 => InputError::new_err(error.to_string()),
        _ => RunError::new_err(error.to_string()),
    }
}

/// As [`raised`], for files.
pub(crate) fn raised_by_store(error: StoreError) -> PyErr {
    raised(error.into())
}
