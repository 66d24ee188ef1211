//! The process that works: worker threads do not survive a fork.

use crate::error::RunError;
use pyo3::prelude::*;
use std::sync::OnceLock;

/// The process in which the worker threads were started; they are one set for each process, as rayon has it.
static STARTED_IN: OnceLock<u32> = OnceLock::new();

/// Refuses to work in a process that was forked off one that worked: its worker threads stayed behind, and it would wait
/// for them for ever.
pub(crate) fn check_process() -> PyResult<()> {
    let this = std::process::id();
    let started_in = *STARTED_IN.get_or_init(|| this);
    if started_in == this {
        return Ok(());
    }
    Err(RunError::new_err(format!(
        "process {this} was forked off process {started_in} after that had begun to work, and worker threads do not survive \
         a fork; start processes by `spawn` or `forkserver`, in Gymnasium by vector_kwargs={{\"context\": \"spawn\"}}"
    )))
}
