//! Recordings of runs for Python: their numbers as one array, their frames one after the other.

use crate::error::raised;
use crate::frame::Frame;
use crate::plain::to_python;
use dsm_tasks::error::TaskError;
use dsm_tasks::mcap_file::open_run;
use dsm_tasks::replay::{Entry, EntrySource, Table, Wanted, read_table};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A recording that `dsm run --record` has written. Its numbers are read at once, its frames when they are asked for.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct Recording {
    path: PathBuf,
    table: Table,
}

#[pymethods]
impl Recording {
    /// Opens a recording and reads its numbers.
    #[new]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = || {
            read_table(&mut *open_run(&path, Wanted::AllButFrames)?).map_err(|error| match error {
                TaskError::Usage(reason) => TaskError::Usage(format!("{}: {reason}", path.display())),
                other => other,
            })
        };
        let table = py.detach(read).map_err(raised)?;
        Ok(Self { path, table })
    }

    /// Episode, robot, seed and all else that is needed to run again.
    #[getter]
    fn head<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.table.head)
    }

    /// How the run ended as the robot itself knows it; None when the recording breaks off before.
    #[getter]
    fn end<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.table.end)
    }

    /// Names of the table's columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.table.columns.clone()
    }

    /// What was measured and sent, (periods, columns) of float64, NaN where nobody asked.
    #[getter]
    fn table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let columns = self.table.columns.len();
        let rows = self.table.values.len() / columns;
        PyArray1::from_slice(py, &self.table.values).reshape([rows, columns])
    }

    /// The frames in the order in which they were read, one at a time; of one camera when it is named.
    #[pyo3(signature = (camera=None))]
    fn frames(&self, camera: Option<String>) -> PyResult<RecordedFrames> {
        let source = open_run(&self.path, Wanted::All).map_err(raised)?;
        Ok(RecordedFrames { source: Mutex::new(source), camera })
    }
}

/// Frames on their way out of a recording.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct RecordedFrames {
    source: Mutex<Box<dyn EntrySource>>,
    camera: Option<String>,
}

#[pymethods]
impl RecordedFrames {
    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Frame>> {
        py.detach(|| self.find_next()).map_err(raised)
    }
}

impl RecordedFrames {
    fn find_next(&self) -> Result<Option<Frame>, TaskError> {
        let mut source = self.source.lock().unwrap_or_else(PoisonError::into_inner);
        while let Some(entry) = source.next_entry()? {
            if let Entry::Frame(frame) = entry
                && self.camera.as_deref().is_none_or(|camera| *camera == *frame.camera)
            {
                return Ok(Some(Frame::new(*frame)));
            }
        }
        Ok(None)
    }
}
